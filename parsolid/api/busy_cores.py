"""Copies of a process that do its work on other cores while it measures: what a rank gets of a node that is full."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from parsolid.machine import cores, free_bytes

# of the memory that is free, what copies may take
_SHARE = 0.5


def cores_with_room(each: float) -> int:
    """How many cores this process and copies of it may keep busy, which write to so many bytes each."""
    left = free_bytes()
    # where nothing tells there are no copies
    room = _SHARE * left / max(each, 1.0) if left < float("inf") else 0.0
    return min(cores(), 1 + int(room))


@contextmanager
def busy_cores(count: int, work: Callable[[], object]) -> Iterator[None]:
    """Have so many cores busy, this one among them: copies of this process repeat `work` until the context is left.

    They are copies as they are at the beginning, whose memory is shared until it is written to. No message of several
    ranks may be in `work`.
    """
    copies: list[int] = []
    parent = os.getpid()
    try:
        for _ in range(count - 1):
            copy = os.fork()
            if copy == 0:
                # work until the process that this one is a copy of, the parent, ends it, or is no more; leave
                # nothing behind
                try:
                    # a word from a copy would be one too many
                    null = os.open(os.devnull, os.O_WRONLY)
                    for stream in (1, 2):
                        os.dup2(null, stream)
                    while os.getppid() == parent:
                        work()
                finally:
                    # without the ends of libraries, which are the parent's to make
                    os._exit(0)
            copies.append(copy)
        yield
    finally:
        for copy in copies:
            os.kill(copy, signal.SIGKILL)
            os.waitpid(copy, 0)
