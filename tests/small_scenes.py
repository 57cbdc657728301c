"""Scenes of a few particles and a few steps that together use everything a run can do."""

import copy
from pathlib import Path

import tomli_w
from solids import COPPER, RUBBER

SOFT = RUBBER
STIFF = SOFT | {"density": 1500.0, "youngs_modulus": 40e6, "poissons_ratio": 0.4}
ONE = [{"beta": 1.0, "tau": 0.02}]
THREE = [{"beta": 2.0, "tau": 0.001}, {"beta": 1.0, "tau": 0.01}, {"beta": 0.5, "tau": 0.3}]
ROLLERS = [{"plane": plane, "kind": "roller"} for plane in ("X = 0", "X = 1", "Y = 0")]

OUTPUT = {"history_steps": 1, "fields_interval": 1e-3, "pictures": False}


def scene(title: str, method: dict, end_time: float, *bodies: dict, **rest) -> dict:
    """Tables of a scene; its dimension is that of the first box."""
    dimension = len(bodies[0]["shape"]["box"]["lower"])
    return {
        "title": title,
        "dimension": dimension,
        "end_time": end_time,
        "method": method,
        "bodies": list(bodies),
        "output": OUTPUT,
    } | rest


def box(lower: list, upper: list, material: dict, **rest) -> dict:
    """Tables of a body."""
    return {"shape": {"box": {"lower": lower, "upper": upper}}, "material": material, **rest}


PUNCH = scene(
    "Small punch",
    # weights and integrator of the paper, whatever else a test states
    {"kind": "tlsph", "kernel": "wendland-c2", "integrator": "ssp-rk3"},
    5e-3,
    box([0.0, 0.0], [1.0, 1.0], SOFT, particles=[9, 9], velocity=["0", "-100*Y*where(X < 0.5, 2*X, 1)"]),
    boundaries=ROLLERS,
    probes=[
        {"name": "corner", "at": [1.0, 1.0], "fields": ["displacement", "velocity", "stress"]},
        {"name": "mass", "quantity": "centre_of_mass"},
    ],
)
TWIST = ["105*sin(pi*Y/4)*Z", "0", "-105*sin(pi*Y/4)*X"]
COLUMN = scene(
    "Small column",
    {"kind": "tlsph"},
    0.04,
    box([-0.5, 0.0, -0.5], [0.5, 2.0, 0.5], SOFT | {"branches": ONE}, particles=[5, 9, 5], velocity=TWIST),
    boundaries=[{"plane": "Y = 0", "kind": "fixed"}],
    probes=[
        {"name": "tip", "at": [0.5, 2.0, 0.5], "fields": ["displacement", "velocity", "twist"], "axis": "Y"},
        {"name": "whole", "quantity": "angular_momentum"},
        {"name": "least", "quantity": "minimum_jacobian"},
    ],
    output=OUTPUT | {"fields_interval": 0.01},
)

# the reference is moved right after the run was stopped, and where the column asks for it
MOVED = PUNCH | {"method": {"kind": "tlsph", "reference": "updated", "update_every": 4}}
MOVING = COLUMN | {"method": {"kind": "tlsph", "reference": "updated", "update_when": 0.1}, "end_time": 0.03}

# two materials, one of them with fewer branches, driven by a wall whose velocity changes, pulled and sheared
DRIVEN = scene(
    "Driven plates",
    {"kind": "tlsph", "kernel": "quintic-spline", "smoothing": 0.7},
    5e-3,
    box([0.0, 0.0], [1.0, 1.0], SOFT | {"branches": THREE}, name="left", particles=[9, 9]),
    box([3.0, 0.0], [4.0, 1.0], STIFF | {"branches": ONE}, name="right", particles=[9, 9]),
    boundaries=[
        {"plane": "Y = 0", "kind": "roller"},
        {"plane": "X = 0", "kind": "velocity", "velocity": ["20*sin(2000*t)", "free"]},
        {"plane": "Y = 1", "kind": "traction", "body": "right", "traction": ["1e5*t/0.005", "2e5*cos(1000*t)"]},
    ],
    loads={"acceleration": ["0", "-9.81"]},
    probes=[
        {"name": "edge", "at": [4.0, 1.0], "fields": ["displacement", "twist", "pressure"], "centre": [3.5, 0.5]},
        {"name": "fastest", "quantity": "maximum_speed"},
        {"name": "all", "quantity": "linear_momentum"},
    ],
)

METAL = COPPER | {"flow_stress": {"kind": "linear-hardening", "yield_stress": 120e6, "hardening": 500e6}}
ALUMINIUM = {"kind": "neo-hookean", "density": 2700.0, "youngs_modulus": 70e9, "poissons_ratio": 0.33}
FINE = {"spacing": [2.5e-4], "placement": "cells"}

# two laws, a wall that moves, particles that change their rank
IMPACT = scene(
    "Impact of two blocks",
    {"kind": "mpm", "cell": 5e-4, "transfer": "apic", "rebalance": 1.05},
    1.5e-6,
    box([0.0, 0.0], [5e-3, 4e-3], METAL, velocity=["300", "100"], **FINE),
    box([0.0, 4e-3], [3e-3, 7e-3], ALUMINIUM, velocity=["300", "-100 + 4e4*X"], **FINE),
    boundaries=[
        {"plane": "Y = 0", "kind": "roller"},
        {"plane": "X = 0", "kind": "wall", "side": "above", "velocity": [310.0, 0.0]},
    ],
    loads={"acceleration": ["0", "-1e7*(1 + X)"]},
    bond=[{"bodies": "all"}],
    probes=[
        {"name": "corner", "at": [0.0, 0.0], "fields": ["displacement", "stress", "plastic_strain", "temperature"]},
        {"name": "top", "at": [3e-3, 7e-3], "fields": ["displacement", "density"]},
        {"name": "upper", "quantity": "upper_bounds"},
        {"name": "work", "quantity": "plastic_work"},
        {"name": "all", "quantity": "linear_momentum"},
    ],
    output=OUTPUT | {"fields_interval": 5e-7},
)

# a block that turns, flies farther than it is long, and is dealt out anew
COARSE = {"spacing": [0.05], "placement": "cells"}
FLIGHT = scene(
    "Flight of a block",
    {"kind": "mpm", "cell": 0.1, "basis": "ugimp", "order": "musl", "flip_fraction": 0.99, "rebalance": 1.05},
    6e-3,
    box([0.0, 0.0, 0.0], [0.4, 0.3, 0.2], SOFT, velocity=["150 - 60*Y", "60*X", "30"], **COARSE),
    probes=[
        {"name": "corner", "at": [0.4, 0.3, 0.2], "fields": ["position", "velocity_gradient", "jacobian"]},
        {"name": "turn", "quantity": "angular_momentum"},
    ],
    output=OUTPUT | {"fields_interval": 2e-3, "fields": ["velocity", "pressure", "density"]},
)

# two laws, contact, fluxes of both, lists made anew on the way
STEEL = {"kind": "micro-inertia", "library": "4340 steel, Rahaman", "energetic_length": 1e-3}
PLATE_COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
CELLS = {"particles": [12, 6], "placement": "cells"}
PLATES = scene(
    "Small plates",
    {"kind": "ulsph", "viscous_heating": True},
    4e-6,
    box([0.0, 0.0], [0.012, 0.006], STEEL, name="steel", velocity=["400", "3e4*X"], **CELLS),
    box([0.012, 0.0], [0.024, 0.006], PLATE_COPPER, name="copper", velocity=["-400", "0"], **CELLS),
    bond=[{"bodies": "all"}],
    probes=[
        {"name": "corner", "at": [0.024, 0.006], "fields": ["displacement", "velocity", "stress"]},
        {"name": "whole", "quantity": "linear_momentum"},
        {"name": "hot", "quantity": "maximum_temperature"},
    ],
    output=OUTPUT | {"fields_interval": 1e-6},
)

# fibres by place and softening, whose state particles of mpm take along to other ranks
FIBRES = {"fibre_modulus": 3e5, "fibre_exponent": 2.0, "dispersion": 0.1, "fibre": {"angle": "atan2(Y, X)"}}
SOFTENING = {"softening": {"r": 2.0, "m": 100.0, "beta": 0.1}, "branches": [{"beta": 1.0, "tau": 0.002}]}
GROUND = {"kind": "gasser-ogden-holzapfel", "density": 1000.0, "shear_modulus": 1e5, "bulk_modulus": 1e6}
UNEVEN = {"particles": [7, 7], "jitter": 0.1, "velocity": ["10*Y", "8*X"]}
TISSUE = scene(
    "Small tissue", {"kind": "tlsph"}, 5e-3, box([0.0, 0.0], [0.1, 0.1], GROUND | FIBRES | SOFTENING, **UNEVEN)
)


def _of_points(scene: dict) -> dict:
    """The same with the material point method, which has no branches."""
    (body,) = copy.deepcopy(scene["bodies"])
    del body["jitter"], body["material"]["branches"]
    body |= {"placement": "cells", "particles": [8, 8]}
    return scene | {"method": {"kind": "mpm", "cell": 0.025, "cfl": 0.15}, "bodies": [body]}


SCENES = {
    "punch": PUNCH,
    "moved": MOVED,
    "moving": MOVING,
    "column": COLUMN,
    "driven": DRIVEN,
    "impact": IMPACT,
    "flight": FLIGHT,
    "plates": PLATES,
    "tissue": TISSUE,
    "tissue_points": _of_points(TISSUE),
}


def changed(scene: dict, changes: dict) -> dict:
    """A copy of a scene with {"key.path": value}; None removes the key, "+" in place of a number adds to a list."""
    scene = copy.deepcopy(scene)
    for path, value in changes.items():
        *keys, last = (int(key) if key.isdigit() else key for key in path.split("."))
        place = scene
        for key in keys:
            place = place[key] if isinstance(place, list) else place.setdefault(key, {})
        if last == "+":
            place.append(value)
        elif value is None:
            del place[last]
        else:
            place[last] = value
    return scene


def write(scene: dict, path: Path) -> Path:
    """Write a scene; returns the path."""
    path.write_text(tomli_w.dumps(scene), encoding="utf-8")
    return path
