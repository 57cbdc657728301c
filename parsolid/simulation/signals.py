"""Signals that ask a run to stop with a checkpoint.

Light to import, so that they are caught while the rest still loads.
"""

import signal


class StopRequest:
    """Remembers SIGTERM and SIGUSR1, so that the loop can end at a step's end with a checkpoint."""

    def __init__(self) -> None:
        self.received: str | None = None

    def install(self) -> None:
        """Catch the signals that batch systems send."""
        for name in ("SIGTERM", "SIGUSR1"):
            signal.signal(getattr(signal, name), self._note)

    def _note(self, number: int, frame: object) -> None:
        self.received = signal.Signals(number).name


# commands that keep the usual effect of the signals
_OTHERS = ("check", "bench", "point", "study", "plot")
REQUEST = StopRequest()


def catch_early(arguments: list[str]) -> None:
    """Catch the signals from the start of a run; for any other command nothing happens."""
    if not arguments or arguments[0] not in _OTHERS:
        REQUEST.install()
