"""Bodies that contact alone holds are brought into contact before a load presses them.

At an equilibrium in which such a body touches nothing, no force acts along its free shifts and turns, so closing the
gap takes no work. The body moves rigidly, q, to where contact bears a push p so small that nothing deforms:

    minimise  contact energy(q) - p . q,   p along the load that comes

by Newton's method on the few q, in a trust region and in the eigenvectors of its matrix, of which many are 0.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from decomposition.reduction import sums

# displacement over the spacing by which the push would move one particle of the body; unbalanced share of the push
_DEPTH, _LEFT = 1e-6, 0.1
# longest motion of a trial over the spacing, and the largest number of trials
_REACH, _TRIALS = 0.5, 150
# stiffness over that of a particle, and force over the push, that count as none
_NONE = 1e-6


class Meeting(NamedTuple):
    """What contact does after a rigid motion: energy [J] of all ranks; force (k,) [N] along modes."""

    energy: float
    force: np.ndarray


def close_gaps(
    comm: Any,
    modes: np.ndarray,
    load: np.ndarray,
    rounding: float,
    stiffness: float,
    spacing: float,
    meet: Callable[[np.ndarray], tuple[float, np.ndarray]],
    product: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray | None:
    """The rigid motion (owned, d) [m] that brings bodies into contact, all zero where they need none, None where
    nothing comes to bear the load; collective.

    modes (k, owned, d): rigid motions whose largest component over all ranks is 1; load (owned, d) [N]: the change of
    loads that comes, up to rounding [N]; stiffness [N/m]: of one particle; meet: this rank's energy [J] and forces
    (owned, d) [N] of contact after a displacement (owned, d); product: by how much these forces change along one, at
    the place met last.
    """

    def along(vectors: np.ndarray) -> np.ndarray:
        return np.asarray(sums(comm, np.tensordot(modes, vectors, ((1, 2), (0, 1)))))

    def met(q: np.ndarray) -> Meeting:
        energy, force = meet(np.tensordot(q, modes, 1))
        return Meeting(float(sums(comm, [energy])[0]), along(force))

    def matrix() -> tuple[np.ndarray, np.ndarray]:
        K = -along(np.moveaxis(np.stack([product(mode) for mode in modes]), 0, -1))
        return np.linalg.eigh(0.5 * (K + K.T))

    q, push = np.zeros(len(modes)), along(load)
    size = float(np.abs(push).max(initial=0.0))
    if size <= max(_NONE * float(sums(comm, [np.abs(load).sum()])[0]), rounding):
        return np.zeros(load.shape)
    push *= _DEPTH * spacing * stiffness / size
    size = float(np.linalg.norm(push))
    first = now = met(q)
    values, vectors = matrix()
    reach = _REACH * spacing
    for _ in range(_TRIALS):
        left = push + now.force - first.force
        held = np.abs((push @ vectors)[values < _NONE * stiffness]).max(initial=0.0) < _NONE * size
        if float(np.linalg.norm(left)) <= (1.01 if held else _LEFT) * size:
            return np.tensordot(q, modes, 1)
        wanted = left @ vectors
        wanted /= np.maximum(np.maximum(np.abs(values), np.abs(wanted) / reach), 1e-300)
        step = vectors @ wanted
        trial = met(q + step)
        if trial.energy - now.energy - (push - first.force) @ step <= 0.0:
            q, now, reach = q + step, trial, min(2.0 * reach, _REACH * spacing)
            values, vectors = matrix()
        else:
            reach = 0.25 * float(np.abs(step).max())
    return None
