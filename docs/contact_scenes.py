"""More figures of docs/contact.md: python docs/contact_scenes.py hertz, and so on; without a name it tells which."""

import sys
import time
from typing import Any

import numpy as np
from contact_tables import (
    POISSON,
    SPEED,
    YOUNG,
    Rows,
    Tables,
    block,
    material,
    momenta,
    off,
    one_of,
    run,
    scene,
)
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.loop import Limits, Simulation


class Timed:
    """Processor time spent in a function [s]."""

    def __init__(self, call: Any) -> None:
        self.call, self.spent = call, 0.0

    def __call__(self, *values: Any) -> None:
        """Call it."""
        began = time.process_time()
        self.call(*values)
        self.spent += time.process_time() - began


def stack() -> None:
    """Three blocks on one another under gravity that rises slowly: force through each face against the weight above."""
    h, g = 1.0 / 8, 2e-3
    bodies = [block(name, [0.0, float(i)], [1.0, i + 1.0], h) for i, name in enumerate("abc")]
    ramp = 30.0 / SPEED
    loads = {"acceleration": ["0", f"-{g}*where(t < {ramp}, t/{ramp}, 1)"]}
    floor = [{"plane": "Y = 0", "kind": "roller", "body": "a"}]
    tables = scene(bodies, 80.0 / SPEED, {"bodies": ["a", "b", "c"], "friction": 0.3}, boundaries=floor, loads=loads)

    def through(simulation: Simulation) -> Tables:
        owned = simulation.systems[0].particles.owned_rows
        body, force = owned("body"), owned("contact_force")[:, 1]
        return {"upper": float(force[body == 2].sum()), "both": float(force[body >= 1].sum())}

    _, columns = run(tables, through)
    late = columns["time"] > 50.0 / SPEED
    spans = np.gradient(columns["time"])[late]
    for name, weight in (("upper", g), ("both", 2 * g)):
        mean = float((columns[name][late] * spans).sum() / spans.sum())
        print(f"force under {name}: {mean / weight:.4f} of the weight above")
    off = np.abs(columns["energy_error"]).max() / columns[stored_energy(columns)].max()
    print(f"balance {off:.1e} of the largest stored energy", flush=True)


def three() -> None:
    """Three blocks meet in space at one time: what is kept."""
    h, v = 0.25, 0.02 * SPEED
    boxes = [
        ([-1.05, 0.0, 0.0], [v, 0.0, 0.0]),
        ([0.0, 0.1, 0.05], [-v, 0.0, 0.0]),
        ([-0.5, 1.13, 0.1], [0.0, -v, 0.0]),
    ]
    bodies = [
        block(name, low, [x + 1.0 for x in low], h, velocity=velocity) for name, (low, velocity) in zip("abc", boxes)
    ]
    simulation, columns = run(scene(bodies, 6.0 / SPEED, {"friction": 0.2}), lambda one: {"p": momenta(one)})
    scale = v * 1.0
    print(
        f"momentum {np.abs(columns['p'] - columns['p'][0])[:, :2].max() / scale:.0e}, balance {off(columns):.1e}, "
        f"friction took {columns['friction_dissipation'][-1] / columns['kinetic'][0]:.3f}, "
        f"contact energy at the end {columns['contact_energy'][-1] / columns['kinetic'][0]:.0e}",
        flush=True,
    )


def hertz() -> None:
    """A cylinder pressed on a block, plane strain: half width and peak of the pressure against Hertz's."""
    for n in [int(one) for one in sys.argv[2:]] or (20, 40):
        radius, depth = 1.0, 0.75
        h = 0.8 / n
        cap = {
            "cylindrical_shell": {
                "centre": [0.0, radius],
                "radius": radius - 0.25,
                "thickness": 0.5,
                "angles": [-125, -55],
            }
        }
        rings, around = round(0.5 / h), round(np.radians(70) * radius / h)
        a = {"name": "roll", "shape": cap, "particles": [around, rings], "placement": "cells", "material": material()}
        b = block("base", [-0.9, -depth], [0.9, 0.0], h, "cells")
        end, push = 40.0 / SPEED, 0.012
        top = {
            "kind": "velocity",
            "where": "upper",
            "velocity": [0.0, f"-{push * SPEED / 25}*where(t < {25 / SPEED}, 1, 0)"],
        }
        floor = {
            "kind": "velocity",
            "box": {"lower": [-1, -1], "upper": [1, -depth + h]},
            "velocity": [0.0, 0.0],
            "body": "base",
        }
        upper = {"kind": "velocity", "ball": {"centre": [0.0, radius], "radius": 0.5 + 1.1 * h}, "body": "roll"}
        boundaries = [upper | {"velocity": top["velocity"]}, floor]
        simulation, _ = run(scene([a, b], end, {"bodies": ["roll", "base"]}, boundaries=boundaries))
        owned = simulation.systems[0].particles.owned_rows
        mine = owned("body") == 1
        x, force = owned("position")[mine, 0], -owned("contact_force")[mine, 1]
        load = float(force.sum())
        wanted = np.sqrt(8 * load * radius * (1 - POISSON**2) / (np.pi * YOUNG))
        width = 2.0 * np.sqrt(float((force * x * x).sum()) / load)
        columns = np.round((x + 0.9) / h - 0.5).astype(int)
        pressure = np.bincount(columns, force) / h
        peak = np.convolve(pressure, [0.25, 0.5, 0.25], "same").max()
        print(
            f"spacing {h:.3f}: a/h {wanted / h:.2f}, half width {width / wanted - 1:+.3f}, "
            f"peak {peak / (2 * load / (np.pi * wanted)) - 1:+.3f}",
            flush=True,
        )


def cost() -> None:
    """Processor time of contact in a step, of two blocks 30 layers thick at so many spacings from each other."""
    h = 1.0 / 200
    for gap in (100.0, 20.0, 0.5, 0.0):
        # so that no two nodes are at one place
        below = max(gap, 1e-3) * h
        a = block("a", [0.0, -30 * h - below], [1.0, -below], h, velocity=[0.0, 0.005 * SPEED])
        b = block("b", [0.0, 0.0], [1.0, 30 * h], h, velocity=[0.0, -0.005 * SPEED])
        simulation, rows = Simulation(MPI.COMM_SELF, parse_scene(scene([a, b], 10.0))), Rows()
        simulation.run(None, [rows], Limits(5))
        contact: Any = simulation.interactions[0]
        contact.before, contact.after = Timed(contact.before), Timed(contact.after)
        clock = Timed(lambda: None)
        began = time.process_time()
        for _ in range(640):
            simulation.take_step(0.4 * h / SPEED)
            clock()
        whole = time.process_time() - began
        spent = contact.before.spent + contact.after.spent - 2.0 * clock.spent
        print(f"gap {gap}: {whole / 640 * 1e6:.0f} us a step, contact {100 * spent / whole:.2f} %", flush=True)


if __name__ == "__main__":
    one_of((stack, three, hertz, cost))
