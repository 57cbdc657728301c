"""Two bars that meet, each of any method: python docs/bars_of_methods.py tlsph mpm 25 50 [wide=4], see mixed.md.

Settings of a method besides: mpm.order=usl, mpm.cfl=0.15.
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
CLOSING = 0.0172 * SPEED
RUBBER = {"kind": "neo-hookean", "density": DENSITY, "youngs_modulus": YOUNG, "poissons_ratio": POISSON}
STRONG = {
    "kind": "elastic-plastic",
    "density": DENSITY,
    "youngs_modulus": YOUNG,
    "poissons_ratio": POISSON,
    "specific_heat": 1000.0,
    "taylor_quinney": 0.9,
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 1e12, "hardening": 0.0},
}


def bars(kinds: list[str], count: int, wide: int = 10, more: dict[str, dict[str, Any]] | None = None) -> Scene:
    """Bars of 1 m and `wide` spacings, half a spacing apart, guided at their sides; more: settings of methods."""
    h, bodies = 1.0 / count, []
    settings: dict[str, Any] = {"mpm": {"cell": 2 * h}, "ulsph": {"viscosity": False}, "peridynamics": {}}
    settings["tlsph"] = {"integrator": "leapfrog"}
    for number, kind in enumerate(kinds):
        nodes, lower = kind == "tlsph", [0.0 if number else -1.0 - 0.5 * h, 0.0]
        body = {"name": "ab"[number], "shape": {"box": {"lower": lower, "upper": [lower[0] + 1.0, wide * h]}}}
        body |= {
            "particles": [count + nodes, wide + nodes],
            "placement": "vertices" if nodes else "cells",
            "method": kind,
        }
        body |= {"velocity": [(0.5 - number) * CLOSING, 0.0], "material": STRONG if kind == "ulsph" else RUBBER}
        bodies.append(body)
    methods = [
        {"name": kind, "kind": kind} | settings[kind] | (more or {}).get(kind, {}) for kind in dict.fromkeys(kinds)
    ]
    guides = [{"plane": f"Y = {place}", "kind": "roller"} for place in (0.0, wide * h)]
    data = {"dimension": 2, "end_time": 3.7 / SPEED, "methods": methods, "bodies": bodies, "boundaries": guides}
    return parse_scene(data | {"contact": [{"bodies": ["a", "b"]}]})


class Rows(Output):
    """The ledger after every step, and the mean velocity of the first bar."""

    every = Cadence(steps=1, times=(0.0,))

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []

    def write(self, simulation: Simulation) -> None:
        """Take a row."""
        system, row = simulation.systems[0], simulation.energy_row()
        first = system.particles.owned_rows("body") == 0
        mass = (system.mass[: system.owned] * system.share[: system.owned])[first]
        velocity = system.particles.owned_rows("velocity")[first, 0]
        names = ("kinetic", "contact_energy", "energy_error", "numerical_dissipation")
        self.rows.append((simulation.clock.time, float(mass @ velocity / mass.sum()), *(row[name] for name in names)))


def main() -> None:
    """A line for each number of spacings."""
    wide, more = 10, dict[str, dict[str, Any]]()
    for word in (word for word in sys.argv[3:] if "=" in word):
        key, value = word.split("=")
        if key == "wide":
            wide = int(value)
        else:
            kind, name = key.split(".")
            more.setdefault(kind, {})[name] = float(value) if value.replace(".", "").isdigit() else value
    for count in (int(word) for word in sys.argv[3:] if "=" not in word):
        rows = Rows()
        Simulation(MPI.COMM_SELF, bars(sys.argv[1:3], count, wide, more)).run(None, [rows])
        time, velocity, kinetic, contact, balance, lost = np.array(rows.rows).T
        touching = time[contact > 1e-9 * kinetic[0]]
        print(
            f"{' and '.join(sys.argv[1:3])} {more or ''}, {count} spacings: "
            f"restitution {-velocity[-1] / velocity[0]:.4f}, contact "
            f"{(touching[-1] - touching[0]) * SPEED / 2:.3f} of 2 L/c, lost {lost[-1] / kinetic[0]:.3f}, "
            f"residual {np.abs(balance).max() / kinetic[0]:.2g}",
            flush=True,
        )


if __name__ == "__main__":
    main()
