"""Hertz in space, of particles: a quarter of a ball's cap on a quarter of a block, both of one solid.

The cap's lattice is the block's, moved up by the ball's surface, so that every layer follows it: a lattice that is cut
by a ball is flat at its pole. What is beyond four half widths is a half space whose displacements are those of a point
load (Boussinesq), and outer layers move by them, so the approach is that of points at infinity. Methods: tlsph,
peridynamics, mpm, and grid (mpm with contact on the grid).
"""

import os
import tempfile
from typing import Any

import meshio
import numpy as np
from hertz_in_plane import POISSON, SPEED, YOUNG, Tables, block, material, of_contact, of_method, run

# of the last contact, over the radius; sides of the boxes in half widths; time of the approach over that of a wave
# through a box, and rest after it
FLATNESS, SIDE, SLOW, REST = 0.1, 4.0, 16.0, 4.0
RADIUS = 1.0
HALF = FLATNESS * RADIUS
REDUCED = YOUNG / (2.0 * (1.0 - POISSON**2))
APPROACH = HALF**2 / RADIUS
LOAD = 4.0 / 3.0 * REDUCED * RADIUS**0.5 * APPROACH**1.5
METHODS: dict[str, Tables] = {
    "tlsph": {"kind": "tlsph", "integrator": "leapfrog"},
    "peridynamics": {"kind": "peridynamics", "solution": {"kind": "explicit"}},
    "mpm": {"kind": "mpm"},
    "grid": {"kind": "mpm"},
}


def cap(count: int, h: float, file: str) -> None:
    """Hexahedra of the cap, one for each particle."""
    line = np.arange(count + 1) * h
    X, Y, Z = (one.ravel() for one in np.meshgrid(line, line, line, indexing="ij"))
    places = np.stack([X, Y, Z + RADIUS - np.sqrt(RADIUS**2 - X**2 - Y**2)], axis=1)
    number = np.arange((count + 1) ** 3).reshape((count + 1,) * 3)
    low, high = slice(None, -1), slice(1, None)
    corners = [(low, low, low), (high, low, low), (high, high, low), (low, high, low)]
    corners += [(low, low, high), (high, low, high), (high, high, high), (low, high, high)]
    cells = np.stack([number[one].ravel() for one in corners], axis=1)
    meshio.Mesh(places, [("hexahedron", cells)]).write(file)


def guided(side: float, thick: float, end: float) -> list[Tables]:
    """Velocities of outer layers: of a point load on each half space, and the cap's approach."""
    x = f"(t/{end})"
    s, rate = f"({x}**3*(10 - 15*{x} + 6*{x}**2))", f"(30/{end}*{x}**2*(1 - {x})**2)"
    going = f"*where(t < {end}, 1, 0)"
    force = f"{1.5 * LOAD}*sqrt(abs({s}))*{rate}{going}"
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    rho = "sqrt(X**2 + Y**2 + Z**2)"
    result = []
    for name, sign in (("block", -1.0), ("cap", 1.0)):
        depth = f"({sign}*Z)"
        factor = f"{1.0 / (4.0 * np.pi * shear)}/{rho}*{force}"
        out = f"{factor}*({depth}/{rho}**2 - {1.0 - 2.0 * POISSON}/({rho} + {depth}))"
        along = f"{sign}*{factor}*({depth}**2/{rho}**2 + {2.0 * (1.0 - POISSON)})"
        approach = f" - {APPROACH}*{rate}{going}" if name == "cap" else ""
        velocity = [f"X*{out}", f"Y*{out}", along + approach]
        lower, upper = [-side, -side, -side * 2.0], [side * 2.0] * 3
        for axis in range(3):
            low, high = list(lower), list(upper)
            if axis == 2:
                low, high = ([*lower[:2], side - thick], high) if sign > 0 else (low, [*upper[:2], thick - side])
            else:
                low[axis] = side - thick
            box = {"lower": low, "upper": high}
            result.append({"kind": "velocity", "box": box, "body": name, "velocity": velocity})
    return result


def tables(method: str, wanted: float, file: str, more: Tables) -> tuple[Tables, float]:
    """The scene with so many spacings in the half width, and the time of the approach."""
    h = HALF / wanted
    count = round(SIDE * wanted)
    side = count * h
    cap(count, h, file)
    kind = "linear-elastic" if method == "peridynamics" else "neo-hookean"
    solid = material(kind=kind)
    base = block("block", [0.0, 0.0, -side], [side, side, 0.0], h, "cells", material=solid)
    ball = {"name": "cap", "shape": {"mesh": {"file": file}}, "placement": "cells", "material": solid}
    end = SLOW * side / SPEED
    settings = METHODS[method] | ({"cell": 2.0 * h} if METHODS[method]["kind"] == "mpm" else {})
    settings |= of_method(settings["kind"], more)
    sides = [{"plane": f"{axis} = 0", "kind": "roller"} for axis in "XY"]
    contact = {"bodies": ["cap", "block"]} | ({"model": "grid"} if method == "grid" else {}) | of_contact(more)
    return {
        "dimension": 3,
        "end_time": end + REST * side / SPEED,
        "method": settings | {"balance_limit": 10.0, "balance_warning": 9.0},
        "bodies": [base, ball],
        "contact": [contact],
        "boundaries": [*sides, *guided(side, (3.01 if method == "peridynamics" else 2.01) * h, end)],
        "output": {"fields_times": []},
    }, end


def force_on_block(simulation: Any) -> Tables:
    """Along Z, of the whole ball."""
    owned = simulation.systems[0].particles.owned_rows
    if simulation.interactions and hasattr(simulation.interactions[0], "pairs"):
        met = simulation.interactions[0].pairs[0]
        if not met.slots:
            return {"force": 0.0}
        here = met.slots[0] >= 0
        share = simulation.systems[0].nodes.share[met.slots[0][here]]
        step = max(simulation.clock.time - force_on_block.time, 1e-300)  # type: ignore[attr-defined]
        force_on_block.time = simulation.clock.time  # type: ignore[attr-defined]
        return {"force": 4.0 * float((share * met.impulse[here, 2]).sum()) / step}
    return {"force": -4.0 * float(owned("contact_force")[owned("body") == 0, 2].sum())}


def pressed(method: str, wanted: float, more: Tables) -> tuple[np.ndarray, np.ndarray, Tables]:
    """Share of the last approach and force over the last load (steps,), and the columns of the run."""
    force_on_block.time = 0.0  # type: ignore[attr-defined]
    with tempfile.TemporaryDirectory() as place:
        scene, end = tables(method, wanted, os.path.join(place, "cap.vtk"), more)
        _, columns = run(scene, force_on_block)
    x = np.minimum(columns["time"] / end, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2), columns["force"] / LOAD, columns
