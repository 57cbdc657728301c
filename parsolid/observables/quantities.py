"""Quantities of all particles: the least and the greatest, momentum and centre of mass."""

from typing import Any

import numpy as np

from parsolid.observables.declared import Observables, Sampler, quantity


@quantity("minimum_jacobian")
class MinimumJacobian(Sampler):
    """The least Jacobian."""

    reduction = "minimum"

    def part(self, watched: Observables) -> np.ndarray:
        return np.array([watched.field("jacobian").min(initial=np.inf)])


@quantity("maximum_speed")
class MaximumSpeed(Sampler):
    """The greatest speed [m/s]."""

    reduction = "maximum"

    def part(self, watched: Observables) -> np.ndarray:
        return np.array([np.linalg.norm(watched.rows("velocity"), axis=1).max(initial=0.0)])


@quantity("linear_momentum")
class LinearMomentum(Sampler):
    """sum m v [kg m/s]."""

    def part(self, watched: Observables) -> np.ndarray:
        mass, v = watched.tributary_mass[:, None], watched.rows("velocity")
        return np.asarray((mass * v).sum(axis=0))


@quantity("angular_momentum")
class AngularMomentum(Sampler):
    """sum m x cross v [kg m^2/s] about the origin, with the spin of the particles themselves where a method has it
    (`own_angular_momentum`): three components, or one in the plane."""

    def part(self, watched: Observables) -> np.ndarray:
        mass, x, v = watched.tributary_mass[:, None], watched.rows("position"), watched.rows("velocity")
        if watched.dimension == 1:
            return np.zeros(1)
        if watched.dimension == 2:
            return np.array([mass[:, 0] @ (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])]) + self._own(watched)
        return np.asarray((mass * np.cross(x, v)).sum(axis=0)) + self._own(watched)

    @staticmethod
    def _own(watched: Observables) -> Any:
        """Spin of all particles about their own positions [kg m^2/s]."""
        try:
            return np.nan_to_num(watched.field("own_angular_momentum")).sum(axis=0)
        except KeyError:
            return 0.0


@quantity("centre_of_mass")
class CentreOfMass(Sampler):
    """sum m x / sum m [m]."""

    def part(self, watched: Observables) -> np.ndarray:
        """This rank's first moments [kg m] and mass [kg]."""
        mass, x = watched.tributary_mass[:, None], watched.rows("position")
        return np.append((mass * x).sum(axis=0), mass.sum())

    def values(self, joined: np.ndarray) -> np.ndarray:
        return np.asarray(joined[:-1] / joined[-1])
