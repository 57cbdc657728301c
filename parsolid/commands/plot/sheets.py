"""Figures of bodies: single times, sheets of several times with a common colour scale, and animations."""

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from parsolid.commands.plot.plane import Cut, PlaneView, draw_plane
from parsolid.commands.plot.scales import prefixed, scale_of, time_labels
from parsolid.output.results import Frame, Results
from parsolid.particles.skins import skins_of
from parsolid.scene import SceneError
from parsolid.scene.validation_errors import describe

# pixels: height of the axes and ruler at the bottom, length of the arrows, largest length of the ruler
MARKS, _ARROW, _RULER = 84, 26.0, 84.0
_INK = "#303030"


def add_marks(figure: Any, left: float, size: tuple[int, int], directions: np.ndarray, pixels: float) -> None:
    """Draw coordinate axes and a ruler into the lower right corner, from `left` [pixels] on.

    size: of the picture [pixels]; directions (d, 2): of the coordinate axes in the picture; pixels: per metre
    """
    axes = figure.add_axes((left / size[0], 0.0, 1.0 - left / size[0], MARKS / size[1]))
    width = size[0] - left
    axes.set(xlim=(0.0, width), ylim=(0.0, MARKS))
    axes.set_axis_off()
    middle = np.array([0.4 * width, 0.56 * MARKS])
    for name, direction in zip("xyz", directions):
        tip = middle + _ARROW * direction
        if np.hypot(*direction) < 0.15:
            continue  # along the line of sight
        arrow = {"arrowstyle": "-|>", "color": _INK, "linewidth": 1.1, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", tip, middle, arrowprops=arrow)
        place = tip + 7.0 * direction / np.hypot(*direction)
        axes.text(*place, name, ha="center", va="center", fontsize=9, color=_INK)
    # the largest of 1, 2 and 5 times a power of ten below a length [m]
    most = min(_RULER, width - 8.0) / pixels
    power = 10.0 ** np.floor(np.log10(most))
    length = float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most * (1.0 + 1e-9)))
    first = 0.5 * (width - length * pixels)
    axes.plot([first, first + length * pixels], [17.0, 17.0], color=_INK, linewidth=2.0, solid_capstyle="butt")
    unit, label = prefixed("m", length)
    axes.text(0.5 * width, 13.0, f"{length / unit:g} {label}", ha="center", va="top", fontsize=9, color=_INK)


DOTS_PER_INCH = 100
# pixels: outer margin, time label, colour bar with numbers, title; default areas of a panel and of a single picture;
# largest side
_MARGIN, _LABEL, _BAR, _TITLE = 14, 24, 104, 30
_PANEL_AREA, _SINGLE_AREA = 300 * 300, 640 * 640
_LARGEST = 8000
# index of white in a palette of 256 colours
_WHITE = 255
# a body with a larger share of failed particles is drawn particle by particle
_TORN = 0.005


@dataclass(frozen=True)
class Look:
    """How bodies are drawn, as the arguments of `plot` state it; None: chosen automatically.

    view: "iso", "front", "side", "top", "below" or the direction towards the viewer; range: of the colours, in SI
    units; columns: of a sheet; size: of the whole picture in pixels; follow: centre each frame on its bodies; mirror:
    also draw the images in the planes X = 0, Y = 0, Z = 0 of these axes (0, 1, 2); colours: a colour map; exaggerate:
    factor on displacements; clip, slice: letter, sign and value of a plane; only: names or indices of bodies; up: the
    vertical axis
    """

    view: str | tuple[float, float, float] = "iso"
    range: tuple[float, float] | None = None
    columns: int | None = None
    size: tuple[int, int] | None = None
    follow: bool = False
    mirror: tuple[int, ...] = ()
    colours: str | None = None
    exaggerate: float = 1.0
    title: str | None = None
    clip: tuple[str, str, float] | None = None
    slice: tuple[str, str, float] | None = None
    only: str | None = None
    up: tuple[int, ...] = (2,)

    @classmethod
    def of(cls, options: Any) -> "Look":
        """From the arguments of `plot` or `view`."""
        return cls(**{name: value for name, value in vars(options).items() if name in cls.__dataclass_fields__})

    @property
    def cut(self) -> Cut | None:
        """The cut by the plane of `clip` or `slice`."""
        if self.clip is None and self.slice is None:
            return None
        letter, sign, value = self.clip or self.slice or ("", "", 0.0)
        return Cut("XYZ".index(letter.upper()), value, None if sign == "=" else sign == ">", letter.islower())

    def bodies(self, results: Results) -> list[int]:
        """Indices of the drawn bodies. Raises SceneError for an unknown body."""
        names = [str(body.get("name", number)) for number, body in enumerate(results.scene["bodies"])]
        words = list(map(str, range(len(names)))) if self.only is None else self.only.split(",")
        if max(self.mirror, default=0) >= (results.dimension or 0):
            raise SceneError([f"--mirror: expected axes of {results.dimension} dimensions, found {list(self.mirror)}"])
        for word in words:
            if word not in names and not (word.isdigit() and int(word) < len(names)):
                raise SceneError([f"--only: expected some of {', '.join(names)}, found {describe(word)}"])
        return [names.index(word) if word in names else int(word) for word in words]


class Sheet:
    """Pictures of one field at several steps of a run, with one colour scale and one view."""

    def __init__(self, results: Results, field: str, steps: list[int], look: Look) -> None:
        """Raises SceneError for an unknown field, or positions that are not finite."""
        results.check_field(field)
        self.results, self.field, self.steps, self.look = results, field, steps, look
        self.cut = look.cut
        self._rows = np.isin(results.rows("body"), look.bodies(results))
        self.frames = [self._shown(frame) for frame in results.frames(steps, field, look.exaggerate)]
        if not all(np.isfinite(frame.position).all() for frame in self.frames):
            raise SceneError([f"{results.fields_path}: expected finite positions, found some that are not"])
        self.volume = np.tile(results.rows("volume")[self._rows], 2 ** len(look.mirror))
        reach = np.cbrt(self.volume)
        alongs = [frame.along for frame in self.frames if frame.along is not None]
        if self.cut and not any(self.cut.keeps(along, reach).any() for along in alongs):
            raise SceneError([f"--clip, --slice: expected a plane through the bodies, found {self.cut.value:g}"])
        self.scale = scale_of(field, [frame.values for frame in self.frames], look.range, look.colours)
        self.labels = time_labels([frame.time for frame in self.frames])
        if look.exaggerate != 1.0:
            self.labels = [f"{label}, displacement × {look.exaggerate:g}" for label in self.labels]
        self._renderers: dict[tuple[int, int], Any] = {}

    def _shown(self, frame: Frame) -> Frame:
        """The drawn bodies of a frame and their images, with the coordinate of a cut."""
        position, values, along = frame.position[self._rows], frame.values[self._rows], None
        if self.cut is not None:
            places = frame.position if self.cut.present else self.results.reference_position
            along = places[self._rows, self.cut.axis]
        for axis in self.look.mirror:
            position, values = np.concatenate([position, position]), np.concatenate([values, values])
            position[len(position) // 2 :, axis] *= -1.0
            if self.cut is not None and along is not None:
                along = np.concatenate([along, -along if axis == self.cut.axis else along])
        return Frame(frame.time, position, values, along)

    @cached_property
    def skins(self) -> Any:
        """The skins of the bodies and of their images."""
        body = self.results.rows("body")[self._rows]
        skins = skins_of(self.results.bodies, int(self.results.dimension or 0), body)
        skins = [skin.by_particle() if self._failed[skin.first : skin.last].mean() > _TORN else skin for skin in skins]
        particles = len(body)
        return [skin.moved(image * particles) for image in range(2 ** len(self.look.mirror)) for skin in skins]

    @cached_property
    def _failed(self) -> np.ndarray:
        """Particles (n,) that have failed at one of the steps; faces between them would bridge cracks."""
        failed = np.zeros(self.results.particles, bool)
        if "damage" in self.results.field_names:
            for frame in self.results.frames(self.steps, "damage"):
                failed |= frame.values >= 1.0
        return failed[self._rows]

    @cached_property
    def view(self) -> Any:
        """The `space.Camera`, in 2-D the PlaneView."""
        largest = max((self.volume[skin.first : skin.last].max() for skin in self.skins if skin.reaches), default=0.0)
        dimension: Any = self.results.dimension
        margin = 0.6 * largest ** (1.0 / dimension)
        if self.results.dimension == 2:
            return PlaneView(self.frames, self.look.follow, margin)
        from parsolid.commands.plot.space import Camera

        return Camera(self.frames, self.look.view, self.look.follow, margin, self.look.up[0])

    def figure(self, numbers: list[int]) -> Figure:
        """A figure of the frames with these indices."""
        size, panels = self._layout(len(numbers))
        figure = Figure(figsize=(size[0] / DOTS_PER_INCH, size[1] / DOTS_PER_INCH), dpi=DOTS_PER_INCH)
        for number, (left, top, width, height) in zip(numbers, panels):
            axes = figure.add_axes((left / size[0], 1.0 - (top + height) / size[1], width / size[0], height / size[1]))
            self._draw(axes, number, (width, height))
            x, y = (left + 0.5 * width) / size[0], 1.0 - (top + height + 4) / size[1]
            figure.text(x, y, self.labels[number], ha="center", va="top", fontsize=11)
        if self.look.title:
            figure.text(0.5, 1.0 - _MARGIN / size[1], self.look.title, ha="center", va="top", fontsize=13)
        scale = self.scale
        room = size[1] - 2 * _MARGIN - MARKS
        height = max(40, min(room, max(240, int(0.6 * size[1]))))
        bottom = MARKS + 0.5 * (size[1] - MARKS - height)
        axes = figure.add_axes(((size[0] - _BAR + 10) / size[0], bottom / size[1], 16 / size[0], height / size[1]))
        limits = Normalize(scale.lower / scale.factor, scale.upper / scale.factor)
        colours = ScalarMappable(limits, matplotlib.colormaps[scale.colours])
        bar = figure.colorbar(colours, cax=axes, extend=scale.extend)
        bar.set_label(scale.label, fontsize=11)
        bar.ax.tick_params(labelsize=10)
        bar.locator = matplotlib.ticker.MaxNLocator(7, steps=[1, 2, 5, 10])
        bar.update_ticks()
        add_marks(figure, size[0] - _BAR, size, self.view.directions, self.view.pixels_of_a_metre(*panels[0][2:]))
        return figure

    def close(self) -> None:
        """Close the renderers."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers.clear()

    def _layout(self, count: int) -> Any:
        """Size of the picture, and left, top, width, height of every panel, in pixels."""
        if not self.look.columns:
            # the number of columns with an aspect ratio near 16 : 9, or that of the size, and few empty panels
            wide, high = self.look.size or (16, 9)
            tried = np.arange(1, count + 1)
            lines = -(-count // tried)
            off = np.abs(np.log(tried * self.view.aspect / lines * high / wide))
            columns = int(tried[np.argmin(off + 2.0 * (1.0 - count / (lines * tried)))])
        else:
            columns = min(self.look.columns, count)
        rows = -(-count // columns)
        top = _MARGIN + (_TITLE if self.look.title else 0)
        if self.look.size is None:
            area = _SINGLE_AREA if count == 1 else _PANEL_AREA
            height = np.sqrt(area / self.view.aspect)
            width = height * self.view.aspect
            shrink = min(1.0, _LARGEST / (columns * width), _LARGEST / (rows * height))
            width, height = max(int(width * shrink), 80), max(int(height * shrink), 40)
            size = (columns * (width + _MARGIN) + _MARGIN + _BAR, top + rows * (height + _LABEL + _MARGIN))
        else:
            size = self.look.size
            width = (size[0] - _MARGIN - _BAR) // columns - _MARGIN
            height = (size[1] - top) // rows - _LABEL - _MARGIN
            if width < 20 or height < 20:
                found = f"{size[0]}x{size[1]} pixels"
                raise SceneError([f"--size: expected room for {columns} x {rows} pictures, found {found}"])
        places = [divmod(i, columns) for i in range(count)]
        panels = [
            (_MARGIN + j * (width + _MARGIN), top + i * (height + _LABEL + _MARGIN), width, height) for i, j in places
        ]
        return size, panels

    def _draw(self, axes: Any, number: int, pixels: tuple[int, int]) -> None:
        frame, shown = self.frames[number], (self.skins, self.volume)
        if self.results.dimension == 2:
            # points within this distance [m] of a mirror plane are on it: corners are extrapolated from particles
            near = 0.3 * float(self.volume.min()) ** 0.5 if len(self.volume) else 0.0
            seams = [(axis, near) for axis in self.look.mirror]
            draw_plane(axes, *shown, frame, number, self.view, self.scale, self.cut, seams)
            return
        axes.set_axis_off()
        if pixels not in self._renderers:
            from parsolid.commands.plot.space import Renderer

            self._renderers[pixels] = Renderer(*shown, self.view, self.scale, pixels, self.cut, self.look.mirror)
        axes.imshow(self._renderers[pixels].draw(frame, number), interpolation="none", aspect="auto")


def write_sheet(sheet: Sheet, path: Path, small: bool = False) -> None:
    """Write all frames in one picture; small: with 256 colours, a third of the file size."""
    _save(sheet.figure(list(range(len(sheet.frames)))), path, small)


def write_singles(sheet: Sheet, directory: Path, small: bool = False, names: Sequence[str] | None = None) -> list[Path]:
    """Write a picture per time; the paths. names: of the files, by default field and time."""
    names = names or [f"{sheet.field}-{frame.time:.6g}s" for frame in sheet.frames]
    paths = [directory / f"{name}.png" for name in names]
    for number, path in enumerate(paths):
        _save(sheet.figure([number]), path, small)
    return paths


def _palette(image: Image.Image) -> Image.Image:
    """A palette of 256 colours that covers all colours of an image, also rare ones, and ends with white."""
    palette = image.quantize(255, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    colours = palette.getpalette() or []
    palette.putpalette(colours[: 3 * 255] + [255] * 3 * (256 - len(colours[: 3 * 255]) // 3))
    return palette


def _save(figure: Figure, path: Path, small: bool) -> None:
    if small and path.suffix.lower() == ".png":
        image = Image.fromarray(_pixels(figure))
        drawn = image.quantize(palette=_palette(image), dither=Image.Dither.FLOYDSTEINBERG)
        # quantize searches the nearest colour approximately, so that white is set explicitly
        paper = (np.asarray(image) == 255).all(axis=-1)
        drawn.paste(_WHITE, mask=Image.fromarray(paper))
        drawn.save(path, optimize=True)
    else:
        figure.savefig(path, dpi=DOTS_PER_INCH)


def write_animation(sheet: Sheet, path: Path, frames_per_second: float) -> None:
    """Write the frames as .gif or .mp4. Raises SceneError for .mp4 without ffmpeg."""
    images = (_pixels(sheet.figure([number])) for number in range(len(sheet.frames)))
    if path.suffix == ".mp4":
        _write_mp4(images, path, frames_per_second)
        return
    # one palette for all frames, so that colours do not flicker
    frames = [Image.fromarray(image) for image in images]
    palette = _palette(frames[len(frames) // 2])
    frames = [frame.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG) for frame in frames]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=1000.0 / frames_per_second, loop=0)


def _write_mp4(images: Any, path: Path, frames_per_second: float) -> None:
    # ffmpeg of the system, or of imageio-ffmpeg
    program = shutil.which("ffmpeg")
    if program is None:
        try:
            import imageio_ffmpeg

            program = str(imageio_ffmpeg.get_ffmpeg_exe())
        except (ImportError, RuntimeError):
            expected = "the program ffmpeg or the package imageio-ffmpeg for .mp4"
            raise SceneError([f"--animation: expected {expected}, found none (.gif needs none)"]) from None
    first = next(images)
    # yuv420p needs even numbers of pixels
    height, width = (length - length % 2 for length in first.shape[:2])
    command = [program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
    command += ["-r", f"{frames_per_second:g}", "-i", "-", "-pix_fmt", "yuv420p", "-crf", "18", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        try:
            for image in (first, *images):
                process.stdin.write(np.ascontiguousarray(image[:height, :width]).tobytes())
        except BrokenPipeError:
            pass  # the error of ffmpeg is read below
        _, errors = process.communicate()
    if process.returncode:
        raise SceneError([f"{path}: expected ffmpeg to write it, found: {errors.decode(errors='replace').strip()}"])


def _pixels(figure: Figure) -> np.ndarray:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
