"""Options of a scene that `pareto` compares: each changes one setting of the method, or the method itself."""

from dataclasses import dataclass
from typing import Any

from parsolid.campaign.coarsening import lattices_of, methods_of
from parsolid.pairs.smoothing import kernel_names
from parsolid.particles.fillings import filling_of
from parsolid.scene import Scene, SceneError
from parsolid.scene.methods import method_kinds
from parsolid.scene.validation_errors import describe

# cell of a grid over the particle spacing, for a scene of a method without a grid
_CELLS = 2.0
# axis of another method; factors on the time step
METHOD, _HALF, _LONGER = "method", 0.5, 1.25
# method -> axis -> key of the method's table and its values
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
# keys of the solution of an equilibrium
_EQUILIBRIUM = {"solver": ("conjugate-gradients", "dynamic-relaxation"), "extrapolation": (0, 2)}
# keys of a method that describe the solid and not its discretisation: another method would lose them
_OF_THE_SOLID = ("geometry", "plane", "damage", "pre_cracks", "initial_state", "motion", "contact")
# keys that are removed with the value of another one
_GOES_WITH = {"integrator": ("cfl", "safety")}
_STEPS = ("cfl", "safety", "step")


@dataclass(frozen=True)
class Option:
    """Changes (axis, key, value) of a method's table; no change for the scene as it is."""

    changes: tuple[tuple[str, str, Any], ...] = ()

    @property
    def name(self) -> str:
        """The changes in words: "integrator leapfrog, weights best"."""
        return ", ".join(f"{axis} {_in_words(value)}" for axis, _, value in self.changes) or "as the scene"

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes along which it differs from the scene."""
        return tuple(axis for axis, _, _ in self.changes)

    def applied(self, level: Scene) -> dict[str, Any]:
        """The tables of a scene with the changes.

        Raises NotCoarsened if another method needs a lattice of a mesh, SceneError if changes exclude each other or
        another method cannot have the settings of the solid.
        """
        tables = level.resolved()
        for axis, key, value in self.changes:
            method = methods_of(tables)[0]
            if axis == METHOD:
                tables = _with_method(tables, value, level)
                continue
            in_solution = key.startswith("solution.")
            name = key.removeprefix("solution.")
            table = method["solution"] if in_solution else method
            table = {k: v for k, v in table.items() if k not in _GOES_WITH.get(name, ())}
            if axis == "step" and name not in table:
                raise SceneError([f"method.{name}: expected this key of the step, found an integrator without it"])
            table[name] = table[name] * value if axis == "step" else value
            tables = tables | {"method": method | {"solution": table} if in_solution else table}
        return tables


def _in_words(value: Any) -> str:
    if isinstance(value, dict):
        return " ".join(str(v) if k == "kind" else f"{k} {v:g}" for k, v in value.items())
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _with_method(tables: dict[str, Any], kind: str, level: Scene) -> dict[str, Any]:
    """The tables with another method and its defaults. Cells of a grid are twice the spacing; for `mpm` and `ulsph`
    particles on nodes of a lattice move into its cells.
    """
    old = methods_of(tables)[0]
    settings = level.systems[0].settings
    for key in _OF_THE_SOLID:
        field = type(settings).model_fields.get(key)
        default = None if field is None else field.get_default(call_default_factory=True)
        if getattr(settings, key, None) != default:
            raise SceneError([f"method.{key}: expected the default for another method, found {describe(old[key])}"])
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
    """All options of one change along the named axes, or along all axes if none is named."""
    settings: Any = scene.systems[0].settings
    present = settings.model_dump()
    if settings.kind == "tlsph":
        present["weights"] = settings.pair_weights
        present["dissipation"] = settings.dissipation_of(settings.pair_weights)
    changes: list[tuple[str, str, Any]] = []
    for axis, (key, values) in AXES[settings.kind].items():
        now = present.get(key)
        for value in values:
            same = now == value
            if isinstance(now, dict) and isinstance(value, dict):
                same = all(now.get(name) == part for name, part in value.items())
            if not same:
                changes.append((axis, key, value))
    solution = present.get("solution") or {}
    if solution.get("kind") == "quasi-static":
        for key, values in _EQUILIBRIUM.items():
            changes += [(key, f"solution.{key}", value) for value in values if solution[key] != value]
    step = next((key for key in _STEPS if present.get(key) is not None), None)
    step = step or next((f"solution.{key}" for key in _STEPS if solution.get(key) is not None), None)
    if step is not None:
        longer = _LONGER if step in ("cfl", "safety") else 2.0
        changes += [("step", step, _HALF), ("step", step, longer)]
    changes += [(METHOD, "kind", kind) for kind in method_kinds() if kind != settings.kind]
    return [Option((change,)) for change in changes if not axes or change[0] in axes]
