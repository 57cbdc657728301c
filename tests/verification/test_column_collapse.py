"""Run-out of columns of sand in plane strain: 1.2 times the height beyond the first foot (Lube et al., Phys. Rev. E 72
(2005) 041301; Lajeunesse et al., Phys. Fluids 17 (2005) 103302)."""

from pathlib import Path

import pytest

from parsolid.commands.cli import main
from parsolid.output.history import read_history

RUNS = Path(__file__).parents[2] / "runs"


@pytest.mark.serial
@pytest.mark.slow
@pytest.mark.parametrize("height", [0.1, pytest.param(0.05, marks=pytest.mark.long)])
def test_a_column_of_sand_runs_out_as_far_as_measured(height, shared_path):
    """Ratios of height to width of 1 and 1/2, 40 particles in the height; the front to a tenth of the run-out."""
    words = [
        word
        for one in (
            "output.pictures=false",
            f"bodies.0.shape.box.upper=[0.1, {height}]",
            f"end_time={1.6 * height**0.5}",
            "output.fields_times=[0]",
            f"bodies.0.spacing={height / 40}",
            f"method.cell={height / 20}",
        )
        for word in ("--set", one)
    ]
    scene = RUNS / "mpm" / "column_collapse.toml"
    assert main(["run", str(scene), "-o", str(shared_path / "run"), "--quiet", *words]) == 0
    reach = read_history(shared_path / "run" / "history.csv")["reach.upper_bounds_x"]
    assert (reach[-1] - 0.1) / height == pytest.approx(1.2, rel=0.1)
    # it is at rest
    assert reach[-1] - reach[int(0.9 * len(reach))] < 0.05 * (reach[-1] - 0.1)
