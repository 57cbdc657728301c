"""Particle kernels of laws whose stress depends on the displacement gradient with tensors as history.

Those are Prony solids with an elastic bulk or of finite strain, and the hyperelastic Maxwell solids of the foundation.
The rows of a state (rows, capacity) are symmetric tensors of particles (11, 22, 33, 12, 13, 23; in the plane 11, 22,
33, 12): first what the law remembers of the deformation (the strain; C^{-1} of a Maxwell solid), then the branches'
e_j, or A_j.
"""

import numpy as np
from numba import types
from numba.extending import overload, register_jitable

from decomposition.compiled import compiled
from parsolid.materials.hyperelastic.law import equilibrium_energy, first_piola_kirchhoff_stress
from parsolid.materials.viscoelastic.maxwell import (
    branch_dissipation,
    branch_energy,
    inverse_right_cauchy_green,
    relaxation_weights,
    relaxed,
)
from parsolid.materials.viscoelastic.prony import (
    Prony,
    branch_form,
    branch_weights,
    dissipation_weights,
    equilibrium_form,
    lateral_strain,
    relaxed_branch,
    strain_measure,
    stress,
    with_lateral,
    with_relaxing_lateral,
)
from parsolid.methods.peridynamics.correspondence import store_record
from parsolid.numerics.dispatch import field_types, is_instance
from parsolid.numerics.lanes import WIDTH, lane, load, store_first
from parsolid.numerics.layout import Plane, load_correction, load_gradient
from parsolid.numerics.tensors import (
    add,
    cofactor,
    determinant,
    expand,
    gram,
    inverse_symmetric,
    lane_of_stored_symmetric,
    matmul,
    matmul_transposed,
    scale,
)

TENSOR_ROWS = {2: 4, 3: 6}


def has_tensor_history(law) -> bool:
    """Whether a law needs this module's kernels."""
    return not isinstance(law, Prony) or law.bulk_modulus is not None or law.finite_strain is not None


def initial_state(law, dimension: int) -> np.ndarray:
    """Rows (r,) of the state of an undeformed particle."""
    rows = np.zeros((1 + len(law.relaxation_times or ()), TENSOR_ROWS[dimension]))
    if not isinstance(law, Prony):
        rows[:, :3] = 1.0
    return rows.ravel()


def step_weights(law, step: float) -> np.ndarray:
    """What a step [s] does to each branch: of a Prony solid a, A and `dissipation_weights`, else `relaxation_weights`
    and the step.
    """
    if isinstance(law, Prony):
        rows = [(*branch_weights(step, time), *dissipation_weights(step, time)) for time in law.relaxation_times or ()]
        return np.array(rows).reshape(-1, 5)
    return np.array([(*relaxation_weights(step, time), step) for time in law.relaxation_times or ()]).reshape(-1, 4)


def load_tensor(space, array, row, i):
    """A symmetric tensor of particles i..i+3."""
    raise NotImplementedError


@overload(load_tensor)
def _load_tensor(space, array, row, i):
    if is_instance(space, Plane):
        return lambda space, array, row, i: (
            load(array, row, i),
            load(array, row + 1, i),
            load(array, row + 2, i),
            load(array, row + 3, i),
        )
    return lambda space, array, row, i: (
        load(array, row, i),
        load(array, row + 1, i),
        load(array, row + 2, i),
        load(array, row + 3, i),
        load(array, row + 4, i),
        load(array, row + 5, i),
    )


@register_jitable
def store_tensor_rows(array, row, i, tensor, count):
    """A symmetric tensor of the first `count` of particles i..i+3."""
    for c in range(len(tensor)):
        store_first(array, row + c, i, tensor[c] + 0.0, count)


def _add_identity(a):
    raise NotImplementedError


@overload(_add_identity)
def _add_identity_of(a):
    if len(a) == 5:
        return lambda a: (a[0] + 1.0, a[1], a[2], a[3] + 1.0, a[4] + 1.0)
    return lambda a: (a[0] + 1.0, a[1], a[2], a[3], a[4] + 1.0, a[5], a[6], a[7], a[8] + 1.0)


def _rows(space):
    raise NotImplementedError


@overload(_rows)
def _rows_of(space):
    if is_instance(space, Plane):
        return lambda space: 4
    return lambda space: 6


# --- Prony solids ------------------------------------------------------------------------------------------------


def _relaxing_strain(space, law, weights, state, i, change, strain):
    """e~ = e + sum gamma_j e_j after the step, and sum gamma_j A_j."""
    raise NotImplementedError


@overload(_relaxing_strain)
def _relaxing_strain_of(space, law, weights, state, i, change, strain):
    if isinstance(field_types(law)["ratios"], types.NoneType):
        return lambda space, law, weights, state, i, change, strain: (strain, 0.0)

    def series(space, law, weights, state, i, change, strain):
        relaxing, factor = strain, 0.0
        for j in range(len(law.ratios)):
            branch = load_tensor(space, state, _rows(space) * (1 + j), i)
            branch = relaxed_branch((weights[j, 0], weights[j, 1]), branch, change)
            relaxing = add(relaxing, scale(law.ratios[j], branch))
            factor += law.ratios[j] * weights[j, 1]
        return relaxing, factor

    return series


def _with_lateral_strains(law, factor, strain, relaxing):
    """Both strains with their lateral components, where these are history; relaxing holds what is carried over in its
    33.
    """
    raise NotImplementedError


@overload(_with_lateral_strains)
def _with_lateral_strains_of(law, factor, strain, relaxing):
    fields = field_types(law)
    if isinstance(fields["free_directions"], types.NoneType) or isinstance(fields["bulk_modulus"], types.NoneType):
        return lambda law, factor, strain, relaxing: (strain, relaxing)

    def condensed(law, factor, strain, relaxing):
        n, carried = law.free_directions, relaxing[2]
        driven = (relaxing[0], (2.0 - n) * relaxing[1], 0.0 * relaxing[2], relaxing[3])
        lateral = lateral_strain(law, factor, carried, strain, driven)
        return with_lateral(strain, lateral, n), with_relaxing_lateral(driven, lateral, n, factor, carried)

    return condensed


@register_jitable
def _prony_strains(space, law, weights, state, i, G):
    """Strain and relaxing strain after the step."""
    strain = strain_measure(law, G)
    change = add(strain, scale(-1.0, load_tensor(space, state, 0, i)))
    relaxing, factor = _relaxing_strain(space, law, weights, state, i, change, strain)
    return _with_lateral_strains(law, factor, strain, relaxing)


def _nominal(law, G, S):
    """First Piola-Kirchhoff stress: sigma itself at small strain, F S at finite strain."""
    raise NotImplementedError


@overload(_nominal)
def _nominal_of(law, G, S):
    if isinstance(field_types(law)["finite_strain"], types.NoneType):
        return lambda law, G, S: expand(S)
    return lambda law, G, S: matmul(_add_identity(G), expand(S))


# --- Maxwell solids ----------------------------------------------------------------------------------------------


def _branch_sum(space, law, weights, state, i, inverse):
    """sum mu_alpha A_alpha after the step, None without branches."""
    raise NotImplementedError


@overload(_branch_sum)
def _branch_sum_of(space, law, weights, state, i, inverse):
    if isinstance(field_types(law)["branch_moduli"], types.NoneType):
        return lambda space, law, weights, state, i, inverse: None

    def branches(space, law, weights, state, i, inverse):
        old, total = load_tensor(space, state, 0, i), scale(0.0, inverse)
        for j in range(len(law.branch_moduli)):
            A = load_tensor(space, state, _rows(space) * (1 + j), i)
            A = relaxed((weights[j, 0], weights[j, 1], weights[j, 2]), A, old, inverse)
            total = add(total, scale(law.branch_moduli[j], A))
        return total

    return branches


# --- what the passes ask -----------------------------------------------------------------------------------------


def nominal_stress(space, law, weights, state, i, G):
    """First Piola-Kirchhoff stress [Pa] after a step, from the displacement gradient; the state stays as it is."""
    raise NotImplementedError


@overload(nominal_stress)
def _nominal_stress(space, law, weights, state, i, G):
    if is_instance(law, Prony):

        def prony(space, law, weights, state, i, G):
            strain, relaxing = _prony_strains(space, law, weights, state, i, G)
            return _nominal(law, G, stress(law, strain, relaxing))

        return prony

    def maxwell(space, law, weights, state, i, G):
        F = _add_identity(G)
        H, J = cofactor(F), determinant(F)
        total = _branch_sum(space, law, weights, state, i, inverse_right_cauchy_green(H, J))
        return first_piola_kirchhoff_stress(law, F, H, J, total)

    return maxwell


def settle_state(space, law, weights, state, i, count, G):
    """Take the state of the first `count` of particles i..i+3 through a step; stored energy and loss [J/m^3]."""
    raise NotImplementedError


@overload(settle_state)
def _settle_state(space, law, weights, state, i, count, G):
    if is_instance(law, Prony):
        branched = not isinstance(field_types(law)["ratios"], types.NoneType)

        def prony(space, law, weights, state, i, count, G):
            strain, _ = _prony_strains(space, law, weights, state, i, G)
            change = add(strain, scale(-1.0, load_tensor(space, state, 0, i)))
            stored = equilibrium_form(law, strain, strain)
            lost = 0.0 * stored
            if branched:
                for j in range(len(weights)):
                    e = load_tensor(space, state, _rows(space) * (1 + j), i)
                    loss = weights[j, 2] * branch_form(law, e, e) + weights[j, 3] * branch_form(law, e, change)
                    loss = loss + weights[j, 4] * branch_form(law, change, change)
                    lost = lost + 2.0 * law.ratios[j] * loss
                    e = relaxed_branch((weights[j, 0], weights[j, 1]), e, change)
                    stored = stored + law.ratios[j] * branch_form(law, e, e)
                    store_tensor_rows(state, _rows(space) * (1 + j), i, e, count)
            store_tensor_rows(state, 0, i, strain, count)
            return stored, lost

        return prony
    branched = not isinstance(field_types(law)["branch_moduli"], types.NoneType)

    def maxwell(space, law, weights, state, i, count, G):
        F = _add_identity(G)
        H, J = cofactor(F), determinant(F)
        C, inverse, old = gram(F), inverse_right_cauchy_green(H, J), load_tensor(space, state, 0, i)
        stored = 0.0 * J
        lost = 0.0 * J
        if branched:
            old_C = inverse_symmetric(old)
            for j in range(len(weights)):
                mu, tau = law.branch_moduli[j], law.relaxation_times[j]
                A = load_tensor(space, state, _rows(space) * (1 + j), i)
                # the trapezoidal rule
                lost = lost + 0.5 * weights[j, 3] * branch_dissipation(mu, tau, old_C, old, A)
                A = relaxed((weights[j, 0], weights[j, 1], weights[j, 2]), A, old, inverse)
                lost = lost + 0.5 * weights[j, 3] * branch_dissipation(mu, tau, C, inverse, A)
                store_tensor_rows(state, _rows(space) * (1 + j), i, A, count)
        store_tensor_rows(state, 0, i, inverse, count)
        return stored, lost

    return maxwell


def scalar_energy(space, law, state, i, k, G):
    """Stored energy [J/m^3] of particle i + k that needs a logarithm, which lanes lack; 0.0 of Prony solids."""
    raise NotImplementedError


@overload(scalar_energy)
def _scalar_energy(space, law, state, i, k, G):
    if is_instance(law, Prony):
        return lambda space, law, state, i, k, G: 0.0
    branched = not isinstance(field_types(law)["branch_moduli"], types.NoneType)

    def maxwell(space, law, state, i, k, G):
        F = _add_identity(_lane_of_general(G, k))
        H, J = cofactor(F), determinant(F)
        energy = equilibrium_energy(law, F, H, J)
        if branched:
            for j in range(len(law.branch_moduli)):
                A = lane_of_stored_symmetric(load_tensor(space, state, _rows(space) * (1 + j), i), k)
                energy += branch_energy(law.branch_moduli[j], gram(F), J, A)
        return energy

    return maxwell


def _lane_of_general(a, k):
    raise NotImplementedError


@overload(_lane_of_general)
def _lane_of_general_of(a, k):
    if len(a) == 5:
        return lambda a, k: (lane(a[0], k), lane(a[1], k), lane(a[2], k), lane(a[3], k), lane(a[4] + 0.0, k))
    return lambda a, k: (
        lane(a[0], k),
        lane(a[1], k),
        lane(a[2], k),
        lane(a[3], k),
        lane(a[4], k),
        lane(a[5], k),
        lane(a[6], k),
        lane(a[7], k),
        lane(a[8], k),
    )


# without contraction of products and sums, so that stresses before and after a restart have the same bits: histories
# are stored by one kernel and read by the other
@compiled(error_model="numpy")
def nominal_records(space, first, last, law, weights, body, state, gradient, record):
    """Records P K^{-1} after a step with the weights of `step_weights`, from the gradient sums of u."""
    for i in range(first, last, WIDTH):
        L = load_correction(space, body.inverse_shape, i)
        G = scale(1.0 / load(body.volume, 0, i), matmul_transposed(load_gradient(space, gradient, i), L))
        S = matmul(nominal_stress(space, law, weights, state, i, G), L)
        store_record(space, None, body, record, i, S, G)


@compiled(error_model="numpy")
def settle_states(space, first, last, law, weights, body, state, gradient, tributary):
    """Take the states through the step whose gradient sums are given.

    tributary (capacity,) [m^3]. Returns (stored energy after it, dissipated over it [J], are all Jacobians positive).
    """
    stored, lost, sound = 0.0, 0.0, True
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        L = load_correction(space, body.inverse_shape, i)
        G = scale(1.0 / load(body.volume, 0, i), matmul_transposed(load_gradient(space, gradient, i), L))
        energy, loss = settle_state(space, law, weights, state, i, count, G)
        J = determinant(_add_identity(G))
        for k in range(count):
            stored += tributary[i + k] * (lane(energy, k) + scalar_energy(space, law, state, i, k, G))
            lost += tributary[i + k] * lane(loss, k)
            if not lane(J, k) > 0.0:
                sound = False
    return stored, lost, sound


@compiled(error_model="numpy")
def nominal_stresses(space, first, last, law, weights, body, state, gradient, result):
    """First Piola-Kirchhoff stress (n, 3, 3) [Pa] from the gradient sums of u."""
    for i in range(first, last, WIDTH):
        L = load_correction(space, body.inverse_shape, i)
        G = scale(1.0 / load(body.volume, 0, i), matmul_transposed(load_gradient(space, gradient, i), L))
        P = nominal_stress(space, law, weights, state, i, G)
        for k in range(min(WIDTH, last - i)):
            p = _lane_of_general(P, k)
            if len(p) == 5:
                result[i + k, 0, 0], result[i + k, 0, 1], result[i + k, 1, 0] = p[0], p[1], p[2]
                result[i + k, 1, 1], result[i + k, 2, 2] = p[3], p[4]
            else:
                for c in range(9):
                    result[i + k, c // 3, c % 3] = p[c]
