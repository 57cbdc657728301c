"""Systems that take several steps in a common one, where theirs is shorter than that of the others.

Impulses of contact, ties and tools are given at the common step alone (Strang's splitting, as ever; r-RESPA of
Tuckerman, Berne, Martyna, J. Chem. Phys. 97 (1992) 1990), so within it systems do not know of one another.
"""

from collections.abc import Sequence
from math import ceil
from typing import Any

from parsolid.collective import minimum
from parsolid.methods.protocol import ParticleSystem

# steps of a system in a common one, at most
MOST = 64
# of the common step that others allow, where a system takes as many as it needs: impulses between systems have errors
# of second order in it, 4e-3 of the energy at the whole of it (docs/contact.md)
_SHARE = 0.25
# of a step, by which one may be longer than stable
_ROUND_OFF = 1e-9


class Subcycling:
    """How many steps each system takes in a common one; nothing where all take one.

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
