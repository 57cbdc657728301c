"""The history of a run: rows of the energy ledger, probes and interactions, written to history.csv."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from parsolid.collective import minimum
from parsolid.observables.declared import PARTICLE_SAMPLERS, QUANTITIES, Observables, Sampler
from parsolid.observables.samplers import (
    InRegion,
    MethodQuantity,
    ParticleField,
    ProbePoint,
    Projected,
    ReactionForce,
    Statistic,
    probe_points,
)
from parsolid.output.errors import together
from parsolid.output.history import History, read_history
from parsolid.output.run_folder import RunFolder
from parsolid.scene import Scene
from parsolid.scene.boundary_faults import reaction_columns
from parsolid.simulation.ledger import ledger_of
from parsolid.simulation.loop import Simulation
from parsolid.simulation.outputs import Cadence, Output

# extremes of all ranks are found as minima
_SIGN = {"minimum": 1.0, "maximum": -1.0}


class Probes:
    """All probes of a scene; columns are "name.field" with a suffix for each component."""

    def __init__(self, comm: Any, scene: Scene, observables: Observables):
        """Collective."""
        self.comm, self.observables = comm, observables
        self.samplers: list[Sampler] = []
        self._fields = [name for probe in scene.probes for name in probe.fields or ()]
        points = [probe.at for probe in scene.probes if probe.at is not None]
        placed = iter(probe_points(comm, observables, np.array(points, float)) if points else ())
        for probe in scene.probes:
            columns = probe.columns_of_fields(scene.dimension)
            samplers = _samplers(probe, columns, next(placed) if probe.at is not None else None)
            if probe.where is not None:
                number = list(scene.named_regions).index(probe.where)
                samplers = [InRegion(sampler, number) for sampler in samplers]
            self.samplers += samplers
        for name in (one.reports for one in scene.boundaries if one.reports is not None):
            self.samplers.append(ReactionForce(name, reaction_columns(name, scene.dimension)))
        self.columns = [column for sampler in self.samplers for column in sampler.columns]

    def prepare(self, time: float) -> None:
        """Exchange what fields need that no rank finds alone, in the state at a time [s]; collective."""
        self.observables.prepare(self._fields, time)

    def sample(self) -> list[float]:
        """Values of all columns, after `prepare`; collective."""
        parts = [np.asarray(sampler.part(self.observables), float) for sampler in self.samplers]
        signs = [_SIGN.get(sampler.reduction, 0.0) for sampler in self.samplers]
        total = self.comm.allreduce(_one_array([part for part, sign in zip(parts, signs) if not sign]))
        lowest = minimum(self.comm, _one_array([sign * part for part, sign in zip(parts, signs) if sign]))
        result: list[float] = []
        for sampler, part, sign in zip(self.samplers, parts, signs):
            count = len(part)
            if sign:
                joined, lowest = sign * lowest[:count], lowest[count:]
            else:
                joined, total = total[:count], total[count:]
            result += [float(value) for value in sampler.values(joined)]
        return result

    def state(self) -> dict[str, Any]:
        """What a restart needs, by the names of the probes; the same on all ranks."""
        states = [(sampler.name, sampler.state()) for sampler in self.samplers]
        return {name: state for name, state in states if state is not None}

    def restore(self, states: dict[str, Any]) -> None:
        """Continue what a checkpoint has kept."""
        for sampler in self.samplers:
            if sampler.name in states and sampler.state() is not None:
                sampler.restore(states[sampler.name])


def _samplers(probe: Any, columns: dict[str, list[str]], place: ProbePoint | None) -> list[Sampler]:
    """What finds the columns of a probe of the scene, (name of field -> its columns), at a place if it has one."""
    if probe.quantity is not None:
        known, names = QUANTITIES.get(probe.quantity), columns[probe.quantity]
        if known is None:
            return [MethodQuantity(probe.name, names, probe.quantity)]
        return [known(probe.name, names)]
    if probe.weight is not None:
        names = [column for field in probe.fields for column in columns[field]]
        return [Projected(probe.name, names, probe.weight, probe.fields)]
    if probe.where is not None:
        return [Statistic(probe.name, columns[name], name, probe.statistic or "mean") for name in probe.fields]
    assert place is not None
    result: list[Sampler] = []
    for name in probe.fields:
        if name in PARTICLE_SAMPLERS:
            result.append(PARTICLE_SAMPLERS[name](probe.name, columns[name], place, probe))
        else:
            result.append(ParticleField(probe.name, columns[name], place, name))
    return result


def _one_array(parts: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.zeros(0), *parts])


# rows of a history in the time of a scene that states no interval
ROWS = 200


def history_columns(scene: Scene) -> list[str]:
    """Columns of the history that a run of a scene will have."""
    columns = ["step", "time", "dt", *ledger_of(scene).columns]
    reports = [one.reports for one in scene.boundaries if one.reports is not None]
    columns += [column for probe in scene.probes for column in probe.columns(scene.dimension)]
    columns += [column for name in reports for column in reaction_columns(name, scene.dimension)]
    return columns + [column for tool in scene.tools or () for column in tool.columns(scene.dimension)]


class HistoryOutput(Output):
    """Rows at the start, at a cadence, after each jump of the loads and at the scene's end.

    last_row: the last row, column -> value.
    """

    def __init__(self, simulation: Simulation, folder: RunFolder | None = None):
        """folder: where history.csv is written, or gone on with; None: rows are kept in memory. Collective."""
        scene, stated = simulation.scene, simulation.scene.output
        self.simulation, self.folder = simulation, folder
        interval = stated.history_interval or scene.end_time / ROWS
        steps = stated.history_steps
        self.every = Cadence(time=interval) if steps is None else Cadence(steps=steps)
        self.probes = Probes(simulation.comm, scene, Observables(simulation.systems))
        self.last_row: dict[str, float] | None = None
        # without a folder
        self.rows: list[dict[str, float]] = []
        self._file: History | None = None
        acting = [column for interaction in simulation.interactions for column in interaction.columns]
        self.columns = ["step", "time", "dt", *simulation.ledger.columns, *self.probes.columns, *acting]
        if folder is not None:
            with together(self.simulation.comm, f"cannot go on with {folder.history}"):
                if self.simulation.comm.rank == 0:
                    self._file = History(folder.history, self.columns)
                    if folder.continued:
                        self._file.resume(self.simulation.clock.step)

    def resume(self, probes: dict[str, Any], every_row: bool = False) -> list[dict[str, float]]:
        """Continue after a restart; the rows of a continued file, all or the last one. Collective.

        probes: their state in the checkpoint.
        """
        self.probes.restore(probes)
        columns: dict[str, list[float]] = {}
        if self.folder is not None:
            with together(self.simulation.comm, f"cannot go on with {self.folder.history}"):
                if self.simulation.comm.rank == 0 and self.folder.continued:
                    columns = read_history(self.folder.history)
                    columns = {name: values[0 if every_row else -1 :] for name, values in columns.items()}
        columns = self.simulation.comm.bcast(columns)
        rows = [dict(zip(columns, values)) for values in zip(*columns.values())]
        self.last_row = rows[-1] if rows else None
        return rows

    def due(self, simulation: Simulation) -> bool:
        now = simulation.clock
        begins = any(one.start == now.time for one in simulation.scene.stages)
        return begins or now.step_size == 0.0 or now.time >= simulation.scene.end_time or self.every.due(now)

    def write(self, simulation: Simulation) -> None:
        now = simulation.clock
        row = {"step": now.step, "time": now.time, "dt": now.step_size} | simulation.energy_row()
        self.probes.prepare(now.time)
        row |= dict(zip(self.probes.columns, self.probes.sample()))
        for interaction in simulation.interactions:
            row |= dict(zip(interaction.columns, interaction.sample()))
        self.last_row = row
        if self.folder is None:
            self.rows.append(row)
            return
        with together(simulation.comm, "cannot write the history"):
            if self._file is not None:
                self._file.append([row[name] for name in self.columns])

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
