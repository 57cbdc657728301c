"""The largest next step [s] that contact allows, by its stiffness and by the change of penetrations in a step.

One rule holds for all candidates within reach of the other body: the step is stable with their stiffness, and changes
their penetration by no more than a share of the kernel's radius plus a share of the penetration. The rate of change is
that of the last step; for particles too fast to have been within reach before, that of the present velocity; at the
start, that of a push from rest.
"""

import math
from typing import Any

import numpy as np

from parsolid.collective import minimum
from parsolid.contact.bodies import ContactBodies
from parsolid.contact.forces import FREE, Candidates, Pairs, Pressure, find_penetrations
from parsolid.kernels import kernel

# share of the threshold: particles of a greater colour bound the step
SEEN = 0.5
# shares of R and of the penetration, by which the penetration may change in a step: forces are taken to change linearly
# in a step
MOST_CLOSED = (0.007, 0.1)
# share of R: particles that approach by more in a step are looked for ahead; slower ones have bounded steps before
FAST = 0.05
# share of FAST that candidates must move against one another before any are looked for
_SLOW = 0.5
# number of steps that the state at the start bounds
_STARTING = 3


@kernel
def closing_step(points, pressure, longest, before, step, seen, most):
    """The least of the steps [s] allowed by owned candidates whose colour is more than a share `seen` of the threshold.

    longest (m,) [s]: allowed by the stiffness; before (m,) [m]: penetrations a time `step` [s] earlier or later; most:
    see `MOST_CLOSED`.
    """
    least = math.inf
    for a in range(len(longest)):
        if pressure.colour[a] > seen * points.threshold[a]:
            allowed = most[0] / points.per_reach[a] + most[1] * max(pressure.penetration[a], 0.0)
            least = min(least, longest[a])
            # smaller colours give no rate: whether they are known depends on when lists were made
            if before[a] > (seen - 1.0) * points.threshold[a] * points.per_slope[a]:
                least = min(least, step * allowed / max(abs(pressure.penetration[a] - before[a]), 1e-300))
    return least


@kernel
def meeting_step(per_reach, now, ahead, time, most, fast):
    """The least time [s] in which the penetration of a fast owned candidate changes by more than allowed.

    Fast ones go deeper by more than a share `fast` of R in `time` [s]. now, ahead (m,) [m]: penetrations at the start
    and the end of that time; most: see `MOST_CLOSED`.
    """
    least = math.inf
    for a in range(len(now)):
        if ahead[a] > 0.0:
            change, allowed = ahead[a] - now[a], most[0] / per_reach[a] + max(-now[a], most[1] * now[a])
            if change > max(allowed, fast / per_reach[a]):
                least = min(least, time * allowed / change)
    return least


@kernel
def spread(moved):
    """Squares [m^2] of the diagonals of two boxes: of displacements (n, 3), and of these and their negatives."""
    among, both = 0.0, 0.0
    for i in range(moved.shape[1]):
        low, high = math.inf, -math.inf
        for a in range(len(moved)):
            low, high = min(low, moved[a, i]), max(high, moved[a, i])
        among += (high - low) ** 2
        both += 4.0 * max(high, -low) ** 2
    return among, both


def penetrations_after(points: Candidates, pairs: Pairs, displacement: np.ndarray) -> np.ndarray:
    """Penetrations (m,) [m] of owned candidates after displacements (n, 3) [m] of all n candidates."""
    rows, count = points.rows.copy(), len(points.share)
    rows[:, :3] += displacement
    found = Pressure._make([*np.zeros((2, count)), np.full(count, FREE), *np.zeros((2, len(rows)))])
    find_penetrations(points._replace(rows=rows), pairs, False, found)
    return found.penetration


class StepRule:
    """The step that contact allows on this rank; all in [s].

    points, pairs, pressure: the present candidates; longest (m,): steps that their stiffness allows. last: the last
    step, or the first; shortest: allowed by the stiffest contact; unseen: what a step may grow to before contact bounds
    it, 0 unless bodies are so fast that lists are widened; allowed: by the present positions; at_start: by the state at
    the start, for the next `starting` steps.
    """

    points: Candidates
    pairs: Pairs
    pressure: Pressure
    longest: np.ndarray

    def __init__(self, contact: ContactBodies) -> None:
        self.last = self.shortest = min(law.longest for _, law in contact.laws)
        self.unseen, self.allowed = 0.0, np.inf
        self.at_start, self.starting = np.inf, 0

    @property
    def step(self) -> float:
        """The step [s] that contact allows; it does not depend on when lists were made."""
        return min(self.allowed, self.at_start) if self.starting else self.allowed

    def begin(self, ahead: np.ndarray) -> None:
        """At the start; ahead (m,) [m]: penetrations after two steps with the present velocities."""
        time = 2.0 * self.last
        self.allowed = min(self._closing(ahead, time, self.longest), self._meeting(ahead, time))

    def start_from_rest(self, comm: Any, pushed: np.ndarray, met: float) -> None:
        """Bound the first steps; collective. pushed (m,) [m]: penetrations after a displacement a shortest^2/2, a the
        acceleration by contact; met: time until bodies may meet."""
        # the stiffness bounds later steps
        free = np.full_like(self.longest, np.inf)
        # in the last of four steps from rest particles move by 7/2 a step^2
        pressed = minimum(comm, float(np.sqrt(self._closing(pushed, self.shortest, free) * self.shortest / 7.0)))
        self.at_start, self.starting = min(max(0.5 * met, self.shortest), pressed), _STARTING

    def update(self, before: np.ndarray) -> None:
        """After a step from the penetrations `before` (m,) [m]; fast particles are looked for ahead with the velocities
        of this step."""
        points, pairs = self.points, self.pairs
        self.allowed = self._closing(before, self.last, self.longest)
        if self.last == 0.0 or not len(points.moved):
            return
        # an upper bound of the next step; images move the other way
        time = max(self.last, self.shortest, self.unseen)
        span = float(np.sqrt(spread(points.moved)[pairs.image is not None]))
        if time / self.last * span > _SLOW * FAST / float(points.per_reach.max(initial=0.0) or np.inf):
            ahead = penetrations_after(points, pairs, time / self.last * points.moved)
            self.allowed = min(self.allowed, self._meeting(ahead, time))

    def _closing(self, other: np.ndarray, time: float, longest: np.ndarray) -> float:
        return float(closing_step(self.points, self.pressure, longest, other, time, SEEN, MOST_CLOSED))

    def _meeting(self, ahead: np.ndarray, time: float) -> float:
        now = self.pressure.penetration
        return float(meeting_step(self.points.per_reach, now, ahead, time, MOST_CLOSED, FAST))
