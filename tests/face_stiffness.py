"""How stiff the face of a half plane is: exactly, and of peridynamics, from definitions alone (no line of the package).

A load of wave number k (over the spacing h of the particles) lies on the first two layers of particles, half on each,
as that of kernel contact does, and the mean displacement of both layers answers, statically and for small strain. The
stiffness is that over 2 k/E' of a load on the face of a half plane; so `exact`, one load a cell, is above 1, for what
lies deeper moves less. Modes are exact along the face (Bloch), layers go so deep that nothing is left.

peridynamics: correspondence with shear-scaled control of a coefficient.
"""

import numpy as np

YOUNG, POISSON = 1.0, 0.3
SHEAR = YOUNG / (2.0 * (1.0 + POISSON))
LAME = 2.0 * SHEAR * POISSON / (1.0 - 2.0 * POISSON)
PLANE = YOUNG / (1.0 - POISSON**2)
# of the gradients 11, 12, 21, 22 of a displacement
ELASTIC = np.array([[LAME + 2 * SHEAR, 0, 0, LAME], [0, SHEAR, SHEAR, 0], [0, SHEAR, SHEAR, 0], [LAME, 0, 0, LAME]])
ELASTIC[3, 3] = LAME + 2 * SHEAR
# depth of the body over a wave length's 1/k
DEEP = 9.0


def answer(stiffness: np.ndarray, load: np.ndarray, k: float) -> float:
    """Load over displacement over 2 k/E'; load (n,) gives the mean of the displacements, too."""
    return float(1.0 / (load.conj() @ np.linalg.solve(stiffness, load)).real / (0.5 * PLANE * k))


def exact(k: float) -> float:
    """Layers of thickness .05 h with linear functions, loads spread evenly over two layers of thickness h."""
    thick = 0.05
    count = round(DEEP / k / thick)
    stiffness, load = np.zeros((2 * count + 2, 2 * count + 2), complex), np.zeros(2 * count + 2, complex)
    for n in range(count):
        here, s = slice(2 * n, 2 * n + 4), 0.5
        for at in (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)):
            N, slope = (1 - at, at), (1 / thick, -1 / thick)
            B = np.zeros((4, 4), complex)
            for q in range(2):
                B[0, 2 * q] = B[2, 2 * q + 1] = 1j * k * N[q]
                B[1, 2 * q] = B[3, 2 * q + 1] = slope[q]
            stiffness[here, here] += s * thick * B.conj().T @ ELASTIC @ B
        if (n + 0.5) * thick < 2.0:
            load[[2 * n + 1, 2 * n + 3]] += 0.25 * thick
    return answer(stiffness[:-2, :-2], load[:-2], k)


def peridynamics(k: float, horizon: int, coefficient: float, dimension: int = 2, layers: int = 0) -> float:
    """Constant weight; the last layers are held. layers: below so many the coefficient is that of beams; dimension 3:
    the same waves on a lattice in space."""
    count, cut = int(DEEP / k), horizon + 0.015
    stiffness = np.zeros((2 * count, 2 * count), complex)
    elastic = np.zeros((dimension,) * 4)
    for i, j in np.ndindex(dimension, dimension):
        elastic[i, i, j, j] += LAME
        elastic[i, j, i, j] += SHEAR
        elastic[i, j, j, i] += SHEAR
    off = range(-horizon, horizon + 1)
    for layer in range(count):
        low, high = max(0, layer - horizon), min(count, layer + horizon + 1)
        near = [(x, q, z) for x in off for q in range(low, high) for z in (off if dimension == 3 else (0,))]
        near = [(x, q, z) for x, q, z in near if 0 < x * x + (q - layer) ** 2 + z * z <= cut * cut]
        bond = np.array([(x, layer - q, z) for x, q, z in near], float)[:, :dimension]
        inverse = np.linalg.inv(bond.T @ bond)
        change = np.zeros((len(near), dimension, 2 * (high - low)), complex)
        for n, (x, q, _) in enumerate(near):
            for axis in range(2):
                change[n, axis, 2 * (q - low) + axis] += np.exp(1j * k * x)
                change[n, axis, 2 * (layer - low) + axis] -= 1.0
        gradient = np.tensordot(change, bond @ inverse, axes=(0, 0)).transpose(0, 2, 1)
        left = change - np.tensordot(bond, gradient, axes=(1, 1))
        beams = layers and layer >= layers
        control = (0.35 if beams else coefficient) * SHEAR * (np.trace(inverse) * np.eye(dimension) + 2.0 * inverse)
        here, B = slice(2 * low, 2 * high), gradient.reshape(dimension**2, -1)
        stiffness[here, here] += B.conj().T @ elastic.reshape(len(B), -1) @ B
        stiffness[here, here] += np.einsum("nau,ab,nbv->uv", left.conj(), control, left, optimize=True)
    load = np.zeros(2 * count, complex)
    load[[1, 3]] = 0.5
    free = 2 * (count - horizon)
    return answer(stiffness[:free, :free], load[:free], k)
