"""The law's functions on four particles at once against plain numbers, in plane strain and in space."""

import numpy as np
import pytest

from decomposition.compiled import compiled
from parsolid.materials.hyperelastic import evaluation
from parsolid.materials.hyperelastic.hyperbolicity import branch_sum, dissipation_rates, polyconvex_state
from parsolid.materials.hyperelastic.law import (
    first_piola_kirchhoff_stress,
    isotropic_shear_modulus,
    pressure_wave_tensor,
    shear_wave_tensor,
)
from parsolid.materials.hyperelastic.mooney_rivlin import MooneyRivlin
from parsolid.materials.viscoelastic.maxwell_lanes import (
    branch_dissipation,
    inverse_right_cauchy_green,
    relaxation_weights,
    relaxed,
)
from parsolid.methods.tlsph.deformation import current_branches
from parsolid.numerics.lanes import lane
from parsolid.numerics.layout import LAYOUT, load_branch, load_deformation
from parsolid.numerics.tensors import add, gram, lane_of_general, lane_of_stored_symmetric, scale

LAWS = {
    "neo-hookean": MooneyRivlin(1100.0, 3.0, None, 7.0, (2.0, 5.0), (0.1, 3.0)),
    "mooney-rivlin": MooneyRivlin(1100.0, 3.0, 2.0, 7.0, (2.0, 5.0), (0.1, 3.0)),
}
TENSOR = {2: [0, 1, 3, 4], 3: list(range(9))}
SYMMETRIC = {2: [0, 1, 3], 3: list(range(6))}
STORED = {2: [0, 1, 2, 3], 3: list(range(6))}
GENERAL = {2: [0, 1, 3, 4, 8], 3: list(range(9))}


@pytest.fixture(params=[2, 3], ids=["plane strain", "space"])
def dimension(request):
    """Dimension of the state."""
    return request.param


def in_plane(tensors):
    """The same with nothing but 1 out of the plane."""
    tensors = tensors.copy()
    tensors[..., 2, :], tensors[..., :, 2] = 0.0, 0.0
    tensors[..., 2, 2] = 1.0
    return tensors


@pytest.fixture
def particles(law, dimension, random_deformation, random_branches):
    """State of four particles, and the arrays in which the solver keeps it."""
    F, A = random_deformation(40), random_branches(4, len(law.branch_moduli or ()) or 1)
    if dimension == 2:
        F, A = in_plane(F), in_plane(A)
    F = F[np.linalg.det(F) > 0.2][:4]
    state = polyconvex_state(law, F, A if law.branch_moduli else None)
    rows = evaluation.general_rows(F)[:, TENSOR[dimension]]
    cofactors = evaluation.general_rows(state.H) if dimension == 3 else np.empty((4, 0))
    deformation = np.ascontiguousarray(np.hstack([rows, cofactors, state.J[:, None]]).T)
    branches = np.ascontiguousarray(evaluation.symmetric_rows(A)[:, SYMMETRIC[dimension]].reshape(4, -1).T)
    return state, deformation, branches if law.branch_moduli else None


@compiled
def wave_and_stress(space, law, deformation, branches, stress, pressure, shear):
    F, H, J = load_deformation(space, deformation, 0)
    viscous = current_branches(space, law, branches, 0, F)
    P = first_piola_kirchhoff_stress(law, F, H, J, viscous)
    Q, S = pressure_wave_tensor(law, F, H, J, viscous), shear_wave_tensor(law, F, viscous)
    # plain factors, so that entries which are numbers become lanes
    one = J / J
    Q, S = scale(one, Q), scale(one, S)
    for k in range(4):
        p, q, s = lane_of_general(P, k), lane_of_stored_symmetric(Q, k), lane_of_stored_symmetric(S, k)
        for c in range(len(p)):
            stress[k, c] = p[c]
        for c in range(len(q)):
            pressure[k, c], shear[k, c] = q[c], s[c]


def test_stress_and_wave_tensors(law, dimension, particles):
    state, deformation, branches = particles
    count = {2: (5, 4), 3: (9, 6)}[dimension]
    stress, pressure, shear = np.empty((4, count[0])), np.empty((4, count[1])), np.empty((4, count[1]))
    wave_and_stress(LAYOUT[dimension], law, deformation, branches, stress, pressure, shear)
    viscous = branch_sum(law, state)
    expected = evaluation.first_piola_kirchhoff_stress(law, state.F, state.H, state.J, viscous)
    assert stress == pytest.approx(evaluation.general_rows(expected)[:, GENERAL[dimension]], rel=1e-13, abs=1e-13)
    expected = evaluation.pressure_wave_tensor(law, state.F, state.H, state.J, viscous)
    assert pressure == pytest.approx(evaluation.symmetric_rows(expected)[:, STORED[dimension]], rel=1e-13, abs=1e-13)
    expected = evaluation.shear_wave_tensor(law, state.F, viscous)
    assert shear == pytest.approx(evaluation.symmetric_rows(expected)[:, STORED[dimension]], rel=1e-13, abs=1e-13)


@compiled
def branches_on_lanes(space, law, deformation, branches, weights, dissipation, new):
    F, H, J = load_deformation(space, deformation, 0)
    A = load_branch(space, branches, 0, 0)
    inverse = inverse_right_cauchy_green(H, J)
    rate = branch_dissipation(law.branch_moduli[0], law.relaxation_times[0], gram(F), inverse, A)
    later = relaxed(weights, A, inverse, add(inverse, scale(0.1, A)))
    for k in range(4):
        dissipation[k] = lane(rate, k)
        values = lane_of_stored_symmetric(scale(J / J, later), k)
        for c in range(len(values)):
            new[k, c] = values[c]


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_branches(law, dimension, particles):
    state, deformation, branches = particles
    dissipation, new = np.empty(4), np.empty((4, len(STORED[dimension])))
    weights = relaxation_weights(0.2, 0.3)
    branches_on_lanes(LAYOUT[dimension], law, deformation, branches, weights, dissipation, new)
    assert dissipation == pytest.approx(dissipation_rates(law, state)[:, 0], rel=1e-11)
    A = np.linalg.inv(state.Y[:, 0])
    inverse = np.linalg.inv(np.swapaxes(state.F, 1, 2) @ state.F)
    expected = weights[0] * A + weights[1] * inverse + weights[2] * (inverse + 0.1 * A)
    assert new == pytest.approx(evaluation.symmetric_rows(expected)[:, STORED[dimension]], rel=1e-13, abs=1e-13)


@compiled
def shear_modulus(law):
    return isotropic_shear_modulus(law)


def test_shear_modulus_is_given_only_where_it_does_not_depend_on_direction(law):
    expected = 2.0 * law.xi if law.zeta is None and law.branch_moduli is None else None
    assert shear_modulus(law) == expected
    assert (isotropic_shear_modulus(law) is None) == (expected is None)
