"""Strain of leapfrog, eight particles at a time, against four, of which laws are tested against plain numbers."""

import numpy as np
import pytest
from solids import column, simulation

from parsolid.methods.tlsph.leapfrog_kernels import ExactRelaxation, advance_strain
from parsolid.numerics.lanes import WIDTH
from parsolid.numerics.layout import Space
from parsolid.numerics.wide_lanes import WIDE
from parsolid.numerics.wide_space import WIDE_SPACE

# a block that neither begins nor ends with whole lanes
FIRST, LAST = 3, 32
STEP = 1e-4


@pytest.fixture(scope="module")
def system():
    """A column of 45 particles after some steps."""
    sim = simulation(column((3, 5, 3), method={"integrator": "leapfrog"}))
    for _ in range(4):
        sim.take_step(STEP)
    sim.systems[0].pairs.gradient("motion")
    return sim.systems[0]


def advanced(system, space):
    """What the kernel returns, and the arrays after it."""
    block, leapfrog = system.blocks[0], system.leapfrog
    body = type(system.body_of(block))(*(None if x is None else x.copy() for x in system.body_of(block)))
    relaxation = ExactRelaxation(block.relaxation(STEP), block.dissipation_weights(STEP))
    more = system.pairs.terms, leapfrog.weights, STEP, relaxation, body
    return advance_strain(space, FIRST, LAST, block.law, *more), body


@pytest.mark.skipif(WIDE == WIDTH, reason="the processor's registers hold four")
def test_eight_particles_at_once_are_strained_as_four_and_no_others_with_them(system):
    assert system.leapfrog._space_of(system.laws[0]) is WIDE_SPACE
    (sound, lost, signal), four = advanced(system, Space())
    (sound_too, lost_too, signal_too), eight = advanced(system, WIDE_SPACE)
    assert sound and sound_too and lost > 0.0
    np.testing.assert_allclose([lost_too, signal_too], [lost, signal], rtol=1e-12)
    for name in ("deformation", "branches", "sums"):
        np.testing.assert_allclose(getattr(eight, name), getattr(four, name), rtol=1e-12, atol=1e-13, err_msg=name)
    before = system.body_of(system.blocks[0])
    assert (eight.sums[FIRST:LAST] == 0.0).all() and (eight.sums[:FIRST] == before.sums[:FIRST]).all()
    assert (eight.sums[LAST:] == before.sums[LAST:]).all() and before.sums[LAST:].any()
    rows = slice(FIRST, LAST)
    np.testing.assert_allclose(eight.record[rows], four.record[rows], rtol=1e-12, atol=1e-6)


@pytest.mark.skipif(WIDE == WIDTH, reason="the processor's registers hold four")
@pytest.mark.parametrize("row", [FIRST + 6, LAST - 1])
def test_a_particle_turned_inside_out_is_not_sound(system, row):
    kept = system.particles.storage("strain")[0, row]
    system.particles.storage("strain")[0, row] = -1.0
    try:
        assert not advanced(system, WIDE_SPACE)[0][0]
    finally:
        system.particles.storage("strain")[0, row] = kept
