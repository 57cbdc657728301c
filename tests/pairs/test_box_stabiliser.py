"""The stabiliser of boxes: nothing for linear fields, symmetric, the energy that it states, the same on all ranks."""

import numpy as np
import pytest
from solids import SOFT, simulation, tables


def system_of(comm, particles, weights, **rest):
    upper = [0.1 * (count - 1) for count in particles]
    data = tables(particles, upper=upper, method={"weights": weights, "integrator": "leapfrog"}, **rest)
    return simulation(data, comm).systems[0]


def product_of(system, field):
    """K_s u of a displacement (n, d) by a function of places (n, d)."""
    places = np.array(system.particles.owned_rows("reference_position"))
    result = np.zeros(places.shape)
    system.boxes.stabiliser().add_product(field(places), result)
    return places, result


@pytest.mark.parametrize(("particles", "weights"), [((9, 12), "fourth-order"), ((5, 6, 9), "cells")])
def test_linear_fields_have_none_and_it_is_symmetric(comm, particles, weights):
    system = system_of(comm, particles, weights)
    d = len(particles)
    matrix = np.array([[0.3, -0.7, 0.2], [0.5, 0.1, -0.4], [0.6, 0.9, -0.8]])[:d, :d]
    _, of_linear = product_of(system, lambda X: 0.2 + X @ matrix.T)
    scale = SOFT["youngs_modulus"]
    assert comm.allreduce(np.abs(of_linear).max(initial=0.0)) < 1e-13 * scale

    def one(X):
        return np.sin(9.0 * X + X[:, ::-1])

    def two(X):
        return np.cos(17.0 * X * X.sum(axis=1, keepdims=True))

    X, of_one = product_of(system, one)
    _, of_two = product_of(system, two)
    sums = [np.vdot(one(X), of_two), np.vdot(two(X), of_one), np.vdot(one(X), of_one)]
    forth, back, energy = comm.allreduce(np.array(sums))
    assert forth == pytest.approx(back, rel=1e-12)
    assert energy > 0.0


@pytest.mark.parametrize("weights", ["cells", "fourth-order"])
def test_the_energy_is_that_of_second_or_third_differences(comm, weights):
    """On an even lattice, and half of a body beside a plane of symmetry has half of its energy there."""
    counts, h = (9, 11), 0.1
    shear = 0.5 * SOFT["youngs_modulus"] / (1.0 + SOFT["poissons_ratio"])

    def field(X):
        return np.stack((np.sin(8.0 * X[:, 0]) * X[:, 1], np.cos(5.0 * X[:, 0] - 9.0 * X[:, 1])), axis=1)

    for roller in (False, True):
        boundaries = [{"plane": "X = 0", "kind": "roller"}] if roller else []
        X, product = product_of(system_of(comm, counts, weights, boundaries=boundaries), field)
        energy = 0.5 * comm.allreduce(np.vdot(field(X), product))
        u = field(np.stack(np.meshgrid(*(h * np.arange(n) for n in counts), indexing="ij"), -1).reshape(-1, 2))
        u, expected = u.reshape(*counts, 2), 0.0
        for axis, across in ((0, 1), (1, 0)):
            length = np.full(counts[across], h)
            ends = [0.5] if weights == "cells" else [17 / 48, 59 / 48, 43 / 48, 49 / 48]
            for k, part in enumerate(ends):
                if not (roller and across == 0):
                    length[k] *= part
                length[-1 - k] *= part
            if roller and across == 0:
                # half of whole nodes on the plane
                length[0] *= 0.5
            order, part = (2, 0.25 / (4.0 * h)) if weights == "cells" else (3, 0.5 / (18.0 * h))
            squares = (np.diff(u, order, axis=axis) ** 2).sum(axis=(axis, 2))
            expected += 0.5 * shear * part * float(length @ squares)
        assert energy == pytest.approx(expected, rel=1e-12)


def test_graded_axes(comm):
    """Slopes of uneven edges: linear fields have no energy, and rough ones have."""
    system = system_of(comm, (9, 12), "fourth-order", body={"grading": [[0.5, 1.0, 0.5], [1.0, 2.0]]})
    X, of_linear = product_of(system, lambda X: X @ np.array([[0.3, 0.5], [-0.7, 0.1]]))
    assert comm.allreduce(np.abs(of_linear).max(initial=0.0)) < 1e-13 * SOFT["youngs_modulus"]
    _, of_rough = product_of(system, lambda X: np.sin(70.0 * X))
    assert comm.allreduce(np.vdot(np.sin(70.0 * X), of_rough)) > 0.1
