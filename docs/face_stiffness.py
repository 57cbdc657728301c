"""How stiff the face of a half plane is to each method: python docs/face_stiffness.py exact peridynamics mpm.

A load of wave number k (over the spacing h of the particles) lies on the first two layers of particles, half on each,
as that of kernel contact does, and the mean displacement of both layers answers, statically and for small strain. Told
is the stiffness over 2 k/E', that of a load on the face of a half plane; so `exact`, one load a cell, is above 1, for
what lies deeper moves less. Modes are exact along the face (Bloch), layers go so deep that nothing is left; all of it
is made here from the methods' definitions, and no line of the package takes part.

peridynamics: correspondence with shear-scaled control of several coefficients; 0 is total-Lagrangian SPH but for the
kernel. space: the same on a lattice in space; layers: with one coefficient in the first layers and that of beams below.
mpm: cells of two particles a direction, the face on nodes; `fine`: the same basis, with energies summed over 16
points a cell and direction in place of the two particles; `carried`: nodes beyond the face have no motion of their own.
"""

import sys
from collections.abc import Callable, Iterator

import numpy as np

YOUNG, POISSON = 1.0, 0.3
SHEAR = YOUNG / (2.0 * (1.0 + POISSON))
LAME = 2.0 * SHEAR * POISSON / (1.0 - 2.0 * POISSON)
PLANE = YOUNG / (1.0 - POISSON**2)
WAVES = (0.2, 0.3, 0.45, 0.6)
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


def hat(x: np.ndarray, width: float) -> np.ndarray:
    """The linear function of a node, averaged over a width about x, in cells."""

    def integral(y: np.ndarray) -> np.ndarray:
        y = np.clip(y, -1.0, 1.0)
        return np.asarray(y - 0.5 * np.sign(y) * y**2)

    return (integral(x + 0.5 * width) - integral(x - 0.5 * width)) / width


def slope(x: np.ndarray, width: float) -> np.ndarray:
    """The derivative of `hat`."""

    def value(y: np.ndarray) -> np.ndarray:
        return np.maximum(1.0 - np.abs(y), 0.0)

    return np.asarray((value(x + 0.5 * width) - value(x - 0.5 * width)) / width)


def points(k: float, width: float, fine: bool, carried: bool = False) -> float:
    """Hat functions averaged over a width in cells: 1 are quadratic splines, .5 those of uGIMP with two particles a
    cell, 1e-3 linear ones. Cells are 2 h. carried: nodes beyond the face move as the particles that they see."""
    rows, cell = int(0.5 * DEEP / k), 2.0
    nodes = np.array([(i, j) for i in range(-2, 4) for j in range(1, -rows, -1)], float)

    def maps(per_cell: int, depth: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Displacement (2, n) and gradients (4, n) of points of one column of cells, down from the face."""
        for at in (np.arange(per_cell) + 0.5) / per_cell:
            for y in -(np.arange(depth * per_cell) + 0.5) / per_cell:
                X, Y = at - nodes[:, 0], y - nodes[:, 1]
                wave = np.exp(1j * k * cell * nodes[:, 0])
                N = hat(X, width) * hat(Y, width) * wave
                G = (slope(X, width) * hat(Y, width) * wave / cell, hat(X, width) * slope(Y, width) * wave / cell)
                u, B = np.zeros((2, 2 * (rows + 1)), complex), np.zeros((4, 2 * (rows + 1)), complex)
                # nodes of a row move alike but for their wave
                row = (1 - nodes[:, 1]).astype(int)
                for axis in range(2):
                    np.add.at(u[axis], 2 * row + axis, N)
                    np.add.at(B[2 * axis], 2 * row + axis, G[0])
                    np.add.at(B[2 * axis + 1], 2 * row + axis, G[1])
                phase = np.exp(-1j * k * cell * at)
                yield u * phase, B * phase

    each = 16 if fine else 2
    stiffness = sum(B.conj().T @ ELASTIC @ B * cell / each**2 for _, B in maps(each, rows - 3)) * cell / 2.0
    load = sum(0.25 * u[1].conj() for u, _ in maps(2, 1))
    used = np.abs(np.diag(stiffness)) > 1e-12
    used[-6:] = False
    if carried:
        mass = sum(u[1:, 1::2].conj().T @ u[1:, 1::2] for u, _ in maps(2, 2))
        # of two particles a cell, only those of the first layer are seen from a cell beyond the face
        weight = 2.0 * hat(np.array([-1.25]), width)[0]
        tied = np.eye(2 * (rows + 1), dtype=complex)[:, 2:]
        for axis in range(2):
            tied[axis, axis::2] = mass[0, 1:] / (weight - mass[0, 0])
        stiffness, load, used = tied.conj().T @ stiffness @ tied, tied.conj().T @ load, used[2:]
    # energy of a spacing of the face in place of a cell
    return answer(stiffness[np.ix_(used, used)], load[used], k)


def rows(name: str) -> Iterator[tuple[str, Callable[[float], float]]]:
    """Names of lines, and their stiffness of a wave number."""
    if name == "exact":
        yield "exact", exact
    elif name == "peridynamics":
        for horizon in (3, 2):
            for coefficient in (0.05, 0.125, 0.35, 1.0):
                yield (
                    f"horizon {horizon} h, coefficient {coefficient}",
                    lambda k, m=horizon, c=coefficient: peridynamics(k, m, c),
                )
    elif name == "space":
        for coefficient in (1.0 / 15.0, 0.1, 0.125, 0.15, 0.35):
            line = f"in space, horizon 3 h, coefficient {coefficient:.3g}"
            yield line, lambda k, c=coefficient: peridynamics(k, 3, c, 3)
    elif name == "layers":
        for count in (1, 2, 3, 4, 6, 8):
            yield f"coefficient .125 in {count} layers, .35 below", lambda k, n=count: peridynamics(k, 3, 0.125, 2, n)
    else:
        for basis, width in (("quadratic splines", 1.0), ("uGIMP", 0.5), ("linear", 1e-3)):
            yield f"mpm, {basis}", lambda k, w=width: points(k, w, False)
            if width == 1.0:
                yield f"mpm, {basis}, carried", lambda k, w=width: points(k, w, False, True)
            if width > 0.1:
                yield f"mpm, {basis}, fine", lambda k, w=width: points(k, w, True)


def main() -> None:
    """A line for each method and setting."""
    print("k h:", *WAVES)
    for name in sys.argv[1:] or ("exact", "peridynamics", "mpm"):
        for line, stiffness in rows(name):
            print(f"{line}:", *(f"{stiffness(k):.3f}" for k in WAVES), flush=True)


if __name__ == "__main__":
    main()
