"""Elastic-plastic solids from deformation gradients: motions of `plastic_motions.json` (fine ordinary differential
equations), objectivity, elastic cycles, every flow stress of the library, failed matter."""

import json
from pathlib import Path

import numpy as np
import pytest

from parsolid.materials.failure.failure import Failure, chained
from parsolid.materials.failure.maximum_tension import MaximumTension
from parsolid.materials.plastic import plastic_evaluation as evaluation
from parsolid.materials.plastic import tile_update as update
from parsolid.materials.plastic import total_lagrangian
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.equation_of_state import LinearElastic, MieGrueneisen
from parsolid.materials.plastic.johnson_cook import JohnsonCook
from parsolid.materials.plastic.melting import ConstantMelting
from parsolid.materials.plastic.shear_modulus import ConstantShearModulus
from parsolid.materials.plastic.total_lagrangian import advance_tile
from parsolid.materials.plastic.voce import Voce
from parsolid.materials.registry import law_of
from parsolid.methods.peridynamics import solids
from parsolid.principal import from_principal, principal
from parsolid.scene.plasticity import library

REFERENCE = json.loads((Path(__file__).parent / "plastic_motions.json").read_text())
ONE = np.eye(3)
SHEAR = np.outer(ONE[0], ONE[1])
COPPER_FLOW = JohnsonCook(90e6, 292e6, 0.31, 0.025, 1.09, 1.0, 294.0)
VOCE = ElasticPlastic(
    8930.0, 383.0, 294.0, 0.0, 0.0,
    LinearElastic(164.206e9), ConstantShearModulus(80.1938e9), Voce(0.45e9, 0.265e9, 16.93, 0.12924e9), None,
)  # fmt: skip


def copper(density, equation_of_state):
    parts = equation_of_state, ConstantShearModulus(47.7e9), COPPER_FLOW, ConstantMelting(1356.0)
    return ElasticPlastic(density, 383.0, 294.0, 0.9, 0.0, *parts)


def circle(t):
    a, s, c = 0.05, np.sin(2.0 * np.pi * t), np.cos(2.0 * np.pi * t)
    return np.array(
        [[1.0 + a * s, a * (1.0 - c), 0.0], [0.0, 1.0 - 0.4 * a * s, 0.5 * a * s], [0, 0, 1.0 - 0.4 * a * s]]
    )


MOTIONS = {
    "voce_shear": (VOCE, lambda t: ONE + t * SHEAR),
    "voce_uniaxial_strain": (VOCE, lambda t: np.diag([1.0 - 0.2 * t, 1.0, 1.0])),
    "voce_biaxial": (VOCE, lambda t: np.diag(np.exp([0.3 * t, 0.1 * t, -0.36 * t]))),
    "voce_circle": (VOCE, circle),
    "jc_copper_shear_1e5": (copper(8960.0, LinearElastic(140e9)), lambda t: ONE + 1e5 * t * SHEAR),
    "jc_copper_uniaxial_1e5_mg": (
        copper(8930.0, MieGrueneisen(8930.0, 3940.0, 1.489, 2.02)),
        lambda t: np.diag([1.0 - 1e5 * t, 1.0, 1.0]),
    ),
}


class Point:
    """The first particle of a tile along a path of F."""

    def __init__(self, law, F=ONE, failure=None, count=0):
        self.law, self.failure, self.tile, self.work = law, failure, update.new_tile(count), 0.0
        self.rows = self.tile.reshape(-1, update.TILE)
        self.rows[update.TEMPERATURE] = law.reference_temperature
        self.F = np.array(F)
        self.move(F, 0.0)

    def move(self, F, step):
        change = F - self.F
        self.rows[update.DEFORMATION : update.DEFORMATION + 9] = F.reshape(9, 1)
        self.rows[update.VELOCITY_GRADIENT : update.VELOCITY_GRADIENT + 9] = change.reshape(9, 1)
        self.rows[update.JACOBIAN], self.rows[update.HEAT], self.F = np.linalg.det(self.F), 0.0, np.array(F)
        advance_tile(self.law, self.failure, step, self.tile)
        self.work += self[update.PLASTIC_WORK]

    def __getitem__(self, row):
        return self.rows[row, 0]

    @property
    def first_piola_kirchhoff(self):
        return self.rows[update.STRESS : update.STRESS + 9, 0].reshape(3, 3)

    @property
    def cauchy(self):
        return self.first_piola_kirchhoff @ self.F.T / np.linalg.det(self.F)


def along(name, steps):
    """The point at each row of the reference, and the row."""
    law, motion = MOTIONS[name]
    rows = REFERENCE["rows"][name]
    point, end, each = Point(law), rows[-1][0], steps // len(rows)
    for i in range(1, steps + 1):
        point.move(motion(i * end / steps), end / steps)
        if i % each == 0:
            yield point, rows[i // each - 1]


STEPPED = [(name, int(steps)) for name, rows in REFERENCE["stepped"].items() for steps in rows]


@pytest.mark.parametrize(("name", "steps"), STEPPED)
def test_steps_err_as_those_of_another_program(name, steps):
    """Differences from the end values as an independent code of the same algorithm has them; that one heats by the work
    of the stress at the end of a step, of first order, which changes what depends on the temperature."""
    *_, (point, end) = along(name, steps)
    expected = REFERENCE["stepped"][name][str(steps)]
    sigma = point.cauchy[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]
    found = np.abs(sigma - end[1:7]).max() / np.abs(end[1:7]).max()
    heated = end[8] > 294.0
    assert found == pytest.approx(expected["stress"], rel=2e-3 if heated else 1e-6)
    assert point[update.PLASTIC_STRAIN] / end[7] - 1.0 == pytest.approx(expected["ep"], rel=0.05 if heated else 1e-4)
    if heated:
        assert abs(point[update.TEMPERATURE] - end[8]) < 0.4 * expected["T"]
        assert abs(point.work / end[10] - 1.0) < 0.4 * expected["plastic_work"]
    else:
        assert point[update.ENERGY] / end[9] - 1.0 == pytest.approx(expected["E"], rel=1e-4)
    metric = point.rows[update.METRIC : update.METRIC + 6, 0]
    assert np.linalg.det(metric[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]) == pytest.approx(1.0, abs=1e-13)


def test_a_closed_elastic_cycle_takes_no_energy():
    """With the stress of J mu d:d; 2.4e-3 of the energy of shear without."""
    strong = VOCE._replace(flow_stress=Voce(45e9, 0.0, 1.0, 0.0))
    point, most = Point(strong), 0.0
    for i in range(1, 401):
        angle = 2.0 * np.pi * i / 400.0
        point.move(ONE + 2e-3 * (np.sin(angle) * SHEAR + (1.0 - np.cos(angle)) * np.diag([1.0, -0.5, -0.5])), 1.0)
        most = max(most, point[update.ENERGY])
    assert point[update.PLASTIC_STRAIN] == 0.0 and abs(point[update.ENERGY]) < 1e-6 * most


@pytest.mark.parametrize("name", [name for name in library() if name.startswith("OFHC")])
def test_every_flow_stress_is_returned_to(name, plain_python):
    """q is the flow stress at the end of the step, with the heat of the step; energy is the work."""
    law = law_of(library()[name])
    point, step, work = Point(law), 1e-7, 0.0
    for i in range(1, 61):
        before, old, start = point.first_piola_kirchhoff.copy(), point.F, point[update.PLASTIC_STRAIN]
        warm = point[update.TEMPERATURE]
        point.move(np.diag([1.0 - 1e-3 * i, 1.0 + 4e-4 * i, 1.0]) + 1e-3 * i * SHEAR, step)
        work += 0.5 * np.sum((before + point.first_piola_kirchhoff) * (point.F - old))
    assert point[update.ENERGY] == pytest.approx(work, rel=1e-12)
    s = point.cauchy - np.trace(point.cauchy) / 3.0 * ONE
    q, x, J = np.sqrt(1.5 * np.sum(s * s)), point[update.INCREMENT], np.linalg.det(point.F)
    mu, melting = point[update.SHEAR_MODULUS], point[update.MELTING]
    heated = warm + law.taylor_quinney * J * q * x / (law.density * law.specific_heat)
    from parsolid.materials.plastic.functions import flow_stress

    assert flow_stress(law.flow_stress, start + x, x / step, heated, mu, melting) == pytest.approx(q, rel=1e-8)
    assert mu == pytest.approx(evaluation.shear_modulus(law, J, point[update.PRESSURE], warm), rel=2e-3)


@pytest.mark.parametrize("slope", [0.0, 300.0])
def test_failed_matter_bears_pressure_alone_and_its_energy_is_the_work_on_it(slope):
    """All that warms this solid, which has no thermal expansion, is what failure released."""
    failure, law = Failure(chained([MaximumTension(1e9)]), False, None), VOCE._replace(specific_heat_slope=slope)
    point, work = Point(law, failure=failure, count=1), 0.0
    path = [np.diag([1.0 + 0.002 * i, 1.0, 1.0]) for i in range(1, 16)]
    path += [np.diag([1.03 - 0.004 * i, 1.0, 1.0]) + 0.01 * i * SHEAR for i in range(1, 16)]
    released = 0.0
    for F in path:
        before, old = point.first_piola_kirchhoff.copy(), point.F
        point.move(F, 1.0)
        released += point[update.RELEASED]
        work += 0.5 * np.sum((before + point.first_piola_kirchhoff) * (F - old))
        if point[update.DAMAGE] >= 1.0:
            J = np.linalg.det(F)
            pressure = max(float(evaluation.pressure(VOCE, J, point[update.ENERGY])), 0.0)
            np.testing.assert_allclose(point.cauchy, -pressure * ONE, atol=1e-9 * 164e9)
    assert point[update.DAMAGE] == 1.0 and released > 0.0 and point[update.PRESSURE] > 1e9
    assert law.internal_energy(point[update.TEMPERATURE]) == pytest.approx(released, rel=1e-9)
    assert point[update.ENERGY] == pytest.approx(work, rel=1e-12)


def test_principal_values_and_axes_at_any_distance():
    random, worst = np.random.default_rng(1), 0.0
    for k in range(300):
        Q = np.linalg.qr(random.normal(size=(3, 3)))[0]
        values = (
            10.0 ** random.uniform(-3, 3, 3)
            if k % 3 == 0
            else 1.0 + 10.0 ** random.uniform(-18, 0) * random.normal(size=3)
        )
        A = Q @ np.diag(values) @ Q.T
        S = tuple(A[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)])
        found, V = principal(S)
        axes = np.reshape(V, (3, 3))
        worst = max(worst, np.abs(np.subtract(S, from_principal(found, V))).max() / np.abs(A).max())
        worst = max(worst, np.abs(axes.T @ axes - ONE).max())
        worst = max(worst, np.abs(np.sort(found) - np.sort(values)).max() / np.abs(values).max())
    assert worst < 1e-14


def test_series_and_principal_axes_give_the_same(plain_python, monkeypatch):
    states = []
    for small in (total_lagrangian.SMALL, -1.0):
        monkeypatch.setattr(total_lagrangian, "SMALL", small)
        rows = update.new_tile().reshape(-1, 1)
        change = 0.02 * np.random.default_rng(3).normal(size=(3, 3))
        rows[update.DEFORMATION : update.DEFORMATION + 9, 0] = (ONE + change).ravel()
        rows[update.VELOCITY_GRADIENT : update.VELOCITY_GRADIENT + 9, 0] = change.ravel()
        total_lagrangian.advance_tile(VOCE, None, 1e-3, rows.ravel())
        states.append(rows[[update.INCREMENT, *range(update.METRIC, update.METRIC + 15)], 0])
    assert states[0][0] > 0.01
    assert states[0] == pytest.approx(states[1], rel=1e-11)


@pytest.fixture
def same_names():
    before = total_lagrangian.times_symmetric, solids.times_symmetric
    yield
    assert (total_lagrangian.times_symmetric, solids.times_symmetric) == before


def test_names_are_as_before_after_plain_python(same_names, plain_python):
    """One is inlined, the other a kernel of the same function, with which others are 3 times slower."""
    assert total_lagrangian.times_symmetric is solids.times_symmetric
