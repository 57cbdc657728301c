"""Boundary conditions on a rank's particles: mirror planes, held and prescribed components, tractions.

Rollers and fixed walls are planes with mirror images: v' = Q v at X' = R X + T, with Q = R at a roller (symmetry), Q = -1 at
a fixed wall and Q = -R where only normal motion is free (antisymmetry, exact for small strain: the stress of the image has
the other sign). Particles on a plane are held as well.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from parsolid.kernels.pairs import image_table
from parsolid.together import anywhere, raise_together

# a particle within this fraction of its spacing of a plane lies on it
ON_PLANE = 1e-6


@dataclass(frozen=True)
class MirrorPlane:
    """The plane X[axis] = coordinate; kind is "roller", "fixed" or "antisymmetric"."""

    axis: int
    coordinate: float
    kind: str

    def signs(self) -> np.ndarray:
        """Q (3,)."""
        reflection = np.ones(3)
        reflection[self.axis] = -1.0
        return {"roller": reflection, "fixed": -np.ones(3), "antisymmetric": -reflection}[self.kind]

    def held(self, dimension: int) -> np.ndarray:
        """Which components (d,) of a particle on the plane do not move."""
        normal = np.arange(dimension) == self.axis
        return {"roller": normal, "fixed": np.ones(dimension, bool), "antisymmetric": ~normal}[self.kind]

    def contains(self, positions: np.ndarray, spacing: np.ndarray) -> np.ndarray:
        """Which particles lie on the plane."""
        return np.abs(positions[:, self.axis] - self.coordinate) <= ON_PLANE * spacing.min(axis=1)


@dataclass
class MirrorCodes:
    """Every reflection a rank may need: in one plane, or in two or three at their common edge or corner.

    signs Q, reflections R, shifts T: (codes, 3); stress_signs s: (codes,); planes: the planes of each code; tolerance [m] for "on the plane".
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

    def near(self, positions: np.ndarray, code: int, reach: np.ndarray) -> np.ndarray:
        """Particles within reach (d,) [m] of all planes of a code."""
        result = np.ones(len(positions), bool)
        for plane in self.planes[code]:
            result &= np.abs(positions[:, plane.axis] - plane.coordinate) <= reach[plane.axis]
        return result

    def on_planes(self, positions: np.ndarray, code: int) -> np.ndarray:
        """Particles on any plane of a code: their image there is one of a code with fewer planes."""
        result = np.zeros(len(positions), bool)
        for plane in self.planes[code]:
            result |= np.abs(positions[:, plane.axis] - plane.coordinate) <= self.tolerance
        return result

    def table(self, dimension: int) -> np.ndarray:
        """Rows for `kernels.pairs.Images`."""
        places = (array[:, :dimension] for array in (self.signs, self.reflections, self.shifts))
        return image_table(dimension, *places, self.stress_signs)


def check_sides(comm, plane: MirrorPlane, cloud, key: str) -> None:
    """All particles must lie on one side of a mirror plane; collective."""
    offset = cloud.position[:, plane.axis] - plane.coordinate
    slack = ON_PLANE * cloud.spacing.min(axis=1, initial=np.inf)
    below = anywhere(comm, np.any(offset < -slack))
    above = anywhere(comm, np.any(offset > slack))
    letter = "XYZ"[plane.axis]
    fault = None
    if below and above:
        fault = f"{key}.plane: expected a plane that bounds the bodies, found particles on both sides of {letter} = {plane.coordinate:g}"
    raise_together(comm, fault)
