"""Lists of pairs that are made anew as particles move: against brute force, on several ranks, and safe in between."""

import numpy as np
import pytest

from parsolid.boundary.mirror_planes import MirrorCodes, MirrorPlane
from parsolid.collective import SolverError
from parsolid.pairs.verlet_list import VerletList
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field

SUPPORT, SKIN = 2.0, 0.25
# where the bodies' particles are at a time, by their place at time 0 and their body
MOTIONS = {
    "shear": lambda x, body, t: x + t * np.eye(x.shape[1])[0] * x[:, 1:2] * 0.3,
    "rotation": lambda x, body, t: np.column_stack(
        (
            x[:, 0] * np.cos(0.3 * t) - x[:, 1] * np.sin(0.3 * t),
            x[:, 0] * np.sin(0.3 * t) + x[:, 1] * np.cos(0.3 * t),
            x[:, 2:],
        )
    ),
    "impact": lambda x, body, t: x + np.where(body == 0, 1.5, -2.0)[:, None] * t * np.eye(x.shape[1])[0],
    "passing": lambda x, body, t: x + np.where(body == 0, 6.0, 0.0)[:, None] * t * np.eye(x.shape[1])[1],
    "falling": lambda x, body, t: x - 0.8 * t * np.eye(x.shape[1])[1],
    "random": lambda x, body, t: x + 0.6 * t * np.sin(17.0 * x[:, ::-1] + 3.0 * x),
}


def two_bodies(dimension: int):
    """Places (n, d), bodies and smoothing lengths of two uneven blocks, a gap of 2.5 spacings apart."""
    shape = (12, 9) if dimension == 2 else (6, 5, 4)
    one = np.stack(np.meshgrid(*map(np.arange, map(float, shape)), indexing="ij"), axis=-1).reshape(-1, dimension)
    place = np.concatenate((one, one + np.eye(dimension)[0] * (shape[0] + 1.5)))
    random = np.random.default_rng(dimension)
    place += 0.15 * random.uniform(-1.0, 1.0, place.shape)
    body = np.repeat([0, 1], len(one))
    return place, body, np.where(body == 0, 1.3, 1.1) + 0.1 * random.uniform(size=len(place))


class Scene:
    """Two bodies on all ranks, moved as prescribed, with the lists of one rank."""

    def __init__(self, comm, dimension, motion="random", codes=None, share=None, **options):
        self.comm, self.motion, self.time = comm, MOTIONS[motion], 0.0
        self.place, self.body, self.length = two_bodies(dimension)
        rows = np.arange(comm.rank, len(self.place), comm.size) if share is None else share
        self.particles = particles = Particles(self.body[rows], np.zeros(2, np.int64))
        particles.declare(
            Field("name", 1, "1", checkpointed=True, whole=True, ghosts="forward", message="reference"), rows
        )
        reference = {"ghosts": "forward", "message": "reference"}
        particles.declare(Field("position", dimension, "m", checkpointed=True, layout=Columns(), **reference))
        particles.declare(Field("velocity", dimension, "m/s", checkpointed=True, layout=Columns()))
        particles.declare(Field("smoothing_length", 1, "m", checkpointed=True, layout=Columns()), self.length[rows])
        self.pairs = VerletList(comm, particles, dimension, SUPPORT, SKIN, codes, **options)
        self.codes = codes
        self.move(0.0)

    def everywhere(self, time):
        return self.motion(self.place, self.body, time)

    def move(self, time):
        """Bring the owned particles to their places at a time."""
        names, particles = self.particles.owned_rows("name"), self.particles
        particles.owned_rows("position")[:] = self.everywhere(time)[names]
        particles.owned_rows("velocity")[:] = (self.everywhere(time + 1e-6) - self.everywhere(time - 1e-6))[
            names
        ] / 2e-6
        self.time = time

    def listed(self):
        """Pairs of all ranks by name, (name, name, times counted by receivers), and those with images by code."""
        names = self.particles["name"]
        found = []
        for pairs in (self.pairs.inner, self.pairs.outer):
            if pairs is not None:
                found.append(np.stack((names[pairs.particle], names[pairs.neighbour])))
                if pairs is self.pairs.inner:
                    found.append(found[0][::-1])
        directed = np.concatenate(found, axis=1).T
        imaged = np.empty((0, 3), np.int64)
        if self.pairs.mirror is not None:
            mirror, images = self.pairs.mirror, self.pairs.images
            image = mirror.neighbour - self.particles.owned - self.particles.ghosts
            imaged = np.stack((names[mirror.particle], names[images.source[image]], images.code[image])).T
        together = [np.concatenate(self.comm.allgather(part)) for part in (directed, imaged)]
        return [part[np.lexsort(part.T[::-1])] for part in together]

    def close(self, factor, time):
        """The same by brute force: pairs closer than factor times the support."""
        place, length = self.everywhere(time), self.length
        reach = 0.5 * factor * SUPPORT * (length[:, None] + length[None, :])
        near = np.linalg.norm(place[:, None] - place[None, :], axis=2) < reach
        np.fill_diagonal(near, False)
        imaged = []
        for code in range(0 if self.codes is None else len(self.codes.signs)):
            d = place.shape[1]
            image = place * self.codes.reflections[code, :d] + self.codes.shifts[code, :d]
            across = np.linalg.norm(place[:, None] - image[None, :], axis=2) < reach
            across &= ~self.codes.on_planes(place, code)[None, :]
            concerned = np.all([plane.concerns(self.body) for plane in self.codes.planes[code]], axis=0)
            across &= concerned[:, None] & concerned[None, :]
            pairs = np.argwhere(across)
            imaged.append(np.column_stack((pairs, np.full(len(pairs), code))))
        mirrored = np.concatenate([np.empty((0, 3), np.int64), *imaged])
        return [np.argwhere(near), mirrored[np.lexsort(mirrored.T[::-1])]]


def corner(dimension: int) -> MirrorCodes:
    """A plane below all particles, and one behind the first body that concerns it alone."""
    planes = [MirrorPlane(1, -0.5, "roller"), MirrorPlane(0, -0.6, "fixed", 0)]
    return MirrorCodes.of(planes, 1e-6)


every_dimension = pytest.mark.parametrize("dimension", [2, 3])
mirrored = pytest.mark.parametrize("codes", [None, corner], ids=["free", "mirror"])


@every_dimension
@mirrored
def test_lists_equal_brute_force_after_every_rebuild(comm, dimension, codes):
    scene = Scene(comm, dimension, "random", codes and codes(dimension))
    for time in (0.0, 0.2, 0.4, 0.6):
        scene.move(time)
        scene.pairs.rebuild(time)
        scene.move(time)
        for found, expected in zip(scene.listed(), scene.close(1.0 + SKIN, time)):
            np.testing.assert_array_equal(found, expected)
        assert comm.allreduce(scene.pairs.directed_pairs) == sum(map(len, scene.listed()))
    assert comm.allreduce(scene.particles.owned) == len(scene.place)


# rotation turns particles through the planes
WAYS = [
    (motion, codes) for motion in sorted(MOTIONS) for codes in (None, corner) if (motion, codes) != ("rotation", corner)
]


@pytest.mark.parametrize("dimension, motion, codes", [(2 + k % 2, *way) for k, way in enumerate(WAYS)])
def test_no_pair_within_the_support_is_ever_missing(comm, dimension, motion, codes):
    scene = Scene(comm, dimension, motion, codes and codes(dimension))
    step, steps = 0.02, 60 if dimension == 2 else 40
    scene.pairs.rebuild(0.0)
    for number in range(1, steps + 1):
        # as in a run: asked at the end of a step, acted on before the next one uses lists
        wanted = comm.allreduce(scene.pairs.expires(scene.time, step))
        if wanted:
            scene.pairs.rebuild(scene.time)
        scene.move(number * step)
        if number % 2:
            # every other state is compared, of which a rebuild's last is one as often as not
            continue
        for found, needed in zip(scene.listed(), scene.close(1.0, scene.time)):
            weights = 1000 ** np.arange(found.shape[1])
            missing = np.setdiff1d(needed @ weights, found @ weights)
            assert not len(missing), (scene.time, len(missing), missing[:5])
    assert comm.allreduce(scene.pairs.late) == 0
    # and not by making lists in every step, nor where all move alike and meet no image
    assert scene.pairs.builds < 0.7 * steps
    assert (scene.pairs.builds == 1) == (motion == "falling" and codes is None)


@every_dimension
def test_bodies_in_flight_need_no_lists_until_they_meet(comm, dimension):
    scene = Scene(comm, dimension, "impact")
    scene.place[scene.body == 1] += 20.0 * np.eye(dimension)[0]
    scene.move(0.0)
    scene.pairs.rebuild(0.0)
    gap = scene.place[scene.body == 1, 0].min() - scene.place[scene.body == 0, 0].max()
    meeting = (gap - scene.pairs.reach) / 3.5
    for time in (0.1, 0.5 * meeting, 0.99 * meeting):
        scene.move(time)
        assert not comm.allreduce(scene.pairs.expires(time, 1e-3))
    scene.move(1.001 * meeting)
    assert comm.allreduce(scene.pairs.expires(scene.time, 1e-3))


def test_a_body_at_constant_velocity_needs_no_lists(comm):
    scene = Scene(comm, 2, "passing")
    scene.motion = lambda x, body, t: x + 5.0 * t
    scene.move(0.0)
    scene.pairs.rebuild(0.0)
    scene.move(100.0)
    assert not comm.allreduce(scene.pairs.expires(100.0, 0.1))
    # but towards its own image it does
    scene = Scene(comm, 2, "passing", corner(2))
    scene.motion = lambda x, body, t: x - 0.02 * t
    scene.move(0.0)
    scene.pairs.rebuild(0.0)
    allowed = 0.5 * SKIN * SUPPORT * scene.length.min()
    scene.move(0.5 * allowed / 0.02)
    assert not comm.allreduce(scene.pairs.expires(scene.time, 0.1))
    scene.move(2.0 * allowed / 0.02)
    assert comm.allreduce(scene.pairs.expires(scene.time, 0.1))


@every_dimension
def test_particles_are_dealt_out_evenly_and_selections_go_with_them(comm, dimension):
    share = np.arange(len(two_bodies(dimension)[0])) if comm.rank == 0 else np.empty(0, np.int64)
    scene = Scene(comm, dimension, "random", share=share)
    chosen = scene.particles.selection(scene.particles.owned_rows("name") % 3 == 0)
    scene.pairs.rebuild(0.0)
    owned = comm.allgather(scene.particles.owned)
    assert sum(owned) == len(scene.place) and max(owned) - min(owned) <= 2
    assert comm.allreduce(scene.pairs.migrated) == len(scene.place) - (owned[0] if comm.size > 1 else len(scene.place))
    names = scene.particles.owned_rows("name")
    np.testing.assert_array_equal(np.sort(names[chosen.rows]), np.sort(names[names % 3 == 0]))
    np.testing.assert_array_equal(scene.particles.owned_rows("position"), scene.everywhere(0.0)[names])


def test_ranks_without_particles(comm):
    scene = Scene(comm, 2, "shear")
    few = np.arange(2) if comm.rank == 0 else np.empty(0, np.int64)
    scene = Scene(comm, 2, "shear", share=few)
    scene.pairs.rebuild(0.0)
    assert len(scene.listed()[0]) == 2
    scene.move(0.1)
    scene.pairs.expires(0.1, 0.01)
    scene.pairs.rebuild(0.1)
    assert len(scene.listed()[0]) == 2


def test_storage_is_sorted_in_space(comm):
    scene = Scene(comm, 2, "random")
    scene.pairs.rebuild(0.0)
    pairs = scene.pairs.inner
    row = pairs.particle
    # shuffled, neighbours would be a third of all particles apart
    if comm.size == 1:
        assert np.abs(pairs.neighbour - row).mean() < 0.12 * scene.pairs.owned


def test_particles_at_one_place_are_refused(comm):
    scene = Scene(comm, 2, "shear")
    scene.place[40] = scene.place[41]
    scene.move(0.0)
    with pytest.raises(SolverError, match="no two particles at the same place"):
        scene.pairs.rebuild(0.0)
