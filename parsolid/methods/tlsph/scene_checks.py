"""Checks of a scene whose method is total-Lagrangian SPH: settings, materials and boundaries that do not go together.

Each check returns its faults as (location of the key, expected, found).
"""

from typing import TYPE_CHECKING, Any

from parsolid.materials.declaration import SOFTENING, Phrase
from parsolid.methods.plastic_fields import (
    fields_of_no_body,
    flowing,
    temperatures_without_heat,
    total_lagrangian_faults,
)
from parsolid.methods.tlsph.body_weights import ON_LATTICES, lattice_faults, no_mesh_weights, weights_of_bodies
from parsolid.scene.base_model import Detail
from parsolid.scene.contact import of_model
from parsolid.scene.plasticity import faults_of_names
from parsolid.scene.validation_errors import NOTHING
from parsolid.solvers.petsc import missing_petsc

if TYPE_CHECKING:
    from parsolid.methods.tlsph.settings import TotalLagrangianSPH

# integrators that solve equations for the displacements of a step
IMPLICIT = frozenset(("static", "implicit"))
SOLUTION = "with method.integrator = 'static' or 'implicit'"
_INTEGRATOR = ("method", "integrator")


def faults(method: "TotalLagrangianSPH", scene: Any) -> list[Detail]:
    used = method.integrators(scene)
    waves_bound_the_step = not (used <= IMPLICIT | {""} or "implicit" in used)
    found = method.faults_of_scaling(scene, None if waves_bound_the_step else "but where waves bound the steps")
    if method.integrator == "ssp-rk3":
        found += _ssp_rk3(method, scene)
    found += _weights(method, scene)
    if scene.stages:
        found += _stages(method, scene)
    if used & IMPLICIT:
        found += _petsc(method) + _solved_scene(method, scene) + _solved_materials(method, scene)
        found += _solved_boundaries(scene)
        if method.integrator == "static":
            found += _velocities_in_equilibrium(scene)
    else:
        found += _keys_of_solutions(method, scene)
    return found + _plasticity(scene)


def _ssp_rk3(method: "TotalLagrangianSPH", scene: Any) -> list[Detail]:
    """What SSP-RK3 does not integrate: what changes or acts once a step, and weights in closed form."""
    reasons = []
    if set(weights_of_bodies(method.pair_weights, scene)) & set(ON_LATTICES):
        reasons.append(f"weights in closed form, as with method.weights = {method.pair_weights!r}")
    if of_model(scene.contact, "kernel") or scene.tie or scene.tools:
        reasons.append("contact, tools and ties, whose forces are found once a step")
    if any(SOFTENING in getattr(body.material, "ledger_terms", {}) for body in scene.bodies):
        reasons.append("state variables of laws, which change once a step")
    if flowing(scene):
        reasons.append("elastic-plastic bodies, whose flow is found once a step")
    return [(_INTEGRATOR, f"'leapfrog' with {reason}", method.integrator) for reason in reasons]


def _weights(method: "TotalLagrangianSPH", scene: Any) -> list[Detail]:
    """Bodies, supports and contact that do not go with the pair weights, or with an updated reference."""
    found = lattice_faults(method.pair_weights, scene)
    kinds = weights_of_bodies(method.pair_weights, scene)
    in_contact = bool(scene.contact or scene.tie or scene.tools)
    for i, body in enumerate(scene.bodies):
        if body.grading is not None and (in_contact or kinds[i] not in ON_LATTICES):
            expected = "weights in closed form and no contact where bodies are graded"
            phrase = f"{method.pair_weights!r} weights{' and contact' if in_contact else ''}"
            found.append((("bodies", i, "grading"), expected, Phrase(phrase)))
    if method.pair_weights == "mesh":
        fault = no_mesh_weights(scene)
        if fault is not None:
            found.append(fault)
    boxes = [kind in ON_LATTICES and body.shape.kind == "box" for kind, body in zip(kinds, scene.bodies)]
    if method.clamp_edges and not any(boxes):
        found.append((("method", "clamp_edges"), "0 unless a box has weights in closed form", method.clamp_edges))
    if method.reference == "updated":
        for i, boundary in enumerate(scene.boundaries):
            if boundary.kind == "antisymmetric":
                expected = "'fixed' or 'roller' where the reference is updated"
                found.append((("boundaries", i, "kind"), expected, boundary.kind))
    return found


def _stages(method: "TotalLagrangianSPH", scene: Any) -> list[Detail]:
    """Stages in motion must have one integrator, dissipation and reconstruction: fields and pair sums of these are
    chosen at set-up."""
    tables: list[tuple[tuple[str | int, ...], dict[str, Any]]] = [
        (("method",), {key: getattr(method, key) for key in method.model_fields_set})
    ]
    for i, stage in enumerate(scene.stages):
        if "integrator" in stage.method:
            tables.append((("stages", i, "method"), stage.method))
    moving = [(place, table) for place, table in tables if table.get("integrator", "leapfrog") not in IMPLICIT]
    found: list[Detail] = []
    for place, table in moving:
        if table.get("integrator") == "ssp-rk3":
            expected = "one of 'leapfrog', 'static', 'implicit' with [[stages]]"
            found.append(((*place, "integrator"), expected, "ssp-rk3"))
        first_place, first = moving[0]
        for key in ("dissipation", "reconstruction"):
            if table.get(key) != first.get(key):
                expected = f"as in {'.'.join(map(str, first_place))}, {first.get(key, 'nothing')}"
                found.append(((*place, key), expected, table.get(key, NOTHING)))
    return found


def _keys_of_solutions(method: "TotalLagrangianSPH", scene: Any) -> list[Detail]:
    """Keys that only static and implicit solutions have, in a scene of explicit motion."""
    expected = "'velocity' or 'rotation', by which a motion is prescribed, or method.integrator = 'static'"
    found: list[Detail] = [
        (("boundaries", i, "kind"), expected, boundary.kind)
        for i, boundary in enumerate(scene.boundaries)
        if boundary.kind == "displacement"
    ]
    if method.linear_solver != "embedded":
        found.append((("method", "linear_solver"), f"no such key but {SOLUTION}", method.linear_solver))
    if method.petsc_options:
        found.append((("method", "petsc_options"), f"no such key but {SOLUTION}", method.petsc_options))
    return found


def _petsc(method: "TotalLagrangianSPH") -> list[Detail]:
    """PETSc where it cannot be imported, and its options without it."""
    if method.linear_solver == "petsc":
        missing = missing_petsc()
        if missing is not None:
            expected = "petsc4py on the MPI of mpi4py (pip install 'parsolid[petsc]') for 'petsc'"
            return [(("method", "linear_solver"), expected, Phrase(missing))]
    elif method.petsc_options:
        expected = "no such key without linear_solver = 'petsc'"
        return [(("method", "petsc_options"), expected, method.petsc_options)]
    return []


def _solved_scene(method: "TotalLagrangianSPH", scene: Any) -> list[Detail]:
    """Tables of a scene that static and implicit solutions do not take."""
    found: list[Detail] = []
    for i, tool in enumerate(scene.tools):
        if tool.mass is not None:
            found.append((("tools", i, "mass"), f"no such key {SOLUTION}, but a motion or none", tool.mass))
    if method.reference == "updated":
        found.append((("method", "reference"), f"'fixed' {SOLUTION}", method.reference))
    if scene.methods is not None and len(scene.methods) > 1:
        found.append((_INTEGRATOR, "'leapfrog' beside other methods", method.integrator))
    if scene.loads.manufactured:
        found.append((("loads", "manufactured"), f"no such key {SOLUTION}", True))
    expected = f"nodes of meshes ('mesh') and of boxes ('cells', 'fourth-order') {SOLUTION}"
    for i, kind in enumerate(weights_of_bodies(method.pair_weights, scene)):
        if kind != "mesh" and (kind not in ON_LATTICES or scene.bodies[i].shape.kind != "box"):
            found.append((("method", "weights"), expected, Phrase(f"{kind!r} for bodies.{i}")))
    return found


def _solved_materials(method: "TotalLagrangianSPH", scene: Any) -> list[Detail]:
    """Laws without a symmetric tangent, or with a memory that static and implicit solutions do not keep."""
    found: list[Detail] = []
    implicit = "implicit" in method.integrators(scene)
    for i, body in enumerate(scene.bodies):
        place, material = ("bodies", i, "material"), body.material
        flows = material.kind == "elastic-plastic"
        if implicit and flows:
            expected = "a hyperelastic law with method.integrator = 'implicit'"
            found.append(((*place, "kind"), expected, material.kind))
        elif implicit and material.branches:
            expected = "none with method.integrator = 'implicit'"
            found.append(((*place, "branches"), expected, Phrase(f"{len(material.branches)}")))
        elif getattr(material, "failure", None) is not None:
            found.append(((*place, "failure"), f"no such key {SOLUTION}", Phrase("one")))
        if not flows and getattr(material, "ledger_terms", None):
            expected = f"a law whose only memory is flow or branches {SOLUTION}"
            found.append(((*place, "kind"), expected, Phrase(f"{material.kind!r} with state variables")))
        flow: Any = getattr(material, "parts", {}).get("flow_stress")
        if getattr(flow, "dilation_angle", None) != getattr(flow, "friction_angle", None):
            expected = f"{flow.friction_angle:g}, the friction_angle, {SOLUTION}: their tangent is symmetric"
            found.append(((*place, "flow_stress", "dilation_angle"), expected, flow.dilation_angle))
    return found


def _solved_boundaries(scene: Any) -> list[Detail]:
    """Dashpots, whose forces static and implicit solutions do not have."""
    return [
        (("boundaries", i, "damping"), f"no such key {SOLUTION}", boundary.damping)
        for i, boundary in enumerate(scene.boundaries)
        if boundary.kind == "spring" and boundary.damping > 0.0
    ]


def _velocities_in_equilibrium(scene: Any) -> list[Detail]:
    """Initial velocities where a run is a sequence of equilibria."""
    instead, found = "with equilibria instead of motion", list[Detail]()
    for i, body in enumerate(scene.bodies):
        if body.velocity is not None:
            found.append((("bodies", i, "velocity"), f"no such key {instead}", Phrase("one")))
    for i, state in enumerate(scene.initial):
        if state.velocity is not None:
            found.append((("initial", i, "velocity"), f"no such key {instead}", Phrase("one")))
        elif "velocity" in (state.fields or ()):
            found.append((("initial", i, "fields"), f"no velocity {instead}", Phrase("one")))
    return found


def _plasticity(scene: Any) -> list[Detail]:
    """Faults of elastic-plastic bodies, and plastic fields that are asked for where no body has them."""
    found = fields_of_no_body(scene) + faults_of_names(scene) + temperatures_without_heat(scene)
    plastic = flowing(scene)
    for i in plastic:
        found += total_lagrangian_faults(scene.bodies[i].material, ("bodies", i, "material"))
    plastic_names = {scene.bodies[i].name for i in plastic}
    for i, state in enumerate(scene.initial):
        names = {state.body} if state.body is not None else {body.name for body in scene.bodies}
        if state.of("stress") is not None and names & plastic_names:
            found.append((("initial", i, "stress"), "no such key of bodies that flow", Phrase("a stress")))
    return found
