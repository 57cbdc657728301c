"""The stress kernel of elastic-plastic particles: oracles, order, energy, guards, lanes."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm
from solids import PlasticPoints

from parsolid.materials.plastic import plastic_evaluation as evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.equation_of_state import LinearElastic, MieGrueneisen
from parsolid.materials.plastic.linear_hardening import LinearHardening
from parsolid.materials.plastic.melting import ConstantMelting
from parsolid.materials.plastic.shear_modulus import ConstantShearModulus
from parsolid.materials.registry import law_of
from parsolid.methods.mpm.elastic_plastic import BulkViscosity
from parsolid.scene.plasticity import library

COPPER = MieGrueneisen(8930.0, 3940.0, 1.489, 2.02)
JOHNSON_COOK = law_of(library()["OFHC copper, Johnson-Cook"])
J2 = ElasticPlastic(
    8930.0,
    383.0,
    300.0,
    0.9,
    0.0,
    COPPER,
    ConstantShearModulus(47.7e9),
    LinearHardening(120e6, 1e8),
    ConstantMelting(1356.0),
)
LINEAR = J2._replace(equation_of_state=LinearElastic(130e9), shear_modulus=ConstantShearModulus(45e9), melting=None)
ELASTIC = LINEAR._replace(flow_stress=LinearHardening(1e20, 0.0))
PERFECT = LINEAR._replace(flow_stress=LinearHardening(400e6, 0.0))


class Particles(PlasticPoints):
    """Particles of one law, driven by velocity gradients (n, 3, 3)."""

    def __init__(self, law, count=1, dimension=3, temperature=300.0):
        super().__init__(law, dimension, 4 * (count // 4 + 2))
        self.count = count
        self.state.temperature[:], self.state.internal_energy[:] = temperature, law.internal_energy(temperature)

    def drive(self, step, gradient, viscosity=None, first=0):
        self.rate.reshape(-1, 3, 4)[first : first + self.count, :, :3] = gradient
        outcome = self.advance(first, first + self.count, step, viscosity)
        return SimpleNamespace(sound=outcome[0], speed=outcome[1], plastic=outcome[2], viscous=outcome[3])

    def stress(self):
        """V sigma (n, 3, 3), V0 = 1."""
        xx, yy, zz, _, yz, xz, xy, _ = self.record[: self.count].T
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)


def sheared(law, rate, steps, shear=1.0, temperature=300.0, dimension=3):
    """Simple shear in equal steps."""
    particles = Particles(law, 1, dimension, temperature)
    particles.rate[0, 1] = rate
    # from Python: a loop of its own would compile the update once more for each law
    for _ in range(steps):
        assert particles.advance(0, 1, shear / rate / steps)[0]
    return particles


@pytest.mark.parametrize("dimension", [2, 3])
def test_elastic_shear_follows_green_and_naghdi(dimension):
    """At a shear of 1 with G = 45 GPa s12 39.140, s11 18.716 GPa (37.866, 20.686 with Jaumann's rate); of
    second order.
    """
    exact = _green_naghdi()
    errors = [
        np.abs(sheared(ELASTIC, 1e3, steps, dimension=dimension).stress()[0, :2, 0] - exact) for steps in (20, 40)
    ]
    stress = sheared(ELASTIC, 1e3, 1000, dimension=dimension).stress()[0]
    assert np.log2(errors[0] / errors[1]) == pytest.approx([2.0, 2.0], abs=0.1)
    assert stress[0, 1] == pytest.approx(39.140e9, rel=2e-5) and stress[0, 0] == pytest.approx(18.716e9, rel=5e-5)
    assert stress[1, 1] == pytest.approx(-stress[0, 0], rel=1e-12) and abs(stress[2, 2]) < 1.0


def _green_naghdi(G=45e9):
    """sigma_11 and sigma_12 of simple shear to 1, Dienes (1979): R turns by b, tan b = 1/2."""
    b = np.arctan(0.5)
    turned, along = np.log(np.cos(b)), np.cos(2.0 * b)
    first = 4.0 * G * (along * turned + b * np.sin(2.0 * b) - np.sin(b) ** 2)
    return np.array([first, 2.0 * G * along * (2.0 * b - 2.0 * np.tan(2.0 * b) * turned - np.tan(b))])


def test_perfect_plasticity():
    """Reference: s12 230.938, s11 0.950 MPa; the plastic s11 is of first order."""
    coarse, fine = sheared(PERFECT, 1e3, 100).stress()[0], sheared(PERFECT, 1e3, 2000).stress()[0]
    assert coarse[0, 1] == pytest.approx(230.938e6, rel=1e-4) and fine[0, 1] == pytest.approx(230.938e6, rel=1e-5)
    assert fine[0, 0] == pytest.approx(0.950e6, abs=0.06e6)


def test_linear_hardening_is_integrated_exactly():
    """Along a fixed direction the return ends on sigma_y(ep), and what is not plastic strain is elastic, whatever the
    step.
    """
    particles, mu = Particles(LINEAR), LINEAR.shear_modulus.modulus
    for _ in range(3):
        particles.drive(1e-5, np.diag([200.0, -100.0, -100.0]))
    ep, s = particles.state.plastic_strain[0, 0], particles.state.unrotated_deviator[:3, 0]
    mises = np.sqrt(1.5 * s @ s)
    assert mises == pytest.approx(120e6 + 1e8 * ep, rel=1e-13)
    logarithms = np.log(particles.state.deformation_gradient[[0, 4, 8], 0])
    assert ep + mises / (3.0 * mu) == pytest.approx(2.0 / 3.0 * (logarithms[0] - logarithms[1]), rel=1e-6)


def test_johnson_cook_shear():
    """Adiabatic shear to 1 at 1000/s: 217.1357 MPa, 341.7201 K, ep 0.574718; in 100 steps within 0.05 %."""
    particles = sheared(JOHNSON_COOK, 1e3, 100, temperature=294.0)
    assert particles.stress()[0, 0, 1] == pytest.approx(217.1357e6, rel=5e-4)
    particles = sheared(JOHNSON_COOK, 1e3, 1000, temperature=294.0)
    assert particles.stress()[0, 0, 1] == pytest.approx(217.1357e6, rel=3e-5)
    assert particles.state.temperature[0, 0] == pytest.approx(341.7201, abs=0.02)
    assert particles.state.plastic_strain[0, 0] == pytest.approx(0.574718, abs=1e-6)


@pytest.mark.parametrize("law", [J2, LINEAR, JOHNSON_COOK], ids=["mie-grueneisen", "linear", "johnson-cook"])
def test_internal_energy_is_the_work_of_the_stress(law):
    """Along a smooth path of everything at once, to second order; so the ledger closes."""
    errors = []
    for steps in (200, 400):
        particles, F, work, old = Particles(law), np.eye(3), 0.0, None
        for k in range(steps):
            t, step = (k + 0.5) / steps, 1e-5 / steps
            spin, stretch = 5e4 * np.cos(3.0 * t), np.array([-1.0, 0.4, 0.2]) * 1e4
            gradient = np.diag(stretch) + np.array([[0, 1.0, 0.3], [-0.5, 0, 0.2], [0, -0.7, 0]]) * spin
            old, before = particles.stress()[0].copy(), F
            F = F + step * gradient @ F
            particles.drive(step, gradient)
            half = (F - before) @ np.linalg.inv(0.5 * (F + before))
            work += 0.5 * np.tensordot(old + particles.stress()[0], half)
        errors.append(abs(particles.state.internal_energy[0, 0] / work - 1.0))
    assert errors[1] < 2e-5 and errors[0] / errors[1] > 2.5


def test_shock_temperature_and_energy():
    """A steady shock of 500 m/s, the viscosity making the Rayleigh line: E = P (1 - J)/2, T = 410.10 K."""
    law = J2._replace(
        flow_stress=LinearHardening(1.0, 0.0), shear_modulus=ConstantShearModulus(1.0), taylor_quinney=0.0
    )
    particles, shock, end = Particles(law), 4684.5, 1.0 - 500.0 / 4684.5
    steps, J, viscous = 2000, 1.0, 0.0
    for k in range(steps):
        new = 1.0 + (end - 1.0) * (k + 1) / steps
        rate = (new / J - 1.0) / 1e-9
        middle = 0.5 * (J + new)
        # the kernel's tr d, and its q = rho quadratic (tr d)^2 with a spacing of 1 m
        trace = (new - J) / middle / 1e-9
        pressure = evaluation.pressure(law, middle, particles.state.internal_energy[0, 0])
        excess = max(8930.0 * shock**2 * (1.0 - middle) - pressure, 0.0)
        viscosity = BulkViscosity(0.0, excess * middle / (8930.0 * trace**2), 1.0)
        gradient = np.zeros((3, 3))
        gradient[0, 0] = rate
        viscous += particles.drive(1e-9, gradient, viscosity).viscous
        J = new
    state = particles.state
    assert state.deformation_gradient[0, 0] == pytest.approx(end, rel=1e-12)
    assert state.internal_energy[0, 0] == pytest.approx(0.5 * 8930.0 * 500.0**2, rel=2e-4)
    assert evaluation.pressure(law, J, state.internal_energy[0, 0]) == pytest.approx(20.9163e9, rel=1e-4)
    assert state.temperature[0, 0] == pytest.approx(410.10, abs=0.1)
    assert 0.0 < viscous < state.internal_energy[0, 0]


def test_elastic_precursor():
    """Uniaxial strain of copper with Y = 120 MPa yields at 255.0 MPa, and so strong a wave runs at 4766.3 m/s."""
    particles, stress, J = Particles(J2._replace(flow_stress=LinearHardening(120e6, 0.0))), 0.0, 1.0
    outcome = particles.drive(0.0, np.zeros((3, 3)))
    assert outcome.speed == pytest.approx(np.sqrt(3940.0**2 + 4.0 / 3.0 * 47.7e9 / 8930.0), rel=1e-12)
    while particles.state.plastic_strain[0, 0] == 0.0:
        J = particles.state.deformation_gradient[0, 0]
        stress = -particles.stress()[0, 0, 0] / J
        particles.drive(1e-10, np.diag([-1e3, 0.0, 0.0]))
    assert stress == pytest.approx(255.0e6, abs=0.1e6)
    assert np.sqrt(stress / (8930.0 * (1.0 - J))) == pytest.approx(4766.3, abs=0.5)


@pytest.mark.parametrize(
    "law, viscosity",
    [(J2, BulkViscosity(0.2, 2.0, 1e-3)), (JOHNSON_COOK, None)],
    ids=["linear hardening, viscous", "johnson-cook"],
)
def test_a_particle_does_not_feel_its_neighbours(law, viscosity):
    """The same bits wherever a particle lies in the arrays, and nothing beyond the range is changed but records."""
    random = np.random.default_rng(11)
    gradients = 3e4 * random.standard_normal((11, 3, 3))
    first, moved = Particles(law, 11), Particles(law, 11)
    for _ in range(12):
        first.drive(1e-8, gradients, viscosity)
        moved.drive(1e-8, gradients[::-1], viscosity, first=1)
    assert (first.state.plastic_strain[0, :11] > 0.0).any()
    for one, other in zip(first.state[:5], moved.state[:5]):
        np.testing.assert_array_equal(one[:, :11], other[:, 11:0:-1])
    np.testing.assert_array_equal(first.record[:11], moved.record[11:0:-1])
    assert (moved.state.deformation_gradient[:, [0, 12]] == np.eye(3).reshape(9, 1)).all()


def test_plane_strain_and_space_agree():
    random = np.random.default_rng(12)
    gradients = np.zeros((6, 3, 3))
    gradients[:, :2, :2], gradients[:, 2, 2] = 3e4 * random.standard_normal((6, 2, 2)), 2e4
    plane, space = Particles(LINEAR, 6, 2), Particles(LINEAR, 6, 3)
    for _ in range(40):
        one, other = plane.drive(1e-8, gradients), space.drive(1e-8, gradients)
    assert plane.record[:6] == pytest.approx(space.record[:6], rel=1e-10, abs=1e-4)
    assert (one.plastic, one.speed) == (pytest.approx(other.plastic, rel=1e-10), pytest.approx(other.speed, rel=1e-12))


def test_objectivity():
    """A rigid rotation turns the stress and changes nothing else."""
    particles = sheared(J2, 1e4, 20, shear=0.2)
    before, ep = particles.stress()[0].copy(), particles.state.plastic_strain[0, 0]
    spin = np.array([[0.0, 1.0, -0.4], [-1.0, 0.0, 0.7], [0.4, -0.7, 0.0]])
    for _ in range(100):
        particles.drive(1e-7, (expm(0.2 * spin) - np.eye(3)) / 1e-7)
    Q = expm(20.0 * spin)
    assert particles.stress()[0] == pytest.approx(Q @ before @ Q.T, abs=1e-9 * np.abs(before).max())
    assert particles.state.plastic_strain[0, 0] == pytest.approx(ep, abs=1e-12)


@pytest.mark.parametrize("law", [J2, JOHNSON_COOK], ids=["linear hardening", "johnson-cook"])
def test_a_melted_particle_carries_pressure_alone(law):
    particles = Particles(law, temperature=1400.0)
    for _ in range(10):
        assert particles.drive(1e-8, np.array([[-1e5, 2e5, 0], [0, 0, 0], [0, 0, 0]])).sound
    assert np.abs(particles.state.unrotated_deviator[:, 0]).max() < 1.0
    stress = particles.stress()[0]
    assert stress == pytest.approx(np.trace(stress) / 3.0 * np.eye(3), abs=10.0) and np.trace(stress) < 0.0
    # no plastic strain beyond the strain
    assert particles.state.plastic_strain[0, 0] <= 1e-7 * 2.4e5


def test_a_step_without_length_changes_nothing():
    """Not even a stress above the flow stress of slow flow."""
    particles = sheared(JOHNSON_COOK, 1e4, 50, shear=0.3)
    before, record = [array.copy() for array in particles.state if array is not None], particles.record[0].copy()
    particles.drive(0.0, np.zeros((3, 3)))
    for old, new in zip(before, (array for array in particles.state if array is not None), strict=True):
        np.testing.assert_array_equal(new, old)
    np.testing.assert_array_equal(particles.record[0], record)


def test_tension_beyond_the_spinodal_stays_finite():
    particles = Particles(JOHNSON_COOK)
    for _ in range(200):
        outcome = particles.drive(1e-8, 1e5 * np.eye(3))
        assert outcome.sound and np.isfinite(outcome.speed)
    assert particles.stress()[0, 0, 0] > 0.0 and particles.state.temperature[0, 0] < 300.0


UNSOUND = {
    "inverted": -2.0 * np.eye(3),
    "beyond the hugoniot": np.diag([-0.7, 0.0, 0.0]),
    "nan": np.full((3, 3), np.nan),
}


@pytest.mark.parametrize("gradient", UNSOUND.values(), ids=UNSOUND)
def test_unsound_particles_are_found(gradient):
    """Also among sound ones; particles beyond the range do not count."""
    particles = Particles(J2, 6)
    gradients = np.zeros((6, 3, 3))
    assert particles.drive(1.0, gradients).sound
    gradients[4] = gradient
    assert not particles.drive(1.0, gradients).sound
    particles = Particles(J2, 5)
    particles.rate.reshape(-1, 3, 4)[5, :, :3] = gradient
    assert particles.drive(1.0, np.zeros((5, 3, 3))).sound
