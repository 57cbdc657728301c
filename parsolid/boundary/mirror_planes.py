"""Mirror planes, of particles and of grids, and the reflections that pairs need.

Rollers and fixed walls are planes with mirror images: v' = Q v at X' = R X + T, with Q = R at a roller (symmetry), Q =
-1 at a fixed wall and Q = -R where only normal motion is free (antisymmetry, exact for small strain: the stress of the
image has the other sign). Particles on a plane are held as well.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from mpi4py import MPI

from parsolid.collective import anywhere, minimum, raise_together
from parsolid.particles.particle_set import ParticleSet

# a particle within this fraction of its spacing of a plane lies on it
ON_PLANE = 1e-6


@dataclass(frozen=True)
class MirrorPlane:
    """The plane X[axis] = coordinate; kind: "roller", "fixed" or "antisymmetric"; body: an index, None means all."""

    axis: int
    coordinate: float
    kind: str
    body: int | None = None

    def signs(self) -> np.ndarray:
        """Q (3,)."""
        reflection = np.ones(3)
        reflection[self.axis] = -1.0
        return {"roller": reflection, "fixed": -np.ones(3), "antisymmetric": -reflection}[self.kind]

    def held(self, dimension: int) -> np.ndarray:
        """Which components (d,) of a particle on the plane do not move."""
        normal = np.arange(dimension) == self.axis
        return np.array({"roller": normal, "fixed": np.ones(dimension, bool), "antisymmetric": ~normal}[self.kind])

    def concerns(self, body: np.ndarray) -> np.ndarray:
        """Which particles, by their body (n,), the plane is meant for."""
        return np.ones(len(body), bool) if self.body is None else np.asarray(body == self.body)

    def contains(self, particle_set: ParticleSet) -> np.ndarray:
        """Which particles it is meant for lie on the plane."""
        offset = np.abs(particle_set.position[:, self.axis] - self.coordinate)
        near = offset <= ON_PLANE * particle_set.spacing.min(axis=1)
        return np.asarray(self.concerns(particle_set.body) & near)


@dataclass
class MirrorCodes:
    """Every reflection a rank may need: in one plane, or in two or three at their common edge or corner.

    signs Q, reflections R, shifts T: (codes, 3); stress_signs s: (codes,); planes: the planes of each code; tolerance
    [m] for "on the plane".
    """

    signs: np.ndarray
    reflections: np.ndarray
    shifts: np.ndarray
    stress_signs: np.ndarray
    planes: list[tuple[MirrorPlane, ...]]
    tolerance: float

    @classmethod
    def of(cls, planes: list[MirrorPlane], tolerance: float) -> "MirrorCodes | None":
        """All combinations of planes with different normals; None without planes."""
        if not planes:
            return None
        subsets = [
            subset
            for size in (1, 2, 3)
            for subset in combinations(planes, size)
            if len({plane.axis for plane in subset}) == size
        ]
        signs, reflections, shifts = np.ones((3, len(subsets), 3))
        shifts[:] = 0.0
        stress_signs = np.ones(len(subsets))
        for code, subset in enumerate(subsets):
            for plane in subset:
                signs[code] *= plane.signs()
                stress_signs[code] *= -1.0 if plane.kind == "antisymmetric" else 1.0
                reflections[code, plane.axis] = -1.0
                shifts[code, plane.axis] = 2.0 * plane.coordinate
        return cls(signs, reflections, shifts, stress_signs, subsets, tolerance)

    def too_close(self, reach: np.ndarray) -> str | None:
        """Two parallel planes whose images would need images themselves, as a message; reach (d,) of the kernel [m]."""
        planes = [codes[0] for codes in self.planes if len(codes) == 1]
        for first, second in combinations(planes, 2):
            distance = abs(first.coordinate - second.coordinate)
            # neither has images of what the other is meant for
            apart = None not in (first.body, second.body) and first.body != second.body
            if not apart and first.axis == second.axis and 2.0 * distance <= reach[first.axis]:
                return (
                    f"boundaries: expected parallel mirror planes farther apart than half the kernel's reach, "
                    f"{0.5 * reach[first.axis]:.4g} m, found two {distance:.4g} m apart along {'XYZ'[first.axis]}"
                )
        return None

    def near(self, positions: np.ndarray, body: np.ndarray, code: int, reach: np.ndarray) -> np.ndarray:
        """Particles that all planes of a code are meant for and within reach (d,) [m] of them."""
        result = np.ones(len(positions), bool)
        for plane in self.planes[code]:
            result &= plane.concerns(body)
            result &= np.abs(positions[:, plane.axis] - plane.coordinate) <= reach[plane.axis]
        return result

    def on_planes(self, positions: np.ndarray, code: int) -> np.ndarray:
        """Particles on any plane of a code: their image there is one of a code with fewer planes."""
        result = np.zeros(len(positions), bool)
        for plane in self.planes[code]:
            result |= np.abs(positions[:, plane.axis] - plane.coordinate) <= self.tolerance
        return result


def mirror_codes(comm: MPI.Comm, planes: list[MirrorPlane], particle_set: ParticleSet) -> MirrorCodes | None:
    """Every reflection that mirror planes need, None without planes; collective."""
    return MirrorCodes.of(planes, ON_PLANE * minimum(comm, float(particle_set.spacing.min(initial=np.inf))))


def check_sides(comm: MPI.Comm, plane: MirrorPlane, particle_set: ParticleSet, key: str) -> None:
    """All particles that a mirror plane is meant for must lie on one side of it; collective."""
    meant = plane.concerns(particle_set.body)
    offset = particle_set.position[meant, plane.axis] - plane.coordinate
    slack = ON_PLANE * particle_set.spacing[meant].min(axis=1, initial=np.inf)
    below = anywhere(comm, bool(np.any(offset < -slack)))
    above = anywhere(comm, bool(np.any(offset > slack)))
    letter = "XYZ"[plane.axis]
    fault = None
    if below and above:
        fault = (
            f"{key}.plane: expected a plane that bounds the bodies, "
            f"found particles on both sides of {letter} = {plane.coordinate:g}"
        )
    raise_together(comm, fault)


def symmetry_planes(planes: list[MirrorPlane]) -> list[MirrorPlane]:
    """Those in which matter goes on as its mirror image, in any deformation."""
    return [plane for plane in planes if plane.kind == "roller"]
