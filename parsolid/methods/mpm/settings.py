"""The material point method as a scene states it."""

from collections.abc import Iterable
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from parsolid.methods.failure_fields import DAMAGE
from parsolid.methods.plastic_fields import FLOW_FIELDS, PLASTIC_STATE, fields_of_no_body
from parsolid.scene.base_model import Point, Positive, dimension_of, reject
from parsolid.scene.codes import Note
from parsolid.scene.contact import in_contact
from parsolid.scene.method_settings import KINETIC_OFFSET, ArtificialViscosity, MassScaling, MethodSettings
from parsolid.scene.plasticity import QUANTITIES, faults_of_names

Basis = Literal["linear", "ugimp", "quadratic-spline", "cubic-spline"]

# nodes of the stencil of a point along an axis
_NODES_ACROSS = {"linear": 2, "ugimp": 3, "quadratic-spline": 3, "cubic-spline": 4}

# cells from the grid's origin up to which bodies leave it where it is; a grid ends 2^20 cells from it
_NEAR_CELLS = 2**16
# points across a cantilever from which FLIP bends it right within 5 % (docs/mpm.md)
_FLIP_LAYERS = 4
_ROUND_OFF = 1e-6
# loads on surfaces
_LOADS = ("traction", "pressure", "spring")


class MaterialPoint(MethodSettings):
    """Material point method with plasticity, an equation of state and heat (Banerjee)."""

    system: ClassVar = "parsolid.methods.mpm.system:MaterialPoint"
    shared_field: ClassVar = True
    in_cells: ClassVar = True
    materials: ClassVar = ("hyperelastic", "elastic-plastic")
    boundaries: ClassVar = ("fixed", "roller", "velocity", "wall", "temperature", "heat-flux", *_LOADS)
    reactions: ClassVar = ("velocity", "wall", *_LOADS)
    state_variables: ClassVar = (
        *("velocity", "velocity_slope", "velocity_gradient", "deformation_gradient", "unrotated_deviator"),
        *("temperature", "temperature_slope", "internal_energy", "plastic_strain"),
        *("damage", "criterion_damage", "back_stress", "volume_flow", "viscous_strain_inverses"),
    )
    state_of_particles: ClassVar = ("deleted_*",)
    state_forces: ClassVar = ("stress_and_volume",)
    refused: ClassVar = {
        "antisymmetric": "a grid is folded at planes of symmetry and of rest",
        "rotation": "nodes of a grid do not turn; 'velocity' takes formulas of place and time",
        "displacement": "nodes of a grid have velocities alone",
        "layer": "nodes of a grid have velocities alone",
        "micro-hard": "it is for micro-inertia, in ulsph",
    }
    loads: ClassVar = ("body_force", "acceleration", "heat_source", "manufactured")
    declared_fields: ClassVar = (*PLASTIC_STATE, DAMAGE)
    extra_fields: ClassVar = FLOW_FIELDS | {"density": "scalar", "velocity_gradient": "tensor", "grid_volume": "scalar"}
    pictured_fields: ClassVar = ("plastic_strain", "von_mises_stress", "pressure")
    ledger_terms: ClassVar = {KINETIC_OFFSET: -1, "plastic_work": 0, "viscous_work": 0, "heat_supplied": -1}
    viscous_terms: ClassVar = ("viscous_work",)
    extra_quantities: ClassVar = {
        "maximum_temperature": "scalar",
        "maximum_plastic_strain": "scalar",
        "plastic_work": "scalar",
        "heat": "scalar",
        "entropy": "scalar",
        "lower_bounds": "vector",
        "upper_bounds": "vector",
    } | QUANTITIES

    kind: Literal["mpm"]
    cell: Positive = Field(description="the spacing of the background grid [m]")
    origin: Point | None = Field(
        None, description="a point of the grid [m]; walls are exact where they lie on its planes"
    )
    basis: Basis = Field("quadratic-spline", description="shape functions of the grid")
    geometry: Literal["plane-strain", "axisymmetric"] | None = Field(
        None,
        description="of a 2-D scene: plane strain per metre of thickness, or axisymmetric with X the radius and Y the "
        "axis, per radian",
    )
    transfer: Literal["flip", "apic", "aflip"] = Field(
        "apic",
        description='of velocities: "apic", which keeps angular momentum; "aflip", FLIP with the slopes of APIC, '
        'which keeps it nearly and loses less energy; "flip", which loses angular momentum. Unless stated '
        '"apic"; in contact "aflip" with flip_fraction 0.99; "flip" on linear weights or with a '
        "flip_fraction",
    )
    flip_fraction: float = Field(1.0, ge=0, le=1, description="share of FLIP in the velocity, the rest is PIC")
    order: Literal["usl", "musl"] = Field(
        "musl",
        description='stress update last with particle velocities mapped again ("musl") or with the new grid velocity '
        '("usl", which loses energy in contact)',
    )
    # transfers between particles and grid leave an error in the balance
    balance_warning: Positive = 0.03
    balance_limit: Positive = 0.1
    cfl: Positive = Field(0.3, description="time step over h / (wave speed + particle speed)")
    viscosity: ArtificialViscosity = ArtificialViscosity()
    conduction: bool = Field(True, description="of heat, where materials have a conductivity")
    motion: bool = Field(True, description="false: nothing moves, heat alone is conducted")
    rebalance: float = Field(
        1.2, gt=1, description="largest over mean number of particles on a rank beyond which cells are dealt out anew"
    )

    mass_scaling: MassScaling = None

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> "MaterialPoint":
        details: list[Any] = []
        if dimension_of(info) == 3 and self.geometry is not None:
            details.append((("geometry",), "no such key in 3-D", self.geometry))
        if self.transfer == "apic" and "transfer" in self.model_fields_set and self.flip_fraction != 1.0:
            details.append((("flip_fraction",), "no such key with the transfer 'apic'", self.flip_fraction))
        reject(*details)
        return self

    @property
    def adds_changes(self) -> bool:
        """Particles add all of the nodes' changes to the velocities that they have, and forget nothing."""
        return self.transfer in ("flip", "aflip") and self.flip_fraction == 1.0

    def defaults_for(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """A grid that is near bodies which are far from the origin, and transfers by what bodies do."""
        return self._usual_origin(scene, bodies) | self._usual_transfer(scene, bodies)

    def _usual_origin(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """A whole number of cells from zero, so that nodes stay where they are, where bodies are many cells away."""
        shapes = [scene.bodies[i].shape for i in bodies]
        bounds = np.array([shape.model.bounds() for shape in shapes if shape.kind != "mesh"])
        if self.origin is not None or not len(bounds):
            return {}
        lower, upper = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
        if max(np.abs(lower).max(), np.abs(upper).max()) <= _NEAR_CELLS * self.cell:
            return {}
        return {"origin": [float(np.floor(place / self.cell) * self.cell) for place in lower]}

    def _usual_transfer(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """Unless transfers are stated: in contact AFLIP with 1 % of APIC, since nodes beyond a face move slowly against
        what presses on it, in FLIP for ever; on linear weights, where slopes turn matter inside out, FLIP."""
        if "transfer" in self.model_fields_set:
            return {}
        if self.basis == "linear" or "flip_fraction" in self.model_fields_set:
            return {"transfer": "flip"}
        return {"transfer": "aflip", "flip_fraction": 0.99} if in_contact(scene, bodies) else {}

    def without_state(self, name: str) -> str:
        """A hint for results without slopes of the velocity."""
        hint = "; method.transfer = 'apic', or 'aflip' in contact, has it unless another is stated, 'flip' does without"
        return hint if name == "velocity_slope" else ""

    def reach(self, spacing: np.ndarray) -> np.ndarray:
        """Distance within which points have nodes in common."""
        return np.full(len(spacing), _NODES_ACROSS[self.basis] * self.cell)

    def band(self, spacing: np.ndarray) -> np.ndarray:
        return np.full(len(spacing), 2.0 * self.cell)

    def contact_distance(self, spacing: np.ndarray) -> np.ndarray:
        return np.maximum(self.reach(spacing), spacing)

    def largest_spacing(self) -> float | None:
        """The cell: a spacing of one point a cell and direction."""
        return self.cell

    def bending_fault(self, across: int, spacing: float) -> tuple[str, bool] | None:
        """Without slopes nodes see less of a rotation than the points have, and it strains what turns."""
        if self.transfer != "flip" or (across >= _FLIP_LAYERS and 2.0 * spacing <= self.cell * (1.0 + _ROUND_OFF)):
            return None
        wanted = f"needs {_FLIP_LAYERS} points across, and two a cell and direction"
        return f"method.transfer = 'flip' {wanted}; 'apic' does with fewer", True

    def contact_refused(self, scene: Any) -> str | None:
        """Between bodies with grids of their own; nothing of one body could part on its grid."""
        alone = any(len(one.bodies) == 1 and one.bodies[0] in {b.name for b in scene.bodies} for one in scene.contact)
        return "within one body of this method" if alone else None

    def notes(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """Bodies in contact whose transfer nobody has asked for: it is not that of others."""
        slopes = self.transfer == "aflip" and self.basis == "linear"
        if slopes:
            text = f"method.transfer = {self.transfer!r} on linear weights is unstable: 'flip', or basis = a spline"
            return [Note("unstable-transfer", text)]
        # with a grid for each body one tells for all
        alike = [i for one in scene.systems if one.settings is self for i in one.bodies]
        usual = self._usual_transfer(scene, alike) if alike[0] in bodies else {}
        names = ", ".join(in_contact(scene, alike) if usual else ())
        chosen = ", ".join(f"method.{key} = {value!r}" for key, value in usual.items())
        text = f"{names} in contact: {chosen}, unless stated; without contact {self.kind} has 'apic'"
        return [Note("transfer-in-contact", text)] if names else []

    def scene_faults(self, scene: Any) -> list[tuple[tuple[Any, ...], str, object]]:
        """Bodies beyond the axis; heat without conductivity; fields that no body has."""
        details: list[Any] = []
        for i, body in enumerate(scene.bodies):
            lower = getattr(body.shape.model, "lower", None)
            if self.geometry == "axisymmetric" and lower is not None and lower[0] < 0.0:
                details.append((("bodies", i, "shape", "box", "lower", 0), "a radius of at least 0", lower[0]))
        plastic = any(body.material.kind == "elastic-plastic" for body in scene.bodies)
        if not plastic and self.viscosity not in (
            ArtificialViscosity(),
            ArtificialViscosity(linear=0.0, quadratic=0.0),
        ):
            # the default is on in every scene and has no effect where no law takes it
            details.append(
                (("method", "viscosity"), "no such key without an elastic-plastic body", self.viscosity.model_dump())
            )
        parts = [getattr(body.material, "parts", {}) for body in scene.bodies]
        conducting = any(each.get("conductivity") or each.get("conductivity_tensor") for each in parts)
        # conduction has a time scale of its own, which inertia must not reach
        heat = "where heat is conducted (method.conduction)" if conducting and self.conduction else None
        details += self.faults_of_scaling(scene, heat if self.motion else "where nothing moves")
        for i, boundary in enumerate(scene.boundaries):
            if boundary.kind in _LOADS and self.geometry == "axisymmetric":
                details.append((("boundaries", i, "kind"), "no load on a surface about an axis", boundary.kind))
            if boundary.kind in ("temperature", "heat-flux") and not conducting:
                details.append((("boundaries", i, "kind"), "a body with a conductivity", boundary.kind))
        return details + fields_of_no_body(scene) + faults_of_names(scene)
