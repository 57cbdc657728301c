"""Contact in every method: python docs/contact_methods.py slide, and so on; without a name it tells which. See
contact.md."""

import sys
import time
from itertools import product
from typing import Any

import numpy as np
from contact_scenes import Timed
from contact_tables import BONDS, LEAPFROG, SPEED, YOUNG, Rows, Tables, block, material, one_of, run, scene
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Limits, Simulation

FLOW = {"kind": "linear-hardening", "yield_stress": 1e3 * YOUNG, "hardening": 0.0}
METAL = material(kind="elastic-plastic") | {"specific_heat": 1.0, "taylor_quinney": 0.9, "flow_stress": FLOW}
GRAVITY, FRICTION = 2e-4, 0.3
# settings, material, where particles are
METHODS: dict[str, tuple[Tables, Tables, str]] = {
    "tlsph, nodes": (LEAPFROG, material(), "vertices"),
    "tlsph, cells": (LEAPFROG, material(), "cells"),
    "tlsph, stages": ({"kind": "tlsph"}, material(), "cells"),
    "peridynamics": (BONDS, material(kind="linear-elastic"), "cells"),
    "ulsph": ({"kind": "ulsph", "viscosity": False}, METAL, "cells"),
    "mpm": ({"kind": "mpm", "geometry": "plane-strain"}, material(), "cells"),
}


def wanted() -> dict[str, tuple[Tables, Tables, str]]:
    """The methods that the command names, or all."""
    return {name: one for name, one in METHODS.items() if not sys.argv[2:] or name in sys.argv[2:]}


def of(name: str, h: float) -> tuple[Tables, Tables, str]:
    """Settings of a method for a spacing, its material, and where its particles are."""
    settings, law, placement = METHODS[name]
    more = {"cell": 2.0 * h} if settings["kind"] == "mpm" else {}
    return settings | more, law, placement


def moved(simulation: Simulation) -> Tables:
    """Mean place and velocity of the second body along the face, with impulses that wait for the next step; `straight`
    is what bouncing leaves as it is, for every force N across the face comes with FRICTION N along it."""
    system = simulation.systems[-1]
    rows, mass = system.particles.owned_rows, system.mass[: system.owned]
    mine = rows("body") == (1 if len(simulation.systems) == 1 else 0)
    x, v = (mass[mine] @ rows(name)[mine, :2] / mass[mine].sum() for name in ("position", "velocity"))
    if "impulse" in system.particles:
        v = v + rows("impulse")[mine, :2].sum(axis=0) / mass[mine].sum()
    return {"x": float(x[0]), "v": float(v[0]), "straight": float(v[0] + FRICTION * v[1])}


def sliding(name: str, slope: float, speed: float, end: float) -> Tables:
    """A block of 10 x 5 spacings on a base, under gravity that leans by a slope."""
    settings, law, placement = of(name, 1.0)
    angle = np.arctan(slope)
    rise = "*where(t < 80, 0.5 - 0.5*cos(pi*t/80), 1)" if speed == 0.0 else ""
    pull = [f"{GRAVITY * np.sin(angle):.9g}{rise}", f"-{GRAVITY * np.cos(angle):.9g}{rise}"]
    base = block("base", [0.0, 0.0], [24.0, 4.0], 1.0, placement, material=law)
    upper = block("block", [3.0, 4.0], [13.0, 9.0], 1.0, placement, velocity=[speed, 0.0], material=law)
    floor: Tables = {"plane": "Y = 0", "kind": "fixed", "body": "base"}
    if placement == "cells" and settings["kind"] != "mpm":
        box = {"lower": [-1.0, -1.0], "upper": [25.0, 1.0]}
        floor = {"kind": "velocity", "box": box, "body": "base", "velocity": [0.0, 0.0]}
    method = settings | {"balance_limit": 10.0}
    return scene(
        [base, upper], end, {"friction": FRICTION}, boundaries=[floor], loads={"acceleration": pull}, method=method
    )


def slide() -> None:
    """A block on a base with friction .3: acceleration on an incline, creep where it sticks, and how far it slides
    before it rests, body on body."""
    for name in wanted():
        told = []
        for slope, speed, end in ((0.5, 0.0, 160.0), (0.2, 0.0, 160.0), (0.0, 0.02, 400.0)):
            _, columns = run(sliding(name, slope, speed, end), moved)
            clock, x, v = columns["time"], columns["x"] - columns["x"][0], columns["v"]
            late = clock > 80.0
            straight = columns["straight"][late]
            if slope == 0.5:
                angle = np.arctan(slope)
                exact = GRAVITY * (np.sin(angle) - FRICTION * np.cos(angle))
                slopes = (100.0 * (np.polyfit(clock[late], one, 1)[0] / exact - 1.0) for one in (straight, v[late]))
                told.append("acceleration {:+.3f} % ({:+.2f} % with its bouncing)".format(*slopes))
            elif speed > 0.0:
                told.append(f"stops after {100.0 * (x[-1] * 2.0 * FRICTION * GRAVITY / speed**2 - 1.0):+.2f} %")
            else:
                told.append(f"creep {x[-1] / 10.0:.1e}, of it since t = 80 {(x[-1] - x[late][0]) / 10.0:.1e}")
        print(f"{name}: {', '.join(told)}", flush=True)


def spinning(overlap: float, friction: float, together: bool, rings: bool, h: float = 1.0 / 12) -> Tables:
    """Two discs held in one another by a part of a spacing that turn about their common point of contact, or of which
    one turns about itself; rings: of particles in rings, in place of a square lattice."""
    bodies = []
    for name, sign in (("left", -1.0), ("right", 1.0)):
        x = sign * (0.5 - 0.5 * overlap * h)
        shell = {"centre": [x, 0.0], "radius": 0.375, "thickness": 0.25, "angles": [0, 360]}
        shape = {"cylindrical_shell": shell} if rings else {"sphere": {"centre": [x, 0.0], "radius": 0.5}}
        count = [round(2.0 * np.pi * 0.375 / h), 3] if rings else [12, 12]
        bodies.append({"name": name, "shape": shape, "particles": count, "placement": "cells", "material": material()})
    everywhere = {"lower": [-2.0, -2.0], "upper": [2.0, 2.0]}
    turn = {"kind": "rotation", "box": everywhere, "centre": [0.0, 0.0], "angle": f"0.2*{SPEED}*t"}
    boundaries = [turn]
    if not together:
        turn |= {"body": "left", "centre": [-0.5 + 0.5 * overlap * h, 0.0]}
        boundaries.append({"kind": "velocity", "box": everywhere, "body": "right", "velocity": [0.0, 0.0]})
    return scene(bodies, 2.0 / SPEED, {"friction": friction}, boundaries=boundaries)


def spin() -> None:
    """Discs pressed on one another that spin: together, where friction has nothing to do, or one of them, without
    friction, where only the roughness of a face of particles can turn the other."""

    def forces(simulation: Simulation) -> Tables:
        rows = simulation.systems[0].particles.owned_rows
        mine, x, f = rows("body") == 0, rows("position"), rows("contact_force")
        arm = x[mine] - x[mine].mean(axis=0)
        turn = float((arm[:, 0] * f[mine, 1] - arm[:, 1] * f[mine, 0]).sum())
        contact: Any = simulation.interactions[0]
        told = {"force": float(np.linalg.norm(f[mine].sum(axis=0))), "turn": turn}
        return told | {"energy": contact.energy, "stuck": contact.stuck}

    cases = product(((True, 0.5), (False, 0.0)), ("rings", "lattice"), (0.2, 0.4))
    for (together, friction), kind, overlap in cases:
        _, columns = run(spinning(overlap, friction, together, kind == "rings"), forces)
        energy, arm = columns["energy"].max(), 0.5 * columns["force"].mean()
        stick, lost = columns["stuck"].max(), np.max(columns.get("friction_dissipation", 0.0))
        print(
            f"{'both turn' if together else 'one turns'}, friction {friction}, {kind}, overlap {overlap} h, "
            f"{len(columns['time'])} steps: stick energy {stick / energy:.1e}, friction took {lost / energy:.1e} of "
            f"the energy of contact, moment over force and radius {np.abs(columns['turn']).max() / arm:.1e} at most, "
            f"{columns['turn'].mean() / arm:.1e} in the mean",
            flush=True,
        )


def costly(name: str, gap: float, space: bool) -> tuple[Tables, float]:
    """Two blocks 30 layers thick at so many spacings from each other, and a step that all methods can take."""
    h = 1.0 / 200
    settings, law, placement = of(name, h)
    below, wide = max(gap, 1e-3) * h, [12 * h, 12 * h] if space else [200 * h]
    zero, still = [0.0] * len(wide), [0.0] * len(wide)
    boxes = {"a": (-30 * h - below, -below, 0.005 * SPEED), "b": (0.0, 30 * h, -0.005 * SPEED)}
    bodies = [
        block(one, [*zero, low], [*wide, high], h, placement, velocity=[*still, v], material=law)
        for one, (low, high, v) in boxes.items()
    ]
    if space:
        settings = {key: value for key, value in settings.items() if key != "geometry"}
    return scene(bodies, 10.0, method=settings), 0.2 * h / SPEED


def cost() -> None:
    """Processor time of contact in a step, of two blocks 30 layers thick in contact and 20 spacings apart; `space`: in
    three dimensions."""
    space = "space" in sys.argv
    for name in {one: None for one in METHODS if one in sys.argv} or METHODS:
        for gap in (0.0, 20.0):
            tables, step = costly(name, gap, space)
            simulation, rows = Simulation(MPI.COMM_SELF, parse_scene(tables)), Rows()
            simulation.run(None, [rows], Limits(5))
            contact: Any = simulation.interactions[0]
            contact.before, contact.after = Timed(contact.before), Timed(contact.after)
            clock, steps = Timed(lambda: None), 40 if space else 320
            began = time.process_time()
            for _ in range(steps):
                simulation.take_step(step)
                clock()
            whole = time.process_time() - began
            spent = contact.before.spent + contact.after.spent - 2.0 * clock.spent
            print(
                f"{name}{', in space' if space else ''}, gap {gap}: {whole / steps * 1e6:.0f} us a step, contact "
                f"{100 * spent / whole:.2f} %",
                flush=True,
            )


if __name__ == "__main__":
    one_of((slide, spin, cost))
