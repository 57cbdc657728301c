"""Momentum that is lost where nothing acts from outside."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from solids import Record, follow, simulation

from parsolid.simulation.energy_check import MomentumBalance, isolated

METAL = {
    "kind": "elastic-plastic",
    "density": 7800.0,
    "specific_heat": 500.0,
    "youngs_modulus": 2e11,
    "poissons_ratio": 0.3,
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 3e8, "hardening": 1e9},
}


class Points:
    """A system of points, as far as momenta ask for it."""

    bodies, share = (0,), np.ones(2)

    def __init__(self, dimension, position, velocity):
        self.dimension, self.owned, self.mass = dimension, len(position), np.array([2.0, 3.0])
        self.fields = {"position": np.array(position), "velocity": np.array(velocity)}
        self.particles = SimpleNamespace(owned_rows=self.fields.get, layout=0)


def momenta_of(monkeypatch, before, after, centre_moves=None):
    monkeypatch.setattr("parsolid.observables.quantities.AngularMomentum._own", staticmethod(lambda watched: 0.0))
    system = Points(len(before[0]), *before[1])
    balance = MomentumBalance(MPI.COMM_SELF, [system])
    balance.check()
    system.fields.update(position=np.array(after[0]), velocity=np.array(after[1]))
    balance.check()
    return balance


@pytest.mark.serial
def test_shares_are_of_the_sums_of_parts(monkeypatch):
    """Two points of 2 and 3 kg turn about their centre at 1 rad/s, then at half of it and with 0.1 m/s besides."""
    place, turning = [[-0.6, 0.0], [0.4, 0.0]], np.array([[0.0, -0.6], [0.0, 0.4]])
    balance = momenta_of(monkeypatch, ([0, 0], (place, turning)), (place, 0.5 * turning + [0.1, 0.0]))
    assert balance.lost == pytest.approx([0.5, 0.6]) and balance.shares() == pytest.approx((0.5 / 2.4, 0.5))
    again = MomentumBalance(MPI.COMM_SELF, [Points(2, place, turning)])
    again.set_state(balance.state())
    assert again.shares() == balance.shares() and (again.first == balance.first).all()


@pytest.mark.serial
def test_a_body_that_flies_far_keeps_its_angular_momentum(monkeypatch):
    place, speed = np.array([[-0.6, 0.0, 1.0], [0.4, 2.0, 0.0]]), [[3.0, 1.0, 2.0]] * 2
    balance = momenta_of(monkeypatch, ([0, 0, 0], (place, speed)), (place + 1e3 * np.array(speed[0]), speed))
    assert max(balance.shares()) < 1e-9


@pytest.mark.serial
def test_rounding_turns_no_body_that_only_flies(monkeypatch):
    """Velocities that are equal but for their last bits have an angular momentum about no centre that could be lost."""
    place, speed = np.array([[0.1, 0.2], [0.7, 0.3]]), np.array([[0.7, 1.1]] * 2)
    after = speed * [[1.0 + 4e-16], [1.0 - 4e-16]]
    balance = momenta_of(monkeypatch, ([0, 0], (place, speed)), (place + 0.1 * speed, after))
    assert 0.0 < balance.lost[1] and balance.shares()[1] < 1e-5


def spinning(method: dict, placement: str = "cells") -> dict:
    body = {"shape": {"box": {"lower": [-0.5, -0.5], "upper": [0.5, 0.5]}}, "particles": [8, 8], "material": METAL}
    return {
        "dimension": 2,
        "end_time": 0.025,
        "method": method,
        "bodies": [body | {"name": "block", "placement": placement, "velocity": ["-20*pi*Y", "20*pi*X"]}],
        "output": {"history_steps": 50, "pictures": False},
    }


@pytest.mark.serial
def test_the_usual_transfer_keeps_a_rigid_rotation(comm):
    """A quarter of a turn; with FLIP and MUSL half of the angular momentum is lost by then, and the block flows."""
    scene = spinning({"kind": "mpm", "cell": 0.25})
    scene["probes"] = [{"name": "block", "quantity": "maximum_plastic_strain"}]
    sim = simulation(scene, comm)
    columns = follow(sim, Record(lambda one: one.energy_row()))
    assert columns["plastic_work"].max() == 0.0
    assert (
        sim.momenta.shares()[1] < 1e-3
        and sim.energy_check.verdict(1.0, (), sim.momenta.shares())["energy_check_code"] is None
    )


def test_a_transfer_that_loses_angular_momentum_is_told(comm):
    sim = simulation(spinning({"kind": "mpm", "cell": 0.25, "transfer": "flip"}), comm)
    follow(sim, Record(lambda one: one.energy_row()))
    verdict = sim.energy_check.verdict(1.0, (), sim.momenta.shares())
    assert (verdict["energy_check"], verdict["energy_check_code"]) == ("unbalanced", "angular-momentum-lost")


@pytest.mark.serial
@pytest.mark.parametrize(
    "more, alone",
    [
        ({}, True),
        ({"boundaries": [{"kind": "wall", "plane": "Y = -3", "side": "above"}]}, False),
        ({"loads": {"acceleration": ["0", "-9.81"]}}, False),
    ],
)
def test_what_acts_from_outside(more, alone):
    from parsolid.scene import parse_scene

    assert isolated(parse_scene(spinning({"kind": "mpm", "cell": 0.25}) | more)) is alone
