"""Fields of every method, computed from its deformation gradient and one of the two stresses."""

import numpy as np

from parsolid.observables.declared import Rows, field


@field
def displacement(rows: Rows) -> np.ndarray:
    """x - X (n, d) [m]."""
    return np.asarray(rows("position") - rows("reference_position"))


@field
def stress(rows: Rows) -> np.ndarray:
    """Cauchy stress (n, 3, 3) [Pa] from P, with the evolved Jacobian where the method has one."""
    F, P = rows("deformation_gradient"), rows("first_piola_kirchhoff_stress")
    return np.asarray(P @ F.swapaxes(1, 2) / rows("jacobian")[:, None, None])


@field
def first_piola_kirchhoff_stress(rows: Rows) -> np.ndarray:
    """P (n, 3, 3) [Pa] from the Cauchy stress."""
    F, sigma = rows("deformation_gradient"), rows.of_method("stress")
    if sigma is None:
        raise KeyError("first_piola_kirchhoff_stress")
    return np.asarray(np.linalg.det(F)[:, None, None] * sigma @ np.linalg.inv(F).swapaxes(1, 2))


@field
def pressure(rows: Rows) -> np.ndarray:
    """-tr(sigma) / 3 (n,) [Pa], positive in compression."""
    return np.asarray(-np.trace(rows("stress"), axis1=1, axis2=2) / 3.0)


@field
def von_mises_stress(rows: Rows) -> np.ndarray:
    """sqrt(3/2 dev(sigma) : dev(sigma)) (n,) [Pa]."""
    return _von_mises(rows("stress"))


@field
def nodal_stress(rows: Rows) -> np.ndarray:
    """Cauchy stress at nodes (n, 3, 3) [Pa]: that of the particles, for methods without a stress at nodes."""
    return rows("stress")


@field
def nodal_von_mises_stress(rows: Rows) -> np.ndarray:
    """Von Mises stress at nodes (n,) [Pa]."""
    return _von_mises(rows("nodal_stress"))


def _von_mises(stress: np.ndarray) -> np.ndarray:
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    return np.asarray(np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator)))


@field
def jacobian(rows: Rows) -> np.ndarray:
    """det F (n,)."""
    return np.asarray(np.linalg.det(rows("deformation_gradient")))


@field
def rank(rows: Rows) -> np.ndarray:
    """Number of the rank that has the particle (n,)."""
    return np.full(rows.last - rows.first, rows.system.comm.rank)


@field
def error_indicator(rows: Rows) -> np.ndarray:
    """Strain energy (n,) [J/m^3] of the difference between the stress and a fit to that of the neighbours, see
    `simulation.field_output.indicate`."""
    found = rows.system.indicated
    return np.zeros(rows.last - rows.first) if found is None else found[rows.first : rows.last]
