"""A log file of the messages of a run."""

import shlex
import sys
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TextIO

from mpi4py import MPI

import parsolid
from parsolid.output.errors import together, words


class Log:
    """Lines appended to a file by one rank; without an open file nothing is written."""

    def __init__(self) -> None:
        self.stream: TextIO | None = None

    def open(self, comm: MPI.Intracomm, path: Path | str | None) -> None:
        """Append to a file, opened by rank 0, from now on; None: to no file. Collective.

        Raises OutputError on all ranks when it cannot be written.
        """
        self.close()
        if path is None:
            return
        with together(comm, f"cannot write the log {path}"):
            if comm.rank == 0:
                Path(path).absolute().parent.mkdir(parents=True, exist_ok=True)
                self.stream = open(path, "a", encoding="utf-8")  # noqa: SIM115
        now = datetime.now(UTC).isoformat(timespec="seconds")
        ranks = f"{comm.size} {'rank' if comm.size == 1 else 'ranks'}"
        self.say(f"--- parsolid {parsolid.__version__}, {ranks}, {now}: {shlex.join(sys.argv[1:])}")

    def say(self, text: str) -> None:
        """Add a line; an error, such as a full disk, ends the log with one message, not the run."""
        if self.stream is not None:
            try:
                print(text, file=self.stream, flush=True)
            except (OSError, ValueError) as error:
                name, self.stream = self.stream.name, None
                with suppress(OSError, ValueError):
                    text = f"parsolid: the log {name} ends here: {words(error)}; the run goes on"
                    print(text, file=sys.stderr, flush=True)

    def close(self) -> None:
        """Close the file."""
        if self.stream is not None:
            with suppress(OSError):
                self.stream.close()
            self.stream = None


def print_line(text: str) -> None:
    """Print a line to standard output; a run goes on when nobody reads it any more."""
    with suppress(OSError, ValueError):
        print(text, flush=True)


# of this process
LOG = Log()
