"""One force evaluation a step: order in time, exact strain and relaxation, energy, stable step, restart."""

import itertools

import numpy as np
import pytest
from lattice_waves import lattice_operators, stable_step
from solids import (
    RUBBER,
    SOFT,
    Record,
    column,
    evolved,
    follow,
    punch,
    random_of,
    run_steps,
    run_to_end,
    simulation,
    tables,
)
from tlsph.test_loads import DRIVEN

from parsolid.methods.tlsph.leapfrog import wave_weights

LEAPFROG = {"integrator": "leapfrog"}


def driven(steps: int, boundaries=tuple(DRIVEN), end: float = 0.8, method=LEAPFROG, **keys):
    """A bar with a branch that is pulled and pressed in time, after equal steps."""
    material = {**SOFT, "branches": [{"beta": 1.0, "tau": 0.2}]}
    velocity = {"velocity": ["0.1*sin(pi*X/2)", "-0.1*Y*(1 + X)"]}
    data = tables((9, 5), [2.0, 1.0], material=material, method=method, boundaries=list(boundaries), body=velocity)
    sim = simulation(data | keys)
    sim.ledger.row(sim.comm, *sim.systems[0].energies())
    for _ in range(steps):
        sim.take_step(end / steps)
    return sim


@pytest.fixture(scope="module")
def refined() -> dict:
    """Runs of 20, 40, 80, 160 equal steps with and without dissipation."""
    return {S: [driven(n, method={**LEAPFROG, "dissipation": S}) for n in (20, 40, 80, 160)] for S in (0.0, 1.0)}


def changes(sims: list, name: str) -> list[float]:
    """Greatest changes of a field from one step size to the next."""
    fields = [np.array(sim.systems[0].particles.owned_rows(name)) for sim in sims]
    return [np.abs(fine - coarse).max() for coarse, fine in itertools.pairwise(fields)]


def test_every_field_is_second_order_in_time_under_tractions_and_prescribed_motion(refined):
    names = evolved(refined[0.0][0].systems[0].particles)
    strain = {"deformation_gradient", "jacobian", "viscous_strain_inverse_1"}
    assert set(names) == strain | {"velocity", "position", "stress_force", "dissipative_force"}
    for name in [name for name in names if name != "dissipative_force"]:
        found = changes(refined[0.0], name)
        assert all(coarse > 3.6 * fine > 0.0 for coarse, fine in itertools.pairwise(found)), (name, found)
    for sim in refined[0.0]:
        table = sim.systems[0].particles
        end = table.owned_rows("reference_position")[:, 0] > 1.99
        np.testing.assert_allclose(table.owned_rows("velocity")[end, 0], 0.4 * np.sin(4.8), rtol=1e-14)


def test_the_dissipation_lags_by_half_a_step(refined):
    # first order in the step, of a force that vanishes with the spacing
    for name in ("velocity", "position", "deformation_gradient"):
        found = changes(refined[1.0], name)
        assert all(coarse > 1.8 * fine for coarse, fine in itertools.pairwise(found)), (name, found)
    with_it, without = (np.array(refined[S][-1].systems[0].particles.owned_rows("velocity")) for S in (1.0, 0.0))
    assert changes(refined[1.0], "velocity")[0] < 0.1 * np.abs(with_it - without).max()


@pytest.mark.parametrize("dissipation", [0.0, 1.0])
def test_the_balance_is_second_order_in_time_under_tractions_and_prescribed_motion(refined, dissipation):
    rows = [sim.ledger.row(sim.comm, *sim.systems[0].energies()) for sim in refined[dissipation]]
    balances = [abs(row["energy_error"]) for row in rows]
    assert all(coarse > 3.5 * fine for coarse, fine in itertools.pairwise(balances)), balances
    assert balances[-1] < 2e-4 * rows[-1]["external_work"]


@pytest.mark.parametrize("scene", [punch, column])
def test_strain_is_the_gradient_of_the_motion_and_its_minors(scene):
    sim, _ = run_steps(scene(method=LEAPFROG), 60)
    system, d = sim.systems[0], sim.systems[0].dimension
    F = np.array(system.particles.owned_rows("deformation_gradient"))
    assert np.abs(F - np.eye(d).ravel()).max() > 0.05
    gradient = system.displacement_gradient().reshape(-1, d * d)
    np.testing.assert_allclose(F - np.eye(d).ravel(), gradient, rtol=0.0, atol=1e-13)
    J = np.linalg.det(F.reshape(-1, d, d))
    np.testing.assert_allclose(system.particles.owned_rows("jacobian"), J, rtol=1e-14)
    assert "cofactor" not in system.particles and "velocity_at_start" not in system.particles


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_held_strain_relaxes_exactly_whatever_the_step(dimension):
    strain = np.diag([0.8, 1.3, 1.1][:dimension]) + 0.2 * np.eye(dimension, k=1)
    everywhere = {"box": {"lower": [-1.0] * dimension, "upper": [2.0] * dimension}}
    tau, gradient = 0.3, (strain - np.eye(dimension)).tolist()
    data = tables(
        (3,) * dimension,
        material={**SOFT, "branches": [{"beta": 1.0, "tau": tau}]},
        body={"displacement": ["+".join(f"({a})*{axis}" for a, axis in zip(row, "XYZ")) for row in gradient]},
        method=LEAPFROG,
        boundaries=[{"kind": "velocity", **everywhere, "velocity": ["0"] * dimension}],
    )
    sim = simulation(data)
    for step in (1e-3, 0.2, 0.7):
        sim.take_step(step)
    inverse = np.linalg.inv(strain.T @ strain)
    wanted = inverse + np.exp(-0.901 / tau) * (np.eye(dimension) - inverse)
    pairs = [(i, i) for i in range(dimension)] + [(i, j) for i in range(dimension) for j in range(i + 1, dimension)]
    found = sim.systems[0].particles.owned_rows("viscous_strain_inverse_1")
    np.testing.assert_allclose(found, [[wanted[i, j] for i, j in pairs]] * len(found), rtol=1e-12)


# --- the stable step ---------------------------------------------------------------------------------------------

RATIOS = (0.0, 0.15, 0.3, 0.45, 0.4999)


@pytest.mark.parametrize("kernel", ["wendland-c2", "cubic-spline", "quintic-spline"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_stable_step_bounds_all_waves_of_a_lattice(dimension, kernel):
    for smoothing, ratio in itertools.product((0.6, 0.7, 0.8, 0.85, 1.2), RATIOS):
        shear = np.sqrt((1.0 - 2.0 * ratio) / (2.0 - 2.0 * ratio))
        of_pressure, of_shear = wave_weights(dimension, smoothing)
        chosen = 1.0 / (of_pressure + of_shear * shear)
        limit = stable_step(*lattice_operators(dimension, smoothing, kernel, 1.0, shear))
        assert chosen < limit, (smoothing, ratio, chosen, limit)
        if (kernel, smoothing) == ("wendland-c2", 0.85):
            # a fixed multiple of 1/c_p would be off by a factor of two
            assert limit < 1.3 * chosen


def shaken(safety: float, dissipation: float) -> float:
    """Kinetic energy after 250 steps over that at the start of a small free body with nu = 0 in random motion."""
    method = {**LEAPFROG, "safety": safety, "dissipation": dissipation, "balance_limit": 1e9}
    sim = simulation(tables((5, 5, 5), material={**SOFT, "poissons_ratio": 0.0}, method=method, end_time=1e3))
    rows = sim.systems[0].particles.owned_rows
    rows("velocity")[:] = 1e-6 * random_of(rows("identifier"), 3)
    columns = follow(sim, Record(), 250)
    assert len(columns["time"]) == 251
    return columns["kinetic"][-1] / columns["kinetic"][0]


@pytest.mark.parametrize("dissipation", [1.0, 3.0])
def test_a_small_free_body_is_stable_at_the_limit_and_not_beyond(dissipation):
    assert shaken(1.0, dissipation) < 0.1
    assert shaken(1.15, dissipation) > 1e2


def test_at_rest_the_step_is_that_of_linear_elasticity():
    sim = simulation(tables((5, 6), material=RUBBER, method={**LEAPFROG, "safety": 0.5}))
    nu, rho = RUBBER["poissons_ratio"], RUBBER["density"]
    mu = RUBBER["youngs_modulus"] / (2.0 * (1.0 + nu))
    fast, slow = np.sqrt(mu / rho * (2.0 - 2.0 * nu) / (1.0 - 2.0 * nu)), np.sqrt(mu / rho)
    assert sim.systems[0].stable_step() == pytest.approx(0.5 * 0.2 / (1.09 * fast + 0.60 * slow), rel=1e-12)


# --- start, restart, refusals ------------------------------------------------------------------------------------


def test_the_balance_closes_where_the_reference_is_moved():
    found = []
    for safety in (0.9, 0.45):
        scene = punch((9, 9), end_time=0.004, method={**LEAPFROG, "safety": safety, "reference": "updated"})
        scene["method"]["update_when"] = 0.02
        sim, columns = run_to_end(scene)
        assert sim.systems[0].reference.updates > 5
        found.append(np.abs(columns["energy_error"]).max() / columns["kinetic"][0])
    assert found[0] < 6e-3 and found[0] > 2.5 * found[1], found


def test_loads_jump_where_a_step_ends():
    loads = {"acceleration": ["where(t < 0.31, 1, -2)", "0"], "jumps": [0.31]}
    data = tables((5, 5), material=SOFT, method=LEAPFROG, loads=loads, end_time=0.5)
    sim = simulation(data)
    assert sim.systems[0].stop_times == (0.31,)
    sim.take_step(0.31)
    sim.take_step(0.19)
    velocity = sim.systems[0].particles.owned_rows("velocity")
    np.testing.assert_allclose(velocity, [[0.31 - 2.0 * 0.19, 0.0]] * len(velocity), rtol=0.0, atol=1e-14)
