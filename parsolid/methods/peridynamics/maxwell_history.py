"""Hyperelastic Maxwell solids of every kind: C^{-1} and the branches' A_alpha as histories."""

from parsolid.materials.hyperelastic.law import (
    equilibrium_energy,
    first_piola_kirchhoff_stress,
    pressure_wave_tensor,
)
from parsolid.materials.viscoelastic.maxwell_lanes import (
    branch_dissipation,
    branch_energy,
    inverse_right_cauchy_green,
    relaxed,
)
from parsolid.methods.peridynamics.tensor_states import (
    largest_principal_value,
    load_state,
    nominal_stress,
    scalar_energy,
    settle_state,
    squared_volume_ratio,
    store_state,
    wave_modulus,
)
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.tensors import I, cofactor, determinant, expand, gram, inverse_symmetric, lane_of


@nominal_stress.otherwise
def _maxwell_stress(space, law, weights, state, i, G):
    F = G + I
    H, J = cofactor(F), determinant(F)
    total = _branch_sum(law.branch_moduli, space, weights, state, i, inverse_right_cauchy_green(H, J))
    return first_piola_kirchhoff_stress(law, F, H, J, total)


@none_without("moduli")
def _branch_sum(moduli, space, weights, state, i, inverse):
    """sum mu_alpha A_alpha after the step, None without branches."""
    old, total = load_state(space, state, 0, i), 0.0 * inverse
    for j in range(len(moduli)):
        A = load_state(space, state, 1 + j, i)
        A = relaxed((weights[j, 0], weights[j, 1], weights[j, 2]), A, old, inverse)
        total = total + moduli[j] * A
    return total


@wave_modulus.otherwise
def _maxwell_waves(space, law, undeformed, weights, state, i, G):
    F = G + I
    H, J = cofactor(F), determinant(F)
    total = _branch_sum(law.branch_moduli, space, weights, state, i, inverse_right_cauchy_green(H, J))
    return largest_principal_value(pressure_wave_tensor(law, F, H, J, total))


@squared_volume_ratio.otherwise
def _maxwell_volumes(space, law, state, i, J):
    return 1.0 / (J * J * determinant(expand(load_state(space, state, 0, i))))


@settle_state.otherwise
def _settle_maxwell(space, law, weights, state, i, count, G):
    F = G + I
    H, J = cofactor(F), determinant(F)
    C, inverse = gram(F), inverse_right_cauchy_green(H, J)
    lost = 0.0 * J + _settle_branches(law.branch_moduli, space, law, weights, state, i, count, C, inverse)
    store_state(state, 0, i, inverse, count)
    return 0.0 * J, lost


@generic
def _settle_branches(moduli, space, law, weights, state, i, count, C, inverse):
    """Dissipated energy [J/m^3] of the branches, whose tensors go through the step."""


@_settle_branches.of(None)
def _without_branches(moduli, space, law, weights, state, i, count, C, inverse):
    return 0.0


@_settle_branches.otherwise
def _with_branches(moduli, space, law, weights, state, i, count, C, inverse):
    old = load_state(space, state, 0, i)
    old_C, lost = inverse_symmetric(old), 0.0 * C[0]
    for j in range(len(moduli)):
        mu, tau = moduli[j], law.relaxation_times[j]
        A = load_state(space, state, 1 + j, i)
        # the trapezoidal rule
        lost = lost + 0.5 * weights[j, 3] * branch_dissipation(mu, tau, old_C, old, A)
        A = relaxed((weights[j, 0], weights[j, 1], weights[j, 2]), A, old, inverse)
        lost = lost + 0.5 * weights[j, 3] * branch_dissipation(mu, tau, C, inverse, A)
        store_state(state, 1 + j, i, A, count)
    return lost


@scalar_energy.otherwise
def _maxwell_energy(space, law, state, i, k, G):
    F = lane_of(G, k) + I
    H, J = cofactor(F), determinant(F)
    energy = equilibrium_energy(law, F, H, J)
    return _add_energy_of_branches(law.branch_moduli, space, state, i, k, gram(F), J, energy)


@generic
def _add_energy_of_branches(moduli, space, state, i, k, C, J, energy):
    """Stored energy [J/m^3] of particle i + k, so far without the branches."""


@_add_energy_of_branches.of(None)
def _no_energy(moduli, space, state, i, k, C, J, energy):
    return energy


@_add_energy_of_branches.otherwise
def _some_energy(moduli, space, state, i, k, C, J, energy):
    for j in range(len(moduli)):
        energy += branch_energy(moduli[j], C, J, lane_of(load_state(space, state, 1 + j, i), k))
    return energy
