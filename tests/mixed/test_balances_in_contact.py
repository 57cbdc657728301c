"""Energy of bodies that meet, to the second order of the step: material points and updated-Lagrangian SPH."""

import numpy as np
import pytest
from mixed.bodies_apart import RUBBER
from mpi4py import MPI
from solids import recorded

from parsolid.collective import SolverError
from parsolid.scene import parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.loop import Simulation

COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
POINTS = {"kind": "mpm", "cell": 2e-3}
LEAPFROG = {"kind": "tlsph", "integrator": "leapfrog"}


def blocks(method: dict, speed: float, end: float, material=COPPER) -> dict:
    """Two blocks of 6 x 6 particles, a millimetre each, that touch and close at a speed [m/s]."""
    bodies = []
    for name, low, sign in (("top", 0.0, -0.5), ("low", -6e-3, 0.5)):
        box = {"lower": [0.0, low], "upper": [6e-3, low + 6e-3]}
        body = {"name": name, "shape": {"box": box}, "particles": [6, 6], "placement": "cells"}
        bodies.append(body | {"velocity": [0.0, sign * speed], "material": material})
    data = {"dimension": 2, "end_time": end, "method": method, "bodies": bodies}
    return data | {"contact": [{"bodies": ["top", "low"]}]}


def run(data: dict) -> dict[str, np.ndarray]:
    return recorded(Simulation(MPI.COMM_SELF, parse_scene(data)))


@pytest.mark.parametrize("method", [POINTS, {"kind": "ulsph"}], ids=["mpm", "ulsph"])
def test_copper_at_three_kilometres_a_second_keeps_its_balance(method):
    """1.6e-2 and 3.9e-3 while heat of the viscosity and corrections of gradients were half a step late."""
    found = run(blocks(method, 3000.0, 1.5e-6))
    energy = found["kinetic"][0]
    assert found["kinetic"].min() < 0.7 * energy and found["contact_energy"].max() > 0.1 * energy, found
    assert np.abs(found["energy_error"]).max() < 1e-3 * energy


@pytest.mark.parametrize("more", [{"order": "usl"}, {"transfer": "apic"}], ids=str)
def test_what_transfers_take_is_booked_in_every_order(more):
    found = run(blocks(POINTS | more, 200.0, 3e-6))
    energy = found["kinetic"][0]
    assert found["numerical_dissipation"][-1] > 0.01 * energy
    assert np.abs(found["energy_error"]).max() < 1e-3 * energy


def test_particles_gain_what_forces_do_at_the_nodes():
    """MUSL's two maps are each other's transpose: m v^2/2 of particles grows by sum m_i a_i . (u_i + u'_i)/2."""
    sim = Simulation(MPI.COMM_SELF, parse_scene(blocks(POINTS | {"transfer": "flip"}, 200.0, 4e-6)))

    def kinetic() -> float:
        return sum(system.energies()[0] - system.external.energy() for system in sim.systems)

    for _ in range(6):
        before, gain = kinetic(), 0.0
        sim.take_step(1e-8)
        for system in sim.systems:
            nodes = system.nodes
            motion, again = nodes.motion[: nodes.count], nodes.remapped[: nodes.count]
            impulse = (nodes.share * motion[:, 3])[:, None] * motion[:, 4:7]
            gain += 0.5 * float(np.sum(impulse * (motion[:, :3] - motion[:, 4:7] + again[:, :3])))
        assert kinetic() - before == pytest.approx(gain, rel=1e-9, abs=1e-12 * before)
    assert abs(gain) > 1e-4 * before


def test_points_fall_alike_in_steps_of_any_length():
    """Forces of a time act for half of the steps before and after it, where something else acts between steps."""
    data = blocks(POINTS, 0.0, 1.0, RUBBER) | {"loads": {"acceleration": ["0", "-10"]}}
    sim, steps = Simulation(MPI.COMM_SELF, parse_scene(data)), (3e-6, 1e-6, 5e-6, 2e-6)
    places = [system.particles.owned_rows("position").copy() for system in sim.systems]
    for step in steps:
        sim.take_step(step)
    # the balance does not know what loads do: a wrong work of theirs would be numerical dissipation
    row = sim.energy_row()
    assert abs(row["numerical_dissipation"]) < 1e-9 * row["external_work"] and row["external_work"] > 0.0
    for system, before in zip(sim.systems, places):
        fallen = system.particles.owned_rows("position") - before
        np.testing.assert_allclose(fallen, np.broadcast_to([0.0, -5.0 * sum(steps) ** 2], fallen.shape), atol=1e-17)


def test_bodies_that_close_fast_take_shorter_steps():
    """A force that stiffens does not change evenly in a third of a spacing."""
    found = run(blocks(LEAPFROG, 60.0, 1e-4, RUBBER))
    pressed = found["contact_energy"].argmax()
    assert found["contact_energy"][pressed] > 0.02 * found["kinetic"][0]
    assert np.abs(found["energy_error"])[: pressed + 1].max() < 5e-4 * found["kinetic"][0]


def apart(gap: float, speed: float) -> dict:
    """`blocks` of rubber that are a gap [m] apart."""
    data = blocks(LEAPFROG, speed, 2e-4, RUBBER)
    data["bodies"][1]["displacement"] = ["0", f"-{gap}"]
    return data


@pytest.mark.parametrize("gap", [0.6e-3, 1.4e-3, 2.4e-3, 3.3e-3])
def test_bodies_that_come_into_sight_fast_begin_to_press_gently(gap):
    """Where what a particle sees of the other body does not yet tell how fast they close, contact looks ahead."""
    found = run(apart(gap, 120.0))
    assert np.abs(found["energy_error"]).max() < 2.5e-3 * found["kinetic"][0]
    assert found["contact_energy"][found["contact_energy"] > 0.0][0] < 2e-4 * found["kinetic"][0]


def test_leapfrogs_swings_of_all_particles_are_told_where_bodies_meet():
    """Those that contact does not touch swing, too: half of what the balance was off by."""
    found = run(blocks(LEAPFROG, 4.0, 4e-4, RUBBER))
    off = np.abs(found["energy_error"]).max(), np.abs(found["energy_error"] + found["kinetic_offset"]).max()
    assert off[0] < 7e-4 * found["kinetic"][0] and off[0] < 0.2 * off[1], off


BONDS = {"kind": "peridynamics"}
LINEAR = {"kind": "linear-elastic", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.3}


def test_what_damps_nothing_takes_a_third_of_a_contacts_step():
    longest = {}
    for name, method, law in (("damped", LEAPFROG, RUBBER), ("undamped", {"kind": "peridynamics"}, RUBBER)):
        sim = Simulation(MPI.COMM_SELF, parse_scene(blocks(method, 4.0, 1e-4, law)))
        longest[name] = sim.interactions[0].contact_bodies.laws[0][1].longest
    assert longest["undamped"] == pytest.approx(0.36 * longest["damped"])


@pytest.mark.parametrize("gap", [1.4e-3, 3e-3, 6e-3])
def test_bonds_that_close_as_fast_as_waves_begin_to_press_gently(gap):
    """Their step closes 1.6 spacings; lists that began at a skin were made when bodies lay in one another."""
    data = apart(gap, 144.0) | {"method": BONDS}
    for body in data["bodies"]:
        body["material"] = LINEAR
    found = run(data)
    pressed = found["contact_energy"][found["contact_energy"] > 0.0]
    assert pressed[0] < 2e-4 * found["kinetic"][0] and pressed.max() > 0.05 * found["kinetic"][0]
    assert np.abs(found["energy_error"]).max() < 1e-3 * found["kinetic"][0]


@pytest.mark.parametrize(
    ("method", "law"),
    [(LEAPFROG, RUBBER), ({"kind": "tlsph"}, RUBBER), (BONDS, LINEAR)],
    ids=["one", "stages", "bonds"],
)
def test_what_lies_half_a_spacing_deep_at_the_start_parts_gently(method, law):
    """Nothing moves yet: steps as long as frequencies allow had 3.0e-3, 3.9e-3 and 1.5e-3 out of balance."""
    data = apart(-0.5e-3, 0.0) | {"method": method, "end_time": 3e-5}
    for body in data["bodies"]:
        body["material"] = law
    found = run(data)
    assert found["kinetic"].max() > 0.5 * found[stored_energy(found)][0]
    assert np.abs(found["energy_error"]).max() < 1e-3 * found[stored_energy(found)][0]


def test_a_step_of_no_length_leaves_the_bound_and_without_entries_there_is_none():
    sim = Simulation(MPI.COMM_SELF, parse_scene(blocks(POINTS, 800.0, 2e-6)))
    contact, system = sim.interactions[0], sim.systems[0]
    for _ in range(4):
        sim.take_step(2e-8)
    allowed, place = contact.stable_step(), system.particles.owned_rows("position")
    sim.take_step(0.0)
    assert contact.stable_step() == allowed < 0.5 * contact.step_rule.longest.min()
    # a rank whose entries are others' now, and one to whom they come back
    for far in (1.0, -1.0):
        place[:, 1] += far
        contact.rebuild(sim.clock.time)
        assert contact.stable_step() == np.inf and contact.state()["steps"].values == (1e300,)


def test_a_checkpoint_of_velocities_of_other_times_is_refused():
    system = Simulation(MPI.COMM_SELF, parse_scene(blocks(POINTS, 800.0, 2e-6))).systems[0]
    with pytest.raises(SolverError):
        system.set_state(system.state() | {"external": None})
