"""Material point method: particles carry the state, a background grid the momentum of each step.

A step: particles give mass, momentum and force to the nodes (summed over ranks); nodes move and obey the boundaries;
particles take velocity, place and velocity gradient; stress; particles are listed by cell anew and handed to other
ranks. No ghost particles, no collective but the loop's.
"""

from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.cell_partition import CellPartition
from decomposition.grid import RankGrid
from parsolid.boundary.loads import accelerations
from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.boundary.surface_loads import SurfaceLoads
from parsolid.collective import maximum, minimum
from parsolid.materials.hyperelastic.law import elastic_moduli
from parsolid.materials.plastic import plastic_evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.methods import failed_matter
from parsolid.methods.mpm.conduction import Conduction, common_conductivity, conducts
from parsolid.methods.mpm.grid import kinetic_energy
from parsolid.methods.mpm.grid_conditions import GridConditions
from parsolid.methods.mpm.initial_state import set_initial_motion
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.nodes import Nodes
from parsolid.methods.mpm.observation import can_melt, first_unsound, homologous_temperatures, shown
from parsolid.methods.mpm.placing import refuse_bad_places
from parsolid.methods.mpm.reference_grid import ReferenceGrid
from parsolid.methods.mpm.residence import Residence
from parsolid.methods.mpm.step_energies import StepEnergies
from parsolid.methods.mpm.stress_update import StressUpdate
from parsolid.methods.mpm.transfers import ORDERS
from parsolid.methods.mpm.waiting import WaitingImpulses
from parsolid.methods.mpm.weights import nodes_across
from parsolid.methods.previous_state import take_forces, take_state
from parsolid.methods.protocol import Announce, EnergyLedger, ParticleSystem
from parsolid.numerics.lanes import aligned_zeros
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene

# a step [s] that bounds nothing
_ANY_STEP = 1e300


class MaterialPoint(ParticleSystem):
    """The method on one rank: its particles are `points`, its cells and shared nodes `grid`, the arrays of nodes
    `nodes`.
    """

    def __init__(self, comm: MPI.Comm, scene: Scene, particle_set: ParticleSet):
        """particle_set: this rank's particles, sorted by law. Raises SolverError on all ranks when planes do not suit
        the grid. Collective.
        """
        self.comm, self.settings, self.dimension = comm, scene.method, scene.dimension
        refuse_bad_places(comm, scene, particle_set)
        self.points = self.particles = points = MaterialPoints(scene, particle_set)
        self.materials = StressUpdate(scene, points)
        self.conditions = GridConditions(comm, scene, particle_set.position, points.origin)
        conducting = conducts(scene, points.laws)
        thermal = self.conditions.thermal_planes(common_conductivity(points.laws)) if conducting else []
        folded = [plane.mirror for plane in self.conditions.planes] + [plane.mirror for plane in thermal]
        mirrors = tuple(dict.fromkeys(folded))
        self.grid = RankGrid(comm, self.dimension, nodes_across(points.basis), mirrors, scene.method.bitwise)
        self.nodes = Nodes(self.grid, points, self.conditions.planes, conducting)
        self.surface_loads = self.nodes.surface_loads = SurfaceLoads(
            self.conditions.declared, comm, points, particle_set
        )
        self.landings = self.surface_loads.landings
        self.told = self.nodes.told = [*self.conditions.told, *self.surface_loads.told]
        self.stress: StressUpdate | ReferenceGrid = self.materials
        if scene.method.formulation == "total-lagrangian":
            self.stress = ReferenceGrid(self.materials, self.nodes)
        self.loads = accelerations(scene, points)
        self.conduction: Conduction | None = None
        if conducting:
            self.conduction = Conduction(self.conditions, points, self.nodes, thermal)
        self.transfer = ORDERS[scene.method.order](points, self.nodes, self.conditions)
        self.residence = Residence(self.grid, points)
        # of a step for which something has asked before it
        self.given: StepEnergies | None = None
        self.waiting: WaitingImpulses | None = None
        self.partition: CellPartition | None = None

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """Set the state at time 0, deal particles out to the owners of their cells, and find the first stress;
        collective.
        """
        set_initial_motion(scene, particle_set, self.points)
        self.materials.begin(scene, particle_set)
        if taken := take_state(self.comm, scene, self, particle_set):
            self.points.without_deleted()
        self.residence.deal_out()
        self.nodes.follow_cells()
        self.stress.advance(0.0)
        take_forces(self.comm, scene, self)
        if taken and self.waiting is not None:
            self.waiting.go_on(min(minimum(self.comm, self.stable_step()), self.settings.maximum_step or np.inf))
        self._look_at_heat()

    def resume(self) -> None:
        """Continue with the checkpoint's owners of cells; on other ranks with new ones; collective."""
        self.points.without_deleted()
        self.residence.deal_out(self.partition)
        self.stress.resume()
        self._look_at_heat()

    def _look_at_heat(self) -> None:
        """What conduction allows for the first step, and how much heat there is; collective."""
        if self.conduction is not None:
            self.conduction.refresh()
            self.energy_scale = self.comm.allreduce(self.points.heat())

    def state(self) -> dict[str, Any]:
        """Owners of cells, the step counter that times re-ordering, the largest speed; collective."""
        return {
            "waiting": None if self.waiting is None else self.waiting.state(self.comm),
            "partition": self.grid.partition.state(),
            "steps": self.residence.steps,
            "fastest": maximum(self.comm, self.materials.fastest),
            "plastic_work": self.comm.allgather(self.materials.plastic_work),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave; owners of cells only for as many ranks."""
        self.residence.steps, self.materials.fastest = state["steps"], state["fastest"]
        partition = CellPartition.from_state(state["partition"], self.dimension)
        work = state["plastic_work"]
        if self.waiting is not None:
            self.waiting.set_state(self.comm, state.get("waiting"))
        if partition.ranks == self.comm.size:
            self.partition, self.materials.plastic_work = partition, work[self.comm.rank]
        else:
            self.materials.plastic_work = sum(work) if self.comm.rank == 0 else 0.0

    # --- a step -------------------------------------------------------------------------------------------------

    def advance_positions(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """All of a step: external forces of its end act in the next one."""

        def note(sound: bool, stable: float) -> None:
            self.noted = sound, stable

        self.sound = self._advance(time, step, ledger, note)

    def complete_step(self, time: float, step: float, ledger: EnergyLedger, announce: Announce) -> bool:
        """See `ParticleSystem`."""
        announce(*self.noted)
        return self.sound

    def _advance(self, time: float, step: float, ledger: EnergyLedger, announce: Announce) -> bool:
        """One step from `time` [s]."""
        self.nodes.follow_cells()
        if self.conduction is not None:
            ledger.add_term("heat_supplied", self.conduction.advance(time, step))
        if not self.settings.motion:
            announce(True, self.stable_step())
            return True
        energies = self.given or self.give_to_nodes(time, step)
        work, caught = self.conditions.obey(self.nodes, self.nodes.motion, time + step)
        caught += self.transfer.nodes_to_particles(time + step, step)
        sound, terms = self.stress.advance(step)
        energies.book(ledger, step, (work, caught), terms)
        self.given = None
        announce(sound, self.stable_step())
        return self.residence.settle() and sound

    def give_to_nodes(self, time: float, step: float) -> StepEnergies:
        """New velocities of the nodes, before boundaries, of a step [s] from a time [s]."""
        forces, kicked, waiting = self._forces(time), step, self.waiting
        energies = StepEnergies(self.points, self.nodes, forces, waiting)
        if waiting is not None:
            forces, kicked = waiting.take(forces, step, (self.substep, self.substeps)), waiting.kicked(step)
        self.transfer.particles_to_nodes(self.stress.on_nodes, forces)
        self.nodes.accelerate(kicked)
        return energies

    def _forces(self, time: float) -> np.ndarray | None:
        """Forces (capacity, 4) [N] of the loads on particles."""
        if not self.loads.acting and not self.surface_loads.acting:
            return None
        result = aligned_zeros((self.points.capacity, 4))
        if self.loads.acting:
            result[: self.owned] = self.points.motion[: self.owned, 3:4] * self.loads.at(time)
        self.surface_loads.add_to(result, time)
        return result

    @property
    def takes_heat(self) -> bool:  # type: ignore[override]
        """Elastic-plastic laws have a temperature."""
        return "temperature" in self.points

    def take_heat(self, heat: np.ndarray, rows: np.ndarray) -> float:
        """See `ParticleSystem.take_heat`; no particle lies on a mirror plane."""
        return self.points.take_heat(heat, rows)

    @property
    def placements(self) -> int | None:  # type: ignore[override]
        """On one rank particles change their rows when storage is sorted; on several when ranks look at that together,
        or, where they need not stay in between, in any step."""
        if self.comm.size == 1:
            return self.points.layout
        return self.residence.placements if self.residence.kept else None

    def take_external_forces(self, keep_rows: bool) -> None:
        """See `waiting.WaitingImpulses` and `Residence.keep`."""
        super().take_external_forces(keep_rows)
        if keep_rows:
            self.residence.keep()
        if self.waiting is None:
            self.waiting = self.transfer.waiting = WaitingImpulses(self.points)
            self.materials.centre()

    def late_impulse(self) -> np.ndarray:
        """Velocities are of the middle of the last step."""
        if self.waiting is None:
            return super().late_impulse()
        rows = self.points.owned_rows
        return np.asarray(rows("external_impulse") + 0.5 * self.waiting.step * rows("external_force"))

    def follow_work(self, work: list[float], number: int) -> None:
        """See `Residence.follow_work`."""
        self.residence.follow_work(work, number)

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        """Rollers."""
        return symmetry_planes([one.plane for one in self.conditions.planes])

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """By the speed of pressure waves in the undeformed solid."""
        law = self.points.laws[self.points.law_of_body[body]]
        if isinstance(law, ElasticPlastic):
            mu = plastic_evaluation.shear_modulus(law, 1.0, 0.0, law.reference_temperature)
            return float(plastic_evaluation.isentropic_bulk_modulus(law, 1.0, 0.0) + 4.0 / 3.0 * mu), law.density
        shear, lame = elastic_moduli(law)
        return float(lame + 2.0 * shear), law.density

    @property
    def owned(self) -> int:  # type: ignore[override]
        """Number of this rank's particles, which changes as they move."""
        return self.points.owned

    @property
    def mass(self) -> np.ndarray:
        """Mass [kg] (capacity,)."""
        return self.points["mass"]

    @property
    def share(self) -> np.ndarray:
        """No particle lies on a mirror plane."""
        return np.ones(len(self.points.motion))

    def stable_step(self) -> float:
        """cfl h / (c + |v|) [s] of this rank's fastest particle, over the root of `mass_terms`, and what conduction
        allows.
        """
        settings, stress, conduction = self.settings, self.stress, self.conduction
        thermal = conduction.stable_step() * stress.stretch**2 if conduction is not None else np.inf
        if not settings.motion:
            return float(thermal)
        # more terms than the lumped one lift frequencies, see `mass_matrix`
        waves = settings.cfl * settings.cell * stress.slowness / settings.mass_terms**0.5
        if self.materials.fastest == 0.0 and "deleted_mass" in self.points:
            # nothing is left on this rank
            waves = _ANY_STEP
        return float(min(waves, thermal, self.surface_loads.largest_step))

    # --- what the loop and the reports ask ------------------------------------------------------------------------

    def energies(self) -> tuple[float, float]:
        """Kinetic energy and internal energy [J] of this rank's particles, heat and plastic work included."""
        kinetic = kinetic_energy(self.owned, self.points.motion)
        if self.waiting is not None:
            kinetic += self.waiting.energy()
        return kinetic, self.materials.stored_energy()

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Fields that are not declared."""
        return shown(self.points, name, first, last)

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """This rank's part of a quantity of the whole body."""
        rows, d = self.particles.owned_rows, self.dimension
        if name.startswith("maximum_"):
            field = name.removeprefix("maximum_")
            values = rows(field) if field in self.particles else np.zeros(0)
            return "maximum", np.array([values.max(initial=0.0)])
        failed = failed_matter.measure(self.particles, self.mass[: self.owned], name)
        if failed is not None:
            return failed
        if name == "plastic_work":
            return "sum", np.array([self.materials.plastic_work])
        if name in ("heat", "entropy"):
            return "sum", np.array([getattr(self.points, name)()])
        lower, upper = self.points.bounds_of_domains()
        return ("minimum", lower[:d]) if name == "lower_bounds" else ("maximum", upper[:d])

    def unsound(self) -> tuple[int, str] | None:
        """The rank's first particle that is inside out, compressed beyond its equation of state, lost, or
        not a number.
        """
        cells = self.grid.cells
        return first_unsound(self.points, cells.order[: cells.start[-1]])

    def advice(self) -> str:
        """What most likely helps."""
        settings, hints = self.settings, [f"a smaller method.cfl (it is {self.settings.cfl:g})"]
        others = [f"{key} = '{word}'" for key, word in (("order", "musl"), ("transfer", "apic"))]
        stated = (settings.order == "musl", settings.transfer == "apic")
        hints += [" or ".join(word for word, has in zip(others, stated) if not has)] if not all(stated) else []
        return ", ".join([*hints, "more particles a cell", "or a milder load"])

    def numbers(self) -> dict[str, int]:
        """Cells, nodes and shared nodes of this rank."""
        cells = self.grid.cells
        return {
            "grid cells": int(cells.occupied.sum()),
            "grid nodes": len(cells.nodes),
            "shared nodes": self.grid.sharing.shared_nodes,
        }

    def arrays(self) -> list[np.ndarray]:
        """Arrays besides those of the particles."""
        return [*self.nodes.arrays(), *self.grid.cells.arrays()]

    def bytes_a_step(self) -> int:
        """Bytes of the sums over nodes; particles that are handed over come on top."""
        self.nodes.follow_cells()
        return self.nodes.bytes_sent

    def summary(self) -> dict[str, Any]:
        """Particles that changed their rank, how often cells were dealt out anew, and particles that have melted if any
        can.
        """
        result: dict[str, Any] = {
            "migrated_particles": self.comm.allreduce(self.grid.migrated),
            "rebalanced": self.residence.rebalanced,
        }
        load = self.residence.load
        result |= load.summary() if load is not None else {}
        result |= failed_matter.summary(self.comm, self.points, self.mass[: self.owned])
        if can_melt(self.points):
            ratios = homologous_temperatures(self.points)
            result["melted_particles"] = self.comm.allreduce(int((ratios >= 1.0).sum()))
            result["largest_temperature_over_melting"] = maximum(self.comm, float(ratios.max(initial=0.0)))
        return result

    @staticmethod
    def small_scene(tables: dict[str, Any]) -> dict[str, Any]:
        """A few cells, with the particles in their middles and nothing that a plane could cut."""
        method = {key: value for key, value in tables["method"].items() if value is not None}
        tables["method"] = method | {"cell": 1.0, "origin": [0.0] * tables["dimension"]}
        tables["bodies"] = [body | {"placement": "cells"} for body in tables["bodies"]]
        return tables
