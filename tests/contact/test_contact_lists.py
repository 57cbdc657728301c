"""Lists of contact leave nothing out that may press, and a look at them knows how long they hold."""

import numpy as np
from meeting import SPEED, block, simulated, tables

from parsolid.contact.friction import gap_correction


def test_only_what_may_press_is_listed_and_nothing_else_presses():
    boxes = [
        block("low", (0.0, -3.0), (6.0, 0.0), (12, 6), "cells"),
        block("top", (0.0, 0.0), (6.0, 3.0), (12, 6), "cells"),
    ]
    sim = simulated(tables(*boxes))
    contact, position = sim.interactions[0], sim.systems[0].particles.owned_rows("position")
    assert contact.search.pairs.active.sum() < contact.search.owned < 0.6 * len(position)
    rng = np.random.default_rng(5)
    # as far as lists hold: together by less than the skin
    position += 0.04 * rng.uniform(-1.0, 1.0, position.shape)
    position[sim.systems[0].particles.owned_rows("body") == 1, 1] -= 0.12
    contact.find_forces(None, held=True)
    energy, force = contact.energy, sim.systems[0].particles.owned_rows("contact_force").copy()
    contact.rebuild(0.0)
    contact.find_forces(None, held=True)
    assert energy > 0.0 and contact.energy == energy
    np.testing.assert_array_equal(sim.systems[0].particles.owned_rows("contact_force"), force)


def test_lists_hold_until_half_the_skin_is_used():
    boxes = [
        block("low", (0.0, -3.0), (6.0, 0.0), (12, 6), "cells"),
        block("top", (0.0, 0.0), (6.0, 3.0), (12, 6), "cells"),
    ]
    sim = simulated(tables(*boxes))
    contact, velocity = sim.interactions[0], sim.systems[0].particles.owned_rows("velocity")
    # what two bodies of a kind have to know is found once
    assert contact.body_pairs.pairs[0].law is contact.body_pairs.pairs[1].law
    body = sim.systems[0].particles.owned_rows("body")
    velocity[body == 1, 1] = -0.2 * SPEED
    contact.rebuild(0.0)
    # half the skin at half the closing speed; sooner with one particle beside the face that is faster
    assert contact.boxes.time_left(0.0, 2.0) > 0.9
    row = int(np.argmin(np.abs(sim.systems[0].particles.owned_rows("position")[:, 1] - 0.25) + 10.0 * (body != 1)))
    velocity[row, 0] = 0.5 * SPEED
    skin = 0.5 * contact.body_pairs.skin[0]
    speed = float(np.hypot(0.5, 0.1)) * SPEED + 0.01 * SPEED
    assert abs(contact.boxes.time_left(0.0, 2.0) - skin / speed) < 1e-12


def test_impulses_of_a_gap_that_closes_or_opens_count_for_the_time_of_pressing():
    # from -1 to 3: three quarters of the step; from 3 to -1: half a step too much, less three quarters
    assert gap_correction(-1.0, 3.0) == 3.0 * (0.75 - 1.0)
    assert gap_correction(3.0, -1.0) == -3.0 * 0.25
    assert gap_correction(1.0, 2.0) == gap_correction(-1.0, -2.0) == 0.0
