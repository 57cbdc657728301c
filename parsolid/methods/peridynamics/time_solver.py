"""What the system asks of a time solver: `velocity_verlet.VelocityVerlet` or `quasi_static.QuasiStatic`."""


class TimeSolver:
    """Moves one rank's particles from step to step.

    jumps, landings: see `methods.protocol.ParticleSystem`; setting: the key of method.solution whose smaller value
    makes steps milder.
    """

    jumps: tuple[float, ...] = ()
    landings: tuple[float, ...] = ()
    setting: str

    def begin(self) -> None:
        """What the solver changes in the bodies' initial displacement and velocity."""

    def stable_step(self) -> float:
        """Largest step [s]; the first call is collective."""
        raise NotImplementedError

    def advance(self, time: float, step: float, ledger, announce) -> bool:
        """One step [s] from a time [s], see `methods.protocol.ParticleSystem`; False when the state is not sound.
        Collective.
        """
        raise NotImplementedError

    def state(self) -> dict:
        """What a restart needs besides the fields."""
        raise NotImplementedError

    def set_state(self, state: dict) -> None:
        """Take back what `state` gave."""
        raise NotImplementedError

    def unsound(self) -> tuple[int, str] | None:
        """This rank's particle with which the last step went wrong, and what is wrong with it."""
        raise NotImplementedError

    def summary(self) -> dict:
        """Entries of summary.json."""
        return {}
