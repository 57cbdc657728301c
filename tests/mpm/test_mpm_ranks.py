"""One run on all ranks and on one: the same shape of a Taylor bar; every basis."""

import numpy as np
from mpm.points import crossing
from solids import gathered, run_steps


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
