"""Lists of pairs with tables of weights: the forces of lists, exact gradients, and where there are none."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import SOFT, random_of, simulation, supports, tables

from parsolid.methods.tlsph.displacement import displacement_gradient
from parsolid.pairs import smoothed_weights
from parsolid.pairs.axis_lists import neighbours_in
from parsolid.pairs.lists import InnerTable
from parsolid.pairs.passes import Vector
from parsolid.pairs.smoothed_weights import SmoothedWeights
from parsolid.pairs.weight_tables import is_tabled

ROLLERS = supports(X=(0.0, "roller"), Y=(0.0, "roller"))
SIZES = {2: (22, 20), 3: (9, 8, 9)}


def leap(dimension, boundaries=(), body=None, lower=0.0, **method) -> dict:
    """A box of unequal spacings that moves by one force evaluation a step."""
    velocity = ["0.1*sin(X)*Y", "0.1*cos(X)", "0.1*X*Y"][:dimension]
    extent = ([lower + size for size in (1.2, 0.9, 1.0)[:dimension]], [lower] * dimension)
    method = {"integrator": "leapfrog"} | method
    body = {"velocity": velocity} | (body or {})
    return tables(SIZES[dimension], *extent, material=SOFT, method=method, body=body, boundaries=list(boundaries))


def forces(sim) -> list[np.ndarray]:
    """Of the stresses and of the dissipation after a step, this rank's."""
    sim.take_step(1e-3)
    return [np.array(sim.systems[0].particles.owned_rows(name)) for name in ("stress_force", "dissipative_force")]


def difference(some, others, comm) -> float:
    """Greatest one over the greatest value."""
    scale = comm.allreduce(max(np.abs(one).max(initial=0.0) for one in others), MPI.MAX)
    most = max(np.abs(one - other).max(initial=0.0) for one, other in zip(some, others))
    return comm.allreduce(most, MPI.MAX) / scale


@pytest.mark.parametrize(
    ("dimension", "method"), [(2, {}), (2, {"dissipation": 0.0}), (3, {}), (3, {"reconstruction": False})]
)
def test_lists_with_tables_have_the_forces_of_lists(dimension, method, comm, monkeypatch):
    data = leap(dimension, ROLLERS, **method)
    monkeypatch.setattr(smoothed_weights, "in_blocks", lambda inner, dimension: None)
    tabled = simulation(data, comm)
    pairs = tabled.systems[0].pairs
    assert isinstance(pairs.inner, InnerTable) and (pairs.rim is None or is_tabled(pairs.rim))
    assert sum(array.nbytes for array in pairs.inner[1:3]) == 6 * len(pairs.inner.neighbour)
    monkeypatch.setattr(smoothed_weights, "by_tables", lambda *lists: None)
    listed = simulation(data, comm)
    assert not is_tabled(listed.systems[0].pairs.inner)
    assert tabled.systems[0].directed_pairs == listed.systems[0].directed_pairs
    found = forces(tabled), forces(listed)
    for one, other in zip(*found):
        if comm.allreduce(float(np.abs(other).sum())) > 0.0:
            # what reconstruction leaves of a smooth jump has its rounding
            assert difference([one], [other], comm) < 1e-12
    assert (method.get("dissipation") == 0.0) == (comm.allreduce(float(np.abs(found[0][1]).sum())) == 0.0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_rounding_of_the_weights_changes_forces_by_as_little(dimension, comm, monkeypatch):
    rounded = forces(simulation(leap(dimension), comm))
    plain = SmoothedWeights.__init__
    monkeypatch.setattr(SmoothedWeights, "__init__", lambda self, *rest: plain(self, *rest[:4]))
    exact = simulation(leap(dimension), comm)
    assert not is_tabled(exact.systems[0].pairs.inner)
    assert 1e-10 < difference(rounded, forces(exact), comm) < 1e-7


@pytest.mark.parametrize("lower", [0.0, 1e5], ids=["here", "far away"])
def test_gradients_and_jumps_of_linear_fields_are_exact(lower, comm):
    # far away places themselves are rounded: to 1e-10 of a spacing
    sim = simulation(leap(3, lower=lower), comm)
    system, tolerance = sim.systems[0], 1e-12 if lower == 0.0 else 1e-8
    inner = system.pairs.inner
    assert len(getattr(inner, "others", inner).table) < 1500
    A = np.random.default_rng(3).normal(size=(3, 3))
    rows = system.particles.owned_rows
    rows("position")[:] += (rows("reference_position") - lower) @ A.T
    found = displacement_gradient(system)
    np.testing.assert_allclose(found, np.tile(A.ravel(), (len(found), 1)), atol=tolerance)
    rows("velocity")[:] = (rows("reference_position") - lower) @ A.T
    system.leapfrog.evaluate()
    jumps = np.abs(rows("dissipative_force")).max(initial=0.0)
    rows("velocity")[:] = random_of(rows("identifier"), 3)
    system.leapfrog.evaluate()
    assert jumps < tolerance * np.abs(rows("dissipative_force")).max(initial=0.0)


def test_no_rank_rounds_what_another_does_not(comm):
    """A lattice beside a body of a kernel: of several ranks one has the lattice alone, along axes."""
    data = leap(3, body={"particles": [12, 5, 5]}, weights="best")
    beside = {"lower": [3.0, 0.0, 0.0], "upper": [3.4, 0.9, 1.0]}
    data["bodies"].append(data["bodies"][0] | {"shape": {"box": beside}, "particles": [4, 5, 5], "placement": "cells"})
    sim = simulation(data, comm)
    assert sim.systems[0].body_weights == ["fourth-order", "kernel"]
    assert not is_tabled(sim.systems[0].pairs.inner)
    dissipative = forces(sim)[1]
    total = np.abs(comm.allreduce(dissipative.sum(axis=0))).max()
    assert total < 1e-11 * comm.allreduce(np.abs(dissipative).max(initial=0.0), MPI.MAX)


def test_there_are_tables_where_few_weights_differ_and_one_evaluation_a_step(comm):
    # without blocks
    plain = {"reconstruction": False}
    pairs = simulation(leap(2, **plain), comm).systems[0].pairs
    neighbours, tabled = neighbours_in(pairs.inner, pairs.owned), is_tabled(pairs.inner)
    assert tabled and neighbours.max() == 8
    with pytest.raises(TypeError, match="with tables"):
        next(pairs.lists())
    with pytest.raises(TypeError, match="first columns"):
        pairs.gradient(None, (Vector(4),))
    for other in (
        leap(2, body={"jitter": 0.2}, **plain),
        leap(2, reference="updated", update_every=5, **plain),
        leap(2, integrator="ssp-rk3", **plain),
    ):
        assert not is_tabled(simulation(other, comm).systems[0].pairs.inner)
