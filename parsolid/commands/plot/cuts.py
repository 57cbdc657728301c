"""Bodies cut open: a half-space of them, or a section."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

from parsolid.commands.plot.skins import Skin


@dataclass(frozen=True)
class Cut:
    """Keeps what lies on one side of a plane across an axis (above: greater coordinates), or what lies in it (None).

    present: the plane stands in the present configuration, else in the reference.
    """

    axis: int
    value: float
    above: bool | None
    present: bool

    def keeps(self, coordinate: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """Which particles (n,) at a coordinate (n,) [m] are shown; reach (n,) [m]: of a particle beyond its middle."""
        if self.above is None:
            return np.abs(coordinate - self.value) <= reach
        return coordinate >= self.value if self.above else coordinate <= self.value


def cut_body(skin: Skin, position: np.ndarray, values: np.ndarray, coordinate: np.ndarray, cut: Cut) -> Any:
    """The cut surface of a body of lattice particles in space, or None where nothing is left of it.

    position (n, 3) [m], values (n,), coordinate (n,) [m] along the axis of the cut.
    """
    assert skin.lines is not None
    places, shown = skin.points(position, linear=True), skin.points(values, linear=False)
    along = skin.points(coordinate, linear=True)
    counts = [count for count, _ in skin.lines]
    number = np.arange(len(places)).reshape(counts)
    for axis, (_, closed) in enumerate(skin.lines):
        if closed:
            number = np.concatenate([number, np.take(number, [0], axis)], axis=axis)
    grid = pyvista.StructuredGrid(*(places[number, k] for k in range(3)))
    rows = number.ravel(order="F")
    grid["shown"], grid["cut"] = shown[rows], along[rows]
    if cut.above is None:
        left = grid.contour([cut.value], scalars="cut")
    else:
        surface = vtkGeometryFilter()
        surface.SetInputData(grid.clip_scalar(scalars="cut", value=cut.value, invert=not cut.above))
        surface.Update()
        left = pyvista.wrap(surface.GetOutput())
    return left if left.n_cells else None
