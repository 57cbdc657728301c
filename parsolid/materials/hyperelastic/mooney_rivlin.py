"""Polyconvex Mooney-Rivlin solid with Maxwell branches (Lee et al., eqs (19), (20), (A.1)).

W = xi (F:F - 3) + zeta (H:H - 3) - 2 (xi + 2 zeta) ln J + lambda_hat/2 (J - 1)^2
    + sum_alpha mu_alpha/2 [F^T F : A_alpha - 3 - ln(J^2 det A_alpha)],   A_alpha = C_v,alpha^{-1}
"""

import math
from typing import NamedTuple

from numba import types
from numba.extending import overload, register_jitable

from parsolid.materials.hyperelastic.law import (
    equilibrium_energy,
    first_piola_kirchhoff_stress,
    isotropic_shear_modulus,
    pressure_wave_tensor,
    shear_wave_tensor,
)
from parsolid.numerics.dispatch import field_types, is_instance, none_without
from parsolid.numerics.tensors import (
    add,
    contract,
    cross,
    expand,
    gram,
    matmul,
    plus_identity,
    scale,
    trace_symmetric,
    zero_like_gram,
)


class MooneyRivlin(NamedTuple):
    """Parameters in SI units; `zeta` is None for the neo-Hookean solid, the branches None without viscosity.

    density [kg/m^3], xi, zeta, lambda_hat [Pa]; branch_moduli [Pa] and relaxation_times [s] are tuples of equal length.
    """

    density: float
    xi: float
    zeta: float | None
    lambda_hat: float
    branch_moduli: tuple | None
    relaxation_times: tuple | None

    @property
    def directional_shear(self) -> bool:
        """Whether the shear wave speed depends on direction."""
        return self.zeta is not None or self.branch_moduli is not None


def of_material(material) -> MooneyRivlin:
    """The law of a scene's material."""
    moduli = material.moduli
    return MooneyRivlin(
        density=float(material.density),
        xi=float(moduli.xi),
        zeta=float(moduli.zeta) or None,
        lambda_hat=float(moduli.lambda_hat),
        branch_moduli=tuple(map(float, material.branch_moduli)) or None,
        relaxation_times=tuple(map(float, material.relaxation_times)) or None,
    )


@register_jitable
def _total(moduli):
    """sum_alpha mu_alpha [Pa]."""
    if moduli is None:
        return 0.0
    result = 0.0
    for modulus in moduli:
        result += modulus
    return result


@register_jitable
def _logarithmic(xi, zeta):
    """2 (xi + 2 zeta) [Pa], the factor of -ln J."""
    if zeta is None:
        return 2.0 * xi
    return 2.0 * (xi + 2.0 * zeta)


@none_without("zeta", "P")
def _add_area_stress(P, zeta, F, H):
    """P + Sigma_H x F with Sigma_H = 2 zeta H."""
    return add(P, cross(scale(2.0 * zeta, H), F))


@none_without("branch_sum", "P")
def _add_branch_stress(P, F, branch_sum):
    """P + F sum_alpha mu_alpha A_alpha."""
    return add(P, matmul(F, expand(branch_sum)))


@none_without("factor", "Q")
def _add_area_tensor(Q, factor, F):
    """Q + factor (tr C I - C), whose normal component is factor (lambda_1^2 + lambda_2^2) of the surface normal to N."""
    C = gram(F)
    return add(Q, plus_identity(scale(-factor, C), factor * trace_symmetric(C)))


@none_without("branch_sum", "Q")
def _add_symmetric(Q, branch_sum):
    return add(Q, branch_sum)


@none_without("zeta", "W")
def _add_area_energy(W, zeta, H):
    return W + zeta * (contract(H, H) - 3.0)


@none_without("zeta")
def _twice(zeta):
    return 2.0 * zeta


@overload(first_piola_kirchhoff_stress)
def _stress(law, F, H, J, branch_sum):
    if not is_instance(law, MooneyRivlin):
        return None

    def stress(law, F, H, J, branch_sum):
        # (A.1): P = Sigma_F + Sigma_H x F + Sigma_J H
        sigma_J = law.lambda_hat * (J - 1.0) - (_logarithmic(law.xi, law.zeta) + _total(law.branch_moduli)) / J
        P = add(scale(2.0 * law.xi, F), scale(sigma_J, H))
        P = _add_area_stress(P, law.zeta, F, H)
        return _add_branch_stress(P, F, branch_sum)

    return stress


@overload(shear_wave_tensor)
def _shear(law, F, branch_sum):
    if not is_instance(law, MooneyRivlin):
        return None

    def tensor(law, F, branch_sum):
        # (59) averaged over both waves: 2 xi + zeta (lambda_1^2 + lambda_2^2) + N . branch_sum N
        Q = plus_identity(_add_area_tensor(zero_like_gram(F), law.zeta, F), 2.0 * law.xi)
        return _add_symmetric(Q, branch_sum)

    return tensor


@overload(pressure_wave_tensor)
def _pressure(law, F, H, J, branch_sum):
    if not is_instance(law, MooneyRivlin):
        return None

    def tensor(law, F, H, J, branch_sum):
        # (56), exact for every N: 2 xi + 2 zeta Lambda_T^2 + f'' Lambda_H^2 + sum mu_alpha (N . A N + Lambda_H^2 / J^2)
        curvature = law.lambda_hat + (_logarithmic(law.xi, law.zeta) + _total(law.branch_moduli)) / (J * J)
        Q = plus_identity(scale(curvature, gram(H)), 2.0 * law.xi)
        return _add_symmetric(_add_area_tensor(Q, _twice(law.zeta), F), branch_sum)

    return tensor


@overload(isotropic_shear_modulus)
def _isotropic(law):
    if not is_instance(law, MooneyRivlin):
        return None
    parameters = field_types(law)
    if isinstance(parameters["zeta"], types.NoneType) and isinstance(parameters["branch_moduli"], types.NoneType):
        return lambda law: 2.0 * law.xi
    return lambda law: None


@overload(equilibrium_energy)
def _energy(law, F, H, J):
    if not is_instance(law, MooneyRivlin):
        return None

    def energy(law, F, H, J):
        # (19)
        W = law.xi * (contract(F, F) - 3.0) - _logarithmic(law.xi, law.zeta) * math.log(J)
        return _add_area_energy(W + 0.5 * law.lambda_hat * (J - 1.0) * (J - 1.0), law.zeta, H)

    return energy
