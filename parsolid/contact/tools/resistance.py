"""How particles resist what presses on them: their faces, and the stiffness that follows."""

from typing import Any

import numpy as np


def radii(particles: Any, in_cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radius (owned,) [m], from a particle to the face of its cell, 0 of nodes, and spacing (owned,) [m] that way.

    in_cells (bodies,): whether a body's particles are in the middles of cells. The way is that of the particle's own
    surface where it has one; inside a body the mean of all ways.
    """
    spacing, area = particles.owned_rows("spacing"), particles.owned_rows("area")
    count, d = spacing.shape
    along = area
    if "axes" in particles:
        along = np.einsum("nij,nj->ni", particles.owned_rows("axes").reshape(count, d, d), area)
    size = np.linalg.norm(along, axis=1)
    width = np.prod(spacing, axis=1) ** (1.0 / d)
    here = size > 0.0
    width[here] = np.linalg.norm(spacing[here] * along[here], axis=1) / size[here]
    return np.where(in_cells[particles.owned_rows("body")], 0.5 * width, 0.0), width


def stiffnesses(particles: Any, radius: np.ndarray, width: np.ndarray, moduli: np.ndarray, polar: bool) -> np.ndarray:
    """M A/h (owned,) [N/m]; A = V/h, of nodes on a face the part of the face that is theirs.

    moduli (bodies,) [Pa]; polar: per radian about the axis X = 0.
    """
    face = np.abs(particles.owned_rows("area")).max(axis=1)
    area = np.where((radius > 0.0) | (face == 0.0), particles.owned_rows("volume") / width, face)
    if polar:
        area = area * particles.owned_rows("reference_position")[:, 0]
    return np.asarray(moduli[particles.owned_rows("body")] * area / width)
