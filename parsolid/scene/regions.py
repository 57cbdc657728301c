"""Parts of space of which boundary conditions speak; which particles are in them is in `particles.regions`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from parsolid.scene.base_model import Plane


class Region(Protocol):
    """A part of space, of which a boundary condition speaks."""

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are in it, to a tolerance [m]."""

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """Whether a box (d,), (d,) [m], grown by a tolerance [m], may have a part of it."""


@dataclass(frozen=True)
class _Geometric:
    """A region whose particles are those that are in it to a rounding error."""

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        raise NotImplementedError

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """Whether the point of the box that is nearest to the middle of the region is in it."""
        return bool(self.contains(np.clip(self.middle(), lower, upper)[None], tolerance)[0])

    def middle(self) -> np.ndarray:
        """A point (d,) [m] in the middle; of a region without one, infinity on its side."""
        raise NotImplementedError


@dataclass(frozen=True)
class OnPlane:
    """A plane: the particles on it.

    Where particles sit in cells, those whose cell it touches; where these cells are jittered or a mesh's, only those
    with a face on the surface of the body.
    """

    plane: Plane

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are on it."""
        return np.asarray(np.abs(places[:, self.plane.axis] - self.plane.offset) <= tolerance)

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """Whether the plane cuts or bounds the box."""
        axis, offset = self.plane.axis, self.plane.offset
        return bool(lower[axis] - tolerance <= offset <= upper[axis] + tolerance)


@dataclass(frozen=True)
class Beside(_Geometric):
    """One side of a plane, those on it too."""

    plane: Plane
    side: Literal["above", "below"]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are there."""
        above = places[:, self.plane.axis] - self.plane.offset
        return np.asarray((above if self.side == "above" else -above) >= -tolerance)

    def middle(self) -> np.ndarray:
        """Infinitely far on its side."""
        return np.full(1, np.inf if self.side == "above" else -np.inf)


@dataclass(frozen=True)
class InBox(_Geometric):
    """A box with axis-aligned faces, [m]."""

    lower: list[float]
    upper: list[float]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are in it."""
        slack = np.broadcast_to(tolerance, len(places))[:, None]
        inside = (places >= np.array(self.lower) - slack) & (places <= np.array(self.upper) + slack)
        return np.asarray(inside.all(axis=1))

    def middle(self) -> np.ndarray:
        """Half-way between the corners."""
        return 0.5 * (np.array(self.lower) + np.array(self.upper))


@dataclass(frozen=True)
class InBall(_Geometric):
    """A ball, [m]."""

    centre: list[float]
    radius: float

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are in it."""
        return np.asarray(np.linalg.norm(places - np.array(self.centre), axis=1) <= self.radius + tolerance)

    def middle(self) -> np.ndarray:
        """The centre."""
        return np.array(self.centre)


@dataclass(frozen=True)
class NearestTo:
    """The particle nearest to a point [m]."""

    point: list[float]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Places that are the point."""
        return np.asarray(np.linalg.norm(places - np.array(self.point), axis=1) <= tolerance)

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """True: some particle is the nearest."""
        return True


@dataclass(frozen=True)
class Named:
    """A region with a name, whose particles were found when they were made."""

    name: str

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Nothing: see `particles.regions.region_of`."""
        raise NotImplementedError

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """True: it may."""
        return True
