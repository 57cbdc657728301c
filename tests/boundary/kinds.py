"""One table of each boundary kind, a small scene of each method in which it has a meaning, and its particles."""

import copy

import numpy as np
from mpm.points import COPPER, scene
from solids import SOFT, tables

from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

KINDS = {
    "fixed": {"plane": "X = 0"},
    "roller": {"plane": "X = 0"},
    "antisymmetric": {"plane": "X = 0"},
    "velocity": {"plane": "X = 1", "velocity": ["t", "free"]},
    "rotation": {"plane": "X = 1", "centre": [1.0, 0.5], "angle": "0.1*t"},
    "displacement": {"plane": "X = 1", "displacement": ["t", "free"]},
    "layer": {"plane": "X = 0.5", "side": "below"},
    "traction": {"plane": "X = 1", "traction": [1.0, 0.0]},
    "pressure": {"plane": "X = 1", "pressure": 1.0},
    "spring": {"plane": "X = 1", "stiffness": 1.0},
    "wall": {"plane": "X = 2", "side": "below"},
    "temperature": {"plane": "X = 0", "temperature": 300.0},
    "heat-flux": {"plane": "X = 0", "heat_flux": 1.0},
    "micro-hard": {"plane": "X = 0"},
}
MOVING = [
    {"kind": "velocity", "plane": "X = 1", "velocity": ["X + Y*t", "free"]},
    {"kind": "velocity", "box": {"lower": [0.9, 0.1], "upper": [1.0, 0.3]}, "velocity": ["Y*t + X", "2"]},
    {"kind": "velocity", "point": [0.1, 0.1], "velocity": ["free", "t"]},
    {"kind": "traction", "plane": "X = 0", "traction": ["1 + Y", 0.0]},
    {"kind": "traction", "plane": "Y = 1", "traction": [0.0, "X*t"]},
]
LOADS = {"body_force": ["X", "t*Y"], "acceleration": [0.0, -9.81]}
PRONY = {"kind": "prony", "density": 1000.0, "youngs_modulus": 7e6, "poissons_ratio": 0.3, "terms": []}


def table(kind: str, method: str = "tlsph") -> dict:
    """The table of a kind."""
    if kind == "pressure" and method == "peridynamics":
        return {"kind": kind, "ball": {"centre": [0.5, 0.5], "radius": 2.0}, "pressure": 1.0}
    return copy.deepcopy({"kind": kind, **KINDS[kind]})


def tables_of(method: str, *boundaries: dict) -> dict:
    """Raw tables of a square of a method with boundaries."""
    if method == "mpm":
        material = COPPER | {"conductivity": 400.0, "reference_temperature": 300.0}
        return scene([0.0, 0.0], [1.0, 1.0], 0.125, 0.25, material=material, boundaries=list(boundaries))
    if method == "tlsph":
        if all(one["kind"] != "displacement" for one in boundaries):
            return tables((9, 9), material=SOFT, boundaries=list(boundaries))
        # prescribed in equilibria alone, in which something holds the body
        static, held = {"integrator": "static", "weights": "cells"}, {"kind": "fixed", "plane": "X = 0"}
        return tables((9, 9), material=SOFT, method=static, boundaries=[*boundaries, held])
    if method == "ulsph":
        steel = {"kind": "micro-inertia", "library": "4340 steel, Rahaman"}
        data = tables((9, 9), material=steel, boundaries=list(boundaries), body={"placement": "cells"})
        data["method"] = {"kind": "ulsph"}
        return data
    data = tables((9, 9), material=PRONY, boundaries=list(boundaries), body={"placement": "cells"})
    data["method"] = {"kind": "peridynamics"}
    return data


def translated(comm, data: dict) -> Simulation:
    """A simulation of raw tables; collective."""
    return Simulation(comm, parse_scene(data))


def contained(particle_set) -> Particles:
    """The particle_set in a container."""
    result, d = Particles(particle_set.body), particle_set.position.shape[1]
    result.declare(Field("identifier", 1, "1", whole=True), particle_set.identifier)
    for name, values in (("reference_position", particle_set.position), ("spacing", particle_set.spacing)):
        result.declare(Field(name, d, "m"), values)
    result.declare(Field("area", d, "m^2"), particle_set.area)
    result.declare(Field("volume", 1, "m^3"), particle_set.volume)
    return result


def shuffle(particles: Particles) -> None:
    """Another order, and some particles leave and come back at other rows."""
    random = np.random.default_rng(5)
    particles.reorder(random.permutation(particles.owned))
    gone = np.sort(random.choice(particles.owned, particles.owned // 3, replace=False))
    packed = particles.packed(gone)
    particles.remove(gone)
    particles.insert(packed[::-1].copy())


def by_particle(particles: Particles, values: np.ndarray) -> np.ndarray:
    """Values of the owned particles in the order of their identifiers."""
    return values[np.argsort(particles.owned_rows("identifier"))]
