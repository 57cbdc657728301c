"""Criteria at which bonds break, from the fracture energy G_c [J/m^2].

G_c is the energy of all bonds across a unit area of a plane (Silling & Askari, Comput. Struct. 83, 2005, eqs (22)-(26);
Foster, Silling & Chen, Int. J. Multiscale Comput. Eng. 9, 2011, eq (11)). Per metre of thickness and square metre of
section; horizons [m] are numbers or arrays.
"""

import math

import numpy as np

from parsolid.materials.damage.bond_based import influence_moment, micromodulus


def critical_stretch(fracture_energy: float, youngs_modulus: float, state: str, influence: str, horizon):
    """Stretch at which the bonds of a bond-based solid of Young's modulus [Pa] have stored G_c.

    With w = 1: sqrt(5 G_c/(9 k delta)) in space, sqrt(4 pi G_c/(9 E delta)) in plane stress, sqrt(5 pi G_c/(12 E
    delta)) in plane strain, sqrt(3 G_c/(E delta)) in a bar.
    """
    power = {"bar": 2, "space": 4}.get(state, 3)
    across = {"bar": 0.5, "space": 0.5 * math.pi}.get(state, 1.0)
    c = micromodulus(youngs_modulus, state, influence, horizon)
    return np.sqrt(fracture_energy / (across * c * influence_moment(influence, power) * horizon ** (power + 1)))


def critical_bond_energy(fracture_energy: float, state: str, horizon):
    """Energy of a bond per two volumes: 4 G_c/(pi delta^4) in space, 3 G_c/(2 delta^3) in the plane, 2 G_c/delta^2 in a
    bar.
    """
    factor, power = {"bar": (2.0, 2), "space": (4.0 / math.pi, 4)}.get(state, (1.5, 3))
    return factor * fracture_energy / horizon**power


def breaking_limit(damage, material, state: str, influence: str, horizon):
    """The critical stretch, or the critical energy per two volumes, of a scene's damage settings for one of its
    materials.
    """
    if damage.criterion == "energy":
        return damage.critical_bond_energy or critical_bond_energy(damage.fracture_energy, state, horizon)
    if damage.critical_stretch is not None:
        return damage.critical_stretch
    modulus = damage.modulus
    if not isinstance(modulus, float):
        modulus = getattr(material, modulus).youngs_modulus
    return critical_stretch(damage.fracture_energy, modulus, state, influence, horizon)
