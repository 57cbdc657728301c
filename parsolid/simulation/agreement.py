"""The one reduction of a step, begun while the last system still advances and fetched before the next step."""

from collections.abc import Callable, Sequence
from functools import partial
from math import hypot, inf, isfinite
from typing import Any

from decomposition.reduction import MinimumAhead
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import ParticleSystem
from parsolid.simulation.time_step import Subcycling


class StepAgreement:
    """What all ranks agree on with one non-blocking minimum a step.

    That is the stable step, requests of ranks (to stop, to write an output whose wall time is over) and whether systems
    and interactions have found that lists are used up. A step is negative when any rank has found its state unsound.

    unsound: whether a system or interaction of this rank has lost its state; nothing but a failed run follows.
    """

    def __init__(
        self,
        comm: Any,
        systems: Sequence[ParticleSystem],
        interactions: Sequence[Interaction],
        subcycling: Subcycling,
        requests: int = 0,
    ) -> None:
        """requests: how many are agreed on."""
        self.systems, self.interactions, self.subcycling = systems, interactions, subcycling
        self.unsound = False
        self._parts: list[ParticleSystem | Interaction] = [*systems, *interactions]
        self._reported: list[float] = []
        self._requests = [0.0] * requests
        self._resumed = False
        self._reporters = {id(system): partial(self._report, system) for system in systems}
        self._minimum = MinimumAhead(comm, 2 + requests + len(self._parts) + subcycling.extra)

    def stable_step(self) -> float:
        """Largest step [s] of this rank's particles in the current state."""
        own = [system.stable_step() for system in self.systems]
        return _combined(self.subcycling.common(min(own), own), self._allowed())

    def resume(self, stable: float) -> None:
        """Begin the reduction for a state whose step [s] is known; interactions are taken into account in it."""
        self.begin_step()
        self._resumed = True
        self._begin([stable], inf, self.subcycling.stable)

    def start(self) -> None:
        """Begin the reduction for a state of which nothing is known yet."""
        self.begin_step()
        stable = [system.stable_step() for system in self.systems]
        self._begin(stable, self._allowed(), stable)

    def begin_step(self, requests: Sequence[float] = ()) -> None:
        """Before systems advance; requests: 1.0 where this rank has one."""
        self._reported.clear()
        self._requests = [-request for request in requests] or [0.0] * len(self._requests)

    def reporter(self, system: ParticleSystem) -> Callable[[bool, float], None]:
        """What a system calls within its step with (whether its state is sound, its next stable step [s])."""
        return self._reporters[id(system)]

    def _report(self, system: ParticleSystem, sound: bool, stable: float) -> None:
        sound = sound and not self.unsound and isfinite(stable)
        self._reported.append(stable if sound or system.owned == 0 else -1.0)
        if len(self._reported) == len(self.systems):
            self._begin(self._reported, self._allowed(), self._reported)

    def _begin(self, stable: Sequence[float], allowed: float, of_systems: Sequence[float]) -> None:
        rebuilds = [-float(part.rebuild_needed) for part in self._parts]
        of_subcycling = self.subcycling.to_agree(of_systems)
        self._minimum.begin((min(stable), allowed, *self._requests, *rebuilds, *of_subcycling))

    def result(self) -> tuple[float, list[bool]]:
        """The step [s] that all ranks agree on, which requests any rank had; sets `rebuild_anywhere`. Collective."""
        stable, allowed, *rest = self._minimum.result()
        first, last = len(self._requests), len(self._requests) + len(self._parts)
        for part, rebuild in zip(self._parts, rest[first:last]):
            part.rebuild_anywhere = rebuild < 0.0
        if not self._resumed:
            stable = self.subcycling.agreed(stable, rest[last:])
        self._resumed = False
        return _combined(stable, allowed), [request < 0.0 for request in rest[:first]]

    def _allowed(self) -> float:
        """Step [s] that interactions allow on this rank where nothing else acts."""
        if not self.interactions or not any(system.bounded for system in self.systems):
            return inf
        return min(interaction.stable_step() for interaction in self.interactions)


def _combined(stable: float, allowed: float) -> float:
    """Step [s] of a motion with the squares of two frequencies added, whose steps alone are these."""
    return stable if stable <= 0.0 or allowed == inf else stable / hypot(1.0, stable / allowed)
