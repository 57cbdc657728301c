"""One run on all ranks and on one: the same shape of a Taylor bar; every basis."""

import numpy as np
import pytest
from points import crossing, final_shape, taylor_bar
from solids import assert_same_fields, gathered, run_steps, run_to_end, simulation

FIELDS = ("position", "velocity", "deformation_gradient", "stress_and_volume")


@pytest.mark.parametrize(
    "order, transfer, end", [("musl", "flip", 80e-6), ("usl", "flip", 10e-6), ("usl", "apic", 10e-6)]
)
def test_the_taylor_bar_does_not_depend_on_the_ranks(comm, order, transfer, end):
    data = taylor_bar(1.6e-3, order=order, transfer=transfer, end_time=end)
    (spread, many), (single, one) = run_to_end(data, comm), run_to_end(data, comm.Split(comm.rank))
    length = final_shape(single)[1]
    assert length < (22e-3 if end == 80e-6 else 31e-3)
    np.testing.assert_allclose(final_shape(spread), final_shape(single), rtol=0.0, atol=1e-9 * length)
    for name, values in one.items():
        scale = one["kinetic"][0]
        np.testing.assert_allclose(many[name][-1], values[-1], rtol=0.0, atol=1e-6 * scale, err_msg=name)


@pytest.mark.every_other
@pytest.mark.parametrize("basis", ["linear", "ugimp", "quadratic-spline", "cubic-spline"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_every_basis_gives_the_same_on_any_ranks(comm, basis, dimension):
    cell = 1.6e-3 if dimension == 3 else 8e-4
    data = taylor_bar(cell, dimension=dimension, length=16e-3, basis=basis, order="usl")
    (spread, many), (single, one) = run_steps(data, 40, comm), run_steps(data, 40, comm.Split(comm.rank))
    assert_same_fields(spread, single, FIELDS, 1e-10)
    np.testing.assert_allclose(many["time"], one["time"], rtol=1e-12)
    assert np.abs(gathered(single, "plastic_strain")[0]).max() > 0.05


@pytest.mark.slow
@pytest.mark.every_other
@pytest.mark.parametrize("method", [{}, {"order": "musl", "transfer": "apic"}])
@pytest.mark.parametrize("cells", [(4, 3), (4, 3, 2)])
def test_a_body_that_crosses_the_domain(comm, cells, method):
    data = crossing(cells=cells, **method)
    (spread, _), (single, _) = run_steps(data, 250, comm), run_steps(data, 250, comm.Split(comm.rank))
    moved = gathered(single, "position")[0] - gathered(single, "reference_position")[0]
    # farther than the block is long: every particle is in cells that none was in at first
    assert moved[:, 0].min() > 1.5 * 0.1 * cells[0]
    assert_same_fields(spread, single, FIELDS, 1e-10)
    assert (spread.systems[0].summary()["migrated_particles"] > 0) == (comm.size > 1)
    # forces on nodes lighter than a thousand-millionth of a particle are left out
    np.testing.assert_allclose(momentum(spread), momentum(simulation(data, comm)), rtol=1e-9)


def momentum(sim) -> np.ndarray:
    """Of all particles in the first two directions [kg m/s]; collective."""
    owned = sim.systems[0].owned
    mine = sim.systems[0].mass[:owned] @ sim.systems[0].particles.owned_rows("velocity")[:, :2]
    return sim.comm.allreduce(mine)


def test_cells_are_dealt_out_anew_when_the_load_drifts(comm):
    (even, _), (drifted, _) = (run_steps(crossing(cells=(8, 5), rebalance=limit), 160, comm) for limit in (1.01, 100.0))
    single, _ = run_steps(crossing(cells=(8, 5)), 160, comm.Split(comm.rank))
    for sim in (even, drifted):
        found, wanted = gathered(sim, "position")[0], gathered(single, "position")[0]
        np.testing.assert_allclose(found, wanted, atol=1e-10 * np.abs(wanted).max())
    if comm.size > 1:
        assert even.systems[0].summary()["rebalanced"] > 0 == drifted.systems[0].summary()["rebalanced"]
        loads = [sim.systems[0].grid.imbalance(sim.systems[0].owned) for sim in (even, drifted)]
        assert loads[0] < 1.1 and loads[1] > 1.5
