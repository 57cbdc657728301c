"""A roller on a surface of any direction: a turned copy, and the ledger."""

import numpy as np
import pytest
from grouped_meshes import block
from mpi4py import MPI
from solids import SOFT, Record, follow, gathered, simulation

from parsolid.collective import SolverError
from parsolid.scene.observation import stored_energy
from parsolid.simulation.time_step import TimeSteps

ELASTIC = {"kind": "neo-hookean", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
STEEL = {"kind": "micro-inertia", "library": "4340 steel, Rahaman"}
# the step is that of a power iteration from the places of the particles, a little another when they are turned
PERIDYNAMICS = {"kind": "peridynamics", "traction": "single-layer", "horizon_ratio": 2.0, "maximum_step": 5e-3}
# material, placement, traction [Pa], end [s]
CASES = {"peridynamics": (ELASTIC, "vertices", 0.3, 1.0), "ulsph": (STEEL, "cells", 2e8, 1.0)}
CASES |= {"tlsph": (SOFT, "vertices", 0.3, 1.0)}
METHODS = [PERIDYNAMICS, {"kind": "ulsph"}, {"kind": "tlsph", "integrator": "ssp-rk3"}, {"kind": "tlsph"}]


def between_rollers(file: str, turned: float, kind: str, method: dict) -> dict:
    material, placement, pull, end = CASES[kind]
    R = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    rollers = [{"kind": "roller", "where": where, "name": where, "reaction": True} for where in ("bottom", "side")]
    push = {"kind": "traction", "where": "top", "traction": list(R @ [pull, -0.7 * pull])}
    body = {"shape": {"mesh": {"file": file}}, "material": material, "placement": placement}
    return {"dimension": 2, "end_time": end, "method": method, "bodies": [body], "boundaries": [*rollers, push]}


def told(sim) -> dict:
    mine = {name: sim.systems[0].reaction(name) for name in ("bottom", "side")}
    return {name: sim.comm.allreduce(np.array(value)) for name, value in mine.items()}


@pytest.mark.parametrize("method", METHODS, ids=lambda one: one.get("integrator", one["kind"]))
def test_a_skew_roller_is_the_turned_copy_of_an_aligned_one(method, shared_path, comm):
    results = []
    for turned in (0.0, 0.4):
        R = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
        name = str(shared_path / f"{turned}.msh")
        if comm.rank == 0:
            block(name, turned)
        comm.Barrier()
        data = between_rollers(name, turned, method["kind"], method)
        sim = simulation(data, comm)
        rows = follow(sim, Record(told), 30, TimeSteps)
        (u,) = gathered(sim, "position")
        u = (u - gathered(sim, "reference_position")[0]) @ R
        forces = np.array([rows["bottom"][-1][:2], rows["side"][-1][:2]]) @ R
        results.append((u, forces, rows[stored_energy(rows)][-1]))
        assert abs(rows["energy_error"][-1]) < 1e-3 * rows["external_work"][-1]
    for aligned, skew in zip(*results):
        np.testing.assert_allclose(skew, aligned, rtol=0, atol=1e-9 * np.abs(aligned).max())
    if comm.size > 1 and method["kind"] == "tlsph":
        alone = simulation(data, MPI.COMM_SELF)
        follow(alone, Record(), 30, TimeSteps)
        np.testing.assert_allclose(gathered(sim, "position")[0], gathered(alone, "position")[0], rtol=0.0, atol=1e-12)
    forces = results[0][1]
    # along the normal, and against the push
    assert abs(forces[0, 0]) < 1e-9 * abs(forces[0, 1]) and abs(forces[1, 1]) < 1e-9 * abs(forces[1, 0]) > 0.0


def test_an_equilibrium_holds_no_skew_normal(tmp_path):
    method = PERIDYNAMICS | {"solution": {"kind": "quasi-static", "step": 0.1}}
    data = between_rollers(block(tmp_path / "m.msh", 0.4), 0.4, "peridynamics", method)
    with pytest.raises(SolverError, match="boundaries.0.kind: expected .*explicit.* for a normal that is held"):
        simulation(data)
