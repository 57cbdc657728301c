"""The stable time step: CFL number, narrowest spacing, and the exact greatest wave speed of the state."""

import numpy as np
import pytest
from solids import ONE_BRANCH, SOFT, Record, follow, set_random_state, simulation, strains, tables

PARTICLES = {2: (5, 6), 3: (4, 5, 3)}


def greatest_speed(sim) -> float:
    """Largest c_p over particles and directions of space, rho c_p^2(N) = mu + N .

    M N for zeta = 0 (formulation, section 1).
    """
    law, strain, rho = sim.systems[0].blocks[0].law, strains(sim), sim.systems[0].blocks[0].law.density
    moduli, mu = law.branch_moduli or (), 2.0 * law.xi
    M = (
        (law.lambda_hat + (mu + sum(moduli)) / strain["J"] ** 2)[:, None, None]
        * strain["H"].swapaxes(1, 2)
        @ strain["H"]
    )
    M = M + sum((modulus * A for modulus, A in zip(moduli, strain["A"])), np.zeros_like(M))
    # in plane strain no wave travels out of the plane
    M = M[:, : sim.systems[0].dimension, : sim.systems[0].dimension]
    return np.sqrt((mu + np.linalg.eigvalsh(M)[:, -1].max()) / rho)


@pytest.mark.parametrize("branches", [[], ONE_BRANCH], ids=["0", "1"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_at_rest_it_is_that_of_linear_elasticity(dimension, branches):
    sim = simulation(tables(PARTICLES[dimension], material={**SOFT, "branches": branches}, method={"cfl": 0.6}))
    E, nu, beta = SOFT["youngs_modulus"], SOFT["poissons_ratio"], sum(branch["beta"] for branch in branches)
    mu, lame = E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    speed = np.sqrt((lame + 2.0 * mu * (1.0 + beta)) / SOFT["density"])
    assert sim.systems[0].stable_step() == pytest.approx(
        0.6 * min(1.0 / (n - 1) for n in PARTICLES[dimension]) / speed, rel=1e-13
    )


@pytest.mark.parametrize("branches", [[], ONE_BRANCH], ids=["0", "1"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_it_follows_the_fastest_wave_of_the_state(dimension, branches):
    sim = simulation(tables(PARTICLES[dimension], material={**SOFT, "branches": branches}))
    for seed in range(5):
        set_random_state(sim, seed=20 * seed)
        expected = 0.7 * min(1.0 / (n - 1) for n in PARTICLES[dimension]) / greatest_speed(sim)
        assert sim.systems[0].stable_step() == pytest.approx(expected, rel=1e-12)


def test_one_crushed_particle_rules_the_step():
    sim = simulation(tables((5, 6), material={**SOFT, "branches": ONE_BRANCH}))
    table, before = sim.systems[0].particles, sim.systems[0].stable_step()
    crushed = 17
    table.owned_rows("deformation_gradient")[crushed] = [0.2, 0.0, 0.0, 0.5]
    table.owned_rows("jacobian")[crushed] = 0.1
    assert sim.systems[0].stable_step() < 0.5 * before
    assert sim.systems[0].stable_step() == pytest.approx(0.7 * 0.2 / greatest_speed(sim), rel=1e-12)


@pytest.mark.parametrize("method", [{}, {"integrator": "leapfrog", "safety": 0.5}], ids=["stages", "leapfrog"])
def test_the_step_found_while_advancing_is_that_of_the_new_state(method):
    body = {"velocity": ["0.5*sin(3*Y)", "-0.4*Y"]}
    sim = simulation(tables((5, 6), material={**SOFT, "branches": ONE_BRANCH}, method=method, body=body))
    record = Record(lambda s: {"stable": s.systems[0].stable_step(), "agreed": s.stable})
    columns = follow(sim, record, 6)
    np.testing.assert_allclose(columns["agreed"], columns["stable"], rtol=1e-12)
    np.testing.assert_allclose(np.diff(columns["time"]), columns["stable"][:-1], rtol=1e-12)
    assert np.ptp(columns["stable"]) > 1e-3 * columns["stable"][0]


def test_a_largest_step_is_kept():
    data = tables((5, 6), method={"maximum_step": 1e-3}, body={"velocity": ["0.1*Y", "0"]})
    sim = simulation(data)
    assert sim.systems[0].stable_step() > 1e-2
    np.testing.assert_allclose(follow(sim, Record(), 4)["time"], 1e-3 * np.arange(5), rtol=1e-13)
