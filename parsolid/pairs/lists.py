"""Pair lists as the passes read them, and the reflections that make a neighbour's mirror image."""

from typing import NamedTuple

import numpy as np

from parsolid.numerics.dispatch import constant, generic


class Images(NamedTuple):
    """Which reflection makes each pair's neighbour: code (m,) int8 into the rows of table (codes, 16).

    With signs Q of a mirrored vector, signs R of the reflected place, the shift T of the planes and a sign s of the
    stress, v' = Q v,  X' = R X + T,  x' = X' + Q (x - X),  (P L)' = s Q P L Q,  (grad v)' = Q grad v R; scalars stay.
    In radial lists M' = Q M R and C1' = Q C1 Q, for which the passes are adjoint at every kind of plane.
    """

    code: np.ndarray
    table: np.ndarray


class PlaneImage(NamedTuple):
    """Columns of `Images.table` in the plane: Q twice; R and T; of a matrix s Q_i Q_j, and Q_i R_j."""

    signs: int
    reflection: int
    stress: int
    gradient: int


class SpaceImage(NamedTuple):
    """Columns of `Images.table` in space: Q, R, T, R_i R_j of the off-diagonal part of a symmetric tensor, s."""

    signs: int
    reflection: int
    shift: int
    off_diagonal: int
    stress_sign: int


PLANE_IMAGE, SPACE_IMAGE = PlaneImage(0, 4, 8, 12), SpaceImage(0, 4, 8, 12, 15)


class InnerList(NamedTuple):
    """Each pair of owned particles once, both receive. Pairs of particle a stand in rows start[a] : start[a+1] (int64).

    neighbour (m,) int32; weight (m, 4), or (m,) where radial.
    """

    start: np.ndarray
    neighbour: np.ndarray
    weight: np.ndarray


class OneSidedList(NamedTuple):
    """Pairs of owned particles with ghosts (images None) or with mirror images: the owned particle alone receives."""

    start: np.ndarray
    neighbour: np.ndarray
    weight: np.ndarray
    images: Images | None


class InnerTable(NamedTuple):
    """Each pair of owned particles once, both receive; start, neighbour as in `InnerList`.

    kind (m,) uint16: rows of table (kinds, 8), in which g_ab and k_ab stand as in a list, and then X_a - X_b.
    """

    start: np.ndarray
    neighbour: np.ndarray
    kind: np.ndarray
    table: np.ndarray


class OneSidedTable(NamedTuple):
    """Pairs of owned particles with ghosts: the owned particle alone receives."""

    start: np.ndarray
    neighbour: np.ndarray
    kind: np.ndarray
    table: np.ndarray


class Places(NamedTuple):
    """Where each pair's neighbour stands, R X_b + T, for set-up: code (m,) int8 into reflections R, shifts T (codes,
    3)."""

    code: np.ndarray
    reflections: np.ndarray
    shifts: np.ndarray


@constant
def mutual(pairs) -> bool:
    """Whether both particles of a pair receive; a constant in kernels."""
    return isinstance(pairs, InnerList | InnerTable)


@generic
def images_of(pairs):
    """The images of a list, None where it has none."""


@images_of.of(InnerList, InnerTable, OneSidedTable)
def _no_images(pairs):
    return None


@images_of.otherwise
def _images(pairs):
    return pairs.images


def empty_list(like) -> OneSidedList:
    """A list of ghosts without pairs; like: a list of the same kind of weights."""
    return OneSidedList(np.zeros(1, np.int64), like.neighbour[:0], like.weight[:0], None)


def image_table(dimension: int, signs, reflections, shifts, stress_signs) -> np.ndarray:
    """Rows of `Images.table` from Q, R (+-1) and T [m], each (codes, dimension), and s (codes,)."""
    table = np.zeros((len(signs), 16))
    if dimension == 3:
        at = SPACE_IMAGE
        for first, values in ((at.signs, signs), (at.reflection, reflections), (at.shift, shifts)):
            table[:, first : first + 3] = values
        for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)), at.off_diagonal):
            table[:, column] = reflections[:, i] * reflections[:, j]
        table[:, at.stress_sign] = stress_signs
    else:
        of = PLANE_IMAGE
        table[:, of.signs : of.signs + 4] = np.tile(signs, 2)
        table[:, of.reflection : of.reflection + 4] = np.concatenate((reflections, shifts), axis=1)
        # columns of a matrix: s Q_i Q_j for P L and Q_i R_j for grad v
        stress = stress_signs[:, None] * np.tile(signs, 2) * np.repeat(signs, 2, axis=1)
        table[:, of.stress : of.stress + 4] = stress
        table[:, of.gradient : of.gradient + 4] = np.tile(signs, 2) * np.repeat(reflections, 2, axis=1)
    return table
