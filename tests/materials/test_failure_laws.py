"""Criteria of failure by hand, every one that the registry finds in the kernel, and what failed matter bears."""

import math

import numpy as np
import pytest

from parsolid.materials import registry
from parsolid.materials.declaration import NEEDED, parameters_of
from parsolid.materials.failure.failure import Failure, Loading, Scatter, chained
from parsolid.materials.failure.functions import damage_after
from parsolid.materials.failure.johnson_cook_damage import JohnsonCookDamage, strain_to_fracture
from parsolid.materials.failure.maximum_tension import MaximumTension, MeanTension
from parsolid.materials.failure.plastic_strain import PlasticStrain
from parsolid.materials.failure.scatter import strengths
from parsolid.materials.hyperelastic.evaluation import symmetric_tensors
from parsolid.materials.plastic import plastic_evaluation as evaluation
from parsolid.materials.plastic import tile_update as update
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.equation_of_state import MieGrueneisen
from parsolid.materials.plastic.linear_hardening import LinearHardening
from parsolid.materials.plastic.melting import ConstantMelting
from parsolid.materials.plastic.shear_modulus import ConstantShearModulus
from parsolid.methods.mpm.elastic_plastic import advance_deformation
from parsolid.scene.plasticity import library_of_criteria

COPPER = ElasticPlastic(
    8930.0,
    383.0,
    300.0,
    0.9,
    0.0,
    MieGrueneisen(8930.0, 3940.0, 1.489, 2.02),
    ConstantShearModulus(47.7e9),
    LinearHardening(120e6, 1e8),
    ConstantMelting(1356.0),
)
KINDS = registry.kinds("failure")


def of_library(name: str) -> JohnsonCookDamage:
    table = library_of_criteria()[name]
    return JohnsonCookDamage(*(table.get(key, default) for key, default in zip(JohnsonCookDamage._fields, DEFAULTS)))


DEFAULTS = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 294.0, 1e-3)
TORCH, STEEL, IRON = (of_library(f"{name}, Johnson-Cook") for name in ("OFHC copper", "4340 steel", "Armco iron"))
# one of each kind, which nothing meets: with all of them in the chain there is one kernel to compile
NEVER = (TORCH._replace(d1=1e30), MaximumTension(1e300), MeanTension(1e300), PlasticStrain(1e300))


ROWS = {
    "plastic_strain": update.PLASTIC_STRAIN,
    "energy": update.ENERGY,
    "temperature": update.TEMPERATURE,
    "damage": update.DAMAGE,
}


class Point:
    """One particle of one law, driven by velocity gradients (3, 3)."""

    def __init__(self, *criteria, law=COPPER, deletes=False, temperature=300.0):
        given = {type(criterion): criterion for criterion in criteria}
        chain = [given.pop(type(criterion), criterion) for criterion in NEVER] + list(given.values())
        self.law, self.kinds = law._replace(failure=Failure(chained(chain), deletes, None)), list(map(type, chain))
        self.tile = update.new_tile(len(chain))
        update.fill_idle(self.law, self.tile, 0)
        self.rows = self.tile.reshape(-1, update.TILE)
        self.rows[update.TEMPERATURE] = temperature
        self.released = 0.0

    def advance(self, step, gradient, steps=1):
        for _ in range(steps):
            self.rows[update.VELOCITY_GRADIENT : update.VELOCITY_GRADIENT + 9, 0] = np.ravel(gradient)
            advance_deformation(step, None, self.tile)
            update.start_step(self.law, self.law.failure, self.tile)
            update.flow(self.law, self.law.failure, step, self.tile)
            update.finish_step(self.law, self.law.failure, step, self.tile)
            assert self.rows[update.ROOM, 0] > 0.0
            self.released += self.rows[update.RELEASED, 0]
            if self.damage >= 1.0:
                # failed matter has no shape to remember
                self.rows[update.DEFORMATION : update.DEFORMATION + 9, 0] = np.cbrt(self.J) * np.eye(3).ravel()
        return self

    @property
    def J(self):
        return self.rows[update.NEW_JACOBIAN, 0]

    @property
    def deviator(self):
        """Unrotated, 11, 22, 33, 12, 13, 23."""
        return self.rows[update.DEVIATOR : update.DEVIATOR + 6, 0]

    @property
    def stress(self):
        """J times Cauchy's."""
        R = self.rows[update.ROTATION : update.ROTATION + 9, 0].reshape(3, 3)
        return self.J * (R @ symmetric_tensors(self.deviator) @ R.T - self.rows[update.PRESSURE, 0] * np.eye(3))

    def __getattr__(self, name):
        return self.rows[ROWS[name], 0]


def stretch(rate):
    return np.diag([rate, 0.0, 0.0])


@pytest.mark.parametrize(
    "criterion, triaxiality, rate, temperature, strain",
    [
        (TORCH, 1.0 / 3.0, 1.0, 294.0, 0.54 + 4.89 * math.exp(-1.01)),
        (TORCH, 0.0, 1e3, 294.0, 5.43 * (1.0 + 0.014 * math.log(1e3))),
        (TORCH, 0.0, 1.0, 825.0, 5.43 * 1.56),
        (STEEL, 1.5, 1e4, 294.0, (0.05 + 3.44 * math.exp(-3.18)) * (1.0 + 0.002 * math.log(1e4))),
        (STEEL, -0.5, 1.0, 2000.0, (0.05 + 3.44 * math.exp(1.06)) * 1.61),
        (IRON, 1.0, 0.01, 100.0, -2.20 + 5.43 * math.exp(-0.47)),
        # the formula is -0.52 there
        (IRON, 2.5, 1.0, 294.0, 1e-3),
        # nothing overflows where pressure is all there is
        (TORCH, -1e9, 1e9, 294.0, None),
    ],
)
def test_strains_to_fracture_by_hand(criterion, triaxiality, rate, temperature, strain):
    found = strain_to_fracture(criterion, triaxiality, rate, temperature, 1356.0)
    if strain is None:
        assert np.isfinite(found) and found > 1e30
    else:
        assert found == pytest.approx(strain, rel=1e-12)


@pytest.mark.parametrize("rate", [1e3, 1e6])
def test_the_damage_of_shear_is_the_strain_over_that_of_no_triaxiality(rate):
    """Isothermal (no heat of flow) and without pressure, at the rate of the flow."""
    # without a heat that presses
    law = COPPER._replace(taylor_quinney=0.0, equation_of_state=MieGrueneisen(8930.0, 3940.0, 1.489, 0.0))
    criterion = TORCH._replace(reference_temperature=300.0, d5=0.0)
    point = Point(criterion, law=law)
    shear = np.zeros((3, 3))
    shear[0, 1] = rate
    point.advance(0.01 / rate, shear, 300)
    expected = point.plastic_strain / (5.43 * (1.0 + 0.014 * math.log(rate / math.sqrt(3.0))))
    # the first steps are elastic, in which the rate is another
    assert point.plastic_strain > 1.5 and point.damage == pytest.approx(expected, rel=2e-3)


def of_kind(kind: str):
    """A criterion with 1 for every number that has to be given, which all of them take."""
    declared = registry.declared("failure", kind)
    values = {name: note.default for name, (_, note) in parameters_of(declared).items()}
    return declared(**{name: 1.0 if value is NEEDED else value for name, value in values.items()})


@pytest.mark.parametrize("kind", KINDS)
def test_every_criterion_of_the_registry_in_the_kernel(kind):
    """As in plain Python from the state after a step; damage rises only, less where matter is stronger."""
    criterion = of_kind(kind)
    if hasattr(criterion, "strength"):
        criterion = criterion._replace(strength=3e9)
    if hasattr(criterion, "strain"):
        criterion = criterion._replace(strain=0.02)
    point = Point(criterion)
    before, ep = 0.0, 0.0
    for number in range(8):
        point.advance(1e-9, stretch(1e6 if number < 5 else -2e6))
        increment, pressure = point.plastic_strain - ep, -np.trace(point.stress) / 3.0
        s, J = tuple(point.deviator), point.J
        loading = Loading(
            s,
            pressure / J,
            point.plastic_strain,
            increment,
            increment / 1e-9,
            point.temperature,
            1356.0,
        )
        expected = damage_after(criterion, before, 1.0, loading)
        assert point.damage == pytest.approx(expected, rel=1e-9) and before <= point.damage < 1.0
        assert damage_after(criterion, before, 2.0, loading) <= expected
        before, ep = point.damage, point.plastic_strain
    assert point.damage > 0.0 and point.released == 0.0


@pytest.mark.parametrize("criterion", [MaximumTension(2e9), MeanTension(2e9), PlasticStrain(0.004)])
def test_failed_matter_bears_pressure_alone_once_its_void_has_closed(criterion):
    point = Point(criterion)
    while point.damage < 1.0:
        point.advance(1e-9, stretch(2e6))
    J = point.J
    assert np.abs(point.stress).max() == 0.0 and point.released > 0.0
    ep, energy = point.plastic_strain, point.energy
    point.advance(1e-9, stretch(2e6), 50)
    assert np.abs(point.stress).max() == 0.0 and point.energy == energy and point.plastic_strain == ep
    opened = point.J
    assert opened > J * 1.09
    # no pressure before it is closed, pressure without shear behind
    point.advance(1e-9, stretch(-2e6), 40)
    assert np.abs(point.stress).max() == 0.0 and point.energy == energy
    point.advance(1e-9, stretch(-2e6), 40)
    pressures = -np.diag(point.stress)
    assert pressures.min() > 1e9 and np.ptp(pressures) < 1e-9 * pressures.max() and point.energy > energy


def test_a_void_of_many_volumes_closes_without_pressure():
    """By more than 2/gamma in one step, where the closed form of the energy has no solution."""
    point = Point(MeanTension(2e9))
    while point.J < 2000.0:
        point.advance(1e-7, stretch(1e6))
    energy, temperature, J = point.energy, point.temperature, point.J
    point.advance(1e-7, stretch(-1e4))
    assert J - point.J > 1.0 and np.abs(point.stress).max() == 0.0
    assert point.energy == energy and point.temperature == temperature


def test_energy_is_continuous_but_for_the_half_step_that_no_force_has_done():
    """E is the work of the mean stresses of the steps, the last of which ends without stress; T takes what is
    released."""
    step, rate = 1e-10, 1e6
    point, whole = Point(MaximumTension(2e9)), Point(MaximumTension(1e12))
    while point.damage < 1.0:
        last, energy = point.stress, point.energy
        point.advance(step, stretch(rate))
        whole.advance(step, stretch(rate))
    J = point.J
    work = 0.5 * last[0, 0] / J * (J - J / (1.0 + step * rate))
    assert point.energy - energy == pytest.approx(work, rel=1e-3)
    capacity = 8930.0 * 383.0
    assert point.temperature - whole.temperature == pytest.approx(point.released / capacity, rel=1e-6)
    # what flow has taken is small against what was stored
    assert 0.8 < point.released / whole.energy < 1.1


def test_the_first_of_several_criteria_ends_it():
    """Whichever it is, the last in the chain or one before."""
    for weak, strong in ((PlasticStrain(0.01), MeanTension(1e11)), (MeanTension(1.4e9), PlasticStrain(0.5))):
        point = Point(weak, strong)
        while point.damage < 1.0:
            point.advance(1e-9, stretch(1e6))
        damages = dict(zip(point.kinds, point.rows[update.CRITERIA :, 0]))
        assert damages.pop(type(weak)) >= 1.0 and 0.0 < damages[type(strong)] < 0.3
        assert max(damages.values()) < 0.3
        assert type(weak) is MeanTension or point.plastic_strain == pytest.approx(0.01, rel=0.1)


def test_weibull_strengths_follow_identifiers_and_seeds_alone():
    identifier = np.arange(200_000)
    factors = strengths(Scatter(8.0, 3), identifier)
    order = np.random.default_rng(0).permutation(len(identifier))
    np.testing.assert_array_equal(strengths(Scatter(8.0, 3), identifier[order]), factors[order])
    assert np.mean(factors) == pytest.approx(1.0, abs=1e-3)
    for share in (0.01, 0.1, 0.5, 0.9):
        exact = (-math.log(1.0 - share)) ** (1.0 / 8.0) / math.gamma(1.0 + 1.0 / 8.0)
        assert np.mean(factors < exact) == pytest.approx(share, abs=4e-3)
    other = strengths(Scatter(8.0, 4), identifier)
    assert abs(np.corrcoef(factors, other)[0, 1]) < 0.01 and abs(np.corrcoef(factors[1:], factors[:-1])[0, 1]) < 0.01


def test_what_was_stored_is_never_negative_in_any_state():
    """At 3 km/s in a cell: rates of 1e9, tension beyond the spinodal, melt."""
    rng = np.random.default_rng(4)
    for _ in range(40):
        point = Point(TORCH, MaximumTension(1e9), law=COPPER, temperature=rng.uniform(50.0, 2000.0))
        gradient = rng.uniform(-1.0, 1.0, (3, 3)) * 10.0 ** rng.uniform(3, 9)
        # compressed no further than the equation of state knows
        gradient -= min(np.trace(gradient), 0.0) / 3.0 * np.eye(3)
        for _ in range(30):
            before = point.released
            point.advance(0.02 / np.abs(gradient).max(), gradient)
            assert point.released >= before and 0.0 <= point.damage <= 1.0
            assert np.isfinite(point.temperature) and np.isfinite(point.energy)
    assert evaluation.pressure(COPPER, 1.0, 0.0) == 0.0
