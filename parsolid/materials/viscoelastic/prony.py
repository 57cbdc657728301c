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

Symmetric tensors have six components (`parsolid.tensors`); a bar is embedded in them: only 11 is not zero.
"""

import math
from typing import Any, NamedTuple

from parsolid.kernels import inlined
from parsolid.materials.viscoelastic.interconversion import shear_relaxation
from parsolid.tensors import (
    add_spherical,
    combine_symmetric,
    contract_symmetric,
    gram,
    symmetric_part,
    times_symmetric,
    trace_symmetric,
)


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
    first_lame: Any
    bulk_modulus: float | None
    free_directions: float | None
    finite_strain: float | None
    ratios: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None

    @property
    def terms(self) -> int:
        """Number of terms of the series."""
        return len(self.ratios or ())


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


def _shear_series(material, G: float, K: float) -> tuple[Any, Any]:
    """gamma_j and tau_j [s] of the shear modulus."""
    moduli, times = material.term_moduli, material.relaxation_times
    if material.bulk == "elastic" and material.youngs_modulus is not None and material.conversion != "paper":
        _, moduli, times = shear_relaxation(K, material.youngs_modulus, moduli, times)
        return moduli / G, times
    stated = material.youngs_modulus or material.shear_modulus
    return [modulus / stated for modulus in moduli], times


def branch_weights(step: float, relaxation_time: float) -> tuple[float, float]:
    """(a, A) of eq (28) for a step [s]; (1, 1) for step 0."""
    x = step / relaxation_time
    if x == 0.0:
        return 1.0, 1.0
    return math.exp(-x), -math.expm1(-x) / x


def dissipation_weights(step: float, relaxation_time: float) -> tuple[float, float, float]:
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


def free_work_weights(step: float, relaxation_time: float) -> tuple[float, float]:
    """Weights (p, q) of the mean of e_j over a step less that of its ends, p e_j + q de; see `free_work`."""
    x = step / relaxation_time
    if x < 0.02:
        # series, because both cancel
        return -x * x * (1.0 / 12.0 - x * (1.0 / 24.0 - x / 80.0)), x * (1.0 / 12.0 - x * (1.0 / 24.0 - x / 80.0))
    a, A = branch_weights(step, relaxation_time)
    return A - 0.5 * (1.0 + a), (1.0 - A) / x - 0.5 * A


class LinearSolid(NamedTuple):
    """A Prony solid as kernels take it: sigma = (bulk tr e + first tr r) 1 + 2 shear r [Pa] of a strain e and the
    relaxing strain r = e + sum gamma_j e_j.

    bulk is 0 where everything relaxes, K where the bulk is elastic, and first is then -2/3 shear. free: directions
    without stress, 1 in plane stress and 2 in a bar, else 0; lateral: so many where the strain along them is history.
    finite: whether e is Green and Lagrange's strain and sigma the second Piola-Kirchhoff stress. undeformed: rho c^2
    [Pa] of pressure waves at rest, before anything has relaxed.
    """

    shear: float
    first: float
    bulk: float
    free: float
    lateral: float
    finite: bool
    undeformed: float


def linear_solid(law: Prony) -> LinearSolid:
    """The constants that kernels need."""
    elastic, free = law.bulk_modulus is not None, law.free_directions or 0.0
    first = -2.0 / 3.0 * law.shear_modulus if elastic else law.first_lame
    lateral, finite = (free if elastic else 0.0), law.finite_strain is not None
    return LinearSolid(
        law.shear_modulus, first, law.bulk_modulus or 0.0, free, lateral, finite, pressure_wave_modulus(law)
    )


@inlined
def strain_of(law, G):
    """The strain of a displacement gradient: small, or Green and Lagrange's."""
    small = symmetric_part(G)
    # a sum of both, so that kernels have one way
    return combine_symmetric(1.0, small, 0.5 if law.finite else 0.0, gram(G))


@inlined
def linear_stress(law, strain, relaxing):
    """Stress [Pa] of both strains with their lateral components; exactly 0 along free directions."""
    mean = law.bulk * trace_symmetric(strain) + law.first * trace_symmetric(relaxing)
    S = add_spherical(times_symmetric(2.0 * law.shear, relaxing), mean)
    if law.free > 0.0:
        return (S[0], (2.0 - law.free) * S[1], 0.0, S[3], 0.0, 0.0)
    return S


@inlined
def branch_form(law, A, B):
    """Energy density 1/2 A : C : B [J/m^3] of a branch over gamma_j; with an elastic bulk of the deviators alone.

    The stored energy is equilibrium_form(e, e) + sum gamma_j branch_form(e_j, e_j), and the rate of dissipation
    sum 2 gamma_j/tau_j branch_form(e_j, e_j) [W/m^3].
    """
    return law.shear * contract_symmetric(A, B) + 0.5 * law.first * trace_symmetric(A) * trace_symmetric(B)


@inlined
def equilibrium_form(law, A, B):
    """Energy density 1/2 A : C0 : B [J/m^3] of the equilibrium solid; with their lateral components."""
    return branch_form(law, A, B) + 0.5 * law.bulk * trace_symmetric(A) * trace_symmetric(B)


@inlined
def with_lateral(law, strain, relaxing, factor):
    """Both strains with the strain along free directions at which their stress vanishes, of laws with `lateral`.

    factor: sum gamma_j A_j; relaxing: of the whole step, with its 33 what is carried over from the step's start,
    sum gamma_j (a_j e_j - A_j e_old), and strain with 0 there.
    """
    # 0 = K tr(e) + 2 G dev(r) along the free directions, solved for their strain
    n, carried = law.lateral, relaxing[2]
    driven = (relaxing[0], (2.0 - n) * relaxing[1], 0.0, relaxing[3], 0.0, 0.0)
    own = 2.0 * law.shear * (1.0 - n / 3.0)
    driving = law.bulk * trace_symmetric(strain) + law.first * trace_symmetric(driven) + own * carried
    e = driving * (-1.0 / (n * law.bulk + own * (1.0 + factor)))
    r = e * (1.0 + factor) + carried
    strain = (strain[0], strain[1] + (n - 1.0) * e, strain[2] + e, strain[3], 0.0, 0.0)
    return strain, (driven[0], driven[1] + (n - 1.0) * r, r, driven[3], 0.0, 0.0)


@inlined
def free_work(law, p, q, branch, change):
    """Energy that a branch dissipates over a step beyond that of strains linear in time, over 2 gamma_j; p and q: of
    `free_work_weights`.

    Along free directions the stress vanishes at the ends of a step, but not in between where strain is linear. Nothing
    does the work of that stress: the true lateral strain follows at once and dissipates it.
    """
    deviator = p * (branch[2] - trace_symmetric(branch) / 3.0) + q * (change[2] - trace_symmetric(change) / 3.0)
    return -law.lateral * law.shear * deviator * change[2]


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
