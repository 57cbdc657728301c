"""What output and reports ask of peridynamics."""

from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.collective import maximum, minimum
from parsolid.materials.viscoelastic.prony import Prony
from parsolid.methods import failed_matter
from parsolid.methods.leapfrog import kinetic_energy
from parsolid.methods.peridynamics.bonds import Bonds
from parsolid.methods.peridynamics.fracture import Fracture
from parsolid.methods.peridynamics.solids import is_small_strain
from parsolid.methods.peridynamics.tangent import instantaneous_wave_modulus
from parsolid.methods.plastic_fields import FLOW_FIELDS
from parsolid.methods.plastic_particles import METRIC_FIELD, measure_flow, shown_flow, take_heat
from parsolid.methods.protocol import BrokenPairs, ParticleSystem
from parsolid.scene.codes import Note, Warned

# small strain takes a turn for a strain of half its square: 1 %; that of a few particles, of crumbs say, is no matter
_TURN, _TURNED = 0.14, 0.05


class Reports(ParticleSystem):
    """Answers of `system.Peridynamics`, which derives from it and has these parts."""

    conditions: Any
    laws_of_bodies: list[Any]
    laws: list[Any]
    pairs: Bonds
    forces: Any
    fracture: Fracture | None
    solver: Any
    _warnings: list[Warned]
    # tensors of the output, and the evaluation of the forces that they are of
    _shown: tuple[int, dict[str, np.ndarray]] = (-1, {})

    @property
    def directed_pairs(self) -> int:  # type: ignore[override]
        return self.pairs.directed_pairs

    def numbers(self) -> dict[str, int]:
        return {"ghosts": self.particles.ghosts, "interactions": self.pairs.directed_pairs}

    def arrays(self) -> list[np.ndarray]:
        return self.pairs.arrays() + ([] if self.fracture is None else self.fracture.damage.arrays())

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """Of the instantaneous solid."""
        law = self.laws_of_bodies[body]
        return instantaneous_wave_modulus(law), law.density

    def broken_pairs(self) -> BrokenPairs | None:
        """Bonds of pre-cracks and failed ones."""
        return None if self.fracture is None else self.fracture.damage.broken_pairs()

    def energies(self) -> tuple[float, float]:
        storage = self.particles.storage
        kinetic = kinetic_energy(self.owned, storage("velocity"), storage("mass"), storage("share"))
        return kinetic, self.forces.stored_energy()

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Deformation gradient and Cauchy stress (n, 3, 3); damage (n,); `FLOW_FIELDS`."""
        if name == "damage":
            known = "damage" in self.particles
            return self.particles.owned_rows("damage")[first:last] if known else np.zeros(last - first)
        if name in FLOW_FIELDS:
            return shown_flow(self.particles, name, first, last, self._tensors("deformation_gradient")[first:last])
        if name not in ("deformation_gradient", "stress"):
            return None
        return self._tensors(name)[first:last]

    def _tensors(self, name: str) -> np.ndarray:
        """Deformation gradients or Cauchy stresses (owned, 3, 3), kept until the next evaluation of forces."""
        if self._shown[0] != self.forces.evaluations:
            self._shown = self.forces.evaluations, {}
        known = self._shown[1]
        if name not in known and name == "stress":
            known[name] = self.forces.cauchy_stresses(self._tensors("deformation_gradient"))
        elif name not in known:
            gradients = self.forces.displacement_gradients()
            d = gradients.shape[1]
            F = known[name] = np.tile(np.eye(3), (self.owned, 1, 1))
            F[:, :d, :d] += gradients
        return known[name]

    @property
    def takes_heat(self) -> bool:  # type: ignore[override]
        return METRIC_FIELD in self.particles

    def take_heat(self, heat: np.ndarray, rows: np.ndarray) -> float:
        return take_heat(self.particles, self.forces.plastic.blocks, heat, rows)

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """Broken bonds, the place of the crack's tip, and what flow and failure have done; collective."""
        if name == "broken_bonds":
            return "sum", np.array(0.0 if self.fracture is None else self.fracture.broken_bonds())
        if name != "crack_tip":
            return measure_flow(self.particles, self.particles.owned_rows("mass") * self.share, name)
        # the same on all ranks
        return "maximum", np.full(self.dimension, np.nan) if self.fracture is None else self.fracture.tip()

    def first_invalid(self) -> tuple[int, str] | None:
        """The first particle that is inside out or whose velocity is not finite, or the one farthest from balance."""
        plastic = self.forces.plastic
        if plastic is not None and not (room := plastic.room()).min(initial=np.inf) > 0.0:
            index = int(np.argmin(room))
            ratio = self.particles.owned_rows("jacobian")[index]
            return index, f"it is compressed beyond its equation of state (to {ratio:.4g} of its volume)"
        if not self.forces.sound:
            jacobian = np.linalg.det(self._tensors("deformation_gradient"))
            index = int(np.argmin(np.where(np.isfinite(jacobian), jacobian, -np.inf)))
            if not np.isfinite(jacobian[index]):
                return index, "a number is no longer finite"
            return index, f"the Jacobian is {jacobian[index]:.4g}, not positive: matter is turned inside out"
        return self.solver.first_invalid()

    def warnings(self) -> list[Warned]:
        """Pressures in regions that are too thin for them."""
        return self._warnings

    def validity_warning(self) -> str | None:
        """Whether more than a little of what has small strain has turned so far that half of the square of the angle,
        by which it grows, counts as a strain, or is half of the stretch at which bonds break; collective."""
        G = self._tensors("deformation_gradient")
        angle = np.linalg.norm(G - G.swapaxes(1, 2), axis=(1, 2)) / np.sqrt(8.0)
        small = np.zeros(self.owned, bool)
        for first, last, law in self.laws:
            small[first:last] = is_small_strain(law)
        volume = self.particles.owned_rows("volume") * self.share
        allowed = np.full(self.owned, _TURN)
        if (
            self.fracture is not None
            and self.settings.damage is not None
            and self.settings.damage.criterion == "stretch"
        ):
            # negative where particles have failed
            limit = self.fracture.damage.limit[: self.owned]
            allowed[limit > 0.0] = np.minimum(_TURN, limit[limit > 0.0] ** 0.5)
        turned, whole = sums(self.comm, [volume[small & (angle > allowed)].sum(), volume.sum()])
        if not turned > _TURNED * whole:
            return None
        most = maximum(self.comm, float(angle[small].max(initial=0.0)))
        least = minimum(self.comm, float(allowed[small].min(initial=_TURN)))
        return (
            f"{turned / whole:.2g} of the volume has turned by more than {least:.2g} rad, {most:.2g} rad at most: small"
            ' strain takes that for a strain of half its square (material.strain = "finite", or a hyperelastic law)'
        )

    def advice(self) -> str:
        if self.solver.unheld:
            return "a support of the piece, or loads on it that balance"
        hints = []
        if self.settings.stabilisation.kind == "none":
            hints.append('method.stabilisation.kind = "shear-scaled"')
        if any(isinstance(law, Prony) and law.finite_strain is not None for _, _, law in self.laws):
            hints.append("a hyperelastic law (St. Venant and Kirchhoff's gives way when compressed to 0.58)")
        return ", or ".join([*hints, f"a smaller method.solution.{self.solver.setting}", "a milder load"])

    def cost_notes(self) -> list[Note]:
        """Iterations of quasi-static solutions where they are many."""
        return self.solver.cost_notes()

    def summary(self) -> dict[str, Any]:
        """Iterations of quasi-static solutions, and what has failed."""
        failed = {}
        if "criterion_damage" in self.particles:
            mass = self.particles.owned_rows("mass") * self.share
            failed = failed_matter.summary(self.comm, self.particles, mass)
        return self.solver.summary() | failed

    def exchanged_records(self) -> dict[str, int]:
        """The rows of the divergence sweep."""
        return {"bond stress": self.particles.fields["bond_stress"].components}

    def bytes_a_step(self) -> int:
        return self.forces.bytes_sent()

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        return symmetry_planes(self.conditions.planes)
