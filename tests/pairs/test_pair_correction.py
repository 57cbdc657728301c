"""Closed pair weights: a constant stress has no force inside, and irregular particles are as accurate as a lattice."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import punch, run_to_end, simulation, supports, tables

from parsolid.collective import SolverError
from parsolid.pairs.candidates import metrics
from parsolid.pairs.list_weights import ListWeights
from parsolid.pairs.pair_list import Neighbours
from parsolid.pairs.smoothing.wendland_c2 import WendlandC2

JITTERED = {2: {"jitter": 0.15}, 3: {"jitter": 0.15}}
PARTICLES = {2: (12, 11), 3: (6, 7, 6)}
ROLLERS = supports(X=(0.0, "roller"), Y=(0.0, "roller"))


def body(dimension, weights="closure", boundaries=(), **keys) -> dict:
    """A box with an uneven inside."""
    data = tables(PARTICLES[dimension], method={"weights": weights}, boundaries=list(boundaries))
    data["bodies"][0] |= {**JITTERED[dimension], **keys}
    return data


def forces_of(sim, stress) -> np.ndarray:
    """sum_b (P_a L_a + P_b L_b) g_ab (n, d) [N] of a stress that is the same at all particles, through the pair
    engine."""
    method = sim.systems[0]
    d, owned = method.dimension, method.owned
    L = method.lists.corrections
    width, record = {2: 2, 3: 4}[d], method.lists.record
    record[:] = 0.0
    P = record[:owned, method.lists.columns.stress :][:, : d * width].reshape(owned, d, width)
    P[:, :, :d] = (stress @ L).swapaxes(1, 2)
    method.lists.find_forces()
    return np.array(method.particles.owned_rows("stress_force"))


def left_over(sim) -> np.ndarray:
    """Force of a unit pressure inside, over the face of a particle."""
    method, d = sim.systems[0], sim.systems[0].dimension
    share = method.share
    inside = (sim.particle_sets[0].area == 0.0).all(axis=1) & (share == 1.0)
    return forces_of(sim, np.eye(d))[inside] / (sim.particle_sets[0].volume / share)[inside, None] ** (1 - 1 / d)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("boundaries", [(), ROLLERS], ids=["free", "mirror"])
@pytest.mark.serial
def test_a_constant_stress_has_almost_no_force_inside(dimension, boundaries):
    plain = left_over(simulation(body(dimension, "kernel", boundaries)))
    closed = left_over(simulation(body(dimension, "closure", boundaries)))
    assert np.abs(plain).max() > 0.5
    assert np.abs(closed).max() < 0.04
    assert np.sqrt(np.mean(closed**2)) < 0.02 * np.sqrt(np.mean(plain**2))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.serial
def test_on_the_surface_it_has_the_force_of_its_traction(dimension):
    sim = simulation(body(dimension))
    stress = np.arange(1.0, 1.0 + dimension**2).reshape(dimension, dimension)
    found, wanted = forces_of(sim, stress), -sim.particle_sets[0].area @ stress.T
    assert np.abs(found - wanted).max() < 0.1 * np.abs(wanted).max()
    # pairwise: nothing is lost, whatever is left over
    assert np.abs(found.sum(axis=0)).max() < 1e-12 * np.abs(found).sum()


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("boundaries", [(), ROLLERS], ids=["free", "mirror"])
def test_gradients_of_linear_fields_stay_exact(dimension, boundaries, comm):
    sim = simulation(body(dimension, "closure", boundaries), comm)
    # what the mirror planes X = 0 and Y = 0 allow
    slope = (
        np.diag([0.3, -0.2, 0.7][:dimension])
        if boundaries
        else np.arange(1.0, 1.0 + dimension**2).reshape(dimension, dimension)
    )
    table = sim.systems[0].particles
    table.owned_rows("position")[:] += table.owned_rows("reference_position") @ slope.T
    found = sim.systems[0].displacement_gradient()
    assert np.abs(found - slope).max(initial=0.0) < 1e-10


def test_the_weights_of_a_pair_are_opposite_on_both_of_its_ranks(comm):
    sim = simulation(body(2), comm)
    near = sim.systems[0].lists.near
    names = near.halo.with_ghosts(np.array(sim.systems[0].particles.owned_rows("identifier")))
    directed, row = {}, np.repeat(np.arange(near.owned), np.diff(near.outer.start))
    for a, b, g in zip(names[row], names[near.outer.neighbour], near.outer.weight[:, :2]):
        directed[int(a), int(b)] = g.tolist()
    everyone = {pair: g for part in comm.allgather(directed) for pair, g in part.items()}
    assert (len(everyone) > 0) == (comm.size > 1)
    assert all(everyone[b, a] == [-x for x in g] for (a, b), g in everyone.items())


@pytest.mark.serial
@pytest.mark.parametrize("jitter", [0.1, 0.2])
def test_an_irregular_punch_is_as_good_as_a_regular_one(jitter):
    def history(jitter, weights):
        data = punch((17, 17), end_time=0.005, method={"weights": weights})
        data["bodies"][0]["jitter"] = jitter
        return run_to_end(data)[1]

    def difference(found):
        energies = [
            np.interp(regular["time"], found["time"], found[name]) - regular[name]
            for name in ("kinetic", "strain_energy")
        ]
        return np.abs(energies).max() / (regular["kinetic"][0] + regular["strain_energy"][0])

    regular = history(0.0, "kernel")
    assert difference(history(jitter, "kernel")) > 0.25
    # the regular body itself is 0.02 from the reference
    assert difference(history(jitter, "closure")) < 0.012


def test_cells_are_refused(comm):
    data = body(2, placement="cells")
    with pytest.raises(SolverError, match="method.weights: expected particles on the surface .* found cells"):
        simulation(data, comm)


@pytest.mark.serial
def test_volumes_that_do_not_fit_are_refused():
    rng = np.random.default_rng(0)
    place = np.stack(np.meshgrid(np.arange(12.0), np.arange(12.0)), axis=-1).reshape(-1, 2)
    place += rng.uniform(-0.45, 0.45, place.shape)
    metric = metrics(np.ones_like(place), None, 0.85)
    area = np.zeros_like(place)
    near = Neighbours(MPI.COMM_SELF, None, 2.0, place, np.zeros(144, np.int64), metric, np.ones(144))
    with pytest.raises(SolverError, match="method.weights: expected particles whose volumes fit"):
        ListWeights(WendlandC2(), surface=(area, np.ones(144))).fill(near)
