"""Small scenes with rigid tools, in every method, and what to watch in them."""

import numpy as np
from mpi4py import MPI
from solids import late_impulse, recorded

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

SOLID = {"density": 1000.0, "youngs_modulus": 1e7, "poissons_ratio": 0.1}
_HYPER = {"kind": "neo-hookean", **SOLID}
_BONDED = {"kind": "linear-elastic", **SOLID}
_FLOW = {"kind": "linear-hardening", "yield_stress": 1e9, "hardening": 1e6}
_METAL = {"kind": "elastic-plastic", "specific_heat": 400.0, "taylor_quinney": 0.9, "flow_stress": _FLOW, **SOLID}
SPACING = 0.1
EXPLICIT = {"kind": "peridynamics", "horizon_ratio": 3.0, "solution": {"kind": "explicit"}}
METHODS = {
    "tlsph": ({"kind": "tlsph", "integrator": "leapfrog"}, _HYPER, "vertices"),
    "tlsph-cells": ({"kind": "tlsph", "integrator": "leapfrog"}, _HYPER, "cells"),
    "peridynamics": (EXPLICIT, _BONDED, "cells"),
    "ulsph": ({"kind": "ulsph"}, _METAL, "cells"),
    "mpm": ({"kind": "mpm", "cell": 2.0 * SPACING}, _METAL, "cells"),
}


def block(method: str, counts=(10, 5), lower=None, **body) -> dict:
    """Raw tables of a block of so many cells from `lower`, the origin unless given."""
    settings, material, placement = METHODS[method]
    d = len(counts)
    lower = list(lower or [0.0] * d)
    upper = [low + n * SPACING for low, n in zip(lower, counts)]
    if settings["kind"] == "mpm" and d == 2:
        settings = settings | {"geometry": "plane-strain"}
    shape = {"box": {"lower": lower, "upper": upper}}
    particles = [n + (placement == "vertices") for n in counts]
    made = {"name": "block", "shape": shape, "particles": particles, "placement": placement, "material": material}
    return {"dimension": d, "end_time": 1.0, "method": dict(settings), "bodies": [made | body]}


def floor(dimension=2, **keys) -> dict:
    """A half-space below Y = 0, in 3-D below Z = 0."""
    normal = [0.0] * (dimension - 1) + [1.0]
    return {"name": "floor", "shape": {"plane": {"point": [0.0] * dimension, "normal": normal}}, **keys}


def motion(sim) -> dict:
    """The ledger, checked as in runs; columns of the tools; mass [kg], momentum [N s], mean velocity [m/s] and place
    [m] of all particles."""
    row, total = dict(sim.energy_row()), 0.0
    for one in sim.interactions:
        row |= dict(zip(one.columns, one.sample()))
    for system in sim.systems:
        m = (system.mass[: system.owned] * system.share[: system.owned])[:, None]
        rows = system.particles.owned_rows
        momentum = (m * rows("velocity") + late_impulse(system)).sum(axis=0)
        total = total + np.concatenate([momentum, (m * rows("position")).sum(axis=0), [m.sum()]])
    momentum, first, mass = np.split(sim.comm.allreduce(total), [sim.systems[0].dimension, -1])
    return row | {"mass": mass[0], "momentum": momentum, "velocity": momentum / mass, "place": first / mass}


def run(data: dict, comm=MPI.COMM_SELF, steps=None) -> tuple[Simulation, dict[str, np.ndarray]]:
    """A simulation of raw tables to its end, or for some steps; its columns."""
    sim = Simulation(comm, parse_scene(data))
    return sim, recorded(sim, motion, steps)
