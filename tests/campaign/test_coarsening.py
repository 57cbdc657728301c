"""The one rule that makes coarser scenes: same lengths, shapes and masses; what cannot be made is refused."""

from pathlib import Path

import numpy as np
import pytest
from solids import RUBBER

from parsolid.campaign.coarsening import NotCoarsened, coarsen, lattice_words, parsed
from parsolid.campaign.variants import RATIOS, SOLVER, SPACING, STEP, coarse_variants, default_ratios
from parsolid.particles.fillings import filling_of
from parsolid.scene import load_scene, parse_scene

RUNS = Path(__file__).parents[2] / "runs"


def mass_and_bounds(scene):
    fillings = [filling_of(body, scene.dimension) for body in scene.bodies]
    volume = [filling.piece(0, filling.count).volume.sum() for filling in fillings]
    return np.array(volume), np.concatenate([[filling.lower, filling.upper] for filling in fillings])


@pytest.mark.parametrize(
    "name, lattices",
    [
        ("tlsph/column", "6 x 31 x 6"),
        ("ulsph/plate_impact", "44 x 13, 44 x 13"),
        ("peridynamics/vibrating_bar", "666"),
        ("peridynamics/plate_with_hole", "24 x 24"),
        ("mpm/taylor", "20 x 202"),
        ("mixed/bars", "31 x 7, 30 x 6"),
        ("contact/ring", "58 x 3"),
        ("mpm/taylor_quarter", "11 x 11 x 111"),
    ],
)
def test_bodies_keep_shape_and_mass_with_nearly_one_ratio_of_spacings(name, lattices):
    scene = load_scene(RUNS / f"{name}.toml")
    made = coarsen(scene, 1.5 if scene.dimension != 2 else 1.6)
    other = parsed(made.tables, False, made.ratio)
    assert lattice_words(other) == lattices
    # the staircase of a hole is as exact as its cells are small
    exact = 5e-3 if "hole" in name else 1e-12
    for before, now in zip(mass_and_bounds(scene), mass_and_bounds(other)):
        assert np.allclose(before, now, rtol=exact)
    counts = [filling_of(body, scene.dimension).count for one in (scene, other) for body in one.bodies]
    whole = len(scene.bodies)
    assert (sum(counts[:whole]) / sum(counts[whole:])) ** (1 / scene.dimension) == pytest.approx(made.ratio, rel=0.15)


def test_planes_on_the_nodes_of_a_grid_stay_on_nodes_and_what_has_no_such_grid_is_refused():
    scene = load_scene(RUNS / "mpm" / "cosine_mode.toml")
    made = coarsen(scene, 1.6)
    assert made.ratio == 2.0 and made.tables["method"]["cell"] == 0.002
    with pytest.raises(NotCoarsened, match="planes of boundaries on nodes"):
        coarsen(scene, 2.56, 2.5)


def test_geometry_is_meshed_with_larger_elements(tmp_path):
    pytest.importorskip("gmsh")
    (tmp_path / "disc.geo").write_text('SetFactory("OpenCASCADE"); Disk(1) = {0, 0, 0, 2, 2};')
    refine = [{"where": "edge-1", "size": 0.1}]
    body = {"shape": {"file": "disc.geo", "size": 0.3, "refine": refine}, "material": RUBBER}
    box = {"box": {"lower": [3, 0], "upper": [4, 1]}}
    bodies = [body, {"shape": box, "particles": [9, 9], "placement": "vertices", "material": RUBBER}]
    tables = {"dimension": 2, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": bodies}
    scene = parse_scene(tables, tmp_path)
    made = coarsen(scene, 2.0)
    mesh = made.tables["bodies"][0]["shape"]["mesh"]
    assert made.ratio == 2.0 and (mesh["size"], mesh["size_factor"]) == (0.3, 2.0)
    other = parsed(made.tables, False, 2.0)
    assert lattice_words(other) == "5 x 5, elements of 0.6 m"
    spacings = [filling_of(one.bodies[0], 2).rows["spacing"] for one in (scene, other)]
    assert np.median(spacings[1]) == pytest.approx(2.0 * np.median(spacings[0]), rel=0.2)
    # bodies from geometry alone can have any ratio
    alone = parse_scene(tables | {"bodies": [body]}, tmp_path)
    found, refused = coarse_variants(alone, False)
    assert [one.ratio for one in found] == [2.25, 1.5] and not refused
    assert len({one.digest for one in found}) == 2


def test_what_cannot_be_coarser_is_refused_with_the_reason():
    found, refused = coarse_variants(load_scene(RUNS / "tlsph" / "thin_plate.toml"), False)
    assert not found and refused and all("2 particles along its direction 3" in one for one in refused)


def test_variants_are_coarser_ones_one_of_half_the_step_and_one_of_a_looser_solver():
    scene = load_scene(RUNS / "peridynamics" / "creep_bar.toml")
    found, refused = coarse_variants(scene, False)
    assert not refused and [one.purpose for one in found] == [SPACING, STEP, SOLVER, SPACING]
    coarse, half, loose, near = (one.scene.method.solution for one in found)
    assert half.step == 0.5 * coarse.step and loose.tolerance == 100 * coarse.tolerance == 100 * near.tolerance
    assert len({one.digest for one in found}) == 4


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
    assert default_ratios(scene) == RATIOS[scene.dimension][place]
    if ratios:
        assert [one.ratio for one in coarse_variants(scene, False)[0]] == pytest.approx(ratios, rel=0.05)
