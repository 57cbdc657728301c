"""Parts of space of which boundary conditions speak; which particles are in them is in `particles.regions`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from parsolid.scene.base_model import Plane


@dataclass(frozen=True)
class Region:
    """A part of space, of which a boundary condition speaks; its particles are those that are in it to a rounding
    error, unless it says otherwise."""

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are in it, to a tolerance [m]."""
        raise NotImplementedError

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """Whether a box (d,), (d,) [m], grown by a tolerance [m], may have a part of it: whether the point of the box
        that is nearest to the middle of the region is in it."""
        return bool(self.contains(np.clip(self.middle(), lower, upper)[None], tolerance)[0])

    def middle(self) -> np.ndarray:
        """A point (d,) [m] in the middle; of a region without one, infinity on its side."""
        raise NotImplementedError


@dataclass(frozen=True)
class OnPlane(Region):
    """A plane: the particles on it.

    Where particles sit in cells, those whose cell it touches; where these cells are jittered or a mesh's, only those
    with a face on the surface of the body.
    """

    plane: Plane

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        return np.asarray(np.abs(self.plane.height(places)) <= tolerance)

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        axis, offset = self.plane.axis, self.plane.offset
        return bool(lower[axis] - tolerance <= offset <= upper[axis] + tolerance)


@dataclass(frozen=True)
class Beside(Region):
    """One side of a plane, those on it too."""

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
        # some particle is the nearest
        return True


@dataclass(frozen=True)
class Named(Region):
    """A region with a name, whose particles were found when they were made, see `particles.regions.region_of`."""

    name: str

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        return True
