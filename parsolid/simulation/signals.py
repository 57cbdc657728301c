"""Signals that ask a run to stop with a checkpoint.

Light to import, so that they are caught while the rest still loads.
"""

import signal


class StopRequest:
    """Remembers SIGTERM, SIGUSR1 and Ctrl-C, so that the loop can end at a step's end with a checkpoint.

    Ctrl-C for a second time ends the process at once.
    """

    def __init__(self) -> None:
        self.received: str | None = None

    def install(self) -> None:
        """Catch the signals that batch systems and the keyboard send."""
        for name in ("SIGINT", "SIGUSR1", "SIGTERM"):
            signal.signal(getattr(signal, name), self._note)

    def _note(self, number: int, frame: object) -> None:
        self.received = signal.Signals(number).name
        if number == signal.SIGINT:
            # not an exception: a rank that waits for another one would not come to raise it
            signal.signal(signal.SIGINT, signal.SIG_DFL)


# commands that keep the usual effect of the signals
_OTHERS = ("check", "bench", "point", "study", "verify", "modes", "plot", "view", "keys", "import", "fit")
REQUEST = StopRequest()


def catch_early(arguments: list[str]) -> None:
    """Catch the signals from the start of a run; for any other command nothing happens."""
    if not arguments or arguments[0] not in _OTHERS:
        REQUEST.install()


def hold() -> None:
    """Keep signals from ending a process that has nothing left to do but to leave: it would not have its status."""
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGUSR1, signal.SIGTERM))
