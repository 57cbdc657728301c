"""Heat conduction between the particles of a background grid: sources, planes at given temperatures, heat through
surfaces.

The step of the conduction comes before that of the motion, with the particles where they are. Heat that a particle
gains raises its temperature and its internal energy alike.
"""

from typing import Any

import numpy as np

from decomposition.recalled import Recalled, RecalledEach
from parsolid.boundary.heat import HeatSupply
from parsolid.methods.mpm import heat as grid_heat
from parsolid.methods.mpm.grid_conditions import GridConditions, ThermalPlane
from parsolid.methods.mpm.heated_surfaces import HeatedSurfaces
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.nodes import Nodes
from parsolid.numerics.lanes import aligned_zeros
from parsolid.scene import Scene

# share of the step at which the shortest waves of explicit conduction start to grow
_SAFETY = 0.9
# particles at one depth give no line
_FLAT = 1e-6
# a plane, slots of the nodes behind and on it, those of their images, and places of the former
Fold = tuple[ThermalPlane, np.ndarray, np.ndarray, np.ndarray]


class Conduction:
    """Heat of one rank's particles in a step; `diffusivity` [m^2/s] is the largest found in the last one."""

    def __init__(self, conditions: GridConditions, points: MaterialPoints, nodes: Nodes, planes: list[ThermalPlane]):
        """points: `MaterialPoints`; nodes: `Nodes`; planes: `GridConditions.thermal_planes`."""
        settings = conditions.declared.scene.method
        self.points, self.nodes, self.planes = points, nodes, planes
        self.conducting, self.moving = settings.conduction, settings.motion
        self.supply = HeatSupply(conditions.declared, points, points.axisymmetric)
        self.surfaces = HeatedSurfaces(self.supply, points)
        self.thermal, self.tensors = aligned_zeros((0, 4)), aligned_zeros((0, 8))
        self.directed = any(getattr(law, "conductivity_tensor", None) for law in points.laws)
        self._seen, self.diffusivity = -1, 0.0
        self._folds: list[Fold] = []
        self._fill, self._take = (
            RecalledEach(grid_heat.fill_thermal, free=(0, 1, 4)),
            RecalledEach(grid_heat.take_heat, free=(0, 1)),
        )
        self._scatter, self._conduct = (
            Recalled(grid_heat.scatter_heat, free=(0,)),
            Recalled(grid_heat.conduct, free=(0,)),
        )
        self._gather = Recalled(grid_heat.gather_heat, free=(0,))

    def refresh(self) -> None:
        """What particles have to conduct, in the present state."""
        points, storage = self.points, self.points.storage
        if len(self.thermal) < points.capacity:
            self.thermal = aligned_zeros((points.capacity, 4))
            self.tensors = aligned_zeros((points.capacity if self.directed else 0, 8))
        self.thermal[: points.owned] = 0.0
        self.diffusivity = 0.0
        for block in points.warm_blocks:
            here, conductivity = (
                (block.first, block.last, points.space),
                (block.law.conductivity or 0.0) * self.conducting,
            )
            state = storage("deformation_gradient"), storage("temperature"), points.motion
            found = self._fill(id(block.law), *here, block.law, conductivity, *state, self.thermal)
            self.diffusivity = max(self.diffusivity, found)
            if self.directed:
                grid_heat.turn_conductivities(*here, self._components(block.law), state[0], points.motion, self.tensors)

    def _components(self, law: Any) -> tuple[float, ...]:
        """xx yy zz xy xz yz [W/(m K)] of a law."""
        alike = (law.conductivity or 0.0,) * 3 + (0.0,) * 3
        found: tuple[float, ...] = (law.conductivity_tensor or alike) if self.conducting else (0.0,) * 6
        return found

    def stable_step(self) -> float:
        """h^2 / (2 d alpha) [s], with a margin, of the present state."""
        if self.moving:
            self.refresh()
        if self.diffusivity == 0.0:
            return np.inf
        return float(_SAFETY * self.points.settings.cell**2 / (2.0 * self.points.dimension * self.diffusivity))

    def _update_folds(self) -> None:
        nodes = self.nodes
        if self._seen == nodes.changes:
            return
        self._seen, self._folds = nodes.changes, []
        for plane in self.planes:
            behind, images, on_plane = nodes.ranks.cells.mirrored(plane.mirror)
            ghosts, images = np.concatenate((behind, on_plane)), np.concatenate((images, on_plane))
            places = nodes.places[ghosts, : self.points.dimension]
            self._folds.append((plane, ghosts.astype(np.int32), images.astype(np.int32), places))

    def advance(self, time: float, step: float) -> float:
        """Conduct for a step [s] from `time`; the heat [J] that this rank's particles gained, in sum that which was
        supplied.
        """
        self.refresh()
        self._update_folds()
        self._supply_sources(time + 0.5 * step)
        passed = self._pass_plastic_heat(step)
        held = [plane.temperatures(places, time) for plane, _, _, places in self._folds]
        # a plane that is not at the particles' temperature at the start takes them along, as nodes of finite elements
        # on it would
        jumps = self._jumps(held) if time == 0.0 else [np.zeros(1)] * len(held)
        self._find_temperatures(time)
        self._find_flows(time + 0.5 * step)
        self._find_increments(held, jumps, time, step)
        return self._take_heat() - passed

    def _find_temperatures(self, time: float) -> None:
        """Of the nodes at a time [s], those behind planes included."""
        nodes = self.nodes
        self._sum_capacities(self.thermal, self.points.find("temperature_slope"))
        lifts = [plane.lift(places, time) for plane, _, _, places in self._folds]
        for (plane, ghosts, images, _), lift in zip(self._folds, lifts):
            grid_heat.fold_capacity(ghosts, images, plane.sign, lift, nodes.heat)
        grid_heat.find_temperatures(0, nodes.count, nodes.heat)
        for (plane, ghosts, images, _), lift in reversed(list(zip(self._folds, lifts))):
            grid_heat.spread_temperature(ghosts, images, plane.sign, lift, nodes.heat)

    def _find_flows(self, time: float) -> None:
        """Heat flows and powers [W] into the nodes, of all ranks, from surfaces at a time [s]."""
        points, nodes = self.points, self.nodes
        reference = None if points.where == "motion" else points.storage("deformation_gradient")
        slopes = points.find("temperature_slope")
        tensors = self.tensors if self.directed else None
        self._conduct(nodes.interpolation, reference, self.thermal, tensors, slopes, nodes.heat, nodes.partial)
        self.surfaces.supply_to(nodes, time)
        nodes.sum("flow")
        for plane, ghosts, images, _ in self._folds:
            grid_heat.fold_flow(ghosts, images, plane.sign, nodes.heat)

    def _find_increments(self, held: list[np.ndarray], jumps: list[np.ndarray], time: float, step: float) -> None:
        """Changes of the nodes' temperatures [K] in a step."""
        nodes = self.nodes
        grid_heat.find_increments(0, nodes.count, nodes.heat, step)
        for (plane, ghosts, images, places), before, jump in reversed(list(zip(self._folds, held, jumps))):
            change = plane.temperatures(places, time + step) - before + jump
            grid_heat.spread_increment(ghosts, images, plane.sign, change, nodes.heat)

    def _take_heat(self) -> float:
        """New temperatures and internal energies of the particles; the heat [J] that they gained from the nodes."""
        points, storage = self.points, self.points.storage
        gained: float = self._gather(self.nodes.interpolation, self.nodes.heat, self.thermal)
        for block in points.warm_blocks:
            state = points.motion, storage("temperature"), storage("internal_energy")
            self._take(id(block.law), block.first, block.last, block.law, self.thermal, *state)
        return gained

    def _pass_plastic_heat(self, step: float) -> float:
        """Let the grid spread what plastic flow has warmed since the last step, where planes hold temperatures; that
        heat [J].

        Particles beside a held plane would keep it otherwise: nodes on the plane have no increments that could take it
        up.
        """
        rise = self.points.find("plastic_rise")
        if rise is None or step == 0.0:
            return 0.0
        cell, heat = float(self.points.settings.cell), 0.0
        for block in self.points.warm_blocks:
            heat += grid_heat.hand_over_rise(block.first, block.last, self.thermal, rise, step, cell)
        return heat

    def _supply_sources(self, time: float) -> None:
        """Powers of sources at a time [s]; only particles with a temperature take any."""
        points, thermal, power = self.points, self.thermal[: self.points.owned], self.supply.sources(time)
        if power is not None:
            thermal[:, 3] = np.where(thermal[:, 1] > 0.0, power * points.motion[: points.owned, 7], 0.0)

    def _sum_capacities(self, thermal: np.ndarray, slopes: np.ndarray | None = None) -> None:
        nodes = self.nodes
        nodes.clear(nodes.heat)
        self._scatter(nodes.interpolation, thermal, slopes, nodes.heat, nodes.partial)
        nodes.sum("capacity")

    def _jumps(self, held: list[np.ndarray]) -> list[np.ndarray]:
        """Temperatures of the planes less those of the particles beside them [K], at the rows of the folds.

        The latter are those of the line on the plane that fits the particles around an image node best, by capacity and
        weight.
        """
        result = []
        for (plane, _, images, _), wanted in zip(self._folds, held):
            if plane.formula is None:
                result.append(np.zeros(len(images)))
                continue
            n, depth = self.points.owned, aligned_zeros(self.thermal.shape)
            depth[:n] = self.thermal[:n]
            beyond = (self.points.places[:n, plane.axis] - plane.offset) / self.points.settings.cell
            self._sum_capacities(self.thermal)
            total, capacity = self.nodes.heat[images, :2].T
            depth[:n, 1] *= beyond
            self._sum_capacities(depth)
            moment, first = self.nodes.heat[images, :2].T
            depth[:n, 0] = beyond
            self._sum_capacities(depth)
            second = self.nodes.heat[images, 0]
            spread = capacity * second - first**2
            with np.errstate(divide="ignore", invalid="ignore"):
                mean = np.where(capacity > 0.0, total / capacity, wanted)
                fitted = np.where(spread > _FLAT * capacity * second, (total * second - first * moment) / spread, mean)
            result.append(wanted - fitted)
        return result


def common_conductivity(laws: list[Any]) -> float | None:
    """Of all laws that have one [W/(m K)], None where they differ or depend on the direction."""
    if any(getattr(law, "conductivity_tensor", None) for law in laws):
        return None
    found = {law.conductivity for law in laws if getattr(law, "conductivity", None)}
    return float(found.pop()) if len(found) == 1 else None


def conducts(scene: Scene, laws: list[Any]) -> bool:
    """Whether there is any heat to conduct or to supply."""
    able = scene.method.conduction and any(getattr(law, "conductivity", None) for law in laws)
    return able or scene.loads.heat_source is not None
