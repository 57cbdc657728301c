"""Fields, quantities, warnings and messages of the material point method."""

from typing import Any

import numpy as np

from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.collective import maximum
from parsolid.materials.plastic.plastic_evaluation import melting_temperature
from parsolid.methods import failed_matter
from parsolid.methods.mpm.cells import CellMigration
from parsolid.methods.mpm.energies import kinetic_energy
from parsolid.methods.mpm.grid import Nodes
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.methods.plastic_fields import FLOW_FIELDS, shown_flow
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene.codes import Warned

# D in cells^2 by a particle's place in its cell, of which no spline but the hat function's depends on it
_SPREADS = {
    "quadratic-spline": lambda place: np.full_like(place, 0.25),
    "cubic-spline": lambda place: np.full_like(place, 1.0 / 3.0),
    "linear": lambda place: place * (1.0 - place),
}


class Reports(ParticleSystem):
    """Base class of `system.MaterialPoint`, which has these members."""

    conditions: Any
    points: MaterialPoints
    nodes: Nodes
    grid: Any
    migration: CellMigration
    external: Any
    solids: dict[Any, Any]
    plastic_work: float

    @property
    def owned(self) -> int:  # type: ignore[override]
        return self.points.owned

    @property
    def mass(self) -> np.ndarray:
        """Mass [kg] (capacity,)."""
        return self.points["mass"]

    @property
    def placements(self) -> int | None:  # type: ignore[override]
        """On one rank particles change their rows when storage is sorted; on several when ranks look at that together,
        or, where they need not stay in between, in any step."""
        if self.comm.size == 1:
            return self.points.layout
        return self.migration.layout_version if self.migration.keeps_rows else None

    @property
    def takes_heat(self) -> bool:  # type: ignore[override]
        """Elastic-plastic laws have a temperature."""
        return "temperature" in self.points

    def take_heat(self, heat: np.ndarray, rows: np.ndarray) -> float:
        """See `ParticleSystem.take_heat`; no particle lies on a mirror plane."""
        return self.points.take_heat(heat, rows)

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Fields that are not declared."""
        points, here = self.points, slice(first, last)
        if name == "deformation_gradient":
            return points.deformation_gradients(first, last)
        if name == "velocity_gradient":
            return points["velocity_gradient"][here].reshape(-1, 3, 4)[:, :, :3].copy()
        if name in FLOW_FIELDS:
            return shown_flow(points, name, first, last, lambda back: self._turned(back, first, last))
        if name == "own_angular_momentum":
            return self._own_angular_momentum(here)
        if name not in ("density", "stress"):
            return None
        mass, grid_volume = points["mass"][here], points.motion[here, 7]
        if "deleted_mass" in points:
            # deleted particles have no stress and keep their density
            gone = points["deleted_mass"][here]
            laws = np.array([law.density for law in points.laws])[points.law_of_body[points["body"][here]]]
            mass, grid_volume = mass + gone, grid_volume + gone / laws
        volumes = grid_volume * points.jacobian(first, last)
        if name == "density":
            return np.asarray(mass / volumes)
        xx, yy, zz, _, yz, xz, xy, _ = points["stress_and_volume"][here].T
        stress = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
        return np.asarray(stress / volumes[:, None, None])

    def _turned(self, tensors: np.ndarray, first: int, last: int) -> np.ndarray:
        """Unrotated tensors (n, 3, 3) of particles first .. last - 1 in present axes."""
        left, _, right = np.linalg.svd(self.points.deformation_gradients(first, last))
        rotation = left @ right
        return np.asarray(rotation @ tensors @ rotation.swapaxes(1, 2))

    def _own_angular_momentum(self, here: slice) -> np.ndarray | None:
        """Angular momentum of the slopes C [kg m^2/s], m eps : C D, (n,) or (n, 3); None without slopes.

        D_j = sum_i w_i (x_i - x_p)_j^2 as in `shape_functions.put_moments`. None with GIMP functions, whose D depends
        on the domain of the particle.
        """
        points, settings = self.points, self.settings
        if "velocity_slope" not in points or settings.basis not in _SPREADS or points.axisymmetric:
            return None
        places = (points["position"][here] - points.origin[: points.dimension]) / settings.cell
        spread = _SPREADS[settings.basis](places % 1.0) * settings.cell**2 * points["mass"][here][:, None]
        slope = points["velocity_slope"][here].reshape(-1, 3, 4)
        # of (C D)_ij = C_ij D_j
        pairs = ((2, 1), (0, 2), (1, 0)) if points.dimension == 3 else ((1, 0),)
        turning = [slope[:, i, j] * spread[:, j] - slope[:, j, i] * spread[:, i] for i, j in pairs]
        return np.stack(turning, axis=1) if points.dimension == 3 else turning[0]

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """This rank's part of a quantity of the whole body."""
        points = self.points
        if name.startswith("maximum_"):
            field = name.removeprefix("maximum_")
            values = points.owned_rows(field) if field in points else np.zeros(0)
            return "maximum", np.array([values.max(initial=0.0)])
        failed = failed_matter.measure(points, points["mass"][: points.owned], name)
        if failed is not None:
            return failed
        if name == "plastic_work":
            return "sum", np.array([self.plastic_work])
        if name in ("heat", "entropy"):
            return "sum", np.array([getattr(points, name)()])
        lower, upper = points.bounds_of_domains()
        d = points.dimension
        return ("minimum", lower[:d]) if name == "lower_bounds" else ("maximum", upper[:d])

    def _melting(self) -> dict[str, Any]:
        """Particles that have melted if any can; collective."""
        comm, points = self.comm, self.points
        if all(getattr(law, "melting", None) is None for law in points.laws):
            return {}
        parts = [np.zeros(0)]
        for block in points.warm_blocks:
            if block.law.melting is not None:
                temperature = points["temperature"][block.first : block.last]
                parts.append(temperature / melting_temperature(block.law, points.jacobian(block.first, block.last)))
        ratios = np.concatenate(parts)
        return {
            "melted_particles": comm.allreduce(int((ratios >= 1.0).sum())),
            "largest_temperature_over_melting": maximum(comm, float(ratios.max(initial=0.0))),
        }

    def warnings(self) -> list[Warned]:
        """Planes at rest that lose or add energy, and walls that bear what is apart, see `GridConditions`."""
        early = "bears from the start, as nodes behind it are in the reach of its points; smaller cells bear later"
        return [
            Warned("badly-held", f"{key}: a plane at rest {why}: what swings there gains or loses energy")
            for key, why in self.conditions.badly_held()
        ] + [
            Warned("wall-bears-early", f"{key}: a body {gap:.4g} m from the wall, which {early}")
            for key, gap in self.conditions.bearing_early
        ]

    def first_invalid(self) -> tuple[int, str] | None:
        """The rank's first particle that is inside out, lost, or not a number."""
        points, cells = self.points, self.grid.cells
        rows, jacobian = points.owned_rows, points.jacobian(0, points.owned)
        numbers = (rows("velocity"), rows("position"), rows("stress_and_volume"), jacobian[:, None])
        finite = np.all([np.isfinite(values).all(axis=1) for values in numbers], axis=0)
        lost = np.ones(points.owned, bool)
        lost[cells.order[: cells.start[-1]]] = False
        for bad, what in (
            (~finite, "a number is no longer finite"),
            (~(jacobian > 0.0), "the Jacobian is not positive: matter is turned inside out"),
            (lost, "it has left the grid"),
        ):
            if bad.any():
                return int(np.argmax(bad)), what
        return None

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """By the speed of pressure waves in the undeformed solid."""
        law = self.points.laws[self.points.law_of_body[body]]
        return self.solids[law].wave_modulus(), law.density

    def energies(self) -> tuple[float, float]:
        """Kinetic energy and internal energy [J] of this rank's particles, heat and plastic work included."""
        kinetic = float(kinetic_energy(self.owned, self.points.motion))
        if self.external is not None:
            kinetic += self.external.energy()
        return kinetic, sum((self.solids[block.law].stored_energy(block) for block in self.points.blocks), 0.0)

    def advice(self) -> str:
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
            "shared nodes": len(self.grid.shared_slots()),
        }

    def arrays(self) -> list[np.ndarray]:
        return [self.nodes.motion, self.nodes.remapped, self.nodes.heat, *self.grid.cells.arrays()]

    def bytes_a_step(self) -> int:
        """Bytes of the sums over nodes, without particles that change their rank."""
        self.nodes.follow_cells()
        return self.nodes.bytes_sent

    def summary(self) -> dict[str, Any]:
        """Particles that changed their rank, how often cells were distributed anew, failed and melted matter."""
        result: dict[str, Any] = {
            "migrated_particles": self.comm.allreduce(self.grid.migrated),
            "rebalanced": self.migration.rebalanced,
        }
        result |= failed_matter.summary(self.comm, self.points, self.mass[: self.owned])
        return result | self._melting()

    @staticmethod
    def small_scene(tables: dict[str, Any]) -> dict[str, Any]:
        """A few cells, with the particles in their middles and nothing that a plane could cut."""
        method = {key: value for key, value in tables["method"].items() if value is not None}
        tables["method"] = method | {"cell": 1.0, "origin": [0.0] * tables["dimension"]}
        tables["bodies"] = [body | {"placement": "cells"} for body in tables["bodies"]]
        return tables

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        return symmetry_planes([one.plane for one in self.conditions.planes])

    @property
    def share(self) -> np.ndarray:
        """No particle lies on a mirror plane."""
        return np.ones(len(self.points.motion))
