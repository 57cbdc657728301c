"""Creep, recovery and vibration against numbers computed elsewhere, and against equations that the solutions must
satisfy.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from lattice_bar import fundamental_period, lattice_frequency

from parsolid.exact.linear_viscoelastic import BarVibration, PronySeries, UniaxialCreep, fitted_oscillation

_REFERENCE = Path(__file__).parents[2] / "runs" / "peridynamics" / "reference"
YOUNG = PronySeries(6.89e6, [62.01e6], [1.0])
BULK = 689e6
LOADED_AND_FREED = ((0.0, 1e6), (50.0, 1e6), (50.0, 0.0))


def reference(name):
    return json.loads((_REFERENCE / name).read_text())


def test_bar_creep_is_that_of_the_reference():
    data = reference("bar_creep.json")
    creep = UniaxialCreep.complete(YOUNG, 0.3, [(0.0, 0.689e6)], (0.0,))
    found = [creep.strains(time)[0] for time in data["t"]]
    assert np.allclose(found, data["series"]["strain"], rtol=1e-12)
    assert found[0] == pytest.approx(0.01) and creep.strains(1.0)[0] == pytest.approx(0.0185646, abs=5e-8)


def test_plate_that_is_loaded_and_freed():
    complete = UniaxialCreep.complete(YOUNG, 0.3, LOADED_AND_FREED, (0.0, 0.5))
    millimetres = {0.0: 14.5138, 49.9999999: 144.2577, 50.1: 128.4530, 100.0: 0.87421}
    corner = np.array([[1.0, 1.0]])
    for time, wanted in millimetres.items():
        u = complete.fields(corner, time)["displacement"][0]
        assert 1e3 * u[0] == pytest.approx(wanted, abs=6e-5)
        assert u[1] == pytest.approx(-0.3 * u[0] / 2)
    assert (
        complete.fields(corner, 49.0)["stress"][0, 0, 0] == 1e6
        and complete.stress(50.0) == complete.stress(99.0) == 0.0
    )


def test_deviatoric_plate_with_the_exact_conversion():
    # one term of E(t) at a fixed bulk modulus is one term of G(t) of another time
    shear = [3 * BULK * E / (9 * BULK - E) for E in (6.89e6, 68.9e6)]
    time = 1.0 * (9 * BULK - 68.9e6) / (9 * BULK - 6.89e6)
    assert shear[1] - shear[0] == pytest.approx(20.9255e6, rel=1e-5) and time == pytest.approx(0.989989, rel=1e-6)
    plate = UniaxialCreep.deviatoric(
        PronySeries(shear[0], [shear[1] - shear[0]], [time]), BULK, LOADED_AND_FREED, (0.0, 0.5)
    )
    complete = UniaxialCreep.complete(YOUNG, 0.3, LOADED_AND_FREED, (0.0, 0.5))
    for instant in (0.0, 3.0, 49.9, 50.0, 77.0):
        assert plate.strains(instant)[0] == pytest.approx(complete.strains(instant)[0], rel=1e-6)
    assert 500 * plate.strains(0.0)[1] == pytest.approx(-3.5075, abs=6e-5)
    assert 500 * plate.strains(49.9999999)[1] == pytest.approx(-35.9435, abs=6e-5)


def test_compliance_inverts_the_relaxation():
    series = PronySeries(2.0, [5.0, 1.0, 30.0, 0.0, 2.0], [0.1, 3.0, 40.0, 7.0, 3.0])
    compliance = series.compliance()
    assert len(compliance.rates) == 3 and series.instantaneous == 40.0
    # the convolution of E with dD is 1 at all times
    points, shares = np.polynomial.legendre.leggauss(400)
    for time in (0.05, 1.0, 20.0, 300.0):
        s, weights = 0.5 * time * (points + 1.0), 0.5 * time * shares
        rate = np.exp(-np.outer(s, compliance.rates)) @ (compliance.amplitudes * compliance.rates)
        total = series.relaxation(time) * compliance(0.0) + np.sum(weights * series.relaxation(time - s) * rate)
        assert total == pytest.approx(1.0, rel=1e-10)
    assert compliance(-1.0) == 0.0 and compliance(1e6) == pytest.approx(0.5)


def test_ramps_are_the_limit_of_many_small_jumps():
    compliance = YOUNG.compliance()
    ramp = [(1.0, 0.0), (3.0, 2e5), (6.0, 1e5)]
    steps, before = [], 0.0
    for time in np.arange(1.0, 6.0, 1e-3) + 5e-4:
        stress = np.interp(time + 5e-4, [1.0, 3.0, 6.0], [0.0, 2e5, 1e5])
        steps += [(time, before), (time, stress)]
        before = stress
    for time in (0.5, 2.0, 4.0, 9.0):
        assert compliance.strain(ramp, time) == pytest.approx(compliance.strain(steps, time), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("relaxed", (False, True))
def test_vibration_is_that_of_the_reference(relaxed):
    data = reference("bar_vibration.json")
    mode, name = data["mode1"], "relaxed" if relaxed else "instantaneous"
    bar = BarVibration(YOUNG, 1e4, 1.0, 1e-3, relaxed, modes=20_000)
    oscillation = bar.oscillation()
    assert oscillation.period == pytest.approx(mode["period_s"], rel=1e-9)
    assert oscillation.decay == pytest.approx(mode["decay_rate_1_s"], rel=1e-9)
    assert oscillation.creep == pytest.approx([-mode["real_root_1_s"]], rel=1e-6)
    # the series cut after 20,000 modes is within 1e-8 m
    places = np.array([[0.4995], [0.9995]])
    for i in range(0, len(data["t"]), 20):
        found = bar.fields(places, data["t"][i])["displacement"][:, 0]
        assert np.abs(found - [data["series"][f"{name}_{place}"][i] for place in ("centre", "tip")]).max() < 1.2e-8


def test_mode_of_the_vibration_starts_at_its_amplitude_and_is_elastic_without_terms():
    elastic = BarVibration(PronySeries(6.89e6), 1e4, 1.0, 1e-3, False, modes=3)
    assert elastic.oscillation(2).decay == pytest.approx(0.0, abs=1e-9) and len(elastic.oscillation().creep) == 0
    assert elastic.oscillation().period == pytest.approx(0.15238786355, rel=1e-9)
    time = np.linspace(0.0, 1.0, 7)
    assert np.allclose(elastic.modal(time), np.cos(elastic.oscillation().frequency * time))
    held = BarVibration(YOUNG, 1e4, 1.0, 1e-3, True, modes=3)
    # after the first oscillation nine tenths creep back with a retardation time of 10 s
    assert held.modal(0.0) == pytest.approx(1.0) and held.modal(20.0) == pytest.approx(0.9 * np.exp(-2.0), rel=2e-3)


def test_periods_of_a_lattice_bar():
    # a table of another program: period of mode 1 over the continuum's, minus 1, of 1000 points
    layers = {3: 1.00e-3, 10: 3.88e-3, 15: 5.98e-3, 20: 8.43e-3}
    mirrors = {3: 4e-7, 10: 2.8e-5, 15: 6.3e-5, 20: 9.4e-5}
    for reach in layers:
        assert fundamental_period(1000, reach, "layer") - 1.0 == pytest.approx(layers[reach], abs=6e-6)
        assert fundamental_period(1000, reach, "mirror") - 1.0 == pytest.approx(mirrors[reach], abs=6e-7)
    # of an infinite lattice
    angle = np.pi / 2000.0
    infinite = [float(angle / lattice_frequency(angle, reach) - 1.0) for reach in layers]
    assert np.allclose(infinite, [2.9e-6, 2.7e-5, 5.9e-5, 1.0e-4], rtol=0.04)
    assert lattice_frequency(0.7, 1) == pytest.approx(np.sin(0.7))


@pytest.mark.parametrize("relaxed", (False, True))
def test_period_and_decay_of_a_history_are_found(relaxed):
    bar = BarVibration(YOUNG, 1e4, 1.0, 1e-3, relaxed, modes=3)
    other = BarVibration(YOUNG, 1e4 * 1.0004, 1.0, 1e-3, relaxed, modes=3)
    time = np.linspace(0.0, 2.8065, 4001)
    found, exact = fitted_oscillation(time, other.modal(time), bar.oscillation()), bar.oscillation()
    assert found.period / exact.period - 1.0 == pytest.approx(2e-4, rel=1e-3)
    assert found.decay == pytest.approx(other.oscillation().decay, rel=1e-5)
    column = bar.history_columns()[0]
    errors = bar.history_errors({"time": time, column: bar.amplitude[0] * other.modal(time)})
    assert errors["period"] == pytest.approx(2e-4, rel=1e-3) and errors["decay_rate"] < 1e-4
    assert errors["amplitude"] == pytest.approx(np.abs(other.modal(time) - bar.modal(time)).max())


def test_history_of_a_creeping_plate_is_judged_on_both_sides_of_its_jumps():
    plate = UniaxialCreep.complete(YOUNG, 0.3, LOADED_AND_FREED, (0.0, 0.5))
    plate.probes = ["corner"]
    place, found = np.array([0.95, 0.9]), []
    rows = [
        (0.0, 0.0, -1.0),
        (0.0, 0.0, 0.0),
        (20.0, 0.1, 20.0),
        (50.0, 0.1, 49.9999999999),
        (50.0, 0.0, 50.0),
        (80.0, 0.1, 80.0),
    ]
    for _, _, instant in rows:
        found.append(plate.fields(place[None, :], instant)["displacement"][0])
    found = np.array(found)
    history = {"time": np.array([row[0] for row in rows]), "dt": np.array([row[1] for row in rows])}
    for i, axis in enumerate("xy"):
        history[f"corner.displacement_{axis}"], history[f"corner.position_{axis}"] = found[:, i], place[i] + found[:, i]
    assert set(history) == {"time", "dt", *plate.history_columns()}
    errors = plate.history_errors(history)
    assert set(errors) == set(plate.history_names()) and max(errors.values()) < 1e-10
    history["corner.displacement_y"] = 1.01 * history["corner.displacement_y"]
    history["corner.position_y"] = place[1] + history["corner.displacement_y"]
    assert plate.history_errors(history)["corner.displacement_y"] == pytest.approx(0.01)
