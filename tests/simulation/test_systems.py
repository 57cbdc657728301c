"""Two systems in one simulation: each is what it is alone, energies add, the step is the least, a restart has the
same bits.
"""

from itertools import pairwise

import numpy as np
import pytest
from solids import Record, follow
from systems import BONDS, SPH, STIFF, plate, raw, two_systems

from parsolid.collective import minimum
from parsolid.methods.interaction import Interaction
from parsolid.observables.declared import Observables
from parsolid.scene import parse_scene
from parsolid.simulation.history import Probes
from parsolid.simulation.loop import Simulation

LEFT, RIGHT = plate("left", 0.0), plate("right", 5.0, STIFF)
# one step for all runs
SHORT = {"maximum_step": 2e-5}
METHODS = {"tlsph": SPH | SHORT, "peridynamics": BONDS | SHORT}


def state(system) -> dict[str, np.ndarray]:
    return {name: np.array(rows) for name, rows in system.particles.checkpointed().items()}


@pytest.fixture(params=METHODS)
def second(request):
    """The method of the second body."""
    return request.param


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


def test_a_field_that_one_method_lacks_is_not_a_number_there(comm):
    data = raw(LEFT, RIGHT, method=METHODS["tlsph"])
    sim = Simulation(comm, two_systems(data, METHODS["peridynamics"] | {"damage": {"critical_stretch": 0.5}}))
    observables = Observables(sim.systems)
    assert observables.usual_fields()[:2] == ["damage", "displacement"]
    damage, owned = observables.field("damage"), sim.systems[0].owned
    assert np.isnan(damage[:owned]).all() and not damage[owned:].any() and len(damage) == len(observables.body)
    with pytest.raises(KeyError):
        observables.field("temperature")


def test_a_failure_names_the_particle_of_its_system(comm):
    sim = Simulation(comm, two_systems(raw(LEFT, RIGHT), BONDS))
    system = sim.systems[1]
    system.particles.owned_rows("velocity")[system.particles.owned_rows("identifier") == 100] = np.nan
    with pytest.raises(RuntimeError, match=r"particle +(6[4-9]|[7-9]\d|1[0-2]\d) on rank") as error:
        follow(sim, Record(), 3)
    assert "method.solution.safety" in str(error.value)
    assert comm.allgather(str(error.value)) == [str(error.value)] * comm.size
