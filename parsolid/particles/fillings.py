"""The filling of any body, meshes included."""

import os
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from parsolid.particles.meshes.filling import MeshFilling
from parsolid.particles.meshes.slices import MeshSlices
from parsolid.scene.bodies import FilledShape
from parsolid.scene.fillings import filling_of as lattice_of
from parsolid.scene.lattice import Filling


def filling_of(
    body: FilledShape,
    dimension: int,
    comm: MPI.Comm = MPI.COMM_SELF,
    mesh: MeshSlices | None = None,
    groups: Sequence[str] = (),
) -> Filling:
    """The particles of a body, not yet made; mesh, groups: see `MeshFilling`; collective. Raises SceneError for a mesh
    that cannot be used."""
    if body.shape.kind != "mesh":
        return lattice_of(body, dimension)
    filling = MeshFilling(comm, body, dimension, mesh, groups)
    _EXTENTS[_key(body, dimension)] = Extent(filling.lower, filling.upper, filling.coarsest)
    return filling


class Extent(NamedTuple):
    """Bounds (d,) [m] of a body and its largest particle spacing [m]."""

    lower: np.ndarray
    upper: np.ndarray
    coarsest: float


# of meshes that have been read: where bodies are asked of one by one, none is read again
_EXTENTS: dict[tuple[Any, ...], Extent] = {}


def extent_of(body: FilledShape, dimension: int) -> Extent:
    """How far a body reaches. Raises SceneError for a mesh that cannot be used."""
    if body.shape.kind != "mesh" or _key(body, dimension) not in _EXTENTS:
        filling = filling_of(body, dimension)
        return Extent(filling.lower, filling.upper, filling.coarsest)
    return _EXTENTS[_key(body, dimension)]


def _key(body: FilledShape, dimension: int) -> tuple[Any, ...]:
    """What the extent of a mesh follows from."""
    model, state = body.shape.model, os.stat(body.shape.model.file)
    return *model.of_whole, model.group, body.placed_on, dimension, state.st_mtime_ns, state.st_size
