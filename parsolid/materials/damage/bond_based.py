"""Elastic bond-based law (prototype microelastic brittle): its micromodulus for every state of strain and influence
function.

A bond of stretch s pulls with c w(|xi|/delta) s per two volumes, and stores c w s^2 |xi|/2 (Silling & Askari, Comput.
Struct. 83, 2005, eqs (8)-(10)). c is such that a uniform stretch stores the classical energy; with w = 1 it is 18 k/(pi
delta^4) in space, 9 E/(pi h delta^3) in plane stress, 48 E/(5 pi h delta^3) in plane strain and 2 E/(A delta^2) in a
bar. Per metre of thickness and square metre of section.
"""

import math
from typing import Annotated, NamedTuple

from parsolid.materials.declaration import Density, Parameter, law

POISSONS_RATIO = {"bar": 0.0, "plane-stress": 1.0 / 3.0, "plane-strain": 0.25, "space": 0.25}


@law("bond-based", "bond-based")
class BondBased(NamedTuple):
    """Elastic bond-based solid (Silling); Poisson's ratio is 1/3 in plane stress, 1/4 in plane strain and in space."""

    density: Density
    youngs_modulus: Annotated[float, Parameter("Pa", "Young's modulus", above=0.0)]

    @property
    def branch_moduli(self) -> None:
        """None: there are no branches."""

    @property
    def relaxation_times(self) -> None:
        """None: there are no branches."""


def micromodulus(youngs_modulus: float, state: str, influence: str, horizon):
    """c from Young's modulus [Pa] for a horizon [m], or an array of them; N/m^6 in space, N/m^5 in the plane, N/m^4 in
    a bar.

    Energy 1/4 c s^2 (integral of w |xi| over the family) of a uniform stretch s.
    """
    E, nu, power = youngs_modulus, POISSONS_RATIO[state], {"bar": 1, "space": 3}.get(state, 2)
    # energy of a uniform stretch over E s^2
    energy = {
        "bar": 0.5,
        "plane-stress": 1.0 / (1.0 - nu),
        "plane-strain": 1.0 / ((1.0 + nu) * (1.0 - 2.0 * nu)),
        "space": 1.5 / (1.0 - 2.0 * nu),
    }[state]
    sphere = {1: 2.0, 2: 2.0 * math.pi, 3: 4.0 * math.pi}[power]
    return 4.0 * energy * E / (sphere * influence_moment(influence, power) * horizon ** (power + 1))


def influence_moment(influence: str, power: int) -> float:
    """Integral of w(q) q^power over q = |xi|/delta from 0 to 1; influence is "constant", "linear" or "cubic-spline"."""
    n = power + 1
    if influence == "constant":
        return 1.0 / n
    if influence == "linear":
        return 1.0 / n - 1.0 / (n + 1)
    # 1 - 6 q^2 + 6 q^3 up to a half, then 2 (1 - q)^3
    inner = 0.5**n * (1.0 / n - 6.0 * 0.25 / (n + 2) + 6.0 * 0.125 / (n + 3))
    outer = sum(math.comb(3, i) * (-1) ** i * (1.0 - 0.5 ** (n + i)) / (n + i) for i in range(4))
    return inner + 2.0 * outer
