"""The folder of a run's results, locked for it: made if need be, and never at the cost of results that are there."""

import itertools
import os
from collections.abc import Callable, Iterable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from mpi4py import MPI

from parsolid.collective import anywhere
from parsolid.output.checkpoint import DEFAULT_NAME
from parsolid.output.crash_report import CONTEXT
from parsolid.output.crash_report import NAME as TRACEBACK
from parsolid.output.errors import OutputError, together
from parsolid.output.lock import FolderLock

FIELDS = "fields.vtkhdf"
# what a run writes; a new run moves it aside
RESULTS = (
    "history.csv",
    "history_error.csv",
    "history*.sums",
    "fields.vtkhdf",
    "fields.*.vtkhdf",
    "fields_*.vtkhdf",
    "fields*.sums",
    "checkpoint.h5",
    "checkpoint.previous.h5",
    "scene.toml",
    "summary.json",
    "modes.csv",
    "modes.json",
    "tools.json",
    "traceback*.txt",
    "pictures",
    "profile-*.txt",
    "*.partial",
)


def occupy(comm: MPI.Intracomm, directory: Path | str) -> FolderLock | None:
    """Make a directory if need be and lock it for this run; the lock, which rank 0 alone has. Collective.

    Raises OutputError on all ranks when another run has it, or it cannot be made or written.
    """
    lock = None
    with together(comm, f"cannot write to the directory {directory}"):
        if comm.rank == 0:
            Path(directory).mkdir(parents=True, exist_ok=True)
            lock = FolderLock(Path(directory))
    return lock


def prepare(
    comm: MPI.Intracomm,
    directory: Path | str,
    continuing: bool = False,
    inputs: Iterable[Path | str] = (),
    moved: Callable[[Path], None] | None = None,
) -> Path:
    """Make a directory ready for a run; returns it. Collective.

    A new run moves the results of an older one to the next free of previous-1/, previous-2/ and so on within the
    directory. continuing: they stay, to be gone on with, but for links in the way. inputs: files that the run reads
    (its scene, meshes, checkpoint): none of them is moved; where the run would write a file of the same name, that is
    an error.
    moved: told, on rank 0, of the folder that an older run's results have been moved to.

    Raises OutputError on all ranks when the directory cannot be made or written, or an input is in the way.
    """
    directory = Path(directory)
    with together(comm, f"cannot write to the directory {directory}"):
        if comm.rank == 0:
            directory.mkdir(parents=True, exist_ok=True)
            if not os.access(directory, os.W_OK | os.X_OK):
                raise PermissionError(13, "Permission denied", str(directory))
            # by name: a link to nowhere is not there for glob
            names = sorted(name for name in os.listdir(directory) if any(fnmatchcase(name, one) for one in RESULTS))
            results = [directory / name for name in names]
            read = {Path(path).resolve() for path in inputs}
            for path in results:
                # a continued run reads a checkpoint here, maybe a whole one not renamed yet, and does not lose it
                if path.resolve() in read and not (continuing and ".h5" in path.suffixes):
                    raise OutputError(
                        f"{path} is read by this run and would be overwritten: choose another output directory"
                    )
            if continuing:
                # take links away that bear the names of files being written: what they point to would be
                # written over
                for path in results:
                    if path.suffix == ".partial" and path.is_symlink():
                        path.unlink()
            elif results:
                number = 1
                while True:
                    aside = directory / f"previous-{number}"
                    try:
                        aside.mkdir()
                        break
                    except FileExistsError:
                        number += 1
                for result in results:
                    result.rename(aside / result.name)
                if moved is not None:
                    moved(aside)
            if (told := directory / TRACEBACK).exists():
                # whether this run has told an error is seen by whether the file is there
                told.rename(next_free(told))
    return directory


def next_free(path: Path) -> Path:
    """fields.vtkhdf -> fields.1.vtkhdf, or the first number that is free."""
    names = (path.with_name(f"{path.stem}.{number}{path.suffix}") for number in itertools.count(1))
    return next(name for name in names if not name.exists())


class RunFolder:
    """A folder made ready for a run; results of another run in it are moved aside.

    directory: the folder; continued: whether the run goes on with results that are there; moved: where results of an
    earlier run are now, known to rank 0.
    """

    def __init__(
        self,
        comm: Any,
        directory: Path | str,
        restart: Path | None = None,
        inputs: tuple[Path | str, ...] = (),
        lock: FolderLock | None = None,
    ):
        """restart: the checkpoint that the run continues from; inputs: files that it reads; lock: rank 0's on the
        folder, if it was locked before. Collective. Raises OutputError on all ranks.
        """
        directory = Path(directory)
        self.moved: list[Path] = []
        # a checkpoint from elsewhere starts a folder of its own; one that is a link is where the link is, too
        places = [] if restart is None else [restart.parent.resolve(), restart.resolve().parent]
        self.continued = directory.resolve() in places
        self._lock = lock if anywhere(comm, lock is not None) else occupy(comm, directory)
        try:
            self.directory = prepare(comm, directory, self.continued, inputs, self.moved.append)
        except BaseException:
            self.close()
            raise
        CONTEXT.folder = self.directory
        self.history, self.fields = self.directory / "history.csv", self.directory / FIELDS
        self.checkpoint, self.summary = self.directory / DEFAULT_NAME, self.directory / "summary.json"
        self.scene = self.directory / "scene.toml"

    def close(self) -> None:
        """Give the folder back, on each rank for itself; nothing is written after it."""
        if self._lock is not None:
            self._lock.release()
