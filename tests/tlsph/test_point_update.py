"""The compiled update of particles on tiles against the same functions in plain Python, of whole and partly filled
tiles, and what it says of particles that are not sound."""

import numpy as np
import pytest
from solids import ONE_BRANCH, SOFT, column, evolved, simulation, tables

from parsolid.kernels import kernel
from parsolid.methods.tlsph.point_update import TILE, make_tile, update_tile
from parsolid.methods.tlsph.state import LawBlock

STEP = 1e-2


@kernel
def compiled_update(*arguments):
    """As the sweeps call it."""
    update_tile(*arguments)


def moving(dimension, law, particles):
    """A body in motion, with one force evaluation a step."""
    velocity = ["0.5*X + 0.3*Y*Y", "0.2*X - 0.4*Y", "0.1*X*Y + 0.3*Z"][:dimension]
    data = tables(particles, material={**SOFT, **law}, method={"integrator": "leapfrog"}, body={"velocity": velocity})
    return simulation(data).systems[0]


@pytest.mark.parametrize("law", [{}, {"zeta": 0.3, "branches": [*ONE_BRANCH, {"beta": 0.4, "tau": 0.03}]}], ids=str)
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_tile_has_the_numbers_of_plain_python(dimension, law):
    block: LawBlock = moving(dimension, law, (3,) * dimension).blocks[0]
    random, results = np.random.default_rng(4), []
    F, G = (0.1 * random.normal(size=(9, TILE)) for _ in range(2))
    plane = dimension == 2
    for tensor in (F, G):
        tensor[[2, 5, 6, 7, 8] if plane else []] = 0.0
    F += make_tile(9).reshape(9, TILE)
    for function in (compiled_update, update_tile):
        tile = {name: make_tile(size) for name, size in {"J": 1, "P": 9, "Z": 2, "signal": 1, "lost": 1}.items()}
        state, A = F.ravel().copy(), None if block.A is None else block.A.copy()
        signals = (1.2, 1.0, 1.0, 1.1, 0.9, 1.3)
        function(
            *(block.solid, STEP, 0.0 if plane else 1.0, signals, block.branches(STEP)[:4], state, G.ravel().copy()),
            *(A, block.branch_sum, make_tile(9), tile["J"], tile["P"], tile["Z"], tile["signal"], tile["lost"]),
            *(None, 0, TILE),
        )
        results.append([state, *tile.values(), *([] if A is None else [A])])
    for found, wanted in zip(*results):
        np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-12 * np.abs(wanted).max())
    np.testing.assert_allclose(results[0][0], F.ravel() + STEP * G.ravel(), rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("particles", [(3, 3, 3), (4, 4, 4), (4, 5, 5)], ids=["part", "two", "more"])
def test_what_a_tile_leaves_empty_counts_nowhere(particles):
    """Sums over the particles of one body in two blocks are those of one."""
    data = column(particles, method={"integrator": "leapfrog"})
    one, two = (simulation(data) for _ in range(2))
    system = two.systems[0]
    law, middle = system.laws[0], system.owned // 2 - 3
    system.blocks = [LawBlock(system.particles, *ends, law) for ends in ((0, middle), (middle, system.owned))]
    system.lists.isotropic = dict.fromkeys(system.blocks, 0.0)
    for sim in (one, two):
        for _ in range(4):
            sim.take_step(1e-4)
    for name in evolved(system.particles):
        values = (np.array(sim.systems[0].particles.owned_rows(name)) for sim in (one, two))
        np.testing.assert_array_equal(*values, err_msg=name)
    rows = [sim.ledger.row(sim.comm, *sim.systems[0].energies()) for sim in (one, two)]
    for name, value in rows[0].items():
        assert rows[1][name] == pytest.approx(value, rel=1e-11, abs=1e-12 * rows[0]["kinetic"]), name


@pytest.mark.parametrize("row", [0, 31, 32, 44])
def test_a_particle_turned_inside_out_is_not_sound(row):
    system = simulation(column((3, 5, 3), method={"integrator": "leapfrog"})).systems[0]
    assert system.lists.advance_step(0.0)[0]
    system.particles.owned_rows("deformation_gradient")[row, 0] = -1.0
    assert not system.lists.advance_step(0.0)[0]
    assert system.first_invalid()[0] == row
