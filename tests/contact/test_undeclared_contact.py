"""Bodies that meet though no table names them end the run with names, time and place, or are warned of."""

import json

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.commands.cli import main
from parsolid.pairs.displacement import body_motions
from parsolid.scene import parse_scene
from parsolid.simulation.loop import RunFailed, Simulation

SOFT = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
# method, material, speed of each [m/s], distance [m] of particles at which bodies have met
CASES = {
    "tlsph": ({"kind": "tlsph", "kernel": "wendland-c2"}, SOFT, 0.2, 0.2),
    "peridynamics": ({"kind": "peridynamics", "horizon_ratio": 2.0, "solution": {"kind": "explicit"}}, SOFT, 0.2, 0.2),
    "mpm": ({"kind": "mpm", "cell": 0.4}, SOFT, 0.2, 1.2),
    "ulsph": ({"kind": "ulsph"}, COPPER, 200.0, 0.52),
}
GAP, SPACING = 2.0, 0.2


def tables(method: str, **more) -> dict:
    """Two blocks of 5 x 5 cells that fly towards one another along X, from a gap of 2 m."""
    settings, material, speed, _ = CASES[method]
    bodies = [
        {
            "name": name,
            "shape": {"box": {"lower": [lower, 0.0], "upper": [lower + 1.0, 1.0]}},
            "spacing": SPACING,
            "placement": "cells",
            "material": material,
            "velocity": [sign * speed, 0.0],
        }
        for name, lower, sign in (("left", -1.0, 1.0), ("right", GAP, -1.0))
    ]
    return {"dimension": 2, "end_time": 1.2 * GAP / (2.0 * speed), "method": settings, "bodies": bodies} | more


@pytest.mark.parametrize("method", CASES)
def test_bodies_that_meet_end_the_run_or_are_warned_of(comm, method):
    _, _, speed, distance = CASES[method]
    sim = Simulation(comm, parse_scene(tables(method)))
    with pytest.raises(RunFailed) as failed:
        sim.run()
    text = str(failed.value)
    assert len(set(comm.allgather(text))) == 1
    assert "'left' and 'right'" in text and f"time       {sim.clock.time:.9g} s" in text
    # seen within the steps between two looks
    due = (GAP + SPACING - distance) / (2.0 * speed)
    assert due <= sim.clock.time + sim.clock.step_size and sim.clock.time <= due + 10.0 * sim.clock.step_size
    place = float(text.partition("x = (")[2].partition(",")[0])
    assert abs(place - 0.5 * GAP) < distance + SPACING
    warned = Simulation(comm, parse_scene(tables(method, undeclared_contact="warn")))
    warned.run(1.01 * sim.clock.time)
    assert [one.code for one in warned.warnings] == ["undeclared-contact"]
    assert "'left' and 'right'" in warned.warnings[0].text
    assert warned.interactions[-1].state()["met"] == [(0, 1)]


def test_bodies_of_two_methods_meet_too(comm):
    data = tables("tlsph")
    data["methods"] = [CASES[name][0] | {"name": name} for name in ("tlsph", "peridynamics")]
    del data["method"]
    for body, name in zip(data["bodies"], ("tlsph", "peridynamics")):
        body["method"] = name
    with pytest.raises(RunFailed, match="'left' and 'right'"):
        Simulation(comm, parse_scene(data)).run()


def test_bodies_that_pass_by_have_not_met():
    data = tables("tlsph")
    box = data["bodies"][1]["shape"]["box"]
    box["lower"][1], box["upper"][1] = 1.2, 2.2
    data["end_time"] *= 1.5
    assert Simulation(MPI.COMM_SELF, parse_scene(data)).run() == "finished"


def test_named_bodies_are_not_looked_for():
    contact = [{"bodies": ["left", "right"]}]
    sim = Simulation(MPI.COMM_SELF, parse_scene(tables("tlsph", contact=contact)))
    assert sim.run() == "finished" and len(sim.interactions) == 1


def test_a_run_goes_on_with_the_checks_of_the_one_before(comm):
    one, other = (Simulation(comm, parse_scene(tables("tlsph"))) for _ in range(2))
    one.run(0.5)
    state = json.loads(json.dumps(one.interactions[-1].state() | {"met": [[0, 1]]}))
    other.interactions[-1].set_state(state)
    assert other.interactions[-1].due == one.interactions[-1].due > 0.5
    # bodies that have been warned of are not found again, others are
    assert other.interactions[-1].state()["met"] == []
    warned = Simulation(comm, parse_scene(tables("tlsph", undeclared_contact="warn"))).interactions[-1]
    warned.set_state(state)
    assert warned.state()["met"] == [(0, 1)]


def test_the_command_ends_with_status_3_and_says_why(tmp_path, capsys):
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'dimension = 2\nend_time = 6\nmethod = { kind = "tlsph", kernel = "wendland-c2" }\n'
        + "".join(
            f'[[bodies]]\nname = "{name}"\nspacing = 0.2\nplacement = "cells"\nvelocity = [{speed}, 0]\n'
            f"shape.box = {{ lower = [{lower}, 0], upper = [{lower + 1}, 1] }}\n"
            'material = { kind = "neo-hookean", density = 1, youngs_modulus = 1, poissons_ratio = 0.3 }\n'
            for name, lower, speed in (("left", -1, 0.2), ("right", 2, -0.2))
        )
    )
    assert main(["run", str(scene), "-q", "-o", str(tmp_path / "out")]) == 3
    assert "'left' and 'right'" in capsys.readouterr().err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["status"] == "failed" and "'left' and 'right'" in summary["fault"]
    out = ["-o", str(tmp_path / "warned"), "--set", 'undeclared_contact="warn"']
    assert main(["run", str(scene), *out]) == 0
    assert "[undeclared-contact]" in capsys.readouterr().out


def test_far_bodies_are_not_followed():
    """Near ones have the boxes that a look at all pairs gives."""
    lower = np.stack(np.meshgrid(np.arange(8.0), np.arange(9.0), indexing="ij"), axis=-1).reshape(-1, 2)
    velocity = np.random.default_rng(3).standard_normal(lower.shape)
    motions = body_motions(velocity, lower, lower + 0.9, None, 0.5)
    for body, corner in enumerate(lower):
        near = np.flatnonzero((np.abs(lower - corner) <= 1.4).all(axis=1))
        rows = slice(motions.start[body], motions.start[body + 1])
        expected = lower[near[near != body]]
        np.testing.assert_array_equal(motions.lower[rows], expected)
        np.testing.assert_array_equal(motions.partner[rows], velocity[near[near != body]])
    every = body_motions(velocity, lower, lower + 0.9, None, np.inf)
    assert (np.diff(every.start) == len(lower) - 1).all()
