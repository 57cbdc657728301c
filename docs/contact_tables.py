"""Figures of docs/contact.md: python docs/contact_tables.py bars, and so on; without a name it tells which."""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.loop import Simulation
from parsolid.simulation.outputs import Cadence, Output

YOUNG, POISSON = 1.0, 0.3
MODULUS = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
SPEED = float(np.sqrt(MODULUS))
LEAPFROG = {"kind": "tlsph", "integrator": "leapfrog"}
BONDS = {"kind": "peridynamics", "solution": {"kind": "explicit"}}
Tables = dict[str, Any]


def material(stiffer: float = 1.0, denser: float = 1.0, kind: str = "neo-hookean") -> Tables:
    """Rubber with wave speed sqrt(stiffer/denser) SPEED."""
    return {"kind": kind, "density": denser, "youngs_modulus": stiffer * YOUNG, "poissons_ratio": POISSON}


def block(
    name: str, lower: list[float], upper: list[float], h: float, placement: str = "vertices", **more: Any
) -> Tables:
    """A box of particles with a spacing."""
    count = [round((b - a) / h) + (placement == "vertices") for a, b in zip(lower, upper)]
    shape = {"shape": {"box": {"lower": lower, "upper": upper}}, "particles": count, "placement": placement}
    return {"name": name, "material": material()} | shape | more


def scene(bodies: list[Tables], end: float, contact: Tables | None = None, **more: Any) -> Tables:
    """All bodies in contact with one another."""
    named = {"bodies": [body["name"] for body in bodies]} | (contact or {})
    tables = {"dimension": len(bodies[-1]["particles"]), "end_time": end, "method": LEAPFROG, "bodies": bodies}
    return tables | {"contact": [named], "output": {"fields_times": []}} | more


class Rows(Output):
    """The ledger after every step, and whatever else is asked for."""

    every = Cadence(steps=1, times=(0.0,))

    def __init__(self, more: Callable[[Simulation], Tables] | None = None) -> None:
        self.rows: list[Tables] = []
        self.more = more

    def write(self, simulation: Simulation) -> None:
        """Take a row."""
        row = simulation.energy_row() | {"time": simulation.clock.time}
        self.rows.append(row | (self.more(simulation) if self.more else {}))

    def columns(self) -> Tables:
        """Each of the rows' values as an array."""
        return {name: np.array([row[name] for row in self.rows]) for name in self.rows[0]}


def run(tables: Tables, more: Callable[[Simulation], Tables] | None = None, comm: Any = MPI.COMM_SELF) -> Any:
    """The simulation at its end, and the columns."""
    simulation, rows = Simulation(comm, parse_scene(tables)), Rows(more)
    simulation.run(None, [rows])
    return simulation, rows.columns()


def means(simulation: Simulation) -> np.ndarray:
    """Mean velocity (bodies, d) of each body of the first system [m/s]."""
    system = simulation.systems[0]
    owned = system.particles.owned_rows
    mass, body = system.mass[: system.owned] * system.share[: system.owned], owned("body")
    found = [(mass[body == i] @ owned("velocity")[body == i]) / mass[body == i].sum() for i in np.unique(body)]
    return np.array(found)


def momenta(simulation: Simulation) -> np.ndarray:
    """Momentum and angular momentum about the origin of the first system, in the plane."""
    system = simulation.systems[0]
    owned = system.particles.owned_rows
    p = owned("velocity") * (system.mass[: system.owned] * system.share[: system.owned])[:, None]
    x = owned("position")
    return np.array([*p.sum(axis=0)[:2], float((x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]).sum())])


def off(columns: Tables, name: str = "energy_error") -> float:
    """The largest value over the kinetic energy at the start, or the largest one later."""
    return float(np.abs(columns[name]).max() / columns["kinetic"].max())


def one_of(tables: tuple[Callable[[], None], ...]) -> None:
    """Print the table that is named, or which there are."""
    named = [one for one in tables if one.__name__ in sys.argv[1:2]]
    if named:
        named[0]()
    else:
        print("\n".join(f"{one.__name__}: {one.__doc__}" for one in tables))


def bars_scene(n: int, case: str, placement: str = "vertices", wide: int = 4, method: Tables | None = None) -> Tables:
    """A bar of length 1 with .01 c runs into another one at rest, both guided at their sides."""
    h, ratio = 1.0 / n, 1.3 if "1.3" in case else 1.0
    kind = "linear-elastic" if method is BONDS else "neo-hookean"
    long, z = (2.0 if case == "unequal" else 1.0), (2.0 if case == "impedance" else 1.0)
    far = round(n * long / ratio)
    low = 0.37 * h if case == "offset" else 0.0
    v = 0.01 * SPEED
    left = block("left", [-1.0 - 0.05 * h, 0.0], [-0.05 * h, wide * h], h, placement, velocity=[v, 0.0])
    right = block("right", [0.0, 0.0], [long, wide * h], h, placement)
    if ratio > 1:
        rows = round(wide / ratio) + (placement == "vertices")
        right["particles"] = [far + (placement == "vertices"), rows]
    if low:
        right["shape"] = {"box": {"lower": [0.0, low - h], "upper": [long, wide * h + low]}}
        right["particles"][1] += 1
    left["material"], right["material"] = material(kind=kind), material(z, z, kind)
    rollers = [{"plane": f"Y = {y}", "kind": "roller", "body": "left"} for y in (0.0, wide * h)]
    if not low:
        rollers += [one | {"body": "right"} for one in rollers]
    contact = {"bodies": ["left", "right"]}
    return scene([left, right], 2.6 / SPEED, contact, boundaries=rollers, method=method or LEAPFROG)


def bars() -> None:
    """Equal, unequal and unlike bars."""
    exact = {"equal": (0.0, 1.0), "1:1.3": (0.0, 1.0), "unequal": (0.0, 0.5), "impedance": (-1 / 3, 2 / 3)}
    for case, (one, two) in exact.items():
        for placement, n in (("vertices", 26), ("vertices", 52), ("cells", 26)):
            simulation, columns = run(bars_scene(n, case, placement))
            found = means(simulation)[:, 0] / (0.01 * SPEED)
            touching = columns["time"][columns["contact_energy"] > 1e-9 * columns["kinetic"][0]]
            print(
                f"{case}, {placement}, L/h {n}: velocities {found[0]:+.3f} {found[1]:+.3f} (exact {one:+.3f} "
                f"{two:+.3f}), "
                f"contact {(touching[-1] - touching[0]) * SPEED / 2:.3f} of 2 L/c, balance {off(columns):.1e}, "
                f"lost {columns['numerical_dissipation'][-1] / columns['kinetic'][0]:.3f}",
                flush=True,
            )


def orders() -> None:
    """Equal bars at four resolutions."""
    for n in (25, 50, 100, 200):
        simulation, columns = run(bars_scene(n, "equal", wide=3))
        found = means(simulation)[:, 0] / (0.01 * SPEED)
        print(f"L/h {n}: restitution {found[1] - found[0]:.4f}, balance {off(columns):.1e}", flush=True)


def patch() -> None:
    """Two blocks pressed by 1 %: pressure and its spread in layers next to the face, between rollers."""
    h = 1.0 / 12
    for name, ratio, stiffer in (
        ("1:1", 1.0, 1.0),
        ("1:1.3", 4 / 3, 1.0),
        ("1:2", 2.0, 1.0),
        ("1:1, x100", 1.0, 100.0),
    ):
        for placement in ("vertices", "cells"):
            other = h * ratio
            rate, end = 0.02 / 40 * SPEED, 60 / SPEED
            low = block("low", [0.0, -1.0], [1.0, 0.0], h, placement)
            top = block("top", [0.0, 0.0], [1.0, 1.0], other, placement, material=material(stiffer, stiffer))
            driven = {"kind": "velocity", "plane": "Y = 1", "body": "top"}
            depth = {"vertices": 0.0, "cells": other}[placement]
            if placement == "cells":
                driven = {"kind": "velocity", "box": {"lower": [-1, 1 - depth], "upper": [2, 2]}, "body": "top"}
            driven["velocity"] = ["free", f"-{rate}*where(t < {40 / SPEED}, 1, 0)"]
            sides = [{"plane": f"{p}", "kind": "roller"} for p in ("X = 0", "X = 1")]
            sides += [{"plane": "Y = -1", "kind": "roller", "body": "low"}, driven]
            simulation, columns = run(scene([low, top], end, boundaries=sides, method=LEAPFROG))
            system = simulation.systems[0]
            owned = system.particles.owned_rows
            stress = system.shown("first_piola_kirchhoff_stress", 0, system.owned)
            assert stress is not None
            mine, y = owned("body") == 0, owned("reference_position")[:, 1]
            force = owned("contact_force")[:, 1] * system.share[: system.owned]
            p = -float(force[mine].sum())
            layers = np.unique(np.round(y[mine], 9))[::-1][:4]
            told = []
            for layer in layers:
                here = stress[mine & (np.abs(y - layer) < 1e-6), 1, 1]
                told.append(f"{-here.mean() / p:.2f} ({here.std() / p:.3f})")
            print(
                f"{name}, {placement}: pressure {p / MODULUS:.4f} M; layers {', '.join(told)}; "
                f"balance {np.abs(columns['energy_error']).max() / columns[stored_energy(columns)].max():.1e}",
                flush=True,
            )


def discs_scene(factor: float = 1.0, friction: float = 0.0, n: int = 16, key: str = "safety") -> Tables:
    """Two discs meet off their centres; factor: on the largest stable step, key: of leapfrog's or, `cfl`, of stages."""
    bodies = [
        {
            "name": name,
            "shape": {"sphere": {"centre": centre, "radius": 0.5}},
            "particles": [n, n],
            "velocity": [sign * 0.025 * SPEED, 0.0],
            "material": material(),
        }
        for name, centre, sign in (("left", [-0.52, -0.15], 1.0), ("right", [0.52, 0.15], -1.0))
    ]
    method = (LEAPFROG if key == "safety" else {"kind": "tlsph"}) | {key: factor, "dissipation": 0}
    return scene(bodies, 4.0 / SPEED, {"friction": friction}, method=method)


def discs() -> None:
    """Oblique impact: what is kept, against the step, by leapfrog and, with `stages`, by these."""
    key, factors = ("cfl", (0.4, 0.2, 0.1)) if "stages" in sys.argv else ("safety", (0.8, 0.4, 0.2, 0.1))
    for friction in (0.0, 0.3):
        for factor in factors:

            def moment(simulation: Simulation) -> Tables:
                owned = simulation.systems[0].particles.owned_rows
                x, f = owned("position"), owned("contact_force")
                turn = float((x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0]).sum())
                return {"moment": turn, "force": float(np.abs(f).sum()), "momentum": momenta(simulation)}

            _, columns = run(discs_scene(factor, friction, key=key), moment)
            change = np.abs(columns["momentum"] - columns["momentum"][0]).max(axis=0) / (0.025 * SPEED * np.pi / 4)
            growth = np.diff(columns["friction_dissipation"]).min() / columns["kinetic"][0]
            print(
                f"friction {friction}, {key} {factor}: balance {off(columns):.1e}, at the end "
                f"{abs(columns['energy_error'][-1]) / columns['kinetic'][0]:.1e}, momentum {change[:2].max():.0e}, "
                f"angular {change[2]:.0e}, "
                f"moment of the contact {np.abs(columns['moment']).max() / columns['force'].max():.0e}, friction took "
                f"{columns['friction_dissipation'][-1] / columns['kinetic'][0]:.3f}, least growth {growth:.0e}",
                flush=True,
            )


TABLES = (bars, orders, patch, discs)

if __name__ == "__main__":
    one_of(TABLES)
