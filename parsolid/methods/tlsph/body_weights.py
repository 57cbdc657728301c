"""Which pair weights each body of a scene has, and which it cannot have; known before any particle is made."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from decomposition.pair_search import close_boxes
from parsolid.materials.declaration import Phrase
from parsolid.pairs.box_weights import REACH
from parsolid.pairs.smoothing import smoothing_kernel
from parsolid.particles.fillings import extent_of
from parsolid.scene.base_model import Detail
from parsolid.scene.boundaries import Support
from parsolid.scene.validation_errors import SceneError

# shapes whose particles stand on no lattice
_UNEVEN = ("mesh", "cylindrical_shell")
# weights in closed form, see `pairs.box_weights` and `pairs.cell_weights`, and the shapes whose nodes have them
ON_LATTICES = {"cells": ("box", "perforated_box"), "fourth-order": ("box",)}
# nodes along an axis from which weights in closed form are nowhere worse than the kernel's (docs/choosing.md)
RESOLVED = 4


def weights_of_bodies(wanted: str, scene: Any) -> list[str]:
    """For each body "kernel", "closure", "cells", "fourth-order" or "mesh"; wanted: one of them for all, or "best".

    "mesh" is for bodies from meshes, and others have "kernel" beside them.

    "best" is "mesh" for nodes of meshes, "fourth-order" for those of boxes, "cells" for those of perforated boxes,
    "closure" for other uneven nodes, and "kernel" for the rest and for all bodies that touch, unless all of them are
    closed. Nothing but shared nodes bonds bodies with the weights of their mesh.
    """
    if wanted == "mesh":
        return ["mesh" if body.shape.kind == "mesh" else "kernel" for body in scene.bodies]
    if wanted != "best":
        return [wanted] * len(scene.bodies)
    result = [_best(i, scene) for i in range(len(scene.bodies))]
    bonded = bonded_bodies(scene, meshes_of(result))
    seen: set[int] = set()
    for i, others in enumerate(bonded):
        together = _reached(i, bonded) if others and i not in seen else set()
        seen |= together
        if not all(result[j] == "closure" for j in together):
            result = ["kernel" if j in together else kind for j, kind in enumerate(result)]
    return result


def meshes_of(kinds: Sequence[str]) -> list[int]:
    """Bodies with the weights of their mesh, by the weights of all."""
    return [i for i, kind in enumerate(kinds) if kind == "mesh"]


def no_mesh_weights(scene: Any) -> Detail | None:
    """Why the bodies from meshes cannot have the weights of their mesh: (location, expected, found), or None."""
    meshes = [i for i, body in enumerate(scene.bodies) if body.shape.kind == "mesh"]
    if not meshes:
        return ("method", "weights"), 'a body from a mesh for "mesh"', Phrase("none")
    return next((fault for fault in (_no_mesh_weights_of(i, scene) for i in meshes) if fault is not None), None)


def _no_mesh_weights_of(i: int, scene: Any) -> Detail | None:
    """The same of one body from a mesh."""
    settings, body = scene.method, scene.bodies[i]
    if settings.integrator == "ssp-rk3":
        return ("method", "integrator"), "'leapfrog' or 'static' with weights = \"mesh\"", settings.integrator
    if settings.reference != "fixed":
        return ("method", "reference"), "'fixed' with weights = \"mesh\"", settings.reference
    if body.placed_on != "vertices":
        return ("bodies", i, "placement"), "'vertices' with weights = \"mesh\"", body.placed_on
    if body.jitter > 0.0:
        return ("bodies", i, "jitter"), 'none with weights = "mesh"', body.jitter
    if body.deformation_gradient is not None:
        found = Phrase("a deformation gradient that is not that of a displacement")
        return ("bodies", i, "deformation_gradient"), 'no such key with weights = "mesh"', found
    for number, state in enumerate(scene.initial):
        for key in ("deformation_gradient", "stress", "results"):
            if getattr(state, key, None) is not None:
                return ("initial", number, key), 'no such key with weights = "mesh"', Phrase("one")
    return None


def best_is_confirmed(scene: Any) -> bool:
    """Whether "best" gives some bodies other weights than the kernel's, and only such as every table confirms: nodes of
    boxes with `RESOLVED` or more along every axis, with mirror planes through nodes or far away."""
    try:
        kinds = weights_of_bodies("best", scene)
        closed = [i for i, kind in enumerate(kinds) if kind not in ("kernel", "mesh")]
        if not closed or any(kinds[i] != "fourth-order" for i in closed):
            return False
        resolved = all(min(scene.bodies[i].numbers()) >= RESOLVED for i in closed)
        return resolved and not any(_beside_planes(i, scene) for i in closed)
    except SceneError:
        # told where the body is
        return False


def _beside_planes(number: int, scene: Any) -> bool:
    """Whether a mirror plane lies beside the nodes of a box, nearer than they reach, or at an axis too short for its
    images."""
    body = scene.bodies[number]
    extent = extent_of(body, scene.dimension)
    for one in scene.boundaries:
        if not isinstance(one, Support) or one.plane is None or not one.mirror or one.body not in (None, body.name):
            continue
        ends = np.array([extent.lower[one.plane.axis], extent.upper[one.plane.axis]])
        nearest = np.abs(ends - one.plane.offset).min() * (body.numbers()[one.plane.axis] - 1) / np.ptp(ends)
        short = nearest <= 1e-6 and body.numbers()[one.plane.axis] <= RESOLVED
        if short or 1e-6 < nearest < REACH:
            return True
    return False


def weights_are_rounded(scene: Any) -> bool:
    """Whether pair weights are rounded to float32: where few of them differ, and not those of SSP-RK3, which
    are the paper's to the last bit. Known by the scene alone, so that it does not depend on the ranks."""
    uneven = any(body.jitter > 0.0 or body.shape.kind in _UNEVEN for body in scene.bodies)
    return scene.method.integrator == "leapfrog" and scene.method.reference == "fixed" and not uneven


def _best(number: int, scene: Any) -> str:
    body = scene.bodies[number]
    for kind in ("fourth-order", "cells"):
        if _off_lattice(kind, body, scene.dimension) is None:
            return kind
    if body.shape.kind == "mesh" and _no_mesh_weights_of(number, scene) is None:
        return "mesh"
    uneven = body.jitter > 0.0 or body.shape.kind == "mesh"
    return "closure" if uneven and body.placed_on == "vertices" else "kernel"


def _off_lattice(kind: str, body: Any, dimension: int) -> str | None:
    """Why a body cannot have weights of a kind, in words."""
    if body.shape.kind not in ON_LATTICES[kind]:
        return f"a {body.shape.kind.replace('_', ' ')}"
    if body.placed_on != "vertices":
        return "particles in cells"
    if body.jitter > 0.0:
        return "jitter"
    counts = body.numbers()
    return f"particles = {counts}" if min(counts) < 2 else None


def lattice_faults(wanted: str, scene: Any) -> list[Detail]:
    """Bodies for which weights in closed form do not hold: (location, expected, found)."""
    if wanted not in ON_LATTICES:
        return []
    shapes = " or ".join(shape.replace("_", " ") for shape in ON_LATTICES[wanted])
    expected = (
        f'for "{wanted}" the nodes of a {shapes} (placement = "vertices"), two or more along each axis, no jitter'
    )
    try:
        reasons = [_off_lattice(wanted, body, scene.dimension) for body in scene.bodies]
        bonded = [] if any(reasons) else bonded_bodies(scene)
    except SceneError:
        # told where the body is
        return []
    found = [f"{reason} in bodies.{i}" for i, reason in enumerate(reasons) if reason is not None]
    if found:
        return [(("method", "weights"), expected, Phrase(", ".join(found)))]
    touching = [f"bodies.{i} and bodies.{j}" for i, others in enumerate(bonded) for j in others if i < j]
    expected = f'for "{wanted}" bodies farther apart than a kernel reaches, as those that touch are bonded by a kernel'
    return [(("method", "weights"), expected, Phrase(", ".join(touching)))] if touching else []


def bonded_bodies(scene: Any, without: Sequence[int] = ()) -> list[list[int]]:
    """For each body the others within a kernel's reach of it, by their bounding boxes, that are bonded to it there;
    without: numbers of bodies that no kernel bonds, which are not looked at."""
    result: list[list[int]] = [[] for _ in scene.bodies]
    left_out = set(without)
    some = [i for i in range(len(scene.bodies)) if i not in left_out]
    if not scene.bond or len(some) < 2:
        return result
    extents = [extent_of(scene.bodies[i], scene.dimension) for i in some]
    support = smoothing_kernel(scene.method.kernel).support * scene.method.smoothing
    lower, upper = (np.array([getattr(one, end) for one in extents]) for end in ("lower", "upper"))
    reach, bonded = support * np.array([one.coarsest for one in extents]), scene.bonded
    for k, m in np.transpose(close_boxes(lower, upper, 2.0 * reach)).tolist():
        gap = np.maximum(np.maximum(lower[m] - upper[k], lower[k] - upper[m]), 0.0)
        i, j = some[k], some[m]
        if np.linalg.norm(gap) < max(reach[k], reach[m]) and bonded.has(i, j):
            result[i].append(j)
            result[j].append(i)
    return [sorted(others) for others in result]


def _reached(start: int, neighbours: Sequence[Sequence[int]]) -> set[int]:
    """A body and all that it is bonded to through others."""
    found, waiting = {start}, [start]
    while waiting:
        new = set(neighbours[waiting.pop()]) - found
        found |= new
        waiting += sorted(new)
    return found
