"""Waves on infinite lattices: the linear operators of the scheme, and the largest stable step of its leapfrog."""

import itertools

import numpy as np

from parsolid.pairs.smoothing import smoothing_kernel
from parsolid.pairs.smoothing.gradient import gradient_factor


def lattice_operators(dimension: int, smoothing: float, kernel: str, pressure: float, shear: float):
    """Stiffness and damping over mass (k, d, d) of plane waves with wave vectors (k, d), for these wave speeds and a
    spacing of 1."""
    W = smoothing_kernel(kernel)
    reach = range(-int(W.support * smoothing) - 1, int(W.support * smoothing) + 2)
    X = np.array([place for place in itertools.product(reach, repeat=dimension) if any(place)], float)
    q = np.linalg.norm(X, axis=1) / smoothing
    X, q = X[q < W.support], q[q < W.support]
    g = X * np.array([gradient_factor(W, float(value), dimension) for value in q])[:, None]
    g /= (X.T @ g)[0, 0]
    axis = np.linspace(0.0, np.pi, 9)
    waves = np.array([k for k in itertools.product(axis, repeat=dimension) if list(k) == sorted(k)])
    phase = waves @ X.T
    gradient = np.sin(phase) @ g
    identity, square = np.eye(dimension), np.einsum("ki,ki->k", gradient, gradient)
    stiffness = shear**2 * square[:, None, None] * identity
    stiffness = stiffness + (pressure**2 - shear**2) * np.einsum("ki,kj->kij", gradient, gradient)
    n = X / np.linalg.norm(X, axis=1)[:, None]
    impedance = shear * identity + (pressure - shear) * np.einsum("ri,rj->rij", n, n)
    jump = 1.0 - np.cos(phase) - 0.5 * np.sin(phase) * (gradient @ X.T)
    damping = np.einsum("kr,r,rij->kij", jump, np.linalg.norm(g, axis=1), impedance)
    return stiffness, damping


def stable_step(stiffness: np.ndarray, damping: np.ndarray) -> float:
    """The largest step for which no wave grows: v += dt (-K x - B v), then x += dt v."""
    low, high = 0.0, 4.0
    identity = np.eye(stiffness.shape[1])
    for _ in range(20):
        dt = 0.5 * (low + high)
        kept = identity - dt * damping
        top = np.concatenate((kept, -dt * stiffness), axis=2)
        bottom = np.concatenate((dt * kept, identity - dt * dt * stiffness), axis=2)
        growth = np.abs(np.linalg.eigvals(np.concatenate((top, bottom), axis=1))).max()
        low, high = (dt, high) if growth <= 1.0 + 1e-7 else (low, dt)
    return low
