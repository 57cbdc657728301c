"""Conduction on the grid: the plain sums, total heat, the decay of a cosine, planes at given temperatures."""

import numpy as np
import pytest
from grid_reference import BASES, line, make_cloud, mirror, weights_of

from parsolid.methods.mpm import heat as grid_heat


class Conduction:
    """Steps of a particle_set's temperatures; planes are (ghost, image, sign, temperature)."""

    def __init__(self, particle_set, thermal, planes=()):
        self.particle_set, self.thermal, self.planes = particle_set, thermal, planes

    def flow(self):
        """Heat flows of the nodes."""
        nodes = self.particle_set.nodes
        nodes[:] = 0.0
        grid = self.particle_set.basis, self.particle_set.cells, self.particle_set.motion
        grid_heat.heat_to_grid(*grid, self.thermal, None, nodes)
        for ghost, image, sign, temperature in self.planes:
            grid_heat.fold_capacity(ghost, image, sign, np.full(len(ghost), (1.0 - sign) * temperature), nodes)
        grid_heat.find_temperatures(len(nodes), nodes)
        for ghost, image, sign, temperature in reversed(self.planes):
            grid_heat.unfold_temperatures(ghost, image, sign, np.full(len(ghost), (1.0 - sign) * temperature), nodes)
        grid_heat.conduct(*grid, self.thermal, None, None, nodes)
        return nodes

    def step(self, step):
        """One step; the heat gained."""
        nodes = self.flow()
        for plane in self.planes:
            grid_heat.fold_flow(*plane[:3], nodes)
        grid_heat.find_increments(len(nodes), nodes, step)
        for plane in reversed(self.planes):
            grid_heat.unfold_increments(*plane[:3], np.zeros(len(plane[0])), nodes)
        grid = self.particle_set.basis, self.particle_set.cells
        return grid_heat.heat_to_particles(*grid, nodes, self.particle_set.motion, self.thermal)


def random_thermal(particle_set):
    thermal = np.zeros((len(particle_set.motion), 4))
    thermal[:] = np.random.default_rng(3).uniform(1.0, 2.0, thermal.shape) * [300.0, 1.0, 1.0, 1.0]
    return thermal


@pytest.mark.parametrize("name, dimension", [*((name, 2) for name in BASES), ("quadratic-spline", 3)])
def test_a_step_is_the_plain_sum(name, dimension):
    particle_set = make_cloud(name, dimension)
    n, thermal = int(particle_set.cells.start[-1]), random_thermal(particle_set)
    w, gradient, _ = weights_of(particle_set, name)
    T, C, conductivity, power = thermal[:n].copy().T
    capacity = w.T @ C
    with np.errstate(divide="ignore", invalid="ignore"):
        nodal = np.where(capacity > 0.0, w.T @ (C * T) / capacity, 0.0)
        flow = w.T @ power - np.einsum("p,pa,pia->i", conductivity, np.einsum("i,pia->pa", nodal, gradient), gradient)
        increment = np.where(capacity > 0.0, 0.01 * flow / capacity, 0.0)
    gained = Conduction(particle_set, thermal).step(0.01)
    np.testing.assert_allclose(thermal[:n, 0], T + w @ increment, rtol=1e-10)
    assert abs(gained - 0.01 * power.sum()) < 1e-12 * (C * T).sum()
    assert abs((C * (thermal[:n, 0] - T)).sum() - 0.01 * power.sum()) < 1e-12 * (C * T).sum()


def cosine(kind, cells):
    """A strip with T = cos(pi x), unit diffusivity, insulated."""
    particle_set = line(kind, cells, 2)
    n = int(particle_set.cells.start[-1])
    thermal = np.zeros((len(particle_set.motion), 4))
    thermal[:n, 0] = np.cos(np.pi * particle_set.motion[:n, 0])
    thermal[:n, 1] = thermal[:n, 2] = particle_set.motion[:n, 7]
    planes = [
        (*mirror(particle_set, d, i, s), 1.0, 0.0) for d, i, s in ((0, 0, 1), (0, cells, -1), (1, 0, 1), (1, 1, -1))
    ]
    return particle_set, thermal, planes


@pytest.mark.parametrize("kind, published", [("linear", 0.0047), ("quadratic-spline", 0.012)])
def test_a_cosine_decays_at_its_rate(kind, published):
    cells, time = 20, 0.1
    particle_set, thermal, planes = cosine(kind, cells)
    n, steps = int(particle_set.cells.start[-1]), int(np.ceil(time * 8.0 * cells**2))
    conduction = Conduction(particle_set, thermal, planes)
    total = thermal[:n, 0] @ thermal[:n, 1]
    for _ in range(steps):
        conduction.step(time / steps)
    exact = np.cos(np.pi * particle_set.motion[:n, 0])
    amplitude = (thermal[:n, 0] @ exact) / (exact @ exact)
    error = amplitude / np.exp(-(np.pi**2) * time) - 1.0
    assert abs(error) < 0.015
    assert error == pytest.approx(published, rel=0.1)
    assert abs(thermal[:n, 0] @ thermal[:n, 1] - total) < 1e-12


@pytest.mark.parametrize("kind", BASES)
def test_planes_at_two_temperatures_give_the_linear_profile(kind):
    cells = 6
    particle_set, thermal, planes = cosine(kind, cells)
    n = int(particle_set.cells.start[-1])
    planes = [(*planes[0][:2], -1.0, 300.0), (*planes[1][:2], -1.0, 400.0), *planes[2:]]
    thermal[:n, 0] = 300.0 + 100.0 * particle_set.motion[:n, 0]
    before = thermal[:n, 0].copy()
    gained = Conduction(particle_set, thermal, planes).step(0.1 / cells**2)
    np.testing.assert_allclose(thermal[:n, 0], before, rtol=0.0, atol=1e-10)
    assert abs(gained) < 1e-10


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
