"""Functions of hyperelastic laws: the energy, and the functions that differences of it replace.

A law is a NamedTuple of parameters, among them density [kg/m^3], branch_moduli [Pa] and relaxation_times [s] (tuples of
equal length, or None) of its Maxwell branches, which are added to every law (`materials.viscoelastic.maxwell`). It
implements `energy`. All else follows by differences of the energy where a law does not implement it; formulas are
faster and exact:

    stress          5-point differences: within 1e-11 of the moduli at moderate strain; 36 energies
    pressure_waves  the trace of the acoustic tensor: no less than rho c^2 of pressure waves as long as shear waves have
                    real speeds, too large by twice that of shear waves; 37 energies
    elastic_moduli  within 1e-8

A law with state variables (`at_particles`) implements `next_state`, and `dissipated_energy` where they dissipate.

F is the deformation gradient, nine numbers row by row, H its cofactor and J its determinant. They are separate
arguments because some integrators advance them separately (Lee et al.); differences of the energy use F alone.
"""

from parsolid.kernels import inlined
from parsolid.materials.law_functions import law_function
from parsolid.tensors import IDENTITY, cofactor, contract, determinant

# of F at rest; five-point first derivatives have an error of its fourth power, and 1e-16 over it of rounding
_STEP = 1e-3


@law_function
def energy(law, F, H, J):
    """Stored energy W [J/m^3] per reference volume, 0 and without stress in the undeformed state."""


@law_function
def stress(law, F, H, J):
    """First Piola-Kirchhoff stress P [Pa], the derivative of the energy by F; nine numbers."""


@law_function
def pressure_waves(law, F, H, J):
    """Symmetric tensor Q [Pa], with rho0 c^2 <= N . Q N of every wave along a direction N of the reference
    configuration.

    It sets the stable time step and the dissipation of pressure waves.
    """


@law_function
def shear_waves(law, F):
    """Symmetric tensor Q [Pa], N . Q N the mean rho0 c^2 of both shear waves along N. It scales their dissipation."""


@law_function
def isotropic_shear_modulus(law):
    """rho0 c^2 [Pa] of shear waves if it is the same for all directions and states (no tensor is kept then), or
    None."""


@law_function
def elastic_moduli(law):
    """Shear modulus and first Lame constant [Pa] in the undeformed state, without branches."""


@law_function
def next_state(law, F, H, J):
    """State variables after a step that ends at F, of those before it in the law: a tuple of numbers, in their order.
    A second call at the same F gives the same. Dependence on the rate is for Maxwell branches."""


@law_function
def dissipated_energy(law):
    """Energy [J/m^3] that the state variables have dissipated so far. The rate of `energy`, which is recoverable, and
    of this together is the stress times the rate of F."""


@law_function
def volume_part(law, J):
    """U [J/m^3], dU/dJ and d2U/dJ2 [Pa] of the part of the energy that depends on the volume alone and does not soften;
    0 where the law has no such part."""


@dissipated_energy.otherwise
def nothing_dissipated(law):
    """0, for laws without state variables."""
    return 0.0


@volume_part.otherwise
def no_volume_part(law, J):
    """The whole energy is one of shape."""
    return 0.0, 0.0, 0.0


@inlined
def _shifted(F, c, by):
    """F with `by` added to component c."""
    return (
        F[0] + by * (c == 0),
        F[1] + by * (c == 1),
        F[2] + by * (c == 2),
        F[3] + by * (c == 3),
        F[4] + by * (c == 4),
        F[5] + by * (c == 5),
        F[6] + by * (c == 6),
        F[7] + by * (c == 7),
        F[8] + by * (c == 8),
    )


@inlined
def energy_of(law, F):
    """Energy [J/m^3] of a deformation gradient alone."""
    return energy(law, F, cofactor(F), determinant(F))


@inlined
def _step_at(H, J):
    """_STEP, less where a stretch is small: J over |H| is at most the least stretch, and 1/sqrt(3) at rest."""
    return _STEP * min(1.0, J * (3.0 / contract(H, H)) ** 0.5)


@inlined
def _slope(law, F, h, c):
    """dW/dF_c by five points a step h apart."""
    near = energy_of(law, _shifted(F, c, h)) - energy_of(law, _shifted(F, c, -h))
    far = energy_of(law, _shifted(F, c, 2.0 * h)) - energy_of(law, _shifted(F, c, -2.0 * h))
    return (8.0 * near - far) / (12.0 * h)


@stress.otherwise
def stress_of_energy(law, F, H, J):
    """Differences of the energy."""
    h = _step_at(H, J)
    return (_slope(law, F, h, 0), _slope(law, F, h, 1), _slope(law, F, h, 2), _slope(law, F, h, 3),
            _slope(law, F, h, 4), _slope(law, F, h, 5), _slope(law, F, h, 6), _slope(law, F, h, 7),
            _slope(law, F, h, 8))  # fmt: skip


@inlined
def _second_slope(law, F, h, c, d):
    """d2W/dF_c dF_d by central differences, within 1e-6 of the moduli."""
    both = energy_of(law, _shifted(_shifted(F, c, h), d, h))
    neither = energy_of(law, _shifted(_shifted(F, c, -h), d, -h))
    first = energy_of(law, _shifted(_shifted(F, c, h), d, -h))
    second = energy_of(law, _shifted(_shifted(F, c, -h), d, h))
    return ((both - first) + (neither - second)) / (4.0 * h * h)


@inlined
def _trace_over_rows(law, F, h, K, L):
    """sum_i d2W/dF_iK dF_iL."""
    both = _second_slope(law, F, h, K, L) + _second_slope(law, F, h, 3 + K, 3 + L)
    return both + _second_slope(law, F, h, 6 + K, 6 + L)


@pressure_waves.otherwise
def trace_of_acoustic_tensor(law, F, H, J):
    """N . Q N is the trace of the acoustic tensor along N, the sum of rho0 c^2 of all three waves."""
    h = _step_at(H, J)
    return (_trace_over_rows(law, F, h, 0, 0), _trace_over_rows(law, F, h, 1, 1), _trace_over_rows(law, F, h, 2, 2),
            _trace_over_rows(law, F, h, 0, 1), _trace_over_rows(law, F, h, 0, 2),
            _trace_over_rows(law, F, h, 1, 2))  # fmt: skip


@shear_waves.otherwise
def undeformed_shear_waves(law, F):
    """The tensor of the undeformed state."""
    modulus = elastic_moduli(law)[0]
    return (modulus, modulus, modulus, 0.0, 0.0, 0.0)


@isotropic_shear_modulus.otherwise
def undeformed_shear_modulus(law):
    """The shear modulus at rest; None with branches, which make it depend on the direction."""
    return elastic_moduli(law)[0] if law.branch_moduli is None else None


@elastic_moduli.otherwise
def moduli_of_energy(law):
    """mu and lambda from five-point differences of the energy in the undeformed state."""
    one = IDENTITY
    normal = _curvature(law, one, 1.0, 0.0)
    shear = _curvature(law, one, 0.0, 1.0)
    return shear, normal - 2.0 * shear


@inlined
def _curvature(law, F, normal, shear):
    """d2W/de2 along dF_11 = normal de, dF_12 = shear de."""
    h = 4.0 * _STEP
    near = energy_of(law, _moved(F, h * normal, h * shear)) + energy_of(law, _moved(F, -h * normal, -h * shear))
    far = energy_of(law, _moved(F, 2.0 * h * normal, 2.0 * h * shear))
    far = far + energy_of(law, _moved(F, -2.0 * h * normal, -2.0 * h * shear))
    return (16.0 * near - far - 30.0 * energy_of(law, F)) / (12.0 * h * h)


@inlined
def _moved(F, normal, shear):
    return _shifted(_shifted(F, 0, normal), 1, shear)
