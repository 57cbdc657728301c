"""Columns of the history, known before a run: of comparisons, targets and `pareto --column`."""

import pytest
from solids import tables

from parsolid.campaign.targets import columns_of
from parsolid.scene import parse_scene
from parsolid.simulation.history import HistoryOutput, history_columns
from parsolid.simulation.loop import Simulation


@pytest.mark.parametrize("sides", [(3, 3), (3, 3, 3)])
def test_a_run_has_the_columns_that_its_scene_foretells(comm, sides):
    plane = {"point": [0.0] * len(sides), "normal": [0.0, 1.0, 0.0][: len(sides)]}
    data = tables(
        sides,
        boundaries=[{"kind": "fixed", "plane": "X = 0", "name": "clamp", "mirror": False, "reaction": True}],
        tools=[{"name": "plate", "shape": {"plane": plane}}],
        probes=[{"name": "end", "at": [1.0] * len(sides), "fields": ["displacement", "stress"]}],
    )
    scene = parse_scene(data)
    columns = HistoryOutput(Simulation(comm, scene)).columns
    assert columns == history_columns(scene)
    # every result can have a bar
    assert set(columns) - set(columns_of(scene)) == {"step", "time", "dt", "energy_error"}
    assert {"clamp.work", "plate.force_y"} <= set(columns_of(scene))
