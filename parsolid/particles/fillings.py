"""Which filling belongs to which shape; a new shape is a model in `scene.shapes` and one entry here."""

import os
from collections.abc import Sequence
from typing import Any

from mpi4py import MPI

from parsolid.particles.lattices.clipped import ClippedFilling
from parsolid.particles.lattices.lattice import BoxFilling, Filling
from parsolid.particles.lattices.perforated import PerforatedFilling
from parsolid.particles.lattices.perforated_nodes import PerforatedNodes
from parsolid.particles.lattices.shell import ShellFilling
from parsolid.particles.meshes.filling import MeshFilling
from parsolid.particles.meshes.slices import MeshSlices
from parsolid.scene.bodies import Extent, FilledShape

_FILLINGS: dict[str, Any] = {
    "box": BoxFilling,
    "perforated_box": PerforatedFilling,
    "cylindrical_shell": ShellFilling,
    "cylinder": ClippedFilling,
    "sphere": ClippedFilling,
}


def filling_of(
    body: FilledShape,
    dimension: int,
    comm: MPI.Comm = MPI.COMM_SELF,
    mesh: MeshSlices | None = None,
    groups: Sequence[str] = (),
    by_nodes: bool = False,
) -> Filling:
    """The particles of a body, not yet made; mesh, groups, by_nodes: see `MeshFilling`; collective. Raises SceneError
    for a mesh that cannot be used."""
    if body.shape.kind != "mesh":
        nodes_of_cells = body.shape.kind == "perforated_box" and body.placed_on == "vertices"
        made: Filling = (PerforatedNodes if nodes_of_cells else _FILLINGS[body.shape.kind])(body, dimension)
        return made
    filling = MeshFilling(comm, body, dimension, mesh, groups, by_nodes)
    _EXTENTS[_key(body, dimension)] = Extent(filling.lower, filling.upper, filling.coarsest)
    return filling


# of meshes that have been read: where bodies are asked of one by one, none is read again
_EXTENTS: dict[tuple[Any, ...], Extent] = {}


def extent_of(body: FilledShape, dimension: int) -> Extent:
    """How far a body reaches. Raises SceneError for a mesh that cannot be used."""
    if body.shape.kind != "mesh":
        return body.extent()
    if _key(body, dimension) not in _EXTENTS:
        filling_of(body, dimension)
    return _EXTENTS[_key(body, dimension)]


def _key(body: FilledShape, dimension: int) -> tuple[Any, ...]:
    """What the extent of a mesh follows from."""
    model, state = body.shape.model, os.stat(body.shape.model.file)
    return *model.mesh_key, model.group, body.placed_on, dimension, state.st_mtime_ns, state.st_size
