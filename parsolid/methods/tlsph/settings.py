"""Keys and defaults of total-Lagrangian SPH in a scene; `scene_checks` has what they exclude."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from parsolid.methods.failure_fields import DAMAGE
from parsolid.methods.plastic_fields import FLOW_FIELDS, PLASTIC_STATE
from parsolid.methods.tlsph.body_weights import (
    ON_LATTICES,
    RESOLVED,
    best_is_confirmed,
    no_mesh_weights,
    weights_of_bodies,
)
from parsolid.methods.tlsph.scene_checks import IMPLICIT, SOLUTION, faults
from parsolid.pairs.smoothing import kernel_names, smoothing_kernel
from parsolid.scene.base_model import Detail, NotNegative, Positive, reject
from parsolid.scene.codes import Note
from parsolid.scene.method_settings import KINETIC_OFFSET, STAGE_CHANGE, MassScaling, MethodSettings
from parsolid.scene.observed import NODAL_VON_MISES

# dissipation of bodies with the weights of their mesh, and stabilisation of plane meshes without plastic flow, unless
# the scene states them (docs/real-parts.md)
MESH_DISSIPATION = 0.1
PLANE_STABILISATION = 0.5
# ledger term: work of the images at fixed planes that is not adjoint, see `fixed_walls`
FIXED_WALLS = "fixed_wall_work"


class TotalLagrangianSPH(MethodSettings):
    """Upwind total-Lagrangian smoothed particle hydrodynamics (Lee et al.)."""

    system: ClassVar = "parsolid.methods.tlsph.system:TotalLagrangianSPH"
    viscous_terms: ClassVar = ("riemann_heat",)
    graded_bodies: ClassVar = True
    initial_stress_refused: ClassVar = None
    extra_fields: ClassVar = {
        **FLOW_FIELDS,
        **dict.fromkeys(("stress_force", "dissipative_force", "area", "updated_reference_position"), "vector"),
        "updated_reference_volume": "scalar",
        "cofactor": "tensor",
    }
    state_variables: ClassVar = (
        *("velocity", "deformation_gradient", "cofactor", "jacobian", "viscous_strain_inverse_*"),
        *("plastic_metric_inverse", "plastic_strain", "internal_energy", "temperature", "damage", "criterion_damage"),
        *("back_stress", "volume_flow"),
    )
    state_forces: ClassVar = (
        *("stress_force", "dissipative_force", "excess_wall_force", "acting_stress", "riemann_heat"),
    )
    declared_fields: ClassVar = (*PLASTIC_STATE, DAMAGE)
    extra_quantities: ClassVar = {
        "maximum_temperature": "scalar",
        "maximum_plastic_strain": "scalar",
        "maximum_damage": "scalar",
        "failed_mass": "scalar",
        "element_variation": "scalar",
    }
    pictured_fields: ClassVar = (NODAL_VON_MISES, *MethodSettings.pictured_fields)
    materials: ClassVar = ("hyperelastic", "elastic-plastic")
    boundaries: ClassVar = (
        *("fixed", "roller", "antisymmetric", "velocity", "rotation", "displacement"),
        *("traction", "pressure", "spring"),
    )
    reactions: ClassVar = boundaries
    refused: ClassVar = {
        "layer": "a part of a body is held by 'fixed' in a region",
        "wall": "rigid bodies that others touch are tools",
        "temperature": "the method conducts no heat",
        "heat-flux": "the method conducts no heat",
        "micro-hard": "it is for micro-inertia, in ulsph",
    }
    stage_keys: ClassVar = (
        *("integrator", "tolerance", "accuracy", "safety", "dissipation", "reconstruction"),
        *("maximum_step", "minimum_step"),
    )
    kind: Literal["tlsph"]
    kernel: Literal[kernel_names()] = Field(  # type: ignore[valid-type]
        "wendland-c2", description="the smoothing kernel"
    )
    smoothing: float = Field(0.85, gt=0, le=30, description="smoothing length over particle spacing, h/dx, at most 30")
    integrator: Literal["ssp-rk3", "leapfrog", "static", "implicit"] = Field(
        "leapfrog",
        description='"leapfrog": one force evaluation a step, order 2; "ssp-rk3": three, order 3, as in the paper, '
        'with the weights of a kernel; "static": a sequence of equilibria, the time being the parameter of the loads; '
        '"implicit": motion, order 2, in steps that waves do not bound',
    )
    tolerance: Annotated[float, Field(gt=0, lt=1)] | None = Field(
        None,
        description='of "static": forces that are not balanced over the largest load (or reaction) so far; of '
        '"implicit": over the largest force so far; 1e-8 unless given',
    )
    accuracy: Annotated[float, Field(gt=0, lt=1)] | None = Field(
        None,
        description='of "implicit": what a step errs by over the largest displacement, 1e-3 unless given; without it '
        "steps are as long as maximum_step where that is given",
    )
    linear_solver: Literal["embedded", "petsc"] = Field(
        "embedded",
        description='of "static" and "implicit": this package\'s own solver of linear equations, or that of PETSc '
        "through petsc4py, with algebraic multigrid",
    )
    petsc_options: str = Field("", description='of linear_solver = "petsc": options for PETSc, such as "-ksp_monitor"')
    cfl: Positive | None = Field(
        None, description="time step over (particle spacing / largest wave speed), 0.7 unless given; of ssp-rk3"
    )
    safety: Positive | None = Field(
        None, description="time step over the largest stable one on a lattice, 0.9 unless given; of leapfrog"
    )
    dissipation: NotNegative | None = Field(
        None,
        description="factor on the Riemann dissipation, 0 = none; unless given 0.1 for bodies with the weights of "
        "their mesh, for boxes with leapfrog 0.1 in smooth small motion and 1 elsewhere, for others 1",
    )
    reconstruction: bool = Field(True, description="linear reconstruction of the velocity jump")
    reference: Literal["fixed", "updated"] = Field(
        "fixed", description='configuration in which neighbours are found; "updated" moves it to the present one'
    )
    update_every: Annotated[int, Field(ge=1)] | None = Field(None, description="steps between updates of the reference")
    update_when: Positive | None = Field(
        None, description="Green strain since the last update of the reference that calls for another"
    )
    weights: Literal["kernel", "closure", "cells", "fourth-order", "mesh", "best"] | None = Field(
        None,
        description='pair weights: unless given, with leapfrog "mesh" for bodies from meshes, "best" for boxes of 8 '
        'nodes or more along each axis that no bond joins, without tools that have mass, and "kernel" for others; '
        '"closure" for irregular particles; "cells" and "fourth-order" in closed form for lattices; "mesh": those of '
        'the elements of meshes; "best": for each body what fits it',
    )
    stabilisation: float = Field(
        0.35,
        ge=0,
        le=1,
        description="part of their own shear energy by which elements resist what differs from their nodes' mean "
        'strain; of weights = "mesh", where unless given it is .5 in the plane and no material flows',
    )
    clamp_edges: float | None = Field(
        None,
        ge=0,
        lt=1,
        description="part of their stress energy that nodes of boxes with weights in closed form do without where a "
        "fixed plane meets a free face, for the singular stress there; unless given by Poisson's ratio, 0 for "
        "elastic-plastic bodies and spacings that differ (docs/tlsph.md)",
    )

    mass_scaling: MassScaling = None

    @property
    def prescribes(self) -> tuple[str, ...]:  # type: ignore[override]
        """Displacements can be prescribed in static and implicit solutions, velocities in all."""
        return ("velocity", "displacement") if self.integrator in IMPLICIT else ("velocity",)

    @property
    def pair_weights(self) -> str:
        """The key `weights`, "kernel" where it is left out."""
        return self.weights or "kernel"

    def integrators(self, scene: Any) -> set[str]:
        """The method's integrator and those of the stages of a scene, "" for stages that leave it out."""
        return {self.integrator, *(stage.method.get("integrator", "") for stage in scene.stages)}

    def dissipation_of(self, weights: str) -> float:
        """Factor on the Riemann dissipation of bodies with pair weights of a kind."""
        if self.integrator in IMPLICIT:
            return 0.0
        if self.dissipation is not None:
            return float(self.dissipation)
        return MESH_DISSIPATION if weights == "mesh" else 1.0

    @property
    def limits_dissipation(self) -> bool:
        """Whether the dissipation of boxes is less where motion is smooth and small (`riemann.dissipation_limiter`)."""
        return self.dissipation is None and self.integrator == "leapfrog"

    @model_validator(mode="after")
    def _check_keys_of_integrator(self) -> "TotalLagrangianSPH":
        """Refuse keys of other integrators and give the own one its default."""
        step_keys = {
            "leapfrog": ("safety", 0.9),
            "ssp-rk3": ("cfl", 0.7),
            **dict.fromkeys(IMPLICIT, ("tolerance", 1e-8)),
        }
        key, default = step_keys[self.integrator]
        refused = [name for name in ("safety", "cfl", "tolerance") if name != key and getattr(self, name) is not None]
        if self.accuracy is not None and self.integrator != "implicit":
            refused.append("accuracy")
        if self.integrator in IMPLICIT:
            if self.dissipation is not None:
                refused.append("dissipation")
            if not self.reconstruction:
                refused.append("reconstruction")
        expected = f"no such key with the integrator {self.integrator!r}"
        reject(*(((name,), expected, getattr(self, name)) for name in refused))
        if getattr(self, key) is None:
            # the model is frozen, and model_fields_set has only what the scene states
            vars(self)[key] = default
        return self

    @model_validator(mode="after")
    def _check_keys_of_reference(self) -> "TotalLagrangianSPH":
        """An updated reference needs one rule for its updates and the kernel's weights; a fixed one has no rule."""
        given = {name: getattr(self, name) for name in ("update_every", "update_when")}
        given = {name: value for name, value in given.items() if value is not None}
        if self.reference == "fixed":
            reject(*(((name,), "no such key with the reference 'fixed'", value) for name, value in given.items()))
        elif len(given) != 1:
            expected = "one of update_every and update_when with 'updated'"
            reject((("reference",), expected, ", ".join(given) or "neither"))
        elif self.pair_weights != "kernel":
            reject((("weights",), "'kernel' with the reference 'updated'", self.weights))
        return self

    def energy_terms(self, scene: Any, bodies: Iterable[int]) -> dict[str, int]:
        """Terms of the method, of leapfrog, of a change between stages, of plastic flow and of images at planes."""
        terms = super().energy_terms(scene, bodies)
        integrators = [self.integrator, *(stage.method.get("integrator", "") for stage in scene.stages)]
        if "leapfrog" in integrators:
            terms[KINETIC_OFFSET] = -1
        losing = {("leapfrog", "implicit"), ("leapfrog", "static"), ("implicit", "static")}
        if losing & set(pairwise(integrators)):
            terms[STAGE_CHANGE] = 1
        if any(scene.bodies[i].material.kind == "elastic-plastic" for i in bodies):
            terms |= {"plastic_work": 0, "riemann_heat": 0}
        kinds = weights_of_bodies(self.pair_weights, self._with_bodies(scene, bodies))
        fixed_planes = any(one.kind == "fixed" and one.plane is not None for one in scene.boundaries)
        if fixed_planes and any(kind not in (*ON_LATTICES, "mesh") for kind in kinds):
            terms[FIXED_WALLS] = -1
        return terms

    def defaults_for(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """Default weights of the bodies, and the default stabilisation of their elements (docs/tlsph.md)."""
        defaults = self._default_weights(scene, bodies)
        if scene.dimension == 3 or "stabilisation" in self.model_fields_set:
            return defaults
        own_scene = self._with_bodies(scene, bodies)
        kinds = weights_of_bodies(defaults.get("weights", self.pair_weights), own_scene)
        flows = any(body.material.kind == "elastic-plastic" for body in own_scene.bodies)
        if "mesh" in kinds and not flows:
            defaults["stabilisation"] = PLANE_STABILISATION
        return defaults

    def _default_weights(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """Default of `weights`, {} for the kernel's.

        Bodies from meshes have the weights of their elements. Boxes have weights in closed form where every example of
        the tables confirms them: `RESOLVED` nodes or more along each axis, no bond, no tool with mass.
        """
        stated = {"kernel", "smoothing", "weights"} & self.model_fields_set
        if self.integrator == "ssp-rk3" or self.reference == "updated" or stated:
            return {}
        if self.integrators(scene) & IMPLICIT:
            return {"weights": "best"}
        own_scene = self._with_bodies(scene, bodies)
        from_mesh = [body.shape.kind == "mesh" for body in own_scene.bodies]
        if any(from_mesh) and no_mesh_weights(own_scene) is not None:
            return {}
        # Without reconstruction, weights in closed form damp more of what is resolved (docs/choosing.md). A tool with
        # mass and the light nodes of their faces oscillate by more than 1 % of the energy (test_free_tools).
        free_tools = any(tool.mass is not None for tool in scene.tools)
        if self.reconstruction and not all(from_mesh) and not free_tools and best_is_confirmed(own_scene):
            return {"weights": "best"}
        return {"weights": "mesh"} if any(from_mesh) else {}

    def _with_bodies(self, scene: Any, bodies: Iterable[int]) -> Any:
        """The scene with this method and some of its bodies alone."""
        return scene.model_copy(update={"method": self, "bodies": [scene.bodies[i] for i in bodies]})

    def notes(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """Notes on faces that are loaded through the kernel's weights, and on volume that clamp edges lack."""
        notes = []
        loaded = any(boundary.kind in ("traction", "pressure") for boundary in scene.boundaries)
        if loaded and self.pair_weights in ("kernel", "mesh") and self.reference == "fixed" and scene.methods is None:
            best = weights_of_bodies("best", scene)
            names = ", ".join(f"bodies.{i}" for i in bodies if best[i] in ON_LATTICES)
            if names:
                text = (
                    f"{names}: below a loaded face the last two layers bear 0.77 and 1.49 of a traction, displacements "
                    'err by 1 to 7 %; method.weights = "best" has neither'
                )
                notes.append(Note("loaded-faces", text))
        return notes

    def ignored_keys(self, scene: Any, bodies: Iterable[int]) -> frozenset[str]:
        """Keys of kernels where no body has a kernel, and of meshes where no body has a mesh."""
        kinds = weights_of_bodies(self.pair_weights, self._with_bodies(scene, bodies))
        ignored = set()
        if not {"kernel", "closure"} & set(kinds):
            ignored |= {"kernel", "smoothing"}
        if "mesh" not in kinds:
            ignored.add("stabilisation")
        return frozenset(ignored)

    def choices(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """A note on the default weights of explicit motions where the scene leaves them out."""
        weights = None if self.integrators(scene) & IMPLICIT else self._default_weights(scene, bodies).get("weights")
        if weights is None:
            return []
        reason = f"boxes of {RESOLVED} nodes or more along each axis have weights that close"
        if weights == "mesh":
            reason = "bodies from meshes have those of their elements"
        return [Note("chosen-weights", f"method.weights = {weights!r} unless stated, as {reason}")]

    def reach(self, spacing: np.ndarray) -> np.ndarray:
        """Support of the kernel, which bonds bodies whatever their weights."""
        return smoothing_kernel(self.kernel).support * self.smoothing * spacing

    def contact_distance(self, spacing: np.ndarray) -> np.ndarray:
        """The kernel's support where neighbours are found anew, else a spacing."""
        return np.maximum(self.reach(spacing), spacing) if self.reference == "updated" else spacing

    def bonding(self, scene: Any, bodies: Iterable[int]) -> list[bool]:
        """False for bodies with the weights of their mesh: these share nodes, are tied or in contact."""
        return [kind != "mesh" for kind in weights_of_bodies(self.pair_weights, self._with_bodies(scene, bodies))]

    def bonded_spacings(self, scene: Any) -> float:
        """Up to this ratio of spacings a kernel reaches the second layer of the other body."""
        return 2.5 if self.smoothing >= 1.3 else 1.25

    def bonded_moduli(self, scene: Any) -> float:
        """Gradients beside a bond are means of both bodies, so that layers of the stiff one oscillate in space, the
        more the greater the ratio of moduli."""
        return 10.0

    def contact_refused(self, scene: Any) -> str | None:
        return None

    def tie_refused(self, scene: Any) -> str | None:
        """Ties are linear in the displacement."""
        return None

    def substeps_refused(self) -> str | None:
        return SOLUTION if self.integrator in IMPLICIT else None

    def scene_faults(self, scene: Any) -> list[Detail]:
        return faults(self, scene)
