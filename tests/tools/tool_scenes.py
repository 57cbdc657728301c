"""Small scenes with rigid tools, in every method, and what to watch in them."""

import numpy as np
from mpi4py import MPI
from solids import late_impulse

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Limits, Simulation
from parsolid.simulation.outputs import Cadence, Output

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


class Watch(Output):
    """Rows of the ledger and of the tools, and the mean velocity and place of all particles."""

    every = Cadence(steps=1, times=(0.0,))

    def __init__(self):
        self.rows = []

    def write(self, sim) -> None:
        row = {"time": sim.clock.time, **sim.energy_row()}
        for one in sim.interactions:
            row |= dict(zip(one.columns, one.sample()))
        momentum, angular, mass, first = 0.0, 0.0, 0.0, 0.0
        for system in sim.systems:
            m = (system.mass[: system.owned] * system.share[: system.owned])[:, None]
            v, x = system.particles.owned_rows("velocity"), system.particles.owned_rows("position")
            v = v + late_impulse(system) / m
            momentum, mass, first = momentum + (m * v).sum(axis=0), mass + m.sum(), first + (m * x).sum(axis=0)
            if x.shape[1] > 1:
                flat = np.zeros((len(m), 3 - x.shape[1]))
                angular = angular + (m * np.cross(np.hstack([x, flat]), np.hstack([v, flat]))).sum(axis=0)
        together = sim.comm.allreduce(np.concatenate([momentum, first, np.atleast_1d(angular), [mass]]))
        d = len(momentum)
        row |= {"momentum": together[:d], "mass": together[-1], "angular": together[2 * d : -1]}
        self.rows.append(row | {"velocity": together[:d] / together[-1], "place": together[d : 2 * d] / together[-1]})

    def __contains__(self, name) -> bool:
        return name in self.rows[0]

    def __getitem__(self, name) -> np.ndarray:
        return np.array([row[name] for row in self.rows])


def run(data: dict, comm=MPI.COMM_SELF, steps=None) -> tuple[Simulation, Watch]:
    """A simulation of raw tables to its end, or for some steps."""
    sim, watch = Simulation(comm, parse_scene(data)), Watch()
    sim.run(None, [watch], Limits(steps=steps))
    return sim, watch
