"""The folder of a run's results, locked for it, with the names of its files."""

from pathlib import Path
from typing import Any

from parsolid.collective import anywhere
from parsolid.output.checkpoint import DEFAULT_NAME
from parsolid.output.crash_report import CONTEXT
from parsolid.output.directory import occupy, prepare
from parsolid.output.fields import DEFAULT_NAME as FIELDS
from parsolid.output.lock import FolderLock


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
        self.continued = restart is not None and directory.resolve() in _folders_of(restart)
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


def _folders_of(path: Path) -> tuple[Path, Path]:
    """Where a file is, by its name and by what it is a link to."""
    return path.parent.resolve(), path.resolve().parent
