"""Conduction in the material point method: a mode, a face at a temperature, a heated face, sources, against exact
solutions and sums.
"""

import numpy as np
import pytest
from mpi4py import MPI
from mpm.points import scene
from solids import gathered, run_steps

from parsolid.exact.heat import CosineMode, HeatedSlab
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

WORLD = MPI.COMM_WORLD
pytestmark = pytest.mark.mpi
LENGTH, CELLS, START = 0.02, 20, 300.0
CONDUCTIVITY, HEAT_CAPACITY = 386.0, 8960.0 * 383.0
DIFFUSIVITY = CONDUCTIVITY / HEAT_CAPACITY
MATERIAL = {
    "kind": "elastic-plastic",
    "density": 8960.0,
    "specific_heat": 383.0,
    "conductivity": CONDUCTIVITY,
    "equation_of_state": {"kind": "linear", "bulk_modulus": 140e9},
    "shear_modulus": {"kind": "constant", "modulus": 47.7e9},
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 400e6},
}


def slab(
    end_time,
    temperature=START,
    basis="quadratic-spline",
    boundaries=(),
    cells=CELLS,
    material=MATERIAL,
    free=(),
    **more,
):
    """Advance a strip of a slab of copper, insulated at planes of symmetry but for `boundaries`, at rest.

    free: planes that are surfaces like others.
    """
    cell = LENGTH / cells
    planes = [
        {"kind": "roller", "plane": plane}
        for plane in ("X = 0", f"X = {LENGTH:g}", "Y = 0", f"Y = {2 * cell:g}")
        if plane not in free
    ]
    body = {
        "shape": {"box": {"lower": [0.0, 0.0], "upper": [LENGTH, 2 * cell]}},
        "particles": [2 * cells, 4],
        "placement": "cells",
        "material": material,
        "temperature": temperature,
    }
    tables = {
        "title": "slab",
        "dimension": 2,
        "end_time": end_time,
        "method": {"kind": "mpm", "cell": cell, "basis": basis, "motion": False},
        "bodies": [body],
        "boundaries": [*boundaries, *planes],
    }
    simulation = Simulation(WORLD, parse_scene(tables | more))
    step = WORLD.allreduce(simulation.systems[0].stable_step(), MPI.MIN)
    count = int(np.ceil(end_time / step))
    for _ in range(count):
        simulation.take_step(end_time / count)
    return simulation


def state(simulation):
    """X, temperature and heat capacity (n,) of this rank's particles."""
    rows = simulation.systems[0].particles.owned_rows
    return rows("reference_position"), rows("temperature"), rows("volume") * HEAT_CAPACITY


def total(values):
    return WORLD.allreduce(float(np.sum(values)))


def relative_error(simulation, exact, time):
    X, temperature, _ = state(simulation)
    wanted = exact.fields(X, time)["temperature"]
    return np.sqrt(total((temperature - wanted) ** 2) / total((wanted - START) ** 2))


@pytest.mark.parametrize("basis, limit", [("linear", 0.005), ("quadratic-spline", 0.015)])
def test_a_cosine_mode_decays_and_no_heat_is_lost(basis, limit):
    time = 0.36
    simulation = slab(time, f"300 + 40*cos(pi*X/{LENGTH})", basis)
    assert relative_error(simulation, CosineMode(START, DIFFUSIVITY, 40.0, LENGTH), time) < limit
    _, temperature, capacity = state(simulation)
    assert total(capacity * temperature) == pytest.approx(total(capacity) * START, rel=1e-12)
    assert abs(simulation.ledger.row(WORLD, 0.0, 0.0)["heat_supplied"]) < 1e-12 * total(capacity) * START


def test_a_face_at_a_temperature_converges():
    time = 0.2
    held = {"kind": "temperature", "plane": "X = 0", "temperature": 350.0}
    exact = HeatedSlab(START, DIFFUSIVITY, LENGTH, face_rise=50.0)
    errors = [relative_error(slab(time, boundaries=[held], cells=cells), exact, time) for cells in (10, 20)]
    assert errors[1] < 0.01 and errors[0] / errors[1] > 2.5


def test_planes_at_two_temperatures_keep_the_linear_profile():
    held = [{"kind": "temperature", "plane": f"X = {x}", "temperature": t} for x, t in ((0, 300.0), (LENGTH, 400.0))]
    X, temperature, _ = state(slab(0.01, f"300 + 100*X/{LENGTH}", boundaries=held, cells=5))
    np.testing.assert_allclose(temperature, 300.0 + 100.0 * X[:, 0] / LENGTH, rtol=0.0, atol=1e-10)


def test_a_face_whose_temperature_rises_takes_the_body_along():
    """T = T0 + b t at the face: the quasi-steady profile T0 + b [t - x (2 L - x) / (2 alpha)] after the start has died
    away.
    """
    time, rate = 6.0, 10.0
    held = {"kind": "temperature", "plane": "X = 0", "temperature": f"300 + {rate}*t"}
    simulation = slab(time, boundaries=[held], cells=10)
    X, temperature, _ = state(simulation)
    x = X[:, 0]
    wanted = START + rate * (time - x * (2.0 * LENGTH - x) / (2.0 * DIFFUSIVITY))
    np.testing.assert_allclose(temperature, wanted, atol=0.01 * rate * LENGTH**2 / DIFFUSIVITY)


def test_heat_flux_and_sources_are_supplied_whole():
    time, flux, source = 0.5, 1e6, 2e7
    heated = {"kind": "heat-flux", "plane": "X = 0", "heat_flux": flux}
    simulation = slab(time, boundaries=[heated], loads={"heat_source": source})
    _, temperature, capacity = state(simulation)
    height = 2 * LENGTH / CELLS
    supplied = time * (flux * height + source * LENGTH * height)
    assert total(capacity * (temperature - START)) == pytest.approx(supplied, rel=1e-10)
    energy = simulation.systems[0].energies()[1]
    row = simulation.ledger.row(WORLD, 0.0, energy)
    assert row["heat_supplied"] == pytest.approx(supplied, rel=1e-10)
    assert row["internal_energy"] == pytest.approx(supplied, rel=1e-10)
    # the source alone would raise all temperatures alike
    uniform = HeatedSlab(START, DIFFUSIVITY, LENGTH, gradient=flux / CONDUCTIVITY)
    X = state(simulation)[0]
    wanted = uniform.fields(X, time)["temperature"] + source * time / HEAT_CAPACITY
    assert np.sqrt(total((temperature - wanted) ** 2) / total((wanted - START) ** 2)) < 2e-3


@pytest.mark.parametrize("free, coarse, fine", [((), 6e-3, 1.6e-3), (("X = 0",), 1.1e-2, 5e-3)])
def test_a_heat_flux_through_a_plane_of_symmetry_and_a_free_surface(free, coarse, fine):
    time, flux = 0.5, 1e6
    heated = [{"kind": "heat-flux", "plane": "X = 0", "heat_flux": flux}]
    exact = HeatedSlab(START, DIFFUSIVITY, LENGTH, gradient=flux / CONDUCTIVITY)
    errors = []
    for cells in (10, 20):
        simulation = slab(time, boundaries=heated, cells=cells, free=free)
        errors.append(relative_error(simulation, exact, time))
        _, temperature, capacity = state(simulation)
        supplied = time * flux * 2 * LENGTH / cells
        assert total(capacity * (temperature - START)) == pytest.approx(supplied, rel=1e-10)
    assert errors[0] < coarse and errors[1] < fine and errors[0] > 2.0 * errors[1]


def test_two_conductivities_beside_a_heated_plane_lose_no_heat():
    """The image of a plane is not known there, which then is a surface like others."""
    planes = [{"kind": "heat-flux", "plane": "Y = 0", "heat_flux": "1e6*(1 + t)"}, {"kind": "roller", "plane": "Y = 0"}]
    method = {"motion": False}
    body = {"temperature": START}
    tables = scene([0.0] * 2, [4e-3] * 2, 5e-4, 1e-3, material=MATERIAL, method=method, body=body, boundaries=planes)
    beside = {"shape": {"box": {"lower": [4e-3, 0.0], "upper": [8e-3, 4e-3]}}}
    tables["bodies"].append(tables["bodies"][0] | beside | {"material": MATERIAL | {"conductivity": 50.0}})
    simulation = Simulation(WORLD, parse_scene(tables | {"bond": [{"bodies": "all"}]}))
    for _ in range(20):
        simulation.take_step(1e-3)
    _, temperature, capacity = state(simulation)
    supplied = 1e6 * 8e-3 * (0.02 + 0.5 * 0.02**2)
    assert total(capacity * (temperature - START)) == pytest.approx(supplied, rel=1e-9)


def test_the_summary_says_how_many_particles_have_melted():
    time, melting = 1e-5, {"melting": {"kind": "constant", "temperature": 1400.0}}
    rise = {"heat_source": 50.0 * HEAT_CAPACITY / time}
    simulation = slab(time, f"1300 + 200*X/{LENGTH}", material=MATERIAL | melting, loads=rise)
    summary = simulation.systems[0].summary()
    # 1350 + 200 X/L reaches 1400 at a quarter of the length; 40 columns of four particles
    assert summary["melted_particles"] == 30 * 4
    assert summary["largest_temperature_over_melting"] == pytest.approx((1550.0 - 200.0 / 80) / 1400.0, rel=1e-4)
    assert "melted_particles" not in slab(time, loads=rise).systems[0].summary()


def test_faces_take_up_plastic_heat_alike_on_all_ranks(comm):
    flow = {"velocity": ["1e6*Y", 0.0], "box": {"lower": [-1e-3, -1e-3], "upper": [2e-3, 2e-3]}}
    held = [{"kind": "temperature", "plane": f"Y = {y}", "temperature": 300.0} for y in (0.0, 2e-4)]
    data = scene(
        [0.0, 0.0],
        [4e-4, 2e-4],
        2.5e-5,
        5e-5,
        material=MATERIAL,
        method={"transfer": "apic"},
        end_time=1.0,
        boundaries=[{"kind": "velocity", **flow}, *held],
        body={"velocity": flow["velocity"], "temperature": 300.0},
    )
    (spread, _), (single, _) = run_steps(data, 200, comm), run_steps(data, 200, comm.Split(comm.rank))
    found, wanted = gathered(spread, "temperature")[0], gathered(single, "temperature")[0]
    np.testing.assert_allclose(found, wanted, rtol=1e-10)


@pytest.mark.parametrize("basis", ["linear", "quadratic-spline", "cubic-spline"])
def test_no_temperature_leaves_the_range_of_those_that_there_were(basis):
    """A hot disc, the edge of which cuts cells, in a cold block with a hot and a cold face."""
    cells, held = (
        6,
        [{"kind": "temperature", "plane": f"Y = {y}", "temperature": t} for y, t in ((0, 1e3), (0.006, 100))],
    )
    sides = [{"kind": "roller", "plane": f"X = {x}"} for x in (0.0, 0.006)]
    body = {"temperature": "where((X - 0.0031)**2 + (Y - 0.0033)**2 < 0.0015**2, 1000, 100)"}
    data = scene(
        [0.0, 0.0],
        [0.006, 0.006],
        0.5e-3,
        0.006 / cells,
        material=MATERIAL,
        method={"basis": basis, "motion": False},
        boundaries=[*held, *sides],
        body=body,
    )
    rows = lambda sim: sim.systems[0].particles.owned_rows("temperature")  # noqa: E731
    ends = lambda sim: {"low": rows(sim).min(initial=500.0), "high": rows(sim).max(initial=500.0)}  # noqa: E731
    _, columns = run_steps(data, 60, WORLD, ends)
    assert columns["low"].min() > 98.0 and columns["high"].max() < 1002.0


def test_a_source_that_grows_is_taken_at_the_middle_of_steps():
    """The rule of the middle is exact for a power that is linear in time."""
    time, growth = 0.3, 4e7
    _, temperature, _ = state(slab(time, cells=4, loads={"heat_source": f"{growth}*t"}))
    np.testing.assert_allclose(temperature - START, 0.5 * growth * time**2 / HEAT_CAPACITY, rtol=1e-9)
