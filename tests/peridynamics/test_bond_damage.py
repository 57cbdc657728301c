"""Bonds that break: the same ones from both ends and on all numbers of ranks, and how that is remembered."""

import numpy as np
import pytest
from bonded_body import BondedBody, lattice
from solids import simulation, supports, tables

from parsolid.methods.peridynamics import fracture
from parsolid.methods.peridynamics.cracks import distance, patch_of
from parsolid.methods.peridynamics.fracture import (
    EnergyCriterion,
    StoredEnergyCriterion,
    break_across,
    failing_bonds,
)
from parsolid.methods.peridynamics.settings import PreCrack
from parsolid.scene.base_model import Plane

bodies = pytest.mark.parametrize("dimension, mirror", [(2, False), (3, False), (2, True), (3, True)])


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
    body.damage.limit[:] = critical
    failed = failing_bonds(body.damage, None)
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


@bodies
def test_damage_is_the_lost_share_of_the_family(comm, dimension, mirror):
    body = BondedBody(comm, dimension, mirror)
    crumpled(body, 0.2)
    damage = body.of_owned(body.damage.damage)
    left, whole = dict.fromkeys(damage, 0.0), dict.fromkeys(damage, 0.0)
    for (a, b, _), weight in body.directed().items():
        whole[a] += 1.0 + 0.01 * b
        left[a] += (1.0 + 0.01 * b) * (weight != 0.0)
    assert damage == pytest.approx({a: 1.0 - left[a] / whole[a] for a in damage}, abs=1e-12)


@bodies
def test_a_plane_crack_breaks_the_bonds_that_cross_it_in_its_box(comm, dimension, mirror):
    body, bounds = BondedBody(comm, dimension, mirror), np.array([np.zeros(dimension), np.full(dimension, 9.0)])
    box = {"lower": [2.0, 0.0, 0.5][:dimension], "upper": [4.0, 9.0, 3.0][:dimension]}
    break_across(body.damage, [patch_of(PreCrack.model_validate({"plane": Plane(1, 2.5), "box": box}), *bounds)])
    X, number = places(dimension), 0
    for key, weight in body.directed().items():
        crossing = False
        for sign in (1.0, -1.0):
            a, b = (np.append(end, 0.0)[:3] * (1.0, sign, 1.0) for end in ends_of(key, X))
            if (a[1] - 2.5) * (b[1] - 2.5) < 0.0:
                place = a + (2.5 - a[1]) / (b[1] - a[1]) * (b - a)
                crossing |= 2.0 <= place[0] <= 4.0 and (dimension == 2 or 0.5 <= place[2] <= 3.0)
        assert (weight == 0.0) == crossing
        number += crossing
    assert number > 10


def test_an_oblique_segment_breaks_the_bonds_that_cross_it(comm):
    body = BondedBody(comm, 2)
    P, Q = np.array([1.3, 0.7]), np.array([6.1, 5.2])
    break_across(body.damage, [patch_of(PreCrack(segment=[P.tolist(), Q.tolist()]), np.zeros(2), np.ones(2))])
    X, number = places(2), 0

    def side(a, b, c):
        return np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    for key, weight in body.directed().items():
        A, B = ends_of(key, X)
        crossing = side(P, Q, A) != side(P, Q, B) and side(A, B, P) != side(A, B, Q)
        assert (weight == 0.0) == crossing
        number += crossing
    assert number > 10


def test_a_rectangle_in_space_is_the_plane_crack_of_its_box(comm):
    bounds = np.zeros(3), np.full(3, 6.0)
    stated = [
        PreCrack(rectangle=[[1.2, 2.4, 0.0], [1.2, 2.4, 3.1], [4.2, 2.4, 0.0]]),
        PreCrack(plane=Plane(1, 2.4), box={"lower": [1.2, 0.0, 0.0], "upper": [4.2, 6.0, 3.1]}),
    ]
    found = []
    for crack in stated:
        body = BondedBody(comm, 3)
        break_across(body.damage, [patch_of(crack, *bounds)])
        found.append({key for key, weight in body.directed().items() if weight == 0.0})
    assert found[0] == found[1] and len(found[0]) > 10


def test_distance_from_a_patch():
    patch = patch_of(PreCrack(segment=[[1.0, 1.0], [3.0, 1.0]]), np.zeros(2), np.ones(2))
    assert distance(patch, np.array([[2.0, 1.5], [6.0, 5.0], [0.0, 1.0]])) == pytest.approx([0.5, 5.0, 1.0])


@pytest.mark.parametrize("tip", [3.0, 4.0, 5.0])
@pytest.mark.parametrize("along", [0, 1])
def test_a_crack_cuts_the_bonds_that_pass_through_its_end_from_both_ends(comm, tip, along):
    """On a lattice the oblique bonds cross the plane of a crack at the corners and edges of cells."""
    body = BondedBody(comm, 2, jitter=0.0)
    ends = np.full((2, 2), 4.0)
    ends[:, along] = -1.0, tip
    break_across(body.damage, [patch_of(PreCrack(segment=ends.tolist()), np.zeros(2), np.ones(2))])
    positions, identifiers = lattice(2, 0.0)
    # in tenths of a spacing, which are exact
    X = {int(i): np.rint(10.0 * x).astype(int) for i, x in zip(identifiers, positions)}
    at_end = 0
    for (a, b, _), weight in body.directed().items():
        (p, f), (q, g) = X[a][[along, 1 - along]], X[b][[along, 1 - along]]
        crosses = (f - 40) * (g - 40) < 0
        # p + (40 - f)/(g - f) (q - p) <= 10 tip, without the division
        beyond = crosses * np.sign(g - f) * ((p - 10 * int(tip)) * (g - f) + (40 - f) * (q - p))
        assert (weight == 0.0) == (crosses and beyond <= 0)
        at_end += bool(crosses and beyond == 0)
    assert at_end >= 4


def test_the_dead_lose_all_bonds_at_the_next_inspection(comm):
    body = BondedBody(comm, 2, limits=(0.01, 0.7))
    crumpled(body, 0.1)
    limit = body.damage.limit
    dead = body.of_owned(limit[: body.owned] < 0.0)
    damage = body.of_owned(body.damage.damage)
    assert any(dead.values()) and all(dead[a] for a in damage if damage[a] > 0.7)
    body.halo.forward(limit).now()
    body.displace(np.zeros_like)
    failed = failing_bonds(body.damage, None)
    if failed is not None:
        body.damage.cut(failed)
    for (a, b, _), weight in body.directed().items():
        if dead[a] or dead[b]:
            assert weight == 0.0
    inverse = body.of_owned(body.particles.owned_rows("inverse_shape"))
    assert all(not inverse[a].any() for a in dead if dead[a])


@bodies
@pytest.mark.parametrize("control", [None, 1.0])
def test_stretched_bonds_beyond_the_critical_energy_break(comm, dimension, mirror, control):
    body = BondedBody(comm, dimension, mirror, "fixed")
    body.displace(crumple)
    stride, random = {2: 2, 3: 4}[dimension], np.random.default_rng(8)
    every = random.normal(size=(2, body.comm.allreduce(body.owned), dimension, dimension))
    every[1] += every[1].swapaxes(1, 2)
    rows = np.zeros((2, len(body.positions), stride * dimension))
    for number, j in np.ndindex(2, dimension):
        rows[number, :, j * stride : j * stride + dimension] = every[number, body.identifier, :, j]
    driving = body.motion.copy()
    driving[:, body.field : body.field + dimension] = np.cos(body.positions)
    body.damage.limit[:] = 0.5
    M, C = rows[0], rows[1] * (control is not None)
    failed = failing_bonds(body.damage, EnergyCriterion(driving, M, C, body.volume))
    whole = body.directed()
    if failed is not None:
        body.damage.cut(failed)
    X, R = places(dimension), np.where(np.arange(dimension) == 1, -1.0, 1.0)
    broken = 0
    for key, weight in body.directed().items():
        fails = False
        # a bond with an image is looked at from both sides of the plane
        for a, b in (key[:2], key[1::-1])[: 1 + key[2]]:
            Q, S = (-1.0, R) if key[2] else (1.0, np.ones(dimension))
            xi = S * X[b] - X[a]
            eta = Q * crumple(X[b][None])[0] - crumple(X[a][None])[0]
            force = (every[0, a] + Q * every[0, b] * S) @ xi
            if control is not None:
                force += (every[1, a] + every[1, b]) @ (Q * np.cos(X[b]) - np.cos(X[a]))
            influence = whole[key] / ((1.0 + 0.01 * a) * (1.0 + 0.01 * b))
            fails |= np.linalg.norm(xi + eta) > np.linalg.norm(xi) and 0.5 * influence * force @ eta > 0.5
        assert (weight == 0.0) == fails
        broken += fails
    assert broken > 10


@bodies
def test_bonds_that_store_more_than_the_critical_energy_break(comm, dimension, mirror):
    """Of the bond-based law, w c s^2 |xi|/2 over both volumes, s the stretch."""
    body = BondedBody(comm, dimension, mirror)
    body.displace(crumple)
    modulus = 2.0 + np.cos(body.identifier)
    body.damage.limit[:] = 0.05
    failed = failing_bonds(body.damage, StoredEnergyCriterion(modulus, body.volume))
    whole = body.directed()
    if failed is not None:
        body.damage.cut(failed)
    X, Q, broken = places(dimension), np.where(np.arange(dimension) == 1, -1.0, 1.0), 0
    for key, weight in body.directed().items():
        a, b = ends_of(key, X)
        u = crumple(np.array([X[key[0]], X[key[1]]]))
        xi = np.linalg.norm(b - a)
        stretch = np.linalg.norm(b - a + (Q * u[1] if key[2] else u[1]) - u[0]) / xi - 1.0
        influence = whole[key] / ((1.0 + 0.01 * key[0]) * (1.0 + 0.01 * key[1]))
        c = 2.0 + 0.5 * (np.cos(key[0]) + np.cos(key[1]))
        assert (weight == 0.0) == (stretch > 0.0 and 0.5 * influence * c * stretch**2 * xi > 0.05)
        broken += weight == 0.0
    assert 10 < broken < 0.9 * len(whole)


@pytest.mark.parametrize("kind, criterion", [("linear-elastic", "stretch"), ("bond-based", "energy")])
def test_bonds_fail_as_if_they_were_looked_at_in_every_step(kind, criterion, monkeypatch):
    material = {"kind": kind, "density": 1.1, "youngs_modulus": 3.0}
    material |= {"poissons_ratio": 0.3} if kind == "linear-elastic" else {}
    limit = {"critical_stretch": 0.02} if criterion == "stretch" else {"fracture_energy": 1e-4}
    method = {"kind": "peridynamics", "damage": {"criterion": criterion, **limit}}
    moved = {"kind": "velocity", "plane": "X = 1", "velocity": ["0.001", "free"]}
    data = tables((10, 6), (1.0, 0.6), material=material, method=method, body={"velocity": ["0.001*X", "0"]})
    data["boundaries"] = [*supports(X=(0.0, "fixed")), moved]
    data["end_time"] = 100.0

    def run():
        simulated = simulation(data)
        while simulated.systems[0].fracture.breaks < 3:
            assert simulated.clock.step < 400
            simulated.take_step(simulated.stable_step())
        return simulated.systems[0]

    shares, spare = [], fracture.spare
    monkeypatch.setattr(fracture, "spare", lambda *given: shares.append((spare(*given), given[-1].mean())[1]))
    displacement = run().displacement.copy()
    assert np.mean(shares) > 0.3
    monkeypatch.setattr(fracture, "spare", lambda *given: None)
    assert np.array_equal(displacement, run().displacement)
