"""What the stages of a step take from the energy, found from their rates alone."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import Record

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Limits, Simulation, StopRequest

LAW = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}


def ringing(cfl: float = 0.7, **more) -> Simulation:
    """A block full of short waves, without dissipation, held at a side, far from a body that it may touch."""
    body = {"shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}}, "particles": [8, 8], "material": LAW}
    far = {"name": "far", "shape": {"box": {"lower": [5.0, 0.0], "upper": [6.0, 1.0]}}, "velocity": [0.0, 0.0]}
    waves = {"name": "block", "velocity": ["1e-4*cos(22*X)*cos(3*Y)", "1e-4*sin(19*Y)*X"]}
    data = {"dimension": 2, "end_time": 2.0, "bodies": [body | waves, body | far], "output": {"fields_times": []}}
    data["method"] = {"kind": "tlsph", "dissipation": 0.0, "cfl": cfl}
    data["boundaries"] = [{"kind": "fixed", "where": "side", "body": "block"}]
    data["regions"] = [{"name": "side", "shape": {"box": {"lower": [-1, -1], "upper": [0.1, 2]}}}]
    return Simulation(MPI.COMM_SELF, parse_scene(data | {"contact": [{"bodies": ["block", "far"]}]} | more))


def columns(simulation: Simulation) -> dict[str, np.ndarray]:
    record = Record()
    simulation.run(record, Limits(), StopRequest())
    return record.columns()


def test_what_stages_take_of_short_waves_is_what_is_gone():
    """But for 1 %: J is evolved by itself, and P knows it as det F."""
    found = columns(ringing())
    energy = found["kinetic"][0]
    gone = energy - (found["kinetic"] + found["stored"])[-1]
    assert gone > 0.02 * energy
    assert found["dissipation_numerical"][-1] == pytest.approx(gone, rel=0.02)
    assert np.abs(found["balance"]).max() < 0.02 * gone


def test_it_is_of_the_fourth_order_in_a_step():
    """(w step)^4/12 a step: of third order in a time."""
    lost = [columns(ringing(cfl))["dissipation_numerical"][-1] for cfl in (0.2, 0.1)]
    assert np.log2(lost[0] / lost[1]) == pytest.approx(3.0, abs=0.15), lost


@pytest.mark.parametrize("what", ["force", "stress"])
def test_a_wrong_force_is_not_taken_for_what_stages_take(what, monkeypatch):
    """One that is 1 % too large, or not of its stored energy."""
    simulation = ringing()
    system = simulation.systems[0]
    name = "find_forces" if what == "force" else "_sweep_gradients"
    sweep = getattr(system.lists, name)

    def wrong():
        sweep()
        (system.particles.storage("stress_force") if what == "force" else system.lists.sums)[:] *= 1.01

    monkeypatch.setattr(system.lists, name, wrong)
    found = columns(simulation)
    assert np.abs(found["balance"]).max() > 2e-3 * found["kinetic"][0]


def test_where_bodies_do_not_meet_nothing_is_told():
    simulation = ringing(contact=[])
    assert "stress_of_stage_0" not in simulation.systems[0].particles
    assert columns(simulation)["dissipation_numerical"][-1] == 0.0
