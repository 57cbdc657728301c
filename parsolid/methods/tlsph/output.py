"""What output, reports and contact ask of total-Lagrangian SPH."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.materials.viscoelastic.maxwell import total_modulus
from parsolid.methods import failed_matter
from parsolid.methods.leapfrog import kinetic_energy
from parsolid.methods.plastic_fields import FLOW_FIELDS
from parsolid.methods.plastic_particles import METRIC_FIELD, measure_flow, shown_flow, take_heat
from parsolid.methods.protocol import ParticleSystem
from parsolid.methods.tlsph.body_weights import ON_LATTICES
from parsolid.methods.tlsph.pressures import nearly_incompressible
from parsolid.methods.tlsph.state import LawBlock, deformation_gradients
from parsolid.scene.codes import Note, Warned
from parsolid.scene.observed import NODAL_STRESS, NODAL_VON_MISES


class Reports(ParticleSystem):
    """Answers of `system.TotalLagrangianSPH`, which derives from it and has these parts."""

    conditions: Any
    laws: list[Any]
    blocks: list[LawBlock]
    plastic_blocks: list[Any]
    sweeps: list[Any]
    meshes: Any
    statics: Any
    implicit: Any
    stages: list[Any]
    reference: Any
    initial_stress: Any
    pressures: Any
    lattice_bodies: list[Any]
    body_weights: list[str]
    evaluations: int

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Deformation gradient, first Piola-Kirchhoff stress (n, 3, 3) and `FLOW_FIELDS`."""
        if name == "deformation_gradient":
            return deformation_gradients(self.particles, first, last)
        if name in FLOW_FIELDS:
            return shown_flow(self.particles, name, first, last, deformation_gradients(self.particles, first, last))
        if name == NODAL_STRESS:
            if self.meshes is None:
                return None
            F = deformation_gradients(self.particles, first, last)
            P: Any = self.shown("first_piola_kirchhoff_stress", first, last)
            result = np.asarray(P @ F.swapaxes(1, 2) / np.linalg.det(F)[:, None, None])
            self.meshes.nodal_stress(first, last, result)
            return result
        if name != "first_piola_kirchhoff_stress":
            return None
        stress = np.zeros((last - first, 3, 3))
        for block in self.blocks:
            low, high = max(first, block.first), min(last, block.last)
            if low < high:
                stress[low - first : high - first] = block.stresses(low, high)
        if self.initial_stress is not None:
            stress += self.initial_stress.first_piola_kirchhoff_stress(first, last)
        if self.pressures is not None:
            stress += self.pressures.stresses(first, last, deformation_gradients(self.particles, first, last))
        return stress

    @property
    def usual_fields(self) -> tuple[str, ...]:
        """See `ParticleSystem`; by these pictures of meshes are coloured."""
        return () if self.meshes is None else (NODAL_VON_MISES,)

    def prepare_fields(self, names: Iterable[str], time: float) -> None:
        """See `ParticleSystem`; for stresses at nodes."""
        if self.meshes is not None and any(name.startswith((NODAL_STRESS, NODAL_VON_MISES)) for name in names):
            self.meshes.prepare_nodal_stress(time)

    def first_invalid(self) -> tuple[int, str] | None:
        """Also a reference that could not be moved."""
        if self.reference is not None and self.reference.fault is not None and self.owned:
            most = int(np.argmin(self.particles.owned_rows("jacobian")))
            return most, f"the reference could not be moved: {self.reference.fault}"
        solved = {"static": self.statics, "implicit": self.implicit}.get(self.settings.integrator)
        unbalanced = None if solved is None else solved.first_invalid()
        return unbalanced or super().first_invalid() or self._beyond_its_law()

    def _beyond_its_law(self) -> tuple[int, str] | None:
        """The first particle that is compressed beyond its equation of state."""
        for block in self.plastic_blocks:
            room = block.room()
            if not (room > 0.0).all():
                index = block.first + int(np.argmin(room))
                ratio = self.particles.owned_rows("jacobian")[index]
                return index, f"it is compressed beyond its equation of state (to {ratio:.4g} of its volume)"
        return None

    @property
    def takes_heat(self) -> bool:  # type: ignore[override]
        return METRIC_FIELD in self.particles

    def take_heat(self, heat: np.ndarray, rows: np.ndarray) -> float:
        return take_heat(self.particles, self.plastic_blocks, heat, rows)

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """See `ParticleSystem`: of plastic flow, of failure and of meshes."""
        if name == "element_variation":
            return "sum", np.array([0.0 if self.meshes is None else self.meshes.element_variation()])
        return measure_flow(self.particles, self.mass * self.share, name)

    def advice(self) -> str:
        settings, hints = self.settings, list[str]()
        if settings.integrator == "static":
            return "a smaller load, more supports, or displacements that are prescribed in place of forces"
        if settings.reference == "updated":
            # it fails where a fixed one goes on, in shear beside free corners
            return 'method.reference = "fixed"'
        if settings.integrator == "leapfrog" and settings.safety > 1.0:
            hints.append(f"a smaller method.safety (it is {settings.safety:g}; 0.9 is stable)")
        if settings.integrator == "ssp-rk3" and settings.cfl > 0.9:
            hints.append(f"a smaller method.cfl (it is {settings.cfl:g}; 0.7 is stable for smoothing of 0.85 and more)")
        smaller = bool(hints)
        if settings.dissipation == 0.0:
            hints.append("method.dissipation = 1 (there is none)")
        hints.append("more particles" if smaller else "more particles where the body is crushed")
        return ", or ".join([*hints, "a milder load"])

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """With all branches."""
        law = self.laws[body]
        shear, lame = elastic_moduli(law)
        return lame + 2.0 * (shear + total_modulus(law.branch_moduli)), law.density

    def least_mass(self, body: int) -> float:
        """Corrected masses are less than the lumped ones near the surface, and so are those of fourth order."""
        found = [one.least_mass for one in self.lattice_bodies if one.body == body]
        return min(found) if found else 1.0 if self.meshes is None else self.meshes.least_masses.get(body, 1.0)

    @property
    def directed_pairs(self) -> int:  # type: ignore[override]
        return sum(bodies.directed_pairs for bodies in self.sweeps)

    def energies(self) -> tuple[float, float]:
        kinetic = kinetic_energy(self.owned, self.particles.storage("velocity"), self.mass, self.share)
        stored = 0.0 if self.initial_stress is None else self.initial_stress.energy()
        stored += 0.0 if self.pressures is None else self.pressures.energy()
        stored += 0.0 if self.meshes is None else self.meshes.stabiliser_energy()
        stored += 0.0 if self.statics is None else self.statics.stabiliser_energy()
        return float(kinetic), stored + sum(block.energy() for block in self.blocks)

    @property
    def farthest(self) -> float:  # type: ignore[override]
        """Distance of the farthest ghost of nodes of lattices [m]: boxes have two planes of them."""
        reaches = [(2 if one.box else one.reach) * max(axis.step for axis in one.axes) for one in self.lattice_bodies]
        return max(reaches, default=0.0)

    def numbers(self) -> dict[str, int]:
        found = {"ghosts": sum(bodies.ghosts for bodies in self.sweeps), "interactions": self.directed_pairs}
        return found if self.statics is None else found | {"unknowns": int(self.statics.free.sum())}

    def arrays(self) -> list[np.ndarray]:
        return [array for bodies in self.sweeps for array in bodies.arrays()]

    def bytes_a_step(self) -> int:
        """Motion, stresses and impedances, in every evaluation."""
        return self.evaluations * sum(bodies.bytes_a_step() for bodies in self.sweeps)

    def summary(self) -> dict[str, Any]:
        """How often the reference was moved, which weights each body has where a scene leaves the choice, and what has
        failed."""
        moved = {} if self.reference is None else {"reference_updates": self.reference.updates}
        moved |= failed_matter.summary(self.comm, self.particles, self.mass * self.share)
        moved |= self.statics.summary() if self._has_equilibria else {}
        moved |= {} if self.implicit is None else self.implicit.summary()
        chosen = self.settings.weights in ("best", "mesh")
        return {**moved, "pair_weights": list(self.body_weights)} if chosen else moved

    @property
    def _has_equilibria(self) -> bool:
        return any(one.integrator == "static" for one in self.stages)

    def progress(self) -> list[str]:
        """Iterations and residual of equilibria."""
        return self.statics.progress() if self.settings.integrator == "static" else []

    def warnings(self) -> list[Warned]:
        """Nearly incompressible bodies that are too stiff, as no pressures are unknowns: meshes in motion, and boxes in
        equilibrium and long steps."""
        found, kinds = dict[str, str](), {one.integrator for one in self.stages}
        if "leapfrog" in kinds:
            told = "coarse meshes are too stiff in motion, by tens of percent with 10 elements across where they bend"
            found["mesh"] = told
        if kinds & {"static", "implicit"}:
            told = "boxes are too stiff in equilibria and long steps, by 12 % with 8 spacings across and nu .4999"
            found |= dict.fromkeys(ON_LATTICES, f"{told}, and take a thousand products: take a body from a mesh")
        result = []
        for number, law, kind in zip(self.bodies, self.laws, self.body_weights):
            if kind in found and nearly_incompressible(law):
                shear, lame = elastic_moduli(law)
                ratio = f"Poisson's ratio {0.5 * lame / (lame + shear):.6g}"
                result.append(Warned("too-stiff", f"bodies.{number}: {ratio}: {found[kind]}"))
        return result

    def cost_notes(self) -> list[Note]:
        """Elements of second order, of which the corners are taken; what load steps take."""
        found = {} if self.meshes is None else self.meshes.of_second_order
        code, words = "second-order-elements", "are taken by their corners"
        cost = self.statics.cost_notes() if self._has_equilibria else []
        return cost + [
            Note(code, f"bodies.{self.bodies[i]}: elements of second order ({', '.join(kinds)}) {words}")
            for i, kinds in found.items()
        ]

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        return symmetry_planes([*self.conditions.planes, *self.conditions.ends])
