"""Bodies and random states of updated-Lagrangian SPH for its tests."""

import copy

import numpy as np
from solids import simulation

STEEL = {"kind": "micro-inertia", "library": "4340 steel, Rahaman"}
# all optional terms, with lengths that a spacing of a few tenths of a millimetre sees
EVERYTHING = STEEL | {"energetic_length": 1e-3, "hardening_length": 1e-4, "dissipative_length": 1e-4}


def block(particles, upper, material=STEEL, lower=None, **keys) -> dict:
    """A body in a box of cells."""
    lower = [0.0] * len(particles) if lower is None else lower
    shape = {"box": {"lower": lower, "upper": upper}}
    return {"shape": shape, "particles": list(particles), "placement": "cells", "material": material} | keys


def scene(*bodies, end_time=1e-5, method=None, **rest) -> dict:
    """Raw tables of a scene."""
    tables = {
        "dimension": len(bodies[0]["particles"]),
        "end_time": end_time,
        "method": {"kind": "ulsph"} | (method or {}),
    }
    return copy.deepcopy(tables | {"bodies": list(bodies)} | rest)


def impact(across=21, along=71, speed=208.0, material=STEEL, **keys) -> dict:
    """The paper's impact: two bars 25.4 x 7.62 mm end on."""
    length, width = 25.4e-3, 7.62e-3
    left = block([along, across], [length, width], material, velocity=[str(speed), 0.0], name="left")
    right = block(
        [along, across], [2 * length, width], material, [length, 0.0], velocity=[str(-speed), 0.0], name="right"
    )
    return scene(left, right, bond=[{"bodies": ["left", "right"]}], **keys)


def randomized(data, comm, seed=0):
    """A simulation with random stress, density, velocity, fluxes, micro-velocity and temperature of every particle,
    the same on any number of ranks, with B of its places and all that neighbours read.
    """
    sim = simulation(data, comm)
    system = sim.systems[0]
    rows, d = system.particles.owned_rows, system.dimension

    def draw(name, low, high):
        if name in system.particles:
            width = rows(name).shape[1:] if rows(name).ndim > 1 else ()
            table = np.random.default_rng([seed, sum(map(ord, name))]).uniform(low, high, (100_000, *width))
            rows(name)[:] = table[rows("identifier")]

    draw("velocity", -100.0, 100.0)
    draw("deviator", -1e8, 1e8)
    trace = rows("deviator")[:, :3].mean(axis=1)
    rows("deviator")[:, :3] -= trace[:, None]
    for name in ("energetic_flux", "dissipative_flux"):
        draw(name, -1e4, 1e4)
    draw("heat_flux", -1e7, 1e7)
    draw("micro_rate", 0.0, 1e4)
    draw("temperature", 300.0, 900.0)
    draw("density", 7500.0, 8100.0)
    evaluate(system)
    return sim, d


def evaluate(system) -> None:
    """B, stresses, forces and gradients of the present state, which a step of length 0 leaves as it is."""
    for _ in range(2):
        system.find_rates(0.0)
        system.advance_state(0.0, 0.0)
        system.neighbours.find_forces()
        system.advance_fluxes(0.0)
    system.find_rates(0.0)
