"""How much of the material point method's error is quadrature: the command `quadrature`.

The particles carry the exact fields of the axis-aligned manufactured solution (`exact.manufactured`) at the time of its
largest strain, and a single evaluation gives accelerations at the nodes. Their error is compared with that of the same
lumped scheme whose integrals are worked out by Gauss points that are many enough to be exact: what is left then is the
basis, what is gone was quadrature.
"""

import csv
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

AMPLITUDE, DENSITY, YOUNGS_MODULUS, POISSONS_RATIO = 0.05, 1000.0, 1e7, 0.3
BASES = ("linear", "ugimp", "cpgimp", "quadratic-spline", "cubic-spline")
# bases whose weights do not depend on a particle's domain, and so have an exact integral
POINTWISE = ("linear", "quadratic-spline", "cubic-spline")
_HALVES, _GAUSS = 2, 4


class Points(NamedTuple):
    """Places X and x (n, 2) [m], volumes and masses (n,), half widths of their domains (n, 2) in grid spacings."""

    reference: np.ndarray
    current: np.ndarray
    volume: np.ndarray
    mass: np.ndarray
    halves: np.ndarray


def manufactured() -> tuple[Any, float]:
    """The solution and the time [s] of its largest strain."""
    from parsolid.exact.manufactured import AxisAligned, Solid

    mu = 0.5 * YOUNGS_MODULUS / (1.0 + POISSONS_RATIO)
    lame = YOUNGS_MODULUS * POISSONS_RATIO / ((1.0 + POISSONS_RATIO) * (1.0 - 2.0 * POISSONS_RATIO))
    solution = AxisAligned(AMPLITUDE, Solid(DENSITY, mu, lame, logarithmic=True))
    return solution, 0.5 * np.pi / solution.frequency


def _square(coordinates: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(coordinates, coordinates, indexing="ij"), axis=-1).reshape(-1, 2)


def reference_places(solution: Any, time: float, current: np.ndarray) -> np.ndarray:
    """X (n, 2) of places x (n, 2), by Newton's method, in which each direction is on its own.

    The displacement gradient is below 0.2, so that the first error of 0.2 X is round-off after five iterations.
    """
    places = current.copy()
    for _ in range(5):
        stretch, _ = solution.stretches(places, time)
        places -= (places + solution.displacement(places, time) - current) / stretch
    return places


def particles(solution: Any, time: float, cells: int, per_cell: int, stretched: bool) -> Points:
    """A lattice of particles with per_cell a cell and direction, displaced; `stretched` domains for cpGIMP."""
    count = cells * per_cell
    reference = _square((np.arange(count) + 0.5) / count)
    current = reference + solution.fields(reference, time)["displacement"]
    stretch = solution.stretches(reference, time)[0]
    halves = np.full_like(reference, 0.5 / per_cell) * (stretch if stretched else 1.0)
    volume = np.full(len(reference), 1.0 / count**2)
    return Points(reference, current, volume * stretch.prod(axis=1), DENSITY * volume, halves)


def gauss_points(solution: Any, time: float, cells: int) -> Points:
    """Gauss points of the half cells, over which every weight is a polynomial."""
    abscissae, weights = np.polynomial.legendre.leggauss(_GAUSS)
    width = 1.0 / (cells * _HALVES)
    coordinates = (width * (np.arange(cells * _HALVES)[:, None] + 0.5 + 0.5 * abscissae)).ravel()
    lengths = np.tile(0.5 * width * weights, cells * _HALVES)
    current, volume = _square(coordinates), np.outer(lengths, lengths).ravel()
    reference = reference_places(solution, time, current)
    mass = DENSITY * volume / solution.stretches(reference, time)[0].prod(axis=1)
    return Points(reference, current, volume, mass, np.full_like(current, 0.5))


def acceleration_error(kind: str, points: Points, solution: Any, time: float, cells: int) -> float:
    """Root mean square error of the nodal accelerations on the unit square over the largest; kind: of basis."""
    from parsolid.methods.mpm.weights import make_basis
    from parsolid.numerics.lanes import aligned_zeros

    n = len(points.mass)
    motion, halves, stress, force = (aligned_zeros((n + 4, columns)) for columns in (8, 4, 8, 4))
    motion[:n, :2], motion[:n, 3], halves[:n, :2] = points.current, points.mass, points.halves
    stress[:n, :3] = np.einsum("nii->ni", solution.fields(points.reference, time)["stress"]) * points.volume[:, None]
    force[:n, :2] = solution.body_force(points.reference, time) * points.mass[:, None]
    numbers, nodes = _scattered(make_basis(kind, halves), n, motion, stress, force, cells)
    inside = ((numbers >= 0) & (numbers <= cells)).all(axis=1)
    places = reference_places(solution, time, numbers[inside] / cells)
    exact = -(solution.frequency**2) * solution.fields(places, time)["displacement"]
    error = nodes[inside, 4:6] / nodes[inside, 3:4] - exact
    return float(np.sqrt((error**2).sum(axis=1).mean() / (exact**2).sum(axis=1).max()))


def _scattered(
    basis: Any, count: int, motion: np.ndarray, stress: np.ndarray, force: np.ndarray, cells: int
) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the nodes (n, 2) and their sums (n, 8), folded at the four sides of the unit square."""
    from decomposition.occupied import Mirror, OccupiedCells
    from parsolid.methods.mpm import grid
    from parsolid.methods.mpm.scatter import scatter
    from parsolid.methods.mpm.weights import base_offset, find_bases, nodes_across
    from parsolid.numerics.lanes import aligned_zeros
    from parsolid.numerics.layout import Plane

    origin, base = np.zeros(4), np.zeros((count, 2), np.int64)
    find_bases(0, count, motion, origin, float(cells), base_offset(basis), base)
    mirrors = [Mirror(axis, 2 * index, side) for axis in (0, 1) for index, side in ((0, 1), (cells, -1))]
    occupied = OccupiedCells(2, nodes_across(basis), tuple(mirrors))
    occupied.add(base)
    occupied.sort(base, count)
    rows = aligned_zeros((len(occupied.index), 4))
    rows[:, :2] = occupied.index
    topology = grid.Grid(origin, 1.0 / cells, float(cells), rows, occupied.start, occupied.order, occupied.stencil)
    nodes = aligned_zeros((len(occupied.nodes), 8))
    interpolation = grid.Interpolation(Plane(), basis, topology, grid.make_scratch(basis, 2), motion)
    scatter(interpolation, motion, grid.Flip(1.0), grid.CauchyStress(stress), force, nodes, None)
    for mirror in mirrors:
        behind, images, on_plane = occupied.mirrored(mirror)
        signs = np.ones((1, 8))
        signs[0, [mirror.axis, 4 + mirror.axis]] = -1.0
        ghost, image = np.concatenate((behind, on_plane)), np.concatenate((images, on_plane))
        grid.fold_mirror(ghost.astype(np.int32), image.astype(np.int32), signs, nodes)
    return occupied.nodes, nodes


def errors(kind: str, cells: int, per_cell: int) -> tuple[float, float | None]:
    """Errors of the accelerations with particles, and with exact integrals (None for averaged bases)."""
    solution, time = manufactured()
    lattice = particles(solution, time, cells, per_cell, kind == "cpgimp")
    found = acceleration_error(kind, lattice, solution, time, cells)
    if kind not in POINTWISE:
        return found, None
    return found, acceleration_error(kind, gauss_points(solution, time, cells), solution, time, cells)


def add_arguments(parser: ArgumentParser) -> None:
    """Give the arguments of `quadrature` to an argparse parser."""
    from parsolid.commands.arguments import whole_number

    parser.add_argument(
        "--cells",
        type=whole_number,
        nargs="+",
        default=[16, 32, 64],
        metavar="N",
        help="cells a side (default 16 32 64)",
    )
    parser.add_argument(
        "--per-cell",
        type=whole_number,
        nargs="+",
        default=[2],
        metavar="N",
        help="particles a cell and direction (default 2)",
    )
    parser.add_argument("-o", "--output", metavar="FILE", help="also write the table to a CSV file")


def run_quadrature(comm: MPI.Intracomm, options: Namespace) -> int:
    """Print the table on rank 0, which works alone; exit status 0."""
    if comm.rank == 0:
        _report(options)
    comm.Barrier()
    return 0


def _report(options: Namespace) -> None:
    from parsolid.commands.console_table import show_table

    names = ["basis", "cells", "particles a cell", "error", "error with exact integrals", "share of quadrature"]
    rows = []
    for kind in BASES:
        for per_cell in options.per_cell:
            for cells in options.cells:
                error, exact = errors(kind, cells, per_cell)
                share = "" if exact is None else f"{100.0 * (1.0 - exact / error):.2f} %"
                rows.append([kind, cells, per_cell**2, f"{error:.3g}", "" if exact is None else f"{exact:.3g}", share])
    show_table(
        "Nodal accelerations from exact fields on the particles, axis-aligned manufactured solution", names, rows
    )
    if options.output:
        with Path(options.output).open("w", newline="") as file:
            csv.writer(file).writerows([names, *rows])
