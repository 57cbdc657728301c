"""Prony solids with an elastic bulk, or of finite strain: strains as histories."""

from decomposition.deferred import register_jitable
from parsolid.materials.viscoelastic.prony_lanes import (
    Prony,
    branch_form,
    equilibrium_form,
    lateral_strain,
    less_free_work,
    relaxed_branch,
    strain_measure,
    stress,
    with_lateral,
    with_relaxing_lateral,
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
from parsolid.numerics.dispatch import generic
from parsolid.numerics.tensors import I, SymmetricPlane, determinant, expand, gram


@nominal_stress.of(Prony)
def _prony_stress(space, law, weights, state, i, G):
    strain, relaxing = _strains(space, law, weights, state, i, G)
    return _first_piola_kirchhoff_stress(law.finite_strain, G, stress(law, strain, relaxing))


@generic
def _first_piola_kirchhoff_stress(finite_strain, G, S):
    """sigma itself at small strain, F S at finite strain."""


@_first_piola_kirchhoff_stress.of(None)
def _small(finite_strain, G, S):
    return expand(S)


@_first_piola_kirchhoff_stress.otherwise
def _finite(finite_strain, G, S):
    return (G + I) @ S


@wave_modulus.of(Prony)
def _prony_waves(space, law, undeformed, weights, state, i, G):
    return _waves(law.finite_strain, space, law, undeformed, weights, state, i, G)


@generic
def _waves(finite_strain, space, law, undeformed, weights, state, i, G):
    """N . S N + N N : F C F^T : N N is at most the largest S and the largest stretch squared times the modulus."""


@_waves.of(None)
def _unchanged(finite_strain, space, law, undeformed, weights, state, i, G):
    return 0.0 * G[0]


@_waves.otherwise
def _stretched(finite_strain, space, law, undeformed, weights, state, i, G):
    strain, relaxing = _strains(space, law, weights, state, i, G)
    stretched = largest_principal_value(gram(G + I)) * undeformed
    return stretched + largest_principal_value(stress(law, strain, relaxing))


@squared_volume_ratio.of(Prony)
def _prony_volumes(space, law, state, i, J):
    return _volumes(law.finite_strain, space, state, i, J)


@generic
def _volumes(finite_strain, space, state, i, J):
    """`squared_volume_ratio`."""


@_volumes.of(None)
def _no_volumes(finite_strain, space, state, i, J):
    return 0.0 * J + 1.0


@_volumes.otherwise
def _volume_ratio(finite_strain, space, state, i, J):
    return determinant(2.0 * expand(load_state(space, state, 0, i)) + I) / (J * J)


@settle_state.of(Prony)
def _settle_prony(space, law, weights, state, i, count, G):
    strain, _ = _strains(space, law, weights, state, i, G)
    change = strain - load_state(space, state, 0, i)
    stored = equilibrium_form(law, strain, strain)
    stored, lost = _settle_branches(law.ratios, space, law, weights, state, i, count, change, stored)
    store_state(state, 0, i, strain, count)
    return stored, lost


@generic
def _settle_branches(ratios, space, law, weights, state, i, count, change, stored):
    """Stored energy [J/m^3] with that of the branches, whose strains go through the step, and what they dissipate."""


@_settle_branches.of(None)
def _without_branches(ratios, space, law, weights, state, i, count, change, stored):
    return stored, 0.0 * stored


@_settle_branches.otherwise
def _with_branches(ratios, space, law, weights, state, i, count, change, stored):
    lost = 0.0 * stored
    for j in range(len(ratios)):
        e = load_state(space, state, 1 + j, i)
        loss = weights[j, 2] * branch_form(law, e, e) + weights[j, 3] * branch_form(law, e, change)
        loss = loss + weights[j, 4] * branch_form(law, change, change)
        loss = less_free_work(law, (weights[j, 5], weights[j, 6]), e, change, loss)
        lost = lost + 2.0 * ratios[j] * loss
        e = relaxed_branch((weights[j, 0], weights[j, 1]), e, change)
        stored = stored + ratios[j] * branch_form(law, e, e)
        store_state(state, 1 + j, i, e, count)
    return stored, lost


@scalar_energy.of(Prony)
def _nothing_scalar(space, law, state, i, k, G):
    return 0.0


# --- strains -----------------------------------------------------------------------------------------------------


@register_jitable
def _strains(space, law, weights, state, i, G):
    """Strain and relaxing strain after the step."""
    strain = strain_measure(law, G)
    change = strain - load_state(space, state, 0, i)
    relaxing, factor = _relaxing_strain(law.ratios, space, weights, state, i, change, strain)
    return _elastic_bulk(law.bulk_modulus, law, factor, strain, relaxing)


@generic
def _relaxing_strain(ratios, space, weights, state, i, change, strain):
    """e~ = e + sum gamma_j e_j after the step, and sum gamma_j A_j."""


@_relaxing_strain.of(None)
def _nothing_relaxes(ratios, space, weights, state, i, change, strain):
    return strain, 0.0


@_relaxing_strain.otherwise
def _series(ratios, space, weights, state, i, change, strain):
    relaxing, factor = strain, 0.0
    for j in range(len(ratios)):
        branch = load_state(space, state, 1 + j, i)
        relaxing = relaxing + ratios[j] * relaxed_branch((weights[j, 0], weights[j, 1]), branch, change)
        factor += ratios[j] * weights[j, 1]
    return relaxing, factor


@generic
def _elastic_bulk(bulk_modulus, law, factor, strain, relaxing):
    """Both strains; with an elastic bulk, and free directions, the strain along these is history."""


@_elastic_bulk.of(None)
def _relaxing_bulk(bulk_modulus, law, factor, strain, relaxing):
    return strain, relaxing


@_elastic_bulk.otherwise
def _free_or_not(bulk_modulus, law, factor, strain, relaxing):
    return _with_lateral_strains(law.free_directions, law, factor, strain, relaxing)


@generic
def _with_lateral_strains(free_directions, law, factor, strain, relaxing):
    """Both strains with their lateral components; relaxing holds what is carried over in its 33."""


@_with_lateral_strains.of(None)
def _no_free_direction(free_directions, law, factor, strain, relaxing):
    return strain, relaxing


@_with_lateral_strains.otherwise
def _condensed(free_directions, law, factor, strain, relaxing):
    carried = relaxing[2]
    driven = SymmetricPlane(relaxing[0], (2.0 - free_directions) * relaxing[1], 0.0 * relaxing[2], relaxing[3])
    lateral = lateral_strain(law, factor, carried, strain, driven)
    return (
        with_lateral(strain, lateral, free_directions),
        with_relaxing_lateral(driven, lateral, free_directions, factor, carried),
    )
