"""Bad input is refused by its key with a code, all of it at once, with exit status 2, and nothing is written."""

import tomllib
from pathlib import Path

import pytest
import tomli_w
from contact.meeting import bars
from mixed.bodies_apart import tables as apart
from mixed.test_methods_meet import bars as gridded
from mixed.test_subcycling import tables as substepped
from mixed.tied_blocks import blocks
from mpm.points import COPPER, SOFT, scene
from mpm.test_failed_points import torn
from mpm.test_heat_laws import block
from peridynamics.bonds_of_bodies import scene as bonds
from peridynamics.test_hyperelastic_series import series
from scene.plain_tables import CUBE, SQUARE
from scene.test_mpm import SQUARE as POINTS
from scene.test_peridynamics import plate
from small_scenes import changed

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
    "series": bonds(2, material=series("neo-hookean")),
    "plate": plate(),
}
# files that are there, of another kind, and of reference series
TEXT = Path(__file__).with_name("refused.toml").read_text().replace("HERE", __file__)
SERIES = str(packaged_scene().with_name("column_b1.json"))
ROWS = [(name, row) for name, rows in tomllib.loads(TEXT.replace("SERIES", SERIES)).items() for row in rows]


@pytest.mark.parametrize("name, row", ROWS, ids=[f"{name}: {row['told']}" for name, row in ROWS])
def test_a_fault_is_told_by_its_key_and_nothing_is_written(name, row, tmp_path, capfd):
    data = changed(SCENES[name], row.get("set", {}) | dict.fromkeys(row.get("remove", ())))
    with pytest.raises(SceneError) as caught:
        parse_scene(data)
    told = {tuple(words.split()[:2]): words.split()[2:] for words in row["told"].split("; ")}
    for fault in caught.value.faults:
        # of a choice of types the key has a part for each
        (found,) = (one for one in told if fault.key.startswith(one[0]) and one[1] in (fault.code, "none"))
        assert all(repr(word) in fault.suggestion + fault.expected for word in told[found])
    assert len(caught.value.faults) >= len(told)
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(data))
    assert main(["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "out")]) == 2
    said = capfd.readouterr().err
    assert all(key in said for key, _ in told) and not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", SCENES)
def test_the_scenes_are_sound_without_a_change(name):
    parse_scene(SCENES[name])
