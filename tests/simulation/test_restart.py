"""What a restart puts back: fields of the same shapes alone, sums of the ranks that there are now, the energy of the
start, also when an allowed change makes it another one."""

from types import SimpleNamespace

import numpy as np
import pytest
from solids import punch

from parsolid.collective import SolverError
from parsolid.output.errors import OutputError
from parsolid.scene import SceneError, parse_scene
from parsolid.simulation import restart as restarts
from parsolid.simulation.energy_check import EnergyCheck, EnergyLimits
from parsolid.simulation.ledger import Ledger
from parsolid.simulation.restart import Restart
from parsolid.simulation.scene_changes import contents

TERMS = {"crack": 1}
JUDGED = {"largest": 50.0, "worst": 0.5, "entered": 3.0, "growth": 0.7, "gained": 0.2, "offset": 0.03}
HEADER = {"initial_energy": 42.0, "energy_check": JUDGED, "checked_step": 4, "momenta": None, "last_step": 0.02}
HEADER |= {"jumped": True, "time": 0.3, "step": 7, "stable_step": 0.01, "interactions": ["kept"], "energy_error": 0.25}
HEADER |= {"doubts": ["it had turned too far"]}


def restart(comm, *, rows=None, same=True, allowed=(), values=None, **header) -> Restart:
    """One that has been read, by default of as many ranks as there are; rows (ranks that wrote, 4) [J]."""
    one = object.__new__(Restart)
    one.comm, one.path, one.allowed, one.notes = comm, "checkpoint.h5", allowed, []
    ledger = np.arange(4.0 * comm.size).reshape(comm.size, 4) if rows is None else rows
    one.header, one.same_ranks, one.values = HEADER | {"ledger": ledger} | header, same, values or [{}]
    return one


def simulation(energies=(0.0, 0.0)) -> SimpleNamespace:
    """What a restart fills."""
    taken = []
    return SimpleNamespace(
        ledger=Ledger(TERMS),
        energy_check=EnergyCheck(EnergyLimits(0.1, 0.2, 0.3)),
        momenta=None,
        time_steps=SimpleNamespace(),
        clock=SimpleNamespace(),
        interactions=[SimpleNamespace(set_state=taken.append)],
        doubts=[None],
        taken=taken,
        energies=lambda: energies,
    )


@pytest.mark.parametrize("terms", [3, 5])
def test_other_energy_terms_are_refused(comm, terms):
    with pytest.raises(
        SolverError, match=f"expected one with the {terms} energy terms .* checkpoint.h5, found 4; .*initial"
    ):
        restart(comm, rows=np.zeros((comm.size, terms))).apply(simulation())


def test_an_allowed_change_is_no_residual_of_the_energy(comm):
    # with its sums, the ledger's balance would be 11 + 6 - 42 and those: now it goes on as it was
    sim, one = simulation((11.0 / comm.size, 6.0 / comm.size)), restart(comm, allowed=("bodies.0.material",))
    one.apply(sim)
    assert sim.ledger.row(comm, *sim.energies())["energy_error"] == pytest.approx(0.25, abs=1e-12)
    jump = sim.ledger.initial - 42.0
    assert [note.code for note in one.notes] == ["restart-energy"] and f" {jump:.4g} J" in one.notes[0].text
    # nothing is said of nothing, nor taken where nothing was allowed
    same = restart(comm, allowed=("x",), energy_error=sim.ledger.row(comm, *sim.energies())["energy_error"] + jump)
    same.apply(sim)
    assert same.notes == [] and sim.ledger.initial == 42.0
    other = restart(comm)
    other.apply(sim)
    assert other.notes == [] and sim.ledger.initial == 42.0
    assert sim.doubts == ["it had turned too far"]


def system(**fields) -> SimpleNamespace:
    """One that keeps these fields."""
    told: list = []
    particles = SimpleNamespace(checkpointed=lambda: fields, restore=told.append)
    return SimpleNamespace(
        particles=particles,
        set_state=told.append,
        resume=lambda: told.append("resumed"),
        forget=lambda: told.append("forgotten"),
        told=told,
    )


@pytest.mark.parametrize(
    "fields",
    [
        {"stress": np.zeros((3, 2))},
        {"stress": np.zeros((3, 2)), "mass": np.zeros(3), "more": np.zeros(3)},
        {"stress": np.zeros((3, 3)), "mass": np.zeros(3)},
        {"stress": np.zeros((3, 2)), "mass": np.zeros((3, 1))},
        {"stress": np.zeros((3, 2)), "mass": np.zeros(3, int)},
    ],
)
def test_a_state_of_another_shape_is_refused(comm, fields):
    values = {"stress": np.zeros((3, 2)), "mass": np.zeros(3)}
    one = restart(comm, values=[values], allowed=("bodies.0.material",), method_state={})
    other = system(**fields)
    with pytest.raises(SolverError, match="bodies.material: "):
        one.apply_state([other], [np.arange(3)])
    assert not other.told


def test_the_same_scene_with_other_fields_is_of_another_version(comm):
    values = {"stress": np.zeros((3, 2)), "mass": np.zeros(3)}
    other = system(stress=values["stress"], moved=np.zeros(3))
    words = "checkpoint.h5: expected .* this version .*: moved is missing, mass is too much"
    with pytest.raises(SolverError, match=words):
        restart(comm, values=[values], method_state={}).apply_state([other], [np.arange(3)])
    assert not other.told


def test_systems_and_the_time_are_compared_besides_the_scene(comm):
    scene = parse_scene(punch(end_time=0.5))
    one = restart(comm, scene=contents(scene))
    one.check(scene)
    assert one.notes == []
    with pytest.raises(SolverError, match="method: expected as many as in the checkpoint, 2, found 1"):
        restart(comm, values=[{}, {}], scene=contents(scene)).check(scene)
    one = restart(comm, scene=contents(scene), time=0.5)
    one.check(scene)
    with pytest.raises(SceneError, match=r"end_time: expected at least 0.5 s, .*checkpoint.h5, found 0.4 s"):
        one.check(parse_scene(punch(end_time=0.4)))


def test_a_file_without_what_is_needed_is_no_checkpoint_of_a_run(comm, shared_path, monkeypatch):
    monkeypatch.setattr(restarts, "read_checkpoint", lambda *_: (HEADER, [], np.zeros((1, 3))))
    with pytest.raises(
        OutputError, match="checkpoint.h5: expected the checkpoint of a run, found one without errors, "
    ):
        Restart(comm, shared_path / "checkpoint.h5")
