"""The pairs of a Verlet list as sweeps take them: within bodies or between two, and within the support or nearly so.

Half of the pairs of a list with a skin are beyond the support. Each rank leaves them out of the sweeps until a particle
has moved so far that one might have come within it (dual lists: Pall and Hess, Comput. Phys. Commun. 184, 2013). Sums
are the same to the bit: those pairs would add nothing to them.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import kernel
from parsolid.methods.ulsph.pair_weights import reference_weights
from parsolid.pairs.verlet_list import Pairs, VerletList
from parsolid.particles.container import Particles

# margin of near pairs beyond the support, over the support
_MARGIN = 0.08
# neighbours on a square lattice are nearer than this many spacings
_DIAGONAL = 1.45
# distance over the support beyond which the weight that pairs in tension keep falls, see `pair_weights.held_weight`
_LETTING_GO = 0.8


@kernel
def have_moved(rows, before, first, motion, most):
    """Whether any of the rows has moved against the first one by `most` or more from a place (rows, d), or is not a
    number; places are columns first.. of motion."""
    for a in range(rows):
        square = 0.0
        for c in range(before.shape[1]):
            square += (motion[a, first + c] - before[a, c] - (motion[0, first + c] - before[0, c])) ** 2
        if not square < most * most:
            return True
    return False


@kernel
def select_near(pairs, weights, dimension, first, length, reach, motion, start, neighbour, near_weights):
    """Write pairs closer than reach h of a pair into start and neighbour, and their weights, if there are some; lengths
    are in a column of motion."""
    count = 0
    for a in range(pairs[0].shape[0] - 1):
        start[a] = count
        for k in range(pairs[0][a], pairs[0][a + 1]):
            b = pairs[1][k]
            h, square = 0.5 * (motion[a, length] + motion[b, length]), 0.0
            for c in range(first, first + dimension):
                square += (motion[b, c] - motion[a, c]) ** 2
            # without a branch, which would be mispredicted at every other pair
            neighbour[count] = b
            if weights is not None:
                near_weights[count] = weights[k]
            count += np.int64(square < (reach * h) ** 2)
    start[-1] = count


class NearPairs:
    """A list of pairs of the first rows of motion, and the near ones of them with their weights."""

    def __init__(self, pairs: Pairs, weights: np.ndarray | None, rows: int, dimension: int, support: float) -> None:
        """weights (pairs,): a number for each pair, or None; support: of the kernel, over the smoothing length."""
        self._all, self._weights, self._rows = pairs, weights, rows
        self._dimension, self._support = dimension, support
        # columns of places and smoothing lengths, see `sweeps`
        self._first, self._length = (2, 5) if dimension == 2 else (4, 7)
        # the last one takes what is no pair
        room = len(pairs.neighbour) + 1
        self._near = Pairs(np.empty_like(pairs.start), np.empty(room, pairs.neighbour.dtype))
        self._near_weights = None if weights is None else np.empty(room)
        self._before: np.ndarray | None = None
        self._most = 0.0

    def find(self, motion: np.ndarray) -> tuple[Pairs, np.ndarray | None]:
        """The pairs that may be within the support, and their weights."""
        if self._before is None or have_moved(self._rows, self._before, self._first, motion, self._most):
            # until a particle has moved by nearly half of the margin
            rows, first = self._rows, self._first
            self._before = motion[:rows, first : first + self._dimension].copy()
            self._most = 0.499 * _MARGIN * self._support * float(motion[:rows, self._length].min(initial=np.inf))
            columns = self._dimension, first, self._length, (1.0 + _MARGIN) * self._support
            select_near(self._all, self._weights, *columns, motion, *self._near, self._near_weights)
        return self._near, self._near_weights

    def arrays(self) -> list[np.ndarray]:
        arrays = [self._before, *self._near, self._weights, self._near_weights]
        return [array for array in arrays if array is not None]


class Part(NamedTuple):
    """Pairs that a sweep treats alike. between: pairs of two bodies; code: of the mirror images, None where sweeps do
    not tell images of different planes apart."""

    near: NearPairs
    between: bool
    code: int | None


def parts_of_list(
    particles: Particles, pairs: VerletList, dimension: int, smoothing: Any, corrected: bool
) -> tuple[list[Part], list[Part], list[Part]]:
    """The parts of a list that was just made: pairs of owned particles, with ghosts, and with mirror images.

    corrected: whether pairs in tension within a body keep the weights of their reference distances.
    """
    known = particles.owned + particles.ghosts
    places = particles["reference_position"][:known]
    lengths = particles["smoothing_length"][:known]
    body = particles["contact_body"][:known] if "contact_body" in particles else None
    images, codes = pairs.images, pairs.codes
    if images is not None:
        R, T = codes.reflections[images.code, :dimension], codes.shifts_at_start[images.code, :dimension]
        places = np.concatenate((places, R * places[images.source] + T))
        lengths = np.concatenate((lengths, lengths[images.source]))
        body = None if body is None else np.concatenate((body, body[images.source]))
    places, lengths = np.ascontiguousarray(places), np.ascontiguousarray(lengths)

    def part(chosen: Pairs, rows: int, between: bool, code: int | None) -> Part:
        weights = None
        if corrected and not between:
            weights = np.empty(len(chosen.neighbour))
            reference_weights(smoothing, chosen, places, lengths, weights)
        return Part(NearPairs(chosen, weights, rows, dimension, smoothing.support), between, code)

    def parts(chosen: Pairs, rows: int, code: int | None = None) -> list[Part]:
        between = None if body is None else body[chosen.particle] != body[chosen.neighbour]
        if between is None or not between.any():
            return [part(chosen, rows, False, code)]
        within = part(chosen.where(~between), rows, False, code)
        return [within, part(chosen.where(between), rows, True, code)]

    inner = parts(pairs.inner, particles.owned)
    outer = [] if pairs.outer is None else parts(pairs.outer, known)
    if pairs.mirror is None or images is None:
        return inner, outer, []
    if not (codes.moving or (codes.signs != codes.reflections).any()):
        return inner, outer, parts(pairs.mirror, len(places))
    of_code = images.code[pairs.mirror.neighbour - known]
    mirror = []
    for code in range(len(codes.planes)):
        mirror += parts(pairs.mirror.where(of_code == code), len(places), code)
    return inner, outer, mirror


def has_torn(particles: Particles, pairs: VerletList, dimension: int, support: float) -> bool:
    """Whether neighbours of the reference lattice, one of them on this rank, which have neither flowed nor failed, are
    so far apart that the weight which they keep in tension is about to fall. Collective."""
    of = particles
    sound = of.owned_rows("plastic_strain") == 0.0
    if "damage" in of:
        sound &= of.owned_rows("damage") == 0.0
    spacing = np.prod(of.owned_rows("spacing"), axis=1) ** (1.0 / dimension)
    known = pairs.halo.with_ghosts(np.column_stack((sound, spacing, of.owned_rows("body"))))
    place, x, h = of["reference_position"], of["position"], of["smoothing_length"]
    for listed in (pairs.inner, pairs.outer):
        if listed is None:
            continue
        a, b = listed.particle, listed.neighbour
        near = np.linalg.norm(place[b] - place[a], axis=1) < _DIAGONAL * np.minimum(known[a, 1], known[b, 1])
        near &= (known[a, 0] * known[b, 0] == 1.0) & (known[a, 2] == known[b, 2])
        a, b = a[near], b[near]
        apart = np.linalg.norm(x[b] - x[a], axis=1)
        if (apart > _LETTING_GO * support * 0.5 * (h[a] + h[b])).any():
            return True
    return False
