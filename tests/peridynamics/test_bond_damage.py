"""Bonds that break: the same ones from both ends and on all numbers of ranks, and what the particles lose with them."""

import numpy as np
import pytest
from bonded_body import BondedBody, lattice

from parsolid.kernels import pairs_plane, pairs_space
from parsolid.kernels.bond_damage import Stretch
from parsolid.methods.bond_damage import Crack, Limits
from parsolid.particles import FieldTable

bodies = pytest.mark.parametrize("dimension, mirror", [(2, False), (3, False), (2, True), (3, True)])
PASSES = {2: pairs_plane, 3: pairs_space}


def crumple(X):
    """A displacement that stretches some bonds by more than 20 %."""
    return 0.3 * np.sin(1.7 * X + 0.4 * X[:, ::-1])


def places(dimension):
    """identifier -> position."""
    positions, identifiers = lattice(dimension)
    return {int(identifier): X for identifier, X in zip(identifiers, positions)}


def ends_of(key, X):
    """Positions of the ends of a directed bond."""
    a, b, image = key
    end = X[b].copy()
    if image:
        end[1] *= -1.0
    return X[a], end


def crumpled(body, critical):
    """Break what a criterion breaks in the crumpled body; the failed bonds."""
    body.displace(crumple)
    body.damage.resistance[:] = critical
    failed = body.damage.inspect(Stretch(body.damage.resistance))
    if failed is not None:
        body.damage.cut(failed)
    return failed


@bodies
def test_bonds_beyond_the_critical_stretch_break_and_no_others(comm, dimension, mirror):
    body = BondedBody(comm, dimension, mirror)
    crumpled(body, 0.2)
    X, Q = places(dimension), np.where(np.arange(dimension) == 1, -1.0, 1.0)
    bonds = body.directed()
    broken = 0
    for key, weight in bonds.items():
        a, b = ends_of(key, X)
        u = crumple(np.array([X[key[0]], X[key[1]]]))
        y = b - a + (Q * u[1] if key[2] else u[1]) - u[0]
        stretch = np.linalg.norm(y) / np.linalg.norm(b - a) - 1.0
        assert (weight == 0.0) == (stretch > 0.2)
        broken += weight == 0.0
    assert 0.02 < broken / len(bonds) < 0.9


@pytest.mark.parametrize("kind", ["roller", "fixed"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_both_ends_of_a_bond_break_together(comm, dimension, kind):
    body = BondedBody(comm, dimension, True, kind)
    crumpled(body, 0.2)
    bonds = body.directed()
    assert all((bonds[b, a, image] == 0.0) == (weight == 0.0) for (a, b, image), weight in bonds.items())


@bodies
def test_what_is_left_of_a_family_is_the_sum_over_its_intact_bonds(comm, dimension, mirror):
    body = BondedBody(comm, dimension, mirror)
    crumpled(body, 0.2)
    X = places(dimension)
    shape, family, whole = body.of_owned(body.damage.intact.shape), body.of_owned(body.damage.intact.family), {}
    damage = body.of_owned(body.damage.damage)
    expected = {a: np.zeros((dimension, dimension)) for a in X}
    left = dict.fromkeys(X, 0.0)
    for key, weight in body.directed().items():
        a, b = ends_of(key, X)
        expected[key[0]] += weight * np.outer(b - a, b - a)
        whole[key[0]] = whole.get(key[0], 0.0) + 1.0 + 0.01 * key[1]
        left[key[0]] += (1.0 + 0.01 * key[1]) * (weight != 0.0)
    for a in X:
        assert shape[a] == pytest.approx(expected[a], abs=1e-12 * 100 * whole[a])
        assert family[a] == pytest.approx(left[a], abs=1e-12 * whole[a])
        assert damage[a] == pytest.approx(1.0 - left[a] / whole[a], abs=1e-12)


@bodies
def test_gradient_sums_lose_what_the_broken_bonds_gave(comm, dimension, mirror):
    body = BondedBody(comm, dimension, mirror)
    passes, width = PASSES[dimension], {2: 4, 3: 12}[dimension]
    body.displace(crumple)
    column = {2: 2, 3: 4}[dimension]
    velocity = slice(0, dimension)
    body.kinematics[:, velocity] = body.kinematics[:, column : column + dimension]

    def sums():
        result = np.zeros((body.owned + 4, width))
        for pairs, images, both in body.lists:
            wide = pairs._replace(weight=vectors(body, pairs, images))
            passes.add_gradients(0, body.owned, wide, images, both, body.kinematics, result)
        return result

    before = sums()
    body.damage.resistance[:] = 0.2
    failed = body.damage.inspect(Stretch(body.damage.resistance))
    if failed is not None:
        body.damage.subtract(failed, 0, before)
        body.damage.cut(failed)
    assert before == pytest.approx(sums(), abs=1e-11)


def vectors(body, pairs, images):
    """Weights as rows (g, 0): the vectors weight xi."""
    d = body.dimension
    row = np.repeat(np.arange(body.owned), np.diff(pairs.start))
    end = body.positions[pairs.neighbour].copy()
    if images is not None:
        end[:, 1] *= -1.0
    result = np.zeros((len(row), 4))
    result[:, :d] = pairs.weight[:, None] * (end - body.positions[row])
    return result


@bodies
def test_a_crack_breaks_the_bonds_that_cross_it(comm, dimension, mirror):
    body = BondedBody(comm, dimension, mirror)
    lower, upper = np.array([2.0, -9.0, 0.5 if dimension == 3 else -9.0]), np.array([4.0, 9.0, 3.0])
    touched = body.damage.introduce([Crack(1, 2.5, lower, upper)])
    X, cut = places(dimension), set()
    for key, weight in body.directed().items():
        crossing = False
        for sign in (1.0, -1.0):
            a, b = (np.append(end, 0.0)[:3] * (1.0, sign, 1.0) for end in ends_of(key, X))
            if (a[1] - 2.5) * (b[1] - 2.5) < 0.0:
                place = a + (2.5 - a[1]) / (b[1] - a[1]) * (b - a)
                inside = 2.0 <= place[0] <= 4.0 and (dimension == 2 or 0.5 <= place[2] <= 3.0)
                crossing = crossing or inside
        assert (weight == 0.0) == crossing
        if crossing:
            cut.add(key[0])
    mine = {int(body.identifier[i]) for i in touched}
    assert cut == set().union(*comm.allgather(mine)) and len(cut) > 5


@pytest.mark.parametrize("tip", [3.0, 4.0, 5.0])
def test_a_crack_that_ends_on_a_crossing_bond_cuts_it_from_both_ends(comm, tip):
    """On a lattice the edge of a crack at a cell's corner lies on the middle of the oblique bonds."""
    body = BondedBody(comm, 2, jitter=0.0)
    body.damage.introduce([Crack(1, 4.0, np.array([-1.0, -9.0, -9.0]), np.array([tip, 9.0, 9.0]))])
    bonds = body.directed()
    assert all((bonds[b, a, image] == 0.0) == (weight == 0.0) for (a, b, image), weight in bonds.items())
    positions, identifiers = lattice(2, 0.0)
    number = {tuple(X): int(i) for X, i in zip(positions, identifiers)}
    assert bonds[number[tip - 0.5, 3.5], number[tip + 0.5, 4.5], False] == 0.0
    assert bonds[number[tip + 0.5, 3.5], number[tip + 0.5, 4.5], False] != 0.0


@bodies
def test_bits_say_which_bonds_are_broken_whatever_the_order(comm, dimension, mirror):
    body = BondedBody(comm, dimension, mirror)
    crumpled(body, 0.2)
    body.damage.pack()
    weights = body.directed()
    fresh = BondedBody(comm, dimension, mirror)
    table = FieldTable(body.owned)
    body.damage.declare(table)
    kept = {name: values.copy() for name, values in table.checkpointed().items()}
    other = FieldTable(fresh.owned)
    fresh.damage.declare(other)
    other.restore(kept)
    restored = fresh.damage.unpack()
    assert np.array_equal(restored, body.damage.damaged())
    assert fresh.directed() == weights


@bodies
def test_bits_are_those_of_one_rank(comm, dimension, mirror):
    """The words of a particle follow from its neighbours' identifiers alone."""
    body = BondedBody(comm, dimension, mirror)
    crumpled(body, 0.2)
    body.damage.pack()
    words, bonds = body.of_owned(body.damage.words), body.directed()
    for a in words:
        neighbours = sorted((image, b) for first, b, image in bonds if first == a)
        expected = [0] * len(words[a])
        for r, (image, b) in enumerate(neighbours):
            if bonds[a, b, image] == 0.0:
                expected[r // 63] |= 1 << r % 63
        assert words[a].tolist() == expected


def test_the_dead_lose_all_bonds_at_the_next_inspection(comm):
    body = BondedBody(comm, 2, limits=Limits(0.01, 0.7))
    crumpled(body, 0.1)
    resistance = body.damage.resistance
    dead = body.of_owned(resistance[: body.owned] < 0.0)
    damage = body.of_owned(body.damage.damage)
    assert any(dead.values()) and all(dead[a] for a in damage if damage[a] > 0.7)
    body.halo.update([resistance])
    body.displace(np.zeros_like)
    failed = body.damage.inspect(Stretch(resistance))
    if failed is not None:
        body.damage.cut(failed)
    for (a, b, _), weight in body.directed().items():
        if dead[a] or dead[b]:
            assert weight == 0.0
    inverse = body.of_owned(body.damage.inverse_shape(np.arange(body.owned)))
    assert all(not inverse[a].any() for a in dead if dead[a])
