"""Planes that move: images at the present plane, with its velocity, and the work that it does."""

import json

import numpy as np
import pytest
import tomli_w
from solids import COPPER, Record, follow, gathered, simulation
from ulsph.plates import block, scene

from parsolid.commands.cli import main
from parsolid.scene import SceneError, parse_scene

RATE = 2e4
# soft enough in shear that nothing flows
ELASTIC = COPPER | {"flow_stress": {"kind": "linear-hardening", "yield_stress": 1e12, "hardening": 0.0}}
MODULI = {"youngs_modulus": 1e6, "poissons_ratio": 0.3}
SHEARED = [
    {"kind": "fixed", "plane": "Y = 0"},
    {"kind": "fixed", "plane": "Y = 1e-3", "velocity": [str(RATE * 1e-3), "0"]},
    {"kind": "antisymmetric", "plane": "X = 0"},
    {"kind": "antisymmetric", "plane": "X = 0.7e-3"},
]
PRESSED = [
    {"kind": "roller", "plane": "X = 0"},
    {"kind": "roller", "plane": "X = 0.7e-3", "velocity": [str(-RATE * 0.7e-3), "free"]},
    {"kind": "roller", "plane": "Y = 0"},
    {"kind": "roller", "plane": "Y = 1e-3"},
]


def layer(boundaries, velocity, **keys) -> dict:
    """A block of 7 x 10 particles of 0.1 mm."""
    return scene(block((7, 10), [0.7e-3, 1e-3], ELASTIC, velocity=velocity), boundaries=boundaries, **keys)


def test_walls_that_slide_keep_shear_uniform(comm):
    """To a shear of 2 %: S_xy = mu gamma of every particle, beside walls and free sides alike, and the walls' work."""
    sim = simulation(layer(SHEARED, [f"{RATE}*Y", 0.0], end_time=1e-6), comm)
    rows = follow(sim, Record())
    strain = RATE * rows["time"][-1]
    S, v, x = gathered(sim, "deviator", "velocity", "position")
    np.testing.assert_allclose(S[:, 3], 47.7e9 * strain, rtol=0.02)
    assert np.abs(v[:, 0] - RATE * x[:, 1]).max() < 0.02 * RATE * 1e-3
    # the area is .7 mm^2
    assert rows["external_work"][-1] == pytest.approx(0.5 * 47.7e9 * strain**2 * 0.7e-6, rel=0.02)
    assert np.abs(rows["energy_error"]).max() < 1e-3 * rows["external_work"][-1]


def test_a_piston_compresses_uniformly(comm):
    """Exact density of every particle, the piston where it has gone to, its work that which the matter has."""
    sim = simulation(layer(PRESSED, [f"-{RATE}*X", 0.0], end_time=1e-6), comm)
    rows, system = follow(sim, Record()), sim.systems[0]
    stretch = 1.0 - RATE * rows["time"][-1]
    (density,) = gathered(sim, "density")
    assert np.ptp(density) < 1e-6 * density[0]
    np.testing.assert_allclose(density * stretch, 8930.0, rtol=1e-4)
    np.testing.assert_allclose(system.planes.travelled, [-RATE * 0.7e-3 * rows["time"][-1]], rtol=1e-12)
    assert np.abs(rows["energy_error"]).max() < 1e-4 * rows["external_work"][-1]


def test_a_restart_goes_on_from_planes_that_have_moved(shared_path, comm):
    """On as many ranks, through lists that the piston makes anew: the same last row of the history, to the bit."""
    if comm.rank == 0:
        data = layer(PRESSED, [f"-{RATE}*X", f"{0.1 * RATE}*X"], end_time=8e-7, output={"pictures": False})
        data["method"]["skin"] = 0.01
        (shared_path / "scene.toml").write_text(tomli_w.dumps(data))
    comm.barrier()
    whole, parts = shared_path / "whole", shared_path / "parts"
    arguments = ["run", str(shared_path / "scene.toml"), "-q", "--set", "output.history_steps=1"]
    assert main([*arguments, "-o", str(whole)]) == 0
    assert main([*arguments, "-o", str(parts), "--max-steps", "37"]) == 0
    comm.barrier()
    assert main([*arguments, "-o", str(parts), "--restart"]) == 0
    if comm.rank == 0:
        first, second = ((one / "history.csv").read_text().splitlines() for one in (whole, parts))
        assert first[-1] == second[-1] and len(first) == len(second) > 60
        assert json.loads((parts / "summary.json").read_text())["lists_made"] > 3


@pytest.mark.serial
@pytest.mark.parametrize("method", [{"kind": "tlsph"}, {"kind": "mpm", "cell": 0.2e-3}])
def test_planes_of_other_methods_do_not_move(method):
    moving = [{"kind": "fixed", "plane": "X = 0", "velocity": ["1", "0"]}]
    data = layer(moving, ["0", "0"], method=method)
    if method["kind"] != "mpm":
        data["bodies"][0]["material"] = {"kind": "neo-hookean", "density": 1e3} | MODULI
    with pytest.raises(SceneError) as refused:
        parse_scene(data)
    assert "boundaries.0.velocity" in [one.key for one in refused.value.faults]
