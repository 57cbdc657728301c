"""The step that the operators of axes allow: below the exact limit of the box, by no more than it must be."""

from functools import reduce

import numpy as np
import pytest
from graded_boxes import growth_rate

from parsolid.pairs import box_stable_step
from parsolid.pairs.box_stable_step import BoxWaves, chords
from parsolid.pairs.box_weights import REACH, Axis, lengths_of, operator_of
from parsolid.scene.bodies import graded_shares

FREE = ("", "")
BOXES = {
    "plane": BoxWaves((Axis(9, 1.0, FREE), Axis(8, 1.0, FREE)), True, 1.0, True),
    "oblong": BoxWaves((Axis(8, 0.5, FREE), Axis(2, 1.0, FREE), Axis(3, 0.8, FREE)), True, 1.0, True),
    "graded": BoxWaves(
        (Axis(9, 0.8, FREE, (*np.linspace(0.0, 1.0, 9) ** 1.4 * 4 + np.linspace(0.0, 4.0, 9),)), Axis(8, 1.0, FREE)),
        True,
        1.0,
        True,
    ),
    "cells": BoxWaves((Axis(4, 1.0, FREE), Axis(3, 1.0, FREE), Axis(3, 1.0, FREE)), False, 1.0, True),
}


def gradient_and_jumps(axis: Axis, wide: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Norm (n,), gradient (n, n) and what a velocity gives a particle by its reconstructed jumps (n, n) of an axis."""
    n, q = axis.nodes, operator_of(axis, wide)
    Q = np.array([[q[i, j - i + REACH] if abs(j - i) <= REACH else 0.0 for j in range(n)] for i in range(n)])
    H, X = lengths_of(axis, wide), np.array(axis.places or range(n)) * axis.step
    D = (Q - np.diag(Q.sum(1))) / H[:, None]
    jumps, last = np.zeros((n, n)), 1 if wide and axis.places else 0
    for a, b in zip(range(last, n - 1 - last), range(last + 1, n - last)):
        jump = np.eye(n)[b] - np.eye(n)[a] - 0.5 * (X[b] - X[a]) * (D[a] + D[b])
        jumps[a] -= Q[a, b] * jump
        jumps[b] += Q[a, b] * jump
    return H, D, jumps


def operators(lattice: BoxWaves, pressure: float, shear: float) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping (n d, n d) of a free box over the mass."""
    parts = [gradient_and_jumps(axis, lattice.fourth_order and axis.has_room) for axis in lattice.axes]
    d, volume = len(parts), reduce(np.kron, [H for H, _, _ in parts])

    def along(k, matrices):
        return reduce(np.kron, [matrices if j == k else np.eye(len(part[0])) for j, part in enumerate(parts)])

    D = [along(k, part[1]) for k, part in enumerate(parts)]
    jumps = [along(k, part[2] / part[0][:, None]) for k, part in enumerate(parts)]
    lame, mu, W = pressure**2 - 2.0 * shear**2, shear**2, volume[:, None]
    blocks = [[lame * D[i].T @ (W * D[j]) + mu * D[j].T @ (W * D[i]) for j in range(d)] for i in range(d)]
    damping = np.zeros((d, len(volume), d, len(volume)))
    for i in range(d):
        blocks[i][i] = blocks[i][i] + mu * sum(D[k].T @ (W * D[k]) for k in range(d))
        speeds = [pressure if k == i else shear for k in range(d)]
        damping[i, :, i, :] = lattice.dissipation * sum(c * one for c, one in zip(speeds, jumps))
    stiffness = np.block(blocks) / np.tile(volume, d)[:, None]
    return stiffness, damping.reshape(stiffness.shape)


def growth(stiffness: np.ndarray, damping: np.ndarray, step: float) -> float:
    """Of the motion that grows most in a step: v += dt (-K x - B v), then x += dt v."""
    one = np.eye(len(stiffness))
    kept = one - step * damping
    return float(
        np.abs(np.linalg.eigvals(np.block([[kept, -step * stiffness], [step * kept, one - step**2 * stiffness]]))).max()
    )


@pytest.mark.serial
@pytest.mark.parametrize(
    ("dissipation", "ratio", "most"), [(1.0, 0.02, 1.35), (1.0, 0.7, 1.25), (0.5, 0.3, 1.2), (0, 0.7, 1.1)]
)
@pytest.mark.parametrize("name", BOXES)
def test_it_is_below_the_exact_limit_of_a_box_by_no_more_than_it_must_be(name, dissipation, ratio, most):
    lattice = BOXES[name]._replace(dissipation=dissipation)
    step = min(axis.step for axis in lattice.axes) / lattice.signal_speed(1.0, ratio)
    motions = operators(lattice, 1.0, ratio)
    assert growth(*motions, step) < 1.0 + 1e-6 and growth(*motions, most * step) > 1.01


@pytest.mark.serial
@pytest.mark.parametrize("name", BOXES)
def test_linear_forms_bound_it_between_all_ratios_of_wave_speeds(name):
    for dissipation in (0.0, 0.5, 1.0, 4.0):
        lattice = BOXES[name]._replace(dissipation=dissipation)
        forms = np.array(chords([lattice.signal_speed], 0.3))
        for ratio in (0.0, 0.1, 0.3, 0.6, 0.9, 1.0, 2.0):
            exact = lattice.signal_speed(1.0, ratio)
            most = 1.001 if ratio in (0.0, 0.3, 1.0) else 1.2
            assert 0.999 * exact < (forms @ (1.0, ratio)).max() < most * exact


def graded(nodes: int, grading: tuple[float, ...]) -> Axis:
    return Axis(nodes, 1.0, FREE, tuple((graded_shares(nodes, grading) * (nodes - 1)).tolist()))


@pytest.mark.serial
@pytest.mark.parametrize("dissipation", [0.25, 1.0, 4.0])
@pytest.mark.parametrize(
    ("nodes", "grading", "grows"),
    [
        (9, (1.0, 0.25, 1.0), (True,) * 3),
        *((n, g, (False,) * 3) for n in (8, 13) for g in ((1.0, 4.0, 1.0), (1.0, 0.7, 1.0), (1.0, 4.0), (1.0, 1.0))),
    ],
)
def test_gradings_whose_dissipation_feeds_waves_are_told(nodes, grading, grows, dissipation):
    axis, wanted = graded(nodes, grading), grows[(0.25, 1.0, 4.0).index(dissipation)]
    motions = operators(BoxWaves((axis,), True, dissipation, True), 1.0, 0.5)
    # along the axis, with the damping of pressure waves
    assert box_stable_step.feeds_waves(axis, True, dissipation) == wanted
    assert any(growth(square * motions[0], motions[1], 0.01) > 1.0 + 1e-7 for square in (1.0, 0.25, 0.01)) == wanted


@pytest.mark.serial
def test_plain_jumps_feed_no_waves_and_have_all_their_pairs():
    rates = np.linalg.eigvalsh(box_stable_step.axis_matrices(graded(9, (1.0, 4.0, 1.0)), True, False).power)
    assert abs(rates[0]) < 1e-12 and rates[1] > 0.05


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize(("most", "ratio", "grows"), [(4.0, 0.02, True), (1.5, 0.02, False)])
def test_what_keeps_the_volume_may_feed_waves_in_a_box(most, ratio, grows):
    """Where each axis alone does not."""
    axis = graded(8, (1.0, most, 1.0))
    lattice = BoxWaves((axis,) * 3, True, 1.0, True)
    rate = growth_rate(lattice, [gradient_and_jumps(axis, True)] * 3, 1.0, ratio)
    assert not box_stable_step.feeds_waves(axis, True, 1.0)
    assert box_stable_step.feeds_waves_of_volume(axis, 1.0, ratio) == grows and (rate > 1e-6) == grows


@pytest.mark.serial
@pytest.mark.parametrize(
    ("grading", "mirrored"),
    [
        *((g, FREE) for g in ((1.0, 3.0, 1.0), (1.0, 5.0), (2.0, 1.0, 2.0), (1.0, 1.0001))),
        ((1.0, 5.0, 1.0), ("roller", "")),
    ],
)
def test_the_step_of_long_graded_axes_is_bound_by_parts_of_them(grading, mirrored):
    axis = graded(300, grading)._replace(mirrors=mirrored).whole
    found = box_stable_step.axis_matrices(axis, True, True)
    for square, damping in ((0.5, 0.75), (0.0, 1.0)):
        whole = np.linalg.eigvalsh(square * found.F + 2.0 * damping * found.power)[-1]
        assert whole < box_stable_step._greatest_eigenvalue(axis, True, True, square, damping) < 1.004 * whole
    assert not box_stable_step.feeds_waves(graded(300, grading), True, 1.0)


@pytest.mark.serial
@pytest.mark.parametrize("wide", [True, False])
def test_long_axes_are_bounded_by_shorter_ones(wide, monkeypatch):
    def of(speeds):
        return BoxWaves((Axis(48, 1.0, FREE),) * 2, wide, 1.0, True).signal_speed(*speeds)

    bounded = [of(speeds) for speeds in ((1.0, 0.01), (1.0, 0.5), (0.0, 1.0))]
    monkeypatch.setattr(box_stable_step, "_MOST_NODES", 48)
    box_stable_step._greatest_eigenvalue.cache_clear()
    exact = [of(speeds) for speeds in ((1.0, 0.01), (1.0, 0.5), (0.0, 1.0))]
    box_stable_step._greatest_eigenvalue.cache_clear()
    assert all(0.9999 * one < bound < 1.02 * one for one, bound in zip(exact, bounded))


@pytest.mark.serial
@pytest.mark.parametrize("grading", [(), (1.0, 3.0), (1.0, 2.0, 1.0)])
def test_gradients_on_graded_axes_are_of_fourth_order_inside_and_second_at_ends(grading):
    errors = []
    for n in (17, 33, 65, 129):
        places = graded_shares(n, grading) * (n - 1) if grading else ()
        axis = Axis(n, 1.0 / (n - 1), FREE, tuple(places))
        X = graded_shares(n, grading or (1.0, 1.0))
        H, D, _ = gradient_and_jumps(axis, True)
        error = np.abs(D @ np.sin(5.0 * X) - 5.0 * np.cos(5.0 * X))
        errors.append((error[6:-6].max(), error.max()))
        assert H.sum() == pytest.approx(1.0, rel=1e-13) and np.abs(D @ X - 1.0).max() < 1e-11
    inside, ends = np.log2(np.array(errors)[:-1] / np.array(errors)[1:]).T
    assert inside.min() > 2.5 and inside[-1] > 3.5 and ends[1:].min() > 1.8
