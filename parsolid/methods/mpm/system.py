"""Material point method: particles carry the state, a background grid the momentum of each step.

A step: particles give mass, momentum and force to the nodes (summed over ranks); nodes move; particles take velocity, place and
velocity gradient; stress; particles are listed by cell anew and handed to other ranks. With `order = "musl"` particles' new
velocities are mapped to the nodes once more before the gradient is taken. No ghost particles, no collective but the loop's.
"""

import time as clock

import numpy as np

from decomposition.cell_partition import CellPartition
from decomposition.grid import RankGrid
from parsolid.boundary.body_loads import BodyLoads
from parsolid.collective import SolverError, maximum, minimum
from parsolid.methods.mpm import grid as kernels
from parsolid.methods.mpm import weights as grid_weights
from parsolid.methods.mpm.conduction import Conduction, conducts, least_coordinates, thermal_planes
from parsolid.methods.mpm.gather import gather
from parsolid.methods.mpm.grid_conditions import driven_regions, mirror_planes, walls
from parsolid.methods.mpm.grid_topology import NodeTables
from parsolid.methods.mpm.initial_state import set_initial_motion
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.observation import can_melt, homologous_temperatures, shown
from parsolid.methods.mpm.reference_grid import ReferenceGrid
from parsolid.methods.mpm.scatter import scatter
from parsolid.methods.mpm.stress_update import StressUpdate
from parsolid.methods.protocol import ParticleMethod
from parsolid.numerics.lanes import aligned_zeros
from parsolid.numerics.layout import LAYOUT, Axisymmetric

# nodes lighter than this share of the lightest particle do not move
_LEAST_MASS = 1e-9
# steps between looks at the order of storage and the balance of ranks, and the share of breaks that calls for a new order
_PERIOD, _DISORDER = 16, 0.3


class MaterialPoint(ParticleMethod):
    """The method on one rank: its particles are `points`, its cells and shared nodes `grid`, the arrays of nodes `tables`."""

    def __init__(self, comm, scene, particle_set):
        """particle_set: this rank's particles, sorted by law. Raises SolverError on all ranks when planes do not suit the grid. Collective."""
        self.comm, self.settings = comm, scene.method
        self.dimension = d = particle_set.position.shape[1]
        self.space = Axisymmetric() if scene.method.geometry == "axisymmetric" else LAYOUT[d]
        self.origin = aligned_zeros(4)
        if scene.method.origin is not None:
            self.origin[:d] = scene.method.origin
        self.points = MaterialPoints(scene, particle_set, self.origin)
        _refuse_branches(self.points.laws)
        self.materials = StressUpdate(scene, self.points)
        self.reference = None
        if scene.method.formulation == "total-lagrangian":
            self.reference = ReferenceGrid(self.points, self.materials, self.space)
        basis = self.points.basis
        width = grid_weights.nodes_across(basis)
        self.planes = mirror_planes(comm, scene, particle_set.position, self.origin, float(scene.method.cell))
        self.walls, self.driven = walls(scene), driven_regions(scene)
        densities = [law.density for law in self.points.laws]
        self.loads = BodyLoads(scene, np.array(densities)[self.points.law_of_body])
        self.conduction, thermal = None, []
        if conducts(scene, self.points.laws):
            lower = least_coordinates(comm, particle_set.position)
            thermal = thermal_planes(scene, self.planes, lower, self.origin, float(scene.method.cell))
            self.conduction = Conduction(scene, self.points, thermal, self.loads)
        mirrors = tuple({plane.mirror: None for plane in (*self.planes, *thermal)})
        self.grid = RankGrid(comm, d, width, mirrors, scene.method.bitwise)
        self.tables = NodeTables(
            self.grid,
            self.origin,
            float(scene.method.cell),
            self.planes,
            scene.method.order == "musl",
            self.conduction is not None,
        )
        self.scratch = kernels.make_scratch(basis, d)
        self.least_mass = _LEAST_MASS * minimum(
            comm, float(self.points.motion[: len(particle_set), 3].min(initial=np.inf))
        )
        self.filters = scene.method.transfer == "apic" or scene.method.flip_fraction < 1.0
        self.gravity = aligned_zeros((1, 4))
        self.steps, self.partition, self.fastest, self.plastic_work = 0, None, 0.0, 0.0
        self.table = self.points

    def begin(self, scene, particle_set) -> None:
        """Set the state at time 0, deal particles out to the owners of their cells, and find the first stress; collective."""
        set_initial_motion(scene, particle_set, self.points)
        self.materials.begin(scene, particle_set)
        self._deal_out(None)
        self.tables.update()
        _, self.fastest, _, _ = self._advance_stress(0.0)
        self._look_at_heat()

    def resume(self) -> None:
        """Continue with the checkpoint's owners of cells; on other ranks with new ones; collective."""
        self._deal_out(self.partition)
        if self.reference is not None:
            self.reference.resume()
        self._look_at_heat()

    def _look_at_heat(self) -> None:
        """What conduction allows for the first step, and how much heat there is; collective."""
        if self.conduction is not None:
            self.conduction.refresh()
            self.energy_scale = self.comm.allreduce(self.points.heat())

    def _deal_out(self, partition) -> bool:
        self.points.stretch_domains()
        sound = self.grid.deal_out(self.points, partition)
        if partition is None:
            self._sort_storage()
        return sound

    def state(self) -> dict:
        """Owners of cells, the step counter that times re-ordering, the largest speed; collective."""
        return {
            "partition": self.grid.partition.state(),
            "steps": self.steps,
            "fastest": maximum(self.comm, self.fastest),
            "plastic_work": self.comm.allgather(self.plastic_work),
        }

    def set_state(self, state: dict) -> None:
        """Take back what `state` gave; owners of cells only for as many ranks."""
        self.steps, self.fastest = state["steps"], state["fastest"]
        partition = CellPartition.from_state(state["partition"], self.dimension)
        work = state["plastic_work"]
        if partition.ranks == self.comm.size:
            self.partition, self.plastic_work = partition, work[self.comm.rank]
        else:
            self.plastic_work = sum(work) if self.comm.rank == 0 else 0.0

    # --- a step -------------------------------------------------------------------------------------------------

    @property
    def owned(self) -> int:
        """Number of this rank's particles, which changes as they move."""
        return self.points.owned

    @property
    def mass(self) -> np.ndarray:
        """Mass [kg] (capacity,)."""
        return self.points.motion[:, 3]

    @property
    def share(self) -> np.ndarray:
        """No particle lies on a mirror plane."""
        return np.ones(len(self.points.motion))

    def stable_step(self) -> float:
        """cfl h / (c + |v|) [s] of this rank's fastest particle, and what conduction allows."""
        thermal = self.conduction.stable_step() if self.conduction is not None else np.inf
        slowness = 1.0 / self.fastest if self.fastest > 0.0 else np.inf
        if self.reference is not None:
            thermal, slowness = thermal * self.reference.stretch**2, self.reference.slowness
        return min(self.settings.cfl * self.settings.cell * slowness, thermal) if self.settings.motion else thermal

    def advance(self, time: float, step: float, ledger, announce) -> bool:
        """One step from `time` [s]."""
        points, tables = self.points, self.tables
        tables.update()
        basis, transfer = self.points.basis, self._transfer()
        if self.conduction is not None:
            supplied = self.conduction.advance(tables, self.space, basis, self.scratch, time, step, self._timed)
            ledger.add_term("heat_supplied", supplied)
        if not self.settings.motion:
            announce(True, self.stable_step())
            return True
        kinetic = kernels.kinetic_energy(self.owned, points.motion)
        external = self._external(time)
        self._to_nodes(basis, transfer, external)
        supplied, caught, gain = self._move_nodes(time, step)
        before = points.motion[: self.owned].copy() if external is not None else None
        self._from_nodes(basis, transfer, time, step)
        if external is not None:
            supplied += _work(external[: self.owned], before, points.motion[: self.owned], step)
        # what filters the particles' velocities loses kinetic energy; FLIP alone does not
        lost = kinetic + gain - kernels.kinetic_energy(self.owned, points.motion) if self.filters else 0.0
        ledger.add(1.0, 0.0, lost + caught, supplied)
        sound, self.fastest, plastic, viscous = self._advance_stress(step)
        self.plastic_work += plastic
        ledger.add_term("plastic_work", plastic)
        ledger.add_term("viscous_work", viscous)
        if self.conduction is not None:
            self.conduction.refresh()
        announce(sound, self.stable_step())
        return self._settle() and sound

    def _transfer(self):
        if self.settings.transfer == "apic":
            return kernels.Apic(self.points.storage("velocity_slope"))
        return kernels.Flip(float(self.settings.flip_fraction))

    def _external(self, time: float) -> np.ndarray | None:
        """Forces (capacity, 4) [N] of the loads on particles."""
        if not self.loads.accelerates:
            return None
        rows = self.table.owned_rows
        result = aligned_zeros((self.points.capacity, 4))
        acceleration = self.loads.acceleration(rows("body"), rows("reference_position"), time)
        result[: self.owned, : self.dimension] = self.points.motion[: self.owned, 3:4] * acceleration
        return result

    def _advance_stress(self, step: float) -> tuple[bool, float, float, float]:
        """See `StressUpdate.advance`."""
        if self.reference is not None:
            return self.reference.advance_stress(self.tables.grid, step)
        return self.materials.advance(step)

    def _to_nodes(self, basis, transfer, external) -> None:
        """Mass, momentum and force of all ranks' particles on the nodes."""
        tables, motion, where = self.tables, self.points.motion, self.points.places
        stress = (
            self.reference.stress
            if self.reference is not None
            else kernels.CauchyStress(self.points.storage("stress_and_volume"))
        )
        tables.clear()
        scatter(
            0,
            tables.cells,
            self.space,
            basis,
            tables.grid,
            self.scratch,
            where,
            motion,
            transfer,
            stress,
            external,
            tables.nodes,
            tables.partial,
        )
        self._timed(tables.sum.start)
        self._timed(tables.sum.finish)

    def _timed(self, communicate) -> None:
        began = clock.perf_counter()
        communicate()
        self.communication_seconds += clock.perf_counter() - began

    def _move_nodes(self, time: float, step: float) -> tuple[float, float, float]:
        """New nodal velocities; in J: work of walls and driven regions, loss at walls, gain of the nodes' kinetic energy."""
        tables, nodes = self.tables, self.tables.nodes
        tables.fold(nodes)
        kernels.update_nodes(0, tables.count, nodes, step, self.gravity, self.least_mass)
        supplied, caught = self._obey(nodes, time + step)
        gain = kernels.kinetic_gain(0, tables.count, nodes, tables.share)
        tables.spread(nodes)
        return supplied, caught, gain

    def _obey(self, nodes: np.ndarray, time: float) -> tuple[float, float]:
        """Let nodes follow walls and driven regions at a time [s]; the work that this takes and what of it is lost [J]."""
        tables, supplied, caught = self.tables, 0.0, 0.0
        for wall in self.walls:
            *impulse, lost = kernels.obey_wall(0, tables.count, nodes, tables.places, tables.share, wall.at(time))
            supplied, caught = supplied + float(np.dot(impulse, wall.velocity[:3])), caught + lost
        for region in self.driven:
            supplied += region.drive(nodes, tables, time, self.dimension)
        return supplied, caught

    def _from_nodes(self, basis, transfer, time: float, step: float) -> None:
        """Velocities, places and velocity gradients of particles from the nodes."""
        tables, motion, rate, where = (
            self.tables,
            self.points.motion,
            self.points.storage("velocity_gradient"),
            self.points.places,
        )
        lists = (0, tables.cells, self.space, basis, tables.grid, self.scratch, where, tables.nodes, motion, step)
        if self.settings.order == "usl":
            gather(*lists, transfer, rate, None)
            return
        gather(*lists, transfer, None, None)
        tables.clear_again()
        scatter(
            0,
            tables.cells,
            self.space,
            basis,
            tables.grid,
            self.scratch,
            where,
            motion,
            transfer,
            None,
            None,
            tables.again,
            tables.partial,
        )
        self._timed(tables.sum_again.start)
        self._timed(tables.sum_again.finish)
        tables.fold(tables.again)
        kernels.find_velocities(0, tables.count, tables.again, self.least_mass)
        self._obey(tables.again, time + step)
        tables.spread(tables.again)
        gather(*lists, None, rate, tables.again)

    def _settle(self) -> bool:
        """List particles by cell anew, hand over those that left; now and then re-order storage and balance the ranks."""
        self.points.stretch_domains()
        began = clock.perf_counter()
        sound = self.grid.settle(self.points)
        self.communication_seconds += clock.perf_counter() - began if self.comm.size > 1 else 0.0
        self.steps += 1
        if self.steps % _PERIOD == 0:
            if self.comm.size > 1 and self.grid.imbalance(self.owned) > self.settings.rebalance:
                sound = self._deal_out(None) and sound
                self.rebalanced += 1
            elif self.grid.cells.breaks(self.owned) > _DISORDER * self.owned:
                self._sort_storage()
        return sound

    rebalanced = 0

    def _sort_storage(self) -> None:
        """Bring particles into the order of the cells; in no cell are only those that end the run."""
        cells = self.grid.cells
        if cells.start[-1] == self.owned:
            self.points.reorder(cells.order[: self.owned].copy())
            cells.sort(self.points.bases(), self.owned, self.points.names() if self.settings.bitwise else None)

    # --- what the loop and the reports ask ------------------------------------------------------------------------

    def energies(self) -> tuple[float, float]:
        """Kinetic energy and internal energy [J] of this rank's particles, heat and plastic work included."""
        return kernels.kinetic_energy(self.owned, self.points.motion), self.materials.stored_energy()

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Fields that are not in the table."""
        return shown(self.points, name, first, last)

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """This rank's part of a quantity of the whole body."""
        rows, d = self.table.owned_rows, self.dimension
        if name.startswith("maximum_"):
            field = name.removeprefix("maximum_")
            values = rows(field) if field in self.table else np.zeros(0)
            return "maximum", np.array([values.max(initial=0.0)])
        if name == "plastic_work":
            return "sum", np.array([self.plastic_work])
        if name == "heat":
            return "sum", np.array([self.points.heat()])
        lower, upper = self.points.bounds_of_domains()
        return ("minimum", lower[:d]) if name == "lower_bounds" else ("maximum", upper[:d])

    def unsound(self) -> tuple[int, str] | None:
        """The rank's first particle that is inside out, compressed beyond its equation of state, lost, or not a number."""
        rows = self.table.owned_rows
        jacobian = self.points.jacobian(0, self.owned)
        finite = (
            np.isfinite(rows("velocity")).all(axis=1)
            & np.isfinite(rows("position")).all(axis=1)
            & np.isfinite(jacobian)
        )
        finite &= np.isfinite(self.points.owned_rows("stress_and_volume")).all(axis=1)
        listed = np.zeros(self.owned, bool)
        listed[self.grid.cells.order[: self.grid.cells.start[-1]]] = True
        for bad, what in (
            (~finite, "a number is no longer finite"),
            (~(jacobian > 0.0), "the Jacobian is not positive: matter is turned inside out"),
            (~listed, "it has left the grid"),
        ):
            if bad.any():
                return int(np.argmax(bad)), what
        return None

    def advice(self) -> str:
        """What most likely helps."""
        smaller = f"a smaller method.cfl (it is {self.settings.cfl:g})"
        return f"{smaller}, order = 'usl' or transfer = 'apic', more particles a cell, or a milder load"

    def numbers(self) -> dict[str, int]:
        """Cells, nodes and shared nodes of this rank."""
        cells = self.grid.cells
        return {
            "grid cells": int(cells.occupied.sum()),
            "grid nodes": len(cells.nodes),
            "shared nodes": self.grid.sharing.shared_nodes,
        }

    def arrays(self) -> list[np.ndarray]:
        """Arrays besides those of the table."""
        return [*self.points.storages(), *self.tables.arrays(), *self.grid.cells.arrays()]

    def bytes_a_step(self) -> int:
        """Bytes of the sums over nodes; particles that are handed over come on top."""
        self.tables.update()
        return self.tables.bytes_sent

    def summary(self) -> dict:
        """Particles that changed their rank, how often cells were dealt out anew, and particles that have melted if any can."""
        result = {"migrated_particles": self.comm.allreduce(self.grid.migrated), "rebalanced": self.rebalanced}
        if can_melt(self.points):
            ratios = homologous_temperatures(self.points)
            result["melted_particles"] = self.comm.allreduce(int((ratios >= 1.0).sum()))
            result["largest_temperature_over_melting"] = maximum(self.comm, float(ratios.max(initial=0.0)))
        return result

    @staticmethod
    def small_scene(tables: dict) -> dict:
        """A few cells, with the particles in their middles and nothing that a plane could cut."""
        method = {key: value for key, value in tables["method"].items() if value is not None}
        tables["method"] = method | {"cell": 1.0, "origin": [0.0] * tables["dimension"]}
        tables["bodies"] = [body | {"placement": "cells"} for body in tables["bodies"]]
        return tables


def _work(external: np.ndarray, before: np.ndarray, after: np.ndarray, step: float) -> float:
    """Work [J] of forces (n, 4) on particles: the nodal velocity in the middle of the step is the mean of the old and the new."""
    moved = after[:, :3] - before[:, :3] - 0.5 * step * (after[:, 4:7] - before[:, 4:7])
    return float((external[:, :3] * moved).sum())


def _refuse_branches(laws: list) -> None:
    for law in laws:
        if getattr(law, "branch_moduli", None):
            raise SolverError("bodies.material.branches: expected none with the material point method, found some")
