"""Error and processor time of equilibria of meshes beside linear finite elements with the same nodes, solved directly.

python benchmarks/static_cost.py [lame kirsch cantilever] [--profile]

Triangles in plane strain, nu .3, small strain, against exact solutions: a thick ring under pressure (Lame), a plate
with a hole (Kirsch, exact displacements on the outer edges), a cantilever under a parabolic shear (Timoshenko, exact
displacements where it is held). The error is that of displacements, root of the mean square over nodes. Seconds of
parsolid are those of set-up and of the equilibrium, without compilation; those of elements of assembly and solution.
The last column has the seconds of parsolid over those that elements need for its error, by a power law of all meshes.
"""

import cProfile
import os
import pstats
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

# as parsolid does, which numpy comes before here
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import meshio
import numpy as np
from linear_elements import LinearElements
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

E, NU, SIZE = 1.0, 0.3, 1e-7
G, KAPPA = E / (2.0 + 2.0 * NU), 3.0 - 4.0 * NU
LAW = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": E, "poissons_ratio": NU}


class Problem(NamedTuple):
    """points: places (n, 2) of a grid (i, j) in [0, 1]^2; counts: cells of the coarsest; exact: displacements (n, 2)
    [m]; boundaries: of the scene; held (n, 2): from places; side, traction: the side that is loaded, and tractions
    (n, 2) [Pa] from places."""

    points: Any
    counts: tuple[int, int]
    exact: Any
    boundaries: list[dict[str, Any]]
    held: Any
    side: str = "bore"
    traction: Any = np.zeros_like


def lame() -> Problem:
    """A quarter of a ring 1 < r < 2 under a pressure within."""
    A = SIZE * (1.0 + NU) / 3.0 / E

    def exact(X: np.ndarray) -> np.ndarray:
        r = np.hypot(*X.T)[:, None]
        return A * ((1.0 - 2.0 * NU) + 4.0 / r**2) * X

    def points(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        r, angle = 1.0 + s, 0.5 * np.pi * t
        X = np.stack((r * np.cos(angle), r * np.sin(angle)), axis=1)
        return np.where(np.abs(X) < 1e-12, 0.0, X)

    within = {"where": "bore", "kind": "traction", "traction": [f"{SIZE}*X*t", f"{SIZE}*Y*t"]}
    rollers = [{"plane": f"{axis} = 0", "kind": "roller"} for axis in "XY"]
    return Problem(points, (4, 6), exact, [*rollers, within], lambda X: np.abs(X) < 1e-9, "bore", lambda X: SIZE * X)


def kirsch() -> Problem:
    """A quarter of a square of side 8 with a hole of radius 1, drawn along X."""

    def parts(r: Any, c1: Any, s1: Any, c3: Any, s3: Any) -> tuple[Any, Any]:
        return (
            r * (KAPPA + 1.0) * c1 + 2.0 / r * ((1.0 + KAPPA) * c1 + c3) - 2.0 / r**3 * c3,
            r * (KAPPA - 3.0) * s1 + 2.0 / r * ((1.0 - KAPPA) * s1 + s3) - 2.0 / r**3 * s3,
        )

    def exact(X: np.ndarray) -> np.ndarray:
        r, a = np.hypot(*X.T), np.arctan2(X[:, 1], X[:, 0])
        found = parts(r, np.cos(a), np.sin(a), np.cos(3.0 * a), np.sin(3.0 * a))
        return SIZE / (8.0 * G) * np.stack(found, axis=1)

    def points(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        angle = 0.5 * np.pi * t
        near = np.stack((np.cos(angle), np.sin(angle)), axis=1)
        far = 4.0 * near / np.abs(near).max(axis=1)[:, None]
        share = (s * (1.0 + 2.0 * s) / 3.0)[:, None]
        X = near + share * (far - near)
        return np.where(np.abs(X) < 1e-12, 0.0, X)

    r, a = "sqrt(X**2 + Y**2)", "atan2(Y, X)"
    one = f"({r}*{KAPPA + 1.0}*cos({a}) + 2/{r}*({KAPPA + 1.0}*cos({a}) + cos(3*{a})) - 2/{r}**3*cos(3*{a}))"
    two = f"({r}*{KAPPA - 3.0}*sin({a}) + 2/{r}*({1.0 - KAPPA}*sin({a}) + sin(3*{a})) - 2/{r}**3*sin(3*{a}))"
    moved = [f"{SIZE / (8.0 * G)!r}*t*{part}" for part in (one, two)]
    rollers = [{"plane": f"{axis} = 0", "kind": "roller"} for axis in "XY"]
    driven = {"where": "outside", "kind": "displacement", "displacement": moved}
    outer = 4.0 - 1e-9
    return Problem(
        points, (6, 8), exact, [*rollers, driven], lambda X: (np.abs(X) < 1e-9) | (X.max(axis=1) > outer)[:, None]
    )


def cantilever() -> Problem:
    """10 x 1, of which the end X = 0 is held."""
    modulus, ratio, L = E / (1.0 - NU**2), NU / (1.0 - NU), 10.0
    scale = SIZE / (6.0 * modulus / 12.0)

    def exact(X: np.ndarray) -> np.ndarray:
        x, y = X.T
        along = y * ((6.0 * L - 3.0 * x) * x + (2.0 + ratio) * (y**2 - 0.25))
        across = 3.0 * ratio * y**2 * (L - x) + (4.0 + 5.0 * ratio) * x / 4.0 + (3.0 * L - x) * x**2
        return scale * np.stack((along, -across), axis=1)

    held = [f"{scale!r}*t*Y*{2.0 + ratio!r}*(Y**2 - 0.25)", f"-{3.0 * scale * ratio * L!r}*t*Y**2"]
    pushed = {"plane": "X = 10", "kind": "traction", "traction": ["0", f"-{6.0 * SIZE}*(0.25 - Y**2)*t"]}

    def traction(X: np.ndarray) -> np.ndarray:
        return np.stack((np.zeros(len(X)), -6.0 * SIZE * (0.25 - X[:, 1] ** 2)), axis=1)

    return Problem(
        lambda s, t: np.stack((L * s, t - 0.5), axis=1), (40, 4), exact,
        [{"plane": "X = 0", "kind": "displacement", "displacement": held}, pushed],
        lambda X: np.repeat(X[:, :1] < 1e-9, 2, axis=1), "outside", traction,
    )  # fmt: skip


def mesh(problem: Problem, factor: int) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Places, triangles, and edges (k, 2) of the sides of the grid."""
    m, n = (factor * count for count in problem.counts)
    s, t = (one.ravel() for one in np.meshgrid(np.arange(m + 1) / m, np.arange(n + 1) / n, indexing="ij"))
    number = np.arange((m + 1) * (n + 1)).reshape(m + 1, n + 1)
    a, b, c, d = (one.ravel() for one in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    turned = ((np.arange(m)[:, None] + np.arange(n)) % 2 == 0).ravel()
    first = np.where(turned[:, None], np.stack((a, b, c), axis=1), np.stack((a, b, d), axis=1))
    second = np.where(turned[:, None], np.stack((a, c, d), axis=1), np.stack((b, c, d), axis=1))
    sides = {"bore": number[0], "outside": number[-1], "low": number[:, 0], "high": number[:, -1]}
    lines = {name: np.stack((one[:-1], one[1:]), axis=1) for name, one in sides.items()}
    return problem.points(s, t), np.concatenate((first, second)), lines


def by_elements(problem: Problem, X: np.ndarray, cells: np.ndarray, lines: dict[str, np.ndarray]) -> np.ndarray:
    """Displacements (n, 2) [m]."""
    load, edges = np.zeros(X.shape), lines[problem.side]
    length = np.linalg.norm(X[edges[:, 1]] - X[edges[:, 0]], axis=1)[:, None]
    for k in (0, 1):
        np.add.at(load, edges[:, k], 0.5 * length * problem.traction(X[edges[:, k]]))
    held = problem.held(X)
    return LinearElements(X, cells, E, NU).displacement(~held, load, np.where(held, problem.exact(X), 0.0))


def scene_of(problem: Problem, file: Path) -> dict[str, Any]:
    """Raw tables."""
    method = {"kind": "tlsph", "integrator": "static", "weights": "mesh"}
    body = {"shape": {"mesh": {"file": str(file)}}, "material": LAW}
    return {"dimension": 2, "end_time": 1.0, "method": method, "bodies": [body], "boundaries": problem.boundaries}


def write(file: Path, X: np.ndarray, cells: np.ndarray, lines: dict[str, np.ndarray]) -> None:
    """A mesh with the sides as groups."""
    tags = np.repeat(np.arange(2, 2 + len(lines)), [len(one) for one in lines.values()])
    edges = np.concatenate(list(lines.values()))
    numbers = [np.ones(len(cells), int), tags]
    named = {"body": np.array([1, 2])} | {name: np.array([i, 1]) for i, name in enumerate(lines, 2)}
    data = {"gmsh:physical": numbers, "gmsh:geometrical": numbers}
    points = np.column_stack((X, np.zeros(len(X))))
    made = meshio.Mesh(points, [("triangle", cells), ("line", edges)], cell_data=data, field_data=named)
    meshio.write(file, made, file_format="gmsh22", binary=True)


def by_particles(data: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, tuple[float, float], Any]:
    """Places and displacements, processor seconds of set-up and of the equilibrium, and the equilibria."""
    began = time.process_time()
    simulation: Any = Simulation(MPI.COMM_SELF, parse_scene(data))
    ready = time.process_time()
    simulation.take_step(1.0)
    ended = time.process_time()
    of, statics = simulation.systems[0].particles.owned_rows, simulation.systems[0].statics
    if statics.fault:
        raise SystemExit(statics.fault)
    return of("reference_position").copy(), of("displacement").copy(), (ready - began, ended - ready), statics


def error(problem: Problem, X: np.ndarray, u: np.ndarray) -> float:
    """Of displacements."""
    exact = problem.exact(X)
    return float(np.sqrt(np.sum((u - exact) ** 2) / np.sum(exact**2)))


def main() -> None:
    """A row for each problem and mesh."""
    names = [one for one in sys.argv[1:] if not one.startswith("-")] or ["lame", "kirsch", "cantilever"]
    folder = Path(tempfile.mkdtemp())
    print("| | nodes | error, elements | s | error, particles | set-up s | equilibrium s | products | ratio |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in names:
        problem, rows = {"lame": lame, "kirsch": kirsch, "cantilever": cantilever}[name](), []
        # compiles
        write(folder / "first.msh", *mesh(problem, 4))
        by_particles(scene_of(problem, folder / "first.msh"))
        for factor in (2, 4, 8, 16):
            X, cells, lines = mesh(problem, factor)
            began = time.process_time()
            u = by_elements(problem, X, cells, lines)
            spent = time.process_time() - began
            file = folder / f"{name}{factor}.msh"
            write(file, X, cells, lines)
            profile = cProfile.Profile()
            if "--profile" in sys.argv and factor == 16:
                profile.enable()
            places, moved, seconds, statics = by_particles(scene_of(problem, file))
            profile.disable()
            rows.append((error(problem, X, u), spent, error(problem, places, moved), *seconds, statics.products))
            if "--profile" in sys.argv and factor == 16:
                pstats.Stats(profile).sort_stats("cumulative").print_stats(60)
            print_row(name, len(X), np.array(rows))


def print_row(name: str, count: int, rows: np.ndarray) -> None:
    """The last one; the ratio by the orders between all meshes so far."""
    *_, (missed, spent, left, ready, solved, products) = rows
    ratio = ""
    if len(rows) > 1:
        order = np.polyfit(np.log(rows[:, 0]), np.log(rows[:, 1]), 1)
        ratio = f"{(ready + solved) / np.exp(np.polyval(order, np.log(left))):.2f}"
    numbers = [f"{missed:.2e}", f"{spent:.2f}", f"{left:.2e}", f"{ready:.2f}", f"{solved:.2f}", int(products), ratio]
    print("|", " | ".join(map(str, [name, count, *numbers])), "|", flush=True)


if __name__ == "__main__":
    main()
