"""Prony solids on four particles at once, for methods that have not moved to `prony`."""

from decomposition.deferred import register_jitable
from parsolid.materials.viscoelastic.prony import (  # noqa: F401
    Prony,
    algorithmic_factor,
    branch_weights,
    dissipation_weights,
    free_work_weights,
    of_material,
    pressure_wave_modulus,
)
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.polar import symmetric_part
from parsolid.numerics.tensors import I, SymmetricPlane, as_tensor, contract, formula, gram, trace


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
