"""Conduction on the grid: the plain sums and total heat. `test_mpm_heat` has modes and faces."""

import numpy as np
import pytest
from grid_reference import BASES, make_cloud, weights_of

from parsolid.methods.mpm import heat as grid_heat


@pytest.mark.parametrize("name, dimension", [*((name, 2) for name in BASES), ("quadratic-spline", 3)])
def test_a_step_is_the_plain_sum(name, dimension):
    particle_set = make_cloud(name, dimension)
    n = int(particle_set.cells.start[-1])
    thermal = np.random.default_rng(3).uniform(1.0, 2.0, (len(particle_set.motion), 4)) * [300.0, 1.0, 1.0, 1.0]
    w, gradient, _ = weights_of(particle_set, name)
    T, C, conductivity, power = thermal[:n].copy().T
    capacity = w.T @ C
    with np.errstate(divide="ignore", invalid="ignore"):
        nodal = np.where(capacity > 0.0, w.T @ (C * T) / capacity, 0.0)
        flow = w.T @ power - np.einsum("p,pa,pia->i", conductivity, np.einsum("i,pia->pa", nodal, gradient), gradient)
        increment = np.where(capacity > 0.0, 0.01 * flow / capacity, 0.0)
    nodes, grid = particle_set.nodes, (particle_set.basis, particle_set.cells)
    grid_heat.heat_to_grid(*grid, particle_set.motion, thermal, None, nodes)
    grid_heat.find_temperatures(len(nodes), nodes)
    grid_heat.conduct(*grid, particle_set.motion, thermal, None, None, nodes)
    grid_heat.find_increments(len(nodes), nodes, 0.01)
    gained = grid_heat.heat_to_particles(*grid, nodes, particle_set.motion, thermal)
    np.testing.assert_allclose(thermal[:n, 0], T + w @ increment, rtol=1e-10)
    assert abs(gained - 0.01 * power.sum()) < 1e-12 * (C * T).sum()
    assert abs((C * (thermal[:n, 0] - T)).sum() - 0.01 * power.sum()) < 1e-12 * (C * T).sum()


def test_what_the_grid_does_not_see_is_passed_to_it_at_the_rate_of_its_shortest_waves():
    particle_set = make_cloud("quadratic-spline", 2)
    n, step = int(particle_set.cells.start[-1]), 0.02
    rng = np.random.default_rng(4)
    thermal = rng.uniform(1.0, 2.0, (len(particle_set.motion), 4)) * [300.0, 1.0, 2e-2, 1.0]
    w, _, _ = weights_of(particle_set, "quadratic-spline")
    nodes, before = particle_set.nodes, thermal[:n].copy()
    nodes[:, 0] = rng.uniform(300.0, 600.0, len(nodes))
    T, capacity, conductivity, power = before.T
    decay = (np.pi / particle_set.cells.spacing) ** 2 * step * conductivity / capacity
    passed = (T - w @ nodes[:, 0]) * (1.0 - np.exp(-decay))
    assert 0.01 < decay.min() and decay.max() < 2.0
    found = grid_heat.pass_to_grid(particle_set.basis, particle_set.cells, nodes, particle_set.motion, thermal, step)
    assert found == pytest.approx(float(capacity @ passed), rel=1e-10)
    np.testing.assert_allclose(thermal[:n, 0], T - passed, rtol=1e-10)
    np.testing.assert_allclose(thermal[:n, 3], power + capacity * passed / step, rtol=1e-10)
