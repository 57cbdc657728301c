"""Quantities shown to the user: fields of particles and sums over the body, from a method's state."""

import numpy as np


class Observables:
    """Fields by name for a range of a rank's particles.

    Every field is an array (n,), (n, d) or (n, 3, 3): those of the table, displacement [m], deformation_gradient, stress (Cauchy)
    [Pa], first_piola_kirchhoff_stress [Pa], pressure [Pa] (positive in compression), von_mises_stress [Pa], rank, and what the
    method shows besides.
    """

    def __init__(self, method):
        self.method = method
        self.table = method.table

    def field(self, name: str, first: int = 0, last: int | None = None) -> np.ndarray:
        """Values of particles first..last-1 (all owned by default). Raises KeyError for an unknown name."""
        last = self.method.owned if last is None else last
        if name == "displacement" and name not in self.table.arrays:
            rows = self.table.owned_rows
            return rows("position")[first:last] - rows("reference_position")[first:last]
        if name == "rank":
            return np.full(last - first, self.method.comm.rank)
        values = self.method.shown(name, first, last)
        if values is None and name in self.table.arrays:
            values = self.table.owned_rows(name)[first:last]
        return self._stress_field(name, first, last) if values is None else values

    def _stress_field(self, name: str, first: int, last: int) -> np.ndarray:
        """What follows from the stress that the method shows."""
        shown, inverse = self.method.shown, np.linalg.inv
        F = shown("deformation_gradient", first, last)
        if name == "jacobian":
            return np.linalg.det(F)
        if name == "first_piola_kirchhoff_stress":
            stress = shown("stress", first, last)
            return np.linalg.det(F)[:, None, None] * stress @ inverse(F).swapaxes(1, 2)
        stress = shown("stress", first, last)
        if stress is None:
            P = shown("first_piola_kirchhoff_stress", first, last)
            stress = P @ F.swapaxes(1, 2) / self._jacobian(F, first, last)[:, None, None]
        if name == "stress":
            return stress
        pressure = -np.trace(stress, axis1=1, axis2=2) / 3.0
        if name == "pressure":
            return pressure
        if name == "von_mises_stress":
            deviator = stress + pressure[:, None, None] * np.eye(3)
            return np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
        raise KeyError(name)

    def _jacobian(self, F: np.ndarray, first: int, last: int) -> np.ndarray:
        """The evolved Jacobian where there is one."""
        if "jacobian" in self.table.arrays:
            return self.table.owned_rows("jacobian")[first:last]
        return np.linalg.det(F)

    def totals(self, name: str) -> np.ndarray:
        """This rank's share of a sum over the body: linear_momentum [kg m/s], angular_momentum [kg m^2/s] about the origin
        (three components, or one in the plane), or mass [kg] and first moments [kg m] for centre_of_mass."""
        method = self.method
        mass = (method.mass[: method.owned] * method.share[: method.owned])[:, None]
        x, v = self.table.owned_rows("position"), self.table.owned_rows("velocity")
        if name == "linear_momentum":
            return (mass * v).sum(axis=0)
        if name == "angular_momentum":
            if method.dimension == 1:
                return np.zeros(1)
            if method.dimension == 2:
                return np.array([mass[:, 0] @ (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])])
            return (mass * np.cross(x, v)).sum(axis=0)
        return np.append((mass * x).sum(axis=0), mass.sum())
