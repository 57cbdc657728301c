"""What most likely helps when a run of total-Lagrangian SPH goes wrong."""

from typing import Any


def advice_of(settings: Any) -> str:
    """What most likely helps a run that goes wrong, by the settings of the method."""
    hints: list[str] = []
    crushed = "more particles where the body is crushed"
    if settings.integrator == "leapfrog" and settings.safety > 1.0:
        hints.append(f"a smaller method.safety (it is {settings.safety:g}; 0.9 is stable)")
    if settings.integrator == "ssp-rk3" and settings.cfl > 0.9:
        hints.append(f"a smaller method.cfl (it is {settings.cfl:g}; 0.7 is stable for smoothing of 0.85 and more)")
    if settings.dissipation == 0.0:
        hints.append("method.dissipation = 1 (there is none)")
    hints.append("more particles" if hints and "smaller" in hints[0] else crushed)
    return ", or ".join([*hints, "a milder load"])
