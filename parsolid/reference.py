"""Errors against a scene's reference: a series over time, or an exact solution at given times.

Against a series: for energies max |error| / E0, for anything else max |error| / max |reference|, over the common times.
Against an exact solution: relative L2 norms of fields, weighted with tributary volumes.
"""

import json

import numpy as np

from parsolid.ledger import COLUMNS


class Errors:
    """Collects what is needed while a run goes on; `result` is the same on all ranks."""

    def __init__(self, scene):
        self.reference = scene.reference
        self.rows: list[dict] = []
        self.found: dict[str, float] = {}
        self.times: tuple[float, ...] = ()
        self.solution = None
        if self.reference is not None and self.reference.exact is not None:
            # scipy takes half a second to import, which a run without a reference is spared
            from parsolid.exact import SOLUTIONS

            self.solution = SOLUTIONS[self.reference.exact].of_scene(scene)
            self.times = tuple(time for time in self.reference.times if time <= scene.end_time)

    def note(self, row: dict) -> None:
        """Remember a history row."""
        if self.reference is not None and self.reference.series is not None:
            self.rows.append({name: row[name] for name in ("time", *self.reference.columns)})

    def resume(self, rows: list[dict], found: dict[str, float]) -> None:
        """Continue with the history rows and the errors of the run before a restart."""
        self.found |= found
        for row in rows:
            self.note(row)

    def look(self, simulation, observables) -> None:
        """Compare fields with the exact solution when its time has come; collective then."""
        time = simulation.clock.time
        if time not in self.times:
            return
        table, comm = simulation.method.table, simulation.comm
        volume = table.owned_rows("volume")
        exact = self.solution.fields(table.owned_rows("reference_position"), time)
        for name, wanted in exact.items():
            difference = observables.field(name)
            d = simulation.scene.dimension
            difference = (difference[:, :d, :d] if difference.ndim == 3 else difference) - wanted
            sums = np.array([_squares(volume, difference), _squares(volume, wanted)])
            sums = comm.allreduce(sums)
            self.found[f"{name}@{time:.6g}"] = float(np.sqrt(sums[0] / sums[1])) if sums[1] > 0.0 else float(np.sqrt(sums[0]))

    def result(self) -> dict[str, float]:
        """Errors by name: a history column, or field@time."""
        if self.rows:
            self.found |= series_errors(self.rows, self.reference)
        return self.found


def _squares(volume: np.ndarray, values: np.ndarray) -> float:
    return float(np.sum(volume * (values.reshape(len(volume), -1) ** 2).sum(axis=1)))


def series_errors(rows: list[dict], reference) -> dict[str, float]:
    """Errors of history rows against a reference series; rows hold "time" and the reference's columns."""
    from scipy.interpolate import CubicSpline

    with open(reference.series) as file:
        data = json.load(file)
    times = np.asarray(data["t"], float)
    time = np.array([row["time"] for row in rows])
    common = (time >= times[0]) & (time <= times[-1])
    errors = {}
    for column, name in reference.columns.items():
        wanted = np.asarray(data["series"][name], float)
        found = np.array([row[column] for row in rows])[common]
        scale = data["E0"] if column in COLUMNS else np.abs(wanted).max()
        errors[column] = float(np.abs(found - CubicSpline(times, wanted)(time[common])).max() / scale)
    return errors
