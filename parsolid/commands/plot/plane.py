"""Pictures of bodies in 2-D by matplotlib."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.tri import Triangulation
from scipy.spatial import cKDTree

from parsolid.commands.plot.scales import Scale
from parsolid.output.results import Frame
from parsolid.particles.skins import Skin

# snapping to pixels would separate the short lines of an edge
_EDGES: dict[str, Any] = {"colors": "#202020", "linewidths": 0.4, "alpha": 0.3, "snap": False}
# colour of bodies without the field, as in 3-D
_NO_COLOUR = "#b8b8b8"
_OUTLINE: dict[str, Any] = {"colors": "#202020", "linewidths": 0.9, "snap": False, "capstyle": "round"}

# particles without a lattice or mesh: half the side of their squares over the spacing, with a small overlap; distance,
# over the spacing, of three particles between which the space is filled; pixels of the image per pixel of the picture,
# and across the smallest particle
_SQUARE, _NEAR, _FINER, _LEAST = 0.51, 1.05, 2.0, 5.0


@dataclass(frozen=True)
class Cut:
    """A cut by a plane normal to an axis: above: keep greater coordinates (True), smaller ones (False), or a section
    (None); present: in the present configuration, else in the reference."""

    axis: int
    value: float
    above: bool | None
    present: bool

    def keeps(self, coordinate: np.ndarray, reach: np.ndarray | float) -> np.ndarray:
        """Which particles (n,) with a coordinate (n,) [m] are drawn; reach (n,) [m]: half width of a section."""
        if self.above is None:
            return np.abs(coordinate - self.value) <= reach
        return coordinate >= self.value if self.above else coordinate <= self.value


class PlaneView:
    """The visible part of the plane: lower and upper corner (frames, 2) [m], of equal size in all frames."""

    def __init__(self, frames: list[Frame], follow: bool, margin: float) -> None:
        """follow: centre each frame on its bodies; margin [m]: distance of the surface from the particles."""
        lower = np.array([frame.position[:, :2].min(axis=0) for frame in frames])
        upper = np.array([frame.position[:, :2].max(axis=0) for frame in frames])
        if not follow:
            lower[:], upper[:] = lower.min(axis=0), upper.max(axis=0)
        size = (upper - lower).max(axis=0)
        # with room for the outline
        half = 0.5 * size + margin + 0.01 * size.max()
        half = np.maximum(half, max(0.05 * half.max(), 1e-300))
        middle = 0.5 * (lower + upper)
        self.lower, self.upper = middle - half, middle + half

    @property
    def aspect(self) -> float:
        """Width over height."""
        width, height = self.upper[0] - self.lower[0]
        return float(width / height)

    # directions of the coordinate axes in the picture
    directions = np.eye(2)

    def pixels_of_a_metre(self, width: int, height: int) -> float:
        """Pixels per metre in a picture of a size in pixels."""
        across, up = self.upper[0] - self.lower[0]
        return float(min(width / across, height / up))


def draw_plane(
    axes: Any,
    skins: list[Skin],
    volume: np.ndarray,
    frame: Frame,
    number: int,
    view: PlaneView,
    scale: Scale,
    cut: Cut | None = None,
    seams: Sequence[tuple[int, float]] = (),
) -> None:
    """Draw the frame with an index into axes; seams: see `_edges`."""
    axes.set(xlim=(view.lower[number, 0], view.upper[number, 0]), ylim=(view.lower[number, 1], view.upper[number, 1]))
    axes.set_aspect("equal")
    axes.set_axis_off()
    limits = Normalize(scale.lower, scale.upper)
    for skin in skins:
        rows = slice(skin.first, skin.last)
        position, values = frame.position[rows, :2], frame.values[rows]
        size, along = volume[rows], np.empty(0) if frame.along is None else frame.along[rows]
        if skin.patches is None:
            left = slice(None) if cut is None else cut.keeps(along, 0.0)
            _particles(axes, position[left], values[left], size[left], limits, scale)
            continue
        points, shown = skin.points(position, linear=True), skin.points(values, linear=False)
        patches = skin.patches
        if cut is not None:
            there = cut.keeps(skin.points(along, linear=True), 0.0)
            patches = [faces[there[faces].all(axis=1)] for faces in patches]
        patches = [faces for faces in patches if len(faces)]
        for faces in patches:
            _fill(axes, points, shown, faces, limits, scale)
        if patches:
            _edges(axes, points, patches, seams)


def _fill(axes: Any, points: Any, values: np.ndarray, faces: Any, limits: Any, scale: Any) -> None:
    if faces.shape[1] == 4:
        # four triangles around the middle, so that no diagonal is preferred
        middle = len(points) + np.arange(len(faces))
        points = np.concatenate([points, points[faces].mean(axis=1)])
        values = np.concatenate([values, values[faces].mean(axis=1)])
        sides = [np.stack([faces[:, i], faces[:, (i + 1) % 4], middle], axis=1) for i in range(4)]
        faces = np.concatenate(sides)
    triangles = Triangulation(points[:, 0], points[:, 1], faces)
    if np.isnan(values).all():
        # a body without the field
        axes.tripcolor(triangles, np.zeros(len(points)), cmap=ListedColormap([_NO_COLOUR]), rasterized=True)
        return
    axes.tripcolor(triangles, values, shading="gouraud", cmap=scale.colours, norm=limits, rasterized=True)


def _edges(axes: Any, points: Any, patches: list[np.ndarray], seams: Sequence[tuple[int, float]]) -> None:
    """Draw edges of faces that are large enough, and the outline but for seams between images.

    seams: axis of a mirror plane, and distance from it [m] within which points are on it
    """
    edges = [
        np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1) for faces in patches
    ]
    pairs, count = np.unique(np.concatenate(edges), axis=0, return_counts=True)
    box = axes.get_window_extent()
    pixels = box.height / np.ptp(axes.get_ylim())
    inner = points[pairs[count > 1]]
    if len(inner) and np.median(np.linalg.norm(inner[:, 1] - inner[:, 0], axis=1)) * pixels > 5.0:
        axes.add_collection(LineCollection(inner, **_EDGES))
    outline = points[pairs[count == 1]]
    for axis, near in seams:
        outline = outline[(np.abs(outline[:, :, axis]) > near).any(axis=1)]
    axes.add_collection(LineCollection(outline, **_OUTLINE))


def _particles(axes: Any, position: Any, values: np.ndarray, volume: Any, limits: Any, scale: Any) -> None:
    """Draw particles: a pixel in a particle's square, or near three particles, has the colour of the nearest one."""
    if not len(position):
        return
    box, (left, right), (lower, upper) = axes.get_window_extent(), axes.get_xlim(), axes.get_ylim()
    columns, rows = (max(2, round(_FINER * length)) for length in (box.width, box.height))
    across = left + (np.arange(columns) + 0.5) * (right - left) / columns
    up = lower + (np.arange(rows) + 0.5) * (upper - lower) / rows
    pixels = np.stack(np.meshgrid(across, up), axis=-1)
    # single particles stay visible
    side = np.maximum(np.sqrt(volume), _LEAST * (right - left) / columns)
    away, who = cKDTree(position).query(pixels, k=3, distance_upper_bound=_NEAR * side.max())
    there = who[..., 0] < len(position)
    first = np.where(there, who[..., 0], 0)
    squares = np.abs(pixels - position[first]).max(axis=-1) <= _SQUARE * side[first]
    shown = there & (squares | (away[..., 2] <= _NEAR * side[first]))
    colours = colormaps[scale.colours].with_extremes(bad=_NO_COLOUR)(limits(np.ma.masked_invalid(values)))
    image = np.where(shown[..., None], colours[first], 0.0)
    axes.imshow(image, extent=(left, right, lower, upper), origin="lower", interpolation="antialiased", aspect="equal")
