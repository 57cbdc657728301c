"""A pair system against sums over all pairs: lists, passes, images, ghosts, several fields at once, and lists made
anew."""

import numpy as np
import pytest
from pair_systems import even_metric, points, share_of, system_of

from parsolid.boundary.mirror_planes import MirrorCodes, MirrorPlane
from parsolid.collective import SolverError
from parsolid.pairs.passes import Scalar, Vector
from parsolid.pairs.smoothed_weights import SmoothedWeights
from parsolid.pairs.smoothing.wendland_c2 import WendlandC2
from parsolid.pairs.terms import KINEMATICS
from parsolid.particles.declaration import Field, Within

every_dimension = pytest.mark.parametrize("dimension", [2, 3])
every_kind = pytest.mark.parametrize("kind", ["smoothed"])
mirrored = pytest.mark.parametrize("mirror", [False, True], ids=["free", "mirror"])
HORIZON = 2.2


def weights_of(kind: str):
    return SmoothedWeights(WendlandC2())


def metric_of(kind: str, place: np.ndarray) -> np.ndarray:
    if kind == "smoothed":
        return even_metric(place)
    return even_metric(place, HORIZON)


def planes_of(place: np.ndarray) -> MirrorCodes:
    """A roller below all points."""
    return MirrorCodes.of([MirrorPlane(1, float(np.floor(place[:, 1].min()) - 0.5), "roller")], 1e-9)


def built(comm, kind: str, dimension: int, mirror: bool, **choices):
    """(system, all points (n, d), rows of them that this rank owns)."""
    place = points(dimension)
    mine = share_of(comm, place)
    codes = planes_of(place) if mirror else None
    system = system_of(place[mine], metric_of(kind, place[mine]), weights_of(kind), comm, codes=codes, **choices)
    return system, place, mine


def pairs_of(kind: str, place: np.ndarray, mirror: bool) -> list[tuple[int, int, np.ndarray, np.ndarray]]:
    """(a, b, g_ab, signs of the image) of every directed pair, from formulas written anew."""
    n, d = place.shape
    signs = np.ones(d)
    ghosts = [(place, signs)]
    if mirror:
        plane = planes_of(place).planes[0][0]
        flip = np.where(np.arange(d) == 1, -1.0, 1.0)
        ghosts.append((place * flip + np.where(np.arange(d) == 1, 2.0 * plane.coordinate, 0.0), flip))
    result = []
    for other, sign in ghosts:
        for a in range(n):
            for b in range(n):
                g = weight_of(kind, other[b] - place[a])
                if g is not None and (a != b or sign is not signs):
                    result.append((a, b, g, sign))
    return result


def weight_of(kind: str, xi: np.ndarray) -> np.ndarray | None:
    """g_ab of two points of volume 1."""
    r, d = np.linalg.norm(xi), len(xi)
    if kind == "radial":
        return (1.0 - r / HORIZON) * xi if r < HORIZON else None
    h = 1.2
    q, c = r / h, {2: 7.0 / (4.0 * np.pi), 3: 21.0 / (16.0 * np.pi)}[d]
    # grad_a W(X_a - X_b), towards b where W falls
    return 5.0 * c / h**d * (1.0 - 0.5 * q) ** 3 * xi / h**2 if q < 2.0 else None


def velocity(place: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(0.7 * place[:, 0] + i) * np.cos(0.4 * place[:, 1]) for i in range(place.shape[1])], axis=1)


def set_velocity(system, place, mine) -> None:
    system.particles.owned_rows("velocity")[:] = velocity(place)[mine]


def matrices(sums: np.ndarray, owned: int, dimension: int, first: int = 0) -> np.ndarray:
    """(owned, d, d) from columns of sums."""
    width = {2: 4, 3: 12}[dimension]
    return sums[:owned, first : first + width].reshape(owned, dimension, -1)[:, :, :dimension].swapaxes(1, 2)


def collect(comm, mine: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Owned values of all ranks in the order of the points."""
    result = np.zeros((count, *values.shape[1:]))
    for rows, piece in comm.allgather((mine, np.array(values))):
        result[rows] = piece
    return result


@every_dimension
@every_kind
@mirrored
def test_sums_and_forces_are_those_over_all_pairs(kind, dimension, mirror, comm):
    system, place, mine = built(comm, kind, dimension, mirror)
    set_velocity(system, place, mine)
    found = collect(comm, mine, matrices(system.gradient("motion"), system.owned, dimension), len(place))
    stress = np.random.default_rng(7).normal(size=(len(place), dimension, dimension))
    width, record = {2: 2, 3: 4}[dimension], system.particles.storage("record")
    record[: system.owned, : dimension * width].reshape(-1, dimension, width)[:, :, :dimension] = stress[mine].swapaxes(
        1, 2
    )
    force = collect(comm, mine, system.divergence()[: system.owned, :dimension], len(place))
    v, wanted, wanted_force = velocity(place), np.zeros_like(found), np.zeros_like(force)
    pairs = pairs_of(kind, place, mirror)
    for a, b, g, sign in pairs:
        wanted[a] += np.outer(sign * v[b] - v[a], g)
        image = stress[b] * np.outer(sign, sign)
        wanted_force[a] += (stress[a] + image) @ g
    assert comm.allreduce(system.directed_pairs) == len(pairs)
    np.testing.assert_allclose(found, wanted, atol=1e-13 * np.abs(wanted).max())
    np.testing.assert_allclose(force, wanted_force, atol=1e-13 * np.abs(wanted_force).max())


@pytest.mark.every_other
@every_dimension
@every_kind
@mirrored
def test_several_fields_in_one_pass_have_the_bits_of_one_after_the_other(kind, dimension, mirror, comm):
    at = KINEMATICS[dimension]
    fields = (Vector(), Scalar(at.position + dimension - 1), Vector(at.position))
    system, place, mine = built(comm, kind, dimension, mirror, fields=fields)
    set_velocity(system, place, mine)
    system.particles.owned_rows("position")[:] = np.cos(place[mine])
    system.particles.send("motion")
    system.particles.receive("motion")
    together, column = system.gradient(None, fields), 0
    assert together.shape[1] == 2 * {2: 4, 3: 12}[dimension] + 4
    for field in fields:
        width = 4 if isinstance(field, Scalar) else {2: 4, 3: 12}[dimension]
        alone = np.zeros((len(together), width))
        system.gradient(None, (field,), alone)
        assert comm.allreduce(np.abs(alone).sum()) > 1.0
        np.testing.assert_array_equal(together[:, column : column + width], alone)
        column += width


@every_dimension
@every_kind
def test_the_gradient_of_a_number_is_that_over_all_pairs(kind, dimension, comm):
    column = KINEMATICS[dimension].position
    system, place, mine = built(comm, kind, dimension, True, fields=(Scalar(column),))
    heat = np.exp(0.1 * place.sum(axis=1))
    system.particles.owned_rows("position")[:, 0] = heat[mine]
    sums = system.gradient("motion", (Scalar(column),))
    found, wanted = collect(comm, mine, sums[: system.owned, :dimension], len(place)), np.zeros_like(place)
    for a, b, g, _ in pairs_of(kind, place, True):
        wanted[a] += (heat[b] - heat[a]) * g
    np.testing.assert_allclose(found, wanted, atol=1e-13 * np.abs(wanted).max())


@every_dimension
@every_kind
@mirrored
def test_the_passes_are_adjoint(kind, dimension, mirror, comm):
    """sum_a v_a . T_a = - sum_a P_a : sum_b (v_b - v_a) (x) g_ab for every P and v."""
    system, place, mine = built(comm, kind, dimension, mirror)
    set_velocity(system, place, mine)
    sums = matrices(system.gradient("motion"), system.owned, dimension)
    stress = np.random.default_rng(3).normal(size=(len(place), dimension, dimension))[mine]
    width, record = {2: 2, 3: 4}[dimension], system.particles.storage("record")
    record[: system.owned, : dimension * width].reshape(-1, dimension, width)[:, :, :dimension] = stress.swapaxes(1, 2)
    power = np.sum(velocity(place)[mine] * system.divergence()[: system.owned, :dimension])
    work = np.sum(stress * sums)
    total, size = comm.allreduce(power + work), comm.allreduce(np.abs(stress * sums).sum())
    assert size > 1.0 and abs(total) < 1e-13 * size


@every_dimension
@every_kind
@mirrored
def test_lists_made_anew_of_the_same_particles_have_the_same_bits(kind, dimension, mirror, comm):
    system, place, mine = built(comm, kind, dimension, mirror)
    set_velocity(system, place, mine)
    before = [array.copy() for array in system.arrays()], system.gradient("motion").copy()
    system.rebuild(place[mine], np.zeros(len(mine), np.int64), metric_of(kind, place[mine]), np.ones(len(mine)))
    assert len(before[0]) == len(system.arrays())
    for one, other in zip(before[0], system.arrays()):
        np.testing.assert_array_equal(one, other)
    system.particles.storage("pair_sums")[:] = 0.0
    np.testing.assert_array_equal(before[1], system.gradient("motion"))


@every_dimension
@every_kind
def test_after_particles_have_moved_a_rebuilt_system_is_as_a_fresh_one(kind, dimension, comm):
    system, place, mine = built(comm, kind, dimension, True)
    # turned, so that other particles are neighbours, and ghosts, than before
    moved = place + 0.4 * velocity(place)
    metric, ones = metric_of(kind, place[mine]), np.ones(len(mine))
    system.particles.owned_rows("reference_position")[:] = moved[mine]
    system.rebuild(moved[mine], np.zeros(len(mine), np.int64), metric, ones)
    fresh = system_of(moved[mine], metric, weights_of(kind), comm, codes=system.codes)
    results = []
    for one in (system, fresh):
        set_velocity(one, place, mine)
        one.particles.owned_rows("position")[:] = moved[mine]
        results.append([one.gradient("motion")[: one.owned], one.particles.owned_rows("correction"), *one.arrays()])
    for found, wanted in zip(*results):
        np.testing.assert_array_equal(found, wanted)


def test_coincident_particles_are_refused_on_all_ranks(comm):
    place = points(2)
    place[-1] = place[-2]
    mine = share_of(comm, place)
    with pytest.raises(SolverError, match="expected no two particles at the same place"):
        system_of(place[mine], even_metric(place[mine]), weights_of("smoothed"), comm)


def test_a_field_of_the_method_may_lie_in_the_record_and_travel_with_it(comm):
    system, _, _ = built(comm, "smoothed", 2, False)
    heat = Field("heat", 1, "K", ghosts="forward", message="motion", layout=Within("kinematics", 6))
    system.particles.declare(heat, 2.0 + comm.rank)
    system.gradient("motion")
    owners = np.concatenate((np.full(system.owned, comm.rank), system.halo.ghost_ranks()))
    assert (system.particles.storage("kinematics")[: len(owners), 6] == 2.0 + owners).all()
