"""Coarser scenes: same lengths, shapes and masses, fewer particles.

Lattices need whole numbers of intervals, so that the actual ratio of the spacings differs from the requested one. It is
chosen near it such that all directions of all bodies have nearly the same ratio, probes keep their positions relative
to particles, and planes on nodes of a background grid lie on nodes of the coarser one. Geometry and meshes are meshed
again with larger elements. Lengths stated as ratios of the spacing (horizon, skin, smoothing length, contact radius)
follow it; the cell of a grid is scaled.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from parsolid.particles.fillings import filling_of
from parsolid.particles.meshes.imported import is_imported
from parsolid.scene import Scene, parse_scene
from parsolid.scene.contact import BodyPairs

# fewest intervals of a coarser lattice along a direction, by method
LEAST = {"tlsph": 2, "ulsph": 3, "mpm": 2, "peridynamics": 3}
# largest factor between actual and requested ratio; rounding of a number of cells; smallest ratio
_REACH, _ROUND_OFF, _LEAST_RATIO = 1.4, 1e-6, 1.15
# weights of unequal ratios and of displaced probes against the distance from the requested ratio
_UNLIKE, _DISPLACED = 3.0, 0.5


class NotCoarsened(Exception):
    """No coarser scene can be made; the message says why, in the words of the scene."""


class BodyLattice(NamedTuple):
    """The lattice of a body: intervals along its directions; ends: number of particles minus number of intervals."""

    number: int
    intervals: tuple[int, ...]
    ends: tuple[int, ...]
    least: int
    lower: np.ndarray
    upper: np.ndarray
    box: bool

    def coarser(self, ratio: float) -> tuple[int, ...]:
        """Intervals at a ratio of the spacing; a direction of one interval keeps it."""
        return tuple(max(1, round(count / ratio)) for count in self.intervals)

    def offsets(self, place: np.ndarray, intervals: tuple[int, ...]) -> np.ndarray:
        """Offsets (d,) of a point [m] from the nearest particle, in intervals."""
        position = (place - self.lower) / (self.upper - self.lower) * intervals - 0.5 * (1 - np.array(self.ends))
        last = np.array(intervals) - 1 + np.array(self.ends)
        result: np.ndarray = position - np.clip(np.round(position), 0, last)
        return result


class CoarserScene(Scene):
    """A coarser scene with the bonds of the original one.

    Its particles reach farther, so that bodies without a bond would be bonded; `unbonded` keeps them apart. Bodies on
    one background grid still act on one another where their points share nodes.
    """

    @property
    def unbonded(self) -> BodyPairs | None:
        """All pairs that no bond names."""
        return BodyPairs([range(len(self.bodies))], self.bonded)


class Level(NamedTuple):
    """The tables of a scene at another resolution, and its actual ratio of the spacings."""

    tables: dict[str, Any]
    ratio: float


def lattices_of(scene: Scene) -> list[BodyLattice]:
    """The lattices of all bodies that are not meshes. Raises NotCoarsened for a mesh that cannot be made again."""
    kinds = {number: system.settings.kind for system in scene.systems for number in system.bodies}
    result = []
    for number, body in enumerate(scene.bodies):
        if body.shape.kind == "mesh":
            model, place = body.shape.model, f"bodies.{number}"
            if not model.of_geometry and model.group is not None:
                raise NotCoarsened(f"{place} is a group of a mesh, whose nodes other bodies share: none is made anew")
            if not model.of_geometry and is_imported(model.file):
                raise NotCoarsened(f"{place} is an imported mesh, of which none is made anew")
            continue
        filling: Any = filling_of(body, scene.dimension)
        ends = tuple(int(line.nodes and not line.closed and line.count > 1) for line in filling.lines)
        intervals = tuple(line.count - end for line, end in zip(filling.lines, ends))
        least, box = LEAST.get(kinds[number], 2), body.shape.kind in ("box", "perforated_box")
        result.append(BodyLattice(number, intervals, ends, least, filling.lower, filling.upper, box))
    return result


def lattice_words(scene: Scene) -> str:
    """Numbers of particles of all lattices, "9 x 49 x 9" or "71 x 21, 71 x 21", and element sizes of meshes."""
    try:
        lattices = lattices_of(scene)
    except NotCoarsened:
        return "mesh"
    words = [" x ".join(str(n + end) for n, end in zip(one.intervals, one.ends)) for one in lattices]
    sizes = dict[str, None]()
    for mesh in _meshes(scene.resolved()):
        size, factor = mesh.get("size"), mesh.get("size_factor", 1.0)
        sizes[f"elements x {factor:.3g}" if size is None else f"elements of {size * factor:.4g} m"] = None
    return ", ".join([*words, *sizes])


def _meshes(tables: dict[str, Any]) -> list[dict[str, Any]]:
    """The tables of bodies' meshes."""
    return [body["shape"]["mesh"] for body in tables["bodies"] if body["shape"].get("mesh") is not None]


def coarsen(scene: Scene, requested: float, more_than: float = _LEAST_RATIO) -> Level:
    """The coarser scene with a ratio of the spacings near the requested one and above `more_than`.

    Raises NotCoarsened for a mesh that cannot be made again, too few particles, or a grid that does not fit.
    """
    lattices = lattices_of(scene)
    if not lattices and requested < more_than:
        raise NotCoarsened(f"a ratio of {requested:.3g} is no more than {more_than:.3g}")
    ratio = _best_ratio(scene, lattices, requested, more_than) if lattices else requested
    new = [lattice.coarser(ratio) for lattice in lattices]
    for lattice, intervals in zip(lattices, new):
        for axis, (before, now) in enumerate(zip(lattice.intervals, intervals)):
            if now < lattice.least and before > now:
                found = f"{now + lattice.ends[axis]} particles along its direction {axis + 1}"
                least = f"this method needs {lattice.least + lattice.ends[axis]}"
                raise NotCoarsened(
                    f"bodies.{lattice.number} would have {found} at 1/{ratio:.3g} of its resolution, {least}"
                )
    tables = without_error_tables(scene)
    for lattice, intervals in zip(lattices, new):
        body = tables["bodies"][lattice.number]
        body.pop("spacing", None)
        body["particles"] = [n + end for n, end in zip(intervals, lattice.ends)]
    actual = ratio
    for method in methods_of(tables):
        if "cell" in method:
            method["cell"] *= ratio
    if lattices and not any("cell" in method for method in methods_of(tables)):
        # geometric mean over all directions, weighted by their intervals
        pairs = [(a, b) for one, now in zip(lattices, new) for a, b in zip(one.intervals, now)]
        weights = sum(a - 1 for a, _ in pairs)
        if not weights:
            raise NotCoarsened("every body has a single particle along each direction")
        actual = math.exp(sum((a - 1) * math.log(a / b) for a, b in pairs) / weights)
    for mesh in _meshes(tables):
        mesh["size_factor"] = mesh.get("size_factor", 1.0) * actual
    return Level(tables, actual)


def without_error_tables(scene: Scene) -> dict[str, Any]:
    """The tables of a scene without those that request error bars and targets."""
    return {key: part for key, part in scene.resolved().items() if key not in ("errors", "run")}


def methods_of(tables: dict[str, Any]) -> list[dict[str, Any]]:
    """The tables of a scene's methods."""
    return tables["methods"] if "methods" in tables else [tables["method"]]


def parsed(tables: dict[str, Any], trust_code: bool, ratio: float) -> Scene:
    """The scene of resolved tables; ratio: its spacing over that of the original scene. Raises SceneError."""
    scene = parse_scene(tables, trust_code=trust_code)
    return CoarserScene.model_construct(**dict(scene)) if ratio > 1.0 else scene


def _best_ratio(scene: Scene, lattices: list[BodyLattice], requested: float, more_than: float) -> float:
    """The ratio of least cost among those at which some direction has a whole number of intervals."""
    points = [np.array(probe.at, float) for probe in scene.probes if probe.at is not None]
    least, most = max(requested / _REACH, more_than), requested * _REACH
    candidates = {
        count / fewer
        for lattice in lattices
        for count in lattice.intervals
        if count > 1
        for fewer in range(max(1, math.ceil(count / most)), math.floor(count / least) + 1)
    }
    best = (math.inf, 0.0)
    misfits = False
    for ratio in sorted(candidates):
        if not _grids_fit(scene, ratio):
            misfits = True
            continue
        unlike = displaced = 0.0
        for lattice in lattices:
            coarser = lattice.coarser(ratio)
            ratios = [abs(math.log(a / (b * ratio))) for a, b in zip(lattice.intervals, coarser) if a > 1]
            unlike = max([unlike, *ratios])
            for point in points if lattice.box else ():
                if (point >= lattice.lower - 1e-9).all() and (point <= lattice.upper + 1e-9).all():
                    offsets = lattice.offsets(point, lattice.intervals) - lattice.offsets(point, coarser)
                    displaced = max(displaced, float(np.abs(offsets).max()))
        cost = abs(math.log(ratio / requested)) + _UNLIKE * unlike + _DISPLACED * displaced
        best = min(best, (cost, ratio))
    if best[1] == 0.0:
        if misfits:
            raise NotCoarsened(f"no grid about {requested:.3g} times coarser has the planes of boundaries on nodes")
        raise NotCoarsened(f"no lattice is about {requested:.3g} times coarser: too few particles in every direction")
    return best[1]


def _grids_fit(scene: Scene, ratio: float) -> bool:
    """Whether planes of boundaries on nodes of a background grid lie on nodes of the coarser grid, too."""
    for system in scene.systems:
        cell: float | None = getattr(system.settings, "cell", None)
        if cell is None:
            continue
        origin = getattr(system.settings, "origin", None) or [0.0] * scene.dimension
        for plane in [one.plane for one in scene.boundaries if getattr(one, "plane", None) is not None]:
            nodes = (plane.offset - origin[plane.axis]) / cell
            if _whole(nodes) and not _whole(nodes / ratio):
                return False
    return True


def _whole(number: float) -> bool:
    return abs(number - round(number)) < _ROUND_OFF * max(1.0, abs(number))
