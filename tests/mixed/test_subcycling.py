"""Systems that take several steps in a common one: as many as they need, on any ranks, restarted."""

import numpy as np
import pytest
from mixed.tied_blocks import blocks
from mpi4py import MPI
from solids import Record, follow

from parsolid.api.simulation import Simulation as stepped
from parsolid.scene import SceneError, parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.loop import Simulation
from parsolid.simulation.time_step import TimeSteps

END = 1.5e-3
# Young's modulus [Pa] and volume [m^3] of the stiff block
STIFF, VOLUME = 1.7e10, 1.25**2


def tables(substeps, **rest) -> dict:
    """Raw tables of a soft block (SPH) tied to one of material points that is 1000 times as stiff."""
    data = blocks("sph", "points", end_time=END, **rest)
    # light nodes of fourth-order weights would take smaller steps at the tie
    data["methods"][0]["weights"] = "kernel"
    data["bodies"][1]["material"] = data["bodies"][1]["material"] | {"youngs_modulus": STIFF}
    for body in data["bodies"]:
        body["velocity"] = ["X*Y", "-0.5*X"]
    if substeps is not None:
        data["methods"][1]["substeps"] = substeps
    return data


def test_the_motion_is_that_of_the_least_step():
    record = Record(lambda sim: {"substeps": sim.systems[1].substeps})
    plain = follow(Simulation(MPI.COMM_SELF, parse_scene(tables(None))), Record(), policy=TimeSteps)
    several = follow(Simulation(MPI.COMM_SELF, parse_scene(tables("auto"))), record, policy=TimeSteps)
    assert several["substeps"][1:].min() == 6.0 and len(plain["time"]) > 5 * len(several["time"])
    assert several["tie_energy"].max() > 1e-5 * plain["kinetic"][0]
    assert several[stored_energy(several)][-1] == pytest.approx(plain[stored_energy(plain)][-1], rel=0.05)


LAW = {"density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}


@pytest.mark.parametrize("tool", [False, True])
@pytest.mark.parametrize(
    ("method", "law"),
    [
        ({"kind": "tlsph"}, "neo-hookean"),
        ({"kind": "tlsph", "integrator": "leapfrog"}, "neo-hookean"),
        ({"kind": "peridynamics"}, "linear-elastic"),
    ],
    ids=["stages", "leapfrog", "peridynamics"],
)
def test_what_impulses_of_contact_and_tools_give_to_several_steps_is_told(method, law, tool):
    """Of the energy .17 (stages) and .27 (leapfrog) came from nowhere: waves that impulses make in a stiff body."""
    bodies = []
    for name, kind, low, v, young in (("soft", "neo-hookean", -1.0, 0.06, 1.0), ("stiff", law, 0.0, -0.04, 100.0)):
        box = {"lower": [low, 0.0], "upper": [low + 0.995, 0.6]}
        body = {"name": name, "method": name, "shape": {"box": box}, "particles": [10, 6], "placement": "cells"}
        bodies.append(body | {"velocity": [v, 0.01], "material": LAW | {"kind": kind, "youngs_modulus": young}})
    methods = [{"name": "soft", "kind": "mpm", "cell": 0.2}, method | {"name": "stiff", "substeps": 7}]
    data = {"dimension": 2, "end_time": 1.0, "methods": methods, "bodies": bodies, "output": {"fields_times": []}}
    wall = {"name": "wall", "shape": {"plane": {"point": [0.996, 0.0], "normal": [-1.0, 0.0]}}, "friction": 0.2}
    data |= {"contact": [{"bodies": ["soft", "stiff"], "friction": 0.3}]} | ({"tools": [wall]} if tool else {})
    found = follow(Simulation(MPI.COMM_SELF, parse_scene(data)), Record(), policy=TimeSteps)
    assert found["contact_energy"].max() > 0.05 * found["kinetic"][0]
    assert np.abs(found["energy_error"]).max() < 1e-3 * found["kinetic"][0]


def test_a_script_may_go_on_after_any_step(comm):
    """The second call begins with the common step alone, which said nothing of the systems': an error of packing."""
    stopping, whole = (stepped(tables("auto"), comm=comm) for _ in range(2))
    for count in (1, 2, 3):
        stopping.step(count)
    whole.step(6)
    assert stopping.time == whole.time and stopping.energies() == whole.energies()


def test_one_method_has_no_common_step():
    data = tables(None)
    del data["tie"], data["bodies"][1], data["methods"][1], data["bodies"][0]["method"]
    (method,) = data.pop("methods")
    del method["name"]
    with pytest.raises(SceneError, match="method.substeps: expected no such key where no other system takes steps"):
        parse_scene(data | {"method": method | {"substeps": 2}})
