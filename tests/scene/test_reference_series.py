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


K = "reference.columns.kinetic"
# data of a file and the key that is told
DAMAGED = [
    ("{", "reference.series"),
    ("[" * 5000, "reference.series"),
    ({"E0": 1.0, "series": {}}, "reference.series"),
    (SOUND | {"t": [0.0, 2.0, 1.0]}, "reference.series"),
    (SOUND | {"t": [0.0, 1.0, 1.0]}, "reference.series"),
    (SOUND | {"t": [0.0, 1.0, math.nan]}, "reference.series"),
    (SOUND | {"t": [0.0, "1", 2.0]}, "reference.series"),
    ({"t": [0.0], "E0": 1.0, "series": {"K": [1.0]}}, "reference.series"),
    *((SOUND | {"E0": energy}, "reference.series") for energy in (0.0, "much", math.inf)),
    *((SOUND | {"series": {"K": [1.0, value, 2.0]}}, K) for value in (math.nan, None, 10**400)),
    (SOUND | {"series": {"K": [1.0, 2.0]}}, K),
]


@pytest.mark.parametrize(("data", "key"), DAMAGED)
def test_a_series_that_cannot_be_compared_is_a_fault_of_the_scene(tmp_path, data, key):
    with pytest.raises(SceneError) as caught:
        parse_scene(with_reference(tmp_path, data, {"kinetic": "K"}))
    assert [fault.key for fault in caught.value.faults] == [key]


def test_a_series_of_zeros_has_no_relative_error(tmp_path):
    zeros = SOUND | {"series": SOUND["series"] | {"x": [0.0, 0.0, 0.0], "K": [0.0, 0.0, 0.0]}}
    with pytest.raises(SceneError, match="columns.p.displacement_x"):
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
