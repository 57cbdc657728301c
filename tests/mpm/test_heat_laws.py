"""A specific heat that depends on the temperature, a conductivity that depends on the direction, and the second law."""

import numpy as np
import pytest
from mpm.points import COPPER, scene, taylor_bar
from scipy.integrate import quad
from solids import Record, StepsToEnd, follow, simulation

from parsolid.materials.plastic.elastic_plastic import of_material
from parsolid.methods.mpm import heat as grid_heat
from parsolid.point.plastic import PlasticPoint
from parsolid.scene import parse_scene

SLOPE = 383.0 * 2.5e-4
WARMER = COPPER | {"specific_heat_slope": SLOPE}
WITHOUT = {key: value for key, value in COPPER.items() if key != "specific_heat"}
BY_POINTS = WITHOUT | {"heat_capacity": {"temperature": [250, 400, 700], "value": [380.0, 410.0, 425.0]}}
BY_FORMULA = WITHOUT | {"heat_capacity": {"formula": "420 - 1.2e6/T**2 + 0.02*T", "between": [150, 1300]}}


def block(material, end_time=1.0, **rest) -> dict:
    """4 x 4 cells of a millimetre, insulated at planes of symmetry."""
    planes = [{"kind": "roller", "plane": f"{axis} = {place}"} for axis in "XY" for place in (0.0, 4e-3)]
    return scene([0.0] * 2, [4e-3] * 2, 5e-4, 1e-3, material=material, end_time=end_time, boundaries=planes, **rest)


def law_of(material):
    return of_material(parse_scene(block(material)).bodies[0].material)


def stated_heat(material, T) -> float:
    """C_v [J/(kg K)] at a temperature [K] as the material says it."""
    stated = material.get("heat_capacity", {})
    if "formula" in stated:
        return 420.0 - 1.2e6 / T**2 + 0.02 * T
    if stated:
        return float(np.interp(T, stated["temperature"], stated["value"]))
    return 383.0 + SLOPE * (T - 300.0)


@pytest.mark.parametrize("material", [WARMER, BY_POINTS, BY_FORMULA], ids=["line", "points", "formula"])
def test_the_energy_of_a_temperature_is_the_integral_of_the_specific_heat(material):
    law, T, corners = law_of(material), 900.0, [250.0, 400.0, 700.0]
    wanted = law.density * quad(lambda x: stated_heat(material, x), 300.0, T, points=corners)[0]
    # a formula is kept by points
    assert law.internal_energy(T) == pytest.approx(wanted, rel=1e-4 if material is BY_FORMULA else 1e-12)
    entropy = quad(lambda x: stated_heat(material, x) / x, 300.0, T, points=corners)[0]
    assert law.entropy(T, 1.0) == pytest.approx(entropy, rel=1e-4 if material is BY_FORMULA else 1e-12)
    data = block(material, 1e-3, method={"motion": False}, loads={"heat_source": law.internal_energy(T) / 1e-3})
    sim = simulation(data)
    # the first step is the whole time: what a particle gets is the integral, however long the step
    sim.take_step(1e-3)
    np.testing.assert_allclose(sim.systems[0].particles.owned_rows("temperature"), T, rtol=1e-12)


def test_heat_from_outside_warms_light_points():
    """Points of 2 g/m, which contact gives heat, but for deleted ones, which take none."""
    sim = simulation(block(COPPER))
    system, rows = sim.systems[0], np.array([3, 0, 5])
    own, heat = system.particles.owned_rows, np.array([0.1, 0.3, 0.7])
    before, mass = own("temperature")[rows], system.mass[rows]
    system.points.motion[5, 3] = 0.0
    assert system.take_heat(heat, rows) == pytest.approx(0.4, rel=1e-12)
    rise = heat / (383.0 * mass) * (1.0, 1.0, 0.0)
    np.testing.assert_allclose(own("temperature")[rows] - before, rise, rtol=1e-12)


@pytest.mark.parametrize("material", [WARMER, BY_POINTS], ids=["line", "points"])
def test_plastic_heat_raises_the_temperature_by_the_integral(material, plain_python):
    law = law_of(material | {"flow_stress": {"kind": "linear-hardening", "yield_stress": 2e9}})
    point = PlasticPoint(law)
    state = point.initial_state()
    for shear in np.linspace(0.1, 2.0, 20):
        state = point.updated(state, np.eye(3) + shear * np.outer([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), 1e-6)
    assert state.temperature > 850.0
    found = law.internal_energy(state.temperature)
    assert found == pytest.approx(0.9 * state.plastic_work, rel=1e-10)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_mode_decays_by_the_conductivity_of_its_direction(axis):
    along, length, time = [300.0, 60.0], 4e-3, 8e-3
    body = {"temperature": f"300 + 40*cos(pi*{'XY'[axis]}/{length})"}
    decay = np.exp(-((np.pi / length) ** 2) * along[axis] / (8930.0 * 383.0) * time)
    for heat, error in (
        ({"conductivity_tensor": [*along, 10.0, 0.0, 0.0, 0.0]}, 3.5),
        ({"conductivity": along[axis]}, 0.5),
    ):
        sim = simulation(block(COPPER | heat, method={"motion": False}, body=body))
        for _ in range(20):
            sim.take_step(time / 20)
        rows = sim.systems[0].particles.owned_rows
        wanted = 300.0 + 40.0 * decay * np.cos(np.pi * rows("reference_position")[:, axis] / length)
        # four cells a half wave
        np.testing.assert_allclose(rows("temperature"), wanted, rtol=0.0, atol=error)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_axes_of_a_conductivity_turn_with_the_matter(dimension):
    """R kappa R^T times the volume, R of F = R U."""
    components = (300.0, 60.0, 10.0, 20.0, *((0.0, 0.0) if dimension == 2 else (5.0, -3.0)))
    xx, yy, zz, xy, xz, yz = components
    kappa = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    R = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    U = np.array([[1.2, 0.1, 0.0], [0.1, 0.9, 0.0], [0.0, 0.0, 1.1]])
    F, motion, tensors = R @ U, np.zeros((4, 8)), np.zeros((4, 8))
    rows = F.ravel() if dimension == 3 else F[[0, 0, 1, 1, 2], [0, 1, 0, 1, 2]]
    deformation = np.zeros((len(rows), 4))
    deformation[:], motion[:, 7] = rows[:, None], 2.0
    grid_heat.turn_conductivities(0, 1, components, deformation, motion, tensors)
    wanted = 2.0 * np.linalg.det(F) * R @ kappa @ R.T
    found = tensors[0, [0, 1, 2, 6, 5, 4]]
    np.testing.assert_allclose(found, wanted[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], rtol=1e-12, atol=1e-12)


def entropies(data) -> np.ndarray:
    """Of all particles [J/K] at the start and after every step."""

    def entropy(sim):
        return {"entropy": sim.comm.allreduce(sim.systems[0].points.entropy())}

    sim = simulation(data)
    start = entropy(sim)["entropy"]
    return np.append(start, follow(sim, Record(entropy), policy=StepsToEnd)["entropy"])


def test_entropy_never_falls():
    """In a bar that flows and heats itself, in a shock, and in a body that conducts and is otherwise left alone."""
    shocked = COPPER | {
        "equation_of_state": {"kind": "mie-grueneisen", "sound_speed": 3940.0, "slope": 1.489, "gamma": 2.02}
    }
    shock = block(shocked, 4e-7, body={"velocity": [-500.0, 0.0]})
    shock["method"].pop("viscosity")
    shock["boundaries"] = [plane for plane in shock["boundaries"] if plane["plane"] != "X = 0.004"]
    warm = {"temperature": "300 + 40*cos(pi*X/4e-3)"}
    conducting = block(COPPER | {"conductivity": 386.0}, 0.02, method={"motion": False}, body=warm)
    for data, grown in ((taylor_bar(1.6e-3), 0.02), (shock, 1e-3), (conducting, 1e-4)):
        found = entropies(data)
        assert np.diff(found).min() >= -1e-12 * np.abs(found).max() and found[-1] - found[0] > grown
