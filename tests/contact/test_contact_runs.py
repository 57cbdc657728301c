"""Bodies that meet in runs: momenta and energy, the same on any number of ranks, and after a restart in contact."""

import numpy as np
import pytest
from contact.meeting import SOFT, SPEED, bars, block, simulated, tables
from mpi4py import MPI
from solids import recorded


def test_bars_exchange_their_velocities():
    data = bars(n=20, gap=0.002)
    sim = simulated(data)
    system = sim.systems[0]

    def mean(sim):
        body, v = system.particles.owned_rows("body"), system.particles.owned_rows("velocity")[:, 0]
        m = system.mass[: system.owned] * system.share[: system.owned]
        left, right = (float((m * v)[body == i].sum() / m[body == i].sum()) for i in (0, 1))
        return {"left": left, "right": right, "together": left + right}

    columns = recorded(sim, mean)
    v = 0.01 * SPEED
    # 1 but for dissipation
    assert (columns["right"][-1] - columns["left"][-1]) / v == pytest.approx(0.95, abs=0.02)
    assert np.abs(columns["together"]).max() < 1e-13 * v
    start = columns["kinetic"][0]
    assert np.abs(columns["energy_error"]).max() < 1.5e-3 * start
    pressed = columns["time"][columns["contact_energy"] > 1e-8 * start]
    assert (pressed[-1] - pressed[0]) * SPEED / 2.0 == pytest.approx(1.0, abs=0.03)
    assert columns["contact_energy"].max() > 0.01 * start and abs(columns["contact_energy"][-1]) < 1e-12 * start


@pytest.mark.serial
def test_a_bar_leaves_one_of_twice_its_impedance_with_a_third(comm):
    """Weights of fourth order, whose faces meet where those of the kernel do; with these the error is 3.5 %."""
    data = bars(n=26, wide=8, gap=0.002)
    data["bodies"][1]["material"] = SOFT | {"density": 2.0, "youngs_modulus": 2.0}
    v = 0.01 * SPEED
    data["bodies"][0]["velocity"], data["bodies"][1]["velocity"] = [v, 0.0], [0.0, 0.0]
    sim = simulated(data, comm)
    columns = recorded(sim)
    system = sim.systems[0]
    body, velocity = (system.particles.owned_rows(name) for name in ("body", "velocity"))
    momentum = system.mass[: system.owned] * system.share[: system.owned] * velocity[:, 0]
    found = comm.allreduce(np.array([momentum[body == i].sum() for i in (0, 1)])) / (np.array([1.0, 2.0]) * 8.0 / 26.0)
    assert system.body_weights == ["fourth-order"] * 2
    np.testing.assert_allclose(found / v, (-1.0 / 3.0, 2.0 / 3.0), rtol=0.0, atol=0.024)
    assert np.abs(columns["energy_error"]).max() < 1e-4 * columns["kinetic"][0]


@pytest.mark.ranks(2)
def test_contact_looks_ahead_from_the_step_on_which_ranks_agree(comm):
    left = block("left", (-1.125, 0.1), (-0.125, 0.6), (16, 8), "cells", velocity=[0.4 * SPEED, 0.1 * SPEED])
    data = tables(left, block("right", (0.0, 0.0), (0.5, 1.0), (8, 16), "cells"))
    found, wanted = (recorded(simulated(data, one), steps=25) for one in (comm, MPI.COMM_SELF))
    assert wanted["contact_energy"][-1] > 1e-3 * wanted["kinetic"][0]
    np.testing.assert_allclose(found["time"], wanted["time"], rtol=1e-12)
