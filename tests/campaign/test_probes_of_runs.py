"""Probes between particles: what the place of a run's particle costs is in its bar, and that of coarse runs is not."""

from pathlib import Path

import numpy as np
import pytest

from parsolid.campaign.coarsening import parsed
from parsolid.campaign.error_bars import error_table
from parsolid.campaign.estimate import SAFETY
from parsolid.campaign.probes import at_particles, box_of, nearest, with_corners
from parsolid.campaign.runner import Record, VariantRun
from parsolid.campaign.variants import RATIOS, SPACING, STEP, Variant, coarse_variants, usual_ratios
from parsolid.scene import load_scene

RUNS = Path(__file__).parents[2] / "runs"
PLACE, TIME = np.array([0.013, 0.0]), np.linspace(0.0, 1.0, 101)
SLAB = [
    "bodies.0.particles=[64, 16]",
    "method.cell=6.25e-4",
    "bodies.0.shape.box.upper=[0.02, 0.005]",
    "boundaries.3.plane=Y = 0.005",
    'probes=[{ name = "third", at = [0.013, 0.0], fields = ["temperature"] }]',
]


@pytest.fixture
def scene():
    return load_scene(RUNS / "mpm" / "cosine_mode.toml", SLAB)


def field(place, error=0.0):
    """A temperature that is linear in the place and grows with time, with an error."""
    return TIME * (300.0 + 2e4 * place[0] - 1e3 * place[1]) + error * TIME


def run_of(variant, coefficient):
    """A variant whose particles have the field with an error of the second order."""
    history = {"time": TIME}
    for probe in variant.scene.probes:
        lattice = box_of(variant.scene, np.array(probe.at))
        value = field(nearest(lattice, np.array(probe.at)), coefficient * variant.ratio**2)
        history[f"{probe.name}.temperature"] = value
    return VariantRun(variant, Record("finished", history))


def test_variants_record_the_particles_around_a_place_and_say_what_is_at_any_other(scene):
    found, _ = coarse_variants(scene, False)
    for one in found:
        (corners,) = one.corners
        assert len(corners.names) == 4 and len(one.scene.probes) == 5
        run = run_of(one, 0.0)
        history, apart = at_particles(scene, run.history, one.corners)
        here = nearest(box_of(scene, PLACE), PLACE)
        assert np.abs(here - PLACE).max() > 1e-5
        assert np.allclose(history["third.temperature"], field(here), rtol=1e-12)
        assert np.allclose(apart["third.temperature"], field(PLACE) - field(here), atol=1e-9)
    # the nearest particles of the variants stand elsewhere
    raw = run_of(found[0], 0.0).history["third.temperature"]
    assert np.abs(raw - field(here)).max() > 1.0


def test_the_bar_has_the_error_and_the_place(scene):
    found, _ = coarse_variants(scene, False)
    here = nearest(box_of(scene, PLACE), PLACE)
    history = {"step": np.arange(101.0), "time": TIME, "third.temperature": field(here, 0.5)}
    scene.__dict__["end_time"] = 1.0
    bar = error_table(scene, history, [run_of(one, 0.5) for one in found if one.purpose != STEP]).bars[
        "third.temperature"
    ]
    assert bar.order == pytest.approx(2.0, abs=0.02) and set(bar.parts) == {"spacing", "place"}
    assert bar.parts["spacing"][-1] == pytest.approx(0.5, rel=0.02)
    assert bar.parts["place"][-1] == pytest.approx(abs(field(PLACE) - field(here))[-1], rel=1e-6)
    assert bar.error[-1] == pytest.approx(SAFETY * (bar.parts["spacing"][-1] + bar.parts["place"][-1]), rel=0.02)


def test_probes_at_particles_of_all_lattices_need_nothing_more():
    found, _ = coarse_variants(load_scene(RUNS / "tlsph" / "tensile_smooth.toml"), False)
    assert all(not one.corners and len(one.scene.probes) == 1 for one in found)


@pytest.mark.parametrize(
    "name, particles, expected",
    [
        ("tlsph/tensile_smooth", [57, 57], (0, [3.5, 56 / 30])),
        ("tlsph/torsion", [9, 49, 9], (0, [8 / 3, 2.0])),
        # two intervals through the thickness are what the method needs
        ("tlsph/tensile_smooth", [57, 5], (1, None)),
        ("mpm/cosine_mode", [96, 12], (1, None)),
        # 6 intervals have coarse runs of 4 and of 3, and of 2 none
        ("peridynamics/extreme/bending", [6, 24, 6], (2, [2.0, 2.0, 2.0, 1.5])),
    ],
)
def test_variants_are_so_coarse_that_enough_particles_are_left(name, particles, expected):
    scene = load_scene(RUNS / f"{name}.toml", [f"bodies.0.particles={particles}"])
    place, ratios = expected
    assert usual_ratios(scene) == RATIOS[scene.dimension][place]
    if ratios:
        assert [one.ratio for one in coarse_variants(scene, False)[0]] == pytest.approx(ratios, rel=0.05)


def test_levels_of_a_search_are_compared_where_probes_are_asked_for(scene):
    """Each has its own particle near the place, and an error of the second order that is the same at any of them."""
    found, _ = coarse_variants(scene, False)
    tables, corners = with_corners(scene, scene, scene.resolved())
    level = Variant(parsed(tables, False, 1.0), SPACING, 1.0, "", corners)
    own = run_of(level, 0.5).history | {"step": np.arange(101.0)}
    scene.__dict__["end_time"] = 1.0
    table = error_table(scene, own, [run_of(one, 0.5) for one in found], corners)
    assert set(table.bars) == {"third.temperature"}
    assert np.allclose(table.values["third.temperature"], field(PLACE, 0.5), rtol=1e-12)
    bar = table.bars["third.temperature"]
    assert set(bar.parts) == {"spacing"} and bar.order == pytest.approx(2.0, abs=0.02)
    assert bar.error[-1] == pytest.approx(SAFETY * 0.5, rel=0.02)
