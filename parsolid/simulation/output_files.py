"""The files of one run: which folder, what is in it, and how a restart goes on with them."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.collective import anywhere
from parsolid.observables.in_region import OfRegion
from parsolid.output.blocks import FieldBlocks
from parsolid.output.directory import occupy, prepare
from parsolid.output.errors import together
from parsolid.output.fields import Fields, FieldSeries
from parsolid.output.history import History, read_history
from parsolid.output.lock import FolderLock
from parsolid.output.numbering import numbers_of
from parsolid.output.packing import pack
from parsolid.output.summary import write_summary
from parsolid.output.whereabouts import HERE
from parsolid.scene import Scene
from parsolid.scene.previous_results import TOOLS
from parsolid.simulation import error_indicator
from parsolid.simulation.observables import Observables
from parsolid.simulation.restart import Restart


class OutputFiles:
    """history.csv, fields.vtkhdf and checkpoint.h5 in the run's folder; every call is collective."""

    def __init__(
        self,
        comm: Any,
        scene: Scene,
        directory: Path | str,
        restart: Restart | None = None,
        inputs: tuple[Path | str, ...] = (),
        lock: FolderLock | None = None,
    ):
        """restart: the `Restart` to continue from, or None. Results of another run in the folder are moved aside.

        inputs: files the run reads; lock: rank 0's on the folder, if it was locked before. Raises OutputError on all
        ranks.
        """
        self.comm, self.scene = comm, scene
        self.history: History | None = None
        # where results of an earlier run are now, known to rank 0
        self.moved: list[Path] = []
        directory = Path(directory)
        # a checkpoint from elsewhere starts a folder of its own; one that is a link is where the link is, too
        self.continued = restart if restart and directory.resolve() in _folders_of(restart.path) else None
        self.lock = lock if anywhere(comm, lock is not None) else occupy(comm, directory)
        try:
            self.directory = prepare(comm, directory, self.continued is not None, inputs, self.moved.append)
        except BaseException:
            self.close()
            raise
        HERE.folder = self.directory
        self.checkpoint = self.directory / "checkpoint.h5"
        self.field_times = scene.fields_times
        resume_at = self.continued.header["time"] if self.continued else None
        names = [plan.name or f"system-{number}" for number, plan in enumerate(scene.systems)]
        file = self.directory / "fields.vtkhdf"
        capacity = max(1, sum(time > (-1.0 if resume_at is None else resume_at) for time in self.field_times))
        self.blocks = FieldBlocks(comm, file, names, capacity, resume_at) if len(names) > 1 else None
        self.fields = None if self.blocks else FieldSeries(comm, file, capacity, resume_at)

    def close(self) -> None:
        """Close the history and give the folder back, on each rank for itself; nothing is written after it."""
        if self.history is not None:
            self.history.close()
        if self.lock is not None:
            self.lock.release()

    def open_history(self, columns: list[str]) -> None:
        """Start the history with its columns, or go on with it."""
        path = self.directory / "history.csv"
        with together(self.comm, f"cannot go on with {path}"):
            if self.comm.rank == 0:
                self.history = History(path, columns)
                if self.continued:
                    self.history.resume(self.continued.header["step"])

    def history_rows(self, last_only: bool) -> list[dict[str, float]]:
        """Rows that a continued history has kept, all or the last one, the same on all ranks; collective."""
        columns: dict[str, list[float]] = {}
        path = self.directory / "history.csv"
        with together(self.comm, f"cannot go on with {path}"):
            if self.comm.rank == 0 and self.continued:
                columns = read_history(path)
                columns = {name: values[-1:] if last_only else values for name, values in columns.items()}
        columns = self.comm.bcast(columns)
        return [dict(zip(columns, values)) for values in zip(*columns.values())]

    def append_history(self, values: list[float]) -> None:
        """Add a row; rank 0's is written."""
        with together(self.comm, "cannot write the history"):
            if self.history is not None:
                self.history.append(values)

    def write_fields(self, observables: Observables, time: float, tools: dict[str, Any] | None = None) -> None:
        """Write the shown fields at a time [s]; tools: the states of those that there are, which a state needs."""
        if tools and "state" in (self.scene.output.fields or ()):
            self._write_tools(time, tools)
        if error_indicator.NAME in (self.scene.output.fields or ()):
            error_indicator.indicate(self.comm, observables.systems)
        if self.fields is not None:
            names = observables.written(self.scene.output.fields)
            identifier, shown = self._chosen(observables)
            self.fields.write(time, identifier, *self._shown(shown, names))
        elif self.blocks is not None:
            for number in reversed(range(len(observables.systems))):
                # the first block tells the times
                block = Observables([observables.systems[number]])
                names = block.written(self.scene.output.fields)
                numbers, shown = self._chosen(block)
                position, varying, constant = self._shown(shown, names)
                constant["identifier"] = numbers
                self.blocks.write(time, number, position, varying, constant)
            self.blocks.collect()

    def _write_tools(self, time: float, tools: dict[str, Any]) -> None:
        """Add the states of tools at a time [s] to those of earlier times."""
        path = self.directory / TOOLS
        with together(self.comm, f"cannot write {path}"):
            if self.comm.rank == 0:
                earlier: dict[str, list[Any]] = {"times": [], "tools": []}
                if path.exists():
                    earlier = json.loads(path.read_text(encoding="utf-8"))
                kept = [k for k, one in enumerate(earlier["times"]) if one < time]
                states = {
                    key: [*(values[k] for k in kept), new] for (key, values), new in zip(earlier.items(), (time, tools))
                }
                write_summary(path, states)

    def pack(self) -> None:
        """Deflate the fields as the scene says, once no more are to come; collective."""
        level = self.scene.output.compression
        series = [self.fields] if self.fields is not None else self.blocks.series if self.blocks is not None else []
        with together(self.comm, "cannot pack the fields"):
            if self.comm.rank == 0 and level:
                for one in series:
                    if len(one.times):
                        pack(one.path, level)

    def _chosen(self, of: Observables) -> tuple[np.ndarray, Observables | OfRegion]:
        """The particles that are written, and their numbers; of a region these run through those there; collective."""
        if self.scene.output.where is None:
            return of.rows("identifier"), of
        chosen = OfRegion(of, list(self.scene.named_regions).index(self.scene.output.where))
        return numbers_of(self.comm, chosen.rows("identifier")), chosen

    @staticmethod
    def _shown(of: Observables | OfRegion, names: list[str]) -> tuple[np.ndarray, Fields, Fields]:
        """Position, fields of these names, and those that do not change."""
        varying = {name: np.ascontiguousarray(of.field(name)) for name in names}
        constant = {"body": of.body, "volume": of.rows("volume")}
        return np.ascontiguousarray(of.rows("position")), varying, constant


def _folders_of(path: Path) -> tuple[Path, Path]:
    """Where a file is, by its name and by what it is a link to."""
    return path.parent.resolve(), path.resolve().parent
