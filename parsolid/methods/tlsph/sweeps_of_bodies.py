"""Set-up: which bodies find their neighbours along axes of boxes, in pair lists and in meshes, and their sweeps."""

from typing import Any

import numpy as np

from decomposition.pair_search import close_boxes
from parsolid.collective import anywhere, minimum, raise_together
from parsolid.materials.blocks import block_numbers
from parsolid.materials.hyperelastic.functions import isotropic_shear_modulus
from parsolid.methods.tlsph.body_weights import meshes_of, weights_are_rounded
from parsolid.methods.tlsph.box_bodies import BoxBodies
from parsolid.methods.tlsph.lattice_bodies import BoxCuts, boxes_of
from parsolid.methods.tlsph.list_bodies import ListBodies
from parsolid.methods.tlsph.mesh_bodies import MeshBodies
from parsolid.pairs.cell_weights import NodesOfCells
from parsolid.pairs.closure import surface_area
from parsolid.pairs.list_weights import ListWeights
from parsolid.pairs.smoothing import smoothing_kernel
from parsolid.scene.shapes import of_one_mesh


def groups_of(laws: list[Any], boxes: list[int], meshes: list[int]) -> np.ndarray:
    """A number for each body: the same for bodies with kernels in pair lists that share a law, then for those with
    weights of meshes, and one for every box behind."""
    _, numbers = block_numbers(laws, np.arange(len(laws)))
    groups, first = np.zeros(len(laws), np.int64), 0
    for some in ([i for i in range(len(laws)) if i not in (*boxes, *meshes)], meshes):
        found = np.unique(numbers[some])
        groups[some] = first + np.searchsorted(found, numbers[some])
        first += len(found)
    groups[boxes] = first + np.arange(len(boxes))
    return groups


def box_bodies_of(system: Any, scene: Any) -> BoxBodies | None:
    """The boxes of a system, None where a scene has none; collective."""
    cuts = BoxCuts(scene, system.comm.size)
    if not cuts.bodies:
        return None
    body, first = system.particles.owned_rows("body"), {block.first: block for block in system.blocks}
    rows = {number: np.flatnonzero(body == number) for number in cuts.bodies}
    blocks = {number: first[int(own[0])] for number, own in rows.items() if len(own)}
    return BoxBodies(system, cuts, [one for one in system.lattice_bodies if one.box], blocks)


def list_bodies_of(system: Any, scene: Any, particle_set: Any) -> ListBodies | None:
    """The bodies of a system with pair lists, None where a scene has none; collective."""
    settings, conditions, surface = system.settings, system.conditions, None
    others = [*boxes_of(scene, system.body_weights), *meshes_of(system.body_weights)]
    if len(others) == len(system.body_weights):
        return None
    rows = slice(0, int(np.sum(~np.isin(particle_set.body, others))))
    if "closure" in system.body_weights:
        here = np.array(system.body_weights)[particle_set.body] == "closure"
        area = surface_area(system.comm, particle_set, conditions.planes, here)
        surface = (area[rows], conditions.share[rows], here[rows])
    # where the reference moves, shear that does not depend on the original direction depends on the moved one
    directional = settings.reference == "updated" or anywhere(
        system.comm, any(isotropic_shear_modulus(block.law) is None for block in system.blocks)
    )
    waves = 0
    factor = settings.dissipation_of("kernel")
    if factor > 0.0:
        waves = 1 if system.staged_step is None else 3 if directional else 2
    cells: Any = None
    if any(one.cells is not None for one in system.lattice_bodies):
        meant = [one for one in system.lattice_bodies if one.cells is not None]
        found: Any = [(one.body, np.flatnonzero(particle_set.body == one.body), one.cells) for one in meant]
        cells = NodesOfCells.of(particle_set.spacing[rows], found)
    rounded = weights_are_rounded(scene) and surface is None and not system.lattice_bodies
    kernel = smoothing_kernel(settings.kernel)
    weights = ListWeights(kernel, factor, waves >= 2, surface, cells, rounded)
    blocks = [block for block in system.blocks if block.last <= rows.stop]
    return ListBodies(system, blocks, weights, waves, scene.unbonded)


def mesh_bodies_of(system: Any, scene: Any, particle_set: Any) -> MeshBodies | None:
    """The bodies of a system with the weights of their mesh, None where a scene has none; collective."""
    numbers = meshes_of(system.body_weights)
    if not numbers:
        return None
    raise_together(system.comm, _bonded_mesh(system, scene, particle_set, numbers))
    body = system.particles.owned_rows("body")
    blocks = [block for block in system.blocks if body[block.first] in numbers]
    bodies = MeshBodies(system, blocks, 1 if system.settings.dissipation_of("mesh") > 0.0 else 0)
    bodies.find_pairs(scene, particle_set, numbers)
    return bodies


def _bonded_mesh(system: Any, scene: Any, particle_set: Any, numbers: list[int]) -> str | None:
    """The fault of a body with the weights of its mesh within a kernel's reach of another one, by their bounding
    boxes, to which a scene bonds it: it would not be bonded to it as others are. Collective."""
    count, d = len(scene.bodies), system.dimension
    if not scene.bond:
        return None
    # lower bounds and the negative upper ones and coarsest spacings of each body
    bounds = np.full((count, 2 * d + 1), np.inf)
    for number in np.unique(particle_set.body):
        here = particle_set.body == number
        X, spacing = particle_set.position[here], particle_set.spacing[here]
        bounds[number] = np.concatenate([X.min(axis=0), -X.max(axis=0), [-spacing.max()]])
    bounds = minimum(system.comm, bounds)
    reach = -smoothing_kernel(system.settings.kernel).support * system.settings.smoothing * bounds[:, -1]
    lower, upper, bonded, bodies = bounds[:, :d], -bounds[:, d : 2 * d], scene.bonded, scene.bodies
    for i, j in sorted(np.transpose(close_boxes(lower, upper, 2.0 * reach)).tolist()):
        gap = np.maximum(np.maximum(lower[j] - upper[i], lower[i] - upper[j]), 0.0)
        by_kernels = bonded.has(i, j) and not of_one_mesh(bodies[i].shape, bodies[j].shape)
        if by_kernels and not {i, j}.isdisjoint(numbers) and np.linalg.norm(gap) < max(reach[i], reach[j]):
            return (
                'method.weights: expected for "mesh" bodies in contact or tied, as bonds are those of kernels, found '
                f"bodies.{i} and bodies.{j}"
            )
    return None


def smoothing_of(system: Any, particle_set: Any) -> Any:
    """h/dx, (n, 1) where bodies of cells have their own, by which neighbours are found."""
    result = np.full((len(particle_set), 1), float(system.settings.smoothing))
    for one in system.lattice_bodies:
        result[particle_set.body == one.body] = one.reach / smoothing_kernel(system.settings.kernel).support
    return result if system.lattice_bodies else system.settings.smoothing
