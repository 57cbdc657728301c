"""The angle by which a material point has turned about an axis."""

from typing import Any

import numpy as np

from parsolid.observables.declared import Observables, Sampler, particle_sampler
from parsolid.observables.samplers import ProbePoint


@particle_sampler("twist")
class Twist(Sampler):
    """Accumulated angle [rad] about an axis; the point may turn by less than half a turn between samples.

    Every rank keeps the angle, so that particles may change their rank.
    """

    def __init__(self, name: str, columns: list[str], place: ProbePoint, probe: Any):
        """probe: the scene's, with its `axis` (Z unless given) and `centre` (the origin unless given)."""
        super().__init__(name, columns)
        self.place = place
        self.axis = "XYZ".index(probe.axis or "Z")
        self.centre = np.zeros(3) if probe.centre is None else np.asarray(probe.centre, float)
        self.angle = 0.0
        self.direction: float | None = None

    def part(self, watched: Observables) -> np.ndarray:
        """This rank's part of the position (d,) [m]."""
        return self.place.value(watched, "position", watched.dimension)

    def values(self, joined: np.ndarray) -> np.ndarray:
        # a right-handed turn about the axis; in the plane the axis points out of it
        second, third = ((1, 2), (2, 0), (0, 1))[self.axis]
        x = joined - self.centre[: len(joined)]
        direction = float(np.arctan2(x[third], x[second]))
        if self.direction is not None:
            self.angle += (direction - self.direction + np.pi) % (2.0 * np.pi) - np.pi
        self.direction = direction
        return np.array([self.angle])

    def state(self) -> tuple[float, float | None]:
        return self.angle, self.direction

    def restore(self, state: Any) -> None:
        self.angle, self.direction = state
