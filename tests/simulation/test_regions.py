"""What is watched, set at the start and written of a region with a name, on any number of ranks."""

import h5py
import numpy as np
import pytest
from solids import SOFT, run_into, simulation, tables

from parsolid.observables.declared import Observables
from parsolid.output.run_folder import RunFolder
from parsolid.scene import parse_scene
from parsolid.simulation.field_output import FieldOutput
from parsolid.simulation.history import Probes
from parsolid.simulation.restart import Restart

STRIP = {"name": "strip", "formula": "Y > 0.7"}


def thrown(**more) -> dict:
    """A square whose upper part is given a velocity."""
    data = tables((6, 6), material=SOFT, regions=[STRIP], **more)
    data["bodies"][0] |= {"velocity": [1.0, 0.0]}
    data["initial"] = [{"where": "strip", "velocity": ["2*X", "-Y"]}]
    return data


def test_probes_of_a_region(comm):
    data = thrown()
    data["regions"].append({"name": "low", "none_of": ["strip"]})
    data["probes"] = [
        {"name": name, "where": "strip", "statistic": name, "fields": ["velocity"]}
        for name in ("mean", "minimum", "maximum", "integral")
    ]
    data["probes"] += [{"name": "p", "where": "strip", "quantity": "linear_momentum"}]
    data["probes"] += [{"name": "rest", "where": "low", "fields": ["velocity"]}]
    sim = simulation(data, comm)
    probes = Probes(comm, sim.scene, Observables(sim.systems))
    found = dict(zip(probes.columns, probes.sample()))
    # nodes at Y = 0.8 and 1, 0.2 apart, of which the outer ones have half a cell
    X = np.linspace(0.0, 1.0, 6)
    along, up = np.array([0.5, 1, 1, 1, 1, 0.5]) * 0.2, {0.8: 0.2, 1.0: 0.1}
    volume = sum(up.values())
    mean = [2 * along @ X, -(0.8 * 0.2 + 1.0 * 0.1) / volume]
    np.testing.assert_allclose([found["mean.velocity_x"], found["mean.velocity_y"]], mean, rtol=1e-12)
    assert [found[f"minimum.velocity_{axis}"] for axis in "xy"] == [0.0, -1.0]
    assert [found[f"maximum.velocity_{axis}"] for axis in "xy"] == [2.0, pytest.approx(-0.8)]
    integral = np.array([found["integral.velocity_x"], found["integral.velocity_y"]])
    np.testing.assert_allclose(integral, volume * np.array(mean), rtol=1e-12)
    density = SOFT["density"]
    np.testing.assert_allclose(found["p.linear_momentum_y"], density * integral[1], rtol=1e-12)
    assert [found["rest.velocity_x"], found["rest.velocity_y"]] == [pytest.approx(1.0), 0.0]


def test_fields_of_a_region_are_written_in_the_order_of_its_particles(shared_path, comm):
    data = thrown(output={"where": "strip", "fields": ["velocity"]})
    sim = simulation(data, comm)
    folder = RunFolder(comm, shared_path / "out")
    FieldOutput(sim, folder).write(sim)
    folder.close()
    with h5py.File(shared_path / "out" / "fields.vtkhdf") as file:
        count = int(file["VTKHDF/NumberOfPoints"][0])
        points, velocity = file["VTKHDF/Points"][:12], file["VTKHDF/PointData/velocity"][:12]
    X = np.linspace(0.0, 1.0, 6)
    assert count == 12 and (points[:, 1] > 0.7).all()
    assert sorted(map(tuple, points[:, :2].round(12))) == sorted((x.round(12), y) for x in X for y in (0.8, 1.0))
    np.testing.assert_allclose(velocity[:, :2], np.column_stack([2 * points[:, 0], -points[:, 1]]), rtol=1e-6)


def test_who_is_in_a_region_is_kept_over_a_restart(shared_path, comm):
    data = thrown(probes=[{"name": "p", "where": "strip", "fields": ["velocity"]}])
    run_into(shared_path / "first", comm, parse_scene(data), 3)
    restart = Restart(comm, shared_path / "first" / "checkpoint.h5")
    column, again = "p.velocity_x", run_into(shared_path / "next", comm, parse_scene(data), 1, restart)
    whole = run_into(shared_path / "whole", comm, parse_scene(data), 4)
    assert again.history.last_row[column] == pytest.approx(whole.history.last_row[column], rel=1e-12)
