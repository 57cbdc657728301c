"""A body that starts at another temperature than its law's reference: free of stress, or heated at constant volume."""

import numpy as np
import pytest
from mpm.points import COPPER, scene
from solids import run_to_end, simulation

from parsolid.scene import SceneError

HOT = COPPER | {"equation_of_state": {"kind": "mie-grueneisen", "sound_speed": 3940.0, "slope": 1.489, "gamma": 2.02}}


def bar(**body) -> dict:
    """A free bar of copper, 4 x 16 particles."""
    return scene([0.0, 0.0], [1e-3, 4e-3], 2.5e-4, 5e-4, material=HOT, end_time=1e-5, body=body)


@pytest.mark.serial
def test_a_hot_bar_is_free_of_stress(comm):
    sim, columns = run_to_end(bar(temperature=1235.0), comm)
    rows = sim.systems[0].particles.owned_rows
    np.testing.assert_array_equal(rows("position"), rows("reference_position")[:, :2])
    np.testing.assert_array_equal(rows("temperature"), 1235.0)
    assert np.abs(columns["energy_error"]).max() == 0.0 and (columns["internal_energy"] == 0.0).all()


@pytest.mark.serial
def test_heating_at_constant_volume_is_a_pressure(comm):
    """gamma rho C_v (T - T0), of the whole body before anything moves."""
    sim = simulation(bar(temperature=1235.0, thermal_reference="at-constant-volume"), comm)
    stress = sim.systems[0].particles.owned_rows("stress_and_volume")
    pressure = 2.02 * 8930.0 * 383.0 * (1235.0 - 300.0)
    volume = sim.systems[0].points["grid_volume"][: len(stress)]
    np.testing.assert_allclose(stress[:, 0], -pressure * volume, rtol=1e-12)


@pytest.mark.serial
@pytest.mark.parametrize(
    "body, key",
    [
        ({"temperature": "300 - 1e6*Y"}, "bodies.0.temperature"),
        ({"thermal_reference": "at-constant-volume"}, "bodies.0.thermal_reference"),
    ],
)
def test_what_is_no_start_is_refused(comm, body, key):
    with pytest.raises(SceneError, match=key):
        simulation(bar(**body), comm)
