"""The bond-based law: forces are minus the derivative of the energy, balance each other, and do not see a rotation."""

import numpy as np
import pytest
from bonded_body import BondedBody

from parsolid.methods.peridynamics.bond_based import add_bond_forces, bond_energy
from parsolid.methods.peridynamics.fracture import failing_bonds

bodies = pytest.mark.parametrize("dimension, mirror", [(2, False), (3, False), (2, True), (3, True)])


def crumple(X):
    return 0.1 * np.sin(1.7 * X + 0.4 * X[:, ::-1])


def forces(body, linear=False):
    """Forces (owned, d) [N] and the energy of all ranks [J]."""
    d, plane = body.dimension, True if body.dimension == 2 else None
    c, share = 2.0 + 0.1 * body.identifier, np.ones(body.owned)
    force, energy = np.zeros((body.owned, 4)), 0.0
    for bonds in body.lists:
        add_bond_forces(*bonds, plane, linear, body.motion, c, force)
        energy += bond_energy(*bonds, plane, body.motion, c, share)
    return force[: body.owned, :d], body.comm.allreduce(energy)


@bodies
def test_force_is_minus_the_derivative_of_the_energy(comm, dimension, mirror):
    body = BondedBody(comm, dimension, mirror)
    body.displace(crumple)
    force, _ = forces(body)
    change = np.cos(2.3 * body.positions + body.positions[:, ::-1])
    step, energy = 1e-5, {}
    for sign in (-1.0, 1.0):
        body.displace(lambda X, move=sign * step: crumple(X) + move * change)
        energy[sign] = forces(body)[1]
    power = comm.allreduce(np.sum(force * change[: body.owned]))
    assert power == pytest.approx(-(energy[1.0] - energy[-1.0]) / (2.0 * step), rel=1e-7)


@pytest.mark.parametrize("dimension", [2, 3])
def test_momentum_and_angular_momentum_are_kept(comm, dimension):
    body = BondedBody(comm, dimension)
    body.displace(crumple)
    force, _ = forces(body)
    x = body.positions[: body.owned] + crumple(body.positions[: body.owned])
    assert comm.allreduce(force.sum(axis=0)) == pytest.approx(0.0, abs=1e-11 * np.abs(force).sum())
    moment = (x[:, :, None] * force[:, None, :]).sum(axis=0)
    moment = moment - moment.T
    assert comm.allreduce(moment) == pytest.approx(0.0, abs=1e-11 * np.abs(force).sum() * 10.0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_rotation_has_no_energy(comm, dimension):
    body = BondedBody(comm, dimension)
    turn = np.eye(dimension)
    turn[:2, :2] = [[0.6, -0.8], [0.8, 0.6]]
    body.displace(lambda X: X @ turn.T - X)
    force, energy = forces(body)
    assert energy < 1e-20 and np.abs(force).max(initial=0.0) < 1e-10


@bodies
def test_the_linear_force_is_the_derivative_at_rest(comm, dimension, mirror):
    body = BondedBody(comm, dimension, mirror)
    body.displace(lambda X: 1e-7 * crumple(X))
    force, linear = forces(body)[0], forces(body, True)[0]
    assert linear == pytest.approx(force, rel=0.0, abs=1e-5 * comm.allreduce(np.abs(force).max(initial=0.0)))


@bodies
def test_broken_bonds_bear_and_store_nothing(comm, dimension, mirror):
    body = BondedBody(comm, dimension, mirror)
    body.displace(crumple)
    before = forces(body)[1]
    body.damage.limit[:] = -1.0
    failed = failing_bonds(body.damage, None)
    if failed is not None:
        body.damage.cut(failed)
    force, energy = forces(body)
    assert before > 0.0 and energy == 0.0 and not force.any()


def test_uniform_stretch_stores_the_energy_of_the_micromodulus(comm):
    """Silling and Askari eq (20): a family stretched by s stores c s^2 / 4 times its sum of w |xi| V a volume."""
    body = BondedBody(comm, 2, jitter=0.0)
    body.displace(lambda X: 0.01 * X)
    _, energy = forces(body)
    expected = 0.0
    for bonds, _, mutual in body.lists:
        row = np.repeat(np.arange(body.owned), np.diff(bonds.start))
        distance = np.linalg.norm(body.positions[bonds.neighbour] - body.positions[row], axis=1)
        c = 2.0 + 0.05 * (body.identifier[row] + body.identifier[bonds.neighbour])
        expected += (1.0 if mutual else 0.5) * np.sum(0.5 * c * bonds.weight * distance) * 1e-4
    assert energy == pytest.approx(comm.allreduce(expected), rel=1e-9)
