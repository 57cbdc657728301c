"""Deformation gradients at which laws are tried, derivatives by them, and waves of a tangent."""

import numpy as np

from parsolid.materials.hyperelastic import functions as of


def arguments(F):
    """F, H and J as functions of hyperelastic laws take them."""
    J = float(np.linalg.det(F))
    return tuple(F.ravel().tolist()), tuple((J * np.linalg.inv(F).T).ravel().tolist()), J


def stress(law, F):
    return np.reshape(of.stress(law, *arguments(F)), (3, 3))


def energy(law, F):
    return float(of.energy(law, *arguments(F)))


def deformations(count, spread, seed=3):
    random, found = np.random.default_rng(seed), []
    while len(found) < count:
        F = np.eye(3) + spread * random.normal(size=(3, 3))
        found += [F] if np.linalg.det(F) > 0.3 else []
    return found


def slope(function, F, step=1e-4):
    """Five-point derivatives by the components of F, (3, 3, ...)."""
    result = [[None] * 3 for _ in range(3)]
    for i, j in np.ndindex(3, 3):
        change = np.zeros((3, 3))
        change[i, j] = step
        near = function(F + change) - function(F - change)
        result[i][j] = (8.0 * near - (function(F + 2.0 * change) - function(F - 2.0 * change))) / (12.0 * step)
    return np.array(result)


def tangent_of(function, F, step=1e-4):
    """dP/dF (i, J, k, L) of a stress P (3, 3) by five points."""
    return slope(function, F, step).transpose(2, 3, 0, 1)


def wave_ratios(Q, tangent, normals):
    """N.QN over rho0 c^2 of the fastest wave along each of some normals N (n, 3), of any length; tangent: dP/dF."""
    ratios = []
    for N in normals / np.linalg.norm(normals, axis=1)[:, None]:
        acoustic = np.einsum("iJkL,J,L->ik", tangent, N, N)
        ratios.append((N @ Q @ N) / np.linalg.eigvalsh(0.5 * (acoustic + acoustic.T))[-1])
    return ratios
