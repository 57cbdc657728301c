"""Pictures of bodies in 3-D by VTK, without a display."""

from typing import Any

import numpy as np
import pyvista
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

from parsolid.commands.plot.plane import Cut
from parsolid.commands.plot.scales import Scale
from parsolid.output.results import Frame
from parsolid.particles.skins import Skin


def cut_body(skin: Skin, position: np.ndarray, values: np.ndarray, coordinate: np.ndarray, cut: Cut) -> Any:
    """The surface of a cut body with a lattice or mesh, or None if nothing is left.

    position (n, 3) [m]; values (n,); coordinate (n,) [m] along the axis of the cut
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


# VTK prints messages about every unavailable renderer
vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)

_DIRECTIONS = {"iso": (1.0, -1.25, 0.75), "front": (0.0, -1.0, 0.0), "side": (1.0, 0.0, 0.0), "top": (0.0, 0.0, 1.0)}
_DIRECTIONS["below"] = (1.0, -1.25, -0.75)
# pictures are drawn larger and reduced, for smooth edges with any renderer
_OVERSAMPLING = 2
# angle between faces [degrees] above which their edge is sharp
_SHARP = 40.0
_EDGE_COLOUR, _EDGE_OPACITY = "#202020", 0.28
# largest number of triangles of all spheres, and largest resolution of a sphere
_TRIANGLES, _FINEST = 1_000_000, 12


class Camera:
    """A parallel projection for all frames of a picture.

    right, up, towards: unit vectors, the last one towards the viewer; span: visible (width, height) [m]
    """

    def __init__(
        self, frames: list[Frame], view: str | tuple[float, float, float], follow: bool, margin: float, upright: int = 2
    ) -> None:
        """follow: centre each frame on its bodies; margin [m]: distance of the surface from the particles; upright: the
        vertical axis.
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
        """Directions (3, 2) of the coordinate axes in the picture."""
        return np.stack([self.right, self.up], axis=1)

    def pixels_of_a_metre(self, width: int, height: int) -> float:
        """Pixels per metre in a picture of a size in pixels."""
        return height / max(self.span[1], self.span[0] * height / width)


class Renderer:
    """Draws frames with one camera at one size in pixels."""

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
        """skins: of all bodies, then of their images in the mirror planes."""
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
        """The picture (height, width, 3) uint8 of a frame; number: its index in the camera."""
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
        """Free the memory of the renderer."""
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
    """A surface joined with its images, without the faces between them; near: distance [m] within which points are on a
    mirror plane."""
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
    """The faces of a skin; patches share no points, so that edges of the body stay sharp.

    turned: reverse the order of corners, for images
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
