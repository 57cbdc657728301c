"""Known orders of convergence of the methods, by kind of quantity.

They hold for smooth motions (docs/studies.md, docs/mpm.md, docs/peridynamics.md). Contact, fracture
and plastic flow, and extremes over particles, lower them to REDUCED.
"""

from typing import Any

from parsolid.scene.observation import ENERGIES
from parsolid.scene.systems import settings_of_stages
from parsolid.simulation.ledger import terms_of

ENERGY, MOTION, STRESS, HEAT = "energy", "motion", "stress", "heat"
INTEGRAL, EXTREME, REACTION, MICRO = "integral", "extreme", "reaction", "micro"
# orders in the spacing; in peridynamics the horizon shrinks with the spacing, and its surfaces are of first order
_SPACING: dict[str, dict[str, float]] = {
    "tlsph": {ENERGY: 2.0, MOTION: 2.0, STRESS: 2.0, INTEGRAL: 2.0},
    "ulsph": {ENERGY: 1.0, MOTION: 1.0, STRESS: 1.0, HEAT: 2.0, INTEGRAL: 2.0, MICRO: 2.0},
    "mpm": {ENERGY: 2.0, MOTION: 2.0, STRESS: 1.0, HEAT: 2.0, INTEGRAL: 2.0},
    "peridynamics": {ENERGY: 1.0, MOTION: 1.0, STRESS: 1.0, INTEGRAL: 1.0},
}
# order of reactions, of extremes over particles, of stress on meshes, and of motions that are not smooth
REDUCED = 1.0
# orders in the time step, by integrator
_STEP = {
    "ssp-rk3": 3.0,
    "leapfrog": 2.0,
    "implicit": 2.0,
    "explicit": 2.0,
    "quasi-static": 1.0,
    "mpm": 1.0,
    "ulsph": 2.0,
}

# words in the names of columns, by kind of quantity
_OF_STRESS, _OF_HEAT = ("stress", "pressure", "mises"), ("temperature", "heat")
# plastic flow with micro-inertia, whose waves are of second order or higher (docs/ulsph.md)
_OF_MICRO = ("plastic_strain", "micro_rate", "micro_stress")
_OF_INTEGRALS = ("momentum", "work", "mass", "energy", "entropy", "dissipation")


def kind_of(column: str, scene: Any) -> str:
    """The kind of quantity of a column of the history."""
    if column in ENERGIES or column in terms_of(scene):
        return ENERGY
    name, _, quantity = column.partition(".")
    probe = next((one for one in scene.probes if one.name == name), None)
    if probe is None:
        return REACTION
    if probe.quantity is not None and any(word in quantity for word in ("maximum", "minimum", "bounds")):
        return EXTREME
    if probe.quantity is not None and any(word in quantity for word in _OF_INTEGRALS):
        return INTEGRAL
    if any(word in quantity for word in _OF_MICRO):
        return MICRO
    if any(word in quantity for word in _OF_STRESS):
        return STRESS
    return HEAT if any(word in quantity for word in _OF_HEAT) else MOTION


def reduced_regularity(scene: Any) -> str | None:
    """Why the motion of a scene is not smooth, in words; None if it is."""
    if scene.contact or scene.tools:
        return "contact"
    if any(getattr(system.settings, "damage", None) for system in scene.systems):
        return "fracture"
    kinds = {body.material.kind for body in scene.bodies}
    # a system without motion conducts heat alone
    if "elastic-plastic" in kinds and any(getattr(system.settings, "motion", True) for system in scene.systems):
        return "plastic flow"
    # micro waves have kinks after an impact, and where plastic flow is held at a plane
    held = {boundary.kind for boundary in scene.boundaries} & {"fixed", "wall", "traction", "micro-hard"}
    return "plastic flow" if "micro-inertia" in kinds and (held or len(scene.bodies) > 1) else None


def without_order(scene: Any) -> str | None:
    """Why errors of a scene's motion do not fall with the spacing, in words; None if they do (docs/mpm.md)."""
    settings = [system.settings for system in scene.systems if system.settings.kind == "mpm"]
    if any(one.basis == "linear" and one.motion for one in settings):
        return "the linear basis does not converge where particles cross cells (quadratic-spline does)"
    return None


def order_in_spacing(column: str, scene: Any) -> float:
    """The known order of a column in the spacing; 0 if it does not converge."""
    kind = kind_of(column, scene)
    if kind != HEAT and without_order(scene):
        return 0.0
    if kind in (EXTREME, REACTION) or reduced_regularity(scene):
        return REDUCED
    if kind == STRESS and has_meshes(scene):
        return REDUCED
    return min(_SPACING.get(system.settings.kind, {}).get(kind, REDUCED) for system in scene.systems)


def has_meshes(scene: Any) -> bool:
    """Whether a body is a mesh."""
    return any(body.shape.kind == "mesh" for body in scene.bodies)


def order_in_time(scene: Any) -> float:
    """The lowest order in the time step of a scene's methods and stages."""
    orders = []
    stages = settings_of_stages(scene)[1:] if scene.stages else []
    for settings in [*(system.settings for system in scene.systems), *stages]:
        solution = getattr(getattr(settings, "solution", None), "kind", None)
        orders.append(_STEP.get(solution or getattr(settings, "integrator", settings.kind), 1.0))
    return min(orders)


def step_is_stated(scene: Any) -> bool:
    """Whether the time step is stated and does not follow the spacing."""
    return any(getattr(getattr(s.settings, "solution", None), "kind", None) == "quasi-static" for s in scene.systems)
