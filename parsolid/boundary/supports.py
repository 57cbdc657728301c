"""Supports of a scene on a rank's particles: mirror planes and clamps."""

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import HeldRegion, Support
from parsolid.boundary.mirror_planes import MirrorCodes, MirrorPlane, check_sides, mirror_codes
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.regions import selected
from parsolid.scene.schema import Scene


class Supports:
    """Supports at the start, in the order of the particle_set; they hold the same particles later on.

    planes: mirror planes; held (n, d) bool: components at rest; codes: every reflection, None without; share (n,): the
    part of a particle on this side of mirror planes.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        scene: Scene,
        supports: list[Support],
        regions: list[HeldRegion],
        particle_set: ParticleSet,
        closed: frozenset[int] = frozenset(),
    ):
        """regions: held ones with a name, of which "fixed" is a clamp; closed: bodies whose operators end at a fixed
        plane, so that they have no images there.

        Raises SolverError on all ranks when a mirror plane cuts a body. Collective.
        """
        dimension = particle_set.position.shape[1]
        self.planes: list[MirrorPlane] = []
        self.held = np.zeros((len(particle_set), dimension), bool)
        for one in supports:
            chosen = selected(scene, one.where, particle_set, comm)
            if one.mirrored:
                check_sides(comm, one.plane, particle_set, one.key)
                self.planes += _with_images(one.plane, closed, len(scene.bodies))
                # cell-centred particles beside the plane move; their images hold them
                chosen &= one.plane.contains(particle_set)
            self.held |= chosen[:, None] & one.plane.held(dimension)
        for region in regions:
            if region.kind == "fixed":
                self.held |= selected(scene, region.where, particle_set, comm)[:, None]
        self.codes: MirrorCodes | None = mirror_codes(comm, self.planes, particle_set)
        count = np.zeros(len(particle_set))
        for plane in self.planes:
            count += plane.contains(particle_set)
        self.share: np.ndarray = 0.5**count


def _with_images(plane: MirrorPlane, closed: frozenset[int], bodies: int) -> list[MirrorPlane]:
    """A plane for the bodies that have images there."""
    if plane.kind != "fixed" or not closed:
        return [plane]
    return [replace(plane, body=i) for i in range(bodies) if i not in closed and plane.body in (None, i)]
