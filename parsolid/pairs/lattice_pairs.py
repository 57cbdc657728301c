"""Which particles are nodes of lattices, with their weights in closed form (`lattice_stencils`)."""

from typing import NamedTuple

import numpy as np


class Lattices(NamedTuple):
    """Of owned particles: number (n,) int64 of the lattice, -1 on none; spacing (n, d) [m]; weight (n, d, 7) and
    undamped (n, d, 2) of their `Stencils`. graded: whether any stand elsewhere than on the even steps by which pairs
    are told."""

    number: np.ndarray
    spacing: np.ndarray
    weight: np.ndarray
    undamped: np.ndarray
    graded: bool = False
