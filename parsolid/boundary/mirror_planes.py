"""Mirror planes, of particles and of grids, and the reflections that pairs need.

Rollers and fixed walls are planes with mirror images: v' = Q v at X' = R X + T, with Q = R at a roller (symmetry), Q =
-1 at a fixed wall and Q = -R where only normal motion is free (antisymmetry, exact for small strain: the stress of the
image has the other sign). Particles on a plane are held as well. Planes may move with a velocity w: then
v' = Q v + 2 w, at the present plane.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.collective import anywhere, minimum, raise_together
from parsolid.particles.particle_set import ParticleSet

# a particle within this fraction of its spacing of a plane lies on it
ON_PLANE = 1e-6


@dataclass(frozen=True)
class MirrorPlane:
    """The plane X[axis] = coordinate; kind: "roller", "fixed" or "antisymmetric"; body: an index, None means all;
    motion: its velocity in time, a `LoadHistory`, None at rest."""

    axis: int
    coordinate: float
    kind: str
    body: int | None = None
    motion: Any = None

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
    [m] for "on the plane". The image of a particle is at x' = D x + (R - D) X + T: reflected at the present plane, or
    carried along where antisymmetry lets the plane move with the matter; drifts D: (codes, 3).

    moving: planes with a motion; travelled (moving,): how far [m] they have gone along their normals, since when T was
    shifts_at_start; velocities (codes, 3): what images have besides Q v [m/s].
    """

    signs: np.ndarray
    reflections: np.ndarray
    shifts: np.ndarray
    stress_signs: np.ndarray
    planes: list[tuple[MirrorPlane, ...]]
    tolerance: float
    drifts: np.ndarray
    moving: list[MirrorPlane]
    travelled: np.ndarray
    velocities: np.ndarray
    shifts_at_start: np.ndarray

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
        stress_signs, drifts = np.ones(len(subsets)), np.ones((len(subsets), 3))
        for code, subset in enumerate(subsets):
            for plane in subset:
                signs[code] *= plane.signs()
                stress_signs[code] *= -1.0 if plane.kind == "antisymmetric" else 1.0
                reflections[code, plane.axis] = -1.0
                shifts[code, plane.axis] = 2.0 * plane.coordinate
                drifts[code, plane.axis] = 1.0 if plane.kind == "antisymmetric" else -1.0
        moving = [plane for plane in planes if plane.motion is not None]
        motion = drifts, moving, np.zeros(len(moving)), np.zeros_like(shifts), shifts.copy()
        return cls(signs, reflections, shifts, stress_signs, subsets, tolerance, *motion)

    def drive(self, time: float, step: float) -> None:
        """Give images the mean velocity of their planes in a step [s] from a time [s], by Simpson's rule.

        Where two planes meet that contradict one another, images have the mean of both.
        """
        speeds, at = dict[MirrorPlane, np.ndarray](), np.zeros((1, 3))
        for plane in self.moving:
            first, middle, last = (
                plane.motion.evaluate(at, time + part * step, part == 1.0) for part in (0.0, 0.5, 1.0)
            )
            mean = (first + 4.0 * middle + last)[0] / 6.0
            speeds[plane] = np.pad(mean, (0, 3 - len(mean)))
        for code, subset in enumerate(self.planes):
            self.velocities[code] = 0.0
            for order in (subset, subset[::-1]):
                shift = np.zeros(3)
                for plane in order:
                    shift = plane.signs() * shift + 2.0 * speeds.get(plane, 0.0)
                self.velocities[code] += 0.5 * shift

    def travel(self, step: float) -> None:
        """Let planes go on for a step [s] with the velocities that images have."""
        codes = [self.planes.index((plane,)) for plane in self.moving]
        speed = [0.5 * self.velocities[code, plane.axis] for code, plane in zip(codes, self.moving)]
        self.put(self.travelled + step * np.array(speed))

    def put(self, travelled: np.ndarray) -> None:
        """Bring moving planes to where they are after they have travelled (moving,) [m]."""
        self.travelled = travelled
        for code, subset in enumerate(self.planes):
            for plane in subset:
                self.shifts[code, plane.axis] = 2.0 * self._place(plane)

    def _place(self, plane: MirrorPlane) -> float:
        """Where along its normal a plane is now [m]; that of antisymmetry goes with the matter."""
        if plane.motion is None or plane.kind == "antisymmetric":
            return plane.coordinate
        return plane.coordinate + float(self.travelled[self.moving.index(plane)])

    @property
    def carried(self) -> bool:
        """Whether images go along with the matter beside any plane."""
        return bool((self.drifts != self.reflections).any())

    def images(self, positions: np.ndarray, reference: np.ndarray, code: int) -> np.ndarray:
        """Images (k, d) [m] by a code of particles at positions, which have reference positions (k, d) [m]."""
        d = positions.shape[1]
        R, D, T = (array[code, :d] for array in (self.reflections, self.drifts, self.shifts))
        return D * positions + (R - D) * reference + T

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

    def near(
        self, positions: np.ndarray, body: np.ndarray, code: int, reach: np.ndarray, reference: np.ndarray | None = None
    ) -> np.ndarray:
        """Particles that all planes of a code are meant for and within reach (d,) [m] of them; reference: positions
        (n, d) [m] at the start, where these are other ones."""
        result = np.ones(len(positions), bool)
        for plane in self.planes[code]:
            result &= plane.concerns(body)
            place, factor = positions, 1.0
            if plane.kind == "antisymmetric" and reference is not None:
                # matter beside a plane that goes with it may have been compressed
                place, factor = reference, 1.5
            result &= np.abs(place[:, plane.axis] - self._place(plane)) <= factor * reach[plane.axis]
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
