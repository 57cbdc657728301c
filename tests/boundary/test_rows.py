"""Prescribed rows, loads and heat stay with their particles after these changed rows and came back from elsewhere."""

import numpy as np
import pytest
from kinds import table, tables_of

from parsolid.boundary.heating import HeatSupply
from parsolid.boundary.loads import InTime
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field
from parsolid.particles.generation import generate
from parsolid.scene import parse_scene


def contained(particle_set) -> Particles:
    """The particle_set in a container."""
    result, d = Particles(particle_set.body), particle_set.position.shape[1]
    result.declare(Field("identifier", 1, "1", whole=True), particle_set.identifier)
    for name, values in (("reference_position", particle_set.position), ("spacing", particle_set.spacing)):
        result.declare(Field(name, d, "m"), values)
    result.declare(Field("area", d, "m^2"), particle_set.area)
    result.declare(Field("volume", 1, "m^3"), particle_set.volume)
    return result


def shuffle(particles: Particles) -> None:
    """Another order, and some particles leave and come back at other rows."""
    random = np.random.default_rng(5)
    particles.reorder(random.permutation(particles.owned))
    gone = np.sort(random.choice(particles.owned, particles.owned // 3, replace=False))
    packed = particles.packed(gone)
    particles.remove(gone)
    particles.insert(packed[::-1].copy())


def by_particle(particles: Particles, values: np.ndarray) -> np.ndarray:
    """Values of the owned particles in the order of their identifiers."""
    return values[np.argsort(particles.owned_rows("identifier"))]


def spread(particles: Particles, prescribed, quantity: str, time: float) -> np.ndarray:
    """What is prescribed, at its particle and component (n, 2)."""
    result = np.zeros((particles.owned, 2))
    result[prescribed.entries] = prescribed.values(quantity, time)
    return by_particle(particles, result)


MOVING = [
    {"kind": "velocity", "plane": "X = 1", "velocity": ["X + Y*t", "free"]},
    {"kind": "velocity", "box": {"lower": [0.9, 0.0], "upper": [1.0, 0.3]}, "velocity": ["Y", "2"]},
    {"kind": "velocity", "point": [0.1, 0.1], "velocity": ["free", "t"]},
    {"kind": "traction", "plane": "X = 0", "traction": ["1 + Y", 0.0]},
    {"kind": "traction", "plane": "Y = 1", "traction": [0.0, "X*t"]},
]
LOADS = {"body_force": ["X", "t*Y"], "acceleration": [0.0, -9.81]}


def test_heat_through_planes(comm):
    data = tables_of("mpm", table("heat_flux") | {"heat_flux": "1 + Y*t"}) | {"loads": {"heat_source": "X"}}
    scene = parse_scene(data)
    particle_set = generate(scene, comm)
    particles, still = contained(particle_set), contained(particle_set)
    fixed, found = (HeatSupply(scene, one, False) for one in (still, particles))
    for _ in range(2):
        shuffle(particles)
        expected, power = np.zeros((2, particles.owned))
        for supply, result in ((fixed, expected), (found, power)):
            rows, values = supply.powers(0, 0.5)
            result[rows] = values
        assert np.array_equal(by_particle(particles, power), by_particle(still, expected))
        assert np.array_equal(by_particle(particles, found.sources(0.5)), by_particle(still, fixed.sources(0.5)))
    # eight particles of side 1/8 at X = 0, at Y = 1/16, 3/16 ...
    total = comm.allreduce(float(power.sum()))
    assert total == pytest.approx(1.0 + 0.5 * 0.5, rel=1e-12)


class Counted:
    """A part of a sum that counts how often it is asked."""

    def __init__(self, depends_on_time: bool):
        self.depends_on_time, self.asked = depends_on_time, 0

    def put(self, result, time, before):
        self.asked += 1
        result += 1.0 + time

    def forget(self):
        pass


def test_what_is_constant_is_evaluated_once_for_a_layout():
    particles = Particles(np.zeros(5, np.int64))
    constant, changing = Counted(False), Counted(True)
    sum_ = InTime(particles, [changing, constant], 2)
    assert sum_.at(1.0).tolist() == [[3.0, 3.0]] * 5 and sum_.at(2.0).tolist() == [[4.0, 4.0]] * 5
    assert (constant.asked, changing.asked) == (1, 2)
    particles.remove(np.array([1, 2]))
    assert sum_.at(0.0).tolist() == [[2.0, 2.0]] * 3
    assert (constant.asked, changing.asked) == (2, 3)
