"""Fields of the particles at given times, written to fields.vtkhdf."""

import json
from typing import Any

import numpy as np

from decomposition.halo import REACH_MARGIN, Halo
from parsolid.collective import maximum
from parsolid.observables.declared import Observables, OfRegion, field_of
from parsolid.output.errors import together
from parsolid.output.fields import FieldBlocks, Fields, FieldSeries, numbers_of
from parsolid.output.run_folder import RunFolder
from parsolid.output.summary import write_summary
from parsolid.output.vtkhdf import pack
from parsolid.scene.previous_results import TOOLS
from parsolid.simulation.loop import Simulation
from parsolid.simulation.outputs import Cadence, Output

_INDICATOR = "error_indicator"
# neighbours are within so many spacings; pairs that are looked at together
_REACH, _PAIRS = 2.3, 2_000_000
_COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


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
            # add the states of tools at a time [s] to those of earlier times
            path = self.folder.directory / TOOLS
            with together(self.comm, f"cannot write {path}"):
                if self.comm.rank == 0:
                    earlier: dict[str, list[Any]] = {"times": [], "tools": []}
                    if path.exists():
                        earlier = json.loads(path.read_text(encoding="utf-8"))
                    kept = [k for k, one in enumerate(earlier["times"]) if one < time]
                    states = {
                        key: [*(values[k] for k in kept), new]
                        for (key, values), new in zip(earlier.items(), (time, tools))
                    }
                    write_summary(path, states)
        if _INDICATOR in (fields or ()):
            indicate(self.comm, simulation.systems)
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

    def _chosen(self, of: Observables) -> tuple[np.ndarray, Observables | OfRegion]:
        """The particles that are written, and their numbers; of a region these run through those there; collective."""
        if self.scene.output.where is None:
            return of.rows("identifier"), of
        chosen = OfRegion(of, list(self.scene.named_regions).index(self.scene.output.where))
        return numbers_of(self.comm, chosen.rows("identifier")), chosen


def indicate(comm: Any, systems: list[Any]) -> None:
    """Give every system its `indicated`, (owned,) [J/m^3]: which particles' surroundings contribute most to the error.

    A particle's stress is compared with the linear function of the reference place that fits those of its neighbours
    best, itself left out (recovery of gradients after Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 24 (1987) 337, with
    least squares over particles). The square of the difference over twice its body's modulus of waves is a density of
    strain energy. What a scene's particles resolve differs by the second order of their spacing, what jumps from
    particle to particle by as much as it jumps. Collective.
    """
    for system in systems:
        stress = np.asarray(field_of(system, "stress"))
        values = np.stack([stress[:, i, j] for i, j in _COMPONENTS], axis=1)
        rows, d = system.particles.owned_rows, system.dimension
        place, body = np.array(rows("reference_position")[:, :d]), np.array(rows("body"))
        reach = _REACH * float(maximum(comm, np.max(rows("spacing"), initial=0.0)))
        # a hair farther, for distances are rounded in another way
        everything = Halo(comm, place, reach * REACH_MARGIN).with_ghosts(np.column_stack([place, body, values]))
        fitted = fit_of_neighbours(place, body, everything, reach, d)
        # components off the diagonal count twice
        difference = np.where(np.isfinite(fitted), (fitted - values) ** 2, 0.0) @ (1.0, 1.0, 1.0, 2.0, 2.0, 2.0)
        moduli = np.array([system.wave_modulus(number)[0] for number in range(len(system.bodies))])
        system.indicated = 0.5 * difference / moduli[body.astype(int)]


def fit_of_neighbours(place: np.ndarray, body: np.ndarray, rows: np.ndarray, reach: float, d: int) -> np.ndarray:
    """What neighbours of the same body say at places (n, d) by a linear fit: (n, components), not numbers where they
    are too few; rows: place, body and components of all particles.
    """
    from scipy.spatial import cKDTree

    result = np.full((len(place), rows.shape[1] - d - 1), np.nan)
    if not len(place):
        return result
    tree, here = cKDTree(rows[:, :d]), cKDTree(place)
    density = here.count_neighbors(tree, reach) / len(place)
    count = max(1, int(_PAIRS / density))
    for first in range(0, len(place), count):
        part = slice(first, first + count)
        pairs = cKDTree(place[part]).sparse_distance_matrix(tree, reach, output_type="ndarray")
        i, j = pairs["i"], pairs["j"]
        kept = (pairs["v"] > 1e-9 * reach) & (rows[j, d] == body[part][i])
        i, j, n = i[kept], j[kept], len(place[part])
        # weighted least squares over pairs
        apart = (rows[j, :d] - place[part][i]) / reach
        base = np.column_stack([np.ones(len(i)), apart])
        weight = (1.0 - np.minimum((apart**2).sum(axis=1), 1.0)) ** 2
        values = rows[j, d + 1 :]
        matrix = np.empty((n, d + 1, d + 1))
        right = np.empty((n, d + 1, values.shape[1]))
        for a in range(d + 1):
            for b in range(d + 1):
                matrix[:, a, b] = np.bincount(i, weight * base[:, a] * base[:, b], n)
            for c in range(values.shape[1]):
                right[:, a, c] = np.bincount(i, weight * base[:, a] * values[:, c], n)
        fitted = (np.linalg.pinv(matrix, rcond=1e-8, hermitian=True)[:, :1] @ right)[:, 0]
        fitted[np.bincount(i, minlength=n) < d + 1] = np.nan
        result[part] = fitted
    return result


def _arrays(of: Observables | OfRegion, names: list[str]) -> tuple[np.ndarray, Fields, Fields]:
    """Position, fields of these names, and those that do not change."""
    varying = {name: np.ascontiguousarray(of.field(name)) for name in names}
    constant = {"body": of.body, "volume": of.rows("volume")}
    return np.ascontiguousarray(of.rows("position")), varying, constant
