"""Bad input is refused by its key with a code, all of it at once, with exit status 2, and nothing is written."""

import tomllib
from pathlib import Path

import pytest
import tomli_w
from contact.meeting import bars
from contact.meeting import block as cell
from contact.meeting import tables as touching
from materials.test_fibres import scene as tissue
from materials.test_flow_in_methods import POWDER, swinging
from materials.test_isochoric_laws import scene as solid
from mixed.bodies_apart import tables as apart
from mixed.test_methods_meet import bars as gridded
from mixed.test_subcycling import tables as substepped
from mixed.tied_blocks import blocks
from mpm.points import COPPER, SOFT, scene
from mpm.test_failed_points import torn
from mpm.test_heat_laws import block
from scene.plain_tables import CUBE, SQUARE
from scene.test_bond import tables as bonded
from scene.test_mpm import SQUARE as POINTS
from scene.test_peridynamics import plate
from small_scenes import changed
from solids import COPPER as METAL
from solids import punch, tables
from tlsph.test_implicit import spinning
from tlsph.test_plastic_flow import method_of
from tlsph.test_stages import there_and_back
from tlsph.test_static import box
from tlsph.test_static_tools import press, pressed
from tools.tool_scenes import block as tooled
from tools.tool_scenes import floor
from ulsph.test_elastic_plastic import scene as flow

from parsolid.commands.cli import main
from parsolid.scene import SceneError, packaged_scene, parse_scene

HELD = [{"kind": "fixed", "where": "a"}]
SCENES = {
    "cube": CUBE,
    "square": SQUARE,
    "regions": SQUARE | {"regions": [{"name": "a", "plane": "X = 0"}], "boundaries": HELD},
    "bars": bars(),
    "two methods": apart(("soft", "metal")),
    "points": POINTS | {"method": POINTS["method"] | {"geometry": "axisymmetric"}},
    "torn": torn(),
    "soft points": changed(scene([0.0, 0.0], [0.4, 0.3], 0.05, 0.1, material=SOFT), {"method.viscosity": None}),
    "warm": block(COPPER),
    "tied": blocks("sph", "bonds"),
    "grids": gridded("points", "points", contact=[{"bodies": ["a", "b"], "model": "grid"}]),
    "substeps": substepped(None),
    "plate": plate(),
    "punch": punch(),
    "nodes": tables([9, 9], method={"integrator": "leapfrog", "weights": "cells"}),
    "implicit": spinning(),
    "stages": there_and_back(),
    "static": box((1.0, 1.0), "cells"),
    "dies": pressed([press(1.0, "0")]),
    "flowing": tables((4, 4), material=METAL, method={"integrator": "leapfrog"}),
    "flowing bonds": tables((4, 4), material=METAL, method=method_of("bonds")),
    "tissue": tissue(),
    "solid": solid({"kind": "yeoh", "c1": 0.17e6, "bulk_modulus": 2e7}),
    "soil": swinging("mpm", POWDER),
    "bonded": bonded(0.0, 1.0, 2.0, bond=[{"bodies": "all"}]),
    "flow": flow((6, 6), [3e-3, 3e-3]),
    "tool": tooled("tlsph") | {"tools": [floor()]},
    "lone": touching(cell("alone", (0.0, 0.0), (1.0, 1.0), (4, 4), "cells"), contact=[]),
}
# files that are there, of another kind, and of reference series
TEXT = Path(__file__).with_name("refused.toml").read_text().replace("HERE", __file__)
SERIES = str(packaged_scene().with_name("column_b1.json"))
ROWS = [(name, row) for name, rows in tomllib.loads(TEXT.replace("SERIES", SERIES)).items() for row in rows]


def faulty(name: str, row: dict) -> dict:
    return changed(SCENES[name], row.get("set", {}) | dict.fromkeys(row.get("remove", ())))


@pytest.mark.parametrize("name, row", ROWS, ids=[f"{name}: {row['told']}" for name, row in ROWS])
def test_a_fault_is_told_by_its_key(name, row):
    data = faulty(name, row)
    with pytest.raises(SceneError) as caught:
        parse_scene(data)
    told = {tuple(words.split()[:2]): words.split()[2:] for words in row["told"].split("; ")}
    assert {(fault.key, fault.code) for fault in caught.value.faults} == told.keys()
    for fault in caught.value.faults:
        assert all(repr(word) in fault.suggestion + fault.expected for word in told[fault.key, fault.code])


@pytest.mark.parametrize("name", SCENES)
def test_the_command_tells_the_faults_and_writes_nothing(name, tmp_path, capfd):
    """Of the first and the last fault of each scene."""
    rows = [row for other, row in ROWS if other == name]
    for row in (rows[0], rows[-1]):
        (tmp_path / "scene.toml").write_text(tomli_w.dumps(faulty(name, row)))
        assert main(["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "out")]) == 2
        said = capfd.readouterr().err
        assert all(words.split()[0] in said for words in row["told"].split("; "))
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", SCENES)
def test_the_scenes_are_sound_without_a_change(name):
    parse_scene(SCENES[name])
