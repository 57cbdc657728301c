"""Pair lists and their two sweeps against sums over all pairs: ghosts, mirror images, several ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from uneven_points import even_metric, points, share_of

from parsolid.boundary.mirror_planes import MirrorCodes, MirrorPlane
from parsolid.collective import SolverError
from parsolid.methods.tlsph.list_bodies import mirror_motion, mirror_records
from parsolid.pairs.list_sweeps import (
    ROWS,
    gradient_in_plane,
    gradient_in_space,
    stress_divergence_in_plane,
    stress_divergence_in_space,
)
from parsolid.pairs.list_weights import ListWeights
from parsolid.pairs.pair_list import Neighbours
from parsolid.pairs.smoothing.wendland_c2 import WendlandC2
from parsolid.scene.contact import BodyPairs

every_dimension = pytest.mark.parametrize("dimension", [2, 3])
mirrored = pytest.mark.parametrize("mirror", [False, True], ids=["free", "mirror"])


def planes_of(place: np.ndarray) -> MirrorCodes:
    """A roller below all points."""
    return MirrorCodes.of([MirrorPlane(1, float(np.floor(place[:, 1].min()) - 0.5), "roller")], 1e-9)


def built(comm, dimension: int, mirror: bool, place=None):
    """(lists of this rank, all points (n, d), rows of them that this rank owns)."""
    place = points(dimension) if place is None else place
    mine = share_of(comm, place)
    codes, body = planes_of(place) if mirror else None, np.zeros(len(mine), np.int64)
    near = Neighbours(comm, codes, 2.0, place[mine], body, even_metric(place[mine]), np.ones(len(mine)))
    ListWeights(WendlandC2()).fill(near)
    return near, place, mine


def pairs_of(place: np.ndarray, mirror: bool) -> list[tuple[int, int, np.ndarray, np.ndarray]]:
    """(a, b, g_ab, signs of the image) of every directed pair, from formulas written anew."""
    n, d = place.shape
    signs = np.ones(d)
    others = [(place, signs)]
    if mirror:
        plane = planes_of(place).planes[0][0]
        flip = np.where(np.arange(d) == 1, -1.0, 1.0)
        others.append((place * flip + np.where(np.arange(d) == 1, 2.0 * plane.coordinate, 0.0), flip))
    found = [(a, b, weight_of(other[b] - place[a]), s) for other, s in others for a in range(n) for b in range(n)]
    return [(a, b, g, s) for a, b, g, s in found if g is not None and (a != b or s is not signs)]


def weight_of(x: np.ndarray) -> np.ndarray | None:
    """g_ab of two points of volume 1: grad_a W(X_a - X_b), towards b where W falls."""
    h, d = 1.2, len(x)
    q, c = np.linalg.norm(x) / h, {2: 7.0 / (4.0 * np.pi), 3: 21.0 / (16.0 * np.pi)}[d]
    return 5.0 * c / h**d * (1.0 - 0.5 * q) ** 3 * x / h**2 if q < 2.0 else None


def collect(comm, mine: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Owned values of all ranks in the order of the points."""
    result = np.zeros((count, *values.shape[1:]))
    for rows, piece in comm.allgather((mine, np.array(values))):
        result[rows] = piece
    return result


def by_columns(matrices: np.ndarray) -> np.ndarray:
    """Rows of matrices (n, d, d) as sweeps have them."""
    n, d = matrices.shape[:2]
    rows = np.zeros((n, d, 2 if d == 2 else 4))
    rows[:, :, :d] = matrices.swapaxes(1, 2)
    return rows.reshape(n, -1)


def sweeps(near, velocity: np.ndarray, stress: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums of the gradient (owned, d, d) and forces (owned, d)."""
    d, owned = velocity.shape[1], near.owned
    at = ROWS[d]
    motion, record = np.zeros((near.rows, at.motion)), np.zeros((near.rows, at.record))
    motion[:owned, :d], record[:owned, at.stress : at.stress + at.vector * d] = velocity, by_columns(stress)
    motion[:, at.reference : at.reference + d] = near.positions
    near.halo.forward(motion, record).now()
    mirror_motion(near.local, near.images, motion, at.position, at.reference)
    mirror_records(near.local, near.images, record, at.stress)
    force = np.zeros((near.rows, at.force))
    for pairs in near.lists:
        (gradient_in_space if d == 3 else gradient_in_plane)(pairs, 0, owned, motion, record)
        (stress_divergence_in_space if d == 3 else stress_divergence_in_plane)(pairs, 0, owned, record, force)
    sums = record[:owned, : at.vector * d].reshape(owned, d, at.vector)
    return sums[:, :, :d].swapaxes(1, 2), force[:owned, :d]


def state_of(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocities and stresses of all points."""
    d = place.shape[1]
    velocity = np.stack([np.sin(0.7 * place[:, 0] + i) * np.cos(0.4 * place[:, 1]) for i in range(d)], axis=1)
    return velocity, np.random.default_rng(7).normal(size=(len(place), d, d))


@every_dimension
@mirrored
def test_sums_and_forces_are_those_over_all_pairs(dimension, mirror, comm):
    near, place, mine = built(comm, dimension, mirror)
    velocity, stress = state_of(place)
    sums, force = (collect(comm, mine, one, len(place)) for one in sweeps(near, velocity[mine], stress[mine]))
    wanted, wanted_force, pairs = np.zeros_like(sums), np.zeros_like(force), pairs_of(place, mirror)
    for a, b, g, sign in pairs:
        wanted[a] += np.outer(sign * velocity[b] - velocity[a], g)
        wanted_force[a] += (stress[a] + stress[b] * np.outer(sign, sign)) @ g
    count = 2 * len(near.inner.neighbour) + len(near.outer.neighbour)
    assert comm.allreduce(count) == len(pairs)
    np.testing.assert_allclose(sums, wanted, atol=1e-13 * np.abs(wanted).max())
    np.testing.assert_allclose(force, wanted_force, atol=1e-13 * np.abs(wanted_force).max())


def test_coincident_particles_are_refused_on_all_ranks(comm):
    place = points(2)
    place[-1] = place[-2]
    with pytest.raises(SolverError, match="expected no two particles at the same place"):
        built(comm, 2, False, place)


def test_a_particle_out_of_reach_is_refused_on_all_ranks(comm):
    place = points(2)
    place[-1] = place[-1] + 50.0
    with pytest.raises(SolverError, match="expected every particle to have a neighbour"):
        built(comm, 2, False, place)


def test_bodies_that_are_not_bonded_have_no_pairs():
    place = points(2)
    body = (place[:, 0] > 4.0).astype(np.int64)
    apart = BodyPairs([[0, 1]])
    near = Neighbours(MPI.COMM_SELF, None, 2.0, place, body, even_metric(place), np.ones(len(place)), apart)
    row = np.repeat(np.arange(near.owned), np.diff(near.inner.start))
    assert len(row) > 20 and (body[row] == body[near.inner.neighbour]).all()
