"""Pictures of three-dimensional bodies, drawn by VTK without a display."""

from typing import Any

import numpy as np
import pyvista
from vtkmodules.vtkCommonCore import vtkLogger

from parsolid.commands.plot.results import Frame
from parsolid.commands.plot.scales import Scale
from parsolid.commands.plot.skins import Skin

# VTK tells of every way of drawing that it tries in vain
vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)

_DIRECTIONS = {"iso": (1.0, -1.25, 0.75), "front": (0.0, -1.0, 0.0), "side": (1.0, 0.0, 0.0), "top": (0.0, 0.0, 1.0)}
# drawn larger and reduced: smooth edges from any renderer
_OVERSAMPLING = 2
_EDGE_COLOUR, _EDGE_OPACITY = "#202020", 0.28
# triangles of all spheres together, and of the finest one
_TRIANGLES, _FINEST = 3_000_000, 12


class Camera:
    """A parallel view on all frames of a picture.

    right, up, towards: unit vectors, the last one to the viewer; span: (width, height) [m] of what is seen.
    """

    def __init__(
        self, frames: list[Frame], view: str | tuple[float, float, float], follow: bool, margin: float
    ) -> None:
        """follow: keep each frame's own middle in the middle; margin [m]: how far the body reaches beyond the
        particles.
        """
        corners = [(frame.position.min(axis=0), frame.position.max(axis=0)) for frame in frames]
        lower, upper = (np.array([corner[i] for corner in corners]) for i in (0, 1))
        lower, upper = lower.min(axis=0), upper.max(axis=0)
        height = 1 if (upper - lower)[1] > 1.5 * max((upper - lower)[0], (upper - lower)[2]) else 2
        self.towards = _direction(view, height)
        up = np.eye(3)[height]
        if abs(self.towards @ up) > 0.99:
            up = np.eye(3)[1] if height == 2 else -np.eye(3)[2]
        self.right = np.cross(up, self.towards)
        self.right /= np.linalg.norm(self.right)
        self.up = np.cross(self.towards, self.right)
        axes = np.array([self.right, self.up, self.towards])
        seen = [_bounds(frame.position @ axes.T) for frame in frames]
        self.middles = np.array([0.5 * (low + high) for low, high in seen])
        size = np.array([high - low for low, high in seen]).max(axis=0)
        if not follow:
            low, high = np.min([low for low, _ in seen], axis=0), np.max([high for _, high in seen], axis=0)
            self.middles[:] = 0.5 * (low + high)
            size = high - low
        self.middles = self.middles @ axes
        self.depth = float(size[2]) + 2.0 * margin
        width, height = size[:2] + 2.0 * margin
        self.span = (float(max(width, 0.05 * height, 1e-300)), float(max(height, 0.05 * width, 1e-300)))

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.span[0] / self.span[1]


def _bounds(points: Any) -> tuple[np.ndarray, np.ndarray]:
    return points.min(axis=0), points.max(axis=0)


def _direction(view: Any, height: int) -> np.ndarray:
    direction = np.array(_DIRECTIONS[view] if isinstance(view, str) else view, float)
    if isinstance(view, str) and height == 1:
        # the named views turn with the body's upright axis, from Z to Y
        direction = np.array([direction[0], direction[2], -direction[1]])
    return direction / np.linalg.norm(direction)


class Renderer:
    """Draws frames from one camera at one size in pixels."""

    def __init__(
        self, skins: list[Skin], volume: np.ndarray, camera: Camera, scale: Scale, size: tuple[int, int]
    ) -> None:
        self.skins, self.camera, self.scale, self.size = skins, camera, scale, size
        self.volume = volume
        window = [_OVERSAMPLING * max(1, pixels) for pixels in size]
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=window, lighting="none", border=False)
        self._plotter = plotter
        plotter.background_color = "white"
        self._light()

    def _light(self) -> None:
        """A main light from the upper left of the viewer, a weak one from the right."""
        camera = self.camera
        upper_left, right = camera.towards + 0.6 * camera.up - 0.5 * camera.right, camera.towards + camera.right
        for direction, intensity in ((upper_left, 0.72), (right, 0.3)):
            light = pyvista.Light(
                position=direction, focal_point=(0, 0, 0), intensity=intensity, light_type="scene light"
            )
            self._plotter.add_light(light)

    def draw(self, frame: Frame, number: int) -> np.ndarray:
        """The picture (height, width, 3) uint8 of a frame, the number-th of the camera's."""
        plotter = self._plotter
        plotter.clear_actors()
        for skin in self.skins:
            rows = slice(skin.first, skin.last)
            position, values = frame.position[rows], frame.values[rows]
            if skin.patches is None:
                self._add(_spheres(position, values, self.volume[rows]), edges=False)
            else:
                mesh = _surface(skin, position, values)
                self._add(mesh, edges=self._edges_fit(mesh))
        self._point(number)
        plotter.render()
        image = plotter.screenshot(return_img=True)
        return _reduced(image, self.size)

    def close(self) -> None:
        """Free the renderer's memory."""
        self._plotter.close()

    def _add(self, mesh: Any, edges: bool) -> None:
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
            show_edges=edges,
            edge_color=_EDGE_COLOUR,
            edge_opacity=_EDGE_OPACITY,
            line_width=_OVERSAMPLING,
            copy_mesh=False,
            render=False,
            nan_color="#b8b8b8",
        )

    def _edges_fit(self, mesh: Any) -> bool:
        """Whether the faces are large enough for their edges to be told apart."""
        pixels = self.size[1] / self.camera.span[1]
        return bool(np.sqrt(mesh.area / max(mesh.n_cells, 1)) * pixels > 5.0)

    def _point(self, number: int) -> None:
        camera, plotter = self.camera, self._plotter
        middle = camera.middles[number]
        distance = 2.0 * camera.depth + max(camera.span)
        plotter.camera.position = middle + distance * camera.towards
        plotter.camera.focal_point = middle
        plotter.camera.up = camera.up
        plotter.camera.parallel_projection = True
        aspect = self.size[0] / self.size[1]
        plotter.camera.parallel_scale = 0.5 * max(camera.span[1], camera.span[0] / aspect)
        plotter.camera.clipping_range = (1e-3 * distance, 2.0 * distance + camera.depth)


def _reduced(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    height, width = size[1], size[0]
    blocks = image[: height * _OVERSAMPLING, : width * _OVERSAMPLING, :3].reshape(
        height, _OVERSAMPLING, width, _OVERSAMPLING, 3
    )
    return blocks.mean(axis=(1, 3)).round().astype(np.uint8)


def _surface(skin: Skin, position: np.ndarray, values: np.ndarray) -> pyvista.PolyData:
    """The faces of a skin; points are not shared between patches, so that edges of the body stay sharp."""
    points, shown = skin.points(position, linear=True), skin.points(values, linear=False)
    pieces, faces, first = [], [], 0
    for patch in skin.patches or ():
        used, number = np.unique(patch, return_inverse=True)
        pieces.append(used)
        faces.append((patch.shape[1], number.reshape(patch.shape) + first))
        first += len(used)
    used = np.concatenate(pieces)
    cells = np.concatenate([np.insert(numbers, 0, count, axis=1).ravel() for count, numbers in faces])
    mesh = pyvista.PolyData(points[used], cells)
    mesh["shown"] = shown[used]
    return mesh


def _spheres(position: np.ndarray, values: np.ndarray, volume: np.ndarray) -> pyvista.PolyData:
    """A sphere for each particle, a little larger than its volume so that neighbours touch."""
    resolution = int(np.clip(np.sqrt(_TRIANGLES / max(len(values), 1) / 2.0), 3, _FINEST))
    sphere = pyvista.Sphere(radius=0.5, theta_resolution=max(4, resolution), phi_resolution=max(4, resolution))
    particle_set = pyvista.PolyData(position)
    particle_set["shown"], particle_set["diameter"] = values, 1.1 * np.cbrt(volume)
    return particle_set.glyph(geom=sphere, scale="diameter", orient=False)
