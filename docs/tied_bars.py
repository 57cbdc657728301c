"""A bar made of two methods, tied in its middle: python docs/tied_bars.py tlsph mpm 25 50, see mixed.md.

A pulse of stress runs through the tie; what is reflected and transmitted is compared with the exact amplitudes.
impedance=2: of the second half over the first; stiffness=1: of the tie. pull=0.01: no pulse, the right end is pulled
slowly until the mean strain is that.
"""

import sys
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.scene import Scene, parse_scene
from parsolid.simulation.loop import Simulation
from parsolid.simulation.outputs import Cadence, Output

DENSITY, YOUNG, POISSON = 1000.0, 17e6, 0.3
SPEED = np.sqrt(YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON)) / DENSITY)
# of the pulse, cosine squared, over the length of half the bar; amplitude of its velocity over the wave speed
WIDTH, AMPLITUDE = 0.8, 1e-4


def pulled(data: dict[str, Any], strain: float) -> dict[str, Any]:
    """The bar without a pulse, held at the left, whose right end is pulled in 60 L/c by a strain times its length."""
    for body in data["bodies"]:
        body.pop("velocity", None)
        body.pop("displacement", None)
    end = 60.0 / SPEED
    course = f"{2.0 * strain / end}*(1 - cos(2*pi*t/{end}))"
    right = {"plane": "X = 1", "kind": "velocity", "body": "b", "velocity": [course, "free"]}
    left = {"plane": "X = -1", "kind": "roller", "body": "a"}
    return data | {"end_time": end, "boundaries": [*data["boundaries"], left, right]}


def strains(simulation: Simulation) -> tuple[float, float, float]:
    """Mean strains along the two halves, and how far they have parted at X = 0 [m], by straight lines through the
    displacements of all particles farther than a tenth of a half from its ends."""
    lines = []
    for number, system in enumerate(simulation.systems):
        rows = system.particles.owned_rows
        place = rows("reference_position")[:, 0]
        inner = np.abs(place - (number - 0.5)) < 0.4
        lines.append(np.polyfit(place[inner], (rows("position")[:, 0] - place)[inner], 1))
    return float(lines[0][0]), float(lines[1][0]), float(lines[1][1] - lines[0][1])


def bar(kinds: list[str], count: int, impedance: float, stiffness: float | None, pull: float | None) -> Scene:
    """Two halves of 1 m and 10 spacings that touch at X = 0, guided at their sides; a pulse runs right in the first."""
    h, bodies = 1.0 / count, []
    settings: dict[str, Any] = {
        "tlsph": {"dissipation": 0.0},
        "peridynamics": {},
        "mpm": {"cell": 2 * h},
        "ulsph": {"viscosity": False},
    }
    names = list(dict.fromkeys(kinds)) if kinds[0] != kinds[1] else [kinds[0], f"{kinds[1]}-2"]
    for number, kind in enumerate(kinds):
        nodes, factor = kind == "tlsph", impedance**number
        rubber = {"density": DENSITY * factor, "youngs_modulus": YOUNG * factor, "poissons_ratio": POISSON}
        material: dict[str, Any] = {"kind": "neo-hookean"} | rubber
        if kind == "ulsph":
            flow = {"kind": "linear-hardening", "yield_stress": 1e12, "hardening": 0.0}
            heat = {"specific_heat": 1000.0, "taylor_quinney": 0.9}
            material = {"kind": "elastic-plastic"} | rubber | heat | {"flow_stress": flow}
        lower = [number - 1.0, 0.0]
        body = {"name": "ab"[number], "shape": {"box": {"lower": lower, "upper": [lower[0] + 1.0, 10 * h]}}}
        body |= {"particles": [count + nodes, 10 + nodes], "placement": "vertices" if nodes else "cells"}
        body |= {"method": names[number], "material": material}
        if number == 0:
            phase = f"(X + 0.5)/{WIDTH}"
            shape = f"where(abs({phase}) < 0.5, cos(pi*{phase})**2, 0)"
            inner = f"(0.5*({phase}) + sin(2*pi*{phase})/(4*pi))"
            moved = f"{-AMPLITUDE * WIDTH}*where({phase} < -0.5, -0.5, where({phase} > 0.5, 0, {inner} - 0.25))"
            body |= {"velocity": [f"{AMPLITUDE * SPEED}*{shape}", "0"], "displacement": [moved, "0"]}
        bodies.append(body)
    methods = [{"name": name, "kind": kind} | settings[kind] for name, kind in zip(names, kinds)]
    guides = [{"plane": f"Y = {place}", "kind": "roller"} for place in (0.0, 10 * h)]
    data = {"dimension": 2, "end_time": 1.0 / SPEED, "methods": methods, "bodies": bodies, "boundaries": guides}
    tie = {"bodies": ["a", "b"]} | ({} if stiffness is None else {"stiffness": stiffness})
    return parse_scene((data if pull is None else pulled(data, pull)) | {"tie": [tie]})


class Rows(Output):
    """The largest residual and interface energy after every step."""

    every = Cadence(steps=1, times=(0.0,))

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []

    def write(self, simulation: Simulation) -> None:
        """Take a row."""
        row = simulation.energy_row()
        names = ("kinetic", simulation.ledger.stored, "tie_energy", "energy_error")
        self.rows.append((simulation.clock.time, *(row[name] for name in names)))


def amplitudes(simulation: Simulation) -> tuple[float, float]:
    """Velocity of each half as a multiple of the pulse where it is in the end: (reflected, transmitted)."""
    result = []
    for number, system in enumerate(simulation.systems):
        rows, owned = system.particles.owned_rows, system.owned
        phase = (rows("reference_position")[:, 0] - (number - 0.5)) / WIDTH
        pulse = np.where(np.abs(phase) < 0.5, np.cos(np.pi * phase) ** 2, 0.0)
        mass = system.mass[:owned] * system.share[:owned]
        result.append(float((mass * pulse) @ rows("velocity")[:, 0] / ((mass * pulse) @ pulse) / (AMPLITUDE * SPEED)))
    return result[0], result[1]


def main() -> None:
    """A line for each number of spacings."""
    options = dict(word.split("=") for word in sys.argv[1:] if "=" in word)
    words = [word for word in sys.argv[1:] if "=" not in word]
    impedance = float(options.get("impedance", 1.0))
    stiffness, pull = (float(options[name]) if name in options else None for name in ("stiffness", "pull"))
    exact = (1.0 - impedance) / (1.0 + impedance), 2.0 / (1.0 + impedance)
    for count in map(int, words[2:]):
        rows = Rows()
        simulation = Simulation(MPI.COMM_SELF, bar(words[:2], count, impedance, stiffness, pull))
        simulation.run(None, [rows])
        time, kinetic, stored, tie, balance = np.array(rows.rows).T
        if pull is not None:
            first, second, parted = strains(simulation)
            told = f"strain {first / pull:.4f} and {second / pull:.4f} of the mean, parted {parted * count / pull:.3f}"
            print(f"{' and '.join(words[:2])}, {count} spacings: {told} h strain, {len(time) - 1} steps", flush=True)
            continue
        energy = kinetic[0] + stored[0]
        reflected, transmitted = amplitudes(simulation)
        left = sum(simulation.systems[0].energies()) / energy
        told = f"reflected {reflected:+.4f} ({exact[0]:+.4f}), transmitted {transmitted:+.4f} ({exact[1]:+.4f})"
        told += f", energy left {left:.2g} ({exact[0] ** 2:.2g}), most in the tie {tie.max() / energy:.2g}"
        print(
            f"{' and '.join(words[:2])}, {count} spacings: {told}, "
            f"residual {np.abs(balance).max() / energy:.2g}, {len(time) - 1} steps",
            flush=True,
        )


if __name__ == "__main__":
    main()
