"""What the system asks of a time solver: `velocity_verlet.VelocityVerlet` or `quasi_static.QuasiStatic`."""

from typing import Any


class TimeSolver:
    """Moves one rank's particles from step to step.

    jumps, landings: see `methods.protocol.ParticleSystem`; setting: the key of method.solution whose smaller value
    makes steps milder.
    """

    jumps: tuple[float, ...] = ()
    landings: tuple[float, ...] = ()
    setting: str

    @property
    def unheld(self) -> bool:
        """Whether the last step found no balance because nothing holds a piece of the bodies."""
        return False

    def cost_notes(self) -> list[str]:
        """What makes a run cost more than its particles say; collective, the same on all ranks."""
        return []

    def begin(self) -> None:
        """What the solver changes in the bodies' initial displacement and velocity."""

    def stable_step(self) -> float:
        """Largest step [s]; the first call is collective."""
        raise NotImplementedError

    def advance(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """One step [s] from a time [s], see `methods.protocol.ParticleSystem`; False when the state is not sound.
        Collective.
        """
        raise NotImplementedError

    def state(self) -> dict[str, Any]:
        """What a restart needs besides the fields."""
        raise NotImplementedError

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        raise NotImplementedError

    def unsound(self) -> tuple[int, str] | None:
        """This rank's particle with which the last step went wrong, and what is wrong with it."""
        raise NotImplementedError

    def summary(self) -> dict[str, Any]:
        """Entries of summary.json."""
        return {}
