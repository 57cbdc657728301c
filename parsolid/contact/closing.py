"""What contact allows of the next step: of its stiffness, and by how far bodies may come nearer in one."""

from typing import Any

import numpy as np

from parsolid.contact import passes
from parsolid.contact.list_kernels import longest_step, time_until_pressed
from parsolid.contact.lists import SEEN

# of R, by what a particle may come nearer or go in a step: its force is taken to change evenly in it
MOST_CLOSED = 0.02
# of that, by what the entries of a rank may move against one another before it looks ahead
_SLOW = 0.5


def closing_step(
    colour: np.ndarray, constants: np.ndarray, longest: np.ndarray, after: np.ndarray, before: np.ndarray, step: float
) -> float:
    """The step [s] that owned entries allow which see the other body; after, before (owned,) [m]: their penetrations, a
    step [s] apart."""
    return float(longest_step(colour, constants, longest, SEEN, after, before, step, MOST_CLOSED))


def meeting_step(constants: np.ndarray, now: np.ndarray, ahead: np.ndarray, time: float) -> float:
    """The step [s] in which no owned entry goes deeper than it may that does not press yet; now, ahead (owned,) [m]:
    penetrations in the present places and in those after a time [s]."""
    return float(time_until_pressed(constants, now, ahead, time, MOST_CLOSED))


def step_ahead(
    matter: passes.Matter, lists: passes.Lists, moved: np.ndarray, step: float, coming: float, time: float
) -> float:
    """`meeting_step` for a time [s] after the step [s] that comes, of entries that go on as in the last one [s]; inf
    where they are too slow for it.

    The step that comes has been agreed on when contact looks at the state before it. moved (n, d) [m]: displacements in
    the last step of entries, those of ghosts behind.
    """
    if step == 0.0 or not len(moved):
        return float(np.inf)
    # of what an image moves, too
    span = np.ptp(moved, axis=0) if lists.code is None else 2.0 * np.abs(moved).max(axis=0)
    most = _SLOW * MOST_CLOSED / float(matter.constants[:, 3].max())
    if time / step * float(np.sqrt(span @ span)) <= most:
        return float(np.inf)
    first, last = (levels_at(matter, lists, matter.place + when / step * moved) for when in (coming, coming + time))
    return meeting_step(matter.constants, first, last, time)


def levels_at(matter: passes.Matter, lists: passes.Lists, place: np.ndarray) -> np.ndarray:
    """Penetrations (owned,) [m] in other places (n, d) [m]."""
    owned = len(lists.feels)
    colour, level, record = np.empty(owned), np.empty(owned), np.empty((owned, 2))
    arrays: Any = matter._replace(place=place), lists, True, colour, level, record
    passes.colours(owned, *arrays)
    return level
