"""The thin plate of Lee et al., section 7.4.1: momentum, and the checkerboard that numerical dissipation prevents."""

from pathlib import Path

import pytest
from checkerboard import checkerboard_of_run

from parsolid.commands.cli import main

SCENE = Path(__file__).parents[2] / "runs" / "tlsph" / "thin_plate.toml"
THIN = (
    "bodies.0.shape.box.lower=[0,0,-0.025]",
    "bodies.0.shape.box.upper=[10,10,0.025]",
    "bodies.0.material.branches=[]",
)


def run(directory, *settings):
    arguments = [part for setting in (*settings, "output.pictures=false") for part in ("--set", setting)]
    assert main([str(SCENE), "-o", str(directory), "-q", *arguments]) == 0
    return directory


@pytest.mark.serial
@pytest.mark.slow
def test_without_dissipation_the_pressure_checkerboards(shared_path):
    contents = []
    for dissipation in (0, 1):
        settings = ("bodies.0.particles=[17,17,3]", f"method.dissipation={dissipation}", *THIN)
        folder = run(shared_path / f"plate-{dissipation}", *settings)
        contents.append(dict(checkerboard_of_run(folder)))
    without, with_it = contents
    # at 6 s, 17 x 17 x 3: 0.0363 and 0.0100
    assert without[6.0] > 0.03 and with_it[6.0] < 0.013
    assert without[5.5] > 3.0 * with_it[5.5]
