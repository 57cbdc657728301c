"""Bodies of several methods that never meet: each moves as in a scene of its own, to the bit, on any number of ranks."""

import numpy as np
import pytest
from bodies_apart import METHODS, alone, mixed
from solids import Record, follow

from parsolid.simulation.loop import Simulation


def state(system) -> dict[str, np.ndarray]:
    return {name: np.array(rows) for name, rows in system.particles.checkpointed().items()}


def test_each_body_is_what_it_is_alone(comm):
    together = Simulation(comm, mixed())
    rows = follow(together, Record(), 20)
    assert [system.name for system in together.systems] == list(METHODS)
    sums = dict.fromkeys(rows, 0.0)
    for number, name in enumerate(METHODS):
        single = Simulation(comm, alone(name))
        for column, values in follow(single, Record(), 20).items():
            # the same term has another sign in another method
            sums[column] = sums[column] + values
        wanted, found = state(single.systems[0]), state(together.systems[number])
        shift = found.pop("identifier") - wanted.pop("identifier")
        assert np.all(shift == 64 * number) and list(found) == list(wanted)
        different = [one for one in wanted if found[one].tobytes() != wanted[one].tobytes()]
        assert not different, f"{name}: {different}"
    for column in ("kinetic", "stored", "dissipation_internal", "work_external", "balance"):
        scale = 1e-12 * rows["kinetic"].max()
        np.testing.assert_allclose(rows[column], sums[column], rtol=0.0, atol=scale, err_msg=column)
    assert abs(rows["stored"][-1]) > 1e-4 * rows["kinetic"][0]
