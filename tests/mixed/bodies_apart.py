"""A scene of four bodies that never meet, one of each method, and the scene of each of them alone."""

from parsolid.scene import Scene, parse_scene

RUBBER = {"kind": "neo-hookean", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.4}
# yields at once
COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
# one step for all
STEP = {"maximum_step": 2e-6}
METHODS = {
    # alone it would have other weights, if no kernel were stated
    "soft": {"kind": "tlsph", "kernel": "wendland-c2"},
    "bonds": {"kind": "peridynamics", "horizon_ratio": 2.0},
    "metal": {"kind": "mpm", "cell": 0.25},
    "flow": {"kind": "ulsph"},
}
SOLIDS = {"soft": RUBBER, "bonds": RUBBER | {"density": 1500.0}, "metal": COPPER, "flow": COPPER}


def body(name: str, number: int) -> dict:
    """A square of 1 m at X = 3 number, which is stretched and sheared."""
    lower = 3.0 * number
    box = {"lower": [lower, 0.0], "upper": [lower + 1.0, 1.0]}
    speeds = [f"20*(X - {lower}) + 3*Y", "-15*Y*Y"]
    result = {"name": name, "shape": {"box": box}, "particles": [8, 8], "velocity": speeds, "material": SOLIDS[name]}
    return result if name == "soft" else result | {"placement": "cells"}


def tables(names=tuple(METHODS), **rest) -> dict:
    """Raw tables of a scene of bodies with these methods, each of which holds itself on Y = 0."""
    bodies = [body(name, number) | {"method": name} for number, name in enumerate(METHODS) if name in names]
    methods = [{"name": name} | METHODS[name] | STEP for name in names]
    held = [{"plane": "Y = 0", "kind": "roller"}]
    return {"dimension": 2, "end_time": 4e-5, "methods": methods, "bodies": bodies, "boundaries": held} | rest


def mixed(names=tuple(METHODS), **rest) -> Scene:
    """Bodies of several methods."""
    return parse_scene(tables(names, **rest))


def alone(name: str, **rest) -> Scene:
    """One of the bodies in a scene that knows no other."""
    data = tables((name,), **rest)
    (method,) = data.pop("methods")
    del method["name"], data["bodies"][0]["method"]
    return parse_scene(data | {"method": method})
