"""What happens at the edge of what a scene may ask of contact: python docs/contact_extremes.py [words of a case]."""

import os
import sys
import tempfile
from typing import Any

import meshio
import numpy as np
from contact_tables import SPEED, Tables, bars_scene, block, material, means, off, run, scene

from parsolid.collective import SolverError
from parsolid.scene import SceneError
from parsolid.simulation.loop import RunFailed

COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
H, V = 1.0 / 12, 0.02 * SPEED


def bars() -> dict[str, Tables]:
    """Two bars at L/h = 24, one of them other than usual; the last of a modulus of a million at L/h = 8."""
    soft, both = bars_scene(24, "equal"), ["left", "right"]
    cases = {f"stiffness {one}": soft | {"contact": [{"bodies": both, "stiffness": one}]} for one in (0.01, 100)}
    for name, moduli in (("modulus and density 1e6 to 1", (1e6, 1e6)), ("modulus 1e6 to 1", (1e6, 1.0))):
        cases[name] = bars_scene(24 if moduli[1] > 1.0 else 8, "equal", wide=4 if moduli[1] > 1.0 else 2)
        cases[name]["bodies"][1]["material"] = material(*moduli)
    coarse = bars_scene(24, "equal")
    coarse["bodies"][0]["particles"], coarse["bodies"][1]["particles"] = [97, 17], [25, 5]
    cases["spacing 1:4"] = coarse
    fast = bars_scene(24, "equal")
    fast["bodies"][0]["velocity"] = [0.6 * SPEED, 0.0]
    cases["closing at .6 c"] = fast | {"end_time": 1.0 / SPEED}
    return cases


def turned(name: str, tip: float, at: float = 0.0) -> Tables:
    """A square that stands on a corner at X = .5 and Y = tip, and comes down; at: where it is in the reference."""
    body = block(name, [0.0, at], [1.0, at + 1.0], H, velocity=["0", f"{-V}"])
    x, y, s = "(X-0.5)", f"(Y-{at + 0.5})", "0.7071067811865476"
    move = [f"{s}*({x}-{y})-{x}", f"{s}*({x}+{y})-{y}+({tip + 0.5**0.5 - 0.5 - at})"]
    return body | {"displacement": move}


def wedge(folder: str, angle: float) -> Tables:
    """A triangle whose tip has an angle [degrees], above Y = 0."""
    rows, half = 12, np.tan(np.radians(0.5 * angle))
    points = [(half * k * H * (2 * i - k) / max(k, 1), 0.01 + k * H) for k in range(rows) for i in range(k + 1)]
    first = [k * (k + 1) // 2 for k in range(rows + 1)]
    up = [(first[k] + i, first[k + 1] + i, first[k + 1] + i + 1) for k in range(rows - 1) for i in range(k + 1)]
    down = [(first[k] + i, first[k + 1] + i + 1, first[k] + i + 1) for k in range(1, rows - 1) for i in range(k)]
    file = os.path.join(folder, f"wedge_{angle:g}.vtk")
    places = np.hstack((np.array(points), np.zeros((len(points), 1))))
    meshio.Mesh(places, [("triangle", np.array(up + down))]).write(file)
    return {"name": "wedge", "shape": {"mesh": {"file": file}}, "velocity": ["0", f"{-V}"], "material": material()}


def corners(folder: str) -> dict[str, Tables]:
    """Corners and tips that run into faces and into each other."""
    base, end = block("base", [-0.5, -0.5], [1.5, 0.0], H), {"end": 3.0 / SPEED}
    below = turned("low", -(2.0**0.5) - 0.01, -2.0) | {"velocity": ["0", f"{V}"]}
    cases = {
        "a corner on a face": scene([turned("corner", 0.01), base], **end),
        "a corner on a corner": scene([turned("corner", 0.0), below], **end),
    }
    for angle in (60.0, 30.0):
        tip = wedge(folder, angle)
        cases[f"a tip of {angle:g} degrees on a face"] = scene([tip, block("base", [-1, -0.5], [1, 0], H)], **end)
    return cases


def copper(speed: float) -> list[Tables]:
    """Two blocks of 10 x 10 particles that close at a speed [m/s]."""
    sides = (("top", [0, 0], [1e-2, 1e-2], -0.5), ("low", [0, -1e-2], [1e-2, 0], 0.5))
    return [
        block(one, low, high, 1e-3, "cells", velocity=[0, v * speed], material=COPPER) for one, low, high, v in sides
    ]


def others() -> dict[str, Tables]:
    """Speeds of metals, many bodies, and what is refused."""
    cases = {}
    for name, method in (("ulsph", {"kind": "ulsph"}), ("mpm", {"kind": "mpm", "cell": 2e-3, "order": "musl"})):
        cases[f"copper closing at 3 km/s, {name}"] = scene(copper(3000.0), 12e-6, method=method)
    for speed in (50, 3000):
        for cfl in (0.25, 0.1):
            tables = scene(copper(speed), 4e-6, method={"kind": "ulsph", "cfl": cfl})
            cases[f"bonded copper closing at {speed} m/s, cfl {cfl}"] = tables | {"contact": []}
    corners_of = [(1.1 * (i % 10), 1.1 * (i // 10)) for i in range(100)]
    many = [
        block(f"b{i}", [x, y], [x + 1, y + 1], 0.25, "cells", velocity=[f"-0.02*({x - 5})", f"-0.02*({y - 5})"])
        for i, (x, y) in enumerate(corners_of)
    ]
    cases["100 bodies"] = scene(many, 48.0 / SPEED)
    touching = [block(n, [0, y], [1, y + 1], H, "cells", velocity=[0, v]) for n, y, v in (("a", 0.0, -V), ("b", -1, V))]
    cases["contact from the first step"] = scene(touching, 3.0 / SPEED)
    base = block("base", [0.0, -1.0], [1.0, 0.0], H, "cells")
    cases["one layer"] = scene([block("thin", [0.0, 0.0], [1.0, H], H, "cells"), base], 1.0)
    deep = block("deep", [0.0, 0.0], [1.0, 1.0], H, "cells", displacement=["0", "-0.4"])
    cases["overlap"] = scene([deep, base], 1.0)
    return cases


def outcome(name: str, tables: Tables) -> None:
    """What became of a scene."""
    try:
        simulation, columns = run(tables)
    except (SceneError, SolverError, RunFailed) as error:
        print(f"{name}: {str(error)[:300]}", flush=True)
        return
    pressed = columns.get("contact_energy", np.zeros(1))
    deepest = pressed.max() / columns["kinetic"].max()
    found: Any = [np.round(means_of(simulation, system)[:2], 5).tolist() for system in range(len(simulation.systems))]
    print(
        f"{name}: {simulation.clock.step} steps, balance {off(columns):.1e} (at the end "
        f"{abs(columns['energy_error'][-1]) / columns['kinetic'].max():.1e}), contact energy up to {deepest:.2g} of "
        f"the kinetic and {pressed[-1] / columns['kinetic'].max():.1g} at the end, velocities {found}, "
        f".01 c = {0.01 * SPEED:.4g}",
        flush=True,
    )


def means_of(simulation: Any, system: int) -> np.ndarray:
    """Mean velocities of a system's bodies [m/s]."""
    one = type("One", (), {"systems": [simulation.systems[system]]})
    return means(one)  # type: ignore[arg-type]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        for label, stated in (bars() | corners(place) | others()).items():
            if not sys.argv[1:] or any(word in label for word in sys.argv[1:]):
                outcome(label, stated)
