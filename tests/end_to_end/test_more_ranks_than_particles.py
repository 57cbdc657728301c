"""Ranks without a particle: every method runs a body of four particles on five ranks as on one."""

import numpy as np
import pytest
from command_line import all_done, many
from run_results import history

RUBBER = 'kind = "neo-hookean", density = 1000, youngs_modulus = 1e6, poissons_ratio = 0.3'
METAL = (
    'kind = "elastic-plastic", density = 1000, youngs_modulus = 1e6, poissons_ratio = 0.3, specific_heat = 1000, '
    'flow_stress = { kind = "linear-hardening", yield_stress = 1e5 }'
)
METHODS = {
    "tlsph": ('kind = "tlsph"', RUBBER),
    "peridynamics": ('kind = "peridynamics"\nhorizon_ratio = 1.5\nplane = "strain"', RUBBER),
    "ulsph": ('kind = "ulsph"', METAL),
    "mpm": ('kind = "mpm"\ncell = 0.5', METAL),
}
SCENE = """
dimension = 2
end_time = 1e-2

[method]
{method}

[[bodies]]
shape = {{ box = {{ lower = [0, 0], upper = [1, 1] }} }}
particles = [2, 2]
placement = "cells"
velocity = ["-X", "0"]
material = {{ {material} }}

[output]
pictures = false
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The folder of the runs of all methods on one rank and on five."""
    folder = tmp_path_factory.mktemp("few")
    for method, (words, material) in METHODS.items():
        (folder / f"{method}.toml").write_text(SCENE.format(method=words, material=material))
    for ranks in (1, 5):
        commands = [["run", folder / f"{method}.toml", "-o", folder / f"{method}-{ranks}"] for method in METHODS]
        all_done(many(commands, ranks, folder / f"jobs{ranks}"))
    return folder


@pytest.mark.parametrize("method", METHODS)
def test_five_ranks_run_four_particles_as_one_does(method, runs):
    one, five = (history(runs / f"{method}-{ranks}") for ranks in (1, 5))
    assert one["kinetic"][0] == pytest.approx(156.25)
    for name, values in one.items():
        np.testing.assert_allclose(five[name], values, rtol=0.0, atol=1e-9 * np.abs(values).max(), err_msg=name)
