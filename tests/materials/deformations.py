"""Deformation gradients at which laws are tried, derivatives by them, waves of a tangent, and what every law obeys."""

import numpy as np

from parsolid.materials.hyperelastic import functions as of
from parsolid.materials.hyperelastic.evaluation import symmetric_tensors


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


def assert_derived_from_energy(law, states, step=1e-4, symmetric=1e-8):
    """P is the derivative of W; dP/dF is symmetric; rho c^2 <= N.QN with the exact acoustic tensor along six normals a
    state; a rotation turns the stress. Ratios of N.QN over rho c^2, six a state."""
    random, ratios = np.random.default_rng(5), []
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    for n, F in enumerate(states):
        tangent = tangent_of(lambda one: stress(law, one), F, step)
        matrix = tangent.reshape(9, 9)
        np.testing.assert_allclose(matrix, matrix.T, rtol=0.0, atol=symmetric * np.abs(matrix).max())
        if n % 10 == 1:
            P = stress(law, F)
            dW = slope(lambda one: np.asarray(energy(law, one)), F)
            np.testing.assert_allclose(P, dW, rtol=0.0, atol=1e-8 * np.abs(P).max())
            np.testing.assert_allclose(stress(law, turn @ F), turn @ P, rtol=0.0, atol=1e-11 * np.abs(P).max())
        Q = symmetric_tensors(np.array(of.pressure_waves(law, *arguments(F))))
        ratios += wave_ratios(Q, tangent, random.normal(size=(6, 3)))
    assert min(ratios) > 1.0 - 1e-6, min(ratios)
    return ratios
