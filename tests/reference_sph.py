"""Equations (70)-(75) of Lee et al. in plain numpy, as printed (with the errata of the project), one particle pair at a
time.

Nothing here comes from the solver: kernels, mirror images, laws and sums are written anew, slowly, over all pairs.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

LEVI_CIVITA = np.zeros((3, 3, 3))
for _even in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    LEVI_CIVITA[_even], LEVI_CIVITA[_even[::-1]] = 1.0, -1.0


def cross(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Tensor cross product of (n, 3, 3) tensors."""
    return np.einsum("ijk,IJK,njJ,nkK->niI", LEVI_CIVITA, LEVI_CIVITA, A, B, optimize=True)


@dataclass
class Solid:
    """Mooney-Rivlin with Maxwell branches, eqs (19), (20)."""

    density: float
    xi: float
    zeta: float
    lambda_hat: float
    moduli: tuple = ()
    times: tuple = ()

    @classmethod
    def of(cls, law) -> "Solid":
        """From the solver's law."""
        return cls(
            law.density,
            law.xi,
            getattr(law, "zeta", 0.0),
            law.lambda_hat,
            law.branch_moduli or (),
            law.relaxation_times or (),
        )

    def stress(self, F, H, J, A):
        """P (27), with the logarithms of the branches in Sigma_J."""
        sigma_J = self.lambda_hat * (J - 1.0) - (2.0 * (self.xi + 2.0 * self.zeta) + sum(self.moduli)) / J
        P = 2.0 * self.xi * F + cross(2.0 * self.zeta * H, F) + sigma_J[:, None, None] * H
        return P + sum((mu * F @ a for mu, a in zip(self.moduli, A)), np.zeros_like(F))

    def energy(self, F, H, J, A):
        """Stored energy density (n,)."""
        W = self.xi * (np.sum(F * F, axis=(1, 2)) - 3.0) + self.zeta * (np.sum(H * H, axis=(1, 2)) - 3.0)
        W = W - 2.0 * (self.xi + 2.0 * self.zeta) * np.log(J) + 0.5 * self.lambda_hat * (J - 1.0) ** 2
        for mu, a in zip(self.moduli, A):
            C = F.swapaxes(1, 2) @ F
            W = W + 0.5 * mu * (np.sum(C * a, axis=(1, 2)) - 3.0 - np.log(J**2 * np.linalg.det(a)))
        return W

    def relaxation_power(self, F, A):
        """sum dW/dA_alpha : dA_alpha/dt (n,), with (72e)."""
        C = F.swapaxes(1, 2) @ F
        result = np.zeros(len(F))
        for mu, tau, a in zip(self.moduli, self.times, A):
            result += np.sum(0.5 * mu * (C - np.linalg.inv(a)) * (np.linalg.inv(C) - a) / tau, axis=(1, 2))
        return result

    def pressure_speed(self, F, H, J, A, N):
        """c_p (56) of one particle for the reference direction N; all arguments of one particle, A (branches, 3, 3)."""
        C = F.T @ F
        stretched = N @ (H.T @ H) @ N
        turned = np.trace(C) - N @ C @ N
        curvature = self.lambda_hat + 2.0 * (self.xi + 2.0 * self.zeta) / J**2
        total = 2.0 * self.xi + 2.0 * self.zeta * turned + curvature * stretched
        return np.sqrt(
            (total + sum(mu * (N @ a @ N + stretched / J**2) for mu, a in zip(self.moduli, A))) / self.density
        )

    def shear_speed(self, F, A, N):
        """c_s, the root mean square of both of (59)."""
        C = F.T @ F
        total = 2.0 * self.xi + self.zeta * (np.trace(C) - N @ C @ N)
        return np.sqrt((total + sum(mu * N @ a @ N for mu, a in zip(self.moduli, A))) / self.density)


def wendland_gradient(x: np.ndarray, metric: np.ndarray) -> np.ndarray:
    """grad W at x (3,) for W = c sqrt(det M) (1 - q/2)^4 (2 q + 1), q^2 = x.M x; plane strain has M33 = 1, x3 = 0."""
    c = 7.0 / (4.0 * np.pi) if metric[2, 2] == 1.0 and not metric[2, :2].any() else 21.0 / (16.0 * np.pi)
    q = np.sqrt(x @ metric @ x)
    if q >= 2.0 or q == 0.0:
        return np.zeros(3)
    slope = -2.0 * (1.0 - 0.5 * q) ** 3 * (2.0 * q + 1.0) + 2.0 * (1.0 - 0.5 * q) ** 4
    return c * np.sqrt(np.linalg.det(metric)) * slope * metric @ x / q


@dataclass
class Points:
    """Particles or their mirror images.

    what a neighbour needs to know, with vectors and tensors in three dimensions.
    """

    X: np.ndarray
    x: np.ndarray
    v: np.ndarray
    volume: np.ndarray
    metric: np.ndarray
    origin: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    sign: np.ndarray


def _mirror_signs(axis: int, kind: str) -> tuple[np.ndarray, np.ndarray, float]:
    """(v' = Q v, X' = R X, sign s of P' = s Q P Q) of a plane's image."""
    R = np.eye(3)
    R[axis, axis] = -1.0
    Q = {"roller": R, "fixed": -np.eye(3), "antisymmetric": -R}[kind]
    return Q, R, -1.0 if kind == "antisymmetric" else 1.0


def with_images(points: Points, planes: list[tuple[int, float, str]]) -> Points:
    """The particles and their images in every plane, edge and corner; planes are (axis, coordinate, kind)."""
    pieces = [points]
    for size in (1, 2, 3):
        for subset in combinations(planes, size):
            if len({plane[0] for plane in subset}) == size:
                pieces.append(_images(points, subset))
    names = Points.__dataclass_fields__
    return Points(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in names))


def _images(points: Points, planes) -> Points:
    apart = np.ones(len(points.X), bool)
    Q, R, shift, sign = np.eye(3), np.eye(3), np.zeros(3), 1.0
    for axis, coordinate, kind in planes:
        apart &= np.abs(points.X[:, axis] - coordinate) > 1e-9
        plane_Q, plane_R, plane_sign = _mirror_signs(axis, kind)
        Q, R, sign = Q @ plane_Q, R @ plane_R, sign * plane_sign
        shift[axis] = 2.0 * coordinate
    X = points.X[apart] @ R + shift
    n = len(X)
    return Points(
        X,
        X + (points.x - points.X)[apart] @ Q,
        points.v[apart] @ Q,
        points.volume[apart],
        R @ points.metric[apart] @ R,
        points.origin[apart],
        np.tile(Q, (n, 1, 1)),
        np.tile(R, (n, 1, 1)),
        np.full(n, sign),
    )


@dataclass
class Options:
    """average: "rms" (the solver's sqrt((Z_a^2 + Z_b^2)/2)) or "mean" (75).

    Direction N of the wave speeds: "weight" or "skew".
    """

    dissipation: float = 1.0
    reconstruct: bool = True
    average: str = "rms"
    direction: str = "weight"


@dataclass
class Reference:
    """All of (70)-(75) for n particles (and images behind them); arrays in three dimensions.

    strain: F, H (n, 3, 3), J (n,), A (branches, n, 3, 3); solids: one Solid a particle.
    """

    dimension: int
    points: Points
    n: int
    strain: dict
    solids: list
    options: Options

    def __post_init__(self):
        self.pairs = [self._pairs_of(a) for a in range(self.n)]
        self.L = np.array([self._correction(a) for a in range(self.n)])
        self.gradient = np.array([self._gradient(a) for a in range(self.n)])
        rows = [slice(a, a + 1) for a in range(self.n)]
        F, H, J, A = (self.strain[name] for name in "FHJA")
        self.P = np.concatenate([s.stress(F[r], H[r], J[r], A[:, r]) for s, r in zip(self.solids, rows)])
        self.PL = self.P @ self.L
        forces = [self._forces(a) for a in range(self.n)]
        self.T, self.D = np.array([f[0] for f in forces]), np.array([f[1] for f in forces])

    def _pairs_of(self, a: int) -> list[tuple[int, np.ndarray]]:
        """(neighbour, Omega_a Omega_b grad W_b(X_a))."""
        p, result = self.points, []
        apart, metric = p.X[a] - p.X, 0.5 * (p.metric[a] + p.metric)
        for b in np.flatnonzero(np.einsum("bi,bij,bj->b", apart, metric, apart) < 4.1):
            g = wendland_gradient(p.X[a] - p.X[b], 0.5 * (p.metric[a] + p.metric[b]))
            if b != a and g.any():
                result.append((b, p.volume[a] * p.volume[b] * g))
        return result

    def _correction(self, a: int) -> np.ndarray:
        """L_a (71)."""
        d, p = self.dimension, self.points
        moment = sum(np.outer(g / p.volume[a], p.X[b] - p.X[a]) for b, g in self.pairs[a])
        result = np.zeros((3, 3))
        result[:d, :d] = np.linalg.inv(moment[:d, :d])
        return result

    def _of_image(self, b: int, tensor: np.ndarray, left: str, right: str) -> np.ndarray:
        """A tensor of the particle behind b, with the image's signs Q or R on either side."""
        signs = {"Q": self.points.Q[b], "R": self.points.R[b]}
        return signs[left] @ tensor[self.points.origin[b]] @ signs[right]

    def _gradient(self, a: int) -> np.ndarray:
        """(70)."""
        p = self.points
        total = np.zeros((3, 3))
        for b, g in self.pairs[a]:
            C_ab = 2.0 * self.L[a] @ g
            total += 0.5 * np.outer(p.v[b] - p.v[a], C_ab)
        return total / p.volume[a]

    def _forces(self, a: int) -> tuple[np.ndarray, np.ndarray]:
        """The force -T_a [N] of (73) and D_a (74)."""
        p, T, D = self.points, np.zeros(3), np.zeros(3)
        for b, g in self.pairs[a]:
            L_b = self._of_image(b, self.L, "R", "R")
            C_ab, C_ba = 2.0 * self.L[a] @ g, -2.0 * L_b @ g
            # s Q P L Q as one: the image of P C_ba
            stress_b = p.sign[b] * p.Q[b] @ self.PL[p.origin[b]] @ p.Q[b] @ (-2.0 * g)
            T -= 0.5 * (stress_b - self.P[a] @ C_ab)
            D += self._dissipation(a, b, g, 0.5 * (C_ab - C_ba))
        return T, D

    def _dissipation(self, a: int, b: int, g: np.ndarray, skew: np.ndarray) -> np.ndarray:
        """D_ab of (74), (75)."""
        p = self.points
        jump = p.v[b] - p.v[a]
        if self.options.reconstruct:
            gradient_b = self._of_image(b, self.gradient, "Q", "R")
            jump = jump - 0.5 * (self.gradient[a] + gradient_b) @ (p.X[b] - p.X[a])
        along = g if self.options.direction == "weight" else skew
        N = along / np.linalg.norm(along)
        n = (p.x[b] - p.x[a]) / np.linalg.norm(p.x[b] - p.x[a])
        i, mirrored = p.origin[b], p.R[b] @ N
        z_p, z_s = map(self._average, self._impedances(a, N), self._impedances(i, mirrored))
        normal = np.outer(n, n)
        S = 0.5 * np.linalg.norm(skew) * (z_p * normal + z_s * (np.eye(3) - normal))
        return self.options.dissipation * S @ jump

    def _impedances(self, a: int, N: np.ndarray) -> tuple[float, float]:
        F, H, J, A = self.strain["F"][a], self.strain["H"][a], self.strain["J"][a], self.strain["A"][:, a]
        solid = self.solids[a]
        return solid.density * solid.pressure_speed(F, H, J, A, N), solid.density * solid.shear_speed(F, A, N)

    def _average(self, z_a: float, z_b: float) -> float:
        return np.sqrt(0.5 * (z_a**2 + z_b**2)) if self.options.average == "rms" else 0.5 * (z_a + z_b)


def _padded(vectors: np.ndarray) -> np.ndarray:
    result = np.zeros((len(vectors), 3))
    result[:, : vectors.shape[1]] = vectors
    return result


def reference_of(sim, strain: dict, planes, options: Options) -> Reference:
    """The reference for a simulation's particles on this rank alone: reads positions, volumes, v, x.

    Planes as in with_images.
    """
    particle_set, table, d = sim.particle_sets[0], sim.systems[0].particles, sim.systems[0].dimension
    on = np.zeros(len(particle_set.position), int)
    for axis, coordinate, _ in planes:
        on += np.abs(particle_set.position[:, axis] - coordinate) < 1e-9
    frame = np.tile(np.eye(3), (len(on), 1, 1))
    if particle_set.axes is not None:
        frame[:, :d, :d] = particle_set.axes
    h = sim.scene.method.smoothing * particle_set.spacing
    inverse_square = np.ones((len(on), 3))
    inverse_square[:, :d] = h**-2.0
    metric = np.einsum("nki,nk,nkj->nij", frame, inverse_square, frame)
    n, unit = len(on), np.tile(np.eye(3), (len(on), 1, 1))
    points = Points(
        _padded(particle_set.position),
        _padded(np.array(table.owned_rows("position"))),
        _padded(np.array(table.owned_rows("velocity"))),
        particle_set.volume * 2.0**on,
        metric,
        np.arange(n),
        unit,
        unit.copy(),
        np.ones(n),
    )
    laws = [None] * n
    for block in sim.systems[0].blocks:
        laws[block.first : block.last] = [Solid.of(block.law)] * (block.last - block.first)
    return Reference(d, with_images(points, planes), n, strain, laws, options)
