"""Fields of the particles at given times, written to fields.vtkhdf."""

import json
from typing import Any

import numpy as np

from parsolid.observables.declared import Observables, OfRegion
from parsolid.output.errors import together
from parsolid.output.fields import FieldBlocks, Fields, FieldSeries, numbers_of
from parsolid.output.run_folder import RunFolder
from parsolid.output.summary import write_summary
from parsolid.output.vtkhdf import pack
from parsolid.scene.previous_results import TOOLS
from parsolid.simulation import error_indicator
from parsolid.simulation.loop import Simulation
from parsolid.simulation.outputs import Cadence, Output


class FieldOutput(Output):
    """The fields that a scene shows, at its times; steps end exactly there."""

    def __init__(self, simulation: Simulation, folder: RunFolder):
        """Goes on with a file of the folder whose run is continued. Collective."""
        self.comm, self.scene, self.folder = simulation.comm, simulation.scene, folder
        self.every = Cadence(times=tuple(self.scene.fields_times))
        self.observables = Observables(simulation.systems)
        time = simulation.clock.time if folder.continued else None
        capacity = max(1, sum(one > (-1.0 if time is None else time) for one in self.every.times))
        names = [plan.name or f"system-{number}" for number, plan in enumerate(self.scene.systems)]
        several = len(names) > 1
        self._blocks = FieldBlocks(self.comm, folder.fields, names, capacity, time) if several else None
        self._series = [FieldSeries(self.comm, folder.fields, capacity, time)] if self._blocks is None else []

    def write(self, simulation: Simulation) -> None:
        time, fields = simulation.clock.time, self.scene.output.fields
        tools = {name: one for each in simulation.interactions for name, one in each.handed_on().items()}
        if tools and "state" in (fields or ()):
            self._write_tools(time, tools)
        if error_indicator.NAME in (fields or ()):
            error_indicator.indicate(self.comm, simulation.systems)
        if self._blocks is None:
            identifier, chosen = self._chosen(self.observables)
            names = self.observables.written(fields)
            self.observables.prepare(names, time)
            self._series[0].write(time, identifier, *_arrays(chosen, names))
            return
        for number in reversed(range(len(simulation.systems))):
            # the first block tells the times
            block = Observables([simulation.systems[number]])
            names = block.written(fields)
            block.prepare(names, time)
            numbers, chosen = self._chosen(block)
            position, varying, constant = _arrays(chosen, names)
            self._blocks.write(time, number, position, varying, constant | {"identifier": numbers})
        self._blocks.collect()

    def pack(self) -> None:
        """Deflate the fields as the scene says, once no more are to come; collective."""
        level = self.scene.output.compression
        with together(self.comm, "cannot pack the fields"):
            if self.comm.rank == 0 and level:
                for one in self._series if self._blocks is None else self._blocks.series:
                    if len(one.times):
                        pack(one.path, level)

    def _write_tools(self, time: float, tools: dict[str, Any]) -> None:
        """Add the states of tools at a time [s] to those of earlier times."""
        path = self.folder.directory / TOOLS
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

    def _chosen(self, of: Observables) -> tuple[np.ndarray, Observables | OfRegion]:
        """The particles that are written, and their numbers; of a region these run through those there; collective."""
        if self.scene.output.where is None:
            return of.rows("identifier"), of
        chosen = OfRegion(of, list(self.scene.named_regions).index(self.scene.output.where))
        return numbers_of(self.comm, chosen.rows("identifier")), chosen


def _arrays(of: Observables | OfRegion, names: list[str]) -> tuple[np.ndarray, Fields, Fields]:
    """Position, fields of these names, and those that do not change."""
    varying = {name: np.ascontiguousarray(of.field(name)) for name in names}
    constant = {"body": of.body, "volume": of.rows("volume")}
    return np.ascontiguousarray(of.rows("position")), varying, constant
