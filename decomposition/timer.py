"""The clock of what a rank spends on messages."""

import time as clock
from types import TracebackType


class Timer:
    """Seconds in messages and in waiting for them, on the wall and of this rank's processor (a rank that waits spins).

    A context; one within another is counted once.
    """

    def __init__(self) -> None:
        self.seconds = self.processor_seconds = 0.0
        self._depth = 0
        self._began = self._processor_began = 0.0

    def __enter__(self) -> None:
        if self._depth == 0:
            self._began, self._processor_began = clock.perf_counter(), clock.process_time()
        self._depth += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.seconds += clock.perf_counter() - self._began
            self.processor_seconds += clock.process_time() - self._processor_began


# of this process: everything that sends or waits runs it
COMMUNICATION = Timer()
