"""Laws of the principal stretches at constant volume, and a volumetric part: Ogden, Hencky, the generalised polynomial.

W = w(e1, e2, e3) + U(J) with e = ln(J^-1/3 lambda). A law of this kind is a NamedTuple with `volume` and a function
`of_stretches`. Principal values come from Jacobi's rotations; stresses divide by no difference of stretches.
"""

from typing import Annotated, Any, NamedTuple

from parsolid.elementary import exp, log
from parsolid.kernels import inlined
from parsolid.materials.declaration import Density, Parameter, law
from parsolid.materials.hyperelastic.functions import elastic_moduli, energy, pressure_waves, stress, volume_part
from parsolid.materials.hyperelastic.volume import (
    BulkModulus,
    VolumeKind,
    volume_energy,
    volume_slopes,
    volume_terms,
)
from parsolid.materials.law_functions import law_function
from parsolid.principal import from_principal, principal
from parsolid.tensors import combine, combine_symmetric, general, gram, matmul

# below it, relative distance of stretches at which differences are derivatives
_CLOSE = 1e-4


@law_function
def of_stretches(law, e):
    """w [J/m^3], its slopes t_i = dw/d ln lambda_i and curvatures T_ij [Pa] (11, 22, 33, 12, 13, 23), of three e."""


@law("hyperelastic", "ogden")
class Ogden(NamedTuple):
    """sum mu_p/alpha_p (sum_i lambdabar_i^alpha_p - 3) + U(J), up to three terms (Ogden, Proc. R. Soc. A 326 (1972)
    565); the shear modulus is sum mu_p alpha_p/2, each mu_p alpha_p > 0. mu_p of Abaqus is mu_p alpha_p/2 here."""

    density: Density
    mu_1: Annotated[float, Parameter("Pa", "of the sign of alpha_1")]
    alpha_1: Annotated[float, Parameter("1", "exponent, not 0")]
    mu_2: Annotated[float, Parameter("Pa", "of the sign of alpha_2", default=0.0)]
    alpha_2: Annotated[float, Parameter("1", "exponent, not 0", default=2.0)]
    mu_3: Annotated[float, Parameter("Pa", "of the sign of alpha_3", default=0.0)]
    alpha_3: Annotated[float, Parameter("1", "exponent, not 0", default=2.0)]
    bulk_modulus: BulkModulus
    volume: VolumeKind
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None

    def faults(self) -> list[tuple[tuple[Any, ...], str, object]]:
        """Terms whose energy is not convex."""
        found: list[tuple[tuple[Any, ...], str, object]] = []
        for p in (1, 2, 3):
            mu, alpha = getattr(self, f"mu_{p}"), getattr(self, f"alpha_{p}")
            if alpha == 0.0:
                found.append(((f"alpha_{p}",), "an exponent that is not 0", alpha))
            elif mu * alpha < 0.0 or (p == 1 and mu == 0.0):
                found.append(((f"mu_{p}",), f"the sign of alpha_{p} = {alpha:g}", mu))
        return found


@law("hyperelastic", "hencky")
class Hencky(NamedTuple):
    """mu |dev ln U|^2 + U(J): linear in logarithmic strain, for small elastic strain; waves are sure for stretches of
    .21 to 1.39 (Bruhns, Xiao & Meyers, Int. J. Plasticity 17 (2001))."""

    density: Density
    shear_modulus: Annotated[float, Parameter("Pa", "mu", above=0.0)]
    bulk_modulus: BulkModulus
    volume: VolumeKind
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


@law("hyperelastic", "polynomial")
class Polynomial(NamedTuple):
    """sum c_ij (I1bar - 3)^i (I2bar - 3)^j + U(J) (Rivlin & Saunders, Phil. Trans. R. Soc. A 243 (1951) 251); mu = 2
    (c10 + c01). Terms of I2bar are not polyconvex (Hartmann & Neff, Int. J. Solids Struct. 40 (2003) 2767)."""

    density: Density
    c10: Annotated[float, Parameter("Pa", "factor of I1bar - 3", at_least=0.0)]
    c01: Annotated[float, Parameter("Pa", "factor of I2bar - 3", at_least=0.0, default=0.0)]
    c20: Annotated[float, Parameter("Pa", "factor of (I1bar - 3)^2", default=0.0)]
    c11: Annotated[float, Parameter("Pa", "factor of (I1bar - 3)(I2bar - 3)", default=0.0)]
    c02: Annotated[float, Parameter("Pa", "factor of (I2bar - 3)^2", default=0.0)]
    c30: Annotated[float, Parameter("Pa", "factor of (I1bar - 3)^3", default=0.0)]
    bulk_modulus: BulkModulus
    volume: VolumeKind
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None

    def faults(self) -> list[tuple[tuple[Any, ...], str, object]]:
        """A solid that does not resist shear at rest."""
        return [] if self.c10 + self.c01 > 0.0 else [(("c10",), "c10 + c01 > 0", self.c10)]


@inlined
def _power_sums(mu, alpha, e):
    """w, t and T of one of Ogden's terms."""
    p1, p2, p3 = exp(alpha * e[0]), exp(alpha * e[1]), exp(alpha * e[2])
    S = p1 + p2 + p3
    third, k, nine = S / 3.0, mu * alpha, S / 9.0
    slopes = (mu * (p1 - third), mu * (p2 - third), mu * (p3 - third))
    curvatures = (k * (p1 / 3.0 + nine), k * (p2 / 3.0 + nine), k * (p3 / 3.0 + nine),
                  k * (nine - (p1 + p2) / 3.0), k * (nine - (p1 + p3) / 3.0), k * (nine - (p2 + p3) / 3.0))  # fmt: skip
    return mu / alpha * (S - 3.0), slopes, curvatures


@inlined
def _sum_of(first, second):
    """Sums of w, t and T."""
    w, t, T = first
    v, s, S = second
    return (
        w + v,
        (t[0] + s[0], t[1] + s[1], t[2] + s[2]),
        (T[0] + S[0], T[1] + S[1], T[2] + S[2], T[3] + S[3], T[4] + S[4], T[5] + S[5]),
    )


@of_stretches.of(Ogden)
def _ogden(law, e):
    both = _sum_of(_power_sums(law.mu_1, law.alpha_1, e), _power_sums(law.mu_2, law.alpha_2, e))
    return _sum_of(both, _power_sums(law.mu_3, law.alpha_3, e))


@of_stretches.of(Hencky)
def _hencky(law, e):
    twice = 2.0 * law.shear_modulus
    t = (twice * e[0], twice * e[1], twice * e[2])
    same, other = twice * 2.0 / 3.0, -twice / 3.0
    w = law.shear_modulus * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    return w, t, (same, same, same, other, other, other)


@of_stretches.of(Polynomial)
def _polynomial(law, e):
    # I1bar - 3 and I2bar - 3 with their slopes and curvatures are those of Ogden's terms of alpha = 2 and -2
    x, u, U = _power_sums(2.0, 2.0, e)
    y, v, V = _power_sums(-2.0, -2.0, e)
    w1 = law.c10 + 2.0 * law.c20 * x + law.c11 * y + 3.0 * law.c30 * x * x
    w2, w11 = law.c01 + law.c11 * x + 2.0 * law.c02 * y, 2.0 * law.c20 + 6.0 * law.c30 * x
    w12, w22 = law.c11, 2.0 * law.c02
    w = law.c10 * x + law.c01 * y + law.c20 * x * x + law.c11 * x * y + law.c02 * y * y + law.c30 * x * x * x
    t = (w1 * u[0] + w2 * v[0], w1 * u[1] + w2 * v[1], w1 * u[2] + w2 * v[2])
    return (
        w,
        t,
        (
            _curved(w1, w2, w11, w12, w22, u, v, U, V, 0, 0, 0),
            _curved(w1, w2, w11, w12, w22, u, v, U, V, 1, 1, 1),
            _curved(w1, w2, w11, w12, w22, u, v, U, V, 2, 2, 2),
            _curved(w1, w2, w11, w12, w22, u, v, U, V, 0, 1, 3),
            _curved(w1, w2, w11, w12, w22, u, v, U, V, 0, 2, 4),
            _curved(w1, w2, w11, w12, w22, u, v, U, V, 1, 2, 5),
        ),
    )


@inlined
def _curved(w1, w2, w11, w12, w22, u, v, U, V, i, j, c):
    mixed = w12 * (u[i] * v[j] + u[j] * v[i])
    return w1 * U[c] + w2 * V[c] + w11 * u[i] * u[j] + mixed + w22 * v[i] * v[j]


@inlined
def logarithms(F):
    """Squares of the principal stretches, their axes, logarithms of the stretches, and the sum of these."""
    squares, axes = principal(gram(F))
    l1, l2, l3 = 0.5 * log(squares[0]), 0.5 * log(squares[1]), 0.5 * log(squares[2])
    return squares, axes, (l1, l2, l3), l1 + l2 + l3


@inlined
def _principal_state(F):
    """Squares of the principal stretches, their axes, and e."""
    squares, axes, each, trace = logarithms(F)
    mean = trace / 3.0
    return squares, axes, (each[0] - mean, each[1] - mean, each[2] - mean)


@energy.of(Ogden, Hencky, Polynomial)
def _energy(law, F, H, J):
    return of_stretches(law, _principal_state(F)[2])[0] + volume_energy(law.volume, law.bulk_modulus, J)


@stress.of(Ogden, Hencky, Polynomial)
def _stress(law, F, H, J):
    squares, axes, e = _principal_state(F)
    P = stress_of_logarithms(F, squares, axes, of_stretches(law, e)[1])
    return combine(1.0, P, volume_slopes(law.volume, law.bulk_modulus, J)[0], H)


@inlined
def stress_of_logarithms(F, squares, axes, t):
    """First Piola-Kirchhoff stress [Pa] from slopes t_i = dW/d ln lambda_i."""
    S = from_principal((t[0] / squares[0], t[1] / squares[1], t[2] / squares[2]), axes)
    return matmul(F, general(S))


@inlined
def _pair(l1, l2, w1, w2, w11, w22, w12):
    """d_12 and c_12 of two axes, see `stretch_waves`; of equal stretches their limits."""
    apart = l1 - l2
    close = abs(apart) < _CLOSE * l1
    a = 0.5 * (w11 + w22) - w12 if close else (w1 - w2) / (1.0 if close else apart)
    b = (w1 + w2) / (l1 + l2)
    return 0.5 * (a + b), w12 + 0.5 * (a - b)


@inlined
def stretch_waves(squares, axes, w, ww):
    """Symmetric tensor Q [Pa], rho0 c^2 <= N.QN of every wave along N, from the slopes w_i = dW/d lambda_i and the
    curvatures w_ij (11, 22, 33, 12, 13, 23) of an energy of the principal stretches, and their axes.

    Of a wave of polarisation m, with p_i = m_i N_i along the axes, rho0 c^2 is

        sum_i w_ii p_i^2 + sum_{i<j} [d_ij (m_i^2 N_j^2 + m_j^2 N_i^2) + 2 c_ij p_i p_j]

    The terms of d_ij are at most sum_i D_i (N_i^2 - p_i^2), D_i the largest d_ij. With g_i^2 = max(w_ii - D_i, 0),
    (sum_i g_i p_i)^2 <= sum_i g_i^2 N_i^2; what is left of the products of p is at most r_ij (p_i^2 + p_j^2).
    """
    l1, l2, l3 = squares[0] ** 0.5, squares[1] ** 0.5, squares[2] ** 0.5
    w11, w22, w33, w12, w13, w23 = ww
    d12, c12 = _pair(l1, l2, w[0], w[1], w11, w22, w12)
    d13, c13 = _pair(l1, l3, w[0], w[2], w11, w33, w13)
    d23, c23 = _pair(l2, l3, w[1], w[2], w22, w33, w23)
    D1, D2, D3 = max(d12, d13), max(d12, d23), max(d13, d23)
    g1, g2, g3 = max(w11 - D1, 0.0) ** 0.5, max(w22 - D2, 0.0) ** 0.5, max(w33 - D3, 0.0) ** 0.5
    r12, r13, r23 = abs(c12 - g1 * g2), abs(c13 - g1 * g3), abs(c23 - g2 * g3)
    q1 = max(D1, w11 - g1 * g1 + r12 + r13) + g1 * g1
    q2 = max(D2, w22 - g2 * g2 + r12 + r23) + g2 * g2
    q3 = max(D3, w33 - g3 * g3 + r13 + r23) + g3 * g3
    return from_principal((q1, q2, q3), axes)


@inlined
def waves_of_logarithms(squares, axes, t, T):
    """`stretch_waves` from slopes t_i and curvatures T_ij by ln lambda."""
    l1, l2, l3 = squares[0] ** 0.5, squares[1] ** 0.5, squares[2] ** 0.5
    slopes = (t[0] / l1, t[1] / l2, t[2] / l3)
    curvatures = ((T[0] - t[0]) / squares[0], (T[1] - t[1]) / squares[1], (T[2] - t[2]) / squares[2],
                  T[3] / (l1 * l2), T[4] / (l1 * l3), T[5] / (l2 * l3))  # fmt: skip
    return stretch_waves(squares, axes, slopes, curvatures)


@pressure_waves.of(Ogden, Hencky, Polynomial)
def _waves(law, F, H, J):
    squares, axes, e = _principal_state(F)
    _, t, T = of_stretches(law, e)
    of_volume = max(volume_slopes(law.volume, law.bulk_modulus, J)[1], 0.0)
    return combine_symmetric(1.0, waves_of_logarithms(squares, axes, t, T), of_volume, gram(H))


@elastic_moduli.of(Ogden, Hencky, Polynomial)
def _moduli(law):
    # at rest T11 - T12 is twice the shear modulus
    T = of_stretches(law, (0.0, 0.0, 0.0))[2]
    shear = 0.5 * (T[0] - T[3])
    return shear, law.bulk_modulus - 2.0 / 3.0 * shear


volume_part.of(Ogden, Hencky, Polynomial)(volume_terms)
