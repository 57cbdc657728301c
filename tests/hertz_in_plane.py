"""Hertz in plane strain, of particles: half of a cylinder's cap on half of a block, both of one solid.

The cap's layers follow its surface. Outer layers, four half widths away, move as half planes do (Flamant) under the
growth of Hertz's pressure, which is that of a flat punch, here two line loads with its second moment; so the exact
force belongs to each approach, and no finite size is in the numbers. Methods: tlsph, peridynamics, ulsph, mpm, and grid
(mpm with contact on the grid, for both bodies). Half widths and peaks are those of the contact's own forces, on
particles or, on the grid, on nodes; there Hertz's pressure is given to the nodes by the same functions.
"""

import os
import tempfile
from collections.abc import Callable
from typing import Any

import meshio
import numpy as np
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation
from parsolid.simulation.outputs import Cadence, Output

YOUNG, POISSON = 1.0, 0.3
SPEED = float(np.sqrt(YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))))
Tables = dict[str, Any]
# of the last contact, over the radius; sides of the boxes in half widths; time of the approach over that of a wave
# through a box, and rest after it
FLATNESS, SIDE, SLOW, REST = 0.1, 4.0, 32.0, 8.0
RADIUS = 1.0
HALF = FLATNESS * RADIUS
PLANE, RATIO = YOUNG / (1.0 - POISSON**2), POISSON / (1.0 - POISSON)
LOAD = np.pi * PLANE * HALF**2 / (8.0 * RADIUS)
STRONG = {
    "kind": "elastic-plastic",
    "density": 1.0,
    "youngs_modulus": YOUNG,
    "poissons_ratio": POISSON,
    "specific_heat": 1.0,
    "taylor_quinney": 0.9,
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 1e6, "hardening": 0.0},
}
METHODS: dict[str, Tables] = {
    "tlsph": {"kind": "tlsph", "integrator": "leapfrog"},
    "peridynamics": {"kind": "peridynamics", "solution": {"kind": "explicit"}},
    "ulsph": {"kind": "ulsph"},
    "mpm": {"kind": "mpm"},
}
# layers whose motion is given
HELD = {"tlsph": 2.01, "peridynamics": 3.01, "ulsph": 3.01, "mpm": 2.01}


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


def of_method(kind: str, words: dict[str, Any]) -> dict[str, Any]:
    """What is said of a method."""
    result: dict[str, Any] = {}
    for name, value in words.items():
        if name.startswith(f"{kind}."):
            *tables, key = name.split(".")[1:]
            place = result
            for one in tables:
                place = place.setdefault(one, {})
            place[key] = value
    return result


def of_contact(words: dict[str, Any]) -> dict[str, Any]:
    """What is said of the contact."""
    return {name: value for name, value in words.items() if "." not in name}


def cap(count: int, h: float, file: str) -> None:
    """Quadrilaterals of the cap, one for each particle."""
    line = np.arange(count + 1) * h
    X, Y = (one.ravel() for one in np.meshgrid(line, line, indexing="ij"))
    places = np.stack([X, Y + RADIUS - np.sqrt(RADIUS**2 - X**2), 0.0 * X], axis=1)
    number = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    low, high = slice(None, -1), slice(1, None)
    corners = [(low, low), (high, low), (high, high), (low, high)]
    cells = np.stack([number[one].ravel() for one in corners], axis=1)
    meshio.Mesh(places, [("quad", cells)]).write(file)


def guided(side: float, h: float, kinds: dict[str, str], end: float) -> list[Tables]:
    """Velocities of outer layers: of each half plane under the growth of the pressure, and the cap's approach."""
    x = f"(t/{end})"
    # the pressure's share of the last one, its growth, and half of the square of the half width
    s, rate = f"({x}**3*(10 - 15*{x} + 6*{x}**2))", f"(30/{end}*{x}**2*(1 - {x})**2*where(t < {end}, 1, 0))"
    square = f"({0.5 * HALF**2}*abs({s}) + 1e-12)"
    factor = f"{LOAD / (np.pi * PLANE)}*{rate}"
    result = []
    for name, sign in (("block", -1.0), ("cap", 1.0)):
        thick = HELD[kinds[name]] * h
        depth, along, out = f"({sign}*Y)", "0", "0"
        for where in (f"(X - sqrt({square}))", f"(X + sqrt({square}))"):
            r = f"({where}**2 + Y**2)"
            along += f" - 0.5*(log({r}/{side**2}) + {1.0 + RATIO}*{where}**2/{r})"
            angle = f"(2*arctan({where}/(sqrt{r} + {depth})))"
            out += f" + 0.5*({1.0 + RATIO}*{where}*{depth}/{r} - {1.0 - RATIO}*{angle})"
        approach = f" - 2*{factor}*(log({2.0 * side**2}/{square}) - {1.0 + RATIO})" if name == "cap" else ""
        velocity = [f"{factor}*({out})", f"{sign}*{factor}*({along}){approach}"]
        lower, upper = [-side, -side], [side * 2.0] * 2
        far = {"lower": [side - thick, -2.0 * side], "upper": upper}
        deep = {"lower": lower, "upper": [upper[0], thick - side]}
        if sign > 0.0:
            deep = {"lower": [lower[0], side - thick], "upper": upper}
        result += [{"kind": "velocity", "box": box, "body": name, "velocity": velocity} for box in (far, deep)]
    return result


def tables(methods: list[str], wanted: float, file: str, words: dict[str, Any]) -> tuple[Tables, float]:
    """The scene with so many spacings in the half width, and the time of the approach."""
    h = HALF / wanted
    count = round(SIDE * wanted)
    side = count * h
    cap(count, h, file)
    kinds = dict(zip(("block", "cap"), ("mpm" if one == "grid" else one for one in methods)))
    laws = {"peridynamics": material(kind="linear-elastic"), "ulsph": STRONG}
    base = block("block", [0.0, -side], [side, 0.0], h, "cells")
    ball = {"name": "cap", "shape": {"mesh": {"file": file}}, "placement": "cells"}
    bodies = [
        body | {"method": kind, "material": laws.get(kind, material())}
        for body, kind in zip((base, ball), kinds.values())
    ]
    end = SLOW * side / SPEED
    named = []
    for kind in dict.fromkeys(kinds.values()):
        cell = {"cell": 2.0 * h} if kind == "mpm" else {}
        method = {"name": kind, "balance_limit": 10.0, "balance_warning": 9.0} | METHODS[kind]
        named.append(method | cell | of_method(kind, words))
    contact = {"bodies": ["cap", "block"]} | of_contact(words)
    return {
        "dimension": 2,
        "end_time": end + REST * side / SPEED,
        "methods": named,
        "bodies": bodies,
        "contact": [contact | ({"model": "grid"} if "grid" in methods else {})],
        "boundaries": [{"plane": "X = 0", "kind": "roller"}, *guided(side, h, kinds, end)],
        "output": {"fields_times": []},
    }, end


class Pressed:
    """Force on the block along Y, and its columns' part of it averaged over the rest at the end: of particles, or of
    nodes, whose first one lies on the plane of symmetry."""

    def __init__(self, end: float, h: float) -> None:
        self.end, self.h, self.last, self.time = end, h, 0.0, 0.0
        self.sum: np.ndarray = np.zeros(0)

    def __call__(self, simulation: Any) -> Tables:
        """A row."""
        system = simulation.systems[0]
        step, self.last = simulation.clock.time - self.last, simulation.clock.time
        met = getattr(simulation.interactions[0], "pairs", None) if simulation.interactions else None
        if met and not met[0].slots:
            return {"force": 0.0}
        if met:
            here = met[0].slots[0] >= 0
            nodes, slots = system.nodes, met[0].slots[0][here]
            columns = np.rint(nodes.places[slots, 0] / system.settings.cell).astype(int)
            force = met[0].impulse[here, 1] * nodes.share[slots] / max(step, 1e-300)
        else:
            owned = system.particles.owned_rows
            mine = owned("body") == 0
            force = -owned("contact_force")[mine, 1]
            columns = np.floor(owned("reference_position")[mine, 0] / self.h).astype(int)
        if self.last > self.end:
            found = step * np.bincount(columns[columns >= 0], force[columns >= 0], minlength=len(self.sum))
            found[: len(self.sum)] += self.sum
            self.sum, self.time = found, self.time + step
        return {"force": 2.0 * float(force.sum())}


def of_particles(column: np.ndarray, h: float) -> tuple[float, float, float]:
    """Half width by the second moment, peak and largest force of columns over Hertz's for their sum, less 1."""
    middle = (np.arange(len(column)) + 0.5) * h
    load = 2.0 * column.sum()
    half = np.sqrt(8.0 * load * RADIUS / (np.pi * PLANE))
    width, most = 2.0 * np.sqrt((column * middle**2).sum() / column.sum()), 2.0 * load / (np.pi * half)
    near = middle < 0.5 * half
    peak = (column / h)[near].sum() / (most * np.sqrt(1.0 - (middle[near] / half) ** 2)).sum()
    return float(width / half - 1), float(peak - 1), float((column / h).max() / most - 1)


def of_nodes(column: np.ndarray, cell: float, averaged: float) -> tuple[float, float, float]:
    """The same of nodes, the first one in place of the largest, beside what they get of Hertz's pressure by hat
    functions averaged over so many cells."""
    load = 2.0 * column.sum()
    half = np.sqrt(8.0 * load * RADIUS / (np.pi * PLANE))
    angle = (np.arange(4000) + 0.5) / 4000 * np.pi
    place, part = half * np.cos(angle), np.sin(angle) ** 2 / (np.sin(angle) ** 2).sum() * load
    node, moved = np.arange(len(column)) * cell, (np.arange(32) + 0.5) / 32 - 0.5
    exact = np.zeros(len(column))
    for one in moved * averaged * cell:
        weight = np.maximum(1.0 - np.abs(place[:, None] + one - node) / cell, 0.0)
        exact += part @ weight / len(moved)
    exact[0] *= 0.5
    # the moment that functions add is that of Hertz's nodes over its own, of a quarter of the half width squared
    more = 2.0 * (exact * node**2).sum() / load - 0.25 * half**2
    width = 2.0 * np.sqrt(2.0 * (column * node**2).sum() / load - more)
    near = node < 0.5 * half
    peak = column[near].sum() / exact[near].sum()
    return float(width / half - 1), float(peak - 1), float(column[0] / exact[0] - 1)


def run_of(methods: list[str], wanted: float, words: dict[str, Any]) -> tuple[Tables, Pressed, Tables]:
    """The columns of a run with its share of the last force, what was looked at, and the scene."""
    with tempfile.TemporaryDirectory() as place:
        scene, end = tables(methods, wanted, os.path.join(place, "cap.vtk"), words)
        looking = Pressed(end, HALF / wanted)
        _, columns = run(scene, looking)
    x = np.minimum(columns["time"] / end, 1.0)
    return columns | {"share": x**3 * (10.0 - 15.0 * x + 6.0 * x**2)}, looking, scene


def of_pressure(looking: Pressed, scene: Tables, words: dict[str, Any]) -> tuple[float, float, float]:
    """Of particles or of nodes."""
    column = looking.sum / looking.time
    if "model" not in scene["contact"][0]:
        return of_particles(column, looking.h)
    averaged = {"quadratic-spline": 1.0, "ugimp": 0.5, "linear": 0.0}[words.get("mpm.basis", "quadratic-spline")]
    return of_nodes(column, scene["methods"][0]["cell"], averaged)
