"""Sums over bonds of correspondence peridynamics, in space and in the plane.

With the weight w_ab = w(|xi|) V_a V_b of a bond xi = X_b - X_a, the two sweeps are

    gradient      sum_b w_ab (f_b - f_a) (x) xi                                  = V_a G_a K_a of a field f
    divergence    sum_b w_ab [(M_a + M_b) xi + (C_a + C_b) (f_b - f_a)]          force [N]

The divergence with M = P K^-1 - C G is the adjoint of the gradient, so that it is the derivative of an energy. A bond
is stored at one of its ends, and both receive; a ghost and a mirror image receive nothing. The image of a particle
stands at R X + T and has the field Q f and the matrices Q M R and Q C Q, with which the sweeps are adjoint at every
kind of plane.

Every particle has one row of each array. In space, vectors and columns of matrices are padded to four numbers, so that
LLVM makes one vector instruction of each:

    motion (n, 8)   X 0 f 0          sums, M, C (n, 12)   the three columns of a matrix          force (owned, 4)

In the plane they are motion (n, 4) = X f, a matrix (n, 4) column by column, and force (owned, 4) in two halves.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.pairs.lattice_convolution import LatticeConvolution, aligned_zeros
from parsolid.pairs.rows_of_four import add, add_scaled, load_row, multiply, scale, store_row, subtract
from parsolid.tensors import general, matmul

# numbers in the row of a matrix
MATRIX_ROW = {2: 4, 3: 12}
# share of broken bonds up to which sums over a lattice are corrected
_MOST_BROKEN = 0.3


class BondList(NamedTuple):
    """Bonds of particle a in rows start[a] : start[a + 1], (n + 1,) int64.

    neighbour (m,) uint32, of which no sign need be tested; weight (m,): w(|xi|) V_a V_b [m^6, in the plane m^4], 0 of a
    broken bond.
    """

    start: np.ndarray
    neighbour: np.ndarray
    weight: np.ndarray


class Images(NamedTuple):
    """Mirror images of the neighbours: code (m,) int8 of each bond, a row of signs Q, reflections R (+-1) and shifts T
    [m], each (codes, 4)."""

    code: np.ndarray
    signs: np.ndarray
    reflections: np.ndarray
    shifts: np.ndarray


# a list, its images or None, and mutual: True where neighbours receive, too, else None, for which kernels compile no
# test
Listed = tuple[BondList, Images | None, bool | None]
Lists = list[Listed]


def part_of(listed: Listed, rows: np.ndarray) -> Listed:
    """What a list has of some bonds, given in its order as rows (particle, bond)."""
    bonds, images, mutual = listed
    ends = np.cumsum(np.bincount(rows[:, 0], minlength=len(bonds.start) - 1))
    if images is not None:
        images = images._replace(code=images.code[rows[:, 1]])
    start = np.concatenate(([0], ends))
    return BondList(start, bonds.neighbour[rows[:, 1]], bonds.weight[rows[:, 1]]), images, mutual


@inlined
def add_to_row(A, i, k, u):
    """Add to numbers k .. k + 3 of row i."""
    store_row(A, i, k, add(load_row(A, i, k), u))


# what a particle itself is beside its images
ONE, ZERO = (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 0.0)


@inlined
def image_of(images, k):
    """Signs Q, reflections R and shifts T as which bond k sees its neighbour; images: None where there are none."""
    if images is None:
        return ONE, ONE, ZERO
    c = images.code[k]
    return load_row(images.signs, c, 0), load_row(images.reflections, c, 0), load_row(images.shifts, c, 0)


@inlined
def bond_vectors(plane, motion, images, k, a, b):
    """xi and f_b - f_a of bond k, of which b is seen as an image if there are any, in the plane with a third component
    0.

    Seen from its other end a bond without an image has the negatives, to the bit, so that two ranks decide alike about
    one across their border. That does not hold with an image: whoever decides looks at both (a, b') and (b, a').
    """
    x, y, z = motion[b, 0], motion[b, 1], 0.0 if plane is not None else motion[b, 2]
    f = 2 if plane is not None else 4
    u, v, w = motion[b, f], motion[b, f + 1], 0.0 if plane is not None else motion[b, f + 2]
    if images is not None:
        Q, R, T = image_of(images, k)
        x, y, z = R[0] * x + T[0], R[1] * y + T[1], R[2] * z + T[2]
        u, v, w = Q[0] * u, Q[1] * v, Q[2] * w
    x, y, u, v = x - motion[a, 0], y - motion[a, 1], u - motion[a, f], v - motion[a, f + 1]
    if plane is not None:
        return (x, y, 0.0), (u, v, 0.0)
    return (x, y, z - motion[a, 2]), (u, v, w - motion[a, f + 2])


@kernel
def add_gradients_in_space(bonds, images, mutual, motion, sums):
    """Add sum_b w_ab (f_b - f_a) (x) xi to sums; mutual: see `BondSweeps.lists`."""
    start, neighbour, weight = bonds.start, bonds.neighbour, bonds.weight
    for a in range(start.size - 1):
        if start[a] == start[a + 1]:
            continue
        X, f = load_row(motion, a, 0), load_row(motion, a, 4)
        s0, s1, s2 = load_row(sums, a, 0), load_row(sums, a, 4), load_row(sums, a, 8)
        for k in range(start[a], start[a + 1]):
            b = neighbour[k]
            X_b, f_b = load_row(motion, b, 0), load_row(motion, b, 4)
            if images is not None:
                Q, R, T = image_of(images, k)
                X_b, f_b = add(multiply(R, X_b), T), multiply(Q, f_b)
            xi, jump = subtract(X_b, X), scale(weight[k], subtract(f_b, f))
            d0, d1, d2 = scale(xi[0], jump), scale(xi[1], jump), scale(xi[2], jump)
            s0, s1, s2 = add(s0, d0), add(s1, d1), add(s2, d2)
            if mutual is not None:
                add_to_row(sums, b, 0, d0)
                add_to_row(sums, b, 4, d1)
                add_to_row(sums, b, 8, d2)
        store_row(sums, a, 0, s0)
        store_row(sums, a, 4, s1)
        store_row(sums, a, 8, s2)


@kernel
def add_gradients_in_plane(bonds, images, mutual, motion, sums):
    """As `add_gradients_in_space`."""
    for a in range(bonds.start.shape[0] - 1):
        if bonds.start[a] == bonds.start[a + 1]:
            continue
        own, s = load_row(motion, a, 0), load_row(sums, a, 0)
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            other = load_row(motion, b, 0)
            if images is not None:
                Q, R, T = image_of(images, k)
                other = (R[0] * other[0] + T[0], R[1] * other[1] + T[1], Q[0] * other[2], Q[1] * other[3])
            step = subtract(other, own)
            g0, g1 = bonds.weight[k] * step[0], bonds.weight[k] * step[1]
            d = multiply((step[2], step[3], step[2], step[3]), (g0, g0, g1, g1))
            s = add(s, d)
            if mutual is not None:
                add_to_row(sums, b, 0, d)
        store_row(sums, a, 0, s)


@kernel
def add_forces_in_space(bonds, images, mutual, motion, M, C, force):
    """Add the forces of the bonds [N]; C None: without control; mutual: see `BondSweeps.lists`."""
    start, neighbour, weight = bonds.start, bonds.neighbour, bonds.weight
    for a in range(start.size - 1):
        if start[a] == start[a + 1]:
            continue
        X, f, total = load_row(motion, a, 0), load_row(motion, a, 4), load_row(force, a, 0)
        M0, M1, M2 = load_row(M, a, 0), load_row(M, a, 4), load_row(M, a, 8)
        if C is not None:
            C0, C1, C2 = load_row(C, a, 0), load_row(C, a, 4), load_row(C, a, 8)
        for k in range(start[a], start[a + 1]):
            b = neighbour[k]
            X_b, m0, m1, m2 = load_row(motion, b, 0), load_row(M, b, 0), load_row(M, b, 4), load_row(M, b, 8)
            if images is not None:
                Q, R, T = image_of(images, k)
                X_b = add(multiply(R, X_b), T)
                m0, m1, m2 = scale(R[0], multiply(Q, m0)), scale(R[1], multiply(Q, m1)), scale(R[2], multiply(Q, m2))
            xi = subtract(X_b, X)
            t = add_scaled(scale(xi[0], add(M0, m0)), xi[1], add(M1, m1))
            t = add_scaled(t, xi[2], add(M2, m2))
            if C is not None:
                f_b, c0, c1, c2 = load_row(motion, b, 4), load_row(C, b, 0), load_row(C, b, 4), load_row(C, b, 8)
                if images is not None:
                    f_b, c0 = multiply(Q, f_b), scale(Q[0], multiply(Q, c0))
                    c1, c2 = scale(Q[1], multiply(Q, c1)), scale(Q[2], multiply(Q, c2))
                jump = subtract(f_b, f)
                t = add_scaled(t, jump[0], add(C0, c0))
                t = add_scaled(add_scaled(t, jump[1], add(C1, c1)), jump[2], add(C2, c2))
            t = scale(weight[k], t)
            total = add(total, t)
            if mutual is not None:
                store_row(force, b, 0, subtract(load_row(force, b, 0), t))
        store_row(force, a, 0, total)


@kernel
def add_forces_in_plane(bonds, images, mutual, motion, M, C, force):
    """As `add_forces_in_space`; forces are (f0 + f2, f1 + f3) of their rows, see `fold_rows`."""
    for a in range(bonds.start.shape[0] - 1):
        if bonds.start[a] == bonds.start[a + 1]:
            continue
        own, M_a, total = load_row(motion, a, 0), load_row(M, a, 0), load_row(force, a, 0)
        if C is not None:
            C_a = load_row(C, a, 0)
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            other, M_b = load_row(motion, b, 0), load_row(M, b, 0)
            if images is not None:
                Q, R, T = image_of(images, k)
                other = (R[0] * other[0] + T[0], R[1] * other[1] + T[1], Q[0] * other[2], Q[1] * other[3])
                M_b = multiply((Q[0] * R[0], Q[1] * R[0], Q[0] * R[1], Q[1] * R[1]), M_b)
            s, m = scale(bonds.weight[k], subtract(other, own)), add(M_a, M_b)
            t = (m[0] * s[0], m[1] * s[0], m[2] * s[1], m[3] * s[1])
            if C is not None:
                C_b = load_row(C, b, 0)
                if images is not None:
                    C_b = multiply((1.0, Q[0] * Q[1], Q[0] * Q[1], 1.0), C_b)
                m = add(C_a, C_b)
                t = (t[0] + m[0] * s[2], t[1] + m[1] * s[2], t[2] + m[2] * s[3], t[3] + m[3] * s[3])
            total = add(total, t)
            if mutual is not None:
                store_row(force, b, 0, subtract(load_row(force, b, 0), t))
        store_row(force, a, 0, total)


@kernel
def fold_rows(force):
    """Forces (f0 + f2, f1 + f3, 0, 0) from rows of the plane."""
    for a in range(force.shape[0]):
        store_row(force, a, 0, (force[a, 0] + force[a, 2], force[a, 1] + force[a, 3], 0.0, 0.0))


@kernel
def fill_columns(first, last, vectors, column, rows):
    """Copy vectors (d, n) of some particles into rows from a column on."""
    for i in range(vectors.shape[0]):
        for a in range(first, last):
            rows[a, column + i] = vectors[i, a]


@kernel
def copy_to_columns(rows, vectors):
    """Copy rows (n, 4) into vectors (d, n or more)."""
    for i in range(vectors.shape[0]):
        for a in range(rows.shape[0]):
            vectors[i, a] = rows[a, i]


class BondSweeps:
    """The two sweeps over a rank's bonds with the messages that they need; `bonds.Bonds` makes the lists.

    inner: bonds of owned particles, each once; rim: those with ghosts; mirror: those with the images of particles and
    ghosts; positions (n, d) [m]; lattice: a convolution that has the sums of all bonds, whole or broken, without the
    lists, or None; missing: the broken ones with minus their whole weights, which its sums are corrected by; motion:
    rows of X and of a field, by its name; sums (owned, 12 or 4): of the last gradient.
    """

    particles: Any
    owned: int
    d: int
    positions: np.ndarray
    volume: np.ndarray
    inner: BondList
    rim: BondList | None = None
    mirror: BondList | None = None
    images: Images | None = None
    lattice: LatticeConvolution | None = None

    def begin_sweeps(self) -> None:
        """Choose the kernels, and make room for sums."""
        space = self.d == 3
        self._add_gradients = add_gradients_in_space if space else add_gradients_in_plane
        self._add_forces = add_forces_in_space if space else add_forces_in_plane
        self.motion: dict[str, np.ndarray] = {}
        self.missing: Lists = []
        self.sums = aligned_zeros(self.owned, MATRIX_ROW[self.d])

    @property
    def lists(self) -> Lists:
        every: list[Any] = [(self.inner, None, True), (self.rim, None, None), (self.mirror, self.images, None)]
        return [one for one in every if one[0] is not None]

    def motion_of(self, name: str) -> np.ndarray:
        """Rows of X and of a vector field of the particles, see `sweeps`; filled by `fill`."""
        if name not in self.motion:
            rows = self.motion[name] = aligned_zeros(len(self.positions), 4 * (self.d - 1))
            rows[:, : self.d] = self.positions
        return self.motion[name]

    def fill(self, name: str, first: int, last: int) -> None:
        """Bring the field in the rows of some particles up to date."""
        fill_columns(first, last, self.particles.storage(name), 2 * (self.d - 1), self.motion_of(name))

    def gradients(self, name: str, message: str | None = None, lists: Lists | None = None) -> np.ndarray:
        """Sums (owned, 12 or 4) of the gradient of a field; message: with which ghosts get it first, or None; lists:
        some of the bonds, or None: all."""
        owned, local, motion = self.owned, len(self.positions), self.motion_of(name)
        lattice, lists = None if lists else self.lattice, lists or self.lists
        self.fill(name, 0, owned)
        self.sums[:] = 0.0
        if message is not None:
            self.particles.send(message)
        if lattice is None:
            self._add_gradients(*lists[0], motion, self.sums)
        if message is not None:
            self.particles.receive(message)
        self.fill(name, owned, local)
        if lattice is not None:
            lattice.gradients(motion, self.sums)
        for bonds, images, mutual in lists[1:] if lattice is None else self.missing:
            self._add_gradients(bonds, images, mutual, motion, self.sums)
        return self.sums

    def divergence(
        self, name: str, control: np.ndarray | None, force: np.ndarray, lists: Lists | None = None
    ) -> np.ndarray:
        """Fill force (owned, 4) [N] with that of the rows of `bond_stress`, which ghosts get first, and of a control on
        a field, of which gradients were taken; control (n, 12 or 4): rows of C, ghosts behind, or None; lists: as
        before."""
        motion, M = self.motion_of(name), self.particles.storage("bond_stress")
        lattice, lists = None if lists else self.lattice, lists or self.lists
        force[:] = 0.0
        self.particles.send("record")
        if lattice is None:
            self._add_forces(*lists[0], motion, M, control, force)
        self.particles.receive("record")
        if lattice is not None:
            lattice.forces(motion, M, control, force)
        for bonds, images, mutual in lists[1:] if lattice is None else self.missing:
            self._add_forces(bonds, images, mutual, motion, M, control, force)
        if self.d == 2:
            fold_rows(force)
        return force

    def leave_out_broken(self) -> None:
        """Let sums over the lattice do without the bonds that are broken; where they are many, lists are as fast."""
        if self.lattice is None:
            return
        broken = [np.flatnonzero(bonds.weight == 0.0) for bonds, _, _ in self.lists]
        if sum(map(len, broken)) > _MOST_BROKEN * sum(len(bonds.weight) for bonds, _, _ in self.lists):
            self.lattice, self.missing = None, []
            return
        self.missing = []
        for one, at in zip(self.lists, broken):
            row = np.searchsorted(one[0].start, at, "right") - 1
            part, images, mutual = part_of(one, np.column_stack((row, at)))
            weight = -self.volume[row] * self.volume[part.neighbour]
            self.missing.append((part._replace(weight=weight), images, mutual))


# --- a particle's tensors, from rows of the sweeps and to them -----------------------------------------------------


@inlined
def gradient_at(plane, sums, inverse, volume, a):
    """G = (sums K^-1) / V of a particle, nine numbers."""
    r = 1.0 / volume[a]
    K0, K1, K3 = r * inverse[0, a], r * inverse[1, a], r * inverse[3, a]
    if plane is not None:
        s0, s1, s2, s3 = sums[a, 0], sums[a, 1], sums[a, 2], sums[a, 3]
        return (s0 * K0 + s2 * K3, s0 * K3 + s2 * K1, 0.0, s1 * K0 + s3 * K3, s1 * K3 + s3 * K1, 0.0, 0.0, 0.0, 0.0)
    K = (K0, K1, r * inverse[2, a], K3, r * inverse[4, a], r * inverse[5, a])
    s = (sums[a, 0], sums[a, 4], sums[a, 8], sums[a, 1], sums[a, 5], sums[a, 9], sums[a, 2], sums[a, 6], sums[a, 10])
    return matmul(s, general(K))


@inlined
def matmul_in(plane, A, B):
    """A B; in the plane, of tensors without components out of it."""
    if plane is not None:
        return (A[0] * B[0] + A[1] * B[3], A[0] * B[1] + A[1] * B[4], 0.0,
                A[3] * B[0] + A[4] * B[3], A[3] * B[1] + A[4] * B[4], 0.0, 0.0, 0.0, 0.0)  # fmt: skip
    return matmul(A, B)


@inlined
def inverse_at(inverse, a):
    """K^-1 of a particle, nine numbers."""
    return general((inverse[0, a], inverse[1, a], inverse[2, a], inverse[3, a], inverse[4, a], inverse[5, a]))


@inlined
def store_rows(plane, M, a, S):
    """Store a tensor as a row of the sweeps, column by column."""
    if plane is not None:
        M[a, 0], M[a, 1], M[a, 2], M[a, 3] = S[0], S[3], S[1], S[4]
    else:
        M[a, 0], M[a, 1], M[a, 2], M[a, 3] = S[0], S[3], S[6], 0.0
        M[a, 4], M[a, 5], M[a, 6], M[a, 7] = S[1], S[4], S[7], 0.0
        M[a, 8], M[a, 9], M[a, 10], M[a, 11] = S[2], S[5], S[8], 0.0


@inlined
def control_at(plane, C, a):
    """A symmetric C of a particle from its row, nine numbers."""
    if plane is not None:
        return (C[a, 0], C[a, 2], 0.0, C[a, 1], C[a, 3], 0.0, 0.0, 0.0, 0.0)
    return (C[a, 0], C[a, 4], C[a, 8], C[a, 1], C[a, 5], C[a, 9], C[a, 2], C[a, 6], C[a, 10])
