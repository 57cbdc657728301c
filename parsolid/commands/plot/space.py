"""Pictures of three-dimensional bodies, drawn by VTK without a display."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

from parsolid.commands.plot.scales import Scale
from parsolid.output.results import Frame
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
    number = np.arange(len(places))
    grid: Any
    if skin.lines is None:
        kinds = {getattr(pyvista.CellType, kind.upper()): cells for kind, cells in skin.elements or ()}
        grid, rows = pyvista.UnstructuredGrid(kinds, np.ascontiguousarray(places)), number
    else:
        # a lattice, whose closed lines end with their first points
        number = number.reshape([count for count, _ in skin.lines])
        for axis, (_, closed) in enumerate(skin.lines):
            if closed:
                number = np.concatenate([number, np.take(number, [0], axis)], axis=axis)
        grid, rows = pyvista.StructuredGrid(*(places[number, k] for k in range(3))), number.ravel(order="F")
    grid["shown"], grid["cut"] = shown[rows], along[rows]
    if cut.above is None:
        left = grid.contour([cut.value], scalars="cut")
    else:
        surface = vtkGeometryFilter()
        surface.SetInputData(grid.clip_scalar(scalars="cut", value=cut.value, invert=not cut.above))
        surface.Update()
        left = pyvista.wrap(surface.GetOutput())
    return left if left.n_cells else None


# VTK tells of every way of drawing that it tries in vain
vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)

_DIRECTIONS = {"iso": (1.0, -1.25, 0.75), "front": (0.0, -1.0, 0.0), "side": (1.0, 0.0, 0.0), "top": (0.0, 0.0, 1.0)}
_DIRECTIONS["below"] = (1.0, -1.25, -0.75)
# drawn larger and reduced: smooth edges from any renderer
_OVERSAMPLING = 2
# an edge between faces that turn by more [degrees] is one of the body
_SHARP = 40.0
_EDGE_COLOUR, _EDGE_OPACITY = "#202020", 0.28
# triangles of all spheres together, and of the finest one
_TRIANGLES, _FINEST = 1_000_000, 12


class Camera:
    """A parallel view on all frames of a picture.

    right, up, towards: unit vectors, the last one to the viewer; span: (width, height) [m] of what is seen.
    """

    def __init__(
        self, frames: list[Frame], view: str | tuple[float, float, float], follow: bool, margin: float, upright: int = 2
    ) -> None:
        """follow: keep each frame's own middle in the middle; margin [m]: how far the body reaches beyond the
        particles; upright: the vertical axis.
        """
        direction = np.array(_DIRECTIONS[view] if isinstance(view, str) else view, float)
        if isinstance(view, str) and upright == 1:
            # the named views turn with the upright axis, from Z to Y
            direction = np.array([direction[0], direction[2], -direction[1]])
        elif isinstance(view, str) and upright == 0:
            direction = np.array([direction[2], direction[0], direction[1]])
        self.towards = direction / np.linalg.norm(direction)
        up = np.eye(3)[upright]
        if abs(self.towards @ up) > 0.99:
            up = np.eye(3)[1] if upright == 2 else -np.eye(3)[2]
        self.right = np.cross(up, self.towards)
        self.right /= np.linalg.norm(self.right)
        self.up = np.cross(self.towards, self.right)
        axes = np.array([self.right, self.up, self.towards])
        seen = [frame.position @ axes.T for frame in frames]
        lows, highs = (
            np.array([places.min(axis=0) for places in seen]),
            np.array([places.max(axis=0) for places in seen]),
        )
        if not follow:
            lows[:], highs[:] = lows.min(axis=0), highs.max(axis=0)
        self.middles, size = 0.5 * (lows + highs), (highs - lows).max(axis=0)
        self.middles = self.middles @ axes
        self.depth = float(size[2]) + 2.0 * margin
        width, height = size[:2] + 2.0 * margin
        self.span = (float(max(width, 0.05 * height, 1e-300)), float(max(height, 0.05 * width, 1e-300)))

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.span[0] / self.span[1]

    @property
    def directions(self) -> np.ndarray:
        """Of the coordinates' axes in the picture (3, 2)."""
        return np.stack([self.right, self.up], axis=1)

    def pixels_of_a_metre(self, width: int, height: int) -> float:
        """In a picture of so many pixels."""
        return height / max(self.span[1], self.span[0] * height / width)


class Renderer:
    """Draws frames from one camera at one size in pixels."""

    def __init__(
        self,
        skins: list[Skin],
        volume: np.ndarray,
        camera: Camera,
        scale: Scale,
        size: tuple[int, int],
        cut: Cut | None = None,
        mirror: tuple[int, ...] = (),
    ) -> None:
        """skins: of all bodies, then of their images in the planes of the axes `mirror`."""
        self.skins, self.camera, self.scale, self.size = skins, camera, scale, size
        self.cut, self.mirror = cut, mirror
        self.volume = volume
        window = [_OVERSAMPLING * max(1, pixels) for pixels in size]
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=window, lighting="none", border=False)
        self._plotter = plotter
        plotter.background_color = "white"
        # a main light from the upper left of the viewer, a weak one from the right
        upper_left, right = camera.towards + 0.6 * camera.up - 0.5 * camera.right, camera.towards + camera.right
        for direction, intensity in ((upper_left, 0.72), (right, 0.3)):
            light = pyvista.Light(
                position=direction, focal_point=(0, 0, 0), intensity=intensity, light_type="scene light"
            )
            plotter.add_light(light)

    def draw(self, frame: Frame, number: int) -> np.ndarray:
        """The picture (height, width, 3) uint8 of a frame, the number-th of the camera's."""
        plotter = self._plotter
        plotter.clear_actors()
        bodies = len(self.skins) // 2 ** len(self.mirror)
        for body in range(bodies):
            self._add_body(frame, self.skins[body::bodies])
        camera = self.camera
        middle = camera.middles[number]
        distance = 2.0 * camera.depth + max(camera.span)
        plotter.camera.position = middle + distance * camera.towards
        plotter.camera.focal_point = middle
        plotter.camera.up = camera.up
        plotter.camera.parallel_projection = True
        aspect = self.size[0] / self.size[1]
        plotter.camera.parallel_scale = 0.5 * max(camera.span[1], camera.span[0] / aspect)
        plotter.camera.clipping_range = (1e-3 * distance, 2.0 * distance + camera.depth)
        plotter.render()
        image = plotter.screenshot(return_img=True)
        width, height = self.size
        blocks = image[: height * _OVERSAMPLING, : width * _OVERSAMPLING, :3].reshape(
            height, _OVERSAMPLING, width, _OVERSAMPLING, 3
        )
        return blocks.mean(axis=(1, 3)).round().astype(np.uint8)

    def _add_body(self, frame: Frame, skins: list[Skin]) -> None:
        """Draw a body and its images."""
        pieces = []
        for image, skin in enumerate(skins):
            rows = slice(skin.first, skin.last)
            position, values, volume = frame.position[rows], frame.values[rows], self.volume[rows]
            if self.cut is not None:
                assert frame.along is not None
                along = frame.along[rows]
                if skin.solid:
                    left = cut_body(skin, position, values, along, self.cut)
                    if left is not None:
                        self._add(left, edges=False)
                    continue
                there = self.cut.keeps(along, 0.55 * np.cbrt(volume) * (self.cut.above is None))
                position, values, volume = position[there], values[there], volume[there]
            if skin.patches is None or self.cut is not None:
                if len(position):
                    # a sphere for each particle, a little larger than its volume so that neighbours touch
                    resolution = int(np.clip(np.sqrt(_TRIANGLES / max(len(values), 1) / 2.0), 3, _FINEST))
                    sphere = pyvista.Sphere(
                        radius=0.5, theta_resolution=max(4, resolution), phi_resolution=max(4, resolution)
                    )
                    particle_set = pyvista.PolyData(position)
                    particle_set["shown"], particle_set["diameter"] = values, 1.1 * np.cbrt(volume)
                    self._add(
                        particle_set.glyph(geom=sphere, scale="diameter", orient=False), edges=False, round_ones=True
                    )
                continue
            pieces.append(_surface(skin, position, values, turned=image.bit_count() % 2 == 1))
        if pieces:
            mesh = _joined(pieces, self.mirror, 0.05 * float(np.cbrt(self.volume[skins[0].first])))
            # edges where the faces are large enough for them to be told apart
            pixels_of_a_face = np.sqrt(mesh.area / max(mesh.n_cells, 1)) * self.size[1] / self.camera.span[1]
            self._add(mesh, edges=bool(pixels_of_a_face > 5.0))

    def close(self) -> None:
        """Free the renderer's memory."""
        self._plotter.close()

    def _add(self, mesh: Any, edges: bool, round_ones: bool = False) -> None:
        """round_ones: spheres, which have no edges to be kept sharp."""
        self._plotter.add_mesh(
            mesh,
            scalars="shown",
            clim=(self.scale.lower, self.scale.upper),
            cmap=self.scale.colours,
            show_scalar_bar=False,
            ambient=0.45,
            diffuse=0.72,
            specular=0.04,
            smooth_shading=True,
            split_sharp_edges=not round_ones,
            feature_angle=_SHARP,
            show_edges=edges,
            edge_color=_EDGE_COLOUR,
            edge_opacity=_EDGE_OPACITY,
            line_width=_OVERSAMPLING,
            copy_mesh=False,
            render=False,
            nan_color="#b8b8b8",
        )


def _joined(pieces: list[pyvista.PolyData], mirror: tuple[int, ...], near: float) -> pyvista.PolyData:
    """A surface and its images as one, without the faces between them; near [m]: such points are on a plane."""
    if len(pieces) == 1:
        return pieces[0]
    whole = pieces[0].append_polydata(*pieces[1:])
    points = np.array(whole.points)
    inside = np.zeros(whole.n_cells, bool)
    # all faces of a lattice are quads, those of a mesh may be triangles, too
    offsets, corners = whole.GetPolys().GetOffsetsArray(), whole.GetPolys().GetConnectivityArray()
    to_numpy: Any = vtk_to_numpy
    first, number = to_numpy(offsets)[:-1], to_numpy(corners)
    for axis in mirror:
        on_plane = np.abs(points[:, axis]) < near
        points[on_plane, axis] = 0.0
        inside |= np.logical_and.reduceat(on_plane[number], first)
    whole.points = points
    outer = whole.remove_cells(inside) if inside.any() else whole
    return outer.clean(tolerance=1e-3 * near, absolute=True)


def _surface(skin: Skin, position: np.ndarray, values: np.ndarray, turned: bool = False) -> pyvista.PolyData:
    """The faces of a skin; points are not shared between patches, so that edges of the body stay sharp.

    turned: the corners of faces run the other way, as an image's must.
    """
    points, shown = skin.points(position, linear=True), skin.points(values, linear=False)
    pieces, faces, first = [], [], 0
    for patch in skin.patches or ():
        used, number = np.unique(patch, return_inverse=True)
        pieces.append(used)
        corners = number.reshape(patch.shape) + first
        faces.append((patch.shape[1], corners[:, ::-1] if turned else corners))
        first += len(used)
    used = np.concatenate(pieces)
    cells = np.concatenate([np.insert(numbers, 0, count, axis=1).ravel() for count, numbers in faces])
    mesh = pyvista.PolyData(points[used], cells)
    mesh["shown"] = shown[used]
    return mesh
