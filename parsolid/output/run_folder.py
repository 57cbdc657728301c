"""The folder of a run's results: created, locked, and cleared of older results, which are moved and never deleted."""

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
# files that a run writes; a new run moves older ones
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
    """Create a directory where it is missing and lock it for this run; returns the lock, on rank 0 alone. Collective.

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
    directory. continuing: the results stay, except for links in place of partial files. inputs: files that the run
    reads (its scene, meshes, checkpoint); they are not moved, and an error where the run would overwrite them.
    moved: called, on rank 0, with the folder to which older results have been moved.

    Raises OutputError on all ranks when the directory cannot be made or written, or an input is in the way.
    """
    directory = Path(directory)
    with together(comm, f"cannot write to the directory {directory}"):
        if comm.rank == 0:
            directory.mkdir(parents=True, exist_ok=True)
            if not os.access(directory, os.W_OK | os.X_OK):
                raise PermissionError(13, "Permission denied", str(directory))
            # by name, since glob does not find broken links
            names = sorted(name for name in os.listdir(directory) if any(fnmatchcase(name, one) for one in RESULTS))
            results = [directory / name for name in names]
            read = {Path(path).resolve() for path in inputs}
            for path in results:
                # a continued run reads its checkpoint in this folder and does not lose it
                if path.resolve() in read and not (continuing and ".h5" in path.suffixes):
                    raise OutputError(
                        f"{path} is read by this run and would be overwritten: choose another output directory"
                    )
            if continuing:
                # the targets of links with names of partial files would be overwritten
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
            if (traceback := directory / TRACEBACK).exists():
                # the presence of this file says that this run has reported an error
                traceback.rename(next_free(traceback))
    return directory


def next_free(path: Path) -> Path:
    """fields.vtkhdf -> fields.1.vtkhdf, or the first number that is free."""
    names = (path.with_name(f"{path.stem}.{number}{path.suffix}") for number in itertools.count(1))
    return next(name for name in names if not name.exists())


class RunFolder:
    """The prepared folder of a run and the paths of its files.

    directory: the folder; continued: whether the run continues results in the folder; moved: folders to which results
    of an earlier run were moved, on rank 0.
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
        # a checkpoint from another folder starts new results; a link counts in its own folder and in its target's
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
        """End the lock, on each rank separately; nothing is written afterwards."""
        if self._lock is not None:
            self._lock.release()
