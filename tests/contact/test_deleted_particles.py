"""Particles that fail and are deleted while they press on another body or are tied to it."""

import numpy as np
import pytest
from solids import LINEAR_COPPER, late_impulse, recorded

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

FAILURE = {"criteria": [{"kind": "plastic-strain", "strain": 0.15}], "after": "delete"}
METHODS = {"mpm": {"kind": "mpm", "cell": 1e-3}, "ulsph": {"kind": "ulsph"}}
OBLIQUE = np.array([50.0, -400.0])


def copper(name, lower, upper, velocity, **failure) -> dict:
    shape = {"shape": {"box": {"lower": lower, "upper": upper}}, "spacing": [5e-4], "placement": "cells"}
    return {"name": name, "velocity": list(velocity), "material": LINEAR_COPPER | failure} | shape


def hammered(method: str) -> dict:
    """A block that is struck obliquely, with friction, and deleted where it is strained most."""
    target = copper("target", [-2e-3, 0.0], [2e-3, 2e-3], (0.0, 0.0), failure=FAILURE)
    hammer = copper("hammer", [-1e-3, 2e-3], [1e-3, 4e-3], OBLIQUE)
    contact = [{"bodies": ["hammer", "target"], "friction": 0.2}]
    output = {"fields_times": [], "history_steps": 1}
    data = {"dimension": 2, "end_time": 2e-6, "method": METHODS[method], "bodies": [target, hammer]}
    return data | {"contact": contact, "output": output}


def torn(method: str) -> dict:
    """A block that tears where it is tied to another one."""
    elastic = {"kind": "neo-hookean", "density": 8930.0, "youngs_modulus": 110e9, "poissons_ratio": 0.33}
    whole = copper("whole", [-4e-3, 0.0], [0.0, 4e-3], (0.0, 0.0)) | {"material": elastic, "method": "elastic"}
    torn = copper("torn", [0.0, 0.0], [4e-3, 4e-3], ("150000*X", "0"), failure=FAILURE) | {"method": "tears"}
    methods = [{"name": "elastic", "kind": "tlsph"}, {"name": "tears"} | METHODS[method]]
    output = {"fields_times": [], "history_steps": 1}
    data = {"dimension": 2, "end_time": 2e-6, "methods": methods, "bodies": [whole, torn]}
    return data | {"tie": [{"bodies": ["whole", "torn"]}], "output": output}


def motion(sim) -> dict:
    """Momentum of what is left, of impulses on their way and of what was deleted [N s]; mass that was [kg]."""
    momentum, mass = np.zeros(2), 0.0
    for system in sim.systems:
        left = (system.mass * system.share)[: system.owned] @ system.particles.owned_rows("velocity")[:, :2]
        momentum += left + late_impulse(system).sum(axis=0)
        if "deleted_mass" in system.particles:
            momentum += system.measure("deleted_momentum")[1]
            mass += float(system.measure("deleted_mass")[1].sum())
    return {"momentum": sim.comm.allreduce(momentum), "deleted": sim.comm.allreduce(mass)}


def followed(data: dict, comm, more=motion) -> tuple[Simulation, dict]:
    sim = Simulation(comm, parse_scene(data))
    return sim, recorded(sim, more)


@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS)
def test_contact_lets_go_of_what_is_deleted(comm, method):
    sim, rows = followed(hammered(method), comm)
    energy, momentum = rows["kinetic"][0], rows["momentum"]
    assert rows["deleted"][-1] > 0.05 * 8930.0 * 8e-6 and rows["friction_dissipation"][-1] > 1e-3 * energy
    assert np.abs(rows["energy_error"]).max() < 1e-3 * energy
    assert np.abs(momentum - 8930.0 * 4e-6 * OBLIQUE).max() < 1e-11 * np.abs(momentum).max()
    for system in sim.systems:
        of = system.particles.owned_rows
        if "deleted_mass" in system.particles:
            assert not of("contact_force")[of("deleted_mass") > 0.0].any()


@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS)
def test_ties_end_where_particles_are_deleted(comm, method):
    sim, rows = followed(torn(method), comm)
    energy, momentum = rows["kinetic"][0], rows["momentum"]
    assert rows["deleted"][-1] > 0.2 * 8930.0 * 16e-6 and rows["tie_energy"].max() > 1e-3 * energy
    assert abs(rows["tie_energy"][-1]) < 1e-14 * energy and np.abs(rows["energy_error"]).max() < 2e-3 * energy
    assert np.abs(momentum - momentum[0]).max() < 1e-11 * np.abs(momentum).max()
    # what has next to no mass is on no spring, which would make steps short
    assert np.diff(rows["time"])[1:-2].min() > 0.2 * np.diff(rows["time"]).max()
