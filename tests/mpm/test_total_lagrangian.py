"""The total-Lagrangian form: a manufactured solution, a Taylor bar, its energy, ranks, conduction, what it refuses."""

import numpy as np
import pytest
from mpi4py import MPI
from points import COPPER, INVISCID, SOFT, scene, taylor_bar
from solids import gathered, run_steps, run_to_end, simulation

from parsolid.collective import maximum
from parsolid.exact.manufactured import AxisAligned
from parsolid.scene import SceneError

TOTAL = {"formulation": "total-lagrangian", "basis": "linear"}


def axis_aligned_error(cells: int, basis: str, comm) -> float:
    """Largest rms error of the displacement over its amplitude in a period."""
    box = {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}}
    body = {"shape": box, "particles": [2 * cells] * 2, "placement": "cells", "material": SOFT}
    data = {
        "dimension": 2,
        "end_time": 0.02,
        "method": {"kind": "mpm", "cell": 1.0 / cells, "order": "musl", "viscosity": INVISCID, **TOTAL, "basis": basis},
        "bodies": [body | {"velocity": ["5*pi*sin(pi*X)", "-5*pi*sin(pi*Y)"]}],
        "boundaries": [{"kind": "roller", "plane": f"{axis} = {x}"} for axis in "XY" for x in (0, 1)],
        "loads": {"manufactured": True},
        "reference": {"exact": "axis-aligned", "parameters": {"amplitude": 0.05}, "each_step": True},
    }
    sim, worst = simulation(data, comm), 0.0
    exact = AxisAligned.of_scene(sim.scene)
    while sim.clock.time < 0.02:
        step = comm.allreduce(sim.systems[0].stable_step(), MPI.MIN)
        sim.take_step(min(step, 0.02 - sim.clock.time))
        rows = sim.systems[0].particles.owned_rows
        error = (
            rows("position")
            - rows("reference_position")
            - exact.fields(rows("reference_position"), sim.clock.time)["displacement"]
        )
        total = comm.allreduce(np.array([(error**2).sum(), len(error)]))
        worst = max(worst, float(np.sqrt(total[0] / total[1])) / 0.05)
    return worst


@pytest.mark.slow
# of the formulation's prototype
@pytest.mark.parametrize("basis, published", [("linear", {8: 0.098, 16: 0.0243})])
def test_the_manufactured_solution_converges_with_second_order(comm, basis, published):
    errors = {cells: axis_aligned_error(cells, basis, comm) for cells in published}
    assert errors == pytest.approx(published, rel=0.05)
    assert np.log2(errors[8] / errors[16]) > 1.9


@pytest.mark.slow
@pytest.mark.serial
def test_a_taylor_bar_neither_locks_nor_loses_energy(comm):
    data = taylor_bar(1.6e-3, order="musl", end_time=80e-6, **TOTAL)
    sim, history = run_to_end(data, comm)
    radius, length = maximum(comm, sim.systems[0].points.bounds_of_domains()[1])
    # converged finite elements, met to 1.1 % by two cells over the radius (0.5 % by four); without mean dilatations 5
    # mm
    assert radius == pytest.approx(7.22e-3, rel=0.012) and length == pytest.approx(21.42e-3, rel=0.012)
    energy = history["kinetic"][0]
    assert abs(history["balance"][-1]) < 0.005 * energy


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_form_does_not_depend_on_the_ranks(comm, dimension):
    data = taylor_bar(1.6e-3, dimension=dimension, length=9.6e-3, order="usl", **TOTAL)
    spread, single = run_steps(data, 40, comm)[0], run_steps(data, 40, comm.Split(comm.rank))[0]
    for found, wanted in zip(
        *(gathered(sim, "position", "velocity", "deformation_gradient") for sim in (spread, single))
    ):
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-9 * np.abs(wanted).max())


def test_heat_flows_in_a_turned_body_as_in_one_that_is_not(comm):
    changes, turn = [], {"displacement": ["-0.4*X - 0.8*Y", "0.8*X - 0.4*Y"]}
    for turned in ({}, turn):
        body = {"temperature": "300 + 50*X*X + 20*X*Y", **turned}
        material = COPPER | {"conductivity": 386.0}
        sim = simulation(scene([0.0, 0.0], [0.4, 0.3], 0.05, 0.1, material=material, method=TOTAL, body=body), comm)
        start = gathered(sim, "temperature")[0]
        sim.take_step(1e-9)
        changes.append(gathered(sim, "temperature")[0] - start)
    scale = np.abs(changes[0]).max()
    assert scale > 0.0
    np.testing.assert_allclose(changes[1], changes[0], atol=1e-6 * scale)


def test_walls_are_refused(comm):
    data = scene(
        [0.0, 0.0],
        [0.4, 0.4],
        0.05,
        0.1,
        method=TOTAL,
        boundaries=[{"kind": "wall", "plane": "Y = 0", "side": "above"}],
    )
    with pytest.raises(SceneError, match="boundaries.0.kind: expected no wall with the formulation 'total-lagrangian'"):
        simulation(data, comm)
