"""Motion of a rigid body: place, rotation, momentum; free, or prescribed as formulas of time.

Vectors have three components in any dimension. Rotations are unit quaternions (w, x, y, z) from the frame of the shape
to that of space. The free rotation is split into rotations about the principal axes, second order, symplectic, exact
in the angular momentum (Dullweber, Leimkuhler, McLachlan, J. Chem. Phys. 107 (1997) 5840).
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The quaternion (4,) of the rotation q followed by p."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.concatenate(([p[0] * q[0] - p[1:] @ q[1:]], vector))


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """The quaternion (4,) of a rotation by an angle [rad] about an axis (3,) of unit length."""
    return np.concatenate(([np.cos(0.5 * angle)], np.sin(0.5 * angle) * axis))


def rotation_matrix(q: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) of a unit quaternion."""
    w, x, y, z = q
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def rotation_vector(q: np.ndarray) -> np.ndarray:
    """Axis times angle (3,) [rad] of a unit quaternion; the angle is at most pi."""
    q = q if q[0] >= 0.0 else -q
    sine = float(np.linalg.norm(q[1:]))
    return np.asarray(q[1:] * (2.0 * np.arctan2(sine, q[0]) / sine if sine > 0.0 else 2.0))


@dataclass
class Pose:
    """Place (3,) [m], rotation (4,), velocity (3,) [m/s] of the place, and spin (3,) [rad/s] in space of a tool."""

    place: np.ndarray
    rotation: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    spin: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @property
    def matrix(self) -> np.ndarray:
        """The rotation as a matrix (3, 3)."""
        return rotation_matrix(self.rotation)

    def power(self, force: np.ndarray, moment: np.ndarray) -> float:
        """Power [W] of a force (3,) [N] and its moment (3,) [N m] about the place."""
        return float(force @ self.velocity + moment @ self.spin)

    def go_on(self, time: float) -> None:
        """Move and turn for a time [s] with the present velocity and spin."""
        rate = float(np.linalg.norm(self.spin))
        self.place = self.place + time * self.velocity
        if rate * time != 0.0:
            self.rotation = product(turn(self.spin / rate, rate * time), self.rotation)


class FreeBody:
    """A rigid body that moves by forces.

    mass [kg]; inertia (3,) [kg m^2] about the principal axes (3, 3), columns in the frame of the shape; free (3,): 1
    for components of the velocity that may change, else 0; turns: whether it may rotate; angular (3,) [kg m^2/s]:
    angular momentum along the principal axes.
    """

    def __init__(
        self, pose: Pose, mass: float, inertia: np.ndarray, axes: np.ndarray, free: np.ndarray, turns: bool
    ) -> None:
        """pose: with its velocity and spin, zero in the components that are not free."""
        self.pose, self.mass, self.inertia, self.axes = pose, mass, inertia, axes
        self.free, self.turns = free.astype(float), turns
        self.angular = inertia * self._to_axes(pose.spin) if turns else np.zeros(3)

    def _to_axes(self, vector: np.ndarray) -> np.ndarray:
        """Components along the principal axes of a vector in space."""
        return np.asarray(self.axes.T @ (self.pose.matrix.T @ vector))

    def spin_of(self, angular: np.ndarray) -> np.ndarray:
        """Spin (3,) [rad/s] in space of an angular momentum along the principal axes."""
        return np.asarray(self.pose.matrix @ (self.axes @ (angular / self.inertia)))

    def _follow_spin(self) -> None:
        if self.turns:
            self.pose.spin = self.spin_of(self.angular)

    @property
    def kinetic(self) -> float:
        """Kinetic energy [J]."""
        return self.energy_of_change(np.zeros(3), np.zeros(3))

    def square_of(self, stiffness: float, turning: float) -> float:
        """Upper bound of the square of the angular frequency [1/s^2] on springs, by the sums of their stiffnesses [N/m]
        and of stiffnesses times squared arms [N m]."""
        return stiffness / self.mass + (turning / float(self.inertia.min()) if self.turns else 0.0)

    def kick(self, impulse: np.ndarray, moment: np.ndarray) -> None:
        """Apply an impulse (3,) [N s] and its moment about the place (3,) [N m s]."""
        self.pose.velocity = self.pose.velocity + self.free * impulse / self.mass
        if self.turns:
            self.angular = self.angular + self._to_axes(moment)
            self._follow_spin()

    def energy_of_change(self, velocity: np.ndarray, angular: np.ndarray) -> float:
        """Kinetic energy [J] of the change from a velocity (3,) [m/s] and an angular momentum (3,) along the axes."""
        change, turned = self.pose.velocity - velocity, self.angular - angular
        energy = self.mass * float(change @ change)
        return 0.5 * (energy + (float(turned @ (turned / self.inertia)) if self.turns else 0.0))

    def drift(self, time: float, step: float) -> None:
        """Move for a step [s] without forces; second order in the rotation."""
        self.pose.place = self.pose.place + step * self.pose.velocity
        if not self.turns or not self.angular.any():
            return
        for k, share in ((0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5)):
            angle = share * step * self.angular[k] / self.inertia[k]
            i, j = (k + 1) % 3, (k + 2) % 3
            cosine, sine = np.cos(angle), np.sin(angle)
            a, b = self.angular[i], self.angular[j]
            self.angular[i], self.angular[j] = cosine * a + sine * b, cosine * b - sine * a
            self.pose.rotation = product(self.pose.rotation, turn(self.axes[:, k], angle))
        self.pose.rotation = self.pose.rotation / np.linalg.norm(self.pose.rotation)
        self._follow_spin()

    def state(self) -> dict[str, Any]:
        """Place, rotation, velocity and angular momentum, as JSON has them."""
        pose = self.pose
        vectors = {"place": pose.place, "rotation": pose.rotation, "velocity": pose.velocity, "angular": self.angular}
        return {name: vector.tolist() for name, vector in vectors.items()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        for name in ("place", "rotation", "velocity"):
            setattr(self.pose, name, np.array(state[name]))
        self.angular = np.array(state["angular"])
        self._follow_spin()


# points and weights of Gauss's and Lobatto's quadrature over a step, exact for polynomials of degree 5
Rule = tuple[tuple[float, float], ...]
_GAUSS: Rule = tuple(zip((0.5 - 0.15**0.5, 0.5, 0.5 + 0.15**0.5), (5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0)))
_LOBATTO: Rule = tuple(zip((0.0, 0.5 - 0.05**0.5, 0.5 + 0.05**0.5, 1.0), (1 / 12, 5 / 12, 5 / 12, 1 / 12)))
# relative difference of the two rules, and most bisections, in the integration of velocities that jump
_SAME, _HALVINGS = 1e-11, 2000


class GuidedBody:
    """A body whose velocity, and rate of rotation about an axis through a moving point, are formulas of time.

    The place follows by quadrature over each step. moved (3,) [m], angle [rad]: displacement and rotation so far.
    """

    def __init__(self, pose: Pose, course: Any, axis: np.ndarray, about: np.ndarray):
        """course(time): velocity (3,) [m/s] and rate [rad/s]; axis (3,) of unit length; about (3,) [m]: at time 0."""
        self.pose, self.course, self.axis, self.about = pose, course, axis, about
        self.start = pose.place.copy()
        self.moved, self.angle = np.zeros(3), 0.0
        self.follow(0.0)

    kinetic = 0.0

    def follow(self, time: float) -> None:
        """Set the pose by `moved` and `angle`, and the velocity at a time [s]."""
        self.go(*self.course(time))

    def go(self, velocity: np.ndarray, rate: float) -> None:
        """Set the pose by `moved` and `angle`, and its motion by a velocity (3,) [m/s] and a rate [rad/s]."""
        self.pose.rotation = turn(self.axis, self.angle)
        arm = self.pose.matrix @ (self.start - self.about)
        self.pose.place = self.about + self.moved + arm
        self.pose.spin = rate * self.axis
        self.pose.velocity = velocity + np.cross(self.pose.spin, arm)

    def drift(self, time: float, step: float) -> None:
        """Move for a step [s] from a time [s]."""
        for share, weight in _GAUSS:
            velocity, rate = self.course(time + share * step)
            self.moved = self.moved + weight * step * velocity
            self.angle += weight * step * rate
        self.follow(time + step)

    def drift_evenly(self, time: float, over: float, ahead: float) -> None:
        """Move for a time `over` [s] from a time [s] by formulas that may jump; velocity and rate become their means
        over that time or, where it is 0, over a time `ahead` [s]."""
        way = self._whole_way(time, over or ahead)
        if over > 0.0:
            self.moved, self.angle = self.moved + way[:3], self.angle + float(way[3])
        self.go(way[:3] / (over or ahead), float(way[3]) / (over or ahead))

    def _whole_way(self, time: float, step: float) -> np.ndarray:
        """Displacement [m] and rotation [rad] (4,) in a step [s] from a time [s], for velocities that may jump: the
        step is bisected until two rules agree, one of which has points at the ends."""
        total, parts, halvings, most = np.zeros(4), [(time, step)], 0, 0.0
        while parts:
            at, length = parts.pop()
            way, other = (
                np.sum([w * length * np.append(*self.course(at + share * length)) for share, w in rule], axis=0)
                for rule in (_GAUSS, _LOBATTO)
            )
            most = max(most, float(np.abs(way).max()), float(np.abs(other).max()))
            if halvings < _HALVINGS and np.abs(way - other).max() > _SAME * most:
                parts += [(at, 0.5 * length), (at + 0.5 * length, 0.5 * length)]
                halvings += 1
            else:
                total += way
        return total

    def state(self) -> dict[str, Any]:
        """Displacement and rotation so far, as JSON has them."""
        return {"moved": self.moved.tolist(), "angle": self.angle}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave; `follow` finds the velocity."""
        self.moved, self.angle = np.array(state["moved"]), state["angle"]
