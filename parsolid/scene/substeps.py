"""Where steps of a method within the common one of several mean nothing."""

from typing import Any

from parsolid.scene.base_model import Detail


def substep_faults(scene: Any) -> list[Detail]:
    """Of one system alone; of solvers of equilibrium, or that break bonds; where all take several."""
    systems = scene.systems
    stated = [system for system in systems if system.settings.substeps not in (None, 1)]
    details: list[Detail] = []
    for system in stated:
        place, found = (*system.place, "substeps"), system.settings.substeps
        if len(systems) == 1:
            details.append((place, "no such key where no other system takes steps", found))
        refused = system.settings.substeps_refused()
        if refused is not None:
            details.append((place, f"no such key {refused}", found))
    timed = [system for system in systems if getattr(system.settings, "balance", "particles") == "measured"]
    if len(systems) == 1:
        details += [((*one.place, "balance"), "'particles' where there is one method", "measured") for one in timed]
    whole = [system for system in stated if isinstance(system.settings.substeps, int)]
    if len(systems) > 1 and len(whole) == len(systems):
        expected = "1 or 'auto' for one method at least"
        details.append(((*systems[0].place, "substeps"), expected, systems[0].settings.substeps))
    return details
