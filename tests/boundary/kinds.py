"""One table of each boundary kind, and a small scene of each method in which it has a meaning."""

import copy

from points import COPPER, scene
from solids import SOFT, tables

from parsolid.boundary.conditions import Conditions
from parsolid.methods.mpm.conditions import GridConditions
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.methods.peridynamics.loads import PeridynamicLoads
from parsolid.methods.ulsph.state import declare_motion
from parsolid.particles.container import Particles
from parsolid.particles.generated import declare_generated
from parsolid.particles.generation import generate
from parsolid.scene import parse_scene

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
    "heat_flux": {"plane": "X = 0", "heat_flux": 1.0},
    "micro_clamped": {"plane": "X = 0"},
}
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
        return tables((9, 9), material=SOFT, boundaries=list(boundaries))
    if method == "ulsph":
        steel = {"kind": "micro-inertia", "library": "4340 steel, Rahaman"}
        data = tables((9, 9), material=steel, boundaries=list(boundaries), body={"placement": "cells"})
        data["method"] = {"kind": "ulsph"}
        return data
    data = tables((9, 9), material=PRONY, boundaries=list(boundaries), body={"placement": "cells"})
    data["method"] = {"kind": "peridynamics"}
    return data


def translated(comm, data: dict):
    """What a method makes of the boundaries of raw tables; collective."""
    scene = parse_scene(data)
    particle_set = generate(scene, comm)
    if scene.method.kind == "tlsph":
        particles = Particles(particle_set.body)
        declare_generated(particles, particle_set)
        return Conditions(comm, scene, particle_set, particles)
    if scene.method.kind == "peridynamics":
        return PeridynamicLoads(comm, scene, particle_set, Particles(particle_set.body))
    if scene.method.kind == "ulsph":
        particles = Particles(particle_set.body)
        declare_generated(particles, particle_set)
        declare_motion(particles, particle_set.position)
        return Conditions(comm, scene, particle_set, particles)
    return GridConditions(comm, scene, particle_set, MaterialPoints(scene, particle_set))
