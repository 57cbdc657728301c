"""Fields, quantities, warnings and messages of updated-Lagrangian SPH."""

from typing import Any

import numpy as np

from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.collective import anywhere, maximum, minimum
from parsolid.materials.blocks import MaterialBlock, blocks_between
from parsolid.methods import failed_matter
from parsolid.methods.hyperelastic_particles import full_gradients
from parsolid.methods.leapfrog import kinetic_energy
from parsolid.methods.plastic_fields import FLOW_FIELDS, shown_flow
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.generated import cell_widths
from parsolid.scene.codes import Warned


class Reports(ParticleSystem):
    """Base class of `system.UpdatedLagrangianSPH`, which has these members."""

    conditions: Any
    laws: list[Any]
    solids: list[Any]
    pairs: Any
    neighbours: Any
    whole_mass: float

    @property
    def owned(self) -> int:  # type: ignore[override]
        return self.particles.owned

    @property
    def blocks(self) -> list[MaterialBlock]:
        return blocks_between(self.particles.bounds, self.laws)

    def parts(self) -> list[tuple[Any, slice]]:
        """Every law of this rank's particles, and their rows."""
        bounds = self.particles.bounds.tolist()
        ranges = zip(self.solids, bounds, bounds[1:])
        return [(solid, slice(first, last)) for solid, first, last in ranges if last > first]

    @property
    def placements(self) -> int:  # type: ignore[override]
        """Particles change their rows when lists are made."""
        return self.pairs.builds

    def warnings(self) -> list[Warned]:
        """Driven layers at a surface that are thinner than the support: matter beside them flows unevenly."""
        rows, motion, found = self.particles.owned_rows, self.conditions.motion, []
        place, spacing, body = rows("reference_position"), rows("spacing"), rows("body")
        for key, one in self.conditions.all:
            if not motion.prescribes(one):
                continue
            driven = np.isin(np.arange(len(place)), motion.held_by(one)[0])
            for number in range(len(self.bodies)):
                here = body == number
                step = maximum(self.comm, spacing[here].max(axis=0, initial=0.0))
                lower, first = (minimum(self.comm, place[k].min(axis=0, initial=np.inf)) for k in (here & driven, here))
                upper, last = (maximum(self.comm, place[k].max(axis=0, initial=-np.inf)) for k in (here & driven, here))
                if not lower[0] <= upper[0]:
                    continue
                at_end = np.minimum(lower - first, last - upper) < 0.5 * step
                counts, needed = np.rint((upper - lower) / step) + 1.0, np.ceil(self.settings.reach(step) / step)
                thin = at_end & (counts < np.minimum(needed, np.rint((last - first) / step) + 1.0))
                if thin.any():
                    axis = int(np.argmax(thin))
                    text = f"{key}: {counts[axis]:.0f} driven layers of particles across {'XYZ'[axis]} at a surface"
                    text += f", where the kernel reaches {needed[axis]:.0f}: strain beside them is uneven"
                    found.append(Warned("thin-driven-layer", text))
        return found

    def validity_warning(self) -> str | None:
        """A message where neighbours have come apart by stretching alone."""
        if not anywhere(self.comm, self.neighbours.torn):
            return None
        return (
            "neighbours that have neither flowed nor failed are nearly as far apart as the kernel reaches, so that "
            f"matter tears; method.smoothing larger than {self.settings.smoothing:g} bears larger stretches"
        )

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Cauchy stress (n, 3, 3) [Pa], Jacobian rho_0/rho (n,), internal energy per reference volume (n,) [J/m^3] of
        particles first..last-1; None for other names."""
        rows = self.particles.owned_rows
        if name == "jacobian":
            density = np.array([law.density for law in self.laws])[self.particles.law_of_body]
            return np.asarray(density[rows("body")[first:last]] / rows("density")[first:last])
        if name == "deformation_gradient" and name in self.particles:
            return full_gradients(self.particles, self.dimension, first, last)
        if name == "internal_energy":
            return np.asarray(rows("energy")[first:last])
        if name in FLOW_FIELDS:
            # back stresses turn with the deviator
            return shown_flow(self.particles, name, first, last, lambda back: back)
        if name != "stress":
            return None
        result = np.zeros((last - first, 3, 3))
        components = rows("deviator")[first:last].T
        places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        for (i, j), values in zip(places, components):
            result[:, i, j] = result[:, j, i] = values
        for solid, here in self.parts():
            a, b = max(first, here.start), min(last, here.stop)
            if a < b:
                pressure = solid.pressures(self.particles, slice(a, b))
                result[a - first : b - first, (0, 1, 2), (0, 1, 2)] -= pressure[:, None]
        return result

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """ "sum", "minimum" or "maximum", and this rank's part, of one of the settings' quantities."""
        rows, mass = self.particles.owned_rows, self.mass
        failed = failed_matter.measure(self.particles, mass, name)
        if failed is not None:
            return failed
        if name == "maximum_von_mises_stress":
            squares = rows("deviator") ** 2
            shears = squares[:, 3:].sum(axis=1)
            return "maximum", np.array([np.sqrt(1.5 * (squares.sum(axis=1) + shears).max(initial=0.0))])
        if name.startswith("maximum_"):
            return "maximum", np.array([rows(name.removeprefix("maximum_")).max(initial=0.0)])
        if name == "mean_plastic_strain":
            return "sum", np.array([float(mass @ rows("plastic_strain")) / self.whole_mass])
        if name == "micro_kinetic":
            return "sum", np.array([sum(solid.energies(self.particles, here)[0] for solid, here in self.parts())])
        if name == "heat":
            parts = [(one.law, here) for one, here in self.parts() if hasattr(one.law, "specific_heat")]
            return "sum", np.array([sum(float(law.heat(rows("temperature")[p]) @ mass[p]) for law, p in parts)])
        half = 0.5 * cell_widths(self.particles)
        if name == "lower_bounds":
            return "minimum", (rows("position") - half).min(axis=0, initial=np.inf)
        return "maximum", (rows("position") + half).max(axis=0, initial=-np.inf)

    def first_invalid(self) -> tuple[int, str] | None:
        rows = self.particles.owned_rows
        density, finite = rows("density"), np.isfinite(rows("velocity")).all(axis=1)
        for name in ("deviator", "temperature", "plastic_strain"):
            values = rows(name)
            finite &= np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
        bad = ~finite | ~(density > 0.0)
        if not bad.any():
            return self._beyond_its_law()
        index = int(np.argmax(bad))
        if not finite[index]:
            return index, "a number is no longer finite"
        return index, f"the density is {density[index]:.4g} kg/m^3, not positive"

    def _beyond_its_law(self) -> tuple[int, str] | None:
        """The first particle beyond what its law describes, and what is wrong with it."""
        for solid, here in self.parts():
            room = solid.room(self.particles, here)
            if room is not None and not (room > 0.0).all():
                index = here.start + int(np.argmin(room))
                ratio = solid.law.density / self.particles.owned_rows("density")[index]
                return index, f"it is compressed beyond its equation of state (to {ratio:.4g} of its volume)"
        return None

    def advice(self) -> str:
        settings = self.settings
        hints = [f"a smaller method.cfl (it is {settings.cfl:g}; 0.3 is stable)"] if settings.cfl > 0.3 else []
        if not settings.viscosity:
            hints.append("method.viscosity (there is none)")
        return ", or ".join([*hints, "more particles", "a milder load"])

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """By the speed of sound."""
        solid = self.solids[self.particles.law_of_body[body]]
        return solid.law.density * solid.sound_speed**2, solid.law.density

    @property
    def directed_pairs(self) -> int:  # type: ignore[override]
        return self.pairs.directed_pairs

    def energies(self) -> tuple[float, float]:
        """Kinetic energy, that of the micro-velocity in it, and stored energy [J] of this rank's particles."""
        kinetic = float(kinetic_energy(self.owned, self.particles.storage("velocity"), self.mass, None))
        stored = 0.0
        for solid, here in self.parts():
            micro, elastic = solid.energies(self.particles, here)
            kinetic, stored = kinetic + micro, stored + elastic
        return kinetic, stored

    def numbers(self) -> dict[str, int]:
        return {"ghosts": self.particles.ghosts, "interactions": self.pairs.directed_pairs}

    def arrays(self) -> list[np.ndarray]:
        return self.pairs.arrays() + self.neighbours.arrays()

    def bytes_a_step(self) -> int:
        """Bytes of the two messages of a step, without particles that change their rank."""
        return self.particles.bytes_sent("motion") + self.particles.bytes_sent("record")

    def summary(self) -> dict[str, Any]:
        """How often lists were made, how often too late, and how many particles changed their rank."""
        return failed_matter.summary(self.comm, self.particles, self.mass) | self.pairs.summary()

    @staticmethod
    def small_scene(tables: dict[str, Any]) -> dict[str, Any]:
        """Particles in the middles of cells."""
        tables["bodies"] = [body | {"placement": "cells"} for body in tables["bodies"]]
        return tables

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        return symmetry_planes(self.conditions.planes)
