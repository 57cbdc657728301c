"""Errors against a scene's reference: a series over time, an exact solution, or values at the end.

Against a series: for energies max |error| / E0, for anything else max |error| / max |reference|, over the common times.
Against values at the end: |value / expected - 1|. Against an exact solution: its own measure (see `exact.solution`), at
given times, as the largest over all steps, or of the history.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.collective import SolverError
from parsolid.observables.declared import Observables
from parsolid.scene import Scene
from parsolid.scene.observation import HISTORY_COLUMNS
from parsolid.simulation.history import HistoryOutput
from parsolid.simulation.loop import Simulation
from parsolid.simulation.outputs import Output
from parsolid.splines import cubic_spline

Row = dict[str, float]


class ReferenceErrors(Output):
    """Collects what is needed while a run goes on; `result` is the same on all ranks.

    history: whose rows are compared; it stands before this one among a run's outputs.
    """

    def __init__(self, scene: Scene, history: HistoryOutput):
        self.reference, self.history = scene.reference, history
        self.rows: list[Row] = []
        self.found: dict[str, float] = {}
        self.times: tuple[float, ...] = ()
        self.solution: Any = None
        self.series: tuple[str, dict[str, str]] | None = None
        self.columns: tuple[str, ...] = ()
        if self.reference is None:
            return
        if self.reference.series is not None and self.reference.columns is not None:
            self.series = self.reference.series, self.reference.columns
            self.columns = ("time", *self.reference.columns)
        if self.reference.exact is not None:
            # scipy takes half a second to import, which a run without a reference is spared
            from parsolid.exact import SOLUTIONS

            kind: Any = SOLUTIONS[self.reference.exact]
            self.solution = kind.of_scene(scene)
            if self.reference.history:
                # columns of the history that a solution looks at. Raises SolverError when the scene has no probes for
                # them
                wanted: list[str] = self.solution.history_columns()
                known = {column for probe in scene.probes for column in probe.columns(scene.dimension)}
                missing = [column for column in wanted if column not in known]
                if missing or not wanted:
                    what = ", ".join(missing) or "position and displacement at a point"
                    raise SolverError(f"reference.history: expected probes that fill {what}, found none")
                self.columns = ("time", "dt", *wanted)
            self.times = scene.reference_times

    @property
    def every_row(self) -> bool:
        """Whether all rows of the history are needed."""
        return self.reference is not None

    def _note(self, row: Row) -> None:
        """Remember a history row."""
        if self.columns:
            self.rows.append({name: row[name] for name in self.columns})
        elif self.reference is not None and self.reference.final is not None:
            self.found = {name: abs(row[name] / wanted - 1.0) for name, wanted in self.reference.final.items()}

    def resume(self, rows: list[Row], found: dict[str, float]) -> None:
        """Continue with the history rows and the errors of the run before a restart."""
        self.found |= found
        for row in rows:
            self._note(row)

    def due(self, simulation: Simulation) -> bool:
        """With every row of the history, and when the time of an exact solution has come."""
        return self.history.last_step == simulation.clock.step or self._solution_due(simulation)

    def _solution_due(self, simulation: Simulation) -> bool:
        each_step = self.reference is not None and self.reference.each_step
        return self.solution is not None and (each_step or simulation.clock.time in self.times)

    def write(self, simulation: Simulation) -> None:
        """Compare with the exact solution, remember the row; collective."""
        if self.history.last_step == simulation.clock.step and self.history.last_row is not None:
            self._note(self.history.last_row)
        if not self._solution_due(simulation):
            return
        from parsolid.exact.solution import View

        assert self.reference is not None
        time, view = simulation.clock.time, View(simulation.comm, Observables(simulation.systems))
        if self.reference.each_step:
            for name, error in self.solution.rms_errors(view, time).items():
                name = f"largest_{name}"
                self.found[name] = max(error, self.found.get(name, 0.0))
        else:
            self.found |= {f"{name}@{time:.6g}": error for name, error in self.solution.errors(view, time).items()}

    def result(self) -> dict[str, float]:
        """Errors by name: a history column, field@time, largest_field, or what a solution finds in the history."""
        if self.rows and self.solution is not None:
            history = {name: np.array([row[name] for row in self.rows]) for name in self.columns}
            self.found |= self.solution.history_errors(history)
        elif self.rows and self.series is not None:
            self.found |= series_errors(self.rows, *self.series)
        return self.found


def series_errors(rows: list[Row], file: str, names: dict[str, str]) -> dict[str, float]:
    """Errors of history rows against series in a JSON file; names: column -> series, rows hold "time" besides."""
    data = json.loads(Path(file).read_text())
    times = np.asarray(data["t"], float)
    time = np.array([row["time"] for row in rows])
    common = (time >= times[0]) & (time <= times[-1])
    if not common.any():
        # a run that was stopped before the reference begins
        return {}
    errors = {}
    for column, name in names.items():
        wanted = np.asarray(data["series"][name], float)
        found = np.array([row[column] for row in rows])[common]
        scale = data["E0"] if column in HISTORY_COLUMNS else np.abs(wanted).max()
        errors[column] = float(np.abs(found - cubic_spline(times, wanted, time[common])).max() / scale)
    return errors
