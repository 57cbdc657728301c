"""One rank's piece of the generated particles."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from parsolid.scene.codes import Note


@dataclass
class ParticleSet:
    """Generated particles before they are partitioned; d = dimension, n = particles on this rank.

    identifier (n,) int64   global id, independent of the number of ranks
    position   (n, d)       reference position X [m]
    volume     (n,)         tributary volume [m^3]; in 2-D per metre of thickness
    spacing    (n, d)       spacing along the particle's own axes [m]
    axes       (n, d, d)    rows = the particle's own orthonormal axes; None = Cartesian
    body       (n,) int32   index into the scene's bodies
    area       (n, d)       outward boundary area vector [m^2]: one component per direction, zero inside
    area_across (n, d)      of each axis, outward area [m^2] of boundary facets that lie across it; None without meshes
    regions    (n, r) int64 1 in each of the scene's r regions with a name, else 0; None without any
    surfaces   (n, r d)     outward area vectors [m^2] of what of its boundary is in each of them
    meshes                  slices of the meshes that they are nodes of, by their keys, until systems are set up
    notes                   on the meshes, the same on all ranks
    """

    identifier: np.ndarray
    position: np.ndarray
    volume: np.ndarray
    spacing: np.ndarray
    axes: np.ndarray | None
    body: np.ndarray
    area: np.ndarray
    area_across: np.ndarray | None = None
    regions: np.ndarray | None = None
    surfaces: np.ndarray | None = None
    meshes: dict[tuple[Any, ...], Any] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.identifier)

    def area_in_planes(self) -> np.ndarray:
        """Outward areas (n, d) [m^2] in the plane across each axis, without those of oblique facets of meshes."""
        return self.area if self.area_across is None else self.area_across

    @classmethod
    def joined(
        cls, pieces: list["ParticleSet"], dimension: int, regions: int = 0, meshes: bool = False
    ) -> "ParticleSet":
        """Pieces one after the other; axes and areas are filled in where only some pieces have them; regions: how many
        there are; meshes: whether there is one on any rank."""
        if not pieces:
            vectors = np.zeros((0, dimension))
            marks = (np.zeros((0, regions), np.int64), np.zeros((0, regions * dimension))) if regions else (None, None)
            return cls(
                np.zeros(0, np.int64),
                vectors,
                np.zeros(0),
                vectors.copy(),
                None,
                np.zeros(0, np.int32),
                vectors.copy(),
                vectors.copy() if meshes else None,
                *marks,
            )
        axes = None
        if any(piece.axes is not None for piece in pieces):
            cartesian = np.eye(dimension)
            axes = np.concatenate([np.tile(cartesian, (len(p), 1, 1)) if p.axes is None else p.axes for p in pieces])
        names = ["identifier", "position", "volume", "spacing", "body", "area"]
        names += ["regions", "surfaces"] if pieces[0].regions is not None else []
        joined: dict[str, Any] = {name: np.concatenate([getattr(p, name) for p in pieces]) for name in names}
        if meshes:
            joined["area_across"] = np.concatenate([piece.area_in_planes() for piece in pieces])
        return cls(axes=axes, **joined)
