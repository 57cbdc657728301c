"""Boundaries and loads of a scene as updated-Lagrangian SPH takes them."""

from typing import Any

import numpy as np

from parsolid.boundary.declarations import (
    Declarations,
    HeldMicroVelocity,
    HeldRegion,
    PrescribedMotion,
    RegionTraction,
    RigidWall,
    Support,
    SurfaceSpring,
    SurfaceTraction,
    TemperaturePlane,
)
from parsolid.boundary.loads import accelerations
from parsolid.boundary.prescribed import NotFree, PrescribedRows
from parsolid.boundary.reactions import holders, sliding
from parsolid.boundary.rows import keep
from parsolid.boundary.slides import Slide, slides_of
from parsolid.boundary.supports import Supports
from parsolid.boundary.surface_loads import SurfaceLoads
from parsolid.collective import anywhere
from parsolid.methods.protocol import EnergyLedger
from parsolid.methods.ulsph.kinematics import kick, second_vector
from parsolid.methods.ulsph.walls import Walls
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.selection import Selection
from parsolid.scene import Scene
from parsolid.scene.formulas import FormulaVector
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.regions import selected


class BoundarySet:
    """Mirror planes' codes, held and prescribed components, temperatures, held micro-velocities, loads.

    held_micro (n,): particles of the particle_set whose micro-velocity is held, None where no rank has any.
    """

    def __init__(self, comm: Any, scene: Scene, particle_set: ParticleSet, particles: Particles):
        """particles: those of the particle_set; collective. Raises SolverError on all ranks."""
        declared = Declarations(
            scene,
            *(Support, HeldRegion, PrescribedMotion, RigidWall, TemperaturePlane, HeldMicroVelocity),
            *(SurfaceTraction, RegionTraction, SurfaceSpring),
        )
        supports = Supports(comm, scene, declared.of(Support, "fixed", "roller"), declared.of(HeldRegion), particle_set)
        self.particles, self.codes, self.planes = particles, supports.codes, supports.planes
        self._clamp = None
        if anywhere(comm, bool(supports.held.any())):
            self._clamp = keep(particles, "clamp", np.where(supports.held, 0.0, 1.0))
        motions = declared.of(PrescribedMotion, "velocity")
        self.prescribed = PrescribedRows(comm, scene, motions, particle_set, particles)
        self.not_free = NotFree(particles, self.prescribed, self._held)
        self.walls = Walls(comm, declared.of(RigidWall), particles)
        self.holders = holders(comm, declared, self.prescribed, particle_set, particles)
        self.surface_loads = SurfaceLoads(declared, comm, particles, particle_set)
        self.slides = slides_of(comm, declared, particle_set, particles, supports.held)
        self.sliding = sliding(self.slides, scene.dimension)
        self.told = [one for one, _ in (*self.holders, *self.sliding)] + self.walls.told + self.surface_loads.told
        self.loads = accelerations(scene, particles)
        self.held_micro: np.ndarray | None = None
        for micro in declared.of(HeldMicroVelocity):
            here = selected(scene, micro.where, particle_set, comm)
            self.held_micro = here if self.held_micro is None else self.held_micro | here
        self._temperatures: list[tuple[Selection, LoadHistory]] = []
        for warm in declared.of(TemperaturePlane):
            chosen = particles.selection(selected(scene, warm.where, particle_set, comm))
            self._temperatures.append((chosen, LoadHistory(FormulaVector((warm.formula,)))))

    def _held(self) -> np.ndarray | None:
        return None if self._clamp is None else self._clamp(slice(None))

    @property
    def sets_temperature(self) -> bool:
        """Whether a temperature is prescribed, the same on all ranks."""
        return bool(self._temperatures)

    def half_kick(self, time: float, step: float, values_at: float) -> tuple[float, float, float]:
        """v after half a step [s] of the forces at a time [s]; prescribed components are those at another.

        Returns the work of loads and of what moves prescribed components, what the viscosity takes, and
        leapfrog's oscillation [J].
        """
        particles = self.particles
        kinematics, mass = particles.storage("kinematics"), particles.storage("mass")
        guided = self.prescribed.guided
        rows, components = self.prescribed.entries
        before = kinematics[rows, components]
        start = particles.owned_rows("velocity").copy() if self.holders or self.sliding else None
        loads = self._accelerations(time)
        clamp = self._held()
        begun = particles.owned_rows("velocity").copy() if self.walls.walls else None
        dimension = particles["position"].shape[1]
        forces = particles.storage("force_sums")
        began = particles.owned_rows("velocity").copy() if self.surface_loads.acting else None
        work, viscous, swing = kick(particles.owned, dimension, 0.5 * step, kinematics, forces, mass, loads, clamp)
        if began is not None:
            self.surface_loads.tell(0.5 * step, 0.25 * step * (began + particles.owned_rows("velocity")))
        if guided:
            free = kinematics[rows, components]
            new = self.prescribed.values("velocity", values_at)
            kinematics[rows, components] = new
            work += float(0.5 * (mass[0, rows] * (new - free)) @ (before + new))
            of_viscosity = forces[rows, second_vector(dimension) + components]
            viscous += float(0.25 * step * of_viscosity @ (new - free))
            swing += float(0.25 * step * (forces[rows, components] - of_viscosity) @ (new - free))
        for slide in self.slides:
            of_loads, of_viscosity, of_forces = self._slide(slide, 0.5 * step, loads)
            work, viscous, swing = work - of_loads, viscous - of_viscosity, swing - of_forces
        if start is not None:
            self._take(start, 0.5 * step, loads)
        if begun is not None:
            loaded, slowed, stilled = self.walls.catch(time, 0.5 * step, begun)
            work, viscous, swing = work + loaded, viscous + slowed, swing + stilled
        return work, -viscous, swing

    def _accelerations(self, time: float) -> np.ndarray | None:
        """Of all loads (owned, 4) [m/s^2] at a time [s]; None without any."""
        loads = self.loads.at(time) if self.loads.acting else None
        if not self.surface_loads.acting:
            return loads
        forces = np.zeros((self.particles.owned, 4))
        self.surface_loads.add_to(forces, time)
        forces /= self.particles.storage("mass")[0, : self.particles.owned, None]
        return forces if loads is None else forces + loads

    def _take(self, start: np.ndarray, step: float, loads: np.ndarray | None) -> None:
        """Count the impulses that hold components through a kick of a step [s] from velocities (n, d)."""
        rows = self.particles.owned_rows
        velocity, mass, d = rows("velocity"), self.particles.storage("mass")[0], start.shape[1]
        acting = self.particles.storage("force_sums")[: len(start), :d]
        if loads is not None:
            acting = acting + mass[: len(start), None] * loads[:, :d]
        impulse = mass[: len(start), None] * (velocity - start) - step * acting
        mean = 0.5 * (velocity + start)
        for told, held in self.holders:
            here, components = held()
            told.add(rows("position")[here], components * impulse[here], mean[here])
        for told, slide in self.sliding:
            here = slide.rows
            told.add(rows("position")[here], slide.held(impulse[here]), mean[here])

    def _slide(self, slide: Slide, step: float, loads: np.ndarray | None) -> tuple[float, float, float]:
        """Take from velocities after a kick of a step [s] what a slide holds, which does no work; what of the work of
        loads, of the viscosity, and of leapfrog's oscillation [J] is not done for that."""
        rows, velocity = slide.rows, self.particles.owned_rows("velocity")
        removed, d, first = slide.held(velocity[rows]), velocity.shape[1], second_vector(velocity.shape[1])
        velocity[rows] -= removed
        removed *= 0.5 * step
        forces = self.particles.storage("force_sums")[rows]
        viscous = float(np.sum(removed * forces[:, first : first + d]))
        work = 0.0
        if loads is not None:
            work = float(np.sum(removed * self.particles.storage("mass")[0, rows, None] * loads[rows, :d]))
        return work, viscous, float(np.sum(removed * forces[:, :d])) - viscous

    def taken(self, step: float, ledger: EnergyLedger) -> tuple[float, float]:
        """Work of walls, and loss to them [J], forgotten; the ledger takes what conditions tell of a step [s]."""
        for told in self.told:
            told.finish(step, ledger)
        return self.walls.taken()

    def hold_motion(self, time: float) -> None:
        """Held and prescribed components of the velocity at a time [s], for a new state."""
        particles = self.particles
        velocity = particles.owned_rows("velocity")
        if self._clamp is not None:
            velocity[:] *= self._clamp(slice(None))
        for one in self.slides:
            velocity[one.rows] -= one.held(velocity[one.rows])
        if self.prescribed.guided:
            particles.storage("kinematics")[self.prescribed.entries] = self.prescribed.values("velocity", time)

    def temperatures(self, time: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """Rows (k,) and their prescribed temperatures (k,) [K] at a time [s]."""
        result = []
        places = self.particles.owned_rows("reference_position")
        for chosen, course in self._temperatures:
            rows = chosen.rows
            result.append((rows, course.evaluate(np.ascontiguousarray(places[rows]), time)[:, 0]))
        return result
