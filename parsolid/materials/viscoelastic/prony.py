"""Linear viscoelasticity by a Prony series, at small strain and, in Green-Lagrange strain, at finite strain.

Branch j of the series is a Maxwell element beside the equilibrium solid; the strain of its spring is e_j, and its
stress is h_j = gamma_j C0 : e_j (Galadima et al., eqs (23), (24)). With strain linear over a step of length dt, (28) is
    e_j <- a_j e_j + A_j (e_new - e_old),   a_j = exp(-dt/tau_j),   A_j = (1 - a_j) / (dt/tau_j),
exact for such a path; a step of length 0 is a jump (a = A = 1). The stress depends on the relaxing strain
    e~ = e + sum_j gamma_j e_j
alone where all moduli relax in one ratio (31), and on the strain too where the bulk is elastic (32)-(35):
    sigma = C0 : e~      or      sigma = K tr(e) I + 2 G0 dev(e~).
The recursion is linear, so what holds for strains holds for displacements: e~ is the strain of u~ = u + sum_j gamma_j
q_j with q_j <- a_j q_j + A_j (u_new - u_old).

At finite strain e is the Green-Lagrange strain and the stress the second Piola-Kirchhoff stress S, P = F S (Kaliske &
Rothert, Comput. Mech. 19, 1997, on a St. Venant-Kirchhoff solid).

Functions take tuples of scalars (`numerics.tensors`), floats or `Lanes`. A bar is embedded in the plane: only 11 is not
zero.
"""

import math
from typing import NamedTuple

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.viscoelastic.interconversion import shear_relaxation
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.polar import symmetric_part
from parsolid.numerics.tensors import I, SymmetricPlane, as_tensor, contract, formula, gram, trace


class Prony(NamedTuple):
    """Parameters in SI units; what a law lacks is None.

    density [kg/m^3]; shear_modulus [Pa] of the equilibrium solid, G0
    first_lame [Pa]: of the equilibrium solid where everything relaxes, for plane stress and bars the condensed one
    bulk_modulus [Pa]: K where the bulk is elastic; exactly one of first_lame and bulk_modulus is given
    free_directions: 1.0 in plane stress, 2.0 in a bar, else None
    finite_strain: 1.0 for Green-Lagrange strain and S, else None
    ratios gamma_j and relaxation_times [s]: tuples of equal length
    """

    density: float
    shear_modulus: float
    first_lame: float | None
    bulk_modulus: float | None
    free_directions: float | None
    finite_strain: float | None
    ratios: tuple | None
    relaxation_times: tuple | None

    @property
    def terms(self) -> int:
        """Number of terms of the series."""
        return len(self.ratios or ())

    @property
    def lateral_history(self) -> bool:
        """Whether the strain along free directions is a history variable (elastic bulk, plane stress or bar)."""
        return self.bulk_modulus is not None and self.free_directions is not None


def of_material(material, state: str) -> Prony:
    """The law of a scene's Prony solid; `state` is "space", "plane-strain", "plane-stress" or "bar"."""
    constants = material.equilibrium
    G, K = constants.shear_modulus, constants.bulk_modulus
    lame = {
        "space": K - 2.0 / 3.0 * G,
        "plane-strain": K - 2.0 / 3.0 * G,
        # 2 lambda G / (lambda + 2 G)
        "plane-stress": 2.0 * G * (K - 2.0 / 3.0 * G) / (K + 4.0 / 3.0 * G),
        "bar": constants.youngs_modulus - 2.0 * G,
    }[state]
    elastic = material.bulk == "elastic"
    ratios, times = _shear_series(material, G, K)
    return Prony(
        density=float(material.density),
        shear_modulus=float(G),
        first_lame=None if elastic else float(lame),
        bulk_modulus=float(K) if elastic else None,
        free_directions={"plane-stress": 1.0, "bar": 2.0}.get(state),
        finite_strain=1.0 if material.strain == "finite" else None,
        ratios=tuple(map(float, ratios)) or None,
        relaxation_times=tuple(map(float, times)) or None,
    )


def _shear_series(material, G: float, K: float) -> tuple:
    """gamma_j and tau_j [s] of the shear modulus."""
    moduli, times = material.term_moduli, material.relaxation_times
    if material.bulk == "elastic" and material.youngs_modulus is not None and material.conversion != "paper":
        _, moduli, times = shear_relaxation(K, material.youngs_modulus, moduli, times)
        return moduli / G, times
    stated = material.youngs_modulus or material.shear_modulus
    return [modulus / stated for modulus in moduli], times


@compiled
def branch_weights(step, relaxation_time):
    """(a, A) of eq (28) for a step [s]; (1, 1) for step 0."""
    x = step / relaxation_time
    if x == 0.0:
        return 1.0, 1.0
    return math.exp(-x), -math.expm1(-x) / x


@compiled
def dissipation_weights(step, relaxation_time):
    """Weights (c, d, e) with which a branch dissipates over a step: 2 gamma (c w(e_j, e_j) + d w(e_j, de) + e w(de,
    de)).

    w is `branch_form`, e_j the branch strain at the start of the step, de the change of the strain over it. The
    integral of 2 gamma w(e_j, e_j)/tau over the step, with strain linear in time; never negative as a whole, 0 in a
    jump.
    """
    x = step / relaxation_time
    if x == 0.0:
        return 0.0, 0.0, 0.0
    gone = -math.expm1(-x)
    decayed = -0.5 * math.expm1(-2.0 * x)
    if x < 0.02:
        # series, because x - 2 (1 - a) + (1 - a^2)/2 cancels
        series = 7.0 / 60.0 - x * (1.0 / 24.0 - x * (31.0 / 2520.0 - x / 320.0))
        square = x * (1.0 / 3.0 - x * (0.25 - x * series))
    else:
        square = (x - 2.0 * gone + decayed) / (x * x)
    return decayed, gone * gone / x, square


@compiled
def free_work_weights(step, relaxation_time):
    """Weights (p, q) of the mean of e_j over a step less that of its ends, p e_j + q de; see `less_free_work`."""
    x = step / relaxation_time
    if x < 0.02:
        # series, because both cancel
        return -x * x * (1.0 / 12.0 - x * (1.0 / 24.0 - x / 80.0)), x * (1.0 / 12.0 - x * (1.0 / 24.0 - x / 80.0))
    a, A = branch_weights(step, relaxation_time)
    return A - 0.5 * (1.0 + a), (1.0 - A) / x - 0.5 * A


@formula
def relaxed_branch(weights, branch, change):
    """Branch strain e_j after a step with the given (a, A) and change of strain; symmetric tensors."""
    return weights[0] * branch + weights[1] * change


small_strain = symmetric_part


@formula
def green_lagrange_strain(gradient):
    """E = (G + G^T + G^T G)/2 of a displacement gradient G (a general tensor)."""
    return small_strain(gradient) + 0.5 * gram(gradient)


@register_jitable
def strain_measure(law, gradient):
    """The law's strain of a displacement gradient: small, or Green-Lagrange."""
    return _strain_of(law.finite_strain, gradient)


@generic
def _strain_of(finite_strain, gradient):
    """Small strain where finite_strain is None, else Green-Lagrange strain."""


@_strain_of.of(None)
def _small(finite_strain, gradient):
    return small_strain(gradient)


@_strain_of.otherwise
def _finite(finite_strain, gradient):
    return green_lagrange_strain(gradient)


@register_jitable
def lateral_strain(law, factor, carried, strain, relaxing):
    """Strain along the free directions at which their stress vanishes; None where the law has no such history.

    factor = sum gamma_j A_j; carried = sum gamma_j (a_j e_j - A_j e_old) of lateral strains, at the start of the step;
    strain and relaxing have no lateral part yet (0 there), but relaxing that of the whole step's other components.
    """
    return _condensed(law.bulk_modulus, law.free_directions, law.shear_modulus, factor, carried, strain, relaxing)


@none_without("K")
def _condensed(K, n, G, factor, carried, strain, relaxing):
    return _condensed_along(n, K, G, factor, carried, strain, relaxing)


@none_without("n")
def _condensed_along(n, K, G, factor, carried, strain, relaxing):
    # 0 = K tr(e) + 2 G0 dev(e~) along n free directions, solved for their strain
    own = 2.0 * G * (1.0 - n / 3.0)
    driving = K * trace(strain) - (2.0 / 3.0) * G * trace(relaxing) + own * carried
    return driving * (-1.0 / (n * K + own * (1.0 + factor)))


@none_without("lateral", returns="strain")
def with_lateral(strain, lateral, free_directions):
    """A plane strain tensor with its lateral components filled in: 33 in plane stress, 22 and 33 in a bar."""
    return SymmetricPlane(strain[0], strain[1] + (free_directions - 1.0) * lateral, strain[2] + lateral, strain[3])


@none_without("lateral", returns="relaxing")
def with_relaxing_lateral(relaxing, lateral, free_directions, factor, carried):
    """The relaxing strain with its lateral components, see `lateral_strain`."""
    return with_lateral(relaxing, lateral * (1.0 + factor) + carried, free_directions)


@register_jitable
def stress(law, strain, relaxing):
    """Stress [Pa], a symmetric tensor, from the strain and the relaxing strain, both with their lateral components.

    sigma at small strain, S at finite strain. Where everything relaxes `strain` is not read and may be None.
    """
    sigma = 2.0 * law.shear_modulus * as_tensor(relaxing) + _mean_stress(law.bulk_modulus, law, strain, relaxing) * I
    return _without_free_stress(sigma, law.free_directions)


@generic
def _mean_stress(bulk_modulus, law, strain, relaxing):
    """What is added to 2 G e~ on the diagonal [Pa]."""


@_mean_stress.of(None)
def _relaxing_bulk(bulk_modulus, law, strain, relaxing):
    return law.first_lame * trace(relaxing)


@_mean_stress.otherwise
def _elastic_bulk(bulk_modulus, law, strain, relaxing):
    return bulk_modulus * trace(strain) - (2.0 / 3.0) * law.shear_modulus * trace(relaxing)


@none_without("free_directions", returns="sigma")
def _without_free_stress(sigma, free_directions):
    """Plane stress has no 33, a bar no 22 either, but for rounding."""
    return SymmetricPlane(sigma[0], (2.0 - free_directions) * sigma[1], 0.0 * sigma[2], sigma[3])


@register_jitable
def equilibrium_form(law, a, b):
    """Bilinear energy density 1/2 a : C0 : b [J/m^3] of the equilibrium solid; a, b with their lateral components."""
    return _add_bulk_form(branch_form(law, a, b), law.bulk_modulus, a, b)


@none_without("bulk_modulus", returns="form")
def _add_bulk_form(form, bulk_modulus, a, b):
    return form + 0.5 * bulk_modulus * trace(a) * trace(b)


@register_jitable
def branch_form(law, a, b):
    """Bilinear energy density [J/m^3] of a branch over gamma_j: 1/2 a : C0 : b, or G0 dev(a) : dev(b) for an elastic
    bulk.

    The stored energy is equilibrium_form(e, e) + sum gamma_j branch_form(e_j, e_j), and the rate of dissipation
    sum 2 gamma_j/tau_j branch_form(e_j, e_j) [W/m^3]; the power of the stress is the sum of the latter and the former's
    rate.
    """
    return _form_of(law.bulk_modulus, law, a, b)


@generic
def _form_of(bulk_modulus, law, a, b):
    """`branch_form`."""


@_form_of.of(None)
def _whole_form(bulk_modulus, law, a, b):
    return law.shear_modulus * contract(a, b) + 0.5 * law.first_lame * trace(a) * trace(b)


@_form_of.otherwise
def _deviatoric_form(bulk_modulus, law, a, b):
    return law.shear_modulus * (contract(a, b) - trace(a) * trace(b) / 3.0)


@register_jitable
def less_free_work(law, weights, branch, change, loss):
    """What a branch dissipates over a step over 2 gamma_j, from what it does on strains that are linear in time.

    Along free directions stress vanishes at the ends of a step, and with strain linear between them not in between. No
    one does the work of that stress: in truth the lateral strain follows at once, and dissipates it.
    """
    return _less_work(law.bulk_modulus, law.free_directions, law.shear_modulus, weights, branch, change, loss)


@none_without("K", returns="loss")
def _less_work(K, n, G, weights, branch, change, loss):
    return _less_work_along(n, G, weights, branch, change, loss)


@none_without("n", returns="loss")
def _less_work_along(n, G, weights, branch, change, loss):
    p, q = weights
    deviator = p * (branch[2] - trace(branch) / 3.0) + q * (change[2] - trace(change) / 3.0)
    return loss - n * G * deviator * change[2]


def algorithmic_factor(law: Prony, step: float) -> float:
    """1 + sum gamma_j A_j: the stiffness of what relaxes, over a step [s], in multiples of that in equilibrium."""
    return 1.0 + sum(
        ratio * branch_weights(step, time)[1] for ratio, time in zip(law.ratios or (), law.relaxation_times or ())
    )


def pressure_wave_modulus(law: Prony, step: float = 0.0) -> float:
    """rho c_p^2 [Pa] of the law over a step [s]; with step 0 the instantaneous one, which bounds explicit steps."""
    factor = algorithmic_factor(law, step)
    G = law.shear_modulus * factor
    if law.bulk_modulus is None:
        return law.first_lame * factor + 2.0 * G
    K, n = law.bulk_modulus, law.free_directions
    if n is None:
        return K + 4.0 / 3.0 * G
    return 9.0 * K * G / (3.0 * K + G) if n == 2.0 else 4.0 * G * (3.0 * K + G) / (3.0 * K + 4.0 * G)
