"""How much of a field alternates from particle to particle: the sign of a method that lacks stabilisation.

`python tests/verification/checkerboard.py DIR...` prints the number for the pressure of runs at their times.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

# a direction of fewer particles (the layers of a plate) holds no wave that could be told from alternation
FEWEST = 5


def checkerboard_content(values: np.ndarray, directions: Sequence[int] | None = None) -> float:
    """The share of a field on a lattice that alternates along all the directions at once, 0 to 1.

    values (n0, n1, ...) on the lattice; directions: axes of it, all of at least `FEWEST` points unless given. With
    D_i p = (2 p_j - p_{j-1} - p_{j+1}) / 4 along direction i, the number is the root mean square of D_1 D_2 ... p over
    that of p, over all points with neighbours on both sides. It is 1 for (-1)^(j1 + j2 + ...), the product of
    sin^2(k_i dx_i / 2) for a wave, so that a smooth field has nearly nothing, and 0 where the field vanishes.

    Raises ValueError when there is no such direction or one has fewer than three points.
    """
    values = np.asarray(values, float)
    if directions is None:
        directions = [axis for axis, count in enumerate(values.shape) if count >= FEWEST]
    if not directions or min(values.shape[axis] for axis in directions) < 3:
        found = f"{list(directions)} of {values.shape}"
        raise ValueError(f"directions: expected at least one, of three points or more, found {found}")
    filtered, inner = values, values
    for axis in directions:
        low, mid, high = (
            np.take(filtered, np.arange(first, filtered.shape[axis] - 2 + first), axis) for first in (0, 1, 2)
        )
        filtered = 0.5 * mid - 0.25 * (low + high)
        inner = np.take(inner, np.arange(1, inner.shape[axis] - 1), axis)
    whole = np.sqrt(np.mean(inner**2))
    return float(np.sqrt(np.mean(filtered**2)) / whole) if whole > 0.0 else 0.0


def checkerboard_of_run(directory: Path | str, field: str = "pressure") -> list[tuple[float, float]]:
    """(time [s], checkerboard content) of a run's first body at the times of its fields.

    Raises SceneError when the folder holds no run, no such field, or the body's particles lie on no lattice.
    """
    from parsolid.output.results import Results
    from parsolid.particles.fillings import filling_of
    from parsolid.particles.lattice import Lattice
    from parsolid.scene import SceneError

    results = Results(directory)
    results.check_field(field)
    filled = results.bodies.get(0)
    dimension = results.dimension
    filling = filling_of(filled, dimension) if filled is not None and dimension is not None else None
    if not isinstance(filling, Lattice):
        raise SceneError([f"{directory}: expected a first body on a lattice, found none"])
    frames = results.frames(list(range(len(results.times))), field)
    return [
        (frame.time, checkerboard_content(frame.values[: filling.count].reshape(filling.shape))) for frame in frames
    ]


if __name__ == "__main__":
    for directory in sys.argv[1:]:
        print(directory)
        for time, content in checkerboard_of_run(directory):
            print(f"  t = {time:<10.6g} s  {content:.5f}")
