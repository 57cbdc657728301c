"""The pair engine: gradient and divergence over a pair list, with Riemann dissipation, for every pair method.

With an antisymmetric weight g_ab and one matrix L_a a particle, the two passes are
    gradient    (grad v)_a = [sum_b (v_b - v_a) (x) g_ab] L_a^T / V_a
    divergence  T_a        =  sum_b (P_a L_a + P_b L_b) g_ab              [N]
and the dissipation of the upwinding is, eqs (74), (75) with linear reconstruction,
    D_a = sum_b k_ab [c_s u + (c_p - c_s) (u.n) n],  u = v_b - v_a - 1/2 (grad v_a + grad v_b)(X_b - X_a),  n = x_ab/|x_ab|.

Arrays (rows are particles, owned first; d = dimension):
    kinematics  d=3: (n, 12) v|0 x|0 X|0;  d=2: (n, 8) v x X 0 0
    record      what a particle tells its neighbours in the second pass:
                columns of P L, columns of 1/2 grad v, then halves of rho^2 times the wave tensors Q_p and, where shear
                waves depend on direction, Q_s, each as a diagonal and an off-diagonal part; the last lane of
                the diagonal of Q_p holds 1/2 rho c_s where they do not
    gradient    d=3: (n, 12) columns of sum (v_b - v_a) (x) g, each padded to 4;  d=2: (n, 4) columns
    force       (n, 8) T padded to 4, D padded to 4
Pair weights (m, 4) are rows: d=3: (g1, g2, g3, k); d=2: (g1, g2, k, 0), where k is 1/2 |C_skew| / |g| times the factor on
the dissipation, and C_skew = (L_a + L_b) g.

Radial lists (peridynamics) hold one number a pair, weight (m,) = w(|xi|) V_a V_b, and g_ab = weight xi with xi = X_b - X_a is
formed as it is needed: 12 bytes a pair; 0 is a broken bond. Their kinematics are f u X, f the field that drives stress and
stabiliser, their records (S = P K^{-1}) columns of M, then the second matrix, then for `AlongBonds` c in every lane. The
stabiliser adds to T_a
    ShearScaled   sum_b weight (C1_a + C1_b) (f_b - f_a),     M = S - C1 G,  second matrix C1
    AlongBonds    sum_b weight xi/(2 |xi|^3) xi . [(c_a + c_b)(f_b - f_a) - (c_a G_a + c_b G_b) xi],     M = S,  second matrix c G
An inner list holds each pair of owned particles once and adds to both; a one-sided list (the neighbour is a ghost or a
mirror image) adds to the owned particle alone.
"""

from typing import NamedTuple

import numpy as np

from parsolid.pairs.lists import Images, image_table
from parsolid.pairs.terms import AlongBonds, ShearScaled

__all__ = ["AlongBonds", "Images", "ShearScaled", "image_table"]

KINEMATICS_WIDTH = {2: 8, 3: 12}
GRADIENT_WIDTH = {2: 4, 3: 12}
FORCE_WIDTH = 8


class PairList(NamedTuple):
    """Pairs of particle a in rows start[a] : start[a+1] (int64); neighbour (m,) int32, weight (m, 4), or (m,) where radial."""

    start: np.ndarray
    neighbour: np.ndarray
    weight: np.ndarray


def bond_record_width(dimension: int, stabiliser) -> int:
    """Columns of the record of radial lists, in whole cache lines."""
    matrix = {2: 4, 3: 12}[dimension]
    if stabiliser is None:
        return matrix
    return 2 * matrix + (4 if isinstance(stabiliser, AlongBonds) else 0)
