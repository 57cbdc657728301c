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


def test_the_share_of_a_rise_that_is_passed_on():
    """Temperature and power after the pass add up to what was there; what stays has decayed as the shortest wave."""
    spacing, step, conductivity_volume, capacity = 0.1, 0.02, 0.3, 2.0
    thermal, rise = np.array([[310.0, capacity, conductivity_volume, 5.0]]), np.array([[4.0]])
    heat = grid_heat.hand_over_rise(0, 1, thermal, rise, step, spacing)
    kept = 4.0 * np.exp(-((np.pi / spacing) ** 2) * conductivity_volume / capacity * step)
    assert rise[0, 0] == pytest.approx(kept, rel=1e-12)
    assert heat == pytest.approx(capacity * (4.0 - kept), rel=1e-12)
    np.testing.assert_allclose(
        thermal[0], [310.0 - (4.0 - kept), capacity, conductivity_volume, 5.0 + heat / step], rtol=1e-12
    )
