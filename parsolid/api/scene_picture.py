"""The picture of a scene before its run, `parsolid check --picture`: 2-D by matplotlib, 3-D by VTK off screen."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mpi4py import MPI

from parsolid.api.picture_data import Mark, PictureData, picture_data
from parsolid.scene import Scene, SceneError

# suffixes that matplotlib writes without other packages
_SUFFIXES = (".png", ".pdf", ".svg")
_BODIES = ("#c9d3df", "#e3d5bd", "#cfdfc9", "#e0cbd3", "#d6cfe3", "#c6dcdb", "#dcdcc0", "#e2cdbf")
# colours of marks by kind, used in turn
_COLOURS = {
    "region": ("#7a7a7a", "#a0522d", "#8a8a3c", "#5f7f8f"),
    "support": ("#1f3f8f", "#2b8fbf", "#4b2f8f", "#1f6f6f"),
    "load": ("#c4161c", "#e8641b", "#b0126f", "#8f4a00"),
    "contact": ("#e0a800", "#b98a00"),
    "tie": ("#8e44ad", "#b57edc"),
    "bond": ("#2e8b3d", "#6cc04a"),
}
_TITLES = {
    "region": "Regions",
    "support": "Supports",
    "load": "Loads and motion",
    "contact": "Contact",
    "tie": "Ties",
    "bond": "Bonds",
}
# diameters of marks over the spacing, different so that marks on one particle can be distinguished
_SIZES = {"region": 0.5, "support": 0.95, "load": 0.75, "contact": 1.25, "tie": 1.25, "bond": 1.25}
_INTERFACES = ("contact", "tie", "bond")
_MOST_ARROWS, _MOST_IN_LEGEND = 24, 8
# over the size of all bodies: length of the longest arrow, and shift of bodies with interfaces in 3-D
_ARROW, _APART = 0.12, 0.1
_VELOCITY, _WALL, _TOOL, _EDGES = "#404040", "#303030", "#9a9a9a", "#8d97a3"
# directions towards the viewer: front, right, above; and back, left, below
_VIEWS = ((2.0, -2.5, 1.5), (-2.0, 2.5, -1.2))
# largest number of inner particles of a body that are drawn in 3-D
_MOST_INSIDE = 20_000


def draw_scene(comm: MPI.Comm, scene: Scene, path: str | Path, meshes: dict[Any, Any] | None = None) -> None:
    """Draw bodies with regions, supports, loads and interfaces into a file. Collective.

    meshes: see `generation.generate`. Raises SceneError on all ranks for regions without particles, and for a file that
    is not png, pdf or svg or cannot be written.
    """
    if Path(path).suffix not in _SUFFIXES:
        raise SceneError([f"picture: expected a file that ends in {', '.join(_SUFFIXES)}, found {str(path)!r}"])
    data, fault = picture_data(comm, scene, meshes), None
    if data is not None:
        try:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            figure_of(scene, data).savefig(path, dpi=130)
        except OSError as error:
            fault = f"picture: expected a file that can be written, found {error}"
    if (fault := comm.bcast(fault)) is not None:
        raise SceneError([fault])


def figure_of(scene: Scene, data: PictureData) -> Figure:
    """The picture with its legend."""
    low, high = data.position.min(axis=0), data.position.max(axis=0)
    sides = np.resize((high - low) / float((high - low).max()), 2) if scene.dimension == 2 else np.array([1.0, 0.0])
    # size of the axes and margins [inches]; the legend is on the right
    width, height = (9.6, 5.2) if scene.dimension == 3 else np.maximum(8.0 * sides, (3.0, 2.2))
    left, below, right, above = 0.9, 0.7, 3.6, 0.6
    figure = Figure(figsize=(left + width + right, below + height + above))
    whole = figure.get_size_inches()
    axes = figure.add_axes((left / whole[0], below / whole[1], width / whole[0], height / whole[1]))
    if scene.dimension == 3:
        _draw_space(axes, scene, data)
    else:
        _draw_plane(axes, scene, data)
    methods = ", ".join(dict.fromkeys(system.settings.kind for system in scene.systems))
    lines = [f"{scene.title or 'scene'}: {methods}, {scene.dimension}-D"]
    for key, unit in (("acceleration", "m/s²"), ("body_force", "N/m³")):
        stated = getattr(scene.loads, key)
        if stated is not None:
            lines.append(f"{key.replace('_', ' ')} ({', '.join(map(str, stated.sources))}) {unit}")
    axes.set_title("\n".join(lines), fontsize=9, loc="left")

    # the legend has a part for each kind of entry; of many entries only the first are named
    def entry(label: str, marker: str, colour: str, filled: bool = True) -> Line2D:
        face = colour if filled else "none"
        return Line2D(
            [], [], ls="", marker=marker, color=colour, mfc=face, mew=1.6, ms=8, label=label.replace("$", r"\$")
        )

    parts: dict[str, list[Line2D]] = {"Bodies": []}
    for number, body in enumerate(scene.bodies):
        label = f"{body.name or f'bodies.{number}'}: {body.material.kind}"
        parts["Bodies"].append(entry(label, "s", _BODIES[number % len(_BODIES)]))
    for one, colour in _numbered(data.marks):
        ring = one.kind in _INTERFACES
        marker = r"$\rightarrow$" if one.arrows is not None else "o"
        parts.setdefault(_TITLES[one.kind], []).append(entry(one.label, marker, colour, not ring))
    for label, _, _ in data.walls:
        parts.setdefault("Planes", []).append(entry(label, "_", _WALL))
    for tool in scene.tools:
        parts.setdefault("Tools", []).append(entry(f"{tool.name} ({tool.shape.kind})", "s", _TOOL))
    if data.velocity.any():
        parts.setdefault("At the start", []).append(entry("velocity of a body", r"$\rightarrow$", _VELOCITY))
    handles: list[Line2D] = []
    for title, entries in parts.items():
        handles.append(Line2D([], [], ls="", label=rf"$\bf{{{title.replace(' ', '~')}}}$"))
        handles += entries[:_MOST_IN_LEGEND]
        if len(entries) > _MOST_IN_LEGEND:
            handles.append(Line2D([], [], ls="", label=f"and {len(entries) - _MOST_IN_LEGEND} more"))
    figure.legend(
        handles=handles,
        loc="center left",
        bbox_to_anchor=(1.0 - (right - 0.2) / whole[0], 0.5),
        fontsize=8,
        frameon=False,
    )
    return figure


def _numbered(marks: list[Mark]) -> list[tuple[Mark, str]]:
    """Marks with their colours."""
    seen: dict[str, int] = {}
    result = []
    for one in marks:
        colours = _COLOURS[one.kind]
        result.append((one, colours[seen.setdefault(one.kind, 0) % len(colours)]))
        seen[one.kind] += 1
    return result


def _evenly_chosen(rows: np.ndarray, most: int) -> np.ndarray:
    """At most `most` rows at even distances."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(np.int64))] if len(rows) else rows


# --- in a plane -----------------------------------------------------------------------------------------------------


def _draw_plane(axes: Any, scene: Scene, data: PictureData) -> None:
    """Draw a scene in 1-D or 2-D; lengths in metres."""
    flat = data.position.shape[1] == 1
    place = np.pad(data.position, ((0, 0), (0, 1))) if flat else data.position
    spacing = np.repeat(data.spacing, 2, axis=1) if flat else data.spacing
    low, high = place.min(axis=0), place.max(axis=0)
    length, margin = _ARROW * float((high - low).max()), 0.14 * float((high - low).max())

    def discs(rows: np.ndarray, share: float, **look: Any) -> None:
        widths, heights = share * spacing[rows].T
        drawn = EllipseCollection(
            widths, heights, np.zeros(len(rows)), units="xy", offsets=place[rows], transOffset=axes.transData, **look
        )
        axes.add_collection(drawn)

    def arrows(tails: np.ndarray, along: np.ndarray, colour: str) -> None:
        axes.quiver(*tails.T, *along.T, color=colour, angles="xy", scale_units="xy", scale=1.0, width=0.0045, zorder=6)

    for number in range(len(scene.bodies)):
        discs(np.flatnonzero(data.body == number), 0.98, facecolor=_BODIES[number % len(_BODIES)], lw=0)
    for one, colour in _numbered(data.marks):
        ring = one.kind in _INTERFACES
        look: dict[str, Any] = {"facecolor": "none", "edgecolor": colour, "lw": 1.1} if ring else {"facecolor": colour}
        discs(one.rows, _SIZES[one.kind], zorder=3 + ring, **look)
        if one.arrows is not None:
            chosen = _evenly_chosen(np.arange(len(one.rows)), _MOST_ARROWS)
            along = length * one.arrows[chosen]
            along = np.pad(along, ((0, 0), (0, 1))) if flat else along
            tails = place[one.rows[chosen]]
            arrows(tails - along if one.inwards else tails, along, colour)
    fastest = np.linalg.norm(data.velocity, axis=1).max()
    for number, velocity in enumerate(data.velocity):
        middle = place[data.body == number].mean(axis=0)
        if velocity.any():
            along = 1.4 * length * velocity / fastest
            arrows(middle[None], np.pad(along, (0, 2 - len(along)))[None], _VELOCITY)
        if len(scene.bodies) <= _MOST_IN_LEGEND:
            axes.annotate(
                scene.bodies[number].name or "",
                middle,
                (0, 7),
                textcoords="offset points",
                ha="center",
                fontsize=8,
                zorder=7,
            )
    for _, axis, offset in data.walls:
        (axes.axvline if axis == 0 else axes.axhline)(offset, color=_WALL, lw=2.0, zorder=2)
        low[axis], high[axis] = min(low[axis], offset), max(high[axis], offset)
    for tool in scene.tools:
        _draw_tool_in_plane(axes, tool.shape, low, high)
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    axes.set_xlabel("X [m]")
    axes.set_ylabel("" if flat else "Y [m]")
    axes.spines[["top", "right"]].set_visible(False)


def _draw_tool_in_plane(axes: Any, shape: Any, low: np.ndarray, high: np.ndarray) -> None:
    """Draw a tool in 2-D; the bounds low, high (2,) [m] are extended by it."""
    from matplotlib.patches import Circle, Rectangle

    model: Any = shape.model
    look: dict[str, Any] = {"facecolor": _TOOL, "edgecolor": _WALL, "alpha": 0.6, "zorder": 1}
    if shape.kind == "plane":
        normal = np.array(model.normal, float)
        axes.axline(model.point, slope=np.inf if normal[1] == 0.0 else -normal[0] / normal[1], color=_WALL, lw=2.0)
        return
    if shape.kind == "box":
        lower, upper = np.array(model.lower, float), np.array(model.upper, float)
        axes.add_patch(Rectangle(tuple(lower.tolist()), *(upper - lower).tolist(), **look))
    elif shape.kind in ("sphere", "cylinder"):
        centre = np.array(model.centre if shape.kind == "sphere" else model.base, float)[:2]
        lower, upper = centre - model.radius, centre + model.radius
        axes.add_patch(Circle(tuple(centre.tolist()), model.radius, **look))
    else:
        return
    np.minimum(low, lower, out=low)
    np.maximum(high, upper, out=high)


# --- in space -------------------------------------------------------------------------------------------------------


def _draw_space(axes: Any, scene: Scene, data: PictureData) -> None:
    """Draw a scene in 3-D from two sides, Z upright; bodies with interfaces are moved apart."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    place, moved = _moved_apart(scene, data)
    low, high = place.min(axis=0), place.max(axis=0)
    size = float((high - low).max())
    plotter: Any = pyvista.Plotter(off_screen=True, window_size=[1000, 1000])
    plotter.set_background("white")

    def draw_cells(rows: np.ndarray, share: float, colour: str) -> None:
        if len(rows):
            sizes = share * np.median(data.spacing[rows], axis=0)
            cube = pyvista.Cube(x_length=sizes[0], y_length=sizes[1], z_length=sizes[2])
            cloud = pyvista.PolyData(np.ascontiguousarray(place[rows], float))
            plotter.add_mesh(cloud.glyph(geom=cube, scale=False, orient=False), color=colour, ambient=0.25)

    def draw_arrow(tail: np.ndarray, along: np.ndarray, colour: str) -> None:
        length = float(np.linalg.norm(along))
        if length > 0.0:
            drawn = pyvista.Arrow(
                start=tail, direction=along / length, scale=length, shaft_radius=0.035, tip_radius=0.1
            )
            plotter.add_mesh(drawn, color=colour, ambient=0.4)

    drawn_by_elements = set()
    for skin in data.meshes:
        number = int(data.body[skin.first])
        drawn_by_elements.add(number)
        faces = np.concatenate([np.insert(patch, 0, patch.shape[1], axis=1).ravel() for patch in skin.patches or ()])
        surface = pyvista.PolyData(np.ascontiguousarray(place[skin.first : skin.last], float), faces)
        plotter.add_mesh(
            surface, color=_BODIES[number % len(_BODIES)], ambient=0.25, show_edges=True, edge_color=_EDGES
        )
    for number in sorted(set(range(len(scene.bodies))) - drawn_by_elements):
        here = data.body == number
        inside = _evenly_chosen(np.flatnonzero(here & ~data.outer), _MOST_INSIDE)
        rows = np.concatenate((np.flatnonzero(here & data.outer), inside))
        draw_cells(rows, 0.98, _BODIES[number % len(_BODIES)])
    shares = {"region": 1.02, "contact": 1.04, "tie": 1.04, "bond": 1.04, "support": 1.06, "load": 1.08}
    for one, colour in _numbered(data.marks):
        draw_cells(one.rows, shares[one.kind], colour)
        if one.arrows is not None:
            for k in _evenly_chosen(np.arange(len(one.rows)), _MOST_ARROWS):
                along, tail = _ARROW * size * one.arrows[k], place[one.rows[k]]
                draw_arrow(tail - along if one.inwards else tail, along, colour)
    fastest = np.linalg.norm(data.velocity, axis=1).max()
    for number, velocity in enumerate(data.velocity):
        if velocity.any():
            middle = place[data.body == number]
            along = velocity / fastest
            tip = middle.mean(axis=0) + along * float(((middle - middle.mean(axis=0)) @ along).max())
            draw_arrow(tip, 1.5 * _ARROW * size * along, _VELOCITY)
    for _, axis, offset in data.walls:
        centre, normal = 0.5 * (low + high), np.eye(3)[axis]
        centre[axis] = offset
        wall = pyvista.Plane(center=centre, direction=normal, i_size=1.3 * size, j_size=1.3 * size)
        plotter.add_mesh(wall, color=_WALL, opacity=0.25)
    for tool in scene.tools:
        drawn = _tool_in_space(pyvista, tool.shape, 0.5 * (low + high), size)
        if drawn is not None:
            plotter.add_mesh(drawn, color=_TOOL, opacity=0.5)
    plotter.add_axes(line_width=3, viewport=(0.0, 0.0, 0.18, 0.18))
    plotter.camera.parallel_projection = True
    views = [_rendered(plotter, 0.5 * (low + high), size * np.array(towards)) for towards in _VIEWS]
    plotter.close()
    tallest = max(len(one) for one in views)
    # white below and beside each
    views = [np.pad(one, ((0, tallest - len(one)), (0, 60), (0, 0)), constant_values=255) for one in views]
    axes.imshow(np.concatenate(views, axis=1))
    axes.set_axis_off()
    original = data.position
    bounds = zip("XYZ", original.min(axis=0), original.max(axis=0))
    sizes = ", ".join(f"{axis} {a:.4g} to {b:.4g} m" for axis, a, b in bounds)
    axes.text(
        0.0,
        -0.03,
        f"from the front and above, and from behind and below; {sizes}"
        + ("; bodies that meet are moved apart" if moved else ""),
        transform=axes.transAxes,
        fontsize=8,
    )


def _rendered(plotter: Any, middle: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """The picture (rows, columns, 3) from a direction, Z upright, without its white margin."""
    plotter.camera_position = [tuple(middle + towards), tuple(middle), (0, 0, 1)]
    plotter.reset_camera()
    picture = plotter.screenshot(return_img=True)
    rows, columns = (np.flatnonzero((picture < 255).any(axis=(2, side))) for side in (1, 0))
    return np.asarray(picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])


def _moved_apart(scene: Scene, data: PictureData) -> tuple[np.ndarray, bool]:
    """Positions (n, 3) [m] with bodies moved apart if there are interfaces, and whether they are."""
    met = any(one.kind in _INTERFACES and len(one.rows) for one in data.marks)
    if not met:
        return data.position, False
    low, high = data.position.min(axis=0), data.position.max(axis=0)
    middles = np.array([data.position[data.body == k].mean(axis=0) for k in range(len(scene.bodies))])
    away = middles - 0.5 * (low + high)
    farthest = max(float(np.linalg.norm(away, axis=1).max()), 1e-300)
    shift = 2.0 * _APART * float((high - low).max()) * away / farthest
    return data.position + shift[data.body], True


def _tool_in_space(pyvista: Any, shape: Any, centre: np.ndarray, size: float) -> Any:
    """The surface of a tool, None for a mesh."""
    model = shape.model
    if shape.kind == "sphere":
        return pyvista.Sphere(radius=model.radius, center=model.centre, theta_resolution=40, phi_resolution=40)
    if shape.kind == "box":
        return pyvista.Box([end for pair in zip(model.lower, model.upper) for end in pair])
    if shape.kind == "plane":
        return pyvista.Plane(center=model.point, direction=model.normal, i_size=1.3 * size, j_size=1.3 * size)
    if shape.kind == "cylinder":
        axis = np.eye(3)["XYZ".index(model.axis)]
        length = model.length or 1.5 * size
        base = np.array(model.base, float)
        middle = base + 0.5 * length * axis if model.length else base + axis * float((centre - base) @ axis)
        return pyvista.Cylinder(center=middle, direction=axis, radius=model.radius, height=length, resolution=48)
    return None
