"""Heat conduction between the particles of a background grid: sources, planes at given temperatures, heat through surfaces.

The step of the conduction comes before that of the motion, with the particles where they are. Heat that a particle gains raises its
temperature and its internal energy alike.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from decomposition.occupied import Mirror
from parsolid.collective import SolverError, maximum
from parsolid.methods.mpm import heat as grid_heat
from parsolid.methods.mpm.grid_conditions import mirror_index
from parsolid.numerics.lanes import aligned_zeros

# share of the step at which the shortest waves of explicit conduction start to grow
_SAFETY = 0.9
# how far from its plane a particle of the surface may be, in its spacings
_REACH = 0.51
# particles at one depth give no line
_FLAT = 1e-6


@dataclass
class ThermalPlane:
    """A plane at a temperature, formula(X, t) [K], or an insulated plane of symmetry (formula None)."""

    mirror: Mirror
    axis: int
    offset: float
    formula: Any

    @property
    def sign(self) -> float:
        """Of the image's temperatures, less those of the plane."""
        return 1.0 if self.formula is None else -1.0

    def temperatures(self, places: np.ndarray, time: float) -> np.ndarray:
        """Temperatures [K] at the feet of places (n, d) [m]."""
        if self.formula is None:
            return np.zeros(len(places))
        feet = places.copy()
        feet[:, self.axis] = self.offset
        return self.formula.evaluate(feet, time)


def thermal_planes(scene, planes: list, lower: np.ndarray, origin: np.ndarray, spacing: float) -> list[ThermalPlane]:
    """Planes at given temperatures, and insulated ones at the other mirror `planes` of the motion.

    lower (d,) [m]: least coordinates of all particles. Raises SolverError for a plane that is neither on nodes nor half-way between.
    """
    result = []
    for i, boundary in enumerate(scene.boundaries):
        if boundary.kind != "temperature":
            continue
        if boundary.body is not None:
            raise SolverError(
                f"boundaries.{i}.body: expected none, a plane's temperature is that of all bodies, found one"
            )
        axis, offset = boundary.plane.axis, float(boundary.plane.offset)
        doubled = mirror_index(f"boundaries.{i}", axis, offset, origin, spacing)
        mirror = Mirror(axis, doubled, 1 if lower[axis] >= offset else -1)
        result.append(ThermalPlane(mirror, axis, offset, boundary.temperature))
    held = [plane.mirror for plane in result]
    return result + [ThermalPlane(p.mirror, p.mirror.axis, 0.0, None) for p in planes if p.mirror not in held]


class _SurfaceHeat:
    """Heat that flows into a body through a plane that bounded it at the start, on the particles there.

    On the particles, not at the plane itself: then what they store has the gradient that the flow needs (measured: half the error).
    """

    def __init__(self, boundary, body: int | None):
        self.boundary, self.body, self._layout = boundary, body, -1

    def _choose(self, points) -> None:
        """The rank's particles at the plane, anew when they are others."""
        if self._layout == points.layout:
            return
        self._layout, rows, plane = points.layout, points.owned_rows, self.boundary.plane
        area, place = rows("area")[:, plane.axis], rows("reference_position")
        beyond = plane.offset - place[:, plane.axis]
        here = (np.abs(beyond) <= _REACH * rows("spacing")[:, plane.axis]) & (area * beyond > 0.0)
        if self.body is not None:
            here &= rows("body") == self.body
        self.rows = np.flatnonzero(here)
        self.area = np.abs(area[self.rows]) * (place[self.rows, 0] if points.axisymmetric else 1.0)
        self.places = place[self.rows]

    def add(self, points, time: float, thermal: np.ndarray) -> None:
        """Add the powers [W] at a time [s] to the fourth column of thermal."""
        self._choose(points)
        thermal[self.rows, 3] += self.area * self.boundary.heat_flux.evaluate(self.places, time)


class Conduction:
    """Heat of one rank's particles in a step; `diffusivity` [m^2/s] is the largest found in the last one."""

    def __init__(self, scene, points, planes: list[ThermalPlane], loads):
        """loads: `BodyLoads`."""
        self.points, self.planes, self.loads, self.conducting = points, planes, loads, scene.method.conduction
        names = [body.name for body in scene.bodies]
        self.surfaces = [
            _SurfaceHeat(boundary, None if boundary.body is None else names.index(boundary.body))
            for boundary in scene.boundaries
            if boundary.kind == "heat_flux"
        ]
        self.thermal = aligned_zeros((0, 4))
        self._seen, self._folds = -1, []
        self.refresh()

    def refresh(self) -> None:
        """What particles have to conduct, in the present state."""
        points = self.points
        if len(self.thermal) < points.capacity:
            self.thermal = aligned_zeros((points.capacity, 4))
        self.thermal[: points.owned] = 0.0
        self.diffusivity = 0.0
        for block in points.warm_blocks:
            law = block.law
            largest = grid_heat.fill_thermal(
                block.first,
                block.last,
                points.space,
                law.specific_heat,
                (law.conductivity or 0.0) * self.conducting,
                points.storage("deformation_gradient"),
                points.storage("temperature"),
                points.motion,
                self.thermal,
            )
            self.diffusivity = max(self.diffusivity, largest)

    def stable_step(self) -> float:
        """h^2 / (2 d alpha) [s], with a margin."""
        if self.diffusivity == 0.0:
            return np.inf
        return _SAFETY * self.points.settings.cell**2 / (2.0 * self.points.dimension * self.diffusivity)

    def _update_folds(self, tables) -> None:
        if self._seen == tables.changes:
            return
        self._seen, self._folds = tables.changes, []
        for plane in self.planes:
            behind, images, on_plane = tables.ranks.cells.mirrored(plane.mirror)
            ghosts, images = np.concatenate((behind, on_plane)), np.concatenate((images, on_plane))
            places = tables.places[ghosts, : self.points.dimension]
            self._folds.append((plane, ghosts.astype(np.int32), images.astype(np.int32), places))

    def advance(self, tables, space, basis, scratch, time: float, step: float, timed) -> float:
        """Conduct for a step [s] from `time`; the heat [J] that this rank's particles gained, in sum that which was supplied.

        timed: calls what communicates, and takes the time.
        """
        self.refresh()
        # after it, as it makes a larger array when particles have come
        points, thermal, nodes = self.points, self.thermal, tables.heat
        self._update_folds(tables)
        self._supply(time + 0.5 * step)
        passed = self._pass_plastic_heat(step)
        lists = (0, tables.cells, space, basis, tables.grid, scratch, points.places)
        now = [plane.temperatures(places, time) for plane, _, _, places in self._folds]
        # a plane that is not at the particles' temperature at the start takes them along, as nodes of finite elements on it would
        jumps = self._jumps(tables, lists, now, timed) if time == 0.0 else [0.0] * len(now)
        self._sum_capacities(tables, lists, thermal, timed)
        for (plane, ghosts, images, _), held in zip(self._folds, now):
            grid_heat.fold_capacity(ghosts, images, plane.sign, held, nodes)
        grid_heat.find_temperatures(0, tables.count, nodes)
        for (plane, ghosts, images, _), held in reversed(list(zip(self._folds, now))):
            grid_heat.spread_temperature(ghosts, images, plane.sign, held, nodes)
        reference = None if points.where == "motion" else points.storage("deformation_gradient")
        grid_heat.conduct(*lists, reference, thermal, nodes, tables.partial)
        timed(tables.sum_flow.start)
        timed(tables.sum_flow.finish)
        for plane, ghosts, images, _ in self._folds:
            grid_heat.fold_flow(ghosts, images, plane.sign, nodes)
        grid_heat.find_increments(0, tables.count, nodes, step)
        for (plane, ghosts, images, places), held, jump in reversed(list(zip(self._folds, now, jumps))):
            change = plane.temperatures(places, time + step) - held + jump
            grid_heat.spread_increment(ghosts, images, plane.sign, change, nodes)
        gained = grid_heat.gather_heat(*lists, nodes, thermal)
        for block in points.warm_blocks:
            energy, temperature = points.storage("internal_energy"), points.storage("temperature")
            grid_heat.take_heat(block.first, block.last, thermal, points.motion, temperature, energy)
        return gained - passed

    def _pass_plastic_heat(self, step: float) -> float:
        """Let the grid spread what plastic flow has warmed since the last step, where planes hold temperatures; that heat [J].

        Particles beside a held plane would keep it otherwise: nodes on the plane have no increments that could take it up.
        """
        rise = self.points.find("plastic_rise")
        if rise is None or step == 0.0:
            return 0.0
        cell, heat = float(self.points.settings.cell), 0.0
        for block in self.points.warm_blocks:
            heat += grid_heat.hand_over_rise(block.first, block.last, self.thermal, rise, step, cell)
        return heat

    def _supply(self, time: float) -> None:
        """Powers of sources and surfaces at a time [s]; only particles with a temperature take any."""
        points, thermal = self.points, self.thermal
        if self.loads.heats:
            rows = points.owned_rows
            power = self.loads.heat(rows("reference_position"), time) * points.motion[: points.owned, 7]
            thermal[: points.owned, 3] = np.where(thermal[: points.owned, 1] > 0.0, power, 0.0)
        for surface in self.surfaces:
            surface.add(points, time, thermal)

    def _sum_capacities(self, tables, lists: tuple, thermal: np.ndarray, timed) -> None:
        tables.clear_heat()
        grid_heat.scatter_heat(*lists, thermal, tables.heat, tables.partial)
        timed(tables.sum_heat.start)
        timed(tables.sum_heat.finish)

    def _jumps(self, tables, lists: tuple, held: list, timed) -> list:
        """Temperatures of the planes less those of the particles beside them [K], at the rows of the folds.

        The latter are those of the line on the plane that fits the particles around an image node best, by capacity and weight.
        """
        result = []
        for (plane, _, images, _), wanted in zip(self._folds, held):
            if plane.formula is None:
                result.append(np.zeros(len(images)))
                continue
            n, depth = self.points.owned, aligned_zeros(self.thermal.shape)
            depth[:n] = self.thermal[:n]
            beyond = (self.points.places[:n, plane.axis] - plane.offset) / self.points.settings.cell
            self._sum_capacities(tables, lists, self.thermal, timed)
            total, capacity = tables.heat[images, :2].T
            depth[:n, 1] *= beyond
            self._sum_capacities(tables, lists, depth, timed)
            moment, first = tables.heat[images, :2].T
            depth[:n, 0] = beyond
            self._sum_capacities(tables, lists, depth, timed)
            second = tables.heat[images, 0]
            spread = capacity * second - first**2
            with np.errstate(divide="ignore", invalid="ignore"):
                mean = np.where(capacity > 0.0, total / capacity, wanted)
                fitted = np.where(spread > _FLAT * capacity * second, (total * second - first * moment) / spread, mean)
            result.append(wanted - fitted)
        return result


def conducts(scene, laws: list) -> bool:
    """Whether there is any heat to conduct or to supply."""
    able = scene.method.conduction and any(getattr(law, "conductivity", None) for law in laws)
    return able or scene.loads.heat_source is not None


def least_coordinates(comm, position: np.ndarray) -> np.ndarray:
    """Least coordinates (d,) [m] of all ranks' particles (n, d); collective."""
    return -maximum(comm, -position.min(axis=0, initial=np.inf))
