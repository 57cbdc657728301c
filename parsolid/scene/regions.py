"""Regions of boundary conditions; `particles.regions` finds the particles in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from parsolid.scene.base_model import Plane


@dataclass(frozen=True)
class Region:
    """A part of space; its particles are those in it within rounding, unless the class says otherwise."""

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which points (n, d) [m] are in it, within a tolerance [m]."""
        raise NotImplementedError

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """Whether it may overlap a box (d,), (d,) [m] within a tolerance [m]: whether it contains the point of the box
        nearest to its middle."""
        return bool(self.contains(np.clip(self.middle(), lower, upper)[None], tolerance)[0])

    def middle(self) -> np.ndarray:
        """Its middle (d,) [m]; infinite for an unbounded region."""
        raise NotImplementedError


@dataclass(frozen=True)
class OnPlane(Region):
    """The particles on a plane.

    Of particles in cells those whose cell touches the plane; of jittered cells and elements of a mesh only those with
    a face on the surface of the body.
    """

    plane: Plane

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        return np.asarray(np.abs(self.plane.height(places)) <= tolerance)

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        axis, offset = self.plane.axis, self.plane.offset
        return bool(lower[axis] - tolerance <= offset <= upper[axis] + tolerance)


@dataclass(frozen=True)
class Beside(Region):
    """One side of a plane, and the plane itself."""

    plane: Plane
    side: Literal["above", "below"]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        above = self.plane.height(places)
        return np.asarray((above if self.side == "above" else -above) >= -tolerance)

    def middle(self) -> np.ndarray:
        return np.full(1, np.inf if self.side == "above" else -np.inf)


@dataclass(frozen=True)
class InBox(Region):
    """A box with axis-aligned faces, [m]."""

    lower: list[float]
    upper: list[float]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        slack = np.broadcast_to(tolerance, len(places))[:, None]
        inside = (places >= np.array(self.lower) - slack) & (places <= np.array(self.upper) + slack)
        return np.asarray(inside.all(axis=1))

    def middle(self) -> np.ndarray:
        return 0.5 * (np.array(self.lower) + np.array(self.upper))


@dataclass(frozen=True)
class InBall(Region):
    """A ball, [m]."""

    centre: list[float]
    radius: float

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        return np.asarray(np.linalg.norm(places - np.array(self.centre), axis=1) <= self.radius + tolerance)

    def middle(self) -> np.ndarray:
        return np.array(self.centre)


@dataclass(frozen=True)
class NearestTo(Region):
    """The particle nearest to a point [m]."""

    point: list[float]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        return np.asarray(np.linalg.norm(places - np.array(self.point), axis=1) <= tolerance)

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        # any body may have the nearest particle
        return True


@dataclass(frozen=True)
class Named(Region):
    """A named region; its particles are known since their generation, see `particles.regions.region_of`."""

    name: str

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        return True
