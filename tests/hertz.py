"""Hertz' contact of particles in plane strain and in space: half of a cap on half of a block, or quarters of both.

The cap's layers follow its surface, for a lattice that is cut by a ball is flat at its pole. Outer layers, four half
widths away, move as half planes do (Flamant) under the growth of Hertz's pressure, which is that of a flat punch, here
two line loads with its second moment, or as half spaces under a point load (Boussinesq); so the exact force belongs to
each approach, and no finite size is in the numbers (Johnson, Contact Mechanics, 4.2). Methods: tlsph, peridynamics,
mpm, and grid (mpm with contact on the grid, in the plane alone). Half widths and peaks are those of the contact's own
forces, on particles or, on the grid, on nodes; there Hertz's pressure is given to the nodes by the same functions.
"""

import itertools
import os
import tempfile
from types import SimpleNamespace
from typing import Any

import meshio
import numpy as np
from solids import Record, simulation

YOUNG, POISSON, RADIUS = 1.0, 0.3, 1.0
SPEED = float(np.sqrt(YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))))
PLANE, RATIO = YOUNG / (1.0 - POISSON**2), POISSON / (1.0 - POISSON)
# half width of the last contact, sides of the boxes in half widths, approach in space
HALF, SIDE = 0.1 * RADIUS, 4.0
APPROACH = HALF**2 / RADIUS
LOAD = {2: np.pi * PLANE * HALF**2 / (8.0 * RADIUS), 3: 2.0 / 3.0 * PLANE * RADIUS**0.5 * APPROACH**1.5}
Tables = dict[str, Any]


def cap(d: int, count: int, h: float, file: str) -> None:
    """Quadrilaterals or hexahedra of the cap, one for each particle."""
    line = np.arange(count + 1) * h
    places = np.zeros(((count + 1) ** d, 3))
    places[:, :d] = np.stack([one.ravel() for one in np.meshgrid(*[line] * d, indexing="ij")], axis=1)
    places[:, d - 1] += RADIUS - np.sqrt(RADIUS**2 - (places[:, : d - 1] ** 2).sum(axis=1))
    number = np.arange((count + 1) ** d).reshape([count + 1] * d)
    ends = slice(None, -1), slice(1, None)
    around = [(0, 0), (1, 0), (1, 1), (0, 1)]
    corners = around if d == 2 else [(*one, up) for up in (0, 1) for one in around]
    cells = np.stack([number[tuple(ends[i] for i in one)].ravel() for one in corners], axis=1)
    meshio.Mesh(places, [("quad" if d == 2 else "hexahedron", cells)]).write(file)


def of_half_planes(side: float, end: float) -> dict[str, list[str]]:
    """Velocities of the block and the cap: of each half plane under the growth of the pressure, and the approach."""
    x = f"(t/{end})"
    # the pressure's share of the last one, its growth, and half of the square of the half width
    s, rate = f"({x}**3*(10 - 15*{x} + 6*{x}**2))", f"(30/{end}*{x}**2*(1 - {x})**2*where(t < {end}, 1, 0))"
    square = f"({0.5 * HALF**2}*abs({s}) + 1e-12)"
    factor = f"{LOAD[2] / (np.pi * PLANE)}*{rate}"
    found = {}
    for name, sign in (("block", -1.0), ("cap", 1.0)):
        depth, along, out = f"({sign}*Y)", "0", "0"
        for where in (f"(X - sqrt({square}))", f"(X + sqrt({square}))"):
            r = f"({where}**2 + Y**2)"
            along += f" - 0.5*(log({r}/{side**2}) + {1.0 + RATIO}*{where}**2/{r})"
            angle = f"(2*arctan({where}/(sqrt{r} + {depth})))"
            out += f" + 0.5*({1.0 + RATIO}*{where}*{depth}/{r} - {1.0 - RATIO}*{angle})"
        approach = f" - 2*{factor}*(log({2.0 * side**2}/{square}) - {1.0 + RATIO})" if name == "cap" else ""
        found[name] = [f"{factor}*({out})", f"{sign}*{factor}*({along}){approach}"]
    return found


def of_half_spaces(side: float, end: float) -> dict[str, list[str]]:
    """The same of a point load on each half space."""
    x = f"(t/{end})"
    s, rate = f"({x}**3*(10 - 15*{x} + 6*{x}**2))", f"(30/{end}*{x}**2*(1 - {x})**2*where(t < {end}, 1, 0))"
    rho, found = "sqrt(X**2 + Y**2 + Z**2)", {}
    for name, sign in (("block", -1.0), ("cap", 1.0)):
        depth = f"({sign}*Z)"
        factor = f"{1.5 * LOAD[3] * (1.0 + POISSON) / (2.0 * np.pi * YOUNG)}/{rho}*sqrt(abs({s}))*{rate}"
        out = f"{factor}*({depth}/{rho}**2 - {1.0 - 2.0 * POISSON}/({rho} + {depth}))"
        along = f"{sign}*{factor}*({depth}**2/{rho}**2 + {2.0 * (1.0 - POISSON)})"
        found[name] = [f"X*{out}", f"Y*{out}", along + (f" - {APPROACH}*{rate}" if name == "cap" else "")]
    return found


def tables(d: int, method: str, wanted: float, file: str, slow: float, rest: float, contact: Tables) -> tuple:
    """The scene with so many spacings in the half width, and the time of the approach; slow, rest: that and what comes
    after it, over the time of a wave through a box."""
    h, count = HALF / wanted, round(SIDE * wanted)
    side, bonds = count * h, method == "peridynamics"
    cap(d, count, h, file)
    law = {"kind": "linear-elastic" if bonds else "neo-hookean", "density": 1.0}
    law |= {"youngs_modulus": YOUNG, "poissons_ratio": POISSON}
    box = {"lower": [0.0] * (d - 1) + [-side], "upper": [side] * (d - 1) + [0.0]}
    bodies = [
        {"name": name, "shape": shape, "placement": "cells", "material": law}
        for name, shape in (("block", {"box": box}), ("cap", {"mesh": {"file": file}}))
    ]
    bodies[0]["particles"] = [count] * d
    end, thick = slow * side / SPEED, (3.01 if bonds else 2.01) * h
    held: list[Tables] = [{"plane": f"{axis} = 0", "kind": "roller"} for axis in "XY"[: d - 1]]
    for (name, velocity), axis in itertools.product(
        (of_half_planes, of_half_spaces)[d - 2](side, end).items(), range(d)
    ):
        lower, upper = [-side] * (d - 1) + [-2.0 * side], [2.0 * side] * d
        if axis == d - 1 and name == "block":
            upper[axis] = thick - side
        else:
            lower[axis] = side - thick
        held.append({"kind": "velocity", "box": {"lower": lower, "upper": upper}, "body": name, "velocity": velocity})
    settings = {"kind": "mpm", "cell": 2.0 * h} if method in ("mpm", "grid") else {"kind": method}
    return {
        "dimension": d,
        "end_time": end + rest * side / SPEED,
        "method": settings | {"balance_limit": 10.0, "balance_warning": 9.0},
        "bodies": bodies,
        "contact": [{"bodies": ["cap", "block"]} | ({"model": "grid"} if method == "grid" else {}) | contact],
        "boundaries": held,
        "output": {"fields_times": []},
    }, end


class Pressed:
    """Force on the whole block, and its columns' part of it in the plane, averaged over the rest at the end: of
    particles, or of nodes, whose first one lies on the plane of symmetry."""

    def __init__(self, d: int, end: float, h: float) -> None:
        self.d, self.end, self.h, self.last, self.time = d, end, h, 0.0, 0.0
        self.sum: np.ndarray = np.zeros(0)

    def __call__(self, sim: Any) -> Tables:
        """A row."""
        system = sim.systems[0]
        step, self.last = sim.clock.time - self.last, sim.clock.time
        met = getattr(sim.interactions[0], "pairs", None) if sim.interactions else None
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
            force = -owned("contact_force")[mine, self.d - 1]
            columns = np.floor(owned("reference_position")[mine, 0] / self.h).astype(int)
        if self.last > self.end:
            found = step * np.bincount(columns[columns >= 0], force[columns >= 0], minlength=len(self.sum))
            found[: len(self.sum)] += self.sum
            self.sum, self.time = found, self.time + step
        return {"force": 2.0 ** (self.d - 1) * float(force.sum())}


def of_particles(column: np.ndarray, h: float) -> tuple[float, float]:
    """Half width by the second moment and peak of columns over Hertz's for their sum, less 1."""
    middle = (np.arange(len(column)) + 0.5) * h
    load = 2.0 * column.sum()
    half = np.sqrt(8.0 * load * RADIUS / (np.pi * PLANE))
    width, most = 2.0 * np.sqrt((column * middle**2).sum() / column.sum()), 2.0 * load / (np.pi * half)
    near = middle < 0.5 * half
    peak = (column / h)[near].sum() / (most * np.sqrt(1.0 - (middle[near] / half) ** 2)).sum()
    return float(width / half - 1), float(peak - 1)


def of_nodes(column: np.ndarray, cell: float) -> tuple[float, float]:
    """The same of nodes, beside what they get of Hertz's pressure by hat functions averaged over a cell."""
    load = 2.0 * column.sum()
    half = np.sqrt(8.0 * load * RADIUS / (np.pi * PLANE))
    angle = (np.arange(4000) + 0.5) / 4000 * np.pi
    place, part = half * np.cos(angle), np.sin(angle) ** 2 / (np.sin(angle) ** 2).sum() * load
    node, moved = np.arange(len(column)) * cell, (np.arange(32) + 0.5) / 32 - 0.5
    exact = np.zeros(len(column))
    for one in moved * cell:
        weight = np.maximum(1.0 - np.abs(place[:, None] + one - node) / cell, 0.0)
        exact += part @ weight / len(moved)
    exact[0] *= 0.5
    # the moment that functions add is that of Hertz's nodes over its own, of a quarter of the half width squared
    more = 2.0 * (exact * node**2).sum() / load - 0.25 * half**2
    width = 2.0 * np.sqrt(2.0 * (column * node**2).sum() / load - more)
    near = node < 0.5 * half
    return float(width / half - 1), float(column[near].sum() / exact[near].sum() - 1)


def pressed(d: int, method: str, wanted: float, slow: float, rest: float, **contact: Any) -> SimpleNamespace:
    """Mean force of the rest over Hertz's, half width and peak in the plane (all less 1), and the run's columns."""
    with tempfile.TemporaryDirectory() as place:
        scene, end = tables(d, method, wanted, os.path.join(place, "cap.vtk"), slow, rest, contact)
        looking = Pressed(d, end, HALF / wanted)
        record = Record(looking)
        simulation(scene).run(None, [record])
    columns, column = record.columns(), looking.sum / looking.time
    force = columns["force"][columns["time"] >= end].mean() / LOAD[d] - 1.0
    if method == "grid":
        width, peak = of_nodes(column, scene["method"]["cell"])
    else:
        width, peak = of_particles(column, looking.h)
    return SimpleNamespace(force=force, width=width, peak=peak, columns=columns)
