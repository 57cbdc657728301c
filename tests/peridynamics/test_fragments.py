"""A quasi-static body in pieces that nothing holds against their loads is told as such, before iterations run out."""

import numpy as np
from solids import simulation, tables

from parsolid.methods.peridynamics.fragments import largest_fragments


def pulled(x: float, by: float) -> dict:
    return {"kind": "traction", "plane": f"X = {x}", "traction": [f"{by}", "0"]}


def step_of(comm, boundaries: list, other: float = 2.0):
    """The quasi-static solver after a step of two blocks side by side, of which the first ends at X = 0 and 1."""
    data = tables(
        (10, 10),
        material={"kind": "linear-elastic", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3},
        method={"kind": "peridynamics", "solution": {"kind": "quasi-static", "step": 1.0}},
        body={"placement": "cells"},
        boundaries=boundaries,
    )
    first = data["bodies"][0]
    data["bodies"].append({**first, "shape": {"box": {"lower": [other, 0.0], "upper": [other + 1.0, 1.0]}}})
    sim = simulation(data | {"bond": [{"bodies": "all"}] if other == 1.0 else []}, comm)
    sim.take_step(0.0)
    return sim.systems[0]


def test_a_piece_that_nothing_holds_against_its_loads_is_told(comm):
    roller = {"kind": "roller", "plane": "X = 0"}
    body = step_of(comm, [roller, pulled(3, 0.01)])
    assert not body.solver.reached and body.solver.equilibrium.iterations < 300
    told = "a piece of 2 that no bond joins, 100 particles around (2.5, 0.5), that nothing holds against its loads"
    assert told in body.solver.equilibrium.fault
    assert body.advice().startswith("a support")


def test_loads_that_balance_on_each_piece_need_no_support(comm):
    body = step_of(comm, [pulled(0, -0.01), pulled(1, 0.01), pulled(2, -0.01), pulled(3, 0.01)])
    assert body.solver.reached
    # the same two blocks bonded to one, which is pulled at one end
    body = step_of(comm, [pulled(2, 0.01)], other=1.0)
    assert "a piece of the bodies, 200 particles" in body.solver.equilibrium.fault


def test_the_largest_fragments_are_those_of_all_ranks(comm):
    labels = np.random.default_rng(comm.rank).integers(0, 200, 300 + 50 * comm.rank) ** 2 // 200
    numbers, counts = np.unique(np.concatenate(comm.allgather(labels)), return_counts=True)
    expected = sorted(zip(numbers.tolist(), counts.tolist()), key=lambda one: (-one[1], one[0]))
    assert largest_fragments(comm, labels) == (len(expected), expected[:50])
