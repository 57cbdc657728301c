"""Short whole runs of updated-Lagrangian SPH with micro-inertia against closed forms and an independent prototype."""

from pathlib import Path

import numpy as np
import pytest

from parsolid.exact.micro_inertia import MicroLayer
from parsolid.scene import load_scene

RUNS = Path(__file__).parents[2] / "runs" / "ulsph"


def test_cosine_mode_of_delayed_heat(run):
    """Amplitudes of the formulation's closed form; matter stays exactly at rest, heat is kept."""
    errors, history = run("ulsph/cosine_mode")
    times, found = history["time"], history["mode.temperature"]
    for time, wanted in ((1e-6, 0.85914997), (2e-6, 0.59978093), (4e-6, 0.18422329)):
        assert found[np.argmin(np.abs(times - time))] == pytest.approx(wanted, abs=3e-3)
    assert errors["temperature@1e-06"] < 4e-3
    heat = history["bar.heat"]
    assert np.abs(heat / heat[0] - 1.0).max() < 1e-13
    for name in ("kinetic", "strain_energy", "end.velocity_x", "end.displacement_y"):
        assert not history[name].any()


def test_pulse_of_delayed_heat(run):
    """Two pulses at 1000 m/s, 0.5 mm wide on a spacing of 0.1 mm."""
    errors, _ = run("ulsph/heat_pulse", "bodies.0.particles=[100, 10]", "end_time=1e-6", "reference.times=[1e-6]")
    coarse = errors["temperature@1e-06"]
    errors, _ = run("ulsph/heat_pulse", "end_time=1e-6", "reference.times=[1e-6]")
    assert errors["temperature@1e-06"] < 0.02
    assert coarse > 2.0**1.5 * errors["temperature@1e-06"]


def test_linear_impact(run):
    """sigma = -rho c v0 and |S| = 2 mu sqrt(2/3) v0/c between the fronts; nothing flows."""
    errors, history = run("ulsph/linear_impact", *(f"bodies.{body}.particles=[142, 7]" for body in (0, 1)))
    assert max(errors.values()) < 2e-3
    assert np.abs(history["energy_error"]).max() < 2e-5 * history["kinetic"][0]
    # without leapfrog's oscillation the largest is that of the first steps of the contact
    plain = history["energy_error"] + history["kinetic_offset"]
    assert np.abs(plain).max() < 2e-4 * history["kinetic"][0]
    assert abs(plain[-1]) < 1e-5 * history["kinetic"][0]


@pytest.fixture
def coarser(monkeypatch):
    """Differences of fourth order with twice the step."""
    monkeypatch.setattr(MicroLayer, "step", 4e-9)


def at_the_middle(clamped: bool, end: float) -> tuple[float, float]:
    """gamma and pi [Pa] of the differences in the middle of the layer at a time [s]."""
    scene = load_scene(RUNS / "micro_layer.toml")
    layer = MicroLayer(scene.bodies[0].material.micro_inertia_law(), 1e-3, 5e3, clamped, end)
    exact = layer.fields(np.array([[0.125e-3, 0.5e-3]]), end)
    return exact["plastic_strain"][0], exact["micro_stress"][0]


@pytest.mark.usefixtures("coarser")
def test_micro_hard_layer(run):
    errors, history = run("ulsph/micro_layer", "end_time=2.5e-6", "reference.times=[2.5e-6]")
    assert errors["plastic_strain@2.5e-06"] < 0.025
    assert errors["micro_stress@2.5e-06"] < 2e-3
    strain, stress = at_the_middle(True, 2.5e-6)
    assert history["middle.plastic_strain"][-1] == pytest.approx(strain, rel=2e-3)
    assert history["middle.micro_stress"][-1] == pytest.approx(stress, rel=1e-3)
    work = history["external_work"][-1]
    assert np.abs(history["energy_error"]).max() < 1e-4 * work


@pytest.mark.usefixtures("coarser")
def test_micro_free_layer_is_a_material_point(run):
    """At its faces and corners too: the bound on the correction is above what they need."""
    motion = '{ kind = "velocity", box = { lower = [-1e-3, -1e-3], upper = [1e-3, 2e-3] }, velocity = ["5e3*Y", 0] }'
    changes = ("end_time=5e-6", "reference.times=[5e-6]", "bodies.0.particles=[5, 21]", f"boundaries=[{motion}]")
    errors, history = run("ulsph/micro_layer", *changes)
    strain, stress = at_the_middle(False, 5e-6)
    assert history["middle.plastic_strain"][-1] == pytest.approx(strain, rel=3e-4)
    assert history["middle.micro_stress"][-1] == pytest.approx(stress, rel=3e-4)
    assert errors["plastic_strain@5e-06"] < 1e-6
    assert errors["micro_stress@5e-06"] < 1e-5


def test_free_standing_micro_wave(run):
    """An initial v^p and nothing else: half a period; energy goes into the micro-stress and comes back."""
    errors, history = run("ulsph/free_micro_wave", "end_time=10e-6", "reference.times=[10e-6]")
    assert max(errors.values()) < 6e-3
    kinetic = history["kinetic"]
    assert np.abs(history["energy_error"]).max() < 1e-4 * kinetic[0]
    assert history["strain_energy"].max() > 0.25 * kinetic[0] > 1e4 * history["strain_energy"][-1]
    assert history["mode.micro_rate"][-1] < -0.98 * history["mode.micro_rate"][0]


def test_driven_micro_wave(run):
    errors, history = run("ulsph/micro_wave")
    assert errors["micro_rate@1.5e-06"] < 2e-3
    assert np.abs(history["energy_error"]).max() < 1e-4 * history["external_work"][-1]


def test_plate_impact(run):
    """71 x 21 to 20 us: energy to .3 %, momentum to rounding; mean gamma is 5 % below that of 212 x 63, .283."""
    _, history = run("ulsph/plate_impact", "end_time=20e-6")
    assert np.abs(history["energy_error"]).max() < 3e-3 * history["kinetic"][0]
    momentum = 7830.0 * 25.4e-3 * 7.62e-3 * 208.0
    assert np.abs([history[f"both.linear_momentum_{axis}"] for axis in "xy"]).max() < 1e-12 * momentum * len(
        history["time"]
    )
    assert history["mean.mean_plastic_strain"][-1] == pytest.approx(0.2678, rel=5e-3)
