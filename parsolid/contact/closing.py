"""What contact allows of the next step: of its stiffness, and by how far bodies may come nearer in one."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.contact import passes, pressing
from parsolid.contact.list_kernels import longest_step, spread, time_until_pressed
from parsolid.contact.lists import SEEN

# of R and of its penetration, by what a particle may come nearer or go in a step: its force is taken to change evenly
# in it, and stiffens most where it begins
MOST_CLOSED = (0.007, 0.1)
# of R, by what a particle comes nearer in a step where contact looks ahead: what is slower has been seen before
FAST = 0.05
# of that, by what the entries of a rank move against one another before it looks
_SLOW = 0.5


class Seen(NamedTuple):
    """What `longest_step` takes of owned entries: colours (owned,), constants (owned, 5), steps (owned,) [s] that the
    stiffness allows, and penetrations (owned,) [m]."""

    colour: np.ndarray
    constants: np.ndarray
    longest: np.ndarray
    level: np.ndarray


def closing_step(seen: Seen, before: np.ndarray, step: float) -> float:
    """The step [s] that owned entries allow which see the other body; before (owned,) [m]: their penetrations a
    step [s] away."""
    arrays = seen.colour, seen.constants, seen.longest, SEEN, seen.level, before
    return float(longest_step(*arrays, step, MOST_CLOSED))


def first_step(seen: Seen, ahead: np.ndarray, time: float) -> float:
    """The step [s] from a start; ahead (owned,) [m]: penetrations after a time [s]."""
    return min(closing_step(seen, ahead, time), meeting_step(seen.constants, seen.level, ahead, time))


def step_from_rest(seen: Seen, pushed: np.ndarray, time: float) -> float:
    """Each of the first four steps [s] from rest, in the last of which forces move entries by what they may, 7/2 a
    step^2; pushed (owned,) [m]: penetrations when the forces have acted for a time [s], a time^2/2."""
    # not of those that touch alone, for which the stiffness has its say later
    free = seen._replace(longest=np.full_like(seen.longest, np.inf))
    return float(np.sqrt(closing_step(free, pushed, time) * time / 7.0))


def meeting_step(constants: np.ndarray, now: np.ndarray, ahead: np.ndarray, time: float) -> float:
    """The step [s] in which no owned entry goes deeper than it may that does not press yet; now, ahead (owned,) [m]:
    penetrations in the present places and in those after a time [s]."""
    return float(time_until_pressed(constants, now, ahead, time, (*MOST_CLOSED, FAST)))


def step_ahead(
    matter: passes.Matter, lists: passes.Lists, level: np.ndarray, moved: np.ndarray, step: float, time: float
) -> float:
    """`meeting_step` for a time [s] in which entries go on as in the last step [s]; inf where they are too slow for it.

    level (owned,) [m]: penetrations; moved (n, d) [m]: displacements in the last step, those of ghosts behind.
    """
    if step == 0.0 or not len(moved):
        return float(np.inf)
    # of what an image moves, too
    span = float(np.sqrt(spread(moved)[lists.code is not None]))
    most = _SLOW * FAST / float(matter.constants[:, 3].max())
    if time / step * span <= most:
        return float(np.inf)
    return meeting_step(matter.constants, level, levels_at(matter, lists, matter.place + time / step * moved), time)


def levels_at(matter: passes.Matter, lists: passes.Lists, place: np.ndarray) -> np.ndarray:
    """Penetrations (owned,) [m] in other places (n, d) [m]."""
    owned = len(lists.feels)
    colour, level, record = np.empty(owned), np.empty(owned), np.empty((owned, 2))
    arrays: Any = matter._replace(place=place), lists, True, colour, level, record
    pressing.colours(owned, *arrays)
    return level
