"""Sums over nodes are functions of where particles are: cells that have been left change no bit of them."""

import numpy as np
import pytest
from mpm.points import crossing
from solids import Record, follow, simulation

from parsolid.methods.mpm import energies
from parsolid.simulation.loop import Limits

METHODS = {
    "musl": {"order": "musl", "flip_fraction": 0.9},
    "usl": {"order": "usl", "transfer": "flip"},
    "apic": {"order": "musl", "transfer": "apic"},
}
PUSHED = [
    {"kind": "roller", "plane": "Y = 0"},
    {"kind": "wall", "plane": "X = 0", "side": "above", "velocity": [230.0, 0.0], "name": "pusher", "reaction": True},
    {
        "kind": "velocity",
        "box": {"lower": [0.4, 0.05], "upper": [0.85, 0.4]},
        "velocity": ["150", "5"],
        "name": "gate",
        "reaction": True,
    },
]


def step_of(
    comm, method: dict, conditions: list, anew: bool, monkeypatch
) -> tuple[dict[str, np.ndarray], list[np.ndarray]]:
    """What this rank counts in the step after the twelfth, and forces that are told; anew: with cells listed once more,
    as a restart lists them."""
    sim = simulation(crossing(cells=(5, 3), **method) | {"boundaries": conditions}, comm)
    follow(sim, Record(), 12)
    system = sim.systems[0]
    if anew:
        system.migration.redistribute(system.grid.partition)
    counted: list[float] = []
    with monkeypatch.context() as patch:
        patch.setattr(energies, "nodal_energies", _kept(energies.nodal_energies, counted))
        sim.ledger.values[:] = [0.0] * len(sim.ledger.values)
        sim.run(limits=Limits(steps=1))
    return {"nodes": np.array(counted), "ledger": np.array(sim.ledger.values)}, [
        told.values.copy() for told in system.reactions
    ]


def _kept(function, values: list[float]):
    def kept(*arguments):
        values.append(function(*arguments))
        return values[-1]

    return kept


@pytest.mark.parametrize("name", METHODS)
def test_cells_that_were_left_change_no_bit_of_a_sum(comm, name, monkeypatch):
    (found, told), (wanted, expected) = (
        step_of(comm, METHODS[name], PUSHED, anew, monkeypatch) for anew in (True, False)
    )
    for key, values in wanted.items():
        assert np.array_equal(found[key], values), key
    assert len(told) == len(PUSHED) - 1 and np.array_equal(told, expected)
    # conditions act, and something is counted, on some rank
    forces = comm.allreduce(np.array([np.abs(one).sum() for one in expected]))
    assert (forces > 0.0).all() and comm.allreduce(
        float(np.abs(np.concatenate([one.ravel() for one in wanted.values()])).sum())
    ) > 0.0
