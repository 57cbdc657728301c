"""Sweeps over boxes against dense operators, single pairs, whole boxes, and themselves on several ranks."""

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.pairs.box_weights import REACH, Axis
from tests.pairs.boxes import Case, make_box, places_of, smooth_motion

SHAPES = [(9, 8, 10), (5, 11, 3), (2, 2, 2), (3, 4, 9), (8, 8), (2, 9), (13, 5)]


def random_state(case: Case, seed: int = 3) -> tuple[np.ndarray, ...]:
    """v, x and, in box arrays, G, P, Z of a box on one rank."""
    rng, sweeps, d = np.random.default_rng(seed), case.sweeps, len(case.axes)
    v, x = smooth_motion(case.place())
    v += 0.1 * rng.standard_normal(v.shape)
    sweeps.exchange_motion(v, x)
    sweeps.P[:] = rng.standard_normal(sweeps.P.shape)
    if sweeps.Z is not None:
        sweeps.Z[:] = 0.5 + rng.random(sweeps.Z.shape)
    return v, x, np.array(case.sweeps.gradient()).reshape(d, d, -1)


def along_axis(matrix: np.ndarray, f: np.ndarray, case: Case, axis: int) -> np.ndarray:
    """A matrix applied along one axis to values (n,) of the nodes."""
    order = case.sweeps.boxes[0].axes
    shape = [case.axes[k].nodes for k in order]
    at = order.index(axis)
    return np.moveaxis(np.tensordot(matrix, f.reshape(shape), axes=(1, at)), 0, at).ravel()


def matrix_of(table: np.ndarray) -> np.ndarray:
    n = table.shape[1]
    result = np.zeros((n, n))
    for i in range(n):
        for k in range(2 * REACH + 1):
            if table[k, i] != 0.0:
                result[i, i + k - REACH] = table[k, i]
    return result


@pytest.mark.parametrize("shape", SHAPES)
def test_gradients_and_divergences_are_those_of_the_dense_operators(shape):
    case = make_box([Axis(n, 0.1 * (k + 1)) for k, n in enumerate(shape)])
    d = len(shape)
    v, _, G = random_state(case)
    force, dissipation = np.zeros((2, *v.shape))
    case.sweeps.divergence(force, dissipation)
    P = case.sweeps.P.reshape(d, d, -1)
    for c in range(d):
        div = np.zeros(v.shape[1])
        for k in range(d):
            along = int(c == k)
            grad = along_axis(matrix_of(case.tables[k].gradient[along]), v[c], case, k)
            np.testing.assert_allclose(G[c, k], grad, atol=1e-11)
            div += along_axis(matrix_of(case.tables[k].divergence[along]), P[c, k], case, k)
        np.testing.assert_allclose(force[c], case.volume * div, atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("mirror", ["", "roller", "antisymmetric"])
def test_stress_does_the_work_that_strain_takes_up(shape, mirror):
    """Adjointness to rounding, images on planes included: their nodes count half and do not move into them."""
    case = make_box([Axis(n, 0.1, ("", mirror if k == 0 else "")) for k, n in enumerate(shape)])
    d = len(shape)
    v, x, _ = random_state(case)
    on = case.index[0] == shape[0] - 1
    share = np.where(on & bool(mirror), 0.5, 1.0)
    held = {"": [], "roller": [0], "antisymmetric": list(range(1, d))}[mirror]
    v[np.ix_(held, np.flatnonzero(on))] = 0.0
    case.sweeps.exchange_motion(v, x)
    G, P = case.sweeps.gradient().reshape(d, d, -1), case.sweeps.P.reshape(d, d, -1)
    for c in range(d):
        # components of the stress that vanish on a plane by its symmetry
        free = {"": True, "roller": c == 0, "antisymmetric": c != 0}[mirror]
        if not free:
            P[c, 0, on] = 0.0
    force, dissipation = np.zeros((2, *v.shape))
    case.sweeps.divergence(force, dissipation)
    work, stored = np.sum(share * force * v), np.sum(share * case.volume * P * G)
    assert work == pytest.approx(-stored, rel=1e-12, abs=1e-12 * np.abs(case.volume * P * G).sum())


def fluxes_one_by_one(case: Case, v: np.ndarray, x: np.ndarray, G: np.ndarray) -> np.ndarray:
    """D V (d, n) [N], pair by pair, of a box without mirror planes."""
    d, shape, Z = len(case.axes), [axis.nodes for axis in case.axes], case.sweeps.Z
    number = np.empty(shape, int)
    number[tuple(case.index)] = np.arange(v.shape[1])
    result = np.zeros_like(v)
    for k in range(d):
        X, across = places_of(case.axes[k]), case.volume / case.tables[k].length[case.index[k]]
        for a in range(v.shape[1]):
            place = case.index[:, a].copy()
            if place[k] + 1 == shape[k]:
                continue
            place[k] += 1
            b = number[tuple(place)]
            u = v[:, b] - v[:, a] - 0.5 * (X[place[k]] - X[place[k] - 1]) * (G[:, k, a] + G[:, k, b])
            n = (x[:, b] - x[:, a]) / np.linalg.norm(x[:, b] - x[:, a])
            pressure, shear = Z[:, a] + Z[:, b]
            weight = case.tables[k].jump[0, 0, place[k] - 1] * case.tables[k].length[place[k] - 1] * across[a]
            flux = weight * (shear * u + (pressure - shear) * (u @ n) * n)
            result[:, a] += flux
            result[:, b] -= flux
    return result


@pytest.mark.parametrize("shape", SHAPES)
def test_dissipation_is_the_sum_of_single_fluxes(shape):
    axes = [Axis(n, 0.1) for n in shape]
    axes[0] = axes[0]._replace(places=tuple((np.linspace(0.0, 1.0, shape[0]) ** 1.1 * (shape[0] - 1)).tolist()))
    case = make_box(axes, dissipation=0.7)
    v, x, G = random_state(case)
    force, dissipation = np.zeros((2, *v.shape))
    case.sweeps.divergence(force, dissipation)
    np.testing.assert_allclose(dissipation, fluxes_one_by_one(case, v, x, G), atol=1e-12)


def test_a_box_in_the_middle_of_the_fields_writes_its_own_rows():
    alone, within = (make_box([Axis(n, 0.1) for n in (9, 8, 4)], first=first) for first in (0, 5))
    v, x = smooth_motion(alone.place())
    n, results = v.shape[1], []
    for case, first in ((alone, 0), (within, 5)):
        velocity, position = np.full((2, 3, n + 9), 1e30)
        velocity[:, first : first + n], position[:, first : first + n] = v, x
        case.sweeps.exchange_motion(velocity, position)
        case.sweeps.gradient()
        case.sweeps.P[:], case.sweeps.Z[:] = case.sweeps.G**2, 1.0
        force = np.zeros((2, 3, n + 9))
        case.sweeps.divergence(*force)
        assert not force[:, :, :first].any() and not force[:, :, first + n :].any()
        results.append(force[:, :, first : first + n])
    assert np.array_equal(*results)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("fourth", [False, True])
def test_half_a_box_at_a_roller_is_half_of_the_whole(axis, end, fourth):
    kinds = ("roller", "") if end == 0 else ("", "roller")
    half = make_box(
        [Axis(n, 0.1, kinds if k == axis else ("", "")) for k, n in enumerate((9, 8, 10))], fourth_order=fourth
    )
    counts = [9, 8, 10]
    counts[axis] = 2 * counts[axis] - 1
    whole = make_box([Axis(n, 0.1) for n in counts], fourth_order=fourth)
    # fold the whole onto the half
    plane = counts[axis] // 2
    distance = whole.index[axis] - plane
    there = whole.index.copy()
    there[axis] = np.abs(distance) if end == 0 else half.axes[axis].nodes - 1 - np.abs(distance)
    number = np.empty([one.nodes for one in half.axes], int)
    number[tuple(half.index)] = np.arange(half.index.shape[1])
    onto, flipped = number[tuple(there)], (distance < 0) if end == 0 else (distance > 0)
    v, x, _ = random_state(half)
    on = half.index[axis] == (0 if end == 0 else half.axes[axis].nodes - 1)
    v[axis, on], x[axis, on] = 0.0, half.place()[axis, on]
    half.sweeps.exchange_motion(v, x)
    G = half.sweeps.gradient().reshape(3, 3, -1)
    P = half.sweeps.P.reshape(3, 3, -1)
    for other in {0, 1, 2} - {axis}:
        P[other, axis, on] = P[axis, other, on] = 0.0
    sign = np.where(flipped, -1.0, 1.0)
    V, x_whole = v[:, onto], x[:, onto]
    V[axis] *= sign
    place = half.place()[axis, on][0]
    x_whole[axis] = place + sign * (x_whole[axis] - place)
    whole.sweeps.exchange_motion(V, x_whole)
    G_whole = whole.sweeps.gradient().reshape(3, 3, -1)
    signs = np.ones((3, 3, V.shape[1]))
    signs[axis] *= sign
    signs[:, axis] *= sign
    np.testing.assert_allclose(G_whole, signs * G[:, :, onto], atol=1e-11)
    whole.sweeps.P[:] = (signs * P[:, :, onto]).reshape(9, -1)
    whole.sweeps.Z[:] = half.sweeps.Z[:, onto]
    forces, of_whole = np.zeros((2, *v.shape)), np.zeros((2, *V.shape))
    half.sweeps.divergence(*forces)
    whole.sweeps.divergence(*of_whole)
    expected = forces[:, :, onto]
    expected[:, axis] *= sign
    np.testing.assert_allclose(of_whole, expected, atol=1e-12)


def of_pairs(case: Case, P_of: int) -> tuple[np.ndarray, ...]:
    """G, forces and dissipation of a smooth motion, by global index, on whatever ranks."""
    d = len(case.axes)
    v, x = smooth_motion(case.place())
    sweeps = case.sweeps
    sweeps.exchange_motion(v, x)
    for box in sweeps.here:
        G = sweeps.gradient()
        sweeps.P[:] = np.roll(G, P_of, axis=0) * 1e3 + G**3
        sweeps.Z[:] = np.abs(G[: len(sweeps.Z)]) + 0.1
        assert box.axes == make_box(case.axes).sweeps.boxes[0].axes
    sweeps.send_stress()
    sweeps.receive_stress()
    forces = np.zeros((2, d, v.shape[1]))
    sweeps.divergence(*forces)
    return forces


@pytest.mark.mpi
@pytest.mark.parametrize("shape", [(24, 9, 8), (13, 12, 11), (9, 30, 4), (5, 5, 5), (2, 3, 2), (25, 31), (9, 64)])
@pytest.mark.parametrize("mirrored", [False, True])
def test_ranks_have_the_same_bits(shape, mirrored):
    comm = MPI.COMM_WORLD
    axes = [Axis(n, 0.1, ("roller", "") if mirrored and k < 2 else ("", "")) for k, n in enumerate(shape)]
    alone, parts = make_box(axes), make_box(axes, comm)
    number = np.empty(shape, int)
    number[tuple(alone.index)] = np.arange(alone.index.shape[1])
    whole, mine = of_pairs(alone, 2), of_pairs(parts, 2)
    assert np.array_equal(mine, whole[:, :, number[tuple(parts.index)]])
    assert comm.allreduce(parts.index.shape[1]) == np.prod(shape)
