"""Pictures of forces against displacements, and of what contact and supports write to a history."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from parsolid.commands.plot.curves import pairs, write_forces

TOLD = {"kind": "velocity", "where": "top", "name": "pull", "reaction": True}
MOVED = {"name": "grip", "where": "top", "fields": ["stress", "displacement"]}
COLUMNS = ["time", "grip.displacement_x", "grip.displacement_y", "pull.force_x", "pull.force_y", "pull.moment"]


@pytest.mark.parametrize(
    ("boundary", "probe", "found"),
    [
        (TOLD, MOVED, ["x", "y"]),
        (TOLD | {"reaction": False}, MOVED, []),
        (TOLD, MOVED | {"where": "foot"}, []),
        (TOLD, MOVED | {"fields": ["stress"]}, []),
    ],
)
def test_a_force_goes_with_the_displacement_of_its_region(boundary, probe, found, tmp_path):
    tables = {"boundaries": [{"kind": "fixed", "plane": "Y = 0"}, boundary], "probes": [probe]}
    wanted = {"pull": [(f"grip.displacement_{a}", f"pull.force_{a}") for a in found]} if found else {}
    assert pairs(tables, COLUMNS) == wanted
    history = {name: np.linspace(0.0, 1.0, 5) for name in COLUMNS}
    results = SimpleNamespace(columns=history, scene=tables, title="pulled", dimension=2, per=lambda name: "/m")
    assert write_forces(results, tmp_path / "forces.png") == bool(found) == (tmp_path / "forces.png").is_file()
