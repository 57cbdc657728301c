"""Mass scaling: slow motions in fewer steps, true weights and temperatures, what is told, what is refused."""

import numpy as np
import pytest
from solids import COPPER, run_into, run_to_end, simulation, tables

from parsolid.materials.registry import law_of, laws_of
from parsolid.scene import parse_scene
from parsolid.scene.validation_errors import SceneError

# plane strain without lateral strain is uniaxial: E u'' = rho g
STEEL = {"kind": "neo-hookean", "density": 8000.0, "youngs_modulus": 2e7, "poissons_ratio": 0.0}
WEIGHT, LENGTH, WIDTH = 8000.0 * 20.0, 1.0, 0.5
STRETCH = WEIGHT * LENGTH**2 / (2.0 * STEEL["youngs_modulus"])
METHODS = {
    "tlsph": {"kind": "tlsph"},
    "ssp-rk3": {"kind": "tlsph", "integrator": "ssp-rk3"},
    "peridynamics": {"kind": "peridynamics"},
    "mpm": {"kind": "mpm", "cell": 0.125},
}


def hanging(method, factor=None, end_time=3.0):
    """A bar under its own weight, which grows smoothly."""
    place = {"plane": "X = 0"}
    if method["kind"] == "peridynamics":
        place = {"box": {"lower": [0.0, 0.0], "upper": [1e-3, WIDTH]}}
    data = tables(
        (16, 8) if method["kind"] == "mpm" else (17, 9), (LENGTH, WIDTH), material=STEEL, end_time=end_time,
        boundaries=[{"kind": "velocity", "velocity": ["0", "free"], "name": "top", "reaction": True, **place}],
        loads={"acceleration": [f"10*(1 - cos(pi*t/{end_time}))", "0"]},
    )  # fmt: skip
    return data | {"method": method | ({} if factor is None else {"mass_scaling": factor})}


@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS)
def test_a_slow_motion_takes_fewer_steps_to_the_same_state_and_bears_the_true_weight(comm, method):
    """The step grows by the root of the factor, the support bears the weight, and particles hang where the exact
    solution has them, in tlsph with weights that close."""
    sim, _ = run_to_end(hanging(METHODS[method], 25.0), comm)
    (system,) = sim.systems
    assert system.reaction("top")[0] == pytest.approx(-WEIGHT * LENGTH * WIDTH, rel=0.01)
    scaled, one = (simulation(hanging(METHODS[method], factor), comm).stable_step() for factor in (25.0, None))
    assert scaled == pytest.approx(5.0 * one, rel=1e-3)
    x, X = (system.particles.owned_rows(name)[:, 0] for name in ("position", "reference_position"))
    if method == "tlsph":
        exact = STRETCH * (1.0 - (1.0 - X / LENGTH) ** 2)
        assert np.abs(x - X - exact).max() < 0.01 * STRETCH


@pytest.mark.serial
@pytest.mark.parametrize(("end_time", "word"), [(3.0, "ok"), (0.25, "inapplicable")])
def test_added_mass_and_kinetic_share_are_told(shared_path, comm, end_time, word):
    """A load that grows within half the first period of the scaled bar is not slow."""
    job = run_into(shared_path, comm, parse_scene(hanging(METHODS["tlsph"], 25.0, end_time)))
    told = job.summary("finished")
    mass = STEEL["density"] * LENGTH * WIDTH
    assert told["mass"] == pytest.approx(mass) and told["added_mass"] == pytest.approx(24.0 * mass)
    assert (told["kinetic_share"] > 0.05) == (word != "ok") and told["energy_check"] == word
    assert told["energy_check_code"] == (None if word == "ok" else "scaled-inertia")


def test_heat_warms_as_much():
    for capacity in ({}, {"specific_heat_slope": 0.1}):
        data = tables((3, 3), material=COPPER | capacity, method={"mass_scaling": 100.0, "integrator": "leapfrog"})
        scene = parse_scene(data)
        (law,), own = laws_of(scene), law_of(scene.bodies[0].material, "plane-strain")
        assert law.density == pytest.approx(100.0 * own.density)
        assert law.temperature_rise(300.0, 1e9) == pytest.approx(own.temperature_rise(300.0, 1e9))


@pytest.mark.parametrize(
    "method",
    [
        {"kind": "tlsph", "integrator": "static", "weights": "cells"},
        {"kind": "tlsph", "integrator": "implicit", "weights": "cells"},
        {"kind": "peridynamics", "solution": {"kind": "quasi-static", "step": 0.1}},
        {"kind": "mpm", "cell": 0.25, "motion": False},
        {"kind": "ulsph"},
    ],
)
def test_it_is_refused_where_no_wave_bounds_the_step(method):
    with pytest.raises(SceneError) as fault:
        parse_scene(hanging(method, 4.0))
    assert any("mass_scaling" in str(one) for one in fault.value.args)
