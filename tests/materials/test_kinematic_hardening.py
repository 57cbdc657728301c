"""Flow about a back stress, from deformation gradients and by rates: the shear cycle of `flow_motions.json` (fine
ordinary differential equations), objectivity, energies, limits."""

import json
from pathlib import Path

import numpy as np
import pytest
from materials.deformations import wave_ratios
from materials.test_total_lagrangian import COPPER_FLOW, ONE, SHEAR, VOCE, Point

from parsolid.materials.failure.failure import Failure, chained
from parsolid.materials.failure.plastic_strain import PlasticStrain
from parsolid.materials.hyperelastic.evaluation import symmetric_tensors
from parsolid.materials.plastic import tile_update as update
from parsolid.materials.plastic.armstrong_frederick import ArmstrongFrederick
from parsolid.materials.plastic.equation_of_state import LinearElastic
from parsolid.materials.plastic.linear_hardening import LinearHardening
from parsolid.materials.plastic.melting import ConstantMelting
from parsolid.materials.plastic.shear_modulus import ConstantShearModulus
from parsolid.point.plastic import PlasticPoint

REFERENCE = json.loads((Path(__file__).parent / "flow_motions.json").read_text())["armstrong_frederick"]
SATURATING = ArmstrongFrederick(REFERENCE["C"], REFERENCE["gamma"])
LAW = VOCE._replace(
    equation_of_state=LinearElastic(REFERENCE["K"]),
    shear_modulus=ConstantShearModulus(REFERENCE["mu"]),
    flow_stress=LinearHardening(REFERENCE["Y"], 0.0),
    kinematic_hardening=SATURATING,
)


def swung(t):
    return ONE + 0.1 * np.sin(2.0 * np.pi * t) * SHEAR


def voigt(S):
    return np.asarray(S)[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]


def mises(S):
    S = S - np.trace(S) / 3.0 * ONE
    return np.sqrt(1.5 * np.sum(S * S))


def cycle(steps):
    """Largest error of a stress over the largest stress, of s11, s22, s33 over the largest of these, and of ep, at the
    rows of the reference."""
    point, errors, rows = Point(LAW), [], {round(row[0] * steps / 1.25): row for row in REFERENCE["shear_cycle"]}
    normal = np.abs([row[1:4] for row in REFERENCE["shear_cycle"]]).max()
    for i in range(1, steps + 1):
        point.move(swung(1.25 * i / steps), 1.25 / steps)
        if i in rows:
            _, *stress, strain = rows[i]
            found, ep = voigt(point.cauchy), point[update.PLASTIC_STRAIN]
            shear = abs(found[3] - stress[3]) / abs(stress[3])
            errors.append((shear, np.abs(found - stress)[:3].max() / normal, abs(ep / strain - 1.0)))
    return np.max(errors, axis=0), point


def test_a_cycle_of_shear_is_that_of_fine_equations():
    (coarse, _), (fine, point) = cycle(1000), cycle(4000)
    assert (fine < (1.1e-3, 8e-3, 4e-5)).all(), fine
    # of first order: the return is implicit, and the stress turns by the step's shear
    assert (3.0 < coarse / fine).all() and (coarse / fine < 5.0).all(), (coarse, fine)
    metric = point.rows[update.METRIC : update.METRIC + 6, 0]
    assert np.linalg.det(symmetric_tensors(metric)) == pytest.approx(1.0, abs=1e-11)


def test_the_step_by_rates_ends_where_that_from_gradients_does():
    """The unrotated axes turn as the matter does at these shears: what is left is of the elastic strain."""
    steps, point, other, state = 1000, PlasticPoint(LAW), Point(LAW), None
    state = point.initial_state()
    for i in range(1, steps + 1):
        F = swung(1.25 * i / steps)
        state = point.updated(state, F, 1.25 / steps)
        other.move(F, 1.25 / steps)
    last = REFERENCE["shear_cycle"][-1]
    assert state.stress[0, 1] == pytest.approx(last[4], rel=1e-3)
    assert state.plastic_strain == pytest.approx(other[update.PLASTIC_STRAIN], rel=2e-3)
    assert state.stress == pytest.approx(other.cauchy, abs=2e-3 * abs(last[4]))
    # what the back stress stores is no dissipation
    back = state.back_stress
    square = back[:3] @ back[:3] + 2.0 * back[3:] @ back[3:]
    stored = 0.75 / SATURATING.modulus * square
    work = 0.5 * (other.work + state.plastic_work + stored)
    assert state.plastic_work + stored == pytest.approx(work, rel=3e-3) and stored > 5e5


@pytest.mark.parametrize("hardening", [SATURATING, ArmstrongFrederick(5e9, 0.0)])
def test_one_strain_forward_and_back_in_tension(hardening):
    """Isochoric uniaxial strain has fixed axes: the stress, the back stress and Bauschinger's effect in closed form."""
    law, steps, e = LAW._replace(kinematic_hardening=hardening), 400, 0.02
    point, C, g = Point(law), hardening.modulus, hardening.recovery
    for i in range(1, steps + 1):
        t = e * i / steps
        point.move(np.diag(np.exp([t, -0.5 * t, -0.5 * t])), 1.0)
    ep = point[update.PLASTIC_STRAIN]
    saturated = C / g * (1.0 - np.exp(-g * ep)) if g else C * ep
    assert mises(point.cauchy) == pytest.approx(300e6 + saturated, rel=2e-3)
    assert ep == pytest.approx(e - mises(point.cauchy) / (3.0 * REFERENCE["mu"]), rel=1e-9)
    back = e - 2.0 * (0.98 * 300e6) / (3.0 * REFERENCE["mu"])
    point.move(np.diag(np.exp([back, -0.5 * back, -0.5 * back])), 1.0)
    assert point[update.INCREMENT] == 0.0
    back = e - 2.0 * (1.02 * 300e6) / (3.0 * REFERENCE["mu"])
    point.move(np.diag(np.exp([back, -0.5 * back, -0.5 * back])), 1.0)
    assert point[update.INCREMENT] > 0.0


def random_path(random, steps=12):
    F, path = np.eye(3), []
    for _ in range(steps):
        F = F + 0.01 * random.standard_normal((3, 3)) @ F
        path.append(F)
    return path


def test_it_is_objective_and_a_step_back_finds_the_stress_again(random):
    path, Q = random_path(random), np.linalg.qr(random.standard_normal((3, 3)))[0]
    Q *= np.linalg.det(Q)
    plain, turned = Point(LAW), Point(LAW)
    for i, F in enumerate(path):
        # the turn grows along the path
        axis = np.linalg.matrix_power(Q, i % 2)
        plain.move(F, 1.0)
        turned.move(axis @ F, 1.0)
        assert turned.cauchy == pytest.approx(axis @ plain.cauchy @ axis.T, abs=1e-9 * mises(plain.cauchy))
    assert plain[update.INCREMENT] > 0.0
    before = plain.cauchy.copy()
    plain.move(path[-1], 0.0)
    assert plain.cauchy == pytest.approx(before, abs=1e-9 * mises(before))


@pytest.mark.parametrize("flow", [LAW.flow_stress, VOCE.flow_stress, COPPER_FLOW], ids=["linear", "voce", "jc"])
def test_every_state_is_on_its_surface_and_nothing_is_gained(flow, random, plain_python):
    """|s - beta| is the flow stress, beta stays within its bound, and flow dissipates what its work does not store."""
    law = LAW._replace(flow_stress=flow, melting=ConstantMelting(1356.0), taylor_quinney=0.9)
    point, bound = Point(law), REFERENCE["C"] / REFERENCE["gamma"]
    for F in random_path(random, 30):
        before = point[update.TEMPERATURE]
        point.move(F, 1e-4)
        back = point.rows[update.BACK_STRESS : update.BACK_STRESS + 6, 0]
        full = symmetric_tensors(back)
        assert abs(np.trace(full)) < 1e-12 * bound and mises(full) <= bound
        if point[update.INCREMENT] > 0.0:
            x = point[update.INCREMENT]
            heating = law.taylor_quinney * np.linalg.det(F) / point[update.CAPACITY]
            size = mises(point.cauchy - full)
            state = (point[update.PLASTIC_STRAIN], x / 1e-4, before + heating * size * x, 1.0, 1356.0)
            assert size == pytest.approx(update.flow_stress(flow, *state), rel=1e-7)
            dissipated = point[update.PLASTIC_WORK] - point[update.BACK_STRESS_ENERGY]
            assert dissipated > 0.0
            assert point[update.TEMPERATURE] == pytest.approx(before + 0.9 * dissipated / point[update.CAPACITY])


def ratios_of_waves(point, random):
    """Of the elastic tangent at a point, by central differences, along 20 normals; see `wave_ratios`."""
    F, Q = point.F, symmetric_tensors(point.rows[update.WAVES : update.WAVES + 6, 0])
    tangent, step = np.empty((3, 3, 3, 3)), 1e-6
    for k, L in np.ndindex(3, 3):
        change, stresses = np.zeros((3, 3)), []
        change[k, L] = step
        for sign in (1.0, -1.0):
            point.move(F + sign * change, 0.0)
            stresses.append(point.first_piola_kirchhoff.copy())
        tangent[:, :, k, L] = (stresses[0] - stresses[1]) / (2.0 * step)
    return wave_ratios(Q, tangent, random.standard_normal((20, 3)))


def test_waves_of_states_that_have_flowed_are_bounded(random):
    """rho c^2 <= N.QN of the elastic tangent, by differences of the stress of states whose axes are not those of F."""
    ratios = []
    for _ in range(20):
        point = Point(
            LAW._replace(flow_stress=LinearHardening(1e9, 0.0), kinematic_hardening=ArmstrongFrederick(90e9, 1.0))
        )
        for F in random_path(random, 5):
            point.move(F + 0.02 * random.standard_normal((3, 3)), 1.0)
        assert point[update.PLASTIC_STRAIN] > 0.01
        ratios += ratios_of_waves(point, random)
    assert min(ratios) >= 1.0 and np.mean(ratios) < 1.1, (min(ratios), np.mean(ratios))


def test_failed_matter_has_no_back_stress_and_its_energy_is_heat():
    failure = Failure(chained([PlasticStrain(0.02)]), False, None)
    point, stored = Point(LAW, failure=failure, count=1), 0.0
    for i in range(1, 40):
        point.move(ONE + 0.002 * i * SHEAR, 1.0)
        stored += point[update.BACK_STRESS_ENERGY]
        if point[update.DAMAGE] >= 1.0:
            break
    rows = point.rows[update.REFERENTIAL_BACK_STRESS : update.REFERENTIAL_BACK_STRESS + 6, 0]
    assert point[update.DAMAGE] == 1.0 and not rows.any()
    elastic = (300e6 + REFERENCE["C"] / REFERENCE["gamma"]) ** 2 / (6.0 * REFERENCE["mu"])
    assert stored < point[update.RELEASED] < stored + elastic
    point.move(ONE + 0.1 * SHEAR, 1.0)
    assert point[update.INCREMENT] == 0.0 and mises(point.cauchy) == 0.0
