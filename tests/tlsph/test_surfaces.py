"""Supports and loads on surfaces with a name: exact motions, closed-form solutions, forces and the ledger's work."""

import itertools

import numpy as np
import pytest
from grouped_meshes import block, ring, uneven_ring
from solids import SOFT, Record, follow, gathered, run_steps, run_to_end, simulation, tables

from parsolid.collective import SolverError
from parsolid.pairs.closure import Closure
from parsolid.simulation.time_step import TimeSteps

BOTH = ({}, {"integrator": "leapfrog"})
TURN = {"kind": "rotation", "where": "bottom", "centre": [0.5, 0.0], "angle": "0.3*ramp(t, 0.1, 0.4)*t"}


def on_mesh(file: str, boundaries, end_time=0.5, material=SOFT, method=None, **rest) -> dict:
    """Raw tables of a body with a mesh."""
    data = tables((2, 2), material=material, method=method, end_time=end_time, boundaries=list(boundaries), **rest)
    data["bodies"] = [{"shape": {"mesh": {"file": file}}, "material": material}]
    return data


def told(*names):
    """Forces and moments of a simulation on all ranks."""

    def more(sim) -> dict:
        mine = {name: sim.systems[0].reaction(name) for name in names}
        return {name: sim.comm.allreduce(np.array(value)) for name, value in mine.items()}

    return more


@pytest.mark.parametrize("method", BOTH, ids=str)
def test_a_rotation_is_exact_in_time_and_its_work_is_booked(method):
    low, high = {"name": "bottom", "plane": "Y = 0"}, {"name": "top", "formula": "Y > 0.999"}
    turn = TURN | {"name": "bottom", "reaction": True, "moment_about": [0.5, 0.0]}
    held = {"kind": "fixed", "where": "top", "name": "top", "reaction": True}
    data = tables((9, 9), method=method, end_time=0.5, boundaries=[turn, held], regions=[low, high])
    sim = simulation(data)
    rows = follow(sim, Record(told("bottom", "top")), policy=TimeSteps)
    X, x = gathered(sim, "reference_position", "position")
    angle = 0.3 * 0.5
    turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    here = X[:, 1] == 0.0
    np.testing.assert_allclose(x[here], [0.5, 0.0] + (X[here] - [0.5, 0.0]) @ turned.T, atol=1e-15)
    np.testing.assert_allclose(x[X[:, 1] > 0.999], X[X[:, 1] > 0.999], atol=1e-15)
    np.testing.assert_allclose(rows["bottom.work"], rows["external_work"], rtol=1e-12)
    assert not rows["top.work"].any() and rows["external_work"][-1] > 1e-4
    # a kink of the angle is landed on: no step has both slopes
    assert {0.1, 0.4} <= set(rows["time"])
    assert abs(rows["energy_error"][-1]) < 2e-3 * rows["external_work"][-1]
    # work is force times motion: the moment by the angle, of which the rest is inertia
    moments = np.array(list(rows["bottom"]))[:, 2]
    angles = 0.3 * np.clip((rows["time"] - 0.1) / 0.3, 0, 1) * rows["time"]
    assert moments[1:] @ np.diff(angles) == pytest.approx(rows["external_work"][-1], rel=0.05)


@pytest.mark.parametrize("method", BOTH, ids=str)
def test_forces_of_all_conditions_are_the_change_of_momentum(method, tmp_path):
    """Sum of forces and moments times the step, and of loads, is the change of momentum and angular momentum."""
    on = [
        {"kind": "fixed", "where": "side", "name": "side", "reaction": True},
        {"kind": "roller", "where": "bottom", "name": "bottom", "reaction": True},
        {"kind": "pressure", "where": "top", "pressure": "0.2*step(t, 0.05)", "name": "top", "reaction": True},
        {"kind": "spring", "where": "top", "stiffness": 2.0, "damping": 0.3, "name": "spring", "reaction": True},
        {"kind": "traction", "where": "top", "traction": [0.1, "t"], "name": "pull", "reaction": True},
        {"kind": "rotation", "where": "corner", "centre": [1.0, 0.0], "angle": "t", "name": "turn", "reaction": True},
    ]
    regions = [{"name": "corner", "formula": "(X > 0.9) & (Y > 0.3) & (Y < 0.4)"}]
    sim = simulation(on_mesh(block(tmp_path / "m.msh", 0.0), on, method=method, regions=regions))
    system, names = sim.systems[0], [one["name"] for one in on]
    weight = (system.mass * system.share)[:, None]

    def momentum():
        x, v = system.particles.owned_rows("position"), system.particles.owned_rows("velocity")
        return np.append((weight * v).sum(axis=0), (weight[:, 0] * (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])).sum())

    for _ in range(3):
        sim.take_step(0.02)
    before, ledger = momentum(), np.array(sim.ledger.values)
    sim.take_step(0.01)
    found = np.sum([system.reaction(name) for name in names], axis=0)
    assert np.abs(found[:2]).max() > 0.05
    # stages have other places: moments are those of the motion but for terms of higher order
    tolerance = [1e-12, 1e-12, 2e-4]
    assert np.all(np.abs(found * 0.01 - (momentum() - before)) < tolerance)
    change = np.array(sim.ledger.values) - ledger
    assert change[-len(names) :].sum() == pytest.approx(change[2], rel=1e-9)


@pytest.mark.parametrize("kind", ["roller", "antisymmetric"])
def test_what_a_slide_holds_does_not_move(kind, tmp_path):
    slides = [{"kind": kind, "where": "bottom"}, {"kind": "roller", "where": "side"}]
    push = {"kind": "traction", "where": "top", "traction": [0.3, -0.2]}
    file = block(tmp_path / "m.msh", 0.0)
    sim, _ = run_steps(on_mesh(file, [*slides, push]), 30)
    X, x = gathered(sim, "reference_position", "position")
    held = 1 if kind == "roller" else 0
    bottom, side = X[:, 1] == 0.0, X[:, 0] == 0.0
    assert np.abs((x - X)[bottom, held]).max() < 1e-15 < np.abs((x - X)[bottom, 1 - held]).max()
    assert np.abs((x - X)[side, 0]).max() < 1e-15
    planes = [{"kind": kind, "plane": "Y = 0"}, {"kind": "roller", "plane": "X = 0"}]
    clamped, _ = run_steps(on_mesh(file, [*({**one, "mirror": False} for one in planes), push]), 30)
    np.testing.assert_allclose(x, gathered(clamped, "position")[0], rtol=0, atol=1e-13)


def smoothly(end: float) -> str:
    return f"(1 - cos(pi*ramp(t, 0, {0.8 * end})))/2"


RUBBER = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 3e6, "poissons_ratio": 0.45}
SHEAR, INNER, OUTER = 3e6 / 2.9, 0.01, 0.02
END = 20 * (OUTER - INNER) / np.sqrt(SHEAR / 1000.0)


@pytest.mark.slow
def test_the_torque_of_a_bushing_is_the_exact_one_at_small_angles(tmp_path):
    """In-plane torsion of a ring between rigid walls: M = 4 pi mu angle / (1/a^2 - 1/b^2) per thickness."""
    angle = 0.01
    turn = {"kind": "rotation", "where": "bore", "centre": [0, 0], "angle": f"{angle}*{smoothly(END)}"}
    on = [
        turn | {"name": "bore", "reaction": True},
        {"kind": "fixed", "where": "outside", "name": "out", "reaction": True},
    ]
    data = on_mesh(ring(tmp_path / "m.msh", INNER, OUTER, 6), on, END, RUBBER, {"weights": "closure"})
    _, rows = run_to_end(data, more=told("bore", "out"))
    exact = 4.0 * np.pi * SHEAR * angle / (1.0 / INNER**2 - 1.0 / OUTER**2)
    late = rows["time"] > 0.8 * END
    for name, sign in (("bore", 1.0), ("out", -1.0)):
        moment = np.array(list(rows[name]))[late, 2].mean()
        assert sign * moment == pytest.approx(exact, rel=0.02)
    assert rows["external_work"][-1] == pytest.approx(0.5 * exact * angle, rel=0.02)
    assert rows["bore.work"][-1] == pytest.approx(rows["external_work"][-1], rel=1e-12)


def test_pressure_in_a_ring_gives_the_displacement_of_lame(tmp_path):
    pressure = 1e-3 * SHEAR
    on = [{"kind": "pressure", "where": "bore", "pressure": f"{pressure}*{smoothly(END)}"}]
    data = on_mesh(ring(tmp_path / "m.msh", INNER, OUTER, 6), on, END, RUBBER, {"weights": "closure"})
    sim, _ = run_to_end(data)
    X, x = gathered(sim, "reference_position", "position")
    r = np.linalg.norm(X, axis=1)
    found = np.linalg.norm(x, axis=1) - r
    exact = pressure * INNER**2 / (OUTER**2 - INNER**2) / (2 * SHEAR) * (0.1 * r + OUTER**2 / r)
    assert np.sqrt(np.mean((found - exact) ** 2) / np.mean(exact**2)) < 0.02


def test_pressure_on_all_sides_turned_with_the_body_pushes_nowhere():
    """Of a body turned as a whole the pressure turns along: no net force or moment."""
    turned = [["cos(1)", "-sin(1)"], ["sin(1)", "cos(1)"]]
    moved = ["X*(cos(1) - 1) - Y*sin(1)", "X*sin(1) + Y*(cos(1) - 1)"]
    body = {"deformation_gradient": turned, "displacement": moved}
    press = {"kind": "pressure", "where": "all", "pressure": 0.5, "name": "press", "reaction": True}
    everywhere = {"name": "all", "formula": "X > -1"}
    sim = simulation(tables((5, 9), [1.0, 2.0], body=body, boundaries=[press], regions=[everywhere]))
    sim.take_step(1e-6)
    assert np.abs(sim.systems[0].reaction("press")).max() < 1e-6
    loads = sim.systems[0].conditions.find_loads(0.0).T
    X = sim.systems[0].particles.owned_rows("reference_position")
    # on the side X = 1 the force is along the turned normal
    side = (X[:, 0] == 1.0) & (X[:, 1] > 0.1) & (X[:, 1] < 1.9)
    np.testing.assert_allclose(loads[side], np.tile([-0.125 * np.cos(1), -0.125 * np.sin(1)], (7, 1)), atol=1e-5)


@pytest.mark.parametrize("method", BOTH, ids=str)
def test_a_stiff_body_on_springs_swings_with_their_frequency(method):
    stiff = SOFT | {"youngs_modulus": 3000.0}
    spring = {"kind": "spring", "where": "low", "stiffness": 0.7, "along": "normal"}
    data = tables(
        (5, 5), material=stiff, method=method, end_time=2.0, boundaries=[spring], body={"velocity": ["0", "0.01"]}
    )
    data["regions"] = [{"name": "low", "plane": {"point": [0.0, 0.0], "normal": [0.0, 2.0]}}]
    sim, rows = run_to_end(data)
    omega = np.sqrt(0.7 / 1.1)
    X, x = gathered(sim, "reference_position", "position")
    assert (x - X)[:, 1].mean() == pytest.approx(0.01 / omega * np.sin(2.0 * omega), rel=2e-3)
    assert abs(rows["energy_error"][-1]) < 1e-4 * rows["kinetic"][0]
    assert rows["external_work"][-1] == pytest.approx(-0.5 * 0.7 * (0.01 / omega * np.sin(2 * omega)) ** 2, rel=5e-3)


def test_weights_of_an_uneven_mesh_close_or_say_what_helps(tmp_path, monkeypatch):
    """Of random nodes at 0.4 spacings and more whole passes lead away from closed weights, and parts of them do not."""
    data = on_mesh(uneven_ring(tmp_path / "m.msh", 0.1, 0.4, 2), [], method={"weights": "closure"})
    simulation(data)
    distances = itertools.count(0, -1)
    monkeypatch.setattr(Closure, "distance", lambda self, correction: next(distances))
    with pytest.raises(SolverError, match="elements much smaller or flatter than their neighbours, or method.weights"):
        simulation(data)
