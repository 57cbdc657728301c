"""Bounds of a body by the domains of its particles."""

import numpy as np


def domain_bounds(
    position: np.ndarray, deformation: np.ndarray, spacing: np.ndarray, axes: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds (d,) [m] of particles' deformed domains; plus and minus infinity without particles.

    A domain is the parallelepiped of edges F l_k a_k about x: position x (n, d) [m], deformation gradient F (n, 3, 3),
    spacing l (n, d) [m] along the particle's own axes a (n, d, d), rows; None = Cartesian.
    """
    d = position.shape[1]
    edges = deformation[:, :d, :d]
    if axes is not None:
        edges = edges @ axes.swapaxes(1, 2)
    reach = 0.5 * np.abs(edges * spacing[:, None, :]).sum(axis=2)
    return (position - reach).min(axis=0, initial=np.inf), (position + reach).max(axis=0, initial=-np.inf)
