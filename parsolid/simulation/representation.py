"""What particles cannot represent, by one rule for all methods: layers across a body, points a cell, bending of slender
bodies, and bonded bodies of unlike spacing. Found when a run is set up, told by `check` and at the run's start.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.pair_search import close_boxes
from parsolid.collective import SolverError, maximum, minimum
from parsolid.contact.report import contact_warnings
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.touching import TOUCHING
from parsolid.scene import Scene
from parsolid.scene.bodies import Body
from parsolid.scene.codes import Warned
from parsolid.scene.contact import of_model, tied_pairs
from parsolid.scene.method_settings import MethodSettings
from parsolid.scene.systems import qualify_keys

# a part is bent rather than sheared where it is so many times as long as thick
_SLENDER = 4.0
_ROUND_OFF = 1e-6

# largest ratio of a body's mean spacings along its axes in contact; up to the first faces that just touch are apart by
# less than 7 % of a spacing and press with less than .06 % of E, up to the second 17 % and .9 %; at 4, 117 % of E
_TOLD_RATIO, _LARGEST_RATIO = 1.25, 1.5

# lower and upper bounds of a body's particles, and their mean spacing, each (d,) [m]
Extent = tuple[np.ndarray, np.ndarray, np.ndarray]


class Across(NamedTuple):
    """Particles across a body along an axis, mirror images included, and its length [m] with them."""

    axis: int
    particles: int
    length: float


def representation(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Warned]:
    """Warnings of all systems; collective, the same on all ranks.

    Raises SolverError, on all ranks, for bonded bodies whose spacings or moduli differ too much, and for bodies in
    contact whose spacings differ too much along their axes.
    """
    extents: dict[int, Extent] = {}
    found: list[Warned] = contact_warnings(scene, systems)
    plans = {plan.bodies: plan for plan in scene.systems}
    for system in systems:
        plan = plans[system.bodies]
        told = system.warnings()
        for number, body in enumerate(system.bodies):
            extents[body] = layers(comm, system, number)
            told += _too_few(scene, body, extents[body], system.settings)
        found += [one._replace(text=qualify_keys(scene, plan, one.text)) for one in told]
        found += _unlike_neighbours(scene, system, extents)
    return found + _unlike_axes(scene, extents)


def _unlike_axes(scene: Scene, extents: dict[int, Extent]) -> list[Warned]:
    """Contact takes particles for those of a square or cubic lattice, from which it finds where their faces are, and
    ties the mean spacing for that across the face, from which they find the area of a point."""
    found = []
    touching = {body for contact in of_model(scene.contact, "kernel") for body in contact.bodies}
    tied = {body for first, second, _ in tied_pairs(scene) for body in (first, second)}
    for number, body in enumerate(scene.bodies):
        spacing = extents[number][2]
        ratio = float(spacing.max() / spacing.min())
        if ratio <= _TOLD_RATIO * (1.0 + _ROUND_OFF):
            continue
        if number in tied:
            text = f"bodies.{number}: spacings differ along its axes by a factor of {ratio:.4g}"
            found.append(Warned("unlike-axes-in-tie", f"{text}; springs of ties are off by up to as much"))
        if body.name not in touching:
            continue
        if ratio > _LARGEST_RATIO * (1.0 + _ROUND_OFF):
            expected = (
                f"spacings that differ along its axes by a factor of {_LARGEST_RATIO:g} at most, as it is in contact"
            )
            raise SolverError(f"bodies.{number}: expected {expected}, found {ratio:.4g}")
        text = f"bodies.{number}: spacings differ along its axes by a factor of {ratio:.4g}; contact is off by up to"
        found.append(Warned("unlike-axes-in-contact", f"{text} a sixth of a spacing"))
    return found


def _too_few(scene: Scene, number: int, extent: Extent, settings: MethodSettings) -> list[Warned]:
    """One layer where a body is free, which has no stiffness against bending or a wrong one; more layers of a slender
    body that the method bends wrongly; spacings beyond the largest that it bears."""
    found, body = [], scene.bodies[number]
    spacing, largest = float(extent[2].max()), settings.largest_spacing()
    if largest is not None and spacing > largest * (1.0 + _ROUND_OFF):
        text = f"bodies.{number}: a spacing of {spacing:.4g} m in cells of {largest:.4g} m, so that points fly freely"
        found.append(Warned("cell-below-spacing", f"{text}; at least one point a cell and direction is needed", True))
    if body.shape.kind == "cylindrical_shell":
        shape = body.shape.model
        counts = [(round(shape.thickness / float(extent[2][-1])) + (body.placed_on == "vertices"), "the thickness")]
    else:
        counts = [(one.particles, "XYZ"[one.axis]) for one in _across(scene, body, extent)]
    few = [axis for count, axis in counts if count <= 1]
    if few and scene.dimension > 1:
        text = f"bodies.{number}: one particle across {' and '.join(few)}, where it is free"
        found.append(Warned("one-layer", f"{text}; bending and strain across it are not represented", True))
    thin = thinnest(scene, number, extent) if scene.dimension > 1 else None
    fault = settings.bending_fault(thin[0], spacing) if thin is not None and not few else None
    if thin is not None and fault is not None:
        text = f"bodies.{number}: {thin[0]} particles across {thin[1]}, where it is thin, of {spacing:.4g} m"
        found.append(Warned("wrong-bending", f"{text}, which do not bend right: {fault[0]}", fault[1]))
    return found


def _unlike_neighbours(scene: Scene, system: ParticleSystem, extents: dict[int, Extent]) -> list[Warned]:
    """Bonded bodies whose spacings differ by more than the method joins exactly. Raises SolverError where two bodies
    that the method bonds differ by more than it bears."""
    warned = []
    bonded, settings = scene.bonded, system.settings
    bonding = dict(zip(system.bodies, settings.bonding(scene, system.bodies)))
    lowest, highest, spacings = (np.array(one) for one in zip(*(extents[body] for body in system.bodies)))
    close = np.transpose(close_boxes(lowest, highest, 2.0 * TOUCHING * spacings.max(axis=1)))
    for i, j in sorted(np.array(system.bodies)[close].tolist()):
        if not (bonding[i] and bonding[j] and bonded.has(i, j)):
            continue
        (lower, upper, spacing), (other_lower, other_upper, other) = extents[i], extents[j]
        gap = np.linalg.norm(np.maximum(np.maximum(lower - other_upper, other_lower - upper), 0.0))
        if gap > TOUCHING * max(spacing.max(), other.max()):
            continue
        ratio = float(max((spacing / other).max(), (other / spacing).max()))
        modulus = [system.wave_modulus(system.bodies.index(k))[0] for k in (i, j)]
        for what, found, most in (
            ("spacings", ratio, settings.bonded_spacings(scene)),
            ("moduli", max(modulus) / min(modulus) if any(modulus) else 1.0, settings.bonded_moduli(scene)),
        ):
            if found > most * (1.0 + _ROUND_OFF):
                expected = f"bonded bodies whose {what} differ by a factor of {most:g} at most (others can be tied: a "
                expected += "[[tie]] of bodies of two [[methods]], of one kind or two)"
                raise SolverError(f"bodies.{j}: expected {expected}, found {found:.4g} against bodies.{i}")
        if ratio > settings.warned_bonded_spacings(scene) * (1.0 + _ROUND_OFF):
            text = f"bodies.{j}: its spacing and that of bodies.{i}, which it is bonded to, differ by a factor of"
            warned.append(Warned("unlike-bonded-spacings", f"{text} {ratio:.4g}, which makes the bond too soft"))
    return warned


def _lengths(body: Body, extent: Extent) -> np.ndarray:
    """Sides (d,) [m] of a body."""
    lower, upper, spacing = extent
    gap = 0.0 if body.placed_on == "vertices" else 1.0
    return np.asarray(np.maximum(np.rint((upper - lower) / spacing) + gap, 1.0) * spacing)


def _across(scene: Scene, body: Body, extent: Extent) -> list[Across]:
    """Along all axes across which a body may deform freely."""
    lower, upper, spacing = extent
    lengths, found = _lengths(body, extent), []
    counts, gap = np.rint((upper - lower) / spacing) + 1.0, 0.0 if body.placed_on == "vertices" else 1.0
    for axis in range(len(counts)):
        ends, near = (lower[axis], upper[axis]), 0.6 * spacing[axis]
        planes = [(getattr(one, "plane", None), one.kind) for one in scene.boundaries]
        here = [kind for plane, kind in planes if plane is not None and plane.axis == axis
                and min(abs(plane.offset - end) for end in ends) <= near]  # fmt: skip
        symmetric = sum(kind in ("roller", "antisymmetric") for kind in here)
        # between two planes of symmetry it cannot bend
        if "fixed" not in here and symmetric < 2:
            count = int(counts[axis] * (1 + symmetric) - symmetric * (1.0 - gap))
            found.append(Across(axis, count, float(lengths[axis]) * (1 + symmetric)))
    return found


def layers(comm: Any, system: ParticleSystem, body: int) -> Extent:
    """Lower and upper bounds of a body's particles and their mean spacing, each (d,) [m]; collective."""
    rows = system.particles.owned_rows
    here = rows("body") == body
    place, spacing = rows("reference_position")[here][:, : system.dimension], rows("spacing")[here]
    lower = minimum(comm, place.min(axis=0, initial=np.inf))
    upper = maximum(comm, place.max(axis=0, initial=-np.inf))
    count = max(1, comm.allreduce(len(place)))
    return lower, upper, np.asarray(comm.allreduce(spacing.sum(axis=0))) / count


def thinnest(scene: Scene, number: int, extent: Extent) -> tuple[int, str] | None:
    """Particles across a slender body where they are fewest, and the name of that direction; None if it is stout."""
    body = scene.bodies[number]
    if body.shape.kind == "cylindrical_shell":
        shape = body.shape.model
        across = round(shape.thickness / float(extent[2][-1])) + (body.placed_on == "vertices")
        return (across, "the thickness") if shape.radius > _SLENDER * shape.thickness else None
    lower, upper, spacing = extent
    free = [one for one in _across(scene, body, extent) if _lengths(body, extent).max() >= _SLENDER * one.length]
    best = min(free, key=lambda one: one.particles, default=None)
    return None if best is None else (best.particles, "XYZ"[best.axis])
