"""Regions of boundary conditions; `particles.regions` finds the particles in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from parsolid.scene.base_model import Plane
from parsolid.scene.shapes import SolidShape


@dataclass(frozen=True)
class Region:
    """A part of space; its particles are those in it within rounding, unless the class says otherwise."""

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which points (n, d) [m] are in it, within a tolerance [m]."""
        raise NotImplementedError

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """Whether it may overlap a box (d,), (d,) [m] within a tolerance [m]."""
        return True


@dataclass(frozen=True)
class AtPlane(Region):
    """The particles on a plane, or those on it and on one side of it.

    Of particles in cells those on a plane are those whose cell touches it; of jittered cells and elements of a mesh
    only those with a face on the surface of the body.
    """

    plane: Plane
    side: Literal["above", "below"] | None = None

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        height = self.plane.height(places)
        if self.side is None:
            return np.asarray(np.abs(height) <= tolerance)
        return np.asarray((height if self.side == "above" else -height) >= -tolerance)

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        low, high = lower[self.plane.axis] - tolerance, upper[self.plane.axis] + tolerance
        return bool(
            (self.side == "above" or low <= self.plane.offset) and (self.side == "below" or self.plane.offset <= high)
        )


@dataclass(frozen=True)
class InShape(Region):
    """The inside of a box or a ball."""

    shape: SolidShape

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        return self.shape.inside(places, -tolerance)

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        # the point of the box nearest to the middle of the shape
        middle = np.mean(self.shape.bounds(), axis=0)
        return bool(self.contains(np.clip(middle, lower, upper)[None], tolerance)[0])


@dataclass(frozen=True)
class NearestTo(Region):
    """The particle nearest to a point [m], of any body."""

    point: list[float]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        return np.asarray(np.linalg.norm(places - np.array(self.point), axis=1) <= tolerance)


@dataclass(frozen=True)
class Named(Region):
    """A named region; its particles are known since their generation, see `particles.regions.region_of`."""

    name: str
