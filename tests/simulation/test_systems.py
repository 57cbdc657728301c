"""Two systems in one simulation: each is what it is alone, energies add, the step is the least, a restart has the
same bits.
"""

from itertools import pairwise

import h5py
import numpy as np
import pytest
from solids import Record, StableSteps, follow, run_into
from systems import BONDS, SPH, STIFF, plate, raw, two_systems

from parsolid.api.report import report_of
from parsolid.collective import SolverError, minimum
from parsolid.methods.interaction import Interaction
from parsolid.observables.declared import Observables
from parsolid.output.checkpoint import read_checkpoint
from parsolid.output.history import read_history
from parsolid.scene import parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.history import Probes
from parsolid.simulation.loop import Simulation
from parsolid.simulation.restart import Restart

LEFT, RIGHT = plate("left", 0.0), plate("right", 5.0, STIFF)
# one step for all runs
SHORT = {"maximum_step": 2e-5}
METHODS = {"tlsph": SPH | SHORT, "peridynamics": BONDS | SHORT}


def pair(second: str) -> dict:
    """Raw tables of both plates; the second body is for another system."""
    return raw(LEFT, RIGHT, method=METHODS["tlsph"])


def both(second: str, comm, restart=None) -> Simulation:
    return Simulation(comm, two_systems(pair(second), METHODS[second]), restart)


def alone(body: dict, kind: str, comm) -> Simulation:
    return Simulation(comm, parse_scene(raw(body, method=METHODS[kind])))


def state(system) -> dict[str, np.ndarray]:
    return {name: np.array(rows) for name, rows in system.particles.checkpointed().items()}


@pytest.fixture(params=METHODS)
def second(request):
    """The method of the second body."""
    return request.param


def test_each_system_is_what_it_is_alone_and_energies_add_exactly(comm, second):
    comm = comm.Split(comm.rank)
    sims = [both(second, comm), alone(LEFT, "tlsph", comm), alone(RIGHT, second, comm)]
    together, *single = (follow(sim, Record(lambda s: {"own": s.energies()}), 20) for sim in sims)
    assert sims[0].particles == 128 and [system.bodies for system in sims[0].systems] == [(0,), (1,)]
    for index, sim in enumerate(sims[1:]):
        wanted = state(sim.systems[0])
        found = state(sims[0].systems[index])
        shift = found.pop("identifier") - wanted.pop("identifier")
        assert np.all(shift == 64 * index) and list(found) == list(wanted)
        assert all(found[name].tobytes() == wanted[name].tobytes() for name in wanted)
    assert np.array_equal(together["time"], single[0]["time"])
    assert np.array_equal(together["own"], single[0]["own"] + single[1]["own"])
    assert np.abs(together[stored_energy(together)]).max() > 0.01 * together["kinetic"][0]


def test_the_ledger_is_the_sum_of_those_of_the_systems_alone(comm, second):
    sims = [both(second, comm), alone(LEFT, "tlsph", comm), alone(RIGHT, second, comm)]
    together, *single = (follow(sim, Record(), 20) for sim in sims)
    for name, found in together.items():
        # a method's own terms are only in its ledger
        parts = [columns[name] for columns in single if name in columns]
        wanted = sum(parts) if name != "time" else parts[0]
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-12 * np.abs(together["kinetic"]).max())


def test_the_step_is_the_least_of_all_systems(comm):
    sim = Simulation(comm, two_systems(raw(LEFT, RIGHT), BONDS))
    least = [minimum(comm, system.stable_step()) for system in sim.systems]
    assert abs(least[0] / least[1] - 1.0) > 0.1
    times = follow(sim, Record(), 3)["time"]
    assert times[1] == min(least)
    limited = Simulation(comm, two_systems(raw(LEFT, RIGHT), BONDS | {"maximum_step": 1e-6}))
    assert follow(limited, Record(), 2)["time"].tolist() == [0.0, 1e-6, 2e-6]


def test_a_jump_of_one_system_is_a_step_of_length_zero_for_all(comm):
    pulled = [{"plane": "X = 5", "kind": "fixed"}, {"plane": "X = 6", "kind": "traction", "traction": ["1e4", "0"]}]
    statics = {"kind": "peridynamics", "solution": {"kind": "quasi-static", "step": 1e-5}}
    data = raw(LEFT, plate("right", 5.0, placement="cells") | {"velocity": [0.0, 0.0]})
    scene = two_systems(data, statics)
    pull = parse_scene(raw(data["bodies"][1], method=statics) | {"boundaries": pulled}).boundaries
    named = [boundary.model_copy(update={"body": "right"}) for boundary in pull]
    scene = type(scene).model_construct(**(dict(scene) | {"boundaries": [*scene.boundaries, *named]}))
    sim = Simulation(comm, scene)
    before = state(sim.systems[0])
    columns = follow(sim, Record(), 1)
    assert columns["time"].tolist() == [0.0, 0.0] and sim.systems[1].jumps == (0.0,)
    # the other system has not moved, the one that is pulled has
    for name, values in state(sim.systems[0]).items():
        # leapfrog finds its first forces in its first step
        if not name.endswith("_force"):
            np.testing.assert_allclose(values, before[name], rtol=1e-13, atol=1e-13)
    stretched = comm.allreduce(np.abs(sim.systems[1].particles.owned_rows("displacement")).sum())
    assert stretched > 1e-4
    times = follow(Simulation(comm, scene), Record(), 3)["time"]
    assert times[1] == 0.0 and 0.0 < times[2] < times[3]


class Push(Interaction):
    """A force from one system on another, as a contact would give it."""

    def __init__(self, sim, force: float):
        self.pair, self.force, self.asked = sim.systems, force, []

    def start_step(self, time: float, step: float, ledger) -> None:
        self.asked.append((time, step))

    def evaluate(self, time: float, step: float, ledger) -> None:
        self.asked.append((time, step))
        for sign, system in zip((1.0, -1.0), self.pair):
            system.particles.owned_rows("external_force")[:, 0] += sign * self.force / 64


def test_systems_take_the_forces_of_interactions(comm):
    bodies = [
        plate(name, x, placement="cells") | {"velocity": [0.0, 0.0]} for name, x in (("left", 0.0), ("right", 5.0))
    ]
    data = raw(*bodies, method=METHODS["tlsph"] | {"integrator": "leapfrog"}) | {"boundaries": []}
    sim = Simulation(comm, two_systems(data, METHODS["peridynamics"]))
    for system in sim.systems:
        system.take_external_forces(keep_rows=False)
    push = Push(sim, 2e6)
    sim.interactions.append(push)
    times = follow(sim, Record(), 4)["time"]
    step = SHORT["maximum_step"]
    assert push.asked == [(time, step) for pair in pairwise(times) for time in pair]
    momenta = [
        comm.allreduce((s.mass[: s.owned] * s.particles.owned_rows("velocity")[:, 0]).sum()) for s in sim.systems
    ]
    # none acts before the first evaluation
    np.testing.assert_allclose(momenta, 3.5 * step * np.array([2e6, -2e6]), rtol=1e-9)


PROBES = [
    {"name": "right", "at": [6.0, 1.0], "fields": ["displacement", "pressure"]},
    {"name": "all", "quantity": "centre_of_mass"},
    {"name": "mode", "weight": "X", "fields": ["velocity"]},
    {"name": "fastest", "quantity": "maximum_speed"},
]


def test_probes_see_all_systems(comm, second):
    data = raw(LEFT, RIGHT, method=METHODS["tlsph"], probes=PROBES)
    split, whole = two_systems(data, METHODS[second]), parse_scene(data)
    values = []
    for scene in (split, whole):
        sim = Simulation(comm, scene)
        probes = Probes(comm, scene, Observables(sim.systems))
        values.append(dict(zip(probes.columns, probes.sample())))
    assert list(values[0]) == list(values[1]) and values[0]["all.centre_of_mass_x"] > 3.0
    assert all(values[0][name] == pytest.approx(value, rel=1e-12) for name, value in values[1].items())


def test_a_restart_goes_on_with_the_same_bits(comm, second, shared_path):
    output = {"history_steps": 1, "fields_times": [1e-4]}
    data = pair(second) | {"probes": PROBES, "output": output, "end_time": 2e-4}
    scene = two_systems(data, METHODS[second])
    whole = run_into(shared_path / "whole", comm, scene).simulation
    run_into(shared_path / "pieces", comm, scene, steps=4)
    file = shared_path / "pieces" / "checkpoint.h5"
    recorder = run_into(shared_path / "pieces", comm, scene, restart=Restart(comm, file))
    again, told = recorder.simulation, recorder.summary("finished")
    for found, wanted in zip(again.systems, whole.systems):
        assert all(rows.tobytes() == state(wanted)[name].tobytes() for name, rows in state(found).items())
    assert again.clock.step == whole.clock.step == 10
    header, systems, _ = read_checkpoint(comm, file)
    assert {"method_state", "method_state_1"} < set(header) and len(systems) == 2
    assert [comm.allreduce(len(fields["identifier"])) for fields in systems] == [64, 64]
    assert told["pairs"] == sum(comm.allreduce(s.directed_pairs) for s in whole.systems) // 2
    assert told["method"] == ("tlsph" if second == "tlsph" else "tlsph and peridynamics")
    if comm.rank == 0:
        histories = [read_history(shared_path / name / "history.csv") for name in ("whole", "pieces")]
        assert histories[0] == histories[1] and len(histories[0]["step"]) == 11
        for number in (0, 1):
            with h5py.File(shared_path / "whole" / f"fields_system-{number}.vtkhdf") as fields:
                points = fields["VTKHDF/PointData"]
                # times 1e-4 and the end
                assert len(points["pressure"]) == 2 * 64 and np.isfinite(points["pressure"][()]).all()
                assert points["body"][()].tolist() == [number] * 64
    with pytest.raises(SolverError, match="method: expected as many as in the checkpoint, 2, found 1"):
        Simulation(comm, parse_scene(data), Restart(comm, file))


def test_a_field_that_one_method_lacks_is_not_a_number_there(comm):
    data = raw(LEFT, RIGHT, method=METHODS["tlsph"])
    sim = Simulation(comm, two_systems(data, METHODS["peridynamics"] | {"damage": {"critical_stretch": 0.5}}))
    observables = Observables(sim.systems)
    assert observables.usual_fields()[:2] == ["damage", "displacement"]
    damage, owned = observables.field("damage"), sim.systems[0].owned
    assert np.isnan(damage[:owned]).all() and not damage[owned:].any() and len(damage) == len(observables.body)
    with pytest.raises(KeyError):
        observables.field("temperature")


def test_check_tells_of_all_systems(comm):
    data = raw(LEFT, RIGHT, method=METHODS["tlsph"])
    sim = Simulation(comm, two_systems(data, METHODS["peridynamics"]))
    sim.time_steps = StableSteps.of(sim.scene, sim.systems)
    told = str(report_of(comm, sim))
    if comm.rank == 0:
        assert "scene: tlsph, 2-D" in told and "scene: peridynamics, 2-D" in told
        assert f"{'particles':<28} {128:>14,}" in told


def test_a_failure_names_the_particle_of_its_system(comm):
    sim = Simulation(comm, two_systems(raw(LEFT, RIGHT), BONDS))
    system = sim.systems[1]
    system.particles.owned_rows("velocity")[system.particles.owned_rows("identifier") == 100] = np.nan
    with pytest.raises(RuntimeError, match=r"particle +(6[4-9]|[7-9]\d|1[0-2]\d) on rank") as error:
        follow(sim, Record(), 3)
    assert "method.solution.safety" in str(error.value)
    assert comm.allgather(str(error.value)) == [str(error.value)] * comm.size
