"""Heat on the background grid: conduction with lumped capacities, sources, planes at given temperatures, heat through
surfaces.

    C_i = sum_p w_ip C_p    T_i = sum_p w_ip C_p T_p / C_i    Q_i = sum_p [w_ip q_p - V_p kappa (grad T)_p . grad w_ip]
    T_p <- T_p + dt sum_i w_ip Q_i / C_i

so that sum_p C_p T_p changes by the powers q_p alone. A transfer of temperatures instead of increments would smooth
them at every step, whatever the spacing. Differences within a cell, which the grid does not see, die away at the rate
at which its shortest waves do: particles give them to the grid as powers (Gerya and Yuen 2003). Without that a cold
particle would be cooled with its hot neighbours. The heat step comes before that of the motion, with the particles
where they are; heat that a particle gains raises its temperature and its internal energy alike.

    thermal (capacity, 4)  T [K], C = m c [J/K], V kappa [W m/K], q [W]     of a particle
    nodes   (slots, 8)     C T, C, 0, 0 | Q, 0, 0, 0                        as particles give them
                           T, C, 0, 0 | change of T, 0, 0, 0                as they take them
"""

import math
from typing import Any

import numpy as np

from parsolid.boundary.heat import HeatSupply
from parsolid.kernels import inlined, kernel
from parsolid.materials.plastic.elastic_plastic import full_tensor
from parsolid.materials.plastic.functions import specific_heat, temperature_rise
from parsolid.methods.hyperelastic_particles import load_gradient
from parsolid.methods.mpm.conditions import GridConditions, ThermalPlane
from parsolid.methods.mpm.grid import Nodes
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.methods.mpm.shape_functions import nodes_across, shape_functions
from parsolid.methods.mpm.transfer import put_weights
from parsolid.scene import Scene
from parsolid.tensors import congruence, determinant, rotation

# share of the step at which the shortest waves of explicit conduction start to grow
_SAFETY = 0.9
# particles at one depth give no line
_FLAT = 1e-6


@kernel
def heat_to_grid(basis, cells, motion, thermal, slopes, nodes):
    """Add C T and C of all particles to nodes, which must be 0 before.

    slopes (capacity, 4) [K/m]: of the particles' temperatures, with which they count at the nodes, or None.
    """
    across, first = nodes_across(basis), 3 - len(cells.axes)
    planes = across if first == 0 else 1
    table, near, slope = np.zeros((3, across, 4)), np.empty((across**3, 2)), np.zeros(3)
    table[0, 0, 0] = 1.0
    for c in range(len(cells.base)):
        if cells.start[c] == cells.start[c + 1]:
            continue
        near[:] = 0.0
        for n in range(cells.start[c], cells.start[c + 1]):
            p = np.uintp(cells.order[n])
            put_weights(basis, cells, c, p, motion, table)
            if slopes is not None:
                for a in cells.axes:
                    slope[first + a] = cells.spacing * slopes[p, a]
            for i in range(planes):
                for j in range(across):
                    row, capacity = (i * across + j) * across, table[0, i, 0] * table[1, j, 0] * thermal[p, 1]
                    temperature = thermal[p, 0]
                    if slopes is not None:
                        temperature += slope[0] * table[0, i, 2] + slope[1] * table[1, j, 2]
                    for k in range(across):
                        share, there = capacity * table[2, k, 0], temperature
                        if slopes is not None:
                            there += slope[2] * table[2, k, 2]
                        near[row + k, 0] += share * there
                        near[row + k, 1] += share
        for k in range(cells.stencil.shape[1]):
            node = np.uintp(cells.stencil[c, k])
            nodes[node, 0] += near[k, 0]
            nodes[node, 1] += near[k, 1]


@kernel
def find_temperatures(count, nodes):
    """Nodal temperatures from C T and C, 0 where there is no capacity; flows become 0."""
    for i in range(count):
        nodes[i, 0] = nodes[i, 0] / nodes[i, 1] if nodes[i, 1] > 0.0 else 0.0
        nodes[i, 4] = 0.0


@kernel
def conduct(basis, cells, motion, thermal, tensors, slopes, nodes):
    """Add the heat flows and powers of all particles to column 4 of nodes, from the temperatures of the nodes.

    tensors (capacity, 8): V kappa [W m/K], xx yy zz 0 | yz xz xy 0, in place of that in thermal, or None; slopes
    (capacity, 4) [K/m] become the gradients, or None.
    """
    across, first = nodes_across(basis), 3 - len(cells.axes)
    planes = across if first == 0 else 1
    table, near, flow, inverse = np.zeros((3, across, 4)), np.empty(across**3), np.empty(across**3), 1.0 / cells.spacing
    table[0, 0, 0] = 1.0
    for c in range(len(cells.base)):
        if cells.start[c] == cells.start[c + 1]:
            continue
        for k in range(cells.stencil.shape[1]):
            near[k], flow[k] = inverse * nodes[cells.stencil[c, k], 0], 0.0
        for n in range(cells.start[c], cells.start[c + 1]):
            p = np.uintp(cells.order[n])
            put_weights(basis, cells, c, p, motion, table)
            x, y, z = 0.0, 0.0, 0.0
            for i in range(planes):
                for j in range(across):
                    row, mean, along = (i * across + j) * across, 0.0, 0.0
                    for k in range(across):
                        mean += table[2, k, 0] * near[row + k]
                        along += table[2, k, 1] * near[row + k]
                    x += table[0, i, 1] * table[1, j, 0] * mean
                    y += table[0, i, 0] * table[1, j, 1] * mean
                    z += table[0, i, 0] * table[1, j, 0] * along
            if first:
                x, y, z = y, z, 0.0
            if slopes is not None:
                slopes[p, 0], slopes[p, 1], slopes[p, 2] = x, y, z
            if tensors is None:
                x, y, z = thermal[p, 2] * x, thermal[p, 2] * y, thermal[p, 2] * z
            else:
                xx, yy, zz = tensors[p, 0], tensors[p, 1], tensors[p, 2]
                yz, xz, xy = tensors[p, 4], tensors[p, 5], tensors[p, 6]
                x, y, z = xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z
            if first:
                x, y, z = 0.0, x, y
            for i in range(planes):
                for j in range(across):
                    row, w = (i * across + j) * across, table[0, i, 0] * table[1, j, 0]
                    side = table[0, i, 1] * table[1, j, 0] * x + table[0, i, 0] * table[1, j, 1] * y
                    side, ahead = w * thermal[p, 3] - inverse * side, -inverse * w * z
                    for k in range(across):
                        flow[row + k] += table[2, k, 0] * side + table[2, k, 1] * ahead
        for k in range(cells.stencil.shape[1]):
            nodes[cells.stencil[c, k], 4] += flow[k]


@inlined
def at_particle(across, planes, table, near):
    """Nodal values near (K^d,) at a particle with the shape functions in table, see `put_weights`."""
    value = 0.0
    for i in range(planes):
        for j in range(across):
            row, mean = (i * across + j) * across, 0.0
            for k in range(across):
                mean += table[2, k, 0] * near[row + k]
            value += table[0, i, 0] * table[1, j, 0] * mean
    return value


@kernel
def pass_to_grid(basis, cells, nodes, motion, thermal, step):
    """Make a share of what particles' temperatures are beyond those of the grid powers of a step [s] instead; the heat
    [J].

    Differences within a cell die away by exp(-pi^2 alpha t / h^2), as the shortest waves of the grid do.
    """
    across, passed = nodes_across(basis), 0.0
    planes, decay = across if len(cells.axes) == 3 else 1, (math.pi / cells.spacing) ** 2 * step
    table, near = np.zeros((3, across, 4)), np.empty(across**3)
    table[0, 0, 0] = 1.0
    for c in range(len(cells.base)):
        if cells.start[c] == cells.start[c + 1]:
            continue
        for k in range(cells.stencil.shape[1]):
            near[k] = nodes[cells.stencil[c, k], 0]
        for n in range(cells.start[c], cells.start[c + 1]):
            p = np.uintp(cells.order[n])
            if thermal[p, 1] <= 0.0:
                continue
            put_weights(basis, cells, c, p, motion, table)
            there = at_particle(across, planes, table, near)
            excess = (thermal[p, 0] - there) * -math.expm1(-decay * thermal[p, 2] / thermal[p, 1])
            thermal[p, 0] -= excess
            thermal[p, 3] += thermal[p, 1] * excess / step
            passed += thermal[p, 1] * excess
    return passed


@kernel
def supply_at_faces(basis, cells, feet, power, nodes):
    """Add powers (capacity,) [W] to column 4 of nodes, by the weights of the places feet (capacity, 4) [m].

    A place beyond the cell of its particle counts as at the edge of it.
    """
    across, first = nodes_across(basis), 3 - len(cells.axes)
    weight = np.zeros((3, across))
    weight[0, 0] = 1.0
    for c in range(len(cells.base)):
        for n in range(cells.start[c], cells.start[c + 1]):
            p = cells.order[n]
            if power[p] == 0.0:
                continue
            for a in cells.axes:
                xi = (feet[p, a] - cells.origin[a]) / cells.spacing - cells.base[c, a]
                w, _ = shape_functions(basis, p, a, min(max(xi, basis.offset), basis.offset + 1.0))
                for k in range(across):
                    weight[first + a, k] = w[k]
            for k in range(cells.stencil.shape[1]):
                w_x, w_y, w_z = weight[0, k // across**2], weight[1, k // across % across], weight[2, k % across]
                nodes[cells.stencil[c, k], 4] += w_x * w_y * w_z * power[p]


@kernel
def find_increments(count, nodes, step):
    """Changes of the nodal temperatures in a step [K] from the heat flows."""
    for i in range(count):
        nodes[i, 4] = step * nodes[i, 4] / nodes[i, 1] if nodes[i, 1] > 0.0 else 0.0


@kernel
def heat_to_particles(basis, cells, nodes, motion, thermal):
    """Add the nodal increments to the temperatures of all particles; the heat that they gained [J]."""
    across, gained = nodes_across(basis), 0.0
    planes = across if len(cells.axes) == 3 else 1
    table, near = np.zeros((3, across, 4)), np.empty(across**3)
    table[0, 0, 0] = 1.0
    for c in range(len(cells.base)):
        if cells.start[c] == cells.start[c + 1]:
            continue
        for k in range(cells.stencil.shape[1]):
            near[k] = nodes[cells.stencil[c, k], 4]
        for n in range(cells.start[c], cells.start[c + 1]):
            p = np.uintp(cells.order[n])
            put_weights(basis, cells, c, p, motion, table)
            change = at_particle(across, planes, table, near)
            thermal[p, 0] += change
            gained += thermal[p, 1] * change
    return gained


@kernel
def fold_capacity(behind, image, sign, lift, nodes):
    """Add what the mirror image of the body gives to C T and C at a mirror plane; before `find_temperatures`.

    behind, image: as in `grid.fold`. The image has the temperatures sign T + lift, lift (n,) [K]: at a plane at a
    temperature T0 2 T0 - T, at an insulated one T, where heat enters T less 2 d q/kappa at a depth d.
    """
    for k in range(behind.size):
        here, there = behind[k], image[k]
        nodes[there, 0] += sign * nodes[here, 0] + lift[k] * nodes[here, 1]
        nodes[there, 1] += nodes[here, 1]


@kernel
def unfold_temperatures(behind, image, sign, lift, nodes):
    """Temperatures behind a mirror plane, of which `fold_capacity` takes the image; after `find_temperatures`."""
    for k in range(behind.size):
        nodes[behind[k], 0] = sign * (nodes[image[k], 0] - lift[k])


@kernel
def fold_flow(behind, image, sign, nodes):
    """Add the image's heat flows; after `conduct`, before `find_increments`."""
    for k in range(behind.size):
        nodes[image[k], 4] += sign * nodes[behind[k], 4]


@kernel
def unfold_increments(behind, image, sign, change, nodes):
    """Increments behind and on a mirror plane whose temperature changes by (n,) [K] in the step; after
    `find_increments`."""
    for k in range(behind.size):
        here, there = behind[k], image[k]
        if here != there:
            nodes[here, 4] = sign * nodes[there, 4] + (1.0 - sign) * change[k]
        elif sign < 0.0:
            nodes[here, 4] = change[k]


@kernel
def fill_thermal(first, last, law, conductivity, deformation, temperature, motion, thermal):
    """T, C and V kappa of particles first..last-1 of one law, in the present configuration; q becomes 0. Returns the
    largest diffusivity V kappa / C [m^2/s].

    conductivity [W/(m K)]; deformation: F, see `hyperelastic_particles.load_gradient`; temperature (1, capacity).
    """
    largest = 0.0
    for p in range(first, last):
        volume = determinant(load_gradient(deformation, p)) * motion[p, 7]
        thermal[p, 0], thermal[p, 1] = temperature[0, p], specific_heat(law, temperature[0, p]) * motion[p, 3]
        thermal[p, 2], thermal[p, 3] = conductivity * volume, 0.0
        largest = max(largest, thermal[p, 2] / thermal[p, 1])
    return largest


@kernel
def turn_conductivities(first, last, components, deformation, motion, tensors):
    """V R kappa R^T [W m/K] of particles first..last-1 of one law, R the rotation of F, as records of `conduct`.

    components [W/(m K)]: xx yy zz xy xz yz.
    """
    for p in range(first, last):
        F = load_gradient(deformation, p)
        volume, turned = determinant(F) * motion[p, 7], congruence(rotation(F), components)
        tensors[p, 0], tensors[p, 1], tensors[p, 2] = volume * turned[0], volume * turned[1], volume * turned[2]
        tensors[p, 4], tensors[p, 5], tensors[p, 6] = volume * turned[5], volume * turned[4], volume * turned[3]


@kernel
def take_heat(first, last, law, thermal, motion, temperature, energy):
    """New temperatures of particles first..last-1, and their heat as internal energy, (1, capacity) [J/m^3]."""
    for p in range(first, last):
        heat = thermal[p, 1] * (thermal[p, 0] - temperature[0, p]) / motion[p, 7]
        energy[0, p] += heat
        if law.heat_points is None and law.specific_heat_slope == 0.0:
            temperature[0, p] = thermal[p, 0]
        else:
            temperature[0, p] += temperature_rise(law, temperature[0, p], heat)


class Conduction:
    """Heat of one rank's particles in a step; diffusivity [m^2/s]: the largest found in the last one.

    The grid takes a flux through a surface up by the weights of the surface itself, not of the particles beside it, and
    particles count at the nodes with the slopes of their temperatures, so that a linear profile is one on the grid.
    Behind a mirror plane through which heat enters the image continues the profile.
    """

    def __init__(
        self, scene: Scene, conditions: GridConditions, points: MaterialPoints, nodes: Nodes, planes: list[ThermalPlane]
    ):
        """planes: `GridConditions.thermal_planes`."""
        self.points, self.nodes, self.planes = points, nodes, planes
        self.conducting, self.moving = scene.method.conduction, scene.method.motion
        self.supply = HeatSupply(scene, points, points.axisymmetric)
        self.thermal, self.tensors = np.zeros((0, 4)), np.zeros((0, 8))
        self.directed = any(getattr(law, "conductivity_tensor", None) for law in points.laws)
        # the least conductivity of any direction over the largest
        self._least = {law: least_conductivity(law) for law in points.laws} if self.directed else {}
        self._feet, self._power = np.zeros((0, 4)), np.zeros(0)
        self._seen, self.diffusivity = -1, 0.0
        # a plane, slots of the nodes behind and on it, those of their images, and places of the former
        self._folds: list[tuple[ThermalPlane, np.ndarray, np.ndarray, np.ndarray]] = []

    def refresh(self) -> None:
        """Find capacities and conductivities of particles in the present state."""
        points, storage = self.points, self.points.storage
        if len(self.thermal) < points.capacity:
            self.thermal = np.zeros((points.capacity, 4))
            self.tensors = np.zeros((points.capacity if self.directed else 0, 8))
            self._feet, self._power = np.zeros((points.capacity, 4)), np.zeros(points.capacity)
        self.thermal[: points.owned] = 0.0
        self.diffusivity = 0.0
        for block in points.warm_blocks:
            conductivity = block.law.conductivity * self.conducting
            F, here = storage("deformation_gradient"), (block.first, block.last)
            state = F, storage("temperature"), points.motion, self.thermal
            self.diffusivity = max(self.diffusivity, fill_thermal(*here, block.law, conductivity, *state))
            if self.directed:
                alike = (conductivity,) * 3 + (0.0,) * 3
                tensor = block.law.conductivity_tensor if self.conducting else None
                # the grid's shortest waves in the direction that conducts least
                self.thermal[slice(*here), 2] *= self._least[block.law]
                turn_conductivities(*here, tensor or alike, F, points.motion, self.tensors)

    def stable_step(self) -> float:
        """h^2 / (2 d alpha) [s], with a margin, of the present state."""
        if self.moving:
            self.refresh()
        if self.diffusivity == 0.0:
            return np.inf
        return float(_SAFETY * self.points.settings.cell**2 / (2.0 * self.points.dimension * self.diffusivity))

    def advance(self, time: float, step: float) -> float:
        """Conduct for a step [s] from `time`; the heat [J] that this rank's particles gained, in sum that which was
        supplied."""
        points, nodes = self.points, self.nodes
        basis, cells, middle = points.basis, nodes.cells, time + 0.5 * step
        self.refresh()
        self._find_folds()
        self._supply_sources(middle)
        held = [plane.temperatures(places, time) for plane, _, _, places in self._folds]
        gained = self._follow_planes(held) if time == 0.0 else 0.0
        self._find_temperatures(time)
        passed = 0.0
        if step > 0.0:
            passed = pass_to_grid(basis, cells, nodes.heat, points.motion, self.thermal, step)
        tensors = self.tensors if self.directed else None
        conduct(basis, cells, points.motion, self.thermal, tensors, points.find("temperature_slope"), nodes.heat)
        self._supply_surfaces(middle)
        nodes.exchange("flow")
        for plane, behind, images, _ in self._folds:
            fold_flow(behind, images, plane.sign, nodes.heat)
        find_increments(nodes.count, nodes.heat, step)
        folds = zip(self._folds, held)
        changes = [plane.temperatures(places, time + step) - before for (plane, _, _, places), before in folds]
        gained += self._take_increments(changes)
        for block in points.warm_blocks:
            state = points.motion, points.storage("temperature"), points.storage("internal_energy")
            take_heat(block.first, block.last, block.law, self.thermal, *state)
        return float(gained - passed)

    def _take_increments(self, changes: list[np.ndarray]) -> float:
        """Give the nodes' increments to particles, with changes [K] of planes at rows of the folds; the heat [J]."""
        for (plane, behind, images, _), change in reversed(list(zip(self._folds, changes))):
            unfold_increments(behind, images, plane.sign, change, self.nodes.heat)
        points = self.points
        return float(heat_to_particles(points.basis, self.nodes.cells, self.nodes.heat, points.motion, self.thermal))

    def _follow_planes(self, held: list[np.ndarray]) -> float:
        """Take particles along with planes that are not at their temperature at the start, as nodes of finite elements
        on these would; the heat [J]."""
        jumps = self._jumps(held)
        self.nodes.clear(self.nodes.heat)
        return self._take_increments(jumps)

    def _find_folds(self) -> None:
        nodes = self.nodes
        if self._seen == nodes.changes:
            return
        self._seen, self._folds = nodes.changes, []
        for plane in self.planes:
            behind, images, on_plane = nodes.grid.cells.mirrored(plane.mirror)
            behind, images = np.concatenate((behind, on_plane)), np.concatenate((images, on_plane))
            self._folds.append((plane, behind, images, nodes.places[behind, : self.points.dimension]))

    def _find_temperatures(self, time: float) -> None:
        """Find temperatures of nodes at a time [s], those behind planes included."""
        nodes = self.nodes
        self._sum_capacities(self.thermal, self.points.find("temperature_slope"))
        lifts = [plane.lift(places, time) for plane, _, _, places in self._folds]
        for (plane, behind, images, _), lift in zip(self._folds, lifts):
            fold_capacity(behind, images, plane.sign, lift, nodes.heat)
        find_temperatures(nodes.count, nodes.heat)
        for (plane, behind, images, _), lift in reversed(list(zip(self._folds, lifts))):
            unfold_temperatures(behind, images, plane.sign, lift, nodes.heat)

    def _sum_capacities(self, thermal: np.ndarray, slopes: np.ndarray | None = None) -> None:
        nodes, points = self.nodes, self.points
        nodes.clear(nodes.heat)
        heat_to_grid(points.basis, nodes.cells, points.motion, thermal, slopes, nodes.heat)
        nodes.exchange("capacity")

    def _supply_sources(self, time: float) -> None:
        """Powers of sources at a time [s]; only particles with a temperature take any."""
        points, thermal, power = self.points, self.thermal[: self.points.owned], self.supply.sources(time)
        if power is not None:
            thermal[:, 3] = np.where(thermal[:, 1] > 0.0, power * points.motion[: points.owned, 7], 0.0)

    def _supply_surfaces(self, time: float) -> None:
        """Heat through surfaces at a time [s] into the flows of the nodes, at the points of the surface nearest to
        particles."""
        points, d = self.points, self.points.dimension
        for number, plane in enumerate(self.supply.planes):
            rows, power = self.supply.powers(number, time)
            self._power[:] = 0.0
            self._power[rows] = power
            beyond = plane.offset - points.owned_rows("reference_position")[rows, plane.axis]
            # column `axis` of F: 11, 12, 21, 22 in two dimensions
            column = points.storage("deformation_gradient")[plane.axis : d * d : d][:, rows].T
            self._feet[rows, :d] = points.motion[rows, :d] + column * beyond[:, None]
            supply_at_faces(points.basis, self.nodes.cells, self._feet, self._power, self.nodes.heat)

    def _jumps(self, held: list[np.ndarray]) -> list[np.ndarray]:
        """Temperatures of the planes less those of the particles beside them [K], at the rows of the folds.

        The latter are those of the line on the plane that fits the particles around an image node best, by capacity and
        weight.
        """
        result = []
        for (plane, _, images, _), wanted in zip(self._folds, held):
            if plane.prescribed is None:
                result.append(np.zeros(len(images)))
                continue
            n, depth = self.points.owned, np.zeros(self.thermal.shape)
            depth[:n] = self.thermal[:n]
            beyond = (self.points.motion[:n, plane.axis] - plane.offset) / self.points.settings.cell
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


def least_conductivity(law: Any) -> float:
    """The least conductivity of any direction over the largest."""
    tensor = getattr(law, "conductivity_tensor", None)
    return 1.0 if tensor is None else float(np.linalg.eigvalsh(full_tensor(tensor))[0] / law.conductivity)


def common_conductivity(laws: list[Any]) -> float | None:
    """The conductivity [W/(m K)] of all laws that have one, None where they differ or depend on the direction."""
    if any(getattr(law, "conductivity_tensor", None) for law in laws):
        return None
    found = {law.conductivity for law in laws if getattr(law, "conductivity", None)}
    return float(found.pop()) if len(found) == 1 else None


def conducts(scene: Scene, laws: list[Any]) -> bool:
    """Whether there is any heat to conduct or to supply."""
    able = scene.method.conduction and any(getattr(law, "conductivity", None) for law in laws)
    return able or scene.loads.heat_source is not None
