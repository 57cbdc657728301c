"""Solutions with delayed heat and micro-inertia: published values, differential equations, an independent solver."""

from types import SimpleNamespace

import numpy as np
import pytest

from parsolid.exact.heat import DelayedHeat
from parsolid.exact.micro_inertia import ElasticImpact, MicroLayer, MicroWave
from parsolid.materials.plastic.micro_inertia import StatedMicroInertia
from parsolid.scene.materials import library_of_micro_inertia

STEEL = library_of_micro_inertia()["4340 steel, Rahaman"]
# heat waves of 1000 m/s
DELAYED = SimpleNamespace(conductivity=3734910.0, density=7830.0, specific_heat=477.0, heat_relaxation_time=1e-6)


def law(**changes):
    """Table 1 without l2, l3 and conduction, but for changes."""
    left_out = dict.fromkeys(
        ("hardening_length", "dissipative_length", "flux_relaxation_time", "conductivity", "heat_relaxation_time"), 0.0
    )
    stated = SimpleNamespace(
        **{"shear_modulus": None, "bulk_modulus": None, "regularisation": 1e-2, "initial_micro_stress": 0.0}
        | {key: value for key, value in STEEL.items() if key != "source"}
        | left_out
        | changes
    )
    return StatedMicroInertia.micro_inertia_law(stated)


def along(axis: int, values) -> np.ndarray:
    places = np.zeros((len(values), 2))
    places[:, axis] = values
    return places


def test_delayed_mode_has_the_published_amplitudes():
    solution = DelayedHeat(298.0, DELAYED, 0.01, np.array([2.0]), np.array([1.0]))
    found = [solution.decay(time)[0] for time in (1e-6, 2e-6, 4e-6)]
    np.testing.assert_allclose(found, [0.8591499749, 0.5997809251, 0.1842232860], rtol=1e-8)


@pytest.mark.parametrize("mode, time", [(2.0, 1.5e-6), (0.5, 3e-6), (0.1, 2e-6)])
def test_delayed_modes_obey_their_equation(mode, time):
    """t_q T'' + T' + alpha k^2 T = 0, oscillating (2), nearly critical (0.5: w t_q = 0.04) and overdamped (0.1)."""
    solution = DelayedHeat(0.0, DELAYED, 0.01 * np.pi, np.array([mode * 10.0]), np.array([1.0]))
    step = 1e-9
    before, now, after = (solution.decay(time + offset)[0] for offset in (-step, 0.0, step))
    inertia, rate = 1e-6 * (after - 2.0 * now + before) / step**2, (after - before) / (2.0 * step)
    restoring = solution.diffusivity * solution.wave_numbers[0] ** 2 * now
    assert inertia + rate + restoring == pytest.approx(0.0, abs=2e-4 * max(abs(restoring), abs(rate)))
    assert solution.decay(0.0)[0] == pytest.approx(1.0, abs=1e-9)


def test_elastic_impact_is_that_of_table_1():
    """21.88 MPa of |S| and 45.3 MPa of stress a m/s."""
    solution = ElasticImpact(law(), 0.0254, 208.0)
    assert solution.wave_speed == pytest.approx(5785.5, rel=1e-5)
    assert solution.deviator / 208.0 == pytest.approx(21.88e6, rel=1e-3)
    assert solution.stress == pytest.approx(-7830.0 * 5785.5 * 208.0, rel=1e-5)


def test_free_layer_flows_as_a_material_point():
    """gamma and pi of an event-driven solver at 1e4/s; from 2.32 us on the point slides at |S| = 0.

    G starts as v^0.2, which costs the differences some of the micro-stress.
    """
    layer = MicroLayer(law(), 1e-3, 1e4, clamped=False, end=3e-6)
    layer.nodes, layer.spacing = 5, 2.5e-4
    middle = along(1, [0.3e-3])
    for time, strain, stress, close, near in (
        (1e-6, 0.00206048326, 36114068.5, 1e-5, 2e-4),
        (2e-6, 0.0121027098, 90981163.9, 1e-5, 2e-4),
        (3e-6, 0.0251782385, 148932961.0, 1e-3, 1e-3),
    ):
        found = layer.fields(middle, time)
        assert found["plastic_strain"][0] == pytest.approx(strain, rel=close)
        assert found["micro_stress"][0] == pytest.approx(stress, rel=near)


def test_differences_across_the_layer_carry_the_micro_wave():
    """What both solutions can do: shear at one rate, small strains, pi = 0."""
    steel = law(stress_relaxation_time=1e3, energetic_length=2e-3)
    wave = MicroWave(steel, 1e-3, 2.0, (100.0, 0.0))
    layer = MicroLayer(steel, 1e-3, 100.0, clamped=False, end=1e-6)
    layer.nodes, layer.spacing = 5, 2.5e-4
    place = along(1, [0.4e-3])
    found, exact = (one.fields(place, 1e-6)["plastic_strain"][0] for one in (layer, wave))
    assert found == pytest.approx(exact, rel=1e-4)


def test_micro_wave_obeys_its_equation():
    """rho l_m^2 v'' = 2 mu (D - v) + S0 l1^2 v,yy at a place, D the prescribed rate over sqrt(2)."""
    steel = law(energetic_length=2e-3)
    wave = MicroWave(steel, 1e-3, 2.0, (100.0, 40.0))
    y, time, step, width = 0.2e-3, 0.7e-6, 1e-9, 1e-6

    def rate(place: float, instant: float) -> float:
        return float(wave.fields(along(1, [place]), instant)["micro_rate"][0])

    now = rate(y, time)
    inertia = (rate(y, time + step) - 2.0 * now + rate(y, time - step)) / step**2
    bend = (rate(y + width, time) - 2.0 * now + rate(y - width, time)) / width**2
    driven = (100.0 + 40.0 * np.cos(wave.wave_number * y)) / np.sqrt(2.0) - now
    right = 2.0 * steel.shear_modulus * driven + steel.yield_stress * steel.energetic_length**2 * bend
    assert steel.density * steel.inertia_length**2 * inertia == pytest.approx(right, rel=1e-4)
    assert rate(y, 0.0) == 0.0


def test_clamped_walls_do_not_flow_and_converge():
    """The middle of a layer of 81 nodes lies within 1e-3 of that of 161."""
    steel, place = law(energetic_length=2e-4, initial_micro_stress=792e6), along(1, [0.0, 0.1e-3, 0.5e-3])
    found = []
    for nodes in (41, 81):
        layer = MicroLayer(steel, 1e-3, 5e3, clamped=True, end=4e-6)
        layer.nodes, layer.spacing, layer.step = nodes, 1e-3 / (nodes - 1), 4e-9
        found.append(layer.fields(place, 4e-6)["plastic_strain"])
    assert found[1][0] == 0.0 and found[1][1] < found[1][2]
    np.testing.assert_allclose(found[0][1:], found[1][1:], rtol=3e-3)
