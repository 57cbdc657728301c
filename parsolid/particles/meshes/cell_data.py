"""Data that a mesh file has for its elements, at particles: of the element, or of those around a node."""

from typing import Any

import numpy as np

from decomposition.slices import Slices
from parsolid.collective import minimum
from parsolid.particles.meshes.files import kinds_in, read_with_meshio, solid_mesh
from parsolid.particles.meshes.geometry import is_geometry
from parsolid.particles.meshes.imported import is_imported
from parsolid.particles.meshes.slices import agreed
from parsolid.scene.validation_errors import SceneError


def cell_data_at(
    comm: Any, body: Any, dimension: int, identifiers: np.ndarray, name: str, components: int
) -> np.ndarray:
    """Cell data (n, components) of this rank's particles of a body; identifiers (n,): theirs. components: 1, or 3 of
    directions, of which the sign is of no matter. Particles on nodes have the mean of the elements around. One rank
    reads the file. Raises SceneError on all ranks, also for another mesh than that of the particles. Collective."""
    of_reader: list[np.ndarray] = []
    particles = comm.allreduce(len(identifiers))

    def read() -> None:
        found = _of_particles(body, dimension, name, components)
        if len(found) != particles:
            raise SceneError(
                [f"expected the mesh of the {particles} particles, found {len(found)} in {body.shape.model.file}"]
            )
        of_reader.append(found)

    agreed(comm, read)
    slices = Slices(comm, particles)
    parts = [of_reader[0][slice(*slices.bounds(rank))] for rank in range(comm.size)] if of_reader else None
    first = int(minimum(comm, int(identifiers.min(initial=np.iinfo(np.int64).max))))
    return slices.fetch(identifiers - first, comm.scatter(parts))


def _of_particles(body: Any, dimension: int, name: str, components: int) -> np.ndarray:
    """Data (particles, components) of all of a body's particles in their order, that of its nodes or elements."""
    stated = body.shape.model
    blocks, values, group = _of_elements(stated, dimension, name, components)
    chosen = np.arange(len(values)) if group is None else group
    if not np.isfinite(values[chosen]).all():
        raise SceneError([f"expected cell data {name!r} that are numbers in every element, found others"])
    if body.placed_on != "vertices":
        return values[chosen]
    mine, start, used = np.zeros(len(values), bool), 0, []
    mine[chosen] = True
    for _, cells in blocks:
        here = start + np.flatnonzero(mine[start : start + len(cells)])
        used.append((cells[here - start], values[here]))
        start += len(cells)
    nodes = np.unique(np.concatenate([cells.ravel() for cells, _ in used]))
    count, sums = np.zeros(len(nodes)), np.zeros((len(nodes), components, components))
    for cells, data in used:
        places = np.searchsorted(nodes, cells)
        # of directions the sum of a a^T, which has no sign
        terms = data[:, :, None] * (data[:, None, :] if components > 1 else 1.0)
        for column in places.T:
            np.add.at(sums, column, terms)
            np.add.at(count, column, 1.0)
    if components == 1:
        return sums[:, :, 0] / count[:, None]
    # of vectors that are all 0 none
    there = np.trace(sums, axis1=1, axis2=2) > 0.0
    return np.where(there[:, None], np.linalg.eigh(sums)[1][:, :, -1], 0.0)


def _of_elements(stated: Any, dimension: int, name: str, components: int) -> tuple[list[Any], np.ndarray, Any]:
    """Blocks of solid elements, data (elements, components), and the numbers of a body's group or None."""
    path = stated.file
    if is_imported(path) or is_geometry(path, dimension):
        raise SceneError([f"expected a mesh file of another program, which has cell data, found {path}"])
    mesh = read_with_meshio(path)
    if name not in mesh.cell_data:
        known = ", ".join(map(repr, sorted(mesh.cell_data))) or "none"
        raise SceneError([f"expected the name of cell data of {path} ({known}), found {name!r}"])
    data, found = mesh.cell_data[name], []
    solid = solid_mesh(mesh, dimension)
    for block, values in zip(mesh.cells, data):
        if block.type in kinds_in(dimension) and len(block.data):
            found.append(np.asarray(values, float).reshape(len(block.data), -1))
    values = np.concatenate(found)
    if values.shape[1] != components and not (components == 3 and values.shape[1] == dimension):
        raise SceneError([f"expected cell data of {components} numbers an element, found {values.shape[1]}"])
    values = np.pad(values, ((0, 0), (0, components - values.shape[1])))
    group = None if stated.group is None else np.sort(solid.groups.elements[stated.group])
    return solid.blocks, values, group
