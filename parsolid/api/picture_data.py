"""Data of the picture of a scene before its run: bodies, regions, supports, loads and interfaces."""

from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from decomposition.pair_search import within_reach
from parsolid.particles.generation import generate
from parsolid.particles.initial_fields import initial_velocity
from parsolid.particles.regions import selected
from parsolid.particles.skins import Skin, skins_of
from parsolid.particles.touching import TOUCHING, close_pairs, systems_of_bodies, within_touch
from parsolid.scene import Scene
from parsolid.scene.base_model import AXES
from parsolid.scene.boundaries import Condition
from parsolid.scene.contact import ALL

# number of times at which loads are evaluated to find the largest
_INSTANTS = 9
# largest number of names of bodies in a label
_NAMES = 4
_ROUND_OFF = 1e-6
_LOADS = ("traction", "pressure", "temperature", "heat-flux", "rotation", "velocity", "displacement", "layer", "spring")


class Mark(NamedTuple):
    """Particles of a region, a condition or an interface.

    kind: "region", "support", "load", "contact", "tie" or "bond"; rows (n,) of `PictureData`; arrows (n, d): of length
    1 or less, or None; inwards: arrows end at the particles
    """

    kind: str
    label: str
    rows: np.ndarray
    arrows: np.ndarray | None = None
    inwards: bool = False


class PictureData(NamedTuple):
    """Particles of all ranks, sorted by identifier: position and spacing (n, d) [m], body (n,), outer (n,): on a
    surface; marks; walls: label, axis and offset [m] of planes; velocity (bodies, d) [m/s]: initial mean; meshes:
    surfaces of bodies from meshes in 3-D."""

    position: np.ndarray
    spacing: np.ndarray
    body: np.ndarray
    outer: np.ndarray
    marks: list[Mark]
    walls: list[tuple[str, int, float]]
    velocity: np.ndarray
    meshes: list[Skin]


def picture_data(comm: MPI.Comm, scene: Scene, meshes: dict[Any, Any] | None = None) -> PictureData | None:
    """The data of the picture of a scene, on rank 0; meshes: see `generation.generate`. Collective.

    Raises SceneError on all ranks.
    """
    drawn = generate(scene, comm, meshes)
    held = [one for one in scene.boundaries if one.on_particles]
    masks = [selected(scene, one, drawn, comm) for one in held]
    arrays: list[Any] = [drawn.identifier, drawn.position, drawn.spacing, drawn.body, drawn.area, drawn.regions, *masks]
    arrays.append(initial_velocity(scene, drawn.body, drawn.position, drawn.regions))
    pieces = comm.gather(arrays)
    if pieces is None:
        return None
    order = np.argsort(np.concatenate([piece[0] for piece in pieces]))
    whole: list[Any] = [None if each[0] is None else np.concatenate(each)[order] for each in zip(*pieces)][1:]
    position, spacing, body, area, regions = whole[:5]
    rows = [np.flatnonzero(mask) for mask in whole[5:-1]]
    marks = (
        []
        if regions is None
        else [Mark("region", name, np.flatnonzero(regions[:, i])) for i, name in enumerate(scene.named_regions)]
    )
    marks += [_condition(scene, one, here, position, area) for one, here in zip(held, rows)]
    marks += _interfaces(scene, position, spacing, body)
    walls = [
        (_label(one), one.plane.axis, one.plane.offset)
        for one in scene.boundaries
        if not one.on_particles and one.plane is not None
    ]
    count = np.maximum(np.bincount(body, minlength=len(scene.bodies)), 1)
    sums = [np.bincount(body, values, minlength=len(scene.bodies)) for values in whole[-1].T]
    velocity = np.stack(sums, axis=1) / count[:, None]
    # the mean velocity of a rotating body is zero but for rounding
    velocity[np.abs(velocity).max(axis=1) < _ROUND_OFF * np.abs(whole[-1]).max(initial=0.0)] = 0.0
    of_elements = {k: one for k, one in enumerate(scene.bodies) if scene.dimension == 3 and one.shape.kind == "mesh"}
    skins = [skin for skin in skins_of(of_elements, 3, body) if skin.elements is not None]
    return PictureData(position, spacing, body, area.any(axis=1), marks, walls, velocity, skins)


def _label(one: Condition) -> str:
    """A boundary condition in words."""
    place = one.region_name or (None if one.plane is None else f"{AXES[one.plane.axis]} = {one.plane.offset:g}")
    name = getattr(one, "name", None)
    label = f"{one.kind} {name!r}" if name else one.kind
    return label if place is None else f"{label}, {place}"


def _condition(scene: Scene, one: Condition, rows: np.ndarray, position: np.ndarray, area: np.ndarray) -> Mark:
    """The mark of a support or a load; arrows show the load at the time when it is largest."""
    keys = ("traction", "velocity", "displacement", "pressure")
    formulas = next((value for key in keys if (value := getattr(one, key, None)) is not None), None)
    label, kind = _label(one), "load" if one.kind in _LOADS else "support"
    if formulas is None:
        return Mark(kind, label, rows)
    values = _largest(formulas, position[rows], scene.end_time)
    inwards = one.kind == "pressure"
    if inwards:
        # pressure acts against the outward normal
        normal = area[rows] / np.maximum(np.linalg.norm(area[rows], axis=1), 1e-300)[:, None]
        values = -values.reshape(len(rows), 1) * normal
    longest = np.linalg.norm(values, axis=1).max(initial=0.0)
    if longest == 0.0:
        return Mark("support" if one.kind in ("velocity", "displacement") else kind, label, rows)
    return Mark(kind, label, rows, values / longest, inwards)


def _largest(formulas: Any, points: np.ndarray, end: float) -> np.ndarray:
    """Values at points (n, d) [m] at the time when they are largest."""
    values = [np.asarray(formulas.evaluate(points, end * k / (_INSTANTS - 1))) for k in range(_INSTANTS)]
    return values[int(np.argmax([float(np.abs(one).max(initial=0.0)) for one in values]))]


def _interfaces(scene: Scene, position: np.ndarray, spacing: np.ndarray, body: np.ndarray) -> list[Mark]:
    """A mark per contact, tie and bond: the particles next to another body of the table."""
    count, d = len(scene.bodies), scene.dimension
    tables = [(kind, one.bodies) for kind in ("contact", "tie", "bond") for one in getattr(scene, kind)]
    if not tables:
        return []
    order = np.argsort(body, kind="stable")
    ends = np.searchsorted(body[order], np.arange(count + 1))
    rows_of = [order[ends[k] : ends[k + 1]] for k in range(count)]
    boxes = np.array([[position[rows].min(axis=0), position[rows].max(axis=0)] for rows in rows_of])
    widest = np.array([np.full(d, spacing[rows].max()) for rows in rows_of])
    names = {one.name: k for k, one in enumerate(scene.bodies)}
    touching = close_pairs(boxes, systems_of_bodies(scene), TOUCHING * widest, TOUCHING * widest)
    acting = within_touch(scene, boxes, widest)
    marks, bonded = [], scene.bonded
    for kind, stated in tables:
        close = acting if kind == "bond" else touching
        members = set(range(count)) if stated == ALL else {names[name] for name in stated}
        met: list[np.ndarray] = [np.zeros(0, np.int64)]
        for (i, j), scale in zip(close.bodies.tolist(), close.semi_axes):
            if i in members and j in members and (stated != ALL or bonded.has(i, j)):
                for one, other in ((rows_of[i], rows_of[j]), (rows_of[j], rows_of[i])):
                    met.append(one[within_reach(position[one] / scale, position[other] / scale, 1.0)])
        label = "all" if stated == ALL else ", ".join(stated[:_NAMES]) + (", ..." if len(stated) > _NAMES else "")
        rows = np.unique(np.concatenate(met))
        marks.append(Mark(kind, f"{label}{'' if len(rows) else ' (apart)'}", rows))
    return marks
