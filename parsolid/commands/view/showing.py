"""Interactive pictures of the bodies of a run: in a window of pyvista, or in an HTML page."""

import base64
import html
import json
import os
import sys
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.ticker import MaxNLocator

from parsolid.api.pictures import missing
from parsolid.commands.plot.command import pictured_fields
from parsolid.commands.plot.sheets import Look, Sheet
from parsolid.output.results import Frame, Results
from parsolid.scene import SceneError

# largest size of a page [bytes]
_MOST = 400e6
_NOT_A_NUMBER = 255


def show(options: Any) -> None:
    """Write the page or open the window. Raises SceneError and OSError."""
    if missing():
        raise SceneError([f"view: expected pip install 'parsolid[plot]', found no {' and no '.join(missing())}"])
    results = Results(options.directory)
    if results.dimension == 1:
        raise SceneError(["view: expected bodies in two or three dimensions, found one"])
    if options.clip and options.slice:
        raise SceneError(["--clip, --slice: expected one of them, found both"])
    sheet = Sheet(
        results, options.field or pictured_fields(results)[0], list(range(len(results.times))), Look.of(options)
    )
    if options.html:
        write_page(sheet, Path(options.html))
        print(options.html, flush=True)
        return
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise SceneError(["view: expected a display for a window, found none (--html FILE writes a page instead)"])
    window(sheet).show()


def write_page(sheet: Sheet, path: Path) -> None:
    """Write a self-contained HTML page. Raises SceneError if it would be too large, and OSError."""
    frames, triangles, size, scale = [], dict[bytes, int](), 0, sheet.scale
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for frame, label in zip(sheet.frames, sheet.labels):
        pieces = []
        for places, values, faces, diameter in _pieces(sheet, frame):
            lower, upper = np.minimum(lower, places.min(axis=0)), np.maximum(upper, places.max(axis=0))
            number = None if faces is None else triangles.setdefault(faces.astype(np.uint32).tobytes(), len(triangles))
            # indices of colours
            share = (values - scale.lower) / (scale.upper - scale.lower)
            shade = np.clip(np.nan_to_num(254.0 * share), 0.0, 254.0).round()
            shade = np.where(np.isfinite(share), shade, _NOT_A_NUMBER).astype(np.uint8)
            piece = {"places": _text(places.astype(np.float32)), "values": _text(shade)}
            size += 17 * len(values)
            pieces.append(piece | {"faces": number, "diameter": diameter})
        frames.append({"time": label, "pieces": pieces})
        if size + sum(map(len, triangles)) > _MOST:
            expected = f"a page of at most {_MOST / 1e6:.0f} MB"
            raise SceneError([f"--html: expected {expected}, found more: --only or --slice some of it"])
    low, high = scale.lower / scale.factor, scale.upper / scale.factor
    ticks = MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high)
    colours = matplotlib.colormaps[scale.colours](np.linspace(0.0, 1.0, 255))[:, :3]
    page = {
        "title": sheet.results.title,
        "label": scale.label,
        # labels of the colour bar and their distance from its upper end, as a share of the bar
        "numbers": [(f"{value:.6g}", float((high - value) / (high - low))) for value in ticks if low <= value <= high],
        "palette": _text((255.0 * colours).round().astype(np.uint8)),
        "centre": (0.5 * (lower + upper)).tolist(),
        "radius": float(0.55 * np.linalg.norm(upper - lower)) or 1.0,
        "turn": _turn(sheet),
        "triangles": [base64.b64encode(faces).decode() for faces in triangles],
        "frames": frames,
    }
    text = files("parsolid.commands.view").joinpath("page.html").read_text(encoding="utf-8")
    # "</script>" in a title would end the data
    data = json.dumps(page).replace("</", "<\\/")
    text = text.replace("@TITLE@", html.escape(sheet.results.title)).replace("@DATA@", data)
    path.write_text(text, encoding="utf-8")


def _pieces(sheet: Sheet, frame: Frame) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray | None, float]]:
    """For every body and image: points (k, 3) [m], values (k,), triangles (m, 3), or None for single particles, and
    their diameter [m]."""
    for skin in sheet.skins:
        rows = slice(skin.first, skin.last)
        position, values, volume = frame.position[rows], frame.values[rows], sheet.volume[rows]
        if sheet.cut is not None:
            assert frame.along is not None
            if skin.solid and sheet.results.dimension == 3:
                from parsolid.commands.plot.space import cut_body

                left = cut_body(skin, position, values, frame.along[rows], sheet.cut)
                if left is not None:
                    left = left.triangulate()
                    yield np.asarray(left.points), np.asarray(left["shown"]), left.faces.reshape(-1, 4)[:, 1:], 0.0
                continue
            there = sheet.cut.keeps(frame.along[rows], 0.55 * np.cbrt(volume) * (sheet.cut.above is None))
            position, values, volume = position[there], values[there], volume[there]
        if skin.patches is None or sheet.cut is not None:
            if len(position):
                dimension: Any = sheet.results.dimension
                yield position, values, None, 1.2 * float(volume.max()) ** (1.0 / dimension)
            continue
        places, shown = skin.points(position, linear=True), skin.points(values, linear=False)
        faces = np.concatenate(
            [
                patch if patch.shape[1] == 3 else np.concatenate([patch[:, [0, 1, 2]], patch[:, [0, 2, 3]]])
                for patch in skin.patches
            ]
        )
        used, number = np.unique(faces, return_inverse=True)
        yield places[used], shown[used], number.reshape(faces.shape), 0.0


def _turn(sheet: Sheet) -> list[float]:
    """The directions right, up and towards the viewer, 9 numbers."""
    if sheet.results.dimension == 2:
        return np.eye(3).ravel().tolist()
    camera = sheet.view
    return np.concatenate([camera.right, camera.up, camera.towards]).tolist()


def _text(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()


def window(sheet: Sheet, off_screen: bool = False) -> Any:
    """A plotter of pyvista with the last time and the view of the sheet; the caller shows it."""
    import pyvista

    plotter: Any = pyvista.Plotter(title=sheet.results.title, off_screen=off_screen)
    scale = sheet.scale

    def draw(number: float) -> None:
        frame = sheet.frames[round(number)]
        for place, (points, values, faces, diameter) in enumerate(_pieces(sheet, frame)):
            mesh = pyvista.PolyData(points)
            if faces is not None:
                mesh = pyvista.PolyData(points, np.insert(faces, 0, 3, axis=1).ravel())
            mesh["shown"] = values / scale.factor
            limits = (scale.lower / scale.factor, scale.upper / scale.factor)
            spheres = {"style": "points_gaussian", "point_size": diameter, "render_points_as_spheres": True}
            plotter.add_mesh(
                mesh,
                name=f"body {place}",
                scalars="shown",
                clim=limits,
                cmap=scale.colours,
                scalar_bar_args={"title": scale.label},
                **(spheres if faces is None else {"split_sharp_edges": True, "smooth_shading": True}),
            )
        plotter.add_text(sheet.labels[round(number)], name="time", font_size=10)

    plotter.add_axes()
    last = len(sheet.frames) - 1
    draw(last)
    if last and not off_screen:
        place = {"pointa": (0.62, 0.92), "pointb": (0.96, 0.92), "slider_width": 0.02, "tube_width": 0.004}
        plotter.add_slider_widget(draw, [0, last], value=last, title="stored time", fmt="%.0f", **place)
    turn = np.reshape(_turn(sheet), (3, 3))
    plotter.view_vector(turn[2], viewup=turn[1])
    return plotter
