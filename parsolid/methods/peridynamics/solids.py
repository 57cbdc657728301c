"""Laws of correspondence peridynamics at a particle: stress after a step, and a step's end.

A law with memory keeps symmetric tensors (11, 22, 33, 12, 13, 23) for each particle, in rows of `history` (6 + 6 terms,
n): first what it knows of the deformation before the step, then one tensor of each branch of its series,

    Prony solid              strain e, and the strains e_j of its branches' springs
    hyperelastic Maxwell     C^-1, and the A_j of its branches

`weights` (terms, k) are those of a step, of `step_weights`. In the plane F_33 = 1 and nothing else is out of it.
"""

from typing import Any

import numpy as np

from parsolid import tensors
from parsolid.kernels import exact
from parsolid.materials.hyperelastic import functions as hyperelastic
from parsolid.materials.law_functions import law_function
from parsolid.materials.viscoelastic import maxwell
from parsolid.materials.viscoelastic.prony import (
    LinearSolid,
    Prony,
    branch_form,
    branch_weights,
    dissipation_weights,
    equilibrium_form,
    free_work,
    free_work_weights,
    linear_solid,
    linear_stress,
    pressure_wave_modulus,
    strain_of,
    with_lateral,
)
from parsolid.tensors import IDENTITY

# loops over branches do not vectorise, and kernels that call functions compile several times faster than with copies
# of them
add_spherical, general, plus, times = map(exact, (tensors.add_spherical, tensors.general, tensors.plus, tensors.times))
cofactor, determinant, gram, matmul = map(exact, (tensors.cofactor, tensors.determinant, tensors.gram, tensors.matmul))
combine_symmetric, contract_symmetric = exact(tensors.combine_symmetric), exact(tensors.contract_symmetric)
determinant_symmetric, inverse_symmetric = exact(tensors.determinant_symmetric), exact(tensors.inverse_symmetric)
plus_symmetric, times_symmetric = exact(tensors.plus_symmetric), exact(tensors.times_symmetric)
relaxed, inverse_right_cauchy_green = exact(maxwell.relaxed), exact(maxwell.inverse_right_cauchy_green)
branch_energy, relaxation_loss = exact(maxwell.branch_energy), exact(maxwell.relaxation_loss)

NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@exact
def tensor_at(history, number, a):
    """Symmetric tensor `number` of a particle."""
    r = 6 * number
    return (
        history[r, a],
        history[r + 1, a],
        history[r + 2, a],
        history[r + 3, a],
        history[r + 4, a],
        history[r + 5, a],
    )


@exact
def store_tensor(history, number, a, S):
    """Store symmetric tensor `number` of a particle."""
    for c in range(6):
        history[6 * number + c, a] = S[c]


@exact
def largest_principal_value(S, plane):
    """Bound of the largest eigenvalue; sharp in the plane, whose 33 does not count."""
    if plane is not None:
        half = 0.5 * (S[0] - S[1])
        return 0.5 * (S[0] + S[1]) + (half * half + S[3] * S[3]) ** 0.5
    whole, total = contract_symmetric(S, S), S[0] + S[1] + S[2]
    # kept above rounding below 0
    return total * (1.0 / 3.0) + ((2.0 / 3.0) * (whole - total * total * (1.0 / 3.0)) + 1e-14 * whole) ** 0.5


@law_function
def stress_after(law, weights, history, a, G):
    """First Piola-Kirchhoff stress [Pa] of a particle after a step to the displacement gradient G; no history
    changes."""


@law_function
def end_of_step(law, weights, history, a, G, plane):
    """Take the history of a particle through a step to the displacement gradient G.

    Returns the stored energy after it and what was dissipated over it [J/m^3], a bound of rho c^2 [Pa] of waves after
    it, 0 of small strain, whose waves do not change, and (J_old/J)^2.
    """


# --- small strain, and Prony series --------------------------------------------------------------------------------


@exact
def strains(law, weights, history, a, G):
    """Strain and relaxing strain after a step, with their lateral components."""
    strain = strain_of(law, G)
    change = combine_symmetric(1.0, strain, -1.0, tensor_at(history, 0, a))
    relaxing, factor = strain, 0.0
    for j in range(weights.shape[0]):
        branch = combine_symmetric(weights[j, 1], tensor_at(history, 1 + j, a), weights[j, 2], change)
        relaxing = combine_symmetric(1.0, relaxing, weights[j, 0], branch)
        factor += weights[j, 0] * weights[j, 2]
    if law.lateral > 0.0:
        strain, relaxing = with_lateral(law, strain, relaxing, factor)
    return strain, relaxing


@stress_after.of(LinearSolid)
def _linear_stress_after(law, weights, history, a, G):
    strain, relaxing = strains(law, weights, history, a, G)
    P = general(linear_stress(law, strain, relaxing))
    if law.finite:
        return matmul(plus(IDENTITY, G), P)
    return P


@end_of_step.of(LinearSolid)
def _linear_end_of_step(law, weights, history, a, G, plane):
    strain, relaxing = strains(law, weights, history, a, G)
    old = tensor_at(history, 0, a)
    change = combine_symmetric(1.0, strain, -1.0, old)
    stored = equilibrium_form(law, strain, strain)
    lost = 0.0
    for j in range(weights.shape[0]):
        w, e = weights[j], tensor_at(history, 1 + j, a)
        loss = w[3] * branch_form(law, e, e) + w[4] * branch_form(law, e, change)
        loss += w[5] * branch_form(law, change, change)
        loss += free_work(law, w[6], w[7], e, change)
        lost += 2.0 * w[0] * loss
        e = combine_symmetric(w[1], e, w[2], change)
        stored += w[0] * branch_form(law, e, e)
        store_tensor(history, 1 + j, a, e)
    store_tensor(history, 0, a, strain)
    if not law.finite:
        return stored, lost, 0.0, 1.0
    # N . S N + N N : F C F^T : N N is at most the largest S and the largest stretch squared times the modulus
    F = plus(IDENTITY, G)
    waves = largest_principal_value(gram(F), plane) * law.undeformed
    waves += largest_principal_value(linear_stress(law, strain, relaxing), plane)
    J = determinant(F)
    return stored, lost, waves, determinant_symmetric(add_spherical(times_symmetric(2.0, old), 1.0)) / (J * J)


# --- hyperelastic solids with Maxwell branches ----------------------------------------------------------------------


@exact
def branch_sum(weights, history, a, inverse):
    """sum mu_j A_j [Pa] after a step to C^-1."""
    old, total = tensor_at(history, 0, a), NOTHING
    for j in range(weights.shape[0]):
        A = relaxed((weights[j, 2], weights[j, 3], weights[j, 4]), tensor_at(history, 1 + j, a), old, inverse)
        total = combine_symmetric(1.0, total, weights[j, 0], A)
    return total


@exact
def sum_of_first(weights):
    """Sum of the branches' moduli [Pa], or of their ratios."""
    total = 0.0
    for j in range(weights.shape[0]):
        total += weights[j, 0]
    return total


@stress_after.otherwise
def _maxwell_stress_after(law, weights, history, a, G):
    F = plus(IDENTITY, G)
    H, J = cofactor(F), determinant(F)
    total = branch_sum(weights, history, a, inverse_right_cauchy_green(H, J))
    branches = maxwell.branch_stress(sum_of_first(weights), total, F, H, J)
    return plus(hyperelastic.stress(law, F, H, J), branches)


@end_of_step.otherwise
def _maxwell_end_of_step(law, weights, history, a, G, plane):
    F = plus(IDENTITY, G)
    H, J = cofactor(F), determinant(F)
    C, inverse, old = gram(F), inverse_right_cauchy_green(H, J), tensor_at(history, 0, a)
    total = branch_sum(weights, history, a, inverse)
    waves = plus_symmetric(
        hyperelastic.pressure_waves(law, F, H, J), maxwell.branch_waves(sum_of_first(weights), total, H, J)
    )
    stored, lost, old_C = hyperelastic.energy(law, F, H, J), 0.0, inverse_symmetric(old)
    for j in range(weights.shape[0]):
        w, A_old = weights[j], tensor_at(history, 1 + j, a)
        A = relaxed((w[2], w[3], w[4]), A_old, old, inverse)
        lost += relaxation_loss(w[0], w[1], (w[5], w[6], w[7]), old_C, old, A_old, C, inverse, A)
        stored += branch_energy(w[0], C, J, A)
        store_tensor(history, 1 + j, a, A)
    store_tensor(history, 0, a, inverse)
    return stored, lost, largest_principal_value(waves, plane), 1.0 / (J * J * determinant_symmetric(old))


# --- what is asked of a law once, or once a step --------------------------------------------------------------------


def kernel_law(law: Any) -> Any:
    """A law as kernels take it."""
    return linear_solid(law) if isinstance(law, Prony) else law


def is_small_strain(law: Any) -> bool:
    """Whether a law does not know the rotation of its solid."""
    return isinstance(law, Prony) and law.finite_strain is None


def has_tensor_history(law: Any) -> bool:
    """Whether the stress of a law does not follow from the gradient of the relaxing displacement alone."""
    return not isinstance(law, Prony) or law.bulk_modulus is not None or law.finite_strain is not None


def series_of(law: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """gamma_j and tau_j [s] of a law's branches, of Maxwell solids relative to the equilibrium shear modulus."""
    times = law.relaxation_times or ()
    if isinstance(law, Prony):
        return law.ratios or (), times
    if not law.branch_moduli:
        return (), times
    shear = hyperelastic.elastic_moduli(law)[0]
    return tuple(modulus / shear for modulus in law.branch_moduli), times


def undeformed_wave_modulus(law: Any) -> float:
    """rho c^2 [Pa] of pressure waves at rest, of all moduli before they relax."""
    if isinstance(law, Prony):
        return pressure_wave_modulus(law)
    shear, lame = hyperelastic.elastic_moduli(law)
    return lame + 2.0 * (shear + sum(law.branch_moduli or ()))


def initial_history(law: Any) -> np.ndarray:
    """Rows of the history of an undeformed particle."""
    tensors = np.zeros((1 + len(law.relaxation_times or ()), 6))
    if not isinstance(law, Prony):
        tensors[:, :3] = 1.0
    return tensors.ravel()


def step_weights(law: Any, step: float) -> np.ndarray:
    """What a step [s] does to each branch, (terms, k).

    Of a Prony solid gamma_j and the weights of `branch_weights`, `dissipation_weights` and `free_work_weights`; else
    mu_j [Pa], tau_j [s], those of `maxwell.relaxation_weights`, and of `maxwell.loss_weights` times tau_j.
    """
    if isinstance(law, Prony):
        kinds = (branch_weights, dissipation_weights, free_work_weights)
        terms = zip(law.ratios or (), law.relaxation_times or ())
        return np.array([(ratio, *sum((of(step, tau) for of in kinds), ())) for ratio, tau in terms]).reshape(-1, 8)
    terms = zip(law.branch_moduli or (), law.relaxation_times or ())
    rows = [
        (factor, tau, *maxwell.relaxation_weights(step, tau), *(tau * w for w in maxwell.loss_weights(step, tau)))
        for factor, tau in terms
    ]
    return np.array(rows).reshape(-1, 8)
