"""How steps are chosen: at most the stable one, landing exactly, no slivers, none of length 0 but where loads jump."""

import math

import pytest

from parsolid.simulation.time_step import TimeSteps

pytestmark = pytest.mark.serial


def walk(steps: TimeSteps, stable: float, time: float = 0.0) -> list[tuple[float, float]]:
    """(step, time it leads to) until the end."""
    taken = []
    while time < steps.end and len(taken) < 1000:
        taken.append(steps.next(time, stable))
        time = taken[-1][1]
    return taken


@pytest.mark.parametrize("even", [False, True])
@pytest.mark.parametrize("stable", [0.3, 0.1, 0.07, 0.0333])
def test_every_landing_is_met_exactly_and_no_step_is_a_sliver(even, stable):
    stop_times = [0.1, 1.0 / 3.0, 0.7]
    steps = walk(TimeSteps(stop_times, [], 1.0, even), stable)
    times = [time for _, time in steps]
    assert {*stop_times, 1.0} <= set(times) and times == sorted(set(times)) and times[-1] == 1.0
    lengths = [step for step, _ in steps]
    assert max(lengths) <= stable * (1.0 + 1e-9) and min(lengths) >= 0.5 * min(stable, 0.1) * (1.0 - 1e-9)
    assert math.fsum(lengths) == pytest.approx(1.0, rel=1e-14)


def test_even_steps_between_two_landings_have_one_length():
    steps = walk(TimeSteps([0.5], [], 1.0, even=True), 0.15)
    assert [step for step, _ in steps] == pytest.approx([0.125] * 8, rel=1e-14)
    # without, the stable step is taken while two of them fit
    uneven = [step for step, _ in walk(TimeSteps([], [], 1.0), 0.3)]
    assert uneven == pytest.approx([0.3, 0.3, 0.2, 0.2])


def test_a_rounding_error_before_a_landing_is_stretched_over():
    assert TimeSteps([], [], 1.0).next(0.9, 0.1 * (1.0 - 1e-10)) == (pytest.approx(0.1), 1.0)


def test_a_jump_has_one_step_of_length_zero():
    steps = TimeSteps([], [0.0, 0.5], 1.0)
    assert walk(steps, 0.3) == [
        (0.0, 0.0),
        (0.25, 0.25),
        (0.25, 0.5),
        (0.0, 0.5),
        (0.25, 0.75),
        (0.25, 1.0),
    ]
    again = TimeSteps([], [0.0, 0.5], 1.0)
    again.jumped = 0.5
    assert again.next(0.5, 0.3) == (0.25, 0.75)


def test_the_longest_step_bounds_the_stable_one():
    assert TimeSteps([], [], 1.0, longest=1e-3).next(0.0, 0.1) == (1e-3, 1e-3)


def test_where_bodies_meet_steps_grow_by_a_quarter_at_most():
    steps, lengths, time = TimeSteps([], [], 1.0, growth=1.25), [], 0.0
    for stable in (0.01, 0.001, *[0.1] * 8):
        step, time = steps.next(time, stable)
        steps.last = step
        lengths.append(step)
    assert lengths[:2] == [0.01, 0.001]
    assert lengths[2:] == pytest.approx([0.001 * 1.25**k for k in range(1, 9)], rel=1e-12)
