"""The law of contact: forces are the derivative of the energy, nothing where bodies touch or are apart, kappa delta
where they overlap, and no friction of a motion that they share."""

import numpy as np
import pytest
from contact.meeting import MODULUS, bars, block, discs, simulated, tables

from parsolid.collective import SolverError


def contact_of(sim):
    return sim.interactions[0]


def moved(sim, body, by):
    """Move a body of the first system, and give its contact new lists."""
    here = sim.systems[0].particles.owned_rows("body") == body
    sim.systems[0].particles.owned_rows("position")[here] += by
    contact_of(sim).rebuild(0.0)


def pressure(sim) -> float:
    """Force that the first body feels over the width of its face."""
    system = sim.systems[0]
    here = system.particles.owned_rows("body") == 0
    return -float((system.particles.owned_rows("contact_force")[:, 0] * system.share[: system.owned])[here].sum())


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("placement", ["vertices", "cells"])
def test_forces_are_the_derivative_of_the_energy(d, placement):
    ends = placement == "vertices"
    sizes = ([3, 3, 3][:d], [4, 4, 4][:d])
    boxes = [block("a", [0.0] * d, [3.0] * d, [n + ends for n in sizes[0]], placement)]
    boxes += [block("b", [3.0] + [0.4] * (d - 1), [6.0] + [3.4] * (d - 1), [n + ends for n in sizes[1]], placement)]
    sim = simulated(tables(*boxes))
    position = sim.systems[0].particles.owned_rows("position")
    rng = np.random.default_rng(3)
    position += 0.05 * rng.normal(size=position.shape)
    moved(sim, 0, 0.3)
    contact = contact_of(sim)
    contact.find_forces(held=True)
    force = sim.systems[0].particles.owned_rows("contact_force").copy()
    assert contact.energy > 1e-4 and np.abs(force).max() > 1e-3
    for _ in range(3):
        direction, step, energies = rng.normal(size=position.shape), 1e-6, []
        for sign in (1.0, -2.0):
            position += sign * step * direction
            contact.find_forces(held=True)
            energies.append(contact.energy)
        position += step * direction
        found = -(energies[0] - energies[1]) / (2.0 * step)
        assert found == pytest.approx(np.sum(force * direction), rel=1e-6)


@pytest.mark.parametrize(
    "placement, wide, weights, wanted",
    [
        ("vertices", 3, "kernel", (0.0199, 0.0995, 0.283)),
        ("vertices", 8, "fourth-order", (0.0199, 0.0995, 0.283)),
        ("cells", 6, "kernel", (0.0207, 0.122, 0.489)),
    ],
)
def test_pressure_against_overlap(placement, wide, weights, wanted):
    """Alike for all weights of nodes: contact sees where matter is."""
    sim = simulated(bars(n=10, wide=wide, placement=placement))
    assert sim.systems[0].body_weights == [weights] * 2
    h, width = 0.1, 0.1 * wide
    contact = contact_of(sim)
    assert contact.contact_bodies.laws[0][1].stiffness == pytest.approx(MODULUS / h, rel=1e-12)
    at = 0.0
    for overlap, share in zip((0.02, 0.1, 0.3), wanted):
        moved(sim, 0, np.array([(overlap - at) * h, 0.0]))
        at = overlap
        contact.find_forces(held=True)
        assert pressure(sim) / (MODULUS * width) == pytest.approx(share, rel=4e-3)


def test_touching_faces_feel_little_and_bodies_apart_nothing():
    for data in (bars(), bars(wide=8), bars(placement="cells"), bars(ratio=4.0 / 3.0, n=12, wide=6)):
        sim = simulated(data)
        contact_of(sim).find_forces(held=True)
        assert abs(pressure(sim)) < 4e-5 * MODULUS
        moved(sim, 0, np.array([-0.02, 0.0]))
        contact_of(sim).find_forces(held=True)
        assert np.all(sim.systems[0].particles.owned_rows("contact_force") == 0.0)
        assert contact_of(sim).energy == 0.0


def test_a_shared_motion_rubs_nothing_and_a_slip_rubs_with_kept_momenta():
    data = discs(friction=0.5)
    sim = simulated(data)
    system, contact = sim.systems[0], contact_of(sim)
    position = system.particles.owned_rows("position")
    moved(sim, 0, np.array([0.13, 0.03]))
    contact.find_forces(held=False)
    assert contact.energy > 0.0
    contact.stuck = 0.0
    system.particles.owned_rows("contact_stick")[:] = 0.0
    # both turn and drift together by a finite angle
    turn = 0.3
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    position[:] = position @ R.T + 0.1
    contact.rebuild(0.0)
    contact.find_forces(held=False)
    assert contact.stuck < 1e-24 * contact.energy
    # one slides on the other
    here = system.particles.owned_rows("body") == 0
    position[here] += 0.01 * R @ np.array([0.3, 0.7])
    contact.find_forces(held=False)
    assert contact.stuck > 1e-6 * contact.energy
    force = system.particles.owned_rows("external_force")
    force[:] = 0.0
    contact.act(0.0)
    assert np.abs(force).max() > 0.0
    moment = position[:, 0] @ force[:, 1] - position[:, 1] @ force[:, 0]
    np.testing.assert_allclose([*force.sum(axis=0), moment], 0.0, atol=1e-12 * np.abs(force).max())


def test_one_layer_and_bodies_in_one_another_are_refused():
    thick = block("thick", (0.0, 0.0), (4.0, 1.0), [16, 4], "cells")
    for count, placement in ((16, "cells"), (17, "vertices")):
        layer = block("layer", (0.0, 1.0), (4.0, 1.25), [count, 1], placement)
        with pytest.raises(SolverError, match="at least two layers of particles, found one in layer"):
            simulated(tables(thick, layer))
    deep = block("deep", (0.0, 1.0), (4.0, 2.0), [16, 4], "cells", displacement=["0", "-0.5"])
    with pytest.raises(SolverError, match=r"do not lie in one another at the start, found (thick|deep) .* in"):
        simulated(tables(thick, deep))
