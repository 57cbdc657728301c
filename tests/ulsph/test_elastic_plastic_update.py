"""The kernel of elastic-plastic laws in updated-Lagrangian SPH at homogeneous deformation: oracles, order, rotation.
`contracts/test_laws` compares every flow stress with the update of other methods."""

import numpy as np
import pytest
from scipy.linalg import expm

from parsolid.materials.plastic import plastic_evaluation as evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.equation_of_state import LinearElastic, MieGrueneisen
from parsolid.materials.plastic.linear_hardening import LinearHardening
from parsolid.materials.plastic.shear_modulus import ConstantShearModulus
from parsolid.materials.plastic.tile_update import new_tile
from parsolid.methods.ulsph.elastic_plastic import State, advance_state

COPPER = MieGrueneisen(8930.0, 3940.0, 1.489, 2.02)
FLOWING = ElasticPlastic(
    8930.0, 383.0, 300.0, 0.9, 0.0, COPPER, ConstantShearModulus(47.7e9), LinearHardening(120e6, 1e8), None
)
ELASTIC = FLOWING._replace(
    equation_of_state=LinearElastic(130e9),
    shear_modulus=ConstantShearModulus(45e9),
    flow_stress=LinearHardening(1e20, 0.0),
)
COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class Particles:
    """Four particles of one law with neighbours in perfect order, driven by a velocity gradient (3, 3)."""

    def __init__(self, law, dimension=3, temperature=300.0):
        self.law, self.dimension, self.tile = law, dimension, new_tile()
        one, d = (lambda value: np.full((1, 4), value)), dimension
        self.rates = np.zeros((4, 4 * d + 4))
        self.body = State(
            mass=one(2.0),
            density=one(law.density),
            correction=np.zeros((6, 4)),
            deviator=np.zeros((6, 4)),
            plastic_strain=one(0.0),
            energy=one(law.internal_energy(temperature)),
            temperature=one(temperature),
            pair_stress=np.zeros((d * d, 4)),
            sound_speed=one(0.0),
        )

    def advance(self, step, gradient):
        """One step; plastic work over the volume at rest."""
        d, weight = self.dimension, self.body.mass[0] * self.body.density[0]
        self.rates[:] = 0.0
        stride = 4 if d == 3 else 2
        for j in range(d):
            self.rates[:, stride * j : stride * j + d] = weight[:, None] * gradient[:d, j]
        # the moment of perfect order: 11, 22, 33
        for place in (3, 12, 13) if d == 3 else (4, 5):
            self.rates[:, place] = weight
        sound, work, heat, released, _ = self.update(step)
        assert sound and heat == 0.0 and released == 0.0
        return work / (4 * 2.0 / self.law.density)

    def update(self, step):
        """The kernel, with the sums of `rates`."""
        how = step, step, 6.0, None, True if self.dimension == 2 else None
        absent = None, None, None, None, None
        return advance_state(0, 4, self.law, None, *how, self.rates, None, self.body, *absent, self.tile)

    def deviator(self):
        """S (3, 3) [Pa] of the first particle."""
        result = np.zeros((3, 3))
        for (i, j), value in zip(COMPONENTS, self.body.deviator[:, 0]):
            result[i, j] = result[j, i] = value
        return result

    def scalars(self):
        """J, E, T, plastic strain."""
        body = self.body
        J = self.law.density / body.density[0, 0]
        return np.array([J, body.energy[0, 0], body.temperature[0, 0], body.plastic_strain[0, 0]])

    def pressure(self):
        J, energy = self.scalars()[:2]
        return float(evaluation.pressure(self.law, J, energy))


def driven(law, gradient, duration, steps, **keys):
    particles = Particles(law, **keys)
    for _ in range(steps):
        particles.advance(duration / steps, gradient)
    return particles


@pytest.mark.parametrize("dimension", [2, 3])
def test_elastic_shear_follows_jaumann(dimension):
    """S12 = G sin(gamma), S11 = G (1 - cos(gamma)) at a shear of 1: 37.866 and 20.686 GPa; of second order."""
    gradient = np.array([[0.0, 1e3, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    exact = 45e9 * np.array([1.0 - np.cos(1.0), np.sin(1.0)])
    errors = [
        np.abs(driven(ELASTIC, gradient, 1e-3, n, dimension=dimension).deviator()[0, :2] - exact) for n in (20, 40)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx([2.0, 2.0], abs=0.1)
    assert errors[1].max() < 1e-4 * 45e9


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_rotated_state_is_the_same_state(dimension):
    """A quarter turn in 200 steps turns S and leaves J, E, T and plastic strain; flow goes on in the turned axes."""
    stretch = np.array([[-300.0, 100.0, 0.0], [100.0, 50.0, 0.0], [0.0, 0.0, 0.0]])
    spin = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) * 0.5 * np.pi
    Q = expm(spin)
    plain, turned = (driven(FLOWING, stretch, 3e-4, 60, dimension=dimension) for _ in range(2))
    before = turned.scalars()
    assert before[3] > 0.03
    for _ in range(200):
        turned.advance(1e-6, spin / 2e-4)
    np.testing.assert_allclose(turned.scalars(), before, rtol=1e-10)
    np.testing.assert_allclose(
        turned.deviator(), Q @ plain.deviator() @ Q.T, atol=1e-4 * np.abs(plain.deviator()).max()
    )
    for _ in range(60):
        plain.advance(5e-6, -0.5 * stretch)
        turned.advance(5e-6, -0.5 * Q @ stretch @ Q.T)
    np.testing.assert_allclose(turned.scalars(), plain.scalars(), rtol=1e-4)
    np.testing.assert_allclose(
        turned.deviator(), Q @ plain.deviator() @ Q.T, atol=2e-4 * np.abs(plain.deviator()).max()
    )


def test_energy_is_the_work_of_the_stress():
    """E rises by the work of stress, -P dJ + J S:D dt by trapezoids, in flow and compression; of second order."""
    gradient = np.array([[-8e3, 6e3, 0.0], [1e3, 2e3, 0.0], [0.0, 0.0, 1e3]])
    D, errors = 0.5 * (gradient + gradient.T), []
    for steps in (100, 200):
        particles, step, work = Particles(FLOWING), 2e-5 / steps, 0.0
        power = 0.0
        for _ in range(steps):
            particles.advance(step, gradient)
            J = particles.scalars()[0]
            now = J * (np.tensordot(particles.deviator(), D) - particles.pressure() * np.trace(D))
            work, power = work + 0.5 * step * (power + now), now
        errors.append(abs(particles.scalars()[1] / work - 1.0))
    assert errors[1] < 2e-4 and errors[0] > 1.7 * errors[1]


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_particle_without_neighbours_keeps_its_state(dimension):
    """Its moment is 0, which has no inverse."""
    particles = driven(FLOWING, np.diag([-1e4, 0.0, 0.0]), 1e-5, 20, dimension=dimension)
    before = particles.scalars()
    particles.rates[:] = 0.0
    assert particles.update(1e-8)[0]
    np.testing.assert_allclose(particles.scalars(), before, rtol=1e-12)
    assert np.isfinite(particles.body.correction).all()
