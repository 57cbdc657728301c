"""Lists of pairs by blocks: the forces of lists with tables, exact gradients, windows, and where there are none."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import SOFT, simulation, supports, tables

from parsolid.numerics.lanes import aligned_zeros
from parsolid.numerics.wide_lanes import WIDE
from parsolid.pairs import block_lists, smoothed_weights
from parsolid.pairs.axis_lists import neighbours_in
from parsolid.pairs.block_lists import ROWS, STRIDE, in_blocks, is_in_blocks
from parsolid.pairs.block_passes import add_forces_by_blocks, add_gradients_by_blocks
from parsolid.pairs.lists import InnerTable
from parsolid.pairs.pair_system import FIELD
from parsolid.pairs.passes import add_gradients
from parsolid.pairs.table_passes import add_forces_by_table

ROLLERS = supports(X=(0.0, "roller"), Y=(0.0, "roller"))


def leap(size=(9, 8, 11), boundaries=(), **method) -> dict:
    """A box of unequal spacings that moves by one force evaluation a step."""
    velocity = ["0.1*sin(X)*Y", "0.1*cos(X)", "0.1*X*Y"][: len(size)]
    method = {"integrator": "leapfrog"} | method
    extent = [1.2, 0.9, 1.0][: len(size)], [0.0] * len(size)
    more = {"material": SOFT, "method": method, "body": {"velocity": velocity}, "boundaries": list(boundaries)}
    return tables(size, *extent, **more)


def forces(sim) -> list[np.ndarray]:
    """Of the stresses and of the dissipation after three steps, this rank's."""
    for _ in range(3):
        sim.take_step(1e-3)
    return [np.array(sim.systems[0].particles.owned_rows(name)) for name in ("stress_force", "dissipative_force")]


def without_blocks(data, comm, monkeypatch):
    """The same on lists with tables."""
    with monkeypatch.context() as patch:
        patch.setattr(smoothed_weights, "in_blocks", lambda inner, dimension: None)
        sim = simulation(data, comm)
    assert not is_in_blocks(sim.systems[0].pairs.inner)
    return sim


@pytest.mark.parametrize("smoothing", [0.85, 1.2])
@pytest.mark.parametrize("size", [(9, 8, 11), (6, 15, 9), (18, 19, 20), (21, 17), (45, 52)])
def test_blocks_have_the_forces_of_tables(size, smoothing, comm, monkeypatch):
    data = leap(size, ROLLERS, smoothing=smoothing)
    blocks = simulation(data, comm)
    # a rank with few particles has no tables
    assert comm.allreduce(is_in_blocks(blocks.systems[0].pairs.inner), MPI.LOR)
    tabled = without_blocks(data, comm, monkeypatch)
    assert blocks.systems[0].directed_pairs == tabled.systems[0].directed_pairs
    pairs = [sim.systems[0].pairs for sim in (blocks, tabled)]
    np.testing.assert_array_equal(*(neighbours_in(one.inner, one.owned) for one in pairs))
    for one, other in zip(forces(blocks), forces(tabled)):
        scale = comm.allreduce(np.abs(other).max(initial=0.0), MPI.MAX)
        assert np.abs(one - other).max(initial=0.0) < 1e-12 * scale


def some_left(inner, dimension):
    """By blocks, but for every third one, whose pairs stay in the list."""
    whole = in_blocks(inner, dimension)
    left = (whole.block < 0) | (np.arange(len(whole.block)) % 3 == 1)
    degree = np.diff(inner.start)
    of_particle = np.repeat(left, WIDE)[: len(degree)]
    of_pair = np.repeat(of_particle, degree)
    start = np.concatenate(([0], np.cumsum(degree * of_particle)))
    others = InnerTable(start, inner.neighbour[of_pair], inner.kind[of_pair], inner.table)
    return whole._replace(block=np.where(left, -1, whole.block).astype(np.int32), others=others)


@pytest.mark.parametrize("size", [(9, 8, 11), (31, 22)])
def test_blocks_that_are_left_to_the_list(size, comm, monkeypatch):
    sim = without_blocks(leap(size), comm, monkeypatch)
    sim.take_step(1e-3)
    pairs, storage = sim.systems[0].pairs, sim.systems[0].particles.storage
    some = some_left(pairs.inner, len(size))
    owned = pairs.owned
    np.testing.assert_array_equal(neighbours_in(some, owned), neighbours_in(pairs.inner, owned))
    of_forces = pairs.terms, storage("kinematics"), storage("record")
    of_gradients = FIELD, storage("kinematics")
    for by_table, by_blocks, name, what in (
        (add_forces_by_table, add_forces_by_blocks, "pair_force", of_forces),
        (add_gradients, add_gradients_by_blocks, "pair_sums", of_gradients),
    ):
        expected, found = np.zeros_like(storage(name)), np.zeros_like(storage(name))
        by_table(pairs.space, pairs.inner, *what, expected)
        by_blocks(pairs.space, some, *what, found)
        # pads of the forces are nobody's
        counts = 4 if name == "pair_sums" else len(size)
        one, other = (array[:owned].reshape(owned, -1, 4)[..., :counts] for array in (found, expected))
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-13 * np.abs(other).max())


@pytest.mark.serial
def test_no_lane_goes_beyond_the_window():
    sim = simulation(leap((5, 81, 81)))
    sim.take_step(1e-3)
    pairs, storage = sim.systems[0].pairs, sim.systems[0].particles.storage
    assert WIDE * len(pairs.inner.block) == STRIDE
    room = aligned_zeros(ROWS * STRIDE + WIDE)
    # of which a store of 0 leaves another sign
    room[ROWS * STRIDE :] = -0.0
    # as if a block reached so far that it is the window's end that bounds it
    inner = pairs.inner._replace(ahead=np.array([7000]), window=room[: ROWS * STRIDE])
    found = np.zeros_like(storage("pair_force"))
    add_forces_by_blocks(pairs.space, inner, pairs.terms, storage("kinematics"), storage("record"), found)
    assert np.signbit(room[ROWS * STRIDE :]).all()


@pytest.mark.serial
def test_memory_counts_what_is_touched_of_a_window():
    sim = simulation(leap())
    sim.take_step(1e-3)
    pairs = sim.systems[0].pairs
    assert max(array.nbytes for array in pairs.arrays()) < ROWS * WIDE * (len(pairs.inner.block) + 1) * 8
    assert any(array.shape == (ROWS, WIDE * len(pairs.inner.block)) for array in pairs.arrays())


def test_there_are_few_patterns_in_a_box_and_no_blocks_of_other_lists(comm):
    inner = simulation(leap((18, 19, 20)), comm).systems[0].pairs.inner
    assert (inner.block >= 0).mean() > 0.95 and len(inner.patterns.shapes) == 9
    assert len(inner.patterns.first) - 1 < 0.8 * len(inner.block)
    for other in (leap(reconstruction=False), leap(dissipation=0.0), leap(integrator="ssp-rk3")):
        assert not is_in_blocks(simulation(other, comm).systems[0].pairs.inner)


# on several ranks few pairs of so few particles are within one
@pytest.mark.serial
@pytest.mark.parametrize("size", [(9, 8, 11), (21, 17)])
def test_many_particles_with_few_pairs_stay_in_tables(size, comm, monkeypatch):
    monkeypatch.setattr(block_lists, "_MANY", {2: 0, 3: 0})
    assert not is_in_blocks(simulation(leap(size), comm).systems[0].pairs.inner)
    pairs = simulation(leap(size, smoothing=1.2), comm).systems[0].pairs.inner
    assert comm.allreduce(is_in_blocks(pairs), MPI.LOR)
