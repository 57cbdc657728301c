"""Total-Lagrangian SPH as a scene states it."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from parsolid.materials.declaration import SOFTENING, Phrase
from parsolid.methods.failure_fields import DAMAGE
from parsolid.methods.plastic_fields import (
    FLOW_FIELDS,
    PLASTIC_STATE,
    fields_of_no_body,
    flowing,
    temperatures_without_heat,
    total_lagrangian_faults,
)
from parsolid.methods.tlsph.body_weights import (
    ON_LATTICES,
    RESOLVED,
    best_is_confirmed,
    lattice_faults,
    no_mesh_weights,
    weights_of_bodies,
)
from parsolid.pairs.smoothing import kernel_names, smoothing_kernel
from parsolid.scene.base_model import Detail, NotNegative, Positive, reject
from parsolid.scene.codes import Note
from parsolid.scene.contact import of_model
from parsolid.scene.method_settings import KINETIC_OFFSET, STAGE_CHANGE, MassScaling, MethodSettings
from parsolid.scene.observed import NODAL_VON_MISES
from parsolid.scene.plasticity import faults_of_names
from parsolid.scene.validation_errors import NOTHING
from parsolid.solvers.petsc import missing_petsc

# keys of which a scene that states one has chosen its weights
_OF_WEIGHTS = {"kernel", "smoothing", "weights"}
# factor on the dissipation with weights of meshes, which need little, where a scene states none
MESH_DISSIPATION = 0.1
# what images at fixed planes do beyond what is adjoint, see `fixed_walls`
FIXED_WALLS = "fixed_wall_work"
# with what there is no motion
_IN_EQUILIBRIUM = "with equilibria instead of motion"
# integrators that solve for displacements, and what that means for others
_SOLVED = frozenset(("static", "implicit"))
# stabilisation of meshes in the plane
_IN_PLANE = 0.5
_SOLUTION = "with method.integrator = 'static' or 'implicit'"


class TotalLagrangianSPH(MethodSettings):
    """Upwind total-Lagrangian smoothed particle hydrodynamics (Lee et al.)."""

    system: ClassVar = "parsolid.methods.tlsph.system:TotalLagrangianSPH"
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
        "fixed",
        "roller",
        "antisymmetric",
        "velocity",
        "rotation",
        "displacement",
        "traction",
        "pressure",
        "spring",
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
        *(
            "integrator",
            "tolerance",
            "accuracy",
            "safety",
            "dissipation",
            "reconstruction",
            "maximum_step",
            "minimum_step",
        ),
    )
    kind: Literal["tlsph"]
    kernel: Literal[kernel_names()] = Field(  # type: ignore[valid-type]
        "wendland-c2", description="the smoothing kernel"
    )
    smoothing: float = Field(0.85, gt=0, le=30, description="smoothing length over particle spacing, h/dx, at most 30")
    integrator: Literal["ssp-rk3", "leapfrog", "static", "implicit"] = Field(
        "leapfrog",
        description='"leapfrog": one force evaluation a step, order 2; "ssp-rk3": three, order 3, as in the paper; '
        '"static": a sequence of equilibria, the time being the parameter of the loads; "implicit": motion, order 2, '
        "in steps that waves do not bound",
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
        description="factor on the Riemann dissipation, 0 = none; 1 unless given, 0.1 for bodies with the weights of "
        "their mesh",
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
    clamp_edges: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="part of their volume that nodes of boxes with weights in closed form do without where a fixed "
        "plane meets a free face, for the singular stress there (docs/tlsph.md)",
    )

    mass_scaling: MassScaling = None

    @property
    def prescribes(self) -> tuple[str, ...]:  # type: ignore[override]
        """Of a motion its velocity; of equilibria the displacement, too."""
        return ("velocity", "displacement") if self.integrator in _SOLVED else ("velocity",)

    @property
    def pair_weights(self) -> str:
        """What `weights` asks for."""
        return self.weights or "kernel"

    def integrators(self, scene: Any) -> set[str]:
        """That of this method and those of the stages of a scene."""
        return {self.integrator, *(one.method.get("integrator", "") for one in scene.stages)}

    def dissipation_of(self, weights: str) -> float:
        """The factor on the dissipation of bodies with pair weights of a kind."""
        if self.integrator in _SOLVED:
            return 0.0
        if self.dissipation is not None:
            return float(self.dissipation)
        return MESH_DISSIPATION if weights == "mesh" else 1.0

    @model_validator(mode="after")
    def _one_way_to_step(self) -> "TotalLagrangianSPH":
        own = {"leapfrog": ("safety", 0.9), "ssp-rk3": ("cfl", 0.7), **dict.fromkeys(_SOLVED, ("tolerance", 1e-8))}
        key, usual = own[self.integrator]
        others = [
            other for other in ("safety", "cfl", "tolerance") if other != key and getattr(self, other) is not None
        ]
        others += ["accuracy"] if self.accuracy is not None and self.integrator != "implicit" else []
        expected = f"no such key with the integrator {self.integrator!r}"
        if self.integrator in _SOLVED:
            others += ["dissipation"] if self.dissipation is not None else []
            others += [] if self.reconstruction else ["reconstruction"]
        reject(*(((other,), expected, getattr(self, other)) for other in others))
        if getattr(self, key) is None:
            # past the validation of an assignment, and not among what the scene states
            vars(self)[key] = usual
        return self

    @model_validator(mode="after")
    def _one_way_to_update(self) -> "TotalLagrangianSPH":
        ways = {name: getattr(self, name) for name in ("update_every", "update_when")}
        given = {name: value for name, value in ways.items() if value is not None}
        if self.reference == "fixed":
            reject(*(((name,), "no such key with the reference 'fixed'", value) for name, value in given.items()))
        elif len(given) != 1:
            reject(
                (("reference",), "one of update_every and update_when with 'updated'", ", ".join(given) or "neither")
            )
        elif self.pair_weights != "kernel":
            reject((("weights",), "'kernel' with the reference 'updated'", self.weights))
        return self

    def energy_terms(self, scene: Any, bodies: Iterable[int]) -> dict[str, int]:
        """Also what fixed planes give to bodies that have images there, and what leapfrog swings within a step."""
        terms, planes = super().energy_terms(scene, bodies), [one for one in scene.boundaries if one.kind == "fixed"]
        if "leapfrog" in self.integrators(scene):
            terms[KINETIC_OFFSET] = -1
        kinds = [self.integrator, *(one.method.get("integrator", "") for one in scene.stages)]
        changes = {("leapfrog", "implicit"), *((one, "static") for one in ("leapfrog", "implicit"))}
        if changes & set(pairwise(kinds)):
            terms[STAGE_CHANGE] = 1
        if any(scene.bodies[i].material.kind == "elastic-plastic" for i in bodies):
            terms |= {"plastic_work": 0, "riemann_heat": 0}
        kinds = weights_of_bodies(self.pair_weights, self._own(scene, bodies))
        with_images = any(kind not in (*ON_LATTICES, "mesh") for kind in kinds)
        images = with_images and any(one.plane is not None for one in planes)
        return terms | ({FIXED_WALLS: -1} if images else {})

    def defaults_for(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """Weights that fit the bodies, and what their elements resist in the plane (docs/tlsph.md)."""
        weights = self._weights_for(scene, bodies)
        if scene.dimension == 3 or "stabilisation" in self.model_fields_set:
            return weights
        own = self._own(scene, bodies)
        kinds = weights_of_bodies(weights.get("weights", self.pair_weights), own)
        flows = any(body.material.kind == "elastic-plastic" for body in own.bodies)
        return weights | ({"stabilisation": _IN_PLANE} if "mesh" in kinds and not flows else {})

    def _weights_for(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """Those of their elements for bodies from meshes, and for boxes weights that close where every example of the
        tables confirms them: of eight nodes or more along each axis that no bond joins, whatever they meet but tools
        with mass."""
        if self.integrator == "ssp-rk3" or self.reference == "updated" or _OF_WEIGHTS & self.model_fields_set:
            return {}
        if self.integrators(scene) & _SOLVED:
            return {"weights": "best"}
        own = self._own(scene, bodies)
        lattices = [i for i, body in enumerate(own.bodies) if body.shape.kind != "mesh"]
        meshes = len(lattices) < len(own.bodies)
        if meshes and no_mesh_weights(own) is not None:
            return {}
        # jumps that are not reconstructed take more of what is resolved with weights in closed form (docs/choosing.md)
        # a tool with mass and the light nodes of their faces oscillate by more than 1 % of the energy (test_free_tools)
        free_tools = any(tool.mass is not None for tool in scene.tools)
        if self.reconstruction and lattices and not free_tools and best_is_confirmed(own):
            return {"weights": "best"}
        return {"weights": "mesh"} if meshes else {}

    def _own(self, scene: Any, bodies: Iterable[int]) -> Any:
        """The scene with this method and its bodies alone."""
        return scene.model_copy(update={"method": self, "bodies": [scene.bodies[i] for i in bodies]})

    def notes(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """Faces that are loaded through weights which do not close, where others would; mass that is not told."""
        told = f"mass, and the weight that clamps bear, are told without {self.clamp_edges:g} of that of these edges"
        less = [Note("clamp-edges", f"method.clamp_edges: {told}")] if self.clamp_edges else []
        return self._notes_of_weights(scene, bodies) + less

    def ignored_keys(self, scene: Any, bodies: Iterable[int]) -> frozenset[str]:
        """What kernels are, where no weights are of one, and what is of meshes alone, where there are none."""
        kinds = weights_of_bodies(self.pair_weights, self._own(scene, bodies))
        of_kernels = () if any(kind in ("kernel", "closure") for kind in kinds) else ("kernel", "smoothing")
        return frozenset({*of_kernels, *(() if "mesh" in kinds else ("stabilisation",))})

    def choices(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """Weights, where the scene leaves them to its bodies."""
        if self.integrators(scene) & _SOLVED:
            return []
        usual = self._weights_for(scene, bodies)
        told = " and ".join(f"method.{key} = {value!r}" for key, value in usual.items())
        why = f"boxes of {RESOLVED} nodes or more along each axis have weights that close"
        if usual.get("weights") == "mesh":
            why = "bodies from meshes have those of their elements"
        return [Note("chosen-weights", f"{told} unless stated, as {why}")] if usual else []

    def _notes_of_weights(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        loaded = any(one.kind in ("traction", "pressure") for one in scene.boundaries)
        if (
            not loaded
            or self.pair_weights not in ("kernel", "mesh")
            or self.reference == "updated"
            or scene.methods is not None
        ):
            return []
        best = weights_of_bodies("best", scene)
        names = ", ".join(f"bodies.{i}" for i in bodies if best[i] in ON_LATTICES)
        of_kernel = (
            "below a loaded face the last two layers bear 0.77 and 1.49 of a traction, displacements err by 1 to 7 %"
        )
        text = f'{names}: {of_kernel}; method.weights = "best" has neither'
        return [Note("loaded-faces", text)] if names else []

    def reach(self, spacing: np.ndarray) -> np.ndarray:
        """That of the kernel, by which bodies are bonded whatever their own weights."""
        return smoothing_kernel(self.kernel).support * self.smoothing * spacing

    def contact_distance(self, spacing: np.ndarray) -> np.ndarray:
        """Where they act on one another, if neighbours are found anew."""
        return np.maximum(self.reach(spacing), spacing) if self.reference == "updated" else spacing

    def bonding(self, scene: Any, bodies: Iterable[int]) -> list[bool]:
        """Not those with the weights of their mesh, which share nodes, are tied or in contact."""
        return [kind != "mesh" for kind in weights_of_bodies(self.pair_weights, self._own(scene, bodies))]

    def bonded_spacings(self, scene: Any) -> float:
        """Kernels reach the second layer of the other body only so far; a long reach bears more."""
        return 2.5 if self.smoothing >= 1.3 else 1.25

    def bonded_moduli(self, scene: Any) -> float:
        """Gradients beside the bond are means of both bodies: layers of the stiff one are displaced in turns, the
        more the greater the ratio."""
        return 10.0

    def contact_refused(self, scene: Any) -> str | None:
        return None

    def tie_refused(self, scene: Any) -> str | None:
        """Ties are linear in the displacement."""
        return None

    def substeps_refused(self) -> str | None:
        return _SOLUTION if self.integrator in _SOLVED else None

    def scene_faults(self, scene: Any) -> list[Detail]:
        """What does not go together in a scene."""
        kinds = enumerate(boundary.kind for boundary in scene.boundaries if self.reference == "updated")
        expected = "'fixed' or 'roller' where the reference is updated"
        faults: list[Detail] = [
            (("boundaries", i, "kind"), expected, kind) for i, kind in kinds if kind == "antisymmetric"
        ]
        if self.integrator == "ssp-rk3" and (of_model(scene.contact, "kernel") or scene.tie or scene.tools):
            expected = "'leapfrog' with contact, tools and ties, whose forces are found once a step"
            faults.append((("method", "integrator"), expected, self.integrator))
        used = self.integrators(scene)
        solved = used <= _SOLVED | {""} or "implicit" in used
        faults += self.faults_of_scaling(scene, "but where waves bound the steps" if solved else None)
        faults += lattice_faults(self.pair_weights, scene) + self._grading_faults(scene) + self._plastic_faults(scene)
        if self.integrator == "ssp-rk3" and any(
            SOFTENING in getattr(body.material, "ledger_terms", {}) for body in scene.bodies
        ):
            expected = "'leapfrog' with state variables of laws, which change once a step"
            faults.append((("method", "integrator"), expected, self.integrator))
        refused = no_mesh_weights(scene) if self.pair_weights == "mesh" else None
        faults += [refused] if refused is not None else []
        return faults + self._edge_faults(scene) + self._faults_of_stages(scene) + self._faults_of_equilibria(scene)

    def _faults_of_stages(self, scene: Any) -> list[Detail]:
        """Stages whose integrators keep other fields, or that want other sums over pairs than those of the set-up."""
        stages, faults = [one for one in scene.stages if "integrator" in one.method], list[Detail]()
        places = [("method",), *(("stages", i, "method") for i in range(len(stages)))]
        stated = [{key: getattr(self, key) for key in self.model_fields_set}, *(one.method for one in stages)]
        moving = [pair for pair in zip(places, stated) if pair[1].get("integrator", "leapfrog") not in _SOLVED]
        for place, one in moving if stages else ():
            if one.get("integrator") == "ssp-rk3":
                faults.append(
                    ((*place, "integrator"), "one of 'leapfrog', 'static', 'implicit' with [[stages]]", "ssp-rk3")
                )
            first_place, first = moving[0]
            for key in ("dissipation", "reconstruction"):
                if one.get(key) != first.get(key):
                    expected = f"as in {'.'.join(map(str, first_place))}, {first.get(key, 'nothing')}"
                    faults.append(((*place, key), expected, one.get(key, NOTHING)))
        return faults

    def _faults_of_equilibria(self, scene: Any) -> list[Detail]:
        """What a sequence of equilibria does not know, and what it alone knows."""
        moved = enumerate(one.kind for one in scene.boundaries)
        if not self.integrators(scene) & _SOLVED:
            unused: list[Detail] = [
                (("method", key), f"no such key but {_SOLUTION}", getattr(self, key))
                for key in ("linear_solver", "petsc_options")
                if getattr(self, key) not in ("embedded", "")
            ]
            expected = "'velocity' or 'rotation', by which a motion is prescribed, or method.integrator = 'static'"
            motions: list[Detail] = [(("boundaries", i, "kind"), expected, k) for i, k in moved if k == "displacement"]
            return motions + unused
        key, faults = ("method", "integrator"), self._faults_of_petsc()
        for i, tool in enumerate(scene.tools):
            if tool.mass is not None:
                faults.append((("tools", i, "mass"), f"no such key {_SOLUTION}, but a motion or none", tool.mass))
        if self.reference == "updated":
            faults.append((("method", "reference"), f"'fixed' {_SOLUTION}", self.reference))
        if scene.methods is not None and len(scene.methods) > 1:
            faults.append((key, "'leapfrog' beside other methods", self.integrator))
        if scene.loads.manufactured:
            faults.append((("loads", "manufactured"), f"no such key {_SOLUTION}", True))
        expected = f"nodes of meshes ('mesh') and of boxes ('cells', 'fourth-order') {_SOLUTION}"
        for i, kind in enumerate(weights_of_bodies(self.pair_weights, scene)):
            if kind != "mesh" and (kind not in ON_LATTICES or scene.bodies[i].shape.kind != "box"):
                faults.append((("method", "weights"), expected, Phrase(f"{kind!r} for bodies.{i}")))
        for i, body in enumerate(scene.bodies):
            place = ("bodies", i, "material")
            implicit = "implicit" in self.integrators(scene)
            if implicit and body.material.kind == "elastic-plastic":
                expected = "a hyperelastic law with method.integrator = 'implicit'"
                faults.append(((*place, "kind"), expected, body.material.kind))
            elif implicit and body.material.branches:
                found = Phrase(f"{len(body.material.branches)}")
                faults.append(((*place, "branches"), "none with method.integrator = 'implicit'", found))
            elif getattr(body.material, "failure", None) is not None:
                faults.append(((*place, "failure"), f"no such key {_SOLUTION}", Phrase("one")))
            if body.material.kind != "elastic-plastic" and getattr(body.material, "ledger_terms", None):
                expected = f"a law whose only memory is flow or branches {_SOLUTION}"
                faults.append(((*place, "kind"), expected, Phrase(f"{body.material.kind!r} with state variables")))
            flow: Any = getattr(body.material, "parts", {}).get("flow_stress")
            if getattr(flow, "dilation_angle", None) != getattr(flow, "friction_angle", None):
                expected = f"{flow.friction_angle:g}, the friction_angle, {_SOLUTION}: their tangent is symmetric"
                faults.append(((*place, "flow_stress", "dilation_angle"), expected, flow.dilation_angle))
            if body.velocity is not None and self.integrator == "static":
                faults.append((("bodies", i, "velocity"), f"no such key {_IN_EQUILIBRIUM}", Phrase("one")))
        for i, one in enumerate(scene.boundaries):
            if one.kind == "spring" and one.damping > 0.0:
                faults.append((("boundaries", i, "damping"), f"no such key {_SOLUTION}", one.damping))
        for i, state in enumerate(scene.initial):
            if self.integrator != "static":
                continue
            if state.velocity is not None:
                faults.append((("initial", i, "velocity"), f"no such key {_IN_EQUILIBRIUM}", Phrase("one")))
            elif "velocity" in (state.fields or ()):
                faults.append((("initial", i, "fields"), f"no velocity {_IN_EQUILIBRIUM}", Phrase("one")))
        return faults

    def _faults_of_petsc(self) -> list[Detail]:
        """PETSc that is not there, and options without it."""
        if self.linear_solver == "petsc":
            found = missing_petsc()
            expected = "petsc4py on the MPI of mpi4py (pip install 'parsolid[petsc]') for 'petsc'"
            return [] if found is None else [(("method", "linear_solver"), expected, Phrase(found))]
        expected = "no such key without linear_solver = 'petsc'"
        return [(("method", "petsc_options"), expected, self.petsc_options)] if self.petsc_options else []

    def _plastic_faults(self, scene: Any) -> list[Detail]:
        """What elastic-plastic bodies do not bear, and what is to be shown of them where there are none."""
        faults, plastic = fields_of_no_body(scene) + faults_of_names(scene), flowing(scene)
        faults += temperatures_without_heat(scene)
        if plastic and self.integrator == "ssp-rk3":
            expected = "'leapfrog' with elastic-plastic bodies, whose flow is found once a step"
            faults.append((("method", "integrator"), expected, self.integrator))
        for i in plastic:
            faults += total_lagrangian_faults(scene.bodies[i].material, ("bodies", i, "material"))
        for i, state in enumerate(scene.initial):
            meant = {state.body} if state.body is not None else {body.name for body in scene.bodies}
            if state.of("stress") is not None and meant & {scene.bodies[k].name for k in plastic}:
                faults.append((("initial", i, "stress"), "no such key of bodies that flow", Phrase("a stress")))
        return faults

    def _edge_faults(self, scene: Any) -> list[Detail]:
        """Edges of clamps where no box has weights in closed form."""
        kinds = weights_of_bodies(self.pair_weights, scene)
        boxes = [kind in ON_LATTICES and body.shape.kind == "box" for kind, body in zip(kinds, scene.bodies)]
        if not self.clamp_edges or any(boxes):
            return []
        expected = "0 unless a box has weights in closed form"
        return [(("method", "clamp_edges"), expected, self.clamp_edges)]

    def _grading_faults(self, scene: Any) -> list[Detail]:
        """Graded bodies without weights in closed form, with a step that knows one spacing only, or in contact, which
        does so, too."""
        kinds = weights_of_bodies(self.pair_weights, scene)
        graded = [i for i, body in enumerate(scene.bodies) if body.grading is not None]
        expected = "weights in closed form, method.integrator = 'leapfrog' and no contact where bodies are graded"
        meets = bool(scene.contact or scene.tie or scene.tools)
        others = [i for i in graded if meets or kinds[i] not in ON_LATTICES or self.integrator == "ssp-rk3"]
        found = Phrase(f"{self.pair_weights!r} weights with {self.integrator!r}{' and contact' if meets else ''}")
        return [(("bodies", i, "grading"), expected, found) for i in others]
