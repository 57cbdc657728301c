"""The sweeps over the bonds of a lattice against those over their lists."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest
from solids import simulation, tables

from parsolid.methods.peridynamics import sweeps
from parsolid.pairs import lattice_convolution

ELASTIC = {"kind": "linear-elastic", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
PLANES = [{"kind": "roller", "plane": "X = 0"}, {"kind": "fixed", "plane": "Y = 0"}]
SPACE, PLANE = (13, 7, 8), (20, 14)
CASES = {
    "space": (SPACE, {"upper": (1.0, 0.5, 0.7)}, {}),
    "space, mirrored": (SPACE, {"boundaries": PLANES, "body": {"placement": "cells"}}, {}),
    "plane": (PLANE, {"boundaries": PLANES}, {"plane": "stress", "horizon_ratio": 5.0}),
}


def scene(particles, method, **keys):
    material = keys.pop("material", ELASTIC)
    return tables(particles, material=material, method={"kind": "peridynamics", **method}, **keys)


@pytest.fixture(autouse=True)
def any_size(monkeypatch):
    monkeypatch.setattr(lattice_convolution, "_FEWEST", 1)
    monkeypatch.setattr(sweeps, "_MOST_BROKEN", 1.0)


@pytest.mark.parametrize("case", CASES)
def test_the_sweeps_are_those_of_the_lists(comm, case):
    particles, keys, method = CASES[case]
    system = simulation(scene(particles, method, **keys), comm).systems[0]
    bonds = system.pairs
    assert bonds.lattice is not None
    # planes stand on places or half-way between
    assert bonds.mirror is None or bonds.lattice.images is not None
    identifier = system.particles.owned_rows("identifier")
    # far from where it was: what moves as one has no force
    moved = np.random.default_rng(3).normal(size=(np.prod(particles), 3))[identifier, : system.dimension]
    system.displacement[:] = moved + 1e3
    found = [system.forces.internal_force(0.0).copy(), bonds.sums.copy()]
    bonds.lattice = None
    expected = [system.forces.internal_force(0.0), bonds.sums]
    for one, other in zip(found, expected):
        assert np.allclose(one, other, rtol=0.0, atol=2e-12 * np.abs(other).max())


def test_what_moves_as_one_has_no_force_at_all():
    system = simulation(scene(SPACE, {})).systems[0]
    system.displacement[:] = np.pi
    assert not system.forces.internal_force(0.0).any()


@pytest.mark.parametrize(
    "method, keys",
    [
        ({}, {"body": {"jitter": 0.1}}),
        ({"influence": "linear"}, {}),
    ],
    ids=["irregular", "weights that vary"],
)
def test_lists_stay_where_sums_are_not_those_of_a_lattice(method, keys):
    assert simulation(scene(SPACE, method, **keys)).systems[0].pairs.lattice is None


@pytest.mark.parametrize("mirror", [False, True])
def test_bonds_that_are_broken_are_left_out_of_the_lattice(comm, mirror):
    """Those of a crack from the start, those that break, and both after a restart."""
    method = {"damage": {"critical_stretch": 0.1}, "pre_cracks": [{"plane": "Y = 0.2"}]}
    data = scene(SPACE, method, **({"boundaries": [{"kind": "roller", "plane": "Y = 0"}]} if mirror else {}))
    system = simulation(data, comm).systems[0]
    x = system.particles.owned_rows("reference_position")[:, 0]
    system.displacement[:] = 0.001 * np.sin(40.0 * system.particles.owned_rows("reference_position"))
    system.displacement[:, 0] += np.where(x > 0.3, 0.03, 0.0)
    system.forces.internal_force(0.0)
    cut = comm.allreduce(system.fracture.damage.broken_count())
    assert system.fracture.ranks_find() and cut > 0.0
    system.fracture.break_bonds(SimpleNamespace(add_term=lambda name, energy: None))
    assert comm.allreduce(system.fracture.broken_bonds()) > 0.0
    bonds, found = system.pairs, [system.forces.force.copy(), system.forces.internal_force(0.0).copy()]
    system.fracture.damage.pack()
    system.fracture.damage.unpack()
    assert bonds.lattice is not None
    assert np.array_equal(system.forces.internal_force(0.0), found[1])
    bonds.lattice = None
    expected = system.forces.internal_force(0.0)
    assert np.allclose(found, expected, rtol=0.0, atol=1e-11 * comm.allreduce(np.abs(expected).max()))


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
    bond = [{"bodies": "all"}]
    system = simulation(data | {"bodies": [data["bodies"][0], other], "bond": bond}, comm).systems[0]
    place, bonds = system.particles.owned_rows("reference_position"), system.pairs
    # a control that relaxes is one for each body
    assert (bonds.lattice is None) == relaxes
    system.displacement[:] = 0.01 * np.sin(40.0 * place) + 0.02 * place[:, ::-1]
    found = system.forces.internal_force(0.1).copy()
    bonds.lattice = None
    expected = system.forces.internal_force(0.1)
    assert np.allclose(found, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())


def test_offsets_on_the_horizon_itself_stop_nothing():
    """A horizon of 2 in (.6, .8, 1): what an offset leaves of it is 0 but for rounding."""
    for size in 1.0 / np.arange(3.0, 60.0):
        offsets = lattice_convolution._offsets(size * np.array([0.6, 0.8, 1.0]) / (2.0 * size), 3)
        assert (offsets.half >= 0).all() and offsets.half[1, 0] == 1


def test_lists_stay_where_they_are_as_fast(monkeypatch):
    """In the plane with few bonds each, and in small bodies."""
    assert simulation(scene(PLANE, {"plane": "stress"})).systems[0].pairs.lattice is None
    monkeypatch.setattr(lattice_convolution, "_FEWEST", 1000)
    assert simulation(scene(SPACE, {})).systems[0].pairs.lattice is None
