"""Particle kernels of laws whose stress depends on the displacement gradient with tensors as history.

Those are Prony solids with an elastic bulk or of finite strain, Prony series on hyperelastic solids, and the
hyperelastic Maxwell solids of the foundation; see `tensor_states` for what they implement.
"""

import numpy as np

from decomposition.compiled import compiled
from parsolid.materials.hyperelastic.law import elastic_moduli, total_modulus
from parsolid.materials.viscoelastic.hyperelastic_series import HyperelasticSeries
from parsolid.materials.viscoelastic.maxwell_lanes import relaxation_weights
from parsolid.materials.viscoelastic.prony_lanes import (
    Prony,
    branch_weights,
    dissipation_weights,
    free_work_weights,
    pressure_wave_modulus,
)
from parsolid.methods.peridynamics import (  # noqa: F401  (what they implement)
    hyperelastic_history,
    maxwell_history,
    prony_history,
)
from parsolid.methods.peridynamics.correspondence import gradient_of, store_record
from parsolid.methods.peridynamics.tensor_states import (
    TENSOR_ROWS,
    nominal_stress,
    scalar_energy,
    settle_state,
    squared_volume_ratio,
    wave_modulus,
)
from parsolid.numerics.lanes import WIDTH, lane
from parsolid.numerics.layout import load_correction
from parsolid.numerics.tensors import I, determinant, lane_of


def has_tensor_history(law) -> bool:
    """Whether a law needs this module's kernels."""
    return not isinstance(law, Prony) or law.bulk_modulus is not None or law.finite_strain is not None


def is_small_strain(law) -> bool:
    """Whether a law does not know the rotation of its solid."""
    return isinstance(law, Prony) and law.finite_strain is None


def initial_state(law, dimension: int) -> np.ndarray:
    """Rows (r,) of the state of an undeformed particle."""
    rows = np.zeros((1 + len(law.relaxation_times or ()), TENSOR_ROWS[dimension]))
    if not isinstance(law, Prony):
        rows[:, :3] = 1.0
    return rows.ravel()


def undeformed_wave_modulus(law) -> float:
    """rho c_max^2 [Pa] at rest, of all moduli before they relax."""
    if isinstance(law, Prony):
        return pressure_wave_modulus(law)
    if isinstance(law, HyperelasticSeries):
        shear, lame = elastic_moduli(law.solid)
        return (lame + 2.0 * shear) * (1.0 + sum(law.ratios))
    shear, lame = elastic_moduli(law)
    return lame + 2.0 * (shear + total_modulus(law.branch_moduli))


def step_weights(law, step: float) -> np.ndarray:
    """What a step [s] does to each branch: of a Prony solid a, A, `dissipation_weights` and `free_work_weights`, else
    `relaxation_weights` and the step.
    """
    if isinstance(law, Prony):
        kinds = (branch_weights, dissipation_weights, free_work_weights)
        rows = [sum((weights(step, time) for weights in kinds), ()) for time in law.relaxation_times or ()]
        return np.array(rows).reshape(-1, 7)
    return np.array([(*relaxation_weights(step, time), step) for time in law.relaxation_times or ()]).reshape(-1, 4)


# without contraction of products and sums, so that stresses before and after a restart have the same bits: histories
# are stored by one kernel and read by the other
@compiled(error_model="numpy")
def nominal_records(space, first, last, law, weights, body, state, gradient, record):
    """Records P K^{-1} after a step with the weights of `step_weights`, from the gradient sums of u."""
    for i in range(first, last, WIDTH):
        G = gradient_of(space, body, gradient, i)
        S = nominal_stress(space, law, weights, state, i, G) @ load_correction(space, body.inverse_shape, i)
        store_record(space, None, body, record, i, S, G)


@compiled(error_model="numpy")
def settle_states(space, first, last, law, undeformed, weights, body, state, gradient, tributary):
    """Take the states through the step whose gradient sums are given.

    tributary (capacity,) [m^3]; undeformed: rho c_max^2 [Pa] of a solid at rest. Returns (stored energy after it,
    dissipated over it [J], are all Jacobians positive, the bound of rho c_max^2 [Pa] to come: that after the step times
    (J_old/J)^4 where a particle has shrunk, for what shrinks goes on shrinking).
    """
    stored, lost, sound, largest = 0.0, 0.0, True, 0.0
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        G = gradient_of(space, body, gradient, i)
        waves = wave_modulus(space, law, undeformed, weights, state, i, G)
        J = determinant(G + I)
        ratio = squared_volume_ratio(space, law, state, i, J)
        energy, loss = settle_state(space, law, weights, state, i, count, G)
        for k in range(count):
            stored += tributary[i + k] * (lane(energy, k) + scalar_energy(space, law, state, i, k, G))
            lost += tributary[i + k] * lane(loss, k)
            # of each particle: greatest of both apart would depend on which rank has which
            largest = max(largest, lane(waves, k) * max(lane(ratio, k), 1.0) ** 2)
            if not lane(J, k) > 0.0:
                sound = False
    return stored, lost, sound, largest


@compiled(error_model="numpy")
def nominal_stresses(space, first, last, law, weights, body, state, gradient, result):
    """First Piola-Kirchhoff stress (n, 3, 3) [Pa] from the gradient sums of u."""
    for i in range(first, last, WIDTH):
        G = gradient_of(space, body, gradient, i)
        P = nominal_stress(space, law, weights, state, i, G)
        for k in range(min(WIDTH, last - i)):
            p = lane_of(P, k)
            if len(p) == 5:
                result[i + k, 0, 0], result[i + k, 0, 1], result[i + k, 1, 0] = p[0], p[1], p[2]
                result[i + k, 1, 1], result[i + k, 2, 2] = p[3], p[4]
            else:
                for c in range(9):
                    result[i + k, c // 3, c % 3] = p[c]
