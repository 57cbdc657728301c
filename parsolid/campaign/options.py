"""What may be chosen for a scene: method, kernel, horizon, weights, integrator and so on, one change from it each."""

from dataclasses import dataclass
from typing import Any

from parsolid.campaign.coarsening import lattices_of, methods_of
from parsolid.pairs.smoothing import kernel_names
from parsolid.particles.fillings import filling_of
from parsolid.scene import Scene, SceneError
from parsolid.scene.methods import method_kinds
from parsolid.scene.validation_errors import describe

# cells of a grid over the spacing of particles, where a scene comes from a method without one
_CELLS = 2.0
NEW, _HALF, _LONGER = "method", 0.5, 1.25
# axis -> key of the method's table and its values, by method
AXES: dict[str, dict[str, tuple[str, tuple[Any, ...]]]] = {
    "tlsph": {
        "kernel": ("kernel", kernel_names()),
        "h/dx": ("smoothing", (0.7, 0.85, 1.0, 1.3)),
        "weights": ("weights", ("kernel", "closure", "cells", "fourth-order", "best")),
        "integrator": ("integrator", ("ssp-rk3", "leapfrog")),
        "dissipation": ("dissipation", (0.0, 0.3, 1.0)),
        "reconstruction": ("reconstruction", (True, False)),
    },
    "ulsph": {
        "kernel": ("kernel", kernel_names()),
        "h/dx": ("smoothing", (1.1, 1.3, 1.6)),
        "pair correction": ("gradient_correction", (True, False)),
        "dissipation": ("viscosity", (False, {"linear": 0.2, "quadratic": 1.0}, {"linear": 1.0, "quadratic": 1.0})),
    },
    "mpm": {
        "basis": ("basis", ("linear", "ugimp", "quadratic-spline", "cubic-spline")),
        "transfer": ("transfer", ("flip", "apic", "aflip")),
        "order": ("order", ("usl", "musl")),
        "dissipation": ("viscosity", ({"linear": 0.0, "quadratic": 0.0}, {"linear": 0.2, "quadratic": 2.0})),
    },
    "peridynamics": {
        "horizon": ("horizon_ratio", (2.0, 3.0, 4.0, 6.0)),
        "weights": ("influence", ("constant", "linear", "cubic-spline")),
        "stabilisation": ("stabilisation", ({"kind": "none"}, {"kind": "shear-scaled"})),
        "traction": ("traction", ("consistent", "single-layer", "horizon")),
    },
}
# of equilibrium, in the table of the solution
_EQUILIBRIUM = {"solver": ("conjugate-gradients", "dynamic-relaxation"), "extrapolation": (0, 2)}
# what a method says of the solid rather than of its discretisation: another method has to say it as well
_OF_THE_SOLID = ("geometry", "plane", "damage", "pre_cracks", "initial_state", "motion", "contact")
# keys that belong to a value of another one
_GOES_WITH = {"integrator": ("cfl", "safety")}
_STEPS = ("cfl", "safety", "step")


@dataclass(frozen=True)
class Option:
    """Changes of a method's table: (axis, key, value) each; "" for the scene as it stands."""

    changes: tuple[tuple[str, str, Any], ...] = ()

    @property
    def name(self) -> str:
        """What it is called: "integrator leapfrog, weights best"."""
        return ", ".join(f"{axis} {_in_words(value)}" for axis, _, value in self.changes) or "as the scene"

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes along which it differs from the scene."""
        return tuple(axis for axis, _, _ in self.changes)

    def together(self, other: "Option") -> "Option":
        """Both changes."""
        return Option(self.changes + other.changes)

    def applied(self, level: Scene) -> dict[str, Any]:
        """The tables of a scene with the changes. Raises NotCoarsened where a method needs a lattice of a mesh,
        SceneError where changes do not go together or another method cannot say what the scene's method says.
        """
        tables = level.resolved()
        for axis, key, value in self.changes:
            method = methods_of(tables)[0]
            if axis == NEW:
                tables = _with_method(tables, value, level)
                continue
            inner = key.startswith("solution.")
            name = key.removeprefix("solution.")
            table = method["solution"] if inner else method
            table = {k: v for k, v in table.items() if k not in _GOES_WITH.get(name, ())}
            if axis == "step" and name not in table:
                raise SceneError([f"method.{name}: expected a step that is stated so, found another integrator"])
            table[name] = table[name] * value if axis == "step" else value
            tables = tables | {"method": method | {"solution": table} if inner else table}
        return tables


def _in_words(value: Any) -> str:
    if isinstance(value, dict):
        return " ".join(str(v) if k == "kind" else f"{k} {v:g}" for k, v in value.items())
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _with_method(tables: dict[str, Any], kind: str, level: Scene) -> dict[str, Any]:
    """The scene in another method with its usual settings; cells of a grid are twice the spacing, and particles that
    stood on nodes of a lattice stand in its cells.
    """
    old = methods_of(tables)[0]
    settings = level.systems[0].settings
    for key in _OF_THE_SOLID:
        field = type(settings).model_fields.get(key)
        usual = None if field is None else field.get_default(call_default_factory=True)
        if getattr(settings, key, None) != usual:
            raise SceneError([f"method.{key}: expected to be as usual for another method, found {describe(old[key])}"])
    lattices, bodies = lattices_of(level), [dict(body) for body in tables["bodies"]]
    method: dict[str, Any] = {"kind": kind}
    if kind == "mpm":
        fillings = [filling_of(body, level.dimension) for body in level.bodies]
        volumes = [float(one.piece(0, one.count).volume.sum()) / one.count for one in fillings]
        method["cell"] = _CELLS * min(volumes) ** (1.0 / level.dimension)
    for lattice in lattices:
        body = bodies[lattice.number]
        if kind in ("mpm", "ulsph") and any(lattice.ends):
            body.pop("spacing", None)
            body |= {"particles": list(lattice.intervals), "placement": "cells"}
    viscosity = old.get("viscosity")
    if kind in ("mpm", "ulsph") and isinstance(viscosity, dict):
        method["viscosity"] = {key: viscosity[key] for key in ("linear", "quadratic")}
    return {key: table for key, table in tables.items() if key != "methods"} | {"method": method, "bodies": bodies}


def options_of(scene: Scene, axes: list[str]) -> list[Option]:
    """One change from a scene each, along the axes that are named, or all."""
    settings: Any = scene.systems[0].settings
    own = settings.model_dump()
    if settings.kind == "tlsph":
        own["weights"] = settings.pair_weights
        own["dissipation"] = settings.dissipation_of(settings.pair_weights)
    found = []
    for axis, (key, values) in AXES[settings.kind].items():
        for value in values:
            now = own.get(key)
            # of tables, what the value says
            is_table = isinstance(now, dict) and isinstance(value, dict)
            if not (all(now.get(k) == one for k, one in value.items()) if is_table else now == value):
                found.append((axis, key, value))
    solution = own.get("solution") or {}
    if solution.get("kind") == "quasi-static":
        for key, values in _EQUILIBRIUM.items():
            found += [(key, f"solution.{key}", value) for value in values if solution[key] != value]
    step = next((key for key in _STEPS if own.get(key) is not None), None)
    step = step or next((f"solution.{key}" for key in _STEPS if solution.get(key) is not None), None)
    if step is not None:
        found += [("step", step, share) for share in (_HALF, _LONGER if step in ("cfl", "safety") else 2.0)]
    found += [(NEW, "kind", kind) for kind in method_kinds() if kind != settings.kind]
    return [Option((change,)) for change in found if not axes or change[0] in axes]
