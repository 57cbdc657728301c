"""How particles resist what presses on them: the modulus of their law, their faces, and the stiffness that follows."""

from typing import Any

import numpy as np

from parsolid.materials.damage.bond_based import BondBased
from parsolid.materials.hyperelastic.law import elastic_moduli, total_modulus
from parsolid.materials.plastic import plastic_evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.micro_inertia import MicroInertia
from parsolid.materials.viscoelastic.prony import Prony

# pressure waves of a bond-based solid, whose Poisson's ratio is 1/4, over Young's modulus
_BOND_BASED = 1.2


def wave_modulus(law: Any) -> float:
    """M = rho c^2 [Pa] of pressure waves in the undeformed solid, before anything has relaxed."""
    if isinstance(law, ElasticPlastic):
        shear = plastic_evaluation.shear_modulus(law, 1.0, 0.0, law.reference_temperature)
        return float(plastic_evaluation.isentropic_bulk_modulus(law, 1.0, 0.0) + 4.0 / 3.0 * shear)
    if isinstance(law, MicroInertia):
        return law.bulk_modulus + 4.0 / 3.0 * law.shear_modulus
    if isinstance(law, BondBased):
        return _BOND_BASED * law.youngs_modulus
    if isinstance(law, Prony):
        glassy = 1.0 + sum(law.ratios or ())
        if law.bulk_modulus is not None:
            return law.bulk_modulus + 4.0 / 3.0 * law.shear_modulus * glassy
        assert law.first_lame is not None
        return (law.first_lame + 2.0 * law.shear_modulus) * glassy
    shear, lame = elastic_moduli(law)
    return float(lame + 2.0 * (shear + total_modulus(law.branch_moduli)))


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
