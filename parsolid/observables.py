"""Quantities shown to the user: fields of particles and sums over the body, from a method's state."""

import numpy as np

from parsolid.methods.stresses import as_matrices, stress_components

class Observables:
    """Fields by name for a range of a rank's particles.

    Every field is an array (n,), (n, d) or (n, 3, 3): displacement [m], velocity [m/s], position [m], deformation_gradient,
    stress (Cauchy) [Pa], first_piola_kirchhoff_stress [Pa], pressure [Pa] (positive in compression), jacobian, body, identifier,
    von_mises_stress [Pa], rank.
    """

    def __init__(self, method):
        self.method = method
        self.table = method.table
        self.dimension = method.dimension

    def field(self, name: str, first: int = 0, last: int | None = None) -> np.ndarray:
        """Values of particles first..last-1 (all owned by default)."""
        last = self.method.owned if last is None else last
        direct = {"velocity", "position", "jacobian", "body", "identifier"}
        if name in direct:
            return self.table.owned_rows(name)[first:last]
        if name == "displacement":
            rows = self.table.owned_rows
            return rows("position")[first:last] - rows("reference_position")[first:last]
        if name == "rank":
            return np.full(last - first, self.method.comm.rank)
        if name == "deformation_gradient":
            return self._deformation_gradient(first, last)
        return self._stress_field(name, first, last)

    def _deformation_gradient(self, first: int, last: int) -> np.ndarray:
        d = self.dimension
        result = np.zeros((last - first, 3, 3))
        result[:, d:, d:] = 1.0
        result[:, :d, :d] = self.table.owned_rows("deformation_gradient")[first:last].reshape(-1, d, d)
        return result

    def _stress_field(self, name: str, first: int, last: int) -> np.ndarray:
        P = self._first_piola_kirchhoff(first, last)
        if name == "first_piola_kirchhoff_stress":
            return P
        jacobian = self.table.owned_rows("jacobian")[first:last]
        stress = P @ self._deformation_gradient(first, last).swapaxes(1, 2) / jacobian[:, None, None]
        if name == "stress":
            return stress
        pressure = -np.trace(stress, axis1=1, axis2=2) / 3.0
        if name == "pressure":
            return pressure
        if name == "von_mises_stress":
            deviator = stress + pressure[:, None, None] * np.eye(3)
            return np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
        raise KeyError(name)

    def _first_piola_kirchhoff(self, first: int, last: int) -> np.ndarray:
        method = self.method
        rows = np.zeros((last - first, 9 if self.dimension == 3 else 5))
        for group in method.groups:
            low, high = max(first, group.first), min(last, group.last)
            if low < high:
                part = rows[low - first : high - first]
                stress_components(method.space, low, high, group.law, method.body_of(group), part)
        return as_matrices(rows)

    def totals(self, name: str) -> np.ndarray:
        """This rank's share of a sum over the body: linear_momentum [kg m/s], angular_momentum [kg m^2/s] about the origin
        (three components, or one in the plane), or mass [kg] and first moments [kg m] for centre_of_mass."""
        method = self.method
        mass = (method.mass * method.share)[:, None]
        x, v = self.table.owned_rows("position"), self.table.owned_rows("velocity")
        if name == "linear_momentum":
            return (mass * v).sum(axis=0)
        if name == "angular_momentum":
            if self.dimension == 2:
                return np.array([mass[:, 0] @ (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])])
            return (mass * np.cross(x, v)).sum(axis=0)
        return np.append((mass * x).sum(axis=0), mass.sum())
