"""Motion of rigid tools against exact solutions."""

import numpy as np
import pytest
from scipy.special import ellipj

from parsolid.contact.tools.rigid_body import FreeBody, GuidedBody, Pose, rotation_matrix, rotation_vector, turn

INERTIA = np.array([3.0, 2.0, 1.0])


def top(spin, axes=None) -> FreeBody:
    pose = Pose(np.zeros(3), spin=np.array(spin))
    return FreeBody(pose, 2.0, INERTIA, np.eye(3) if axes is None else axes, np.ones(3), True)


def in_space(body):
    """Angular momentum about the place."""
    return body.pose.matrix @ body.axes @ body.angular


def exact_spin(spin, t):
    """Euler's top, with the spin about the second axis 0 at the start (Landau and Lifshitz, Mechanics, section 37)."""
    (a, b, c), (p, _, r) = INERTIA[::-1], spin[::-1]
    energy, square = a * p * p + c * r * r, (a * p) ** 2 + (c * r) ** 2
    assert square > b * energy
    rate = np.sqrt((c - b) * (square - energy * a) / (a * b * c))
    m = (b - a) * (energy * c - square) / ((c - b) * (square - energy * a))
    sn, cn, dn, _ = ellipj(rate * t, m)
    second = np.sqrt((energy * c - square) / (b * (c - b)))
    return np.array([r * dn, second * sn, p * cn])


def test_free_asymmetric_top_of_second_order():
    spin, end, errors = [1.0, 0.0, 0.4], 7.0, []
    for steps in (40, 80, 160, 320):
        body = top(spin)
        momentum, energy = in_space(body), body.kinetic
        drift = 0.0
        for _ in range(steps):
            body.drift(0.0, end / steps)
            drift = max(drift, abs(body.kinetic / energy - 1.0))
        assert np.abs(in_space(body) - momentum).max() < 1e-13 * np.linalg.norm(momentum)
        errors.append(np.abs(np.abs(body.angular / INERTIA) - np.abs(exact_spin(spin, end))).max())
        assert drift < 0.05 * (40 / steps) ** 2
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 2.0) < 0.1), orders
    assert errors[-1] < 1e-3


def test_the_frame_of_the_shape_does_not_matter():
    axes = rotation_matrix(turn(np.array([2.0, 1.0, 2.0]) / 3.0, 0.7))
    one, other = top([1.0, 0.2, 0.4]), top(axes @ [1.0, 0.2, 0.4], axes)
    for _ in range(50):
        one.drift(0.0, 0.05)
        other.drift(0.0, 0.05)
    assert np.allclose(axes @ one.pose.spin, other.pose.spin, atol=1e-13)


def test_kicks_give_linear_and_angular_momentum():
    body = top([0.3, 0.0, 0.1])
    before = in_space(body)
    body.drift(0.0, 0.3)
    body.kick(np.array([1.0, 2.0, 3.0]), np.array([0.5, -0.2, 0.1]))
    assert np.allclose(in_space(body), before + np.array([0.5, -0.2, 0.1]), atol=1e-14)
    assert np.allclose(body.pose.velocity, [0.5, 1.0, 1.5])


def test_what_is_held_does_not_move():
    body = FreeBody(Pose(np.zeros(3)), 2.0, INERTIA, np.eye(3), np.array([False, True, False]), False)
    body.kick(np.ones(3), np.ones(3))
    body.drift(0.0, 1.0)
    assert body.pose.place.tolist() == [0.0, 0.5, 0.0] and body.pose.spin.tolist() == [0.0, 0.0, 0.0]


def test_guided_motion_is_the_integral_of_its_formulas():
    def course(time):
        return np.array([np.cos(time), time**2, 0.0]), 0.4 * time

    axis, about = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    body = GuidedBody(Pose(np.array([2.0, 0.0, 0.0])), course, axis, about)
    for k in range(20):
        body.drift(0.1 * k, 0.1)
    angle = 0.2 * 2.0**2
    arm = np.array([np.cos(angle), np.sin(angle), 0.0])
    assert np.allclose(body.pose.place, about + np.array([np.sin(2.0), 8.0 / 3.0, 0.0]) + arm, atol=1e-12)
    assert np.allclose(body.pose.velocity, [np.cos(2.0) - 0.8 * arm[1], 4.0 + 0.8 * arm[0], 0.0], atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 3.0])
def test_rotation_vectors(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    assert np.allclose(rotation_vector(turn(axis, angle)), angle * axis, rtol=1e-12, atol=1e-15)
