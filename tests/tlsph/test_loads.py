"""Body forces, tractions and prescribed velocities: exact motions, and work that closes the energy balance."""

import numpy as np
import pytest
from scipy.optimize import brentq
from solids import ONE_BRANCH, SOFT, evaluate, simulation, supports, tables


def bar(dimension, boundaries=(), loads=None, particles=None, material=SOFT, **body) -> dict:
    """A bar along X of length 2."""
    particles = particles or {2: (9, 5), 3: (7, 4, 4)}[dimension]
    return tables(
        particles,
        [2.0, 1.0, 0.8][:dimension],
        material=material,
        body=body,
        boundaries=list(boundaries),
        loads=loads or {},
    )


def advanced(data: dict, step: float, steps: int):
    sim = simulation(data)
    for _ in range(steps):
        sim.take_step(step)
    return sim


@pytest.mark.parametrize("load", ["acceleration", "body_force"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_free_fall(dimension, load):
    g = np.array([1.5, -9.81, 0.7])[:dimension]
    scale = 1.0 if load == "acceleration" else SOFT["density"]
    sim = advanced(bar(dimension, loads={load: list(scale * g)}), 0.02, 25)
    table, t = sim.systems[0].particles, 0.5
    np.testing.assert_allclose(table.owned_rows("velocity"), np.tile(g * t, (sim.systems[0].owned, 1)), rtol=1e-12)
    fallen = table.owned_rows("position") - table.owned_rows("reference_position")
    np.testing.assert_allclose(fallen, np.tile(0.5 * g * t * t, (sim.systems[0].owned, 1)), rtol=1e-12)
    mass = sim.systems[0].mass @ sim.systems[0].share
    row = sim.ledger.row(sim.comm, *sim.systems[0].energies())
    assert row["kinetic"] == pytest.approx(0.5 * mass * t * t * g @ g, rel=1e-12)
    assert row["external_work"] == pytest.approx(row["kinetic"], rel=1e-12)
    assert abs(row["strain_energy"]) < 1e-12 * row["kinetic"]


def test_a_force_cubic_in_time_gives_the_exact_velocity():
    # the stages are at 0, 1 and 1/2 of the step with Simpson's weights
    sim = advanced(bar(2, loads={"acceleration": ["4*t**3", "1 - t"]}), 0.05, 20)
    np.testing.assert_allclose(
        sim.systems[0].particles.owned_rows("velocity"), np.tile([1.0, 0.5], (sim.systems[0].owned, 1)), rtol=1e-12
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_momentum_of_a_free_bar_is_traction_times_area_times_time(dimension):
    traction = [0.3, -0.2, 0.1][:dimension]
    data = bar(
        dimension,
        [{"plane": "X = 2", "kind": "traction", "traction": traction}],
        material={**SOFT, "branches": ONE_BRANCH},
    )
    sim = advanced(data, 0.01, 30)
    area = 1.0 if dimension == 2 else 0.8
    momentum = (sim.systems[0].mass * sim.systems[0].share) @ sim.systems[0].particles.owned_rows("velocity")
    np.testing.assert_allclose(momentum, np.array(traction) * area * 0.3, rtol=1e-12)


def stretched(dimension, stretch: float, sim) -> tuple[float, np.ndarray]:
    """(P_11, F) of uniaxial stress in a neo-Hookean bar."""
    law = sim.systems[0].blocks[0].law

    def stress(side, across):
        F = np.diag([stretch, side, side if dimension == 3 else 1.0])
        J = np.linalg.det(F)
        sigma_J = law.lambda_hat * (J - 1.0) - 2.0 * law.xi / J
        return (2.0 * law.xi * F + sigma_J * J * np.linalg.inv(F).T)[across, across], F

    side = brentq(lambda value: stress(value, 1)[0], 0.5, 1.5, xtol=1e-15)
    return stress(side, 0)[0], stress(side, 0)[1][:dimension, :dimension]


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_traction_holds_the_stress_of_a_stretched_bar(dimension):
    rollers = supports(X=(0.0, "roller"), Y=(0.0, "roller"), **({"Z": (0.0, "roller")} if dimension == 3 else {}))
    P, F = stretched(dimension, 1.2, simulation(bar(dimension)))
    displacement = [f"{float(F[i, i] - 1.0)!r}*{'XYZ'[i]}" for i in range(dimension)]
    pull = {"plane": "X = 2", "kind": "traction", "traction": [float(P), 0, 0][:dimension]}
    sim = simulation(bar(dimension, [*rollers, pull], displacement=displacement))
    X, spacing = sim.systems[0].particles.owned_rows("reference_position"), 2.0 / ({2: 9, 3: 7}[dimension] - 1)
    np.testing.assert_allclose(
        sim.systems[0].particles.owned_rows("deformation_gradient"),
        np.tile(F.ravel(), (sim.systems[0].owned, 1)),
        atol=1e-13,
    )
    share = sim.systems[0].share[:, None]
    forces = share * evaluate(sim)["T"] + sim.systems[0].conditions.find_loads(0.0).T
    # the pairs across a cut carry the stress times the area, as long as the end is two particles away
    area = 1.0 if dimension == 2 else 0.8
    for cut in (0.1, 0.9, 1.1):
        assert np.abs(forces[X[:, 0] > cut].sum(axis=0)).max() < 1e-12 * P * area
    # no force on particles whose whole neighbourhood is even; nor across the bar, where there is no stress
    assert np.abs(forces[X[:, 0] < 2.0 - 2.5 * spacing, 0]).max() < 1e-12 * P
    assert np.abs(forces[:, 1:]).max() < 1e-12 * P


DRIVEN = [
    {"plane": "X = 0", "kind": "roller"},
    {"plane": "X = 2", "kind": "velocity", "velocity": ["0.4*sin(6*t)", "free"]},
    {"plane": "Y = 1", "kind": "traction", "traction": ["0.05*t", "-0.1*(1 + X*t)"]},
]


def balances(boundaries, loads, steps, branches=()) -> list[float]:
    result = []
    for number in steps:
        sim = simulation(bar(2, boundaries, loads, material={**SOFT, "branches": list(branches)}))
        sim.ledger.row(sim.comm, *sim.systems[0].energies())
        for _ in range(number):
            sim.take_step(0.8 / number)
        row = sim.ledger.row(sim.comm, *sim.systems[0].energies())
        assert abs(row["external_work"]) > 1e-3
        result.append(abs(row["energy_error"]) / abs(row["external_work"]))
    return result


@pytest.mark.parametrize("loads", [{}, {"acceleration": ["1.0", "-0.5"]}], ids=["no load", "gravity"])
def test_work_of_drivers_and_loads_closes_the_balance(loads):
    coarse, fine, finest = balances(DRIVEN, loads, (20, 40, 80))
    assert coarse < 1e-3 and coarse > 6.5 * fine and fine > 6.5 * finest, (coarse, fine, finest)
    # internal variables are second order, and so is what they leave of the balance
    coarse, fine = balances(DRIVEN, loads, (80, 160), [{"beta": 1.0, "tau": 0.5}])
    assert fine < 1e-5 and coarse > 3.0 * fine, (coarse, fine)


def test_regions_that_overlap_are_counted_once():
    overlapping = [
        {"plane": "X = 2", "kind": "velocity", "velocity": ["where(Y > 0.31, 0.5*t, 0.3*t)", "0.2"]},
        {"box": {"lower": [1.0, 0.0], "upper": [2.0, 0.3]}, "kind": "velocity", "velocity": ["0.3*t", "free"]},
    ]
    coarse, fine = balances(overlapping, {"acceleration": ["0.0", "1.0"]}, (40, 80))
    assert coarse > 5.0 * fine
    sim = advanced(bar(2, overlapping), 0.05, 4)
    X, v = sim.systems[0].particles.owned_rows("reference_position"), sim.systems[0].particles.owned_rows("velocity")
    boxed = (X[:, 0] > 0.99) & (X[:, 1] < 0.31)
    np.testing.assert_allclose(v[boxed, 0], 0.06, rtol=1e-14)
    np.testing.assert_allclose(v[(X[:, 0] > 1.99) & ~boxed], [[0.1, 0.2]] * 3, rtol=1e-14)
