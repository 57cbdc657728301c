"""Soils: the shear of `flow_motions.json`, apex, cap and tension against closed forms and ordinary differential
equations, objectivity, waves, what flow dissipates."""

import json
from pathlib import Path

import numpy as np
import pytest
from materials.test_kinematic_hardening import mises, random_path, ratios_of_waves, voigt
from materials.test_total_lagrangian import ONE, SHEAR, Point
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from parsolid.materials.plastic import tile_update as update
from parsolid.materials.plastic.drucker_prager import DruckerPrager, cone
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.equation_of_state import LinearElastic
from parsolid.materials.plastic.shear_modulus import ConstantShearModulus

REFERENCE = json.loads((Path(__file__).parent / "flow_motions.json").read_text())["drucker_prager"]
G, K = REFERENCE["G"], REFERENCE["K"]
NEVER = np.inf
FLOW = DruckerPrager(np.radians(REFERENCE["phi"]), np.radians(REFERENCE["psi"]), REFERENCE["c"], NEVER, NEVER, NEVER)
ETA, STRENGTH = cone(FLOW.friction_angle, FLOW.cohesion)
DILATION = cone(FLOW.dilation_angle, 0.0)[0]


def soil(**changes):
    parts = LinearElastic(K), ConstantShearModulus(G), FLOW._replace(**changes), None
    return ElasticPlastic(1600.0, 800.0, 300.0, 0.9, 0.0, *parts)


def pressed(law, pressure):
    """A point at rest under a pressure [Pa]."""
    point = Point(law)
    point.rows[update.PLASTIC_VOLUME] = pressure / K
    point.move(ONE, 0.0)
    return point


def mean(point):
    """Mean Cauchy stress."""
    return np.trace(point.cauchy) / 3.0


def test_the_cones_numbers_are_those_of_the_angles():
    assert (ETA, STRENGTH, DILATION) == pytest.approx([REFERENCE[name] for name in ("eta", "k", "eta_bar")], rel=1e-7)


def sheared(steps):
    """Largest errors of the stress over the largest stress, and of the plastic volume, at the rows."""
    point, errors, rows = pressed(soil(), 1e5), [], {round(row[0] * steps): row for row in REFERENCE["shear"]}
    for i in range(1, steps + 1):
        point.move(ONE + 0.3 * i / steps * SHEAR, 1.0 / steps)
        if i in rows:
            _, *stress, volume = rows[i]
            opened = point[update.PLASTIC_VOLUME] - 1e5 / K
            errors.append((np.abs(voigt(point.cauchy) - stress).max() / np.abs(stress).max(), abs(opened / volume - 1)))
    return np.max(errors, axis=0), point


def test_shear_under_pressure_dilates_as_fine_equations_say():
    (coarse, _), (fine, point) = sheared(400), sheared(1600)
    assert (fine < (3e-4, 1e-4)).all(), fine
    assert (3.0 < coarse / fine).all() and (coarse / fine < 5.0).all(), (coarse, fine)
    # the work that is neither elastic nor of flow is none, to first order
    s = point.cauchy - mean(point) * ONE
    elastic = np.sum(s * s) / (4.0 * G) + 0.5 * mean(point) ** 2 / K - 0.5 * 1e10 / K
    assert point[update.ENERGY] - elastic == pytest.approx(point.work, rel=1e-3)
    assert point.work > elastic


def test_tension_ends_at_the_apex_or_at_the_cut_off():
    for law, bound in ((soil(), STRENGTH / ETA), (soil(tension=2e3), 2e3), (soil(cohesion=0.0), 0.0)):
        point = Point(law)
        for i in range(1, 21):
            point.move((1.0 + 0.001 * i) * ONE, 1.0)
        J = 1.02**3
        # Kirchhoff's pressure is K times the logarithm, and Cauchy's has the bound
        assert mean(point) == pytest.approx(bound, rel=1e-9, abs=1e-6)
        assert point[update.PLASTIC_VOLUME] == pytest.approx(np.log(J) - bound * J / K, rel=1e-9)
        assert mises(point.cauchy) < 1e-6
        # and is no less when it closes: pressure comes back at once
        point.move(1.0190 * ONE, 1.0)
        assert mean(point) < -1e3


def test_the_cap_hardens_as_it_is_compacted():
    """Isotropic compaction far beyond the cap: p = p_0 exp(plastic volume/c), by one equation at the end."""
    law, c, start = soil(cap_pressure=5e4, compaction=0.02), 0.02, 5e4
    ends = []
    for steps in (20, 200):
        point = Point(law)
        for i in range(1, steps + 1):
            point.move(np.exp(-0.1 / 3.0 * i / steps) * ONE, 1.0)
        ends.append((-mean(point), point[update.COMPACTION]))
    J = np.exp(-0.1)
    compacted = brentq(lambda v: K * (0.1 - v) / J - start * np.exp(v / c), 0.0, 0.1, xtol=1e-15)
    assert ends[1][1] == pytest.approx(compacted, rel=1e-9)
    assert ends[1][0] == pytest.approx(start * np.exp(compacted / c), rel=1e-9)
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)
    # it unloads elastically and keeps its cap
    point.move(np.exp(-0.099 / 3.0) * ONE, 1.0)
    assert point[update.COMPACTION] == pytest.approx(compacted, rel=1e-12)
    assert -mean(point) == pytest.approx(K * (0.099 - compacted) / np.exp(-0.099), rel=1e-9)


def test_one_step_far_beyond_the_cap_meets_its_equation(random):
    """The count of Newton's method is fixed; pressures to 1e4 caps, stiff and soft."""
    for _ in range(60):
        start, c = 10.0 ** random.uniform(2, 6), 10.0 ** random.uniform(-3, -0.5)
        point, e = Point(soil(cap_pressure=start, compaction=c)), 10.0 ** random.uniform(-4, -0.5)
        point.move(np.exp(-e / 3.0) * ONE, 1.0)
        v, J = point[update.COMPACTION], np.exp(-e)
        if v > 0.0:
            assert K * (e - v) / J == pytest.approx(start * np.exp(v / c), rel=1e-10)


def oedometer(t, y):
    """Rates of the axial deviator and of the mean stress [Pa] in uniaxial strain of the perfect cone, small strain."""
    s, p = y
    s_rate, p_rate = 2.0 * G * (-0.01) * 2.0 / 3.0, K * (-0.01)
    loading = np.sqrt(0.75) * np.sign(s) * s_rate + ETA * p_rate
    if np.sqrt(0.75) * abs(s) + ETA * p < STRENGTH or loading <= 0.0:
        return [s_rate, p_rate]
    flow = loading / (G + K * ETA * DILATION)
    return [s_rate - 2.0 * G * flow * np.sign(s) / np.sqrt(3.0), p_rate - K * DILATION * flow]


def test_a_path_in_uniaxial_strain_is_that_of_the_rate_equations():
    """Axial strain of 1 % from a small pressure; the integrator's steps are a hundred times finer."""
    point = pressed(soil(), 2e3)
    for i in range(1, 201):
        point.move(np.diag([np.exp(-0.01 * i / 200), 1.0, 1.0]), 1.0)
    ends = solve_ivp(oedometer, (0.0, 1.0), [0.0, -2e3], max_step=1e-3, rtol=1e-8).y[:, -1]
    found = point.cauchy * np.linalg.det(point.F)
    assert found[0, 0] - np.trace(found) / 3.0 == pytest.approx(ends[0], rel=2e-3)
    assert np.trace(found) / 3.0 == pytest.approx(ends[1], rel=2e-3)


@pytest.mark.parametrize("changes", [{}, {"tension": 2e3, "cap_pressure": 2e4, "compaction": 0.01}])
def test_states_are_admissible_objective_and_flow_dissipates(changes, random):
    Q = np.linalg.qr(random.standard_normal((3, 3)))[0]
    Q *= np.linalg.det(Q)
    law = soil(**changes)
    plain, turned, worked = Point(law), Point(law), 0.0
    for i, F in enumerate(random_path(random, 40)):
        axis = Q if i % 2 else ONE
        plain.move(F, 1.0)
        turned.move(axis @ F, 1.0)
        size = np.abs(plain.cauchy).max()
        assert turned.cauchy == pytest.approx(axis @ plain.cauchy @ axis.T, abs=1e-9 * size + 1e-6)
        root, p = mises(plain.cauchy) / np.sqrt(3.0), mean(plain)
        bound = plain.law.flow_stress.cap_pressure * np.exp(plain[update.COMPACTION] / plain.law.flow_stress.compaction)
        assert root <= STRENGTH - ETA * p + 1e-9 * size + 1e-6 and p <= law.flow_stress.tension + 1e-6
        assert -p <= bound * (1.0 + 1e-9) if np.isfinite(bound) else True
        assert plain[update.PLASTIC_WORK] >= -1e-9 * size
        worked += plain[update.PLASTIC_WORK]
    assert worked > 1e3 and plain[update.TEMPERATURE] == pytest.approx(
        300.0 + 0.9 * worked / (1600.0 * 800.0), rel=1e-9
    )


def test_a_closed_elastic_cycle_takes_nothing():
    """Kirchhoff's stress of Hencky's energy; what is left is of the order of the step, squared."""
    point = Point(soil(cohesion=1e9))
    for i in range(1, 401):
        t = 2.0 * np.pi * i / 400
        point.move(ONE + 0.01 * np.sin(t) * SHEAR + 0.01 * (1.0 - np.cos(t)) * np.diag([1.0, -0.5, 0.3]), 1.0)
    assert abs(point[update.ENERGY]) < 1e-6 * G * 0.02**2 and point.work == 0.0


def test_waves_of_states_that_have_flowed_are_bounded(random):
    ratios = []
    for _ in range(20):
        point = Point(soil(cohesion=1e6))
        for F in random_path(random, 5):
            point.move(F + 0.03 * random.standard_normal((3, 3)), 1.0)
        ratios += ratios_of_waves(point, random)
    assert min(ratios) >= 1.0 and np.mean(ratios) < 1.1, (min(ratios), np.mean(ratios))
