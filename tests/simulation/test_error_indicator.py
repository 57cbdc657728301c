"""The field `error_indicator`: its order where stresses are smooth, its place where the error is, and ranks."""

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from solids import RUBBER, punch, simulation, supports, tables

from parsolid.observables.declared import Observables
from parsolid.output.run_folder import RunFolder
from parsolid.simulation.field_output import FieldOutput, fit_of_neighbours, indicate

NAME = "error_indicator"
AMPLITUDE, WIDTH, START = 1e-6, 0.08, 0.35
GAUSS = f"exp(-((X - {START})/{WIDTH})**2)"


def indicated(sim) -> np.ndarray:
    indicate(sim.comm, sim.systems)
    return sim.systems[0].indicated


def pulse(across: int) -> dict:
    """A plane wave that runs along X: a bump of strain with the velocity that belongs to it."""
    modulus = RUBBER["youngs_modulus"] * 0.55 / (1.45 * 0.1)
    speed = (modulus / RUBBER["density"]) ** 0.5
    body = {
        "velocity": [f"{AMPLITUDE * speed}*{GAUSS}", "0"],
        "deformation_gradient": [[f"1 - {AMPLITUDE}*{GAUSS}", "0"], ["0", "1"]],
    }
    sides = supports(Y0=(0.0, "roller"), Y1=(4.0 / across, "roller"))
    data = tables([across + 1, 5], [1.0, 4.0 / across], material=RUBBER, body=body, boundaries=sides)
    return data | {"end_time": 0.25 / speed}


@pytest.mark.serial
@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_a_fit_of_neighbours_has_linear_fields_whatever_the_length(length):
    place = length * np.random.default_rng(2).uniform(size=(60, 2))
    values = 3.0 + place @ np.array([[2.0, -1.0], [0.5, 4.0]]) / length
    body = np.repeat([0.0, 1.0], 30)
    values[30:] += 100.0
    found = fit_of_neighbours(place, body, np.column_stack((place, body, values)), 0.6 * length, 2)
    np.testing.assert_allclose(found, values, rtol=1e-9)


@pytest.mark.serial
def test_it_falls_with_the_second_order_of_the_spacing_where_stresses_are_smooth():
    found = []
    for across in (40, 80, 160, 320):
        values = indicated(simulation(pulse(across)))
        found.append(np.sqrt(np.mean(values)))
    orders = np.log2(np.array(found[:-1]) / found[1:])
    assert orders[-1] == pytest.approx(2.0, abs=0.05) and (orders > 1.6).all(), orders


@pytest.mark.serial
def test_it_is_largest_where_the_error_of_the_stress_is():
    data = pulse(50)
    sim = simulation(data)
    sim.run()
    shown, values = Observables(sim.systems), indicated(sim)
    place = shown.rows("reference_position")[:, 0]
    exact = 1.0 - AMPLITUDE * np.exp(-(((place - START - 0.25) / WIDTH) ** 2))
    error = np.abs(shown.field("deformation_gradient")[:, 0, 0] - exact)
    worst, told = place[np.argmax(error)], place[np.argmax(values)]
    assert abs(worst - told) <= WIDTH, (worst, told)
    # the fifth with the largest indicator has most of the error
    first = np.argsort(-values)[: len(values) // 5]
    assert (error[first] ** 2).sum() > 0.6 * (error**2).sum()


def test_it_is_the_same_on_any_ranks_written_when_named_and_zero_for_uniform_stress(comm, shared_path):
    data = punch((13, 13)) | {"output": {"fields": [NAME]}}
    sim = simulation(data, comm)
    # a stress that bends, and jumps at one particle
    rows = sim.systems[0].particles.owned_rows
    place = rows("reference_position")
    assert np.abs(indicated(sim)).max(initial=0.0) < 1e-20
    one = simulation(data, MPI.COMM_SELF)
    for each in (sim, one):
        own = each.systems[0].particles.owned_rows
        own("deformation_gradient")[:, 0] += 1e-3 * own("reference_position")[:, 1] ** 2
        own("deformation_gradient")[own("identifier") == 84, 0] += 1e-2
    mine, alone = indicated(sim), indicated(one)
    whole = np.zeros(len(alone))
    whole[one.systems[0].particles.owned_rows("identifier")] = alone
    assert np.allclose(mine, whole[rows("identifier")], rtol=1e-9, atol=1e-12 * alone.max())
    assert np.argmax(whole) == 84 and place.shape[1] == 2
    FieldOutput(sim, RunFolder(comm, shared_path)).write(sim)
    if comm.rank == 0:
        with h5py.File(shared_path / "fields.vtkhdf") as file:
            written = file["VTKHDF/PointData"][NAME][:]
        assert np.allclose(written[: len(whole)], whole, rtol=1e-6, atol=1e-9 * alone.max())
