"""How long a step is: at most the stable one, ending exactly where a run must land, of length 0 where loads jump; and
how many steps each system takes in a common one.
"""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from math import ceil
from typing import Any, TypeVar

import numpy as np

from parsolid.collective import minimum
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.contact import of_model
from parsolid.scene.load_histories import corner_times

# steps of a system in a common one, at most
MOST = 64
# of the common step that others allow, where a system takes as many as it needs: impulses between systems have errors
# of second order in it, 4e-3 of the energy at the whole of it (docs/contact.md)
_SHARE = 0.25
# of a step, by which one may be longer than stable
_ROUND_OFF = 1e-9


class Subcycling:
    """How many steps each system takes in a common one, where its own is shorter than that of the others; nothing where
    all take one.

    Impulses of contact, ties and tools are given at the common step alone (Strang's splitting; r-RESPA of Tuckerman,
    Berne, Martyna, J. Chem. Phys. 97 (1992) 1990), so within it systems do not know of one another.

    stable: largest steps [s] of all systems, agreed on by all ranks, where any system takes several.
    """

    def __init__(self, comm: Any, systems: Sequence[ParticleSystem], kept: list[float] | None):
        """kept: `stable` of a checkpoint. Collective."""
        self.requested = [system.settings.substeps or 1 for system in systems]
        self.systems, self.active = systems, any(requested != 1 for requested in self.requested)
        self.stable, self._resumed = list(kept or ()), kept is not None
        if self.active and not kept:
            self.stable = [minimum(comm, system.stable_step()) for system in systems]

    @property
    def extra(self) -> int:
        """Numbers that travel with the minimum of a step besides those of all scenes."""
        return len(self.requested) if self.active else 0

    def to_agree(self, own: Sequence[float]) -> Sequence[float]:
        """Numbers that travel: stable steps [s] of this rank's systems, those of the checkpoint at first."""
        if not self.active:
            return []
        resumed, self._resumed = self._resumed, False
        return self.stable if resumed else own

    def agreed(self, stable: float, of_systems: Sequence[float]) -> float:
        """The common step [s] from what all ranks have agreed on, as `common`."""
        if self.active and stable >= 0.0:
            self.stable = list(of_systems)
        return self.common(stable, of_systems)

    def common(self, stable: float, of_systems: Sequence[float]) -> float:
        """The common step [s] from the least one and those of all systems: that of those whose ratio is given; with
        "auto" a share of it, or of the slowest of all, but no less than the least."""
        if not self.active or stable < 0.0:
            return stable
        stated = [step * requested for step, requested in zip(of_systems, self.requested) if requested != "auto"]
        own = [step for step, requested in zip(of_systems, self.requested) if requested == "auto"]
        if not own:
            return min(stated)
        share = max(_SHARE * min(stated, default=max(own)), min(of_systems))
        return min(share, MOST * min(own), *stated)

    def count(self, number: int, step: float) -> int:
        """Steps of a system in a common one [s]."""
        if not self.active:
            return 1
        requested = self.requested[number]
        if requested == "auto":
            requested = max(1, ceil(step / self.stable[number] * (1.0 - _ROUND_OFF)))
        count = requested if step > 0.0 else 1
        self.systems[number].substeps = count
        return count


# landing on a time may stretch or halve steps but never makes a sliver
SLIVER = 1e-9
# where bodies meet, a step is at most so many times as long as the one before it: when a contact opens, the stable one
# may become ten times as long, and what leapfrog's kinetic offset gains by that is taken from the energy of waves
_GROWTH = 1.25

Self = TypeVar("Self", bound="TimeSteps")


class TimeSteps:
    """Chooses steps from the stable ones.

    stop_times, jumps: times [s] at which a step must end, at which a step of length 0 is due; end: the scene's [s];
    even: whether steps between two stop times have one length; longest, floor: the largest step, and the stable step
    that ends a run [s]; growth: the most that a step is over the one before it.
    """

    def __init__(
        self,
        stop_times: Iterable[float],
        jumps: Iterable[float],
        end: float,
        even: bool = False,
        longest: float = np.inf,
        floor: float = 0.0,
        growth: float = np.inf,
    ):
        self.jumps = frozenset(jumps)
        self.stop_times = sorted({*stop_times, *self.jumps, end})
        self.end, self.even, self.longest, self.floor, self.growth = end, even, longest, floor, growth
        # the time of the jump that the last step of length 0 was for
        self.jumped: float | None = None
        # the last step [s], 0 at the start
        self.last = 0.0

    @classmethod
    def of(cls: type[Self], scene: Scene, systems: Sequence[ParticleSystem]) -> Self:
        """Landing on the times of field output and of comparisons, on corners of formulas, and on those of every
        system."""
        stop_times = {
            *scene.fields_times,
            *scene.reference_times,
            *(t for system in systems for t in system.stop_times),
        }
        stop_times |= {time for time in corner_times(scene) if 0.0 < time < scene.end_time}
        jumps = {time for system in systems for time in system.jumps}
        even = any(system.even_steps for system in systems)
        growth = _GROWTH if of_model(scene.contact, "kernel") or scene.tools else np.inf
        result = cls(stop_times, jumps, scene.end_time, even, growth=growth)
        result.take_limits(systems)
        return result

    def take_limits(self, systems: Sequence[ParticleSystem]) -> None:
        """Take the longest and shortest step of the systems' present settings."""
        settings = [system.settings for system in systems]
        # several steps of a system may be in a common one
        times = [MOST if one.substeps == "auto" else one.substeps or 1 for one in settings]
        most = [one.maximum_step * many for one, many in zip(settings, times) if one.maximum_step is not None]
        self.longest = min(most, default=np.inf)
        least = [one.minimum_step for one in settings if one.minimum_step is not None]
        self.floor = max(least, default=1e-12 * self.end)

    def land_on(self, times: Iterable[float]) -> None:
        """Have steps end at further times [s], too."""
        self.stop_times = sorted({*self.stop_times, *times})

    def next(self, time: float, stable: float) -> tuple[float, float]:
        """(step, time it leads to) [s] after a time, from the stable step of the state."""
        if time in self.jumps and self.jumped != time:
            self.jumped = time
            return 0.0, time
        most = self.growth * self.last if self.last > 0.0 else np.inf
        return self.clip(time, min(stable, self.longest, most))

    def clip(self, time: float, stable: float) -> tuple[float, float]:
        """(step, time it leads to) [s]: at most the stable step, landing exactly on the next landing."""
        later = bisect_right(self.stop_times, time)
        target = min(self.stop_times[later], self.end) if later < len(self.stop_times) else self.end
        remaining = target - time
        if remaining <= stable * (1.0 + SLIVER):
            return remaining, target
        if self.even:
            step = float(remaining / np.ceil(remaining / stable / (1.0 + SLIVER)))
        elif remaining < 2.0 * stable:
            step = 0.5 * remaining
        else:
            step = stable
        return step, time + step
