"""Contact on the nodes of the grid beside that of material points: python docs/grid_contact_tables.py bars 25 50, or
slide 1 2, or patch 12; see contact.md."""

import sys
from typing import Any

import numpy as np
from bars_of_methods import CLOSING, SPEED, bars
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation
from parsolid.simulation.outputs import Cadence, Output

GRAVITY, FRICTION = 2e-4, 0.3
SOLID = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}


class Rows(Output):
    """The ledger after every step, and momentum and mean place of the last system."""

    every = Cadence(steps=1, times=(0.0,))

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def write(self, simulation: Simulation) -> None:
        """Take a row."""
        system = simulation.systems[-1]
        mass, rows = system.mass[: system.owned], system.particles.owned_rows
        momentum = mass @ rows("velocity")
        if "impulse" in system.particles:
            momentum = momentum + rows("impulse").sum(axis=0)
        place = mass @ rows("position") / mass.sum()
        row = simulation.energy_row()
        self.rows.append(row | {"time": simulation.clock.time, "p": momentum / mass.sum(), "x": place})

    def columns(self) -> dict[str, np.ndarray]:
        """Every column over the steps."""
        return {name: np.array([row[name] for row in self.rows]) for name in self.rows[0]}


def followed(data: dict[str, Any], model: str) -> dict[str, np.ndarray]:
    """The rows of a run of a scene with contact of a model."""
    data["contact"] = [{"bodies": ["a", "b"], "model": model, "friction": data.pop("friction", 0.0)}]
    rows = Rows()
    Simulation(MPI.COMM_SELF, parse_scene(data)).run(None, [rows])
    return rows.columns()


def two_bars(count: int, model: str) -> str:
    """Restitution, time of contact, and where the energy went."""
    data = bars(["mpm", "mpm"], count).resolved()
    found = followed(data, model)
    velocity, energy, time = found["p"][:, 0], found["kinetic"][0], found["time"] * SPEED
    steps = np.flatnonzero(np.abs(np.diff(velocity)) > 1e-6 * CLOSING) + 1
    lost = {
        name: found[name][-1] / energy for name in ("numerical_dissipation", "contact_dissipation") if name in found
    }
    begin = time[steps[0]] - 0.5 * SPEED / CLOSING / count
    return (
        f"restitution {-velocity[-1] / velocity[0]:.3f}, start {begin:+.3f} L/c, "
        f"contact {(time[steps[-1]] - time[steps[0]]) / 2.0:.3f} of 2 L/c, "
        f"lost {', '.join(f'{value:.3f} ({name})' for name, value in lost.items())}, residual at most "
        f"{np.abs(found['energy_error']).max() / energy:.2g}, at the end {abs(found['energy_error'][-1]) / energy:.2g}"
    )


def sliding_block(fineness: int, model: str, slope: float) -> str:
    """Acceleration of a block on an incline over the exact one, or its creep over its length where it sticks."""
    angle, ramp = np.arctan(slope), "*where(t < 40, t/40, 1)"
    bodies = [
        {"name": name, "shape": {"box": {"lower": lower, "upper": upper}}, "placement": "cells", "material": SOLID}
        | {"particles": [fineness * (b - a) for a, b in zip(lower, upper)]}
        for name, lower, upper in (("a", [0, 0], [24, 4]), ("b", [3, 4], [13, 9]))
    ]
    methods = [{"name": "points", "kind": "mpm", "cell": 2.0 / fineness, "balance_limit": 1.0}]
    pull = [f"{GRAVITY * np.sin(angle):.9g}{ramp}", f"-{GRAVITY * np.cos(angle):.9g}{ramp}"]
    held = [{"plane": "Y = 0", "kind": "fixed", "body": "a"}]
    data = {"dimension": 2, "end_time": 160.0, "methods": methods, "bodies": bodies, "boundaries": held}
    found = followed(data | {"loads": {"acceleration": pull}, "friction": FRICTION}, model)
    time, velocity = found["time"], found["p"][:, 0]
    exact = GRAVITY * (np.sin(angle) - FRICTION * np.cos(angle))
    if exact < 0.0:
        return f"sticks, creep {(found['x'][-1, 0] - found['x'][0, 0]) / 10.0:.1e} of its length"
    late = time > 80.0
    return f"acceleration {100.0 * (np.polyfit(time[late], velocity[late], 1)[0] / exact - 1.0):+.2f} %"


def pressed_blocks(count: int, model: str) -> str:
    """Two blocks pressed by 1 % between rollers: mean of the stress across the face over that far from it, layer by
    layer of the lower block, and its spread along the face."""
    h, ramp, end = 1.0 / count, 24.0, 26.0
    c = float(np.sqrt(0.7 / (1.3 * 0.4)))
    rate = f"-{0.02 / ramp * c}*(1 - cos(2*pi*t/{ramp / c}))*where(t < {ramp / c}, 1, 0)"
    bodies = [
        {"name": name, "shape": {"box": {"lower": [0.0, low], "upper": [1.0, low + 1.0]}}, "placement": "cells"}
        | {"particles": [count, count], "material": SOLID}
        for name, low in (("a", -1.0), ("b", 0.0))
    ]
    methods = [{"name": "points", "kind": "mpm", "cell": 2.0 * h, "transfer": "apic", "balance_limit": 10.0}]
    sides = [{"plane": plane, "kind": "roller"} for plane in ("X = 0", "X = 1")]
    sides += [{"plane": "Y = -1", "kind": "roller", "body": "a"}]
    driven = {"lower": [-1.0, 1.0 - 2.0 * h], "upper": [2.0, 2.0]}
    sides += [{"kind": "velocity", "box": driven, "body": "b", "velocity": ["free", rate]}]
    data = {"dimension": 2, "end_time": end / c, "methods": methods, "bodies": bodies, "boundaries": sides}
    data["contact"] = [{"bodies": ["a", "b"], "model": model}]
    simulation, rows = Simulation(MPI.COMM_SELF, parse_scene(data)), Rows()
    simulation.run(None, [rows])
    points = simulation.systems[0].particles
    y, V = points.owned_rows("reference_position")[:, 1], points.owned_rows("motion")[:, 7]
    stress = points.owned_rows("stress_and_volume")[:, 1] / V
    far, told = stress[np.abs(y + 0.5) < 0.2].mean(), []
    for layer in range(4):
        here = stress[np.abs(y + (layer + 0.5) * h) < 0.2 * h] / far
        told.append(f"{here.mean():.3f} ({here.std():.4f})")
    return ", ".join(told)


def main() -> None:
    """A line for each size and model."""
    what, sizes = sys.argv[1], map(int, sys.argv[2:])
    for size in sizes:
        for model in ("kernel", "grid"):
            if what == "patch":
                print(f"{size} spacings, {model}: {pressed_blocks(size, model)}", flush=True)
                continue
            if what == "bars":
                print(f"{size} spacings, {model}: {two_bars(size, model)}", flush=True)
                continue
            for slope in (0.5, 0.2):
                print(
                    f"{10 * size} x {5 * size}, {model}, slope {slope}: {sliding_block(size, model, slope)}", flush=True
                )


if __name__ == "__main__":
    main()
