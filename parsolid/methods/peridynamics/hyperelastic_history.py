"""Prony series on hyperelastic solids: C and the branches' C_j as histories."""

from decomposition.deferred import register_jitable
from parsolid.materials.hyperelastic.law import first_piola_kirchhoff_stress, pressure_wave_tensor
from parsolid.materials.viscoelastic.hyperelastic_series import (
    HyperelasticSeries,
    branch_energy,
    second_piola_kirchhoff_stress,
    solid_energy,
)
from parsolid.materials.viscoelastic.maxwell_lanes import relaxed
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
from parsolid.numerics.tensors import I, cofactor, contract, determinant, expand, gram, lane_of


@register_jitable
def _relaxed_stress(space, law, weights, state, i, C):
    """sum gamma_j S0(C_j) after the step, and sum gamma_j."""
    old, total, sum_of_ratios = load_state(space, state, 0, i), 0.0 * C, 0.0
    for j in range(len(law.ratios)):
        Cj = relaxed((weights[j, 0], weights[j, 1], weights[j, 2]), load_state(space, state, 1 + j, i), old, C)
        total = total + law.ratios[j] * second_piola_kirchhoff_stress(law.solid, Cj)
        sum_of_ratios += law.ratios[j]
    return total, sum_of_ratios


@nominal_stress.of(HyperelasticSeries)
def _series_stress(space, law, weights, state, i, G):
    F = G + I
    total, ratios = _relaxed_stress(space, law, weights, state, i, gram(F))
    P = first_piola_kirchhoff_stress(law.solid, F, cofactor(F), determinant(F), None)
    return (1.0 + ratios) * P - F @ total


@wave_modulus.of(HyperelasticSeries)
def _series_waves(space, law, undeformed, weights, state, i, G):
    F = G + I
    total, ratios = _relaxed_stress(space, law, weights, state, i, gram(F))
    waves = pressure_wave_tensor(law.solid, F, cofactor(F), determinant(F), 0.0 * total)
    # N . S N of what has relaxed goes off
    return (1.0 + ratios) * largest_principal_value(waves) + largest_principal_value(-1.0 * total)


@squared_volume_ratio.of(HyperelasticSeries)
def _series_volumes(space, law, state, i, J):
    return determinant(expand(load_state(space, state, 0, i))) / (J * J)


@settle_state.of(HyperelasticSeries)
def _settle_series(space, law, weights, state, i, count, G):
    C, old = gram(G + I), load_state(space, state, 0, i)
    lost = 0.0 * G[0]
    for j in range(len(law.ratios)):
        before = load_state(space, state, 1 + j, i)
        after = relaxed((weights[j, 0], weights[j, 1], weights[j, 2]), before, old, C)
        change = second_piola_kirchhoff_stress(law.solid, after) - second_piola_kirchhoff_stress(law.solid, before)
        # the trapezoidal rule, exact for a stress linear in C, and with it the work that forces do over the step
        lost = lost + 0.25 * law.ratios[j] * contract(change, C + old - after - before)
        store_state(state, 1 + j, i, after, count)
    store_state(state, 0, i, C, count)
    return 0.0 * lost, lost


@scalar_energy.of(HyperelasticSeries)
def _series_energy(space, law, state, i, k, G):
    C = gram(lane_of(G, k) + I)
    energy = solid_energy(law.solid, C)
    for j in range(len(law.ratios)):
        energy += law.ratios[j] * branch_energy(law.solid, C, lane_of(load_state(space, state, 1 + j, i), k))
    return energy
