"""Peridynamics as a scene states it."""

from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.methods.plastic_fields import (
    FLOW_FIELDS,
    PLASTIC_STATE,
    fields_of_no_body,
    flowing,
    temperatures_without_heat,
    total_lagrangian_faults,
)
from parsolid.scene.base_model import (
    Detail,
    OnRestart,
    Plane,
    Point,
    Positive,
    SceneModel,
    dimension_of,
    reject,
)
from parsolid.scene.codes import Note
from parsolid.scene.contact import in_contact
from parsolid.scene.materials import HyperelasticSolid
from parsolid.scene.method_settings import ArtificialViscosity, MassScaling, MethodSettings
from parsolid.scene.plasticity import faults_of_names
from parsolid.scene.shapes import Box

Share = Annotated[float, Field(ge=0, le=1)]

# coefficient of shear-scaled control with which a face is as stiff as a half space's
_PRESSED = 0.125
# of the control on velocities
_VISCOUS = 0.05


class Stabilisation(SceneModel):
    """Control of the zero-energy modes of the correspondence force.

    shear-scaled  self-adjoint, in multiples of the equilibrium shear modulus, on the relaxing displacement; of
                  elastic-plastic bodies on velocities, in multiples of impedance times spacing
    none          nothing; static solutions are then not unique
    """

    kind: Literal["shear-scaled", "none"] = "shear-scaled"
    coefficient: Positive | None = Field(None, description="factor of the control: 0.35 unless given, 0.125 in contact")
    viscous_coefficient: Positive | None = Field(
        None, description="factor of the control on velocities of elastic-plastic bodies: 0.05 unless given"
    )
    relaxes: bool = Field(
        True, description="whether the control relaxes with the body; false keeps angular momentum to rounding"
    )

    @property
    def factor(self) -> float:
        """The coefficient, with its default."""
        return self.coefficient or {"shear-scaled": 0.35, "none": 0.0}[self.kind]

    @property
    def viscous_factor(self) -> float:
        """That of the control on velocities, with its default."""
        return self.viscous_coefficient or {"shear-scaled": _VISCOUS, "none": 0.0}[self.kind]

    @property
    def is_open(self) -> bool:
        """Whether it is shear-scaled control whose coefficient nobody has stated."""
        return self.kind == "shear-scaled" and "coefficient" not in self.model_fields_set

    @model_validator(mode="after")
    def _used(self) -> "Stabilisation":
        details: list[Any] = []
        stated = [key for key in ("coefficient", "viscous_coefficient") if getattr(self, key) is not None]
        if self.kind == "none":
            details += [((key,), "no such key without control", getattr(self, key)) for key in stated]
        if self.kind == "none" and not self.relaxes:
            details.append((("relaxes",), "no such key without control", self.relaxes))
        reject(*details)
        return self


class Explicit(SceneModel):
    """Symplectic Euler with a step of `safety` times 2/sqrt(largest eigenvalue), found by power iteration on the actual
    body.

    While bonds may break the step is also at most `damage_safety` times that of the undamaged body.
    """

    on_restart: ClassVar = dict.fromkeys(("safety", "damage_safety"), OnRestart.FREE)
    kind: Literal["explicit"]
    safety: float = Field(0.8, gt=0, le=1, description="time step over the stability limit")
    damage_safety: float = Field(0.25, gt=0, le=1, description="the same where bonds may break")


class QuasiStatic(SceneModel):
    """Equilibrium at the end of every material step, without inertia."""

    on_restart: ClassVar = dict.fromkeys(("step", "tolerance", "most_iterations"), OnRestart.FREE)
    kind: Literal["quasi-static"]
    step: Positive = Field(description="the material step [s]")
    solver: Literal["conjugate-gradients", "dynamic-relaxation"] = Field(
        "conjugate-gradients",
        description="how equilibrium is found: Newton's method with conjugate gradients, or a damped motion, which "
        "needs no tangent",
    )
    tolerance: float = Field(1e-8, gt=0, lt=1, description="residual over the largest load (or reaction) met so far")
    extrapolation: Annotated[int, Field(ge=0, le=3)] = Field(
        2,
        description="of the polynomial through earlier states at which a solution starts, the order: 0 the last state",
    )
    most_iterations: Annotated[int, Field(ge=1)] = Field(
        100_000, description="iterations after which a solution has failed"
    )


class Damage(SceneModel):
    """Bonds that break at a critical stretch, or at a critical bond energy, given as such or by the fracture energy.

    least_shape_ratio, largest_damage: a particle whose shape tensor's determinant falls below this share of that inside
    a body, or whose share of broken bonds rises above this one, loses all its bonds
    """

    exactly_one: ClassVar = (("fracture_energy", "critical_stretch", "critical_bond_energy"),)
    criterion: Literal["stretch", "energy"] = Field("stretch", description="what breaks a bond")
    fracture_energy: Positive | None = Field(None, description="the energy release rate G_c [J/m^2]")
    critical_stretch: Positive | None = Field(None, description="the stretch at which a bond breaks")
    critical_bond_energy: Positive | None = Field(
        None, description="energy per two volumes at which a bond breaks [J/m^6]"
    )
    modulus: Literal["instantaneous", "equilibrium"] | Positive = Field(
        "instantaneous",
        description='Young\'s modulus in the critical stretch: "instantaneous", "equilibrium" or a number [Pa]',
    )
    least_shape_ratio: Share = Field(
        0.02, description="share of a whole neighbourhood's shape determinant below which a particle bears no stress"
    )
    largest_damage: Share = Field(0.8, description="share of broken bonds above which a particle bears no stress")

    @model_validator(mode="after")
    def _matched(self) -> "Damage":
        other = {"stretch": "critical_bond_energy", "energy": "critical_stretch"}[self.criterion]
        if getattr(self, other) is not None:
            reject(((other,), f"no such key with criterion = {self.criterion!r}", getattr(self, other)))
        return self


class PreCrack(SceneModel):
    """A cut at time 0: the bonds through it are broken.

    plane, box  an axis-aligned plane, or what of it is within a box
    """

    exactly_one: ClassVar = (("plane", "segment", "rectangle"),)
    plane: Plane | None = Field(None, description="a plane that no bond crosses")
    box: Box | None = None
    segment: Annotated[list[Point], Field(min_length=2, max_length=2)] | None = Field(
        None, description="in 2-D: its two ends [m]"
    )
    rectangle: Annotated[list[Point], Field(min_length=3, max_length=3)] | None = Field(
        None, description="in 3-D: a corner and its two neighbouring corners [m]"
    )

    @model_validator(mode="after")
    def _flat(self, info: ValidationInfo) -> "PreCrack":
        dimension, details = dimension_of(info), []
        if self.box is not None and self.plane is None:
            details.append((("box",), "no such key without plane", self.box.model_dump()))
        for key, where in (("segment", 2), ("rectangle", 3)):
            points = getattr(self, key)
            if points is None:
                continue
            if dimension not in (None, where):
                details.append(((key,), f"no such key but in {where}-D", points))
            elif not _spread(points):
                details.append(((key,), "points that do not lie on one " + ("place" if where == 2 else "line"), points))
        reject(*details)
        return self


def _spread(points: list[Any]) -> bool:
    """Whether two points differ, or three are not on one line."""
    edges = [[b - a for a, b in zip(points[0], point)] for point in points[1:]]
    products = [sum(a * b for a, b in zip(edge, other)) for edge in edges for other in edges]
    if len(edges) == 1:
        return products[0] > 0.0
    return products[0] * products[3] - products[1] ** 2 > 1e-20 * products[0] * products[3]


Solution = Annotated[Explicit | QuasiStatic, Field(discriminator="kind")]


class Peridynamics(MethodSettings):
    """Non-ordinary state-based (correspondence) peridynamics, viscoelastic, with damage (Galadima et al.); also
    bond-based.
    """

    system: ClassVar = "parsolid.methods.peridynamics.system:Peridynamics"
    dimensions: ClassVar = (1, 2, 3)
    materials: ClassVar = ("hyperelastic", "prony", "bond-based", "elastic-plastic")
    prescribes: ClassVar = ("velocity", "displacement")
    boundaries: ClassVar = (
        "fixed",
        "roller",
        "velocity",
        "rotation",
        "displacement",
        "layer",
        "traction",
        "pressure",
    )
    state_variables: ClassVar = (
        *("velocity", "branch_displacements*", "tensor_history", "deformation_gradient", "jacobian"),
        *("plastic_metric_inverse", "plastic_strain", "internal_energy", "temperature", "criterion_damage"),
        *("back_stress", "volume_flow"),
    )
    declared_fields: ClassVar = PLASTIC_STATE
    state_of_particles: ClassVar = ("broken_bonds",)
    state_forces: ClassVar = ("dissipative_force", "control_heat", "acting_stress")
    pressed: ClassVar = ("where", "box", "ball")
    refused: ClassVar = {
        "antisymmetric": "images of a solid that moves against it are not made",
        "spring": "loads do not depend on the motion",
        "wall": "rigid bodies that others touch are tools",
        "temperature": "the method conducts no heat",
        "heat-flux": "the method conducts no heat",
        "micro-hard": "it is for micro-inertia, in ulsph",
    }
    reactions: ClassVar = ("fixed", "roller", "velocity", "rotation", "displacement", "layer", "traction", "pressure")
    pictured_fields: ClassVar = ("damage", "von_mises_stress", "pressure")
    ledger_terms: ClassVar = {"fracture_dissipation": 1, "kinetic_offset": -1, "residual_work": 0}
    viscous_terms: ClassVar = ("control_heat",)
    extra_fields: ClassVar = {
        **FLOW_FIELDS,
        "damage": "scalar",
        "bond_limit": "scalar",
        "micromodulus": "scalar",
        "internal_force": "vector",
        "dissipative_force": "vector",
        "area": "vector",
    }
    extra_quantities: ClassVar = {
        "broken_bonds": "scalar",
        "crack_tip": "vector",
        "maximum_temperature": "scalar",
        "maximum_plastic_strain": "scalar",
        "maximum_damage": "scalar",
        "failed_mass": "scalar",
    }

    on_restart: ClassVar = dict.fromkeys(("horizon_ratio", "initial_state", "pre_cracks"), OnRestart.FIXED)
    kind: Literal["peridynamics"]
    horizon_ratio: float = Field(
        3.0, ge=1, le=30, description="m: the horizon is (m + 0.015) times the particle spacing"
    )
    influence: Literal["constant", "linear", "cubic-spline"] = Field(
        "constant", description="w(|xi|/horizon), 1 at |xi| = 0"
    )
    traction: Literal["consistent", "consistent-everywhere", "single-layer", "horizon"] = Field(
        "consistent",
        description='how tractions act: "consistent", as forces that balance a uniform stress near it, exact on a '
        'lattice; "consistent-everywhere", also inside, where irregular particles need forces for that; '
        '"single-layer", on the particles at the face; "horizon", spread evenly over the horizon beneath '
        "it",
    )
    plane: Literal["stress", "strain"] | None = Field(
        None, description='of a 2-D scene: "stress" or "strain" (strain unless given); lengths per metre of thickness'
    )
    initial_state: Literal["instantaneous", "relaxed"] = Field(
        "instantaneous",
        description='how the bodies\' initial displacement came about: "instantaneous", just before the start, with '
        'nothing relaxed yet, or "relaxed", held for ever',
    )
    stabilisation: Stabilisation = Stabilisation()
    viscosity: ArtificialViscosity = Field(ArtificialViscosity(), description="of elastic-plastic bodies in shocks")
    solution: Solution = Field(Explicit(kind="explicit"), description="explicit steps, or equilibrium at each step")
    damage: Damage | None = Field(
        None,
        description="bonds that break; the particle field damage is the share of a family's volume that bonds were "
        "lost to, the quantities broken_bonds (those of pre-cracks not among them) and crack_tip (see "
        "`methods.peridynamics.fracture`) follow cracks",
    )
    pre_cracks: list[PreCrack] = []
    mass_scaling: MassScaling = None

    def reach(self, spacing: np.ndarray) -> np.ndarray:
        return np.full(len(spacing), self.horizon(float(spacing.max())))

    def band(self, spacing: np.ndarray) -> np.ndarray:
        return self.horizon_ratio * super().band(spacing)

    def horizon(self, spacing: float) -> float:
        """The horizon [m] for a particle spacing [m]; the margin keeps the last neighbours out of reach of rounding."""
        return (self.horizon_ratio + 0.015) * spacing

    def state(self, dimension: int) -> str:
        """The state of strain, "bar", "plane-strain", "plane-stress" or "space"."""
        return "plane-stress" if self.plane == "stress" else super().state(dimension)

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> "Peridynamics":
        details: list[Any] = []
        if dimension_of(info) in (1, 3) and self.plane is not None:
            details.append((("plane",), "no such key but in 2-D", self.plane))
        reject(*details)
        return self

    def defaults_for(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """In contact a softer control unless one is stated: that of beams makes a face a quarter too stiff against what
        varies within a horizon or two. Not where bonds break, for which it is too soft."""
        bonds = any(scene.bodies[i].material.kind == "bond-based" for i in bodies)
        if bonds or self.damage is not None or not self.stabilisation.is_open or not in_contact(scene, bodies):
            return {}
        # as one that nobody has stated
        stated, keys = self.stabilisation.model_fields_set, self.stabilisation.model_dump() | {"coefficient": _PRESSED}
        return {"stabilisation": Stabilisation.model_construct(stated, **keys)}

    def energy_terms(self, scene: Any, bodies: Iterable[int]) -> dict[str, int]:
        """Also what flow and the control on velocities heat."""
        plastic = any(scene.bodies[i].material.kind == "elastic-plastic" for i in bodies)
        return super().energy_terms(scene, bodies) | ({"plastic_work": 0, "control_heat": 0} if plastic else {})

    def scene_faults(self, scene: Any) -> list[Detail]:
        """Laws that would have to find their own thickness, and what solids that flow do not bear."""
        faults = self._unknown_thickness(scene) + self._plastic_faults(scene)
        solved = "with equilibrium instead of motion" if self.solution.kind != "explicit" else None
        faults += self.faults_of_scaling(scene, solved)
        if self.stabilisation.kind != "none" and any(body.material.kind == "mazars" for body in scene.bodies):
            expected = "'none' with a law that softens in a band, which an elastic control would hold together"
            faults.append((("method", "stabilisation", "kind"), expected, self.stabilisation.kind))
        return faults

    def _plastic_faults(self, scene: Any) -> list[Detail]:
        """What elastic-plastic bodies do not bear, and what is to be shown of them where there are none."""
        faults = fields_of_no_body(scene) + temperatures_without_heat(scene)
        faults += [fault for fault in faults_of_names(scene) if fault[2] != "damage"]
        plastic = flowing(scene)
        if not plastic:
            expected, factor = "no such key without an elastic-plastic body", self.stabilisation.viscous_coefficient
            if factor is not None:
                faults.append((("method", "stabilisation", "viscous_coefficient"), expected, factor))
            if self.viscosity != ArtificialViscosity():
                faults.append((("method", "viscosity"), expected, self.viscosity.model_dump()))
            return faults
        if self.solution.kind != "explicit":
            expected = "'explicit' with elastic-plastic bodies, whose control is one on velocities"
            faults.append((("method", "solution", "kind"), expected, self.solution.kind))
        for i in plastic:
            faults += total_lagrangian_faults(scene.bodies[i].material, ("bodies", i, "material"))
        return faults + self._bond_faults(scene, plastic)

    def _bond_faults(self, scene: Any, plastic: list[int]) -> list[Detail]:
        """Bonds of solids that flow break by their stretch alone, and are whole where the law itself fails."""
        faults: list[Detail] = []
        failing = [i for i in plastic if scene.bodies[i].material.failure is not None]
        if failing and (self.damage is not None or self.pre_cracks):
            expected = "no such key where bonds break: damage is the share of broken bonds there"
            faults.append((("bodies", failing[0], "material", "failure"), expected, Phrase("criteria of failure")))
        if self.damage is not None and self.damage.criterion == "energy":
            expected = "'stretch' with elastic-plastic bodies, whose bonds store only a part of the work on them"
            faults.append((("method", "damage", "criterion"), expected, "energy"))
        named = self.damage is not None and not isinstance(self.damage.modulus, float)
        if self.damage is not None and self.damage.fracture_energy is not None and named:
            expected = "a number [Pa], or critical_stretch, with elastic-plastic bodies"
            faults.append((("method", "damage", "modulus"), expected, self.damage.modulus))
        return faults

    def _unknown_thickness(self, scene: Any) -> list[Detail]:
        """Solids whose laws know no free direction."""
        state = self.state(scene.dimension)
        if state not in ("plane-stress", "bar"):
            return []
        what = "plane stress" if state == "plane-stress" else "bars"
        expected = f"a law that knows {what}: prony, linear-elastic or bond-based"
        kinds = [(i, body.material) for i, body in enumerate(scene.bodies)]
        return [
            (("bodies", i, "material", "kind"), expected, getattr(material, "kind", ""))
            for i, material in kinds
            if isinstance(material, HyperelasticSolid) or material.kind == "elastic-plastic"
        ]

    def notes(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """What costs accuracy: tractions on uneven particles, a part that is sheared between held regions, and a
        control that makes faces in contact stiff.
        """
        return [*self._loaded_unevenly(scene, bodies), *self._sheared(scene), *self._pressed_on(scene, bodies)]

    def _loaded_unevenly(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """Forces that balance a uniform stress know the areas of a lattice."""
        uneven = [f"bodies.{i}" for i in bodies if scene.bodies[i].jitter > 0.0 or scene.bodies[i].shape.kind == "mesh"]
        loaded = any(one.kind == "traction" for one in scene.boundaries)
        if not uneven or not loaded or self.traction != "consistent":
            return []
        figure = "displacements are off by up to 6 %, 2 % in the mean, with jitter 0.2"
        remedy = 'for a box at rest method.traction = "consistent-everywhere" has them right, and resultants 4 % off'
        text = f"{', '.join(uneven)}: uneven particles under a traction; {figure}; {remedy}"
        return [Note("uneven-traction", text)]

    def _sheared(self, scene: Any) -> list[Note]:
        """A part between regions that are held or driven, whose families are cut off there."""
        held = ("fixed", "rotation", "velocity", "displacement")
        regions = {getattr(one, "where", None) for one in scene.boundaries if one.kind in held} - {None}
        if len(regions) < 2 or not self.stabilisation.is_open:
            return []
        names = " and ".join(sorted(map(repr, regions)))
        ring = "a ring sheared between two such faces is 7 % too soft with 6 layers of particles, 4 % with 12"
        remedy = "1.4 % with method.stabilisation.coefficient = 1 (0.35 unless given, which is for beams)"
        return [Note("sheared-part", f"{names} are held or driven: {ring}, {remedy}")]

    def _pressed_on(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """Bodies in contact: what control they have, which is for faces, or for bonds that break."""
        names, key = ", ".join(in_contact(scene, bodies)), "method.stabilisation.coefficient"
        if self.defaults_for(scene, bodies):
            told = f"{key} = {_PRESSED:g} for all bodies of the method, unless stated, with which faces are as stiff"
            bends = "as they should be and beams of ten particles bend 12 % too far"
            text = f"{names} in contact: {told} {bends}; without contact {self.kind} has 0.35"
            return [Note("stabilisation-in-contact", text)]
        if not names or self.damage is None or not self.stabilisation.is_open:
            return []
        face = "pressed faces are a quarter too stiff against what varies within a horizon or two"
        text = f"{names} in contact with bonds that break: {key} = 0.35, unless stated; {face}"
        return [Note("stabilisation-in-contact", text)]

    def warned_bonded_spacings(self, scene: Any) -> float:
        """Beyond it a pulled pair is longer by more than a fifth of the coarse spacing (docs/contact.md)."""
        return 1.25

    def contact_refused(self, scene: Any) -> str | None:
        """Equilibrium has no motion that impulses could change."""
        return None if self.solution.kind == "explicit" else "with equilibrium instead of motion"

    def substeps_refused(self) -> str | None:
        """Of equilibrium, and of bonds, which break in a step that all ranks agree on."""
        if self.solution.kind != "explicit":
            return "with equilibrium instead of motion"
        return "with bonds that break" if self.damage is not None else None
