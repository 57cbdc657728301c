"""Rigid tools in equilibria and long steps: patch tests, friction, ranks, restarts, stages, and what is refused."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import gathered, run_alone_and_on_all, run_to_end, supports
from tlsph.test_load_history import METAL
from tlsph.test_mesh_weights import RUBBER
from tlsph.test_stages import run
from tlsph.test_static import box, static

from parsolid.contact.tools.rigid_body import GuidedBody, Pose
from parsolid.methods.tlsph.implicit import Implicit
from parsolid.methods.tlsph.static import Failed, Static
from parsolid.scene import parse_scene
from parsolid.simulation.loop import FINISHED, INTERRUPTED, Simulation

SIDES = [{"plane": "X = 0", "kind": "roller"}, {"plane": "Y = 0", "kind": "roller"}]


def press(at, speed, name="press", normal=-1, **keys):
    """A plane at a height, that moves along Y and touches what is beyond it."""
    shape = {"plane": {"point": [0.0, at], "normal": [0.0, normal]}}
    return {"name": name, "shape": shape, "motion": {"velocity": ["0", speed]}, **keys}


def pressed(tools, weights="cells", particles=(6, 6), boundaries=SIDES, **rest):
    """A square of one metre in equilibrium with tools."""
    data = box((1.0, 1.0), weights, boundaries=boundaries, tools=tools, **rest)
    data["bodies"][0]["particles"] = list(particles)
    return data


def of_tools(sim):
    """Columns of the tools."""
    return dict(zip(sim.interactions[0].columns, sim.interactions[0].sample()))


@pytest.mark.serial
@pytest.mark.parametrize(("weights", "gap"), [("cells", 0.0), ("cells", 0.03), ("mesh", 0.0)])
def test_patch(shared_path, comm, weights, gap):
    """A plane strains a body evenly, by work that it stores, and from when it meets it."""
    tools = [press(1.0 + gap, "-0.2")]
    if weights == "mesh":
        data = static(shared_path, counts=(3, 3), scale=1.0 / 3.0, moving=0.0, boundaries=SIDES, tools=tools)
    else:
        data = pressed(tools)
    sim, rows = run_to_end(data, comm, of_tools)
    (F,) = gathered(sim, "deformation_gradient")
    # springs of nodes of a mesh differ by their widths
    assert np.ptp(F, axis=0).max() < (0.01 if weights == "mesh" else 1e-7)
    # but for what the springs of contact give way
    assert 0.8 + gap < F[:, 3].mean() < 0.86 + gap
    P = sim.systems[0].shown("first_piola_kirchhoff_stress", 0, sim.systems[0].owned)
    mean = comm.allreduce(np.einsum("n,nij->ij", sim.systems[0].particles.owned_rows("volume"), P))
    np.testing.assert_allclose(mean[1, 1], -rows["press.force_y"][-1], rtol=1e-6)
    np.testing.assert_allclose(mean[0, 0], 0.0, atol=1e-6 * rows["press.force_y"][-1])
    assert rows["strain_energy"][-1] == pytest.approx(rows["external_work"][-1], rel=1e-4)


@pytest.mark.serial
def test_friction(comm):
    """A tool that slides along a held body pulls it with its coefficient times what presses; slip takes what the tool
    does and nothing stores."""
    driven = {"velocity": ["0.02*where(t > 0.5, 1, 0)", "-0.02*where(t < 0.5, 1, 0)"]}
    held = [{"plane": "Y = 0", "kind": "fixed"}]
    tool = press(1.0, "0", friction=0.2) | {"motion": driven}
    data = pressed([tool], boundaries=held, particles=(4, 4)) | {"output": {"fields_interval": 0.5}}
    sim, rows = run(data, comm)
    force = of_tools(sim)
    assert force["press.force_x"] == pytest.approx(-0.2 * force["press.force_y"], rel=1e-6)
    assert rows["friction_dissipation"][-1] > 0.05 * rows["external_work"][-1]
    assert np.abs(rows["energy_error"]).max() < 1e-3 * rows["external_work"][-1]


@pytest.mark.serial
def test_a_tool_that_rubs_leaves_the_body_as_it_was(comm):
    """The last of the force goes in a step whose work is rounding beside what was stored."""
    ball = {"sphere": {"centre": [0.5, 1.3], "radius": 0.3}}
    tool = press(1.0, "where(t < 0.5, -0.05, 0.05)", friction=0.2) | {"shape": ball}
    data = pressed([tool], boundaries=[{"plane": "Y = 0", "kind": "fixed"}])
    sim, rows = run_to_end(data, comm)
    assert sim.clock.time == 1.0 and abs(rows["strain_energy"][-1]) < 1e-6 * rows["strain_energy"].max()


@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_bounce(comm, friction):
    """A square falls on a slope in long steps: its energy is kept but for what friction takes."""
    slope = {"name": "slope", "shape": {"plane": {"point": [0.0, -0.05], "normal": [0.1, 1.0]}}, "friction": friction}
    data = pressed([slope], particles=(4, 4), boundaries=[], body={"velocity": ["0.1", "-0.2"]})
    data["method"] |= {"integrator": "implicit", "maximum_step": 0.04}
    _, rows = run_to_end(data | {"end_time": 1.6}, comm)
    assert rows["contact_energy"].max() > 0.05 * rows["kinetic"][0]
    assert (rows["friction_dissipation"][-1] > 0.01 * rows["kinetic"][0]) == (friction > 0.0)
    limit = 1e-4 if friction else 1e-8
    assert np.abs(rows["energy_error"]).max() < limit * rows["kinetic"][0]


@pytest.mark.serial
def test_pressed_then_let_go(comm):
    """One ledger where a tool presses a body in equilibrium and leaves it in motion."""
    data = pressed([press(1.0, "where(t < 1, -0.05, 2)")], particles=(4, 4))
    data |= {"end_time": 1.3, "stages": [{"start": 1.0, "method": {"integrator": "leapfrog"}}]}
    _, rows = run(data, comm)
    assert rows["kinetic"][-1] > 0.1 * rows["strain_energy"].max()
    assert np.abs(rows["energy_error"]).max() < 2e-3 * rows["strain_energy"].max()


@pytest.mark.serial
def test_jump(comm):
    """A load step ends where the velocity of a tool jumps: here it turns back."""
    _, rows = run(pressed([press(1.0, "-0.05*(1 - 2*step(t, 0.53))")], particles=(4, 4)), comm)
    assert 0.53 in rows["time"]
    work = rows["external_work"]
    assert work[-1] < 0.02 * work.max()
    assert np.abs(rows["energy_error"]).max() < 1e-4 * work.max()


@pytest.mark.serial
@pytest.mark.parametrize(
    "motion", [{"velocity": ["0", "where(t < 0.37, -0.1, 0.02)"]}, {"rate": "where(t < 0.3, 0, 0.1)"}]
)
def test_jump_within_a_load_step(comm, motion):
    """A tool does mean force times way, wherever in a load step its velocity jumps."""
    tool = press(1.0, "0", friction=0.2) | {"motion": {"velocity": ["0", "-0.05"]} | motion}
    _, rows = run(pressed([tool], particles=(4, 4)), comm)
    assert rows["time"][-1] == 1.0
    assert np.abs(rows["energy_error"]).max() < 1e-3 * rows["external_work"].max()


@pytest.mark.parametrize("jump", [1e-3, 0.37, 0.5, 0.97, 1.0])
def test_way_through_a_jump(jump):
    """How far a velocity that jumps leads a tool, and its mean velocity."""
    body = GuidedBody(Pose(np.zeros(3)), lambda t: (np.array([0.0, 1.0 - 3.0 * (t >= jump), 0.0]), 0.0), *np.eye(3)[:2])
    body.drift_evenly(0.0, 1.0, 1.0)
    assert body.pose.place[1] == pytest.approx(3.0 * jump - 2.0, abs=1e-10)
    assert body.pose.velocity[1] == pytest.approx(3.0 * jump - 2.0, abs=1e-10)


@pytest.mark.serial
def test_a_tool_that_holds_a_body_takes_no_more_products(shared_path, comm):
    """Than a face that is driven (29 of a nearly incompressible mesh): its stiffness is in the preconditioner."""
    law = RUBBER | {"poissons_ratio": 0.4999}
    tools = [press(1.0, "-0.1")]
    data = static(shared_path, counts=(8, 8), scale=0.125, moving=0.0, boundaries=SIDES, tools=tools)
    data["bodies"][0]["material"] = law
    sim, _ = run(data, comm)
    assert sim.systems[0].statics.most_products < 40


@pytest.mark.ranks(1, 2)
def test_nearly_incompressible(shared_path, comm):
    """A tool with friction on a mesh whose pressures are unknowns: the same on all ranks."""
    law = RUBBER | {"poissons_ratio": 0.4999}
    tools = [press(1.03, "-0.1", friction=0.1)]
    data = static(shared_path, counts=(4, 4), scale=0.25, moving=0.0, boundaries=SIDES, tools=tools)
    data["bodies"][0]["material"] = law
    rows = run_alone_and_on_all(data, comm, names=("time", "external_work", "strain_energy"))
    assert rows["time"][-1] == 1.0
    assert np.abs(rows["energy_error"]).max() < 1e-3 * rows["external_work"][-1]


def test_parts_of_a_load_step_leave_no_remainder(monkeypatch):
    """A tool meets the body after a seventh of a load step, and six parts as long follow."""
    sim = Simulation(MPI.COMM_SELF, parse_scene(pressed([press(1.0, "-0.05")], particles=(3, 3))))
    attempt, ends = Static._attempt, []

    def tried(self, stretch, at):
        ends.append(stretch.end)
        return Failed("", part=1.0 / 7.0) if len(ends) == 1 else attempt(self, stretch, at)

    sim.take_step(0.0)
    monkeypatch.setattr(Static, "_attempt", tried)
    monkeypatch.setattr(Static, "_growth", lambda self, taken: 1.0)
    sim.take_step(0.07)
    assert len(ends) == 8 and ends[-2] < 0.9
    assert sim.systems[0].statics.load_step == pytest.approx(0.01)


@pytest.mark.serial
def test_a_tool_meets_a_body_that_may_flow(comm):
    """The load step ends where the tool does meet it, though in trials at its end the tool pushes the body away."""
    ball = {"sphere": {"centre": [0.5, 1.31], "radius": 0.3}}
    tool = press(1.0, "-0.08", friction=0.2) | {"shape": ball}
    data = pressed([tool], boundaries=[{"plane": "Y = 0", "kind": "fixed"}], end_time=0.35)
    data["bodies"][0]["material"] = METAL
    sim, rows = run(data, comm)
    assert rows["external_work"][-1] > 0.0 and sim.systems[0].statics.retries < 10


@pytest.mark.slow
@pytest.mark.serial
def test_springback_on_rollers_that_rub(comm):
    """A bar is bent between three rollers into flow and let go: the way turns where all of them slip, and the bar is
    left bent and free of load."""
    rollers = [
        ("left", -0.8, -0.1, "0"),
        ("right", 0.8, -0.1, "0"),
        ("punch", 0.0, 0.2, "where(t < 1, -0.03, 0.03)"),
    ]
    tools = [
        press(0.0, speed, name, friction=0.1) | {"shape": {"sphere": {"centre": [x, y], "radius": 0.1}}}
        for name, x, y, speed in rollers
    ]
    data = box((2.0, 0.1), "cells", boundaries=[], tools=tools, end_time=2.0, output={"fields_interval": 1.0})
    data["bodies"][0] |= {"material": METAL, "particles": [21, 3]}
    data["bodies"][0]["shape"]["box"] = {"lower": [-1.0, 0.0], "upper": [1.0, 0.1]}
    sim, rows = run(data, comm)
    assert sim.clock.time == 2.0 and sim.systems[0].statics.retries < 30
    work = rows["external_work"]
    assert abs(of_tools(sim)["punch.force_y"]) < 1e-6 * work.max() / 0.03
    # forces of a first guess, which may be far larger than any in balance, do not loosen the tolerance of 1e-8
    assert sim.systems[0].statics.target < 1e-7 * work.max() / 0.03
    # it springs back without flow
    assert 0.0 < rows["plastic_work"][-1] < 1.001 * rows["plastic_work"][rows["time"].tolist().index(1.0)]
    assert 0.0 < work[-1] < 0.99 * work.max()
    assert np.abs(rows["energy_error"]).max() < 1e-3 * work.max()


class StopAfter:
    """A stop request that is there after so many looks."""

    def __init__(self, looks):
        self.looks = looks

    @property
    def received(self):
        self.looks -= 1
        return "SIGTERM" if self.looks < 0 else None


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("integrator", ["static", "implicit"])
def test_a_stop_ends_a_step_between_its_solutions(comm, monkeypatch, integrator):
    """A step that is taken in parts does not hold up a run that is to stop; the same run goes on."""
    data = pressed([press(1.03, "-0.2")], particles=(4, 4))
    if integrator == "implicit":
        data["method"] |= {"integrator": "implicit", "maximum_step": 0.1}
        data["end_time"] = 0.4
        attempt = Implicit._attempt
        # steps longer than this fail
        monkeypatch.setattr(
            Implicit,
            "_attempt",
            lambda self, time, step, *rest: None if step > 0.03 else attempt(self, time, step, *rest),
        )
    whole = Simulation(comm, parse_scene(data))
    assert whole.run() == FINISHED
    sim = Simulation(comm, parse_scene(data))
    # the loop looks once before each step, and a jump of length 0 has no parts
    assert sim.run(stop=StopAfter(2)) == INTERRUPTED
    assert sim.systems[0].stopped and sim.clock.time < data["end_time"]
    assert sim.run() == FINISHED
    assert sim.clock.time == whole.clock.time
    assert comm.allreduce(sim.energies()[1]) == pytest.approx(comm.allreduce(whole.energies()[1]), rel=1e-3)


def test_stops_within_solutions_leave_the_load_steps_as_they_are(comm):
    """Interrupted again and again, a run takes the steps of the whole one, each at most 1.25 times the one before."""
    floor = {"name": "floor", "shape": {"plane": {"point": [0.0, 0.0], "normal": [0.0, 1.0]}}, "friction": 0.1}
    data = pressed([press(1.0, "-0.05", friction=0.1), floor], particles=(4, 4), boundaries=supports(X=(0.0, "roller")))
    whole, sim = (Simulation(comm, parse_scene(data)) for _ in range(2))
    assert whole.run() == FINISHED
    stops = 0
    while sim.run(stop=StopAfter(2 + stops // 3)) == INTERRUPTED:
        stops += 1
    assert stops > 2 * whole.clock.step
    assert sim.clock.step == whole.clock.step and sim.energy_row() == whole.energy_row()
