"""What contact allows of the next step [s]: by its stiffness, and by how far bodies may come nearer in one.

The rule is one for all candidates: of those that see the other body, a step that their stiffness allows, and one in
which their penetration changes by no more than a share of the kernel's radius and of itself. The change is that of the
last step; that of the time ahead where particles come so fast that they have not been seen before; that of a push from
rest at the start.
"""

import math
from typing import NamedTuple

import numpy as np

from parsolid.contact.bodies import ContactBodies
from parsolid.contact.forces import FREE, Candidates, Pairs, Pressure, find_penetrations
from parsolid.kernels import kernel

# of its threshold, what a particle sees of a body that it has met
SEEN = 0.5
# of R and of its penetration, by what a particle may come nearer or go in a step: its force is taken to change evenly
# in it, and stiffens most where it begins
MOST_CLOSED = (0.007, 0.1)
# of R, by what a particle comes nearer in a step where contact looks ahead: what is slower has been seen before
FAST = 0.05
# of that, by what the candidates of a rank move against one another before it looks
_SLOW = 0.5
# ends of steps until contact has seen what was apart at the start and met within two steps
_STARTING = 3


@kernel
def closing_step(points, pressure, longest, before, step, seen, most):
    """The least step [s] that owned candidates allow that see more than a share `seen` of their threshold.

    longest (m,) [s]: by their stiffness; before (m,) [m]: penetrations a time `step` [s] away; most: shares of R and of
    the penetration by which these may change in a step.
    """
    least = math.inf
    for a in range(len(longest)):
        if pressure.colour[a] > seen * points.threshold[a]:
            allowed = most[0] / points.per_reach[a] + most[1] * max(pressure.penetration[a], 0.0)
            least = min(least, longest[a])
            # what saw less before has no rate yet: whether it had a colour then depends on when lists were made
            if before[a] > (seen - 1.0) * points.threshold[a] * points.per_slope[a]:
                least = min(least, step * allowed / max(abs(pressure.penetration[a] - before[a]), 1e-300))
    return least


@kernel
def meeting_step(per_reach, now, ahead, time, most, fast):
    """The least time [s] in which owned candidates go deeper than they may, of those that go by more than a share
    `fast` of R in a time [s]; now, ahead (m,) [m]: penetrations at its start and its end; most as in `closing_step`."""
    least = math.inf
    for a in range(len(now)):
        if ahead[a] > 0.0:
            change, allowed = ahead[a] - now[a], most[0] / per_reach[a] + max(-now[a], most[1] * now[a])
            if change > max(allowed, fast / per_reach[a]):
                least = min(least, time * allowed / change)
    return least


@kernel
def spread(moved):
    """Square [m^2] of the diagonal of the box of displacements (n, 3), and of the one that has their negatives, too."""
    among, both = 0.0, 0.0
    for i in range(moved.shape[1]):
        low, high = math.inf, -math.inf
        for a in range(len(moved)):
            low, high = min(low, moved[a, i]), max(high, moved[a, i])
        among += (high - low) ** 2
        both += 4.0 * max(high, -low) ** 2
    return among, both


def penetrations_after(points: Candidates, pairs: Pairs, displacement: np.ndarray) -> np.ndarray:
    """Penetrations (m,) [m] of owned candidates when all n have moved by displacements (n, 3) [m]."""
    rows, count = points.rows.copy(), len(points.share)
    rows[:, :3] += displacement
    found = Pressure._make([*np.zeros((2, count)), np.full(count, FREE), *np.zeros((2, len(rows)))])
    find_penetrations(points._replace(rows=rows), pairs, False, found)
    return found.penetration


class Seen(NamedTuple):
    """The candidates of a rank in the present places: with the steps (m,) [s] that their stiffness allows."""

    points: Candidates
    pairs: Pairs
    pressure: Pressure
    longest: np.ndarray


class StepRule:
    """The step that contact allows on this rank.

    last [s]: the last step, or that of the start; shortest [s]: of the stiffest contact, by its stiffness alone;
    unseen [s]: how long a step may get before contact has a say, where bodies come so fast that lists reach ahead, else
    0; allowed [s]: by the present places; at_start [s], starting: what the state at the start allows, and of how many
    steps yet.
    """

    def __init__(self, contact: ContactBodies) -> None:
        self.last = self.shortest = min(law.longest for _, law in contact.laws)
        self.unseen, self.allowed = 0.0, np.inf
        self.at_start, self.starting = np.inf, 0

    @property
    def horizon(self) -> float:
        """The longest [s] that the next step may be as far as contact knows."""
        return max(self.last, self.shortest, self.unseen)

    @property
    def step(self) -> float:
        """Largest step [s], by the present places alone, so that it does not depend on when lists were made."""
        return min(self.allowed, self.at_start) if self.starting else self.allowed

    def begin(self, seen: Seen, ahead: np.ndarray) -> None:
        """At the start; ahead (m,) [m]: penetrations after two steps with the present velocities."""
        time, share = 2.0 * self.last, (SEEN, MOST_CLOSED)
        closing = closing_step(seen.points, seen.pressure, seen.longest, ahead, time, *share)
        meeting = meeting_step(seen.points.per_reach, seen.pressure.penetration, ahead, time, MOST_CLOSED, FAST)
        self.allowed = min(closing, meeting)

    def from_rest(self, seen: Seen, pushed: np.ndarray) -> float:
        """Each of the first four steps [s] from rest, in the last of which forces move candidates by what they may, 7/2
        a step^2; pushed (m,) [m]: penetrations when the forces have acted for the shortest step, a step^2/2."""
        # not of those that touch alone, for which the stiffness has its say later
        free = np.full_like(seen.longest, np.inf)
        step = closing_step(seen.points, seen.pressure, free, pushed, self.shortest, SEEN, MOST_CLOSED)
        return float(np.sqrt(step * self.shortest / 7.0))

    def start_with(self, pressed: float, met: float) -> None:
        """First steps [s]: `from_rest` of all ranks, and the time [s] until bodies that are apart may meet."""
        self.at_start, self.starting = min(max(0.5 * met, self.shortest), pressed), _STARTING

    def update(self, seen: Seen, before: np.ndarray) -> None:
        """After a step from the penetrations `before` (m,) [m]."""
        arrays = seen.points, seen.pressure, seen.longest, before
        self.allowed = min(closing_step(*arrays, self.last, SEEN, MOST_CLOSED), self._step_ahead(seen))

    def _step_ahead(self, seen: Seen) -> float:
        """`meeting_step` of a time in which candidates go on as in the last step; inf where they are too slow."""
        points, time = seen.points, self.horizon
        if self.last == 0.0 or not len(points.moved):
            return float(np.inf)
        # of what an image moves, too
        span = float(np.sqrt(spread(points.moved)[seen.pairs.image is not None]))
        if time / self.last * span <= _SLOW * FAST / float(points.per_reach.max(initial=0.0) or np.inf):
            return float(np.inf)
        ahead = penetrations_after(points, seen.pairs, time / self.last * points.moved)
        return float(meeting_step(points.per_reach, seen.pressure.penetration, ahead, time, MOST_CLOSED, FAST))
