"""Bodies cut open: a half-space of them, or a section."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

from parsolid.particles.skins import Skin


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
    """The cut surface of a body in space whose lattice or mesh is known, or None where nothing is left of it.

    position (n, 3) [m], values (n,), coordinate (n,) [m] along the axis of the cut.
    """
    places, shown = skin.points(position, linear=True), skin.points(values, linear=False)
    along = skin.points(coordinate, linear=True)
    grid, rows = _of_elements(skin, places) if skin.lines is None else _of_lines(skin, places)
    grid["shown"], grid["cut"] = shown[rows], along[rows]
    if cut.above is None:
        left = grid.contour([cut.value], scalars="cut")
    else:
        surface = vtkGeometryFilter()
        surface.SetInputData(grid.clip_scalar(scalars="cut", value=cut.value, invert=not cut.above))
        surface.Update()
        left = pyvista.wrap(surface.GetOutput())
    return left if left.n_cells else None


def _of_lines(skin: Skin, places: np.ndarray) -> tuple[Any, np.ndarray]:
    """The grid of a lattice with points at places (p, 3) [m], and which of these each of its points is."""
    assert skin.lines is not None
    number = np.arange(len(places)).reshape([count for count, _ in skin.lines])
    for axis, (_, closed) in enumerate(skin.lines):
        if closed:
            number = np.concatenate([number, np.take(number, [0], axis)], axis=axis)
    return pyvista.StructuredGrid(*(places[number, k] for k in range(3))), number.ravel(order="F")


def _of_elements(skin: Skin, places: np.ndarray) -> tuple[Any, np.ndarray]:
    """The same of a mesh."""
    kinds = {getattr(pyvista.CellType, kind.upper()): cells for kind, cells in skin.elements or ()}
    return pyvista.UnstructuredGrid(kinds, np.ascontiguousarray(places)), np.arange(len(places))
