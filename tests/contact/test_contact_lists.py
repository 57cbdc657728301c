"""Lists of contact leave nothing out that may press, and a look at them knows how long they hold."""

import time
import tracemalloc

import numpy as np
from contact.meeting import SPEED, block, simulated, tables
from mpi4py import MPI

from parsolid.contact.broad_phase import MovingBoxes, NearPairs, time_left
from parsolid.contact.friction import gap_correction
from parsolid.contact.report import describe_contacts
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

BOXES = [
    block("low", (0.0, -3.0), (6.0, 0.0), (12, 6), "cells"),
    block("top", (0.0, 0.0), (6.0, 3.0), (12, 6), "cells"),
]


def test_only_what_may_press_is_listed_and_nothing_else_presses():
    sim = simulated(tables(*BOXES))
    contact, rows = sim.interactions[0], sim.systems[0].particles.owned_rows
    position = rows("position")
    assert contact.search.pairs.active.sum() < contact.search.owned < 0.6 * len(position)
    # as far as lists hold: together by less than the skin
    position += 0.04 * np.random.default_rng(5).uniform(-1.0, 1.0, position.shape)
    position[rows("body") == 1, 1] -= 0.12
    contact.find_forces(held=True)
    energy, force = contact.energy, rows("contact_force").copy()
    contact.rebuild(0.0)
    contact.find_forces(held=True)
    assert energy > 0.0 and contact.energy == energy
    np.testing.assert_array_equal(rows("contact_force"), force)


def test_lists_hold_until_half_the_skin_is_used():
    sim = simulated(tables(*BOXES))
    contact, rows = sim.interactions[0], sim.systems[0].particles.owned_rows
    velocity, body = rows("velocity"), rows("body")
    velocity[body == 1, 1] = -0.2 * SPEED
    contact.rebuild(0.0)
    # half the skin at half the closing speed; sooner with one particle beside the face that is faster
    assert contact.broad_phase.time_left(0.0, 2.0) > 0.9
    row = int(np.argmin(np.abs(rows("position")[:, 1] - 0.25) + 10.0 * (body != 1)))
    velocity[row, 0] = 0.5 * SPEED
    skin = 0.5 * contact.broad_phase.skin[0]
    speed = float(np.hypot(0.5, 0.1)) * SPEED + 0.01 * SPEED
    assert abs(contact.broad_phase.time_left(0.0, 2.0) - skin / speed) < 1e-12


def test_particles_that_get_faster_leave_their_box_or_list_sooner():
    point, body = np.array([[0.9]]), np.array([0])
    # the body of the particle, and one 1.1 m away from it
    lower, upper = np.array([[0.0], [2.0]]), np.array([[1.0], [3.0]])
    boxes = MovingBoxes(lower, upper, np.zeros((2, 1)), np.array([0.1, 0.1]), np.array([0.25, 0.25]))
    no_partners = NearPairs(np.array([0, 0]), np.zeros(0, np.int64), *[np.zeros(0)] * 2)
    listed = NearPairs(np.array([0, 1]), np.array([1]), np.array([0.1]), np.array([1.0]))
    far = listed._replace(reach=np.array([0.8]))
    times = [
        time_left.py_func(point, 1.0 + 0.0 * point, point, body, np.array([0]), boxes, near, 0.0, 9.0)
        for near in (no_partners, listed, far)
    ]
    np.testing.assert_allclose(times, [0.2 / 1.25, 0.1 / 1.25, 0.2 / 1.25], rtol=1e-12)


def test_impulses_of_a_gap_that_closes_or_opens_count_for_the_time_of_pressing():
    # from -1 to 3: three quarters of the step; from 3 to -1: half a step too much, less three quarters
    assert gap_correction(-1.0, 3.0) == 3.0 * (0.75 - 1.0)
    assert gap_correction(3.0, -1.0) == -3.0 * 0.25
    assert gap_correction(1.0, 2.0) == gap_correction(-1.0, -2.0) == 0.0


def many(count: int) -> dict:
    """Small blocks beside one another in a square, every pair of them in contact."""
    side, blocks = int(np.ceil(count**0.5)), []
    for k in range(count):
        x, y = 0.8 * (k % side), 0.8 * (k // side)
        velocity = [0.05 * SPEED * np.sin(k), 0.05 * SPEED * np.cos(3 * k)]
        blocks.append(block(f"b{k}", (x, y), (x + 0.75, y + 0.75), (3, 3), "cells", velocity=velocity))
    return tables(*blocks, contact=[{"bodies": [one["name"] for one in blocks], "friction": 0.3}])


def test_time_and_memory_grow_with_the_number_of_bodies_and_not_with_its_square():
    found = []
    for count in (500, 2000):
        scene = parse_scene(many(count))
        tracemalloc.start()
        began = time.process_time()
        sim = Simulation(MPI.COMM_SELF, scene)
        describe_contacts(MPI.COMM_SELF, scene, sim.systems)
        contact = sim.interactions[0]
        contact.rebuild(0.0)
        contact.find_forces(held=True)
        found.append((time.process_time() - began, tracemalloc.get_traced_memory()[1], len(contact.broad_phase.own)))
        tracemalloc.stop()
    (_, few_bytes, few_pairs), (seconds, many_bytes, many_pairs) = found
    assert many_pairs < 4.5 * few_pairs < 200 * 500
    # 4 MB of the table of bodies that are not bonded, a byte a pair, are the only square
    assert many_bytes < 5.0 * few_bytes + 30e6 and seconds < 30.0
