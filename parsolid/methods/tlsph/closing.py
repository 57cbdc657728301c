"""Bodies that contact alone holds are brought into contact before a load presses them.

At an equilibrium in which such a body touches nothing, no force acts along its free shifts and turns, so closing the
gap takes no work. The body moves rigidly, q, to where contact bears a push p so small that nothing deforms:

    minimise  contact energy(q) - p . q,   p along the load that comes

by Newton's method on the few q, in a trust region and in the eigenvectors of its matrix, of which many are 0. A turn
of q is a linear one, which strains the body in second order: it is made a rotation, and q found again from there.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from decomposition.reduction import sums

# displacement over the spacing by which the push would move one particle of the body; unbalanced share of the push
_DEPTH, _LEFT = 1e-6, 0.1
# longest motion of a trial over the spacing, and the largest number of trials
_REACH, _TRIALS = 0.5, 150
# stiffness over that of a particle, and force over the push, that count as none
_NONE = 1e-6
# a turn that strains nothing, and how often one is made a rotation
_TURN, _TURNS = 1e-7, 8


Met = Callable[[np.ndarray], tuple[float, np.ndarray]]


class Meeting(NamedTuple):
    """What contact does after a rigid motion: energy [J] of all ranks; force (k,) [N] along modes."""

    energy: float
    force: np.ndarray


class Loose(NamedTuple):
    """Bodies that contact alone holds: modes (k, owned, d), rigid motions of one body each, whose largest component
    over all ranks is 1; groups: the particles (owned,) bool of each body, or of those that are joined; names: of what
    each can do."""

    modes: np.ndarray
    groups: Sequence[np.ndarray] = ()
    names: Sequence[str] = ()


def close_gaps(
    comm: Any,
    loose: Loose,
    places: np.ndarray,
    load: np.ndarray,
    rounding: float,
    stiffness: float,
    spacing: float,
    meet: Met,
    product: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray | None:
    """The rigid motion (owned, d) [m] that brings bodies into contact, all zero where they need none, None where
    nothing comes to bear the load; collective.

    places (owned, d) [m]; load (owned, d) [N]: the change of loads that comes, up to rounding [N]; stiffness [N/m]: of
    one particle; meet: this rank's energy [J] and forces (owned, d) [N] of contact after a displacement (owned, d);
    product: by how much these forces change along one, at the place met last.
    """
    moved, modes = np.zeros(load.shape), loose.modes.copy()
    before = meet(moved)[1].copy()
    for _ in range(_TURNS):
        start = moved
        search = _Search(comm, modes, before, stiffness, spacing, lambda way, start=start: meet(start + way), product)
        way = search.run(load, rounding)
        if way is None:
            return None
        largest = 0.0
        moved = start.copy()
        for here in loose.groups:
            shift, R, turn = _rotation(comm, (places + start)[here], way[here])
            moved[here] += shift
            modes[:, here] = modes[:, here] @ R.T
            largest = max(largest, turn)
        if largest <= _TURN:
            break
    return moved


def _rotation(comm: Any, places: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The displacement (n, d) [m] of a rotation about the middle of places (n, d) [m], in place of the linear turn in a
    rigid way (n, d) [m]; the rotation (d, d) and its angle."""
    d = places.shape[1]
    count, *both = sums(comm, [float(len(places)), *places.sum(axis=0), *way.sum(axis=0)])
    middle, shift = np.reshape(both, (2, d)) / max(count, 1.0)
    arm, moved = np.zeros((2, len(places), 3))
    arm[:, :d], moved[:, :d] = places - middle, way - shift
    inertia = np.vdot(arm, arm) * np.eye(3) - arm.T @ arm
    found = sums(comm, np.column_stack((inertia, np.cross(arm, moved).sum(axis=0))))
    turn = np.linalg.lstsq(found[:, :3], found[:, 3], rcond=1e-9)[0]
    angle = float(np.linalg.norm(turn))
    W = np.cross(turn / max(angle, 1e-300), -np.eye(3))
    R = (np.eye(3) + np.sin(angle) * W + (1.0 - np.cos(angle)) * W @ W)[:d, :d]
    return shift + arm[:, :d] @ (R - np.eye(d)).T, R, angle


class _Search:
    """Newton's method for the amounts q (k,) of modes (k, owned, d); before (owned, d) [N]: forces of contact in
    equilibrium; stiffness, spacing, meet, product: see `close_gaps`."""

    def __init__(
        self,
        comm: Any,
        modes: np.ndarray,
        before: np.ndarray,
        stiffness: float,
        spacing: float,
        meet: Any,
        product: Any,
    ) -> None:
        self.comm, self.modes, self.stiffness, self.spacing = comm, modes, stiffness, spacing
        self.meet, self.product, self.first = meet, product, self.along(before)

    def along(self, vectors: np.ndarray) -> np.ndarray:
        """Parts (k, ...) of vectors (owned, d, ...) along the modes."""
        return np.asarray(sums(self.comm, np.tensordot(self.modes, vectors, ((1, 2), (0, 1)))))

    def met(self, q: np.ndarray) -> Meeting:
        """After a motion."""
        energy, force = self.meet(np.tensordot(q, self.modes, 1))
        return Meeting(float(sums(self.comm, [energy])[0]), self.along(force))

    def matrix(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness of contact at the motion met last: its values (k,) and vectors (k, k)."""
        K = -self.along(np.moveaxis(np.stack([self.product(mode) for mode in self.modes]), 0, -1))
        return np.linalg.eigh(0.5 * (K + K.T))

    def run(self, load: np.ndarray, rounding: float) -> np.ndarray | None:
        """See `close_gaps`."""
        q, push = np.zeros(len(self.modes)), self.along(load)
        size = float(np.abs(push).max(initial=0.0))
        if size <= max(_NONE * float(sums(self.comm, [np.abs(load).sum()])[0]), rounding):
            return np.zeros(load.shape)
        push *= _DEPTH * self.spacing * self.stiffness / size
        size = float(np.linalg.norm(push))
        now, reach, near = self.met(q), _REACH * self.spacing, None
        values, vectors = self.matrix()
        for _ in range(_TRIALS):
            left = push + now.force - self.first
            free = vectors[:, values < _NONE * self.stiffness]
            held, borne = (np.abs(one @ free).max(initial=0.0) < _NONE * size for one in (push, left))
            if float(np.linalg.norm(left)) <= (1.01 if held else _LEFT) * size:
                near = q if near is None else near
                if borne:
                    return np.tensordot(q, self.modes, 1)
            wanted = left @ vectors
            # shares of the way along free directions are those of the push
            wanted /= np.maximum(np.maximum(np.abs(values), np.abs(wanted).max() / reach), 1e-300)
            step = vectors @ wanted
            trial = self.met(q + step)
            if trial.energy - now.energy - (push - self.first) @ step <= 0.0:
                q, now, reach = q + step, trial, min(2.0 * reach, _REACH * self.spacing)
                values, vectors = self.matrix()
            else:
                reach = 0.25 * float(np.abs(step).max())
        # as contact bears it but for a motion along the face
        return None if near is None else np.tensordot(near, self.modes, 1)
