"""Both passes of updated-Lagrangian SPH on random fields: what does work is what is worked on, to round-off."""

import numpy as np
import pytest
from ulsph.plates import EVERYTHING, block, randomized, scene

from parsolid.methods.ulsph.micro_inertia import TILE, load_vectors

SPACE = {"energetic_length": 1e-2, "dissipative_length": 1e-2, "hardening_length": 1e-3}


def jittered(dimension, bodies=1):
    count = {2: (9, 7), 3: (6, 5, 4)}[dimension]
    upper = [1e-3 * n for n in count]
    first = block(count, upper, EVERYTHING | SPACE, jitter=0.2, seed=3)
    if bodies == 1:
        return scene(first)
    lower, higher = [0.0] * dimension, list(upper)
    lower[0], higher[0] = upper[0], 2 * upper[0]
    second = block(count, higher, EVERYTHING | SPACE, lower, jitter=0.2, seed=4)
    return scene(first, second, method={"contact": "welded"}, bond=[{"bodies": "all"}])


def total(comm, value):
    return comm.allreduce(np.asarray(value, float))


def velocity_gradients(system):
    d, n, rows = system.dimension, system.owned, system.particles.owned_rows
    columns = system.neighbours.rates[:, : d * system.neighbours.stride].reshape(n, d, -1)[:, :, :d].swapaxes(1, 2)
    return columns @ corrections(system) / (rows("mass") * rows("density"))[:, None, None]


def corrections(system):
    d, values = system.dimension, system.particles.owned_rows("correction")
    B = np.empty((system.owned, 3, 3))
    for column, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
        B[:, i, j] = B[:, j, i] = values[:, column]
    return B[:, :d, :d]


@pytest.mark.parametrize("dimension, bodies", [(2, 2), (3, 1)])
def test_power_closes(dimension, bodies, comm):
    """sum m (v.a + l_m^2 v^p v^p' + e') = 0 (row 4 of the formulation): each part by itself, to round-off."""
    sim, d = randomized(jittered(dimension, bodies), comm)
    system = sim.systems[0]
    rows, volume = system.particles.owned_rows, system.mass / system.particles.owned_rows("density")
    F, viscous, v = rows("force"), rows("viscous_force"), rows("velocity")
    sigma = system.shown("stress", 0, system.owned)[:, :d, :d]
    scale = total(comm, np.abs(F * v).sum())
    inner = (volume[:, None, None] * sigma * velocity_gradients(system)).sum()
    assert abs(total(comm, (F * v).sum() + inner)) < 1e-12 * scale
    heat = rows("viscous_heat").sum()
    assert abs(total(comm, (viscous * v).sum() + heat)) < 1e-12 * scale
    assert total(comm, heat) > 1e-3 * scale
    # the micro-flux and the heat flux against their gradients
    divergence, heat_loss = (rows("density") / rows("mass") * system.neighbours.flows[:, k] for k in (0, 1))
    xi = rows("energetic_flux") + rows("dissipative_flux")
    lost = volume * divergence * rows("micro_rate")
    gained = (volume[:, None] * xi * rows("micro_gradient")).sum()
    assert abs(total(comm, lost.sum() + gained)) < 1e-12 * total(comm, np.abs(lost).sum())
    assert abs(total(comm, (volume * heat_loss).sum())) < 1e-12 * total(comm, np.abs(volume * heat_loss).sum())


@pytest.mark.parametrize("dimension", [2, 3])
def test_momentum_and_angular_momentum(dimension, comm):
    """Forces add up to nothing, and so do their moments, at corners with few neighbours too."""
    sim, d = randomized(jittered(dimension), comm)
    rows = sim.systems[0].particles.owned_rows
    F, x = rows("force") + rows("viscous_force"), rows("position")
    assert np.abs(total(comm, F.sum(axis=0))).max() < 1e-12 * total(comm, np.abs(F).sum())
    moment = np.cross(x, F) if d == 3 else x[:, 0] * F[:, 1] - x[:, 1] * F[:, 0]
    size = total(comm, (np.linalg.norm(x, axis=1) * np.linalg.norm(F, axis=1)).sum())
    assert np.abs(total(comm, moment.sum(axis=0))).max() < 1e-12 * size


@pytest.mark.parametrize("dimension", [2, 3])
def test_gradients_of_linear_fields_are_exact(dimension, comm):
    sim, d = randomized(jittered(dimension), comm)
    system = sim.systems[0]
    system.most_correction = 1e6
    rows, x = system.particles.owned_rows, system.particles.owned_rows("position")
    L = np.random.default_rng(1).uniform(-1.0, 1.0, (d, d))
    rows("velocity")[:] = x @ L.T
    rows("micro_rate")[:] = 3.0 + x @ np.arange(1.0, d + 1.0)
    # a step of length 0 keeps the state
    system.find_rates(0.0)
    system.advance_state(0.0, 0.0)
    system.neighbours.find_forces()
    system.advance_fluxes(0.0)
    system.find_rates(0.0)
    assert np.abs(velocity_gradients(system) - L).max(initial=0.0) < 1e-11
    assert np.abs(rows("micro_gradient") - np.arange(1.0, d + 1.0)).max(initial=0.0) < 1e-10


@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
def test_vectors_of_a_tile_are_those_of_the_field(d):
    """And have no third component in the plane, whatever the tile held."""
    tile, field = np.ones(5 * TILE), np.random.default_rng(1).normal(size=(d, 9))
    load_vectors(field, 2, 4, tile, 1)
    found = tile.reshape(5, TILE)[1:4, :4]
    np.testing.assert_array_equal(found, np.concatenate([field, np.zeros((3 - d, 9))])[:, 2:6])
