"""Small scenes of bodies that meet, and what their particles feel."""

import copy

import numpy as np
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

SOFT = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
MODULUS = 0.7 / (1.3 * 0.4)
SPEED = float(np.sqrt(MODULUS))
SPH = {"kind": "tlsph", "integrator": "leapfrog"}
BONDS = {"kind": "peridynamics", "solution": {"kind": "explicit"}}


def block(name, lower, upper, particles, placement="vertices", **more) -> dict:
    """A box."""
    box = {"lower": list(lower), "upper": list(upper)}
    shape = {"shape": {"box": box}, "particles": list(particles), "placement": placement}
    return {"name": name, "material": SOFT} | shape | more


def tables(*bodies, method=SPH, end_time=1.0, contact=None, **more) -> dict:
    """Raw tables; all pairs of bodies are in contact unless told."""
    wanted = [{"bodies": [body["name"] for body in bodies]}] if contact is None else contact
    dimension = len(bodies[0]["particles"])
    stated = {"dimension": dimension, "end_time": end_time, "method": method, "bodies": list(bodies)}
    # what a test changes is its own
    return copy.deepcopy(stated | {"contact": wanted, **more})


def bars(n=12, wide=4, placement="vertices", speed=0.01, ratio=1.0, gap=0.0, **more) -> dict:
    """Two bars of length 1 between rollers that meet at X = 0 with speed v [of c] in all."""
    h, v = 1.0 / n, speed * SPEED
    ends = 1 if placement == "vertices" else 0
    one, two = ([round(k * r) + ends for k in (n, wide)] for r in (1.0, ratio))
    left = block("left", (-1.0 - gap, 0.0), (-gap, wide * h), one, placement, velocity=[0.5 * v, 0.0])
    right = block("right", (0.0, 0.0), (1.0, wide * h), two, placement, velocity=[-0.5 * v, 0.0])
    rollers = [{"plane": f"Y = {y}", "kind": "roller"} for y in (0.0, wide * h)]
    return tables(left, right, **({"boundaries": rollers, "end_time": 2.6 / SPEED} | more))


def discs(n=10, speed=0.05, friction=0.3, **more) -> dict:
    """Two discs that meet off their centres, in free flight."""
    return tables(
        *(
            {
                "name": name,
                "shape": {"sphere": {"centre": centre, "radius": 0.5}},
                "particles": [n, n],
                "velocity": [sign * 0.5 * speed * SPEED, 0.0],
                "material": SOFT,
            }
            for name, centre, sign in (("left", [-0.49, -0.12], 1.0), ("right", [0.49, 0.12], -1.0))
        ),
        contact=[{"bodies": ["left", "right"], "friction": friction}],
        **({"end_time": 4.0 / SPEED} | more),
    )


def simulated(data: dict, comm=MPI.COMM_SELF) -> Simulation:
    return Simulation(comm, parse_scene(data))
