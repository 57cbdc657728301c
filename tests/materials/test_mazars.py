"""Mazars's damage: the fracture energy of a band of any width, strengths, the energy of a cycle, waves; the width that
a method gives a crack; what is refused; ranks and a restart amid damage. A notched beam in `tlsph` against finite
elements with a cohesive crack (long).
"""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from materials.deformations import arguments, stress
from scipy.optimize import brentq

from parsolid.materials import registry
from parsolid.materials.hyperelastic import functions as of
from parsolid.materials.hyperelastic.at_particles import after_step
from parsolid.scene import SceneError, parse_scene
from parsolid.scene.materials import ValueFault
from parsolid.simulation.loop import Simulation

CONCRETE = {
    "kind": "mazars",
    "density": 2346.0,
    "youngs_modulus": 37e9,
    "poissons_ratio": 0.21,
    "tensile_strength": 3.9e6,
    "fracture_energy": 143.2,
}
METHODS = {
    "tlsph": {"kind": "tlsph"},
    "mpm": {"kind": "mpm", "cell": 0.04},
    "peridynamics": {"kind": "peridynamics", "horizon_ratio": 3, "stabilisation": {"kind": "none"}},
}


def tables(method=METHODS["tlsph"], **material):
    body = {
        "shape": {"box": {"lower": [0.0, 0.0], "upper": [0.1, 0.1]}},
        "particles": [5, 5],
        "placement": "cells" if method["kind"] == "mpm" else "vertices",
        "material": CONCRETE | material,
    }
    return {
        "dimension": 2,
        "end_time": 1.0,
        "method": method,
        "bodies": [body],
        "probes": [{"name": "middle", "at": [0.05, 0.05], "fields": ["damage"]}],
    }


def scene(method=METHODS["tlsph"], **material):
    return parse_scene(tables(method, **material))


def law(**material):
    return scene(**({"band": 2.5e-3} | material)).bodies[0].material.law_at((0.0, 0.0))


def pulled(solid, strains):
    """Nominal stresses [Pa] along a uniaxial path of strains with free sides, the work [J/m^3] and the law after it."""
    stresses, work, before = [], 0.0, (0.0, 0.0)
    for strain in strains:

        def of_sides(across, strain=strain):
            F = np.diag([1.0 + strain, 1.0 + across, 1.0 + across])
            after = after_step(solid, *arguments(F))
            return after, stress(after, F)

        found = brentq(lambda across: of_sides(across)[1][1, 1], -2.0 * abs(strain), 3.0 * abs(strain), xtol=1e-16)
        solid, P = of_sides(found)
        work += 0.5 * (P[0, 0] + before[1]) * (strain - before[0])
        before = strain, P[0, 0]
        stresses.append(P[0, 0])
    return np.array(stresses), work, solid


@pytest.mark.parametrize("band", [1e-3, 1e-2])
def test_a_crack_takes_the_fracture_energy_whatever_the_width_of_its_band(band):
    solid = law(band=band)
    softening = CONCRETE["fracture_energy"] / CONCRETE["tensile_strength"] / band
    strains = np.concatenate([np.linspace(0.0, 2e-4, 101)[1:], 2e-4 + softening * np.linspace(0.0, 12.0, 1500)[1:]])
    stresses, work, after = pulled(solid, strains)
    # of the strain ln(1 + e) on the way up, of nominal stress
    assert stresses.max() == pytest.approx(3.9e6, rel=1e-2)
    # nominal work of logarithmic laws at the strains of an open crack
    assert after.damage_dissipation * band == pytest.approx(143.2, rel=6e-3)
    assert after.damage_dissipation == pytest.approx(work, rel=2e-2)


def test_damage_in_tension_is_that_of_the_formula_and_compression_bears_five_times_as_much():
    solid, e = law(poissons_ratio=0.0), 5e-4
    after = after_step(solid, *arguments(np.diag([np.exp(e), 1.0, 1.0])))
    first, last = 3.9e6 / 37e9, 0.5 * 3.9e6 / 37e9 + 143.2 / (3.9e6 * 2.5e-3)
    assert after.damage == pytest.approx(1.0 - first / e * np.exp(-(e - first) / (last - first)), rel=1e-12)
    stresses, _, _ = pulled(law(), -np.linspace(0.0, 2e-3, 101)[1:])
    assert stresses.min() == pytest.approx(-21.2e6, rel=5e-3)


def test_pressure_stays_where_a_crack_has_closed():
    solid = law()._replace(damage=0.999)
    closed, opened = (np.diagonal(stress(solid, np.exp(e) * np.eye(3))) for e in (-1e-3, 1e-3))
    assert closed == pytest.approx(-3e-3 * solid.bulk_modulus * np.exp(2e-3), rel=2e-3)
    assert opened == pytest.approx(3e-6 * solid.bulk_modulus, rel=5e-3)


def around_a_cycle(steps):
    """Work over what is dissipated, of a way on which damage grows with turned axes, and back."""
    solid, work, before, P_before = law(), 0.0, np.eye(3), np.zeros((3, 3))
    way = np.array([[1.0, 0.4, 0.0], [0.1, -0.3, 0.0], [0.0, 0.2, 0.5]])
    for size in 1e-3 * np.sin(np.linspace(0.0, np.pi, steps + 1))[1:]:
        F = np.eye(3) + size * way
        solid = after_step(solid, *arguments(F))
        P = stress(solid, F)
        work += 0.5 * float(np.sum((P + P_before) * (F - before)))
        before, P_before = F, P
    return work / of.dissipated_energy(solid)


def test_work_around_a_cycle_is_what_damage_dissipates():
    coarse, fine = (abs(around_a_cycle(steps) - 1.0) for steps in (200, 400))
    assert fine < 4e-4 and fine < 0.5 * coarse, (coarse, fine)


@pytest.mark.parametrize(("kind", "expected"), [("tlsph", 0.05), ("mpm", 0.08), ("peridynamics", 0.15)])
def test_particles_have_the_band_of_their_method(comm, kind, expected, plain_python):
    band = Simulation(comm, scene(METHODS[kind])).systems[0].particles.owned_rows("band")
    assert band == pytest.approx(np.full(len(band), expected))


def test_bands_that_snap_back_and_points_without_a_band_are_refused(comm):
    with pytest.raises(ValueFault, match="^band: "):
        scene().bodies[0].material.law_at((0.0, 0.0))
    for wide in (scene().bodies[0].material.largest_band, 0.0):
        with pytest.raises(Exception, match=r"bodies\.0\.material\.band"):
            Simulation(comm, scene(band=wide))
    with pytest.raises(SceneError, match=r"method\.stabilisation\.kind"):
        scene({"kind": "peridynamics"})
    assert registry.law_of(scene().bodies[0].material).damage == 0.0


@pytest.mark.long
def test_a_notched_beam_bears_as_much_as_one_with_a_cohesive_crack(tmp_path):
    """Peak load 1258 N and 693 N at an opening of 0.15 mm by linear finite elements of 2.5 mm, with nu = 0 and a
    cohesive crack of the same strength, fracture energy and exponential softening along the ligament."""
    beam = Path(__file__).parents[2] / "validation" / "scenes" / "concrete_beam.toml"
    command = [sys.executable, "-m", "parsolid", "run", str(beam), "-o", str(tmp_path / "out")]
    subprocess.run([*command, "--set", "bodies.0.material.poissons_ratio=0"], check=True, capture_output=True)
    with open(tmp_path / "out" / "history.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    column = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    load = np.convolve(-0.05 * column["head.force_y"], np.full(5, 0.2), "same")
    opening = column["right.displacement_x"] - column["left.displacement_x"]
    assert load.max() == pytest.approx(1258.0, rel=0.02)
    assert np.interp(1.5e-4, opening, load) == pytest.approx(693.0, rel=0.04)
    assert column["energy_error"][-1] < 1e-4 * column["external_work"][-1]
