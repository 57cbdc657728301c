"""The passes over the bonds of a lattice against those over their lists."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest
from solids import simulation, tables

from parsolid.pairs import lattice_sums

ELASTIC = {"kind": "linear-elastic", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
PLANES = [{"kind": "roller", "plane": "X = 0"}, {"kind": "fixed", "plane": "Y = 0"}]
SPACE, PLANE = (13, 7, 8), (20, 14)
CASES = {
    "space": (SPACE, {"upper": (1.0, 0.5, 0.7)}, {}),
    "space, mirrored": (SPACE, {"boundaries": PLANES, "body": {"placement": "cells"}}, {}),
    "plane": (PLANE, {"boundaries": PLANES}, {"plane": "stress", "horizon_ratio": 5.0}),
}


def uses_lists(engine):
    return engine.passes is engine.bond_system


def scene(particles, method, **keys):
    material = keys.pop("material", ELASTIC)
    return tables(particles, material=material, method={"kind": "peridynamics", **method}, **keys)


@pytest.fixture(autouse=True)
def any_size(monkeypatch):
    monkeypatch.setattr(lattice_sums, "_FEWEST", 1)


@pytest.mark.parametrize("case", CASES)
def test_the_passes_are_those_of_the_lists(comm, case):
    particles, keys, method = CASES[case]
    system = simulation(scene(particles, method, **keys), comm).systems[0]
    engine, laws = system.engine, system.history.laws
    assert isinstance(engine.passes, lattice_sums.LatticeSums)
    # planes stand on places or half-way between
    assert engine.bond_system.mirror is None or engine.passes.mirrored is not None
    identifier = system.particles.owned_rows("identifier")
    # far from where it was: what moves as one has no force
    engine.field[: engine.owned] = np.random.default_rng(3).normal(size=(np.prod(particles), 3))[
        identifier, : engine.dimension
    ]
    engine.field[: engine.owned] += 1e3
    found = [engine.evaluate(laws).copy(), engine.particles.storage("pair_sums").copy()]
    engine.passes = engine.bond_system
    expected = [engine.evaluate(laws), engine.particles.storage("pair_sums")]
    for one, other in zip(found, expected):
        assert np.allclose(one, other, rtol=0.0, atol=2e-12 * np.abs(other).max())


def test_images_without_places_have_their_list(comm):
    """As where rounding takes them off the lattice."""
    particles, keys, method = CASES["space, mirrored"]
    system = simulation(scene(particles, method, **keys), comm).systems[0]
    engine = system.engine
    engine.field[: engine.owned] = np.sin(40.0 * system.particles.owned_rows("reference_position"))
    expected = engine.evaluate(system.history.laws).copy()
    engine.passes = lattice_sums._on_lattice(engine.bond_system, None)
    found = engine.evaluate(system.history.laws)
    assert engine.passes.mirrored is None
    assert np.allclose(found, expected, rtol=0.0, atol=2e-12 * np.abs(expected).max(initial=1.0))


def test_bodies_at_the_same_places_keep_their_lists():
    """Two that are not bonded: each particle has as many neighbours as on a lattice, but not those."""
    bonds = simulation(scene(SPACE, {})).systems[0].engine.bond_system
    assert lattice_sums._on_lattice(bonds, None) is not None
    twice = SimpleNamespace(
        **{name: getattr(bonds, name) for name in ("owned", "metric", "weights", "space")},
        positions=np.concatenate((bonds.positions, bonds.positions)),
        volume=np.concatenate((bonds.volume, bonds.volume)),
    )
    assert lattice_sums._on_lattice(twice, None) is None


def test_what_moves_as_one_has_no_force_at_all():
    system = simulation(scene(SPACE, {})).systems[0]
    system.engine.field[:] = np.pi
    assert not system.engine.evaluate(system.history.laws).any()


@pytest.mark.parametrize(
    "method, keys",
    [
        ({}, {"body": {"jitter": 0.1}}),
        ({"influence": "linear"}, {}),
        ({"damage": {"critical_stretch": 0.1}}, {}),
        ({"stabilisation": {"kind": "paper"}}, {}),
    ],
    ids=["irregular", "weights that vary", "bonds that break", "another control"],
)
def test_lists_stay_where_sums_are_not_those_of_a_lattice(method, keys):
    assert uses_lists(simulation(scene(SPACE, method, **keys)).systems[0].engine)


@pytest.mark.parametrize("relaxes", [True, False])
def test_bodies_that_relax_differently_have_the_forces_of_their_lists(comm, relaxes):
    control = {"kind": "shear-scaled", "relaxes": relaxes}
    solid = {"kind": "prony", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3, "strain": "finite"}
    data = scene(
        (7, 7, 8), {"stabilisation": control}, upper=(0.5, 0.5, 0.7), material=solid, body={"placement": "cells"}
    )
    other = copy.deepcopy(data["bodies"][0])
    other["shape"]["box"]["lower"][0], other["shape"]["box"]["upper"][0] = 0.5, 1.0
    other["material"]["terms"] = [{"ratio": 2.0, "tau": 0.3}]
    system = simulation(data | {"bodies": [data["bodies"][0], other]}, comm).systems[0]
    place, engine = system.particles.owned_rows("reference_position"), system.engine
    # a stabiliser that relaxes has one control for each body
    assert uses_lists(engine) == relaxes
    system.displacement[:] = 0.01 * np.sin(40.0 * place) + 0.02 * place[:, ::-1]
    found = system.history.internal_force(0.1).copy()
    engine.passes = engine.bond_system
    expected = system.history.internal_force(0.1)
    assert np.allclose(found, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())


def test_offsets_on_the_horizon_itself_stop_nothing():
    """A horizon of 2 in (.6, .8, 1): what an offset leaves of it is 0 but for rounding."""
    for size in 1.0 / np.arange(3.0, 60.0):
        metric = np.full(3, 1.0 / (2.0 * size) ** 2)
        lines = lattice_sums._lines(size * np.array([0.6, 0.8, 1.0]), metric, 1.0, np.arange(3), 3)
        assert (lines.half >= 0).all() and lines.half[1, 2] == 1


def test_lists_stay_where_they_are_as_fast(monkeypatch):
    """In the plane with few bonds each, and in small bodies."""
    assert uses_lists(simulation(scene(PLANE, {"plane": "stress"})).systems[0].engine)
    monkeypatch.setattr(lattice_sums, "_FEWEST", 1000)
    assert uses_lists(simulation(scene(SPACE, {})).systems[0].engine)
