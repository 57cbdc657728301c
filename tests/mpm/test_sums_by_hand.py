"""Sums of kernels over nodes and particles against numpy and derivatives: energies, powers, fits of normals."""

import numpy as np
import pytest

from parsolid.methods.mpm.contact_normals import FIT, MATRIX, Seen, add_fits, half_extent
from parsolid.methods.mpm.energies import nodal_energies
from parsolid.methods.mpm.external_forces import power, power_at_end

pytestmark = pytest.mark.serial


@pytest.mark.parametrize("with_remapped", [False, True])
def test_energies_of_changes_of_nodal_velocities(with_remapped):
    rng = np.random.default_rng(1)
    nodes, share, u = rng.normal(size=(6, 8)), rng.uniform(size=6), rng.normal(size=(6, 8))
    mass, v, a = (share * nodes[:, 3])[:, None], nodes[:, :3], nodes[:, 4:7]
    wanted = [np.sum(mass * a * (v - 0.5 * a)), 0.5 * np.sum(mass * a * a), 0.5 * np.sum(mass * a * (v - u[:, :3]))]
    found = nodal_energies(6, nodes, u if with_remapped else None, share)
    np.testing.assert_allclose(found, wanted if with_remapped else [*wanted[:2], 0.0], rtol=1e-12)


def test_powers_of_stresses_at_the_start_and_the_end_of_a_step():
    rng, step = np.random.default_rng(2), 0.2
    stress, rate = np.zeros((5, 8)), np.zeros((5, 12))
    S, L = rng.normal(size=(5, 3, 3)), 0.5 * rng.normal(size=(5, 3, 3))
    S = S + S.swapaxes(1, 2)
    stress[:, [0, 1, 2, 4, 5, 6]] = S[:, (0, 1, 2, 1, 0, 0), (0, 1, 2, 2, 2, 1)]
    rate.reshape(5, 3, 4)[:, :, :3] = L
    assert power(5, stress, rate) == pytest.approx(np.sum(S * L), rel=1e-12)
    moved = L @ np.linalg.inv(np.eye(3) + step * L)
    assert power_at_end(5, stress, rate, step) == pytest.approx(np.sum(S * moved), rel=1e-10)


def test_a_fit_of_a_normal_has_the_derivatives_of_its_loss():
    """Of share log(1 + exp(-z)), z = side fit . (1, y) - extent |fit|, for domains that are balls."""
    rng, count = np.random.default_rng(3), 7
    place, share, radius = rng.normal(size=(count, 3)), rng.uniform(0.1, 1.0, count), rng.uniform(0.1, 0.4, count)
    side = np.where(np.arange(count) % 2, 1.0, -1.0)
    form = radius[:, None] ** 2 * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    seen, shrunk = Seen(np.array([0, count]), place, share, side, form), 0.8
    assert half_extent(form[0], np.array([0.6, 0.0, 0.8])) == pytest.approx(radius[0])

    def loss(fit):
        z = side * (fit[0] + place @ fit[1:]) - shrunk * radius * np.linalg.norm(fit[1:])
        return np.sum(share * np.log1p(np.exp(-z)))

    def row_of(fit):
        result = np.zeros((1, FIT + MATRIX))
        add_fits(seen, shrunk, fit[None], np.ones(1, bool), result)
        return result[0]

    fit, h = np.array([0.2, 0.7, -0.4, 0.5]), 1e-6
    ahead, behind = (np.array([row_of(fit + sign * h * one)[:FIT] for one in np.eye(FIT)]) for sign in (1.0, -1.0))
    slopes = [(loss(fit + h * one) - loss(fit - h * one)) / (2.0 * h) for one in np.eye(FIT)]
    np.testing.assert_allclose(row_of(fit)[:FIT], slopes, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(
        row_of(fit)[FIT:], ((ahead - behind) / (2.0 * h))[np.triu_indices(FIT)], rtol=1e-5, atol=1e-7
    )
    # a node that does not move takes nothing
    still = np.zeros((1, FIT + MATRIX))
    add_fits(seen, shrunk, fit[None], np.zeros(1, bool), still)
    assert not still.any()
