"""A reference series is looked at before a run, not after it."""

import json
import math

import pytest
from plain_tables import SQUARE

from parsolid.scene import SceneError, parse_scene
from parsolid.simulation.reference import series_errors

SOUND = {"t": [0.0, 1.0, 2.0], "E0": 5.0, "series": {"K": [1.0, 2.0, 3.0], "x": [0.0, 0.0, 1.0]}}
PROBE = {"name": "p", "at": [0.0, 0.0], "fields": ["displacement"]}


def with_reference(folder, data, columns) -> dict:
    text = data if isinstance(data, str) else json.dumps(data)
    (folder / "reference.json").write_text(text)
    return SQUARE | {"probes": [PROBE], "reference": {"series": str(folder / "reference.json"), "columns": columns}}


DAMAGED = {
    "no JSON": ("{", "JSON with t, E0 and a table series"),
    "nested": ("[" * 5000, "JSON with t, E0 and a table series"),
    "no times": ({"E0": 1.0, "series": {}}, "JSON with t, E0 and a table series"),
    "times that fall": (SOUND | {"t": [0.0, 2.0, 1.0]}, "t of at least two finite numbers that rise"),
    "a time twice": (SOUND | {"t": [0.0, 1.0, 1.0]}, "t of at least two finite numbers that rise"),
    "a time that is none": (SOUND | {"t": [0.0, 1.0, math.nan]}, "t of at least two finite numbers that rise"),
    "a time in words": (SOUND | {"t": [0.0, "1", 2.0]}, "t of at least two finite numbers that rise"),
    "one time": ({"t": [0.0], "E0": 1.0, "series": {"K": [1.0]}}, "t of at least two finite numbers that rise"),
    "no energy": (SOUND | {"E0": 0.0}, "E0 > 0"),
    "energy in words": (SOUND | {"E0": "much"}, "E0 > 0"),
    "energy not finite": (SOUND | {"E0": math.inf}, "E0 > 0"),
    "value that is none": (
        SOUND | {"series": {"K": [1.0, math.nan, 2.0]}},
        "columns.kinetic: expected a series of fin",
    ),
    "value of nothing": (SOUND | {"series": {"K": [1.0, None, 2.0]}}, "columns.kinetic: expected a series of finite"),
    "value too large": (SOUND | {"series": {"K": [1.0, 10**400, 2.0]}}, "columns.kinetic: expected a series of fin"),
    "another length": (SOUND | {"series": {"K": [1.0, 2.0]}}, "columns.kinetic: expected one of"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_series_that_cannot_be_compared_is_a_fault_of_the_scene(tmp_path, name):
    data, words = DAMAGED[name]
    with pytest.raises(SceneError, match=f"reference.*{words}"):
        parse_scene(with_reference(tmp_path, data, {"kinetic": "K"}))


def test_a_series_of_zeros_has_no_relative_error(tmp_path):
    zeros = SOUND | {"series": SOUND["series"] | {"x": [0.0, 0.0, 0.0], "K": [0.0, 0.0, 0.0]}}
    with pytest.raises(SceneError, match="columns.p.displacement_x: expected a series that is not zero throughout"):
        parse_scene(with_reference(tmp_path, zeros, {"p.displacement_x": "x"}))
    # energies are compared with E0
    parse_scene(with_reference(tmp_path, zeros, {"kinetic": "K"}))
    parse_scene(with_reference(tmp_path, SOUND, {"kinetic": "K", "p.displacement_x": "x"}))


def test_a_run_that_ends_before_the_reference_begins_has_no_error(tmp_path):
    (tmp_path / "r.json").write_text(json.dumps(SOUND | {"t": [1.0, 2.0, 3.0]}))
    rows = [{"time": 0.0, "kinetic": 1.0}, {"time": 0.5, "kinetic": 1.0}]
    assert series_errors(rows, str(tmp_path / "r.json"), {"kinetic": "K"}) == {}
    rows.append({"time": 1.0, "kinetic": 2.0})
    assert series_errors(rows, str(tmp_path / "r.json"), {"kinetic": "K"}) == {"kinetic": pytest.approx(0.2)}
