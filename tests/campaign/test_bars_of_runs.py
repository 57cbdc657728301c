"""`run --error-bars` and `--target` as a whole, on any number of ranks: bars, restarts in a coarse run, limits."""

import json
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.api.running import RunOptions, run_scene
from parsolid.campaign.error_bars import Campaign, ErrorTable
from parsolid.campaign.estimate import Bar
from parsolid.campaign.in_process import InProcess, Interrupted, VariantRun
from parsolid.campaign.records import Record, read_files
from parsolid.campaign.targets import Target, no_bar, predicted_seconds, worst
from parsolid.campaign.variants import SPACING, Variant, coarse_variants
from parsolid.commands.cli import parse
from parsolid.commands.run import options_of
from parsolid.exit_status import NOT_REACHED
from parsolid.output.results import load
from parsolid.scene import SceneError, load_scene, parse_scene
from parsolid.simulation.loop import Limits

SCENE = Path(__file__).parents[2] / "runs" / "tlsph" / "tensile_smooth.toml"
SMALL = ["bodies.0.particles=[17, 17]", "end_time=0.0008", "output.pictures=false", "output.fields_times=[]"]
COLUMNS = {"kinetic": "K", "strain_energy": "W", "material_dissipation": "Dint", "corner.displacement_y": "uy_11"}


def run(comm, folder, *options, more=()):
    words = options_of(parse(["run", str(SCENE), "-q", *options]))
    return run_scene(comm, load_scene(SCENE, [*SMALL, *more]), folder, words, 0.0)


def test_bars_hold_the_true_errors_and_are_the_same_on_any_ranks(comm, shared_path, capsys):
    from scipy.interpolate import CubicSpline

    assert run(comm, shared_path / "all", "--error-bars") == 0
    comm.barrier()
    if comm.rank == 0:
        folder = shared_path / "all"
        told = json.loads((folder / "summary.json").read_text())["error_bars"]
        results = load(folder)
        data = json.loads((SCENE.parent / "reference" / "tensile_smooth_b3.json").read_text())
        times, inside = results.columns["time"], []
        for column, name in COLUMNS.items():
            true = np.abs(results.columns[column] - CubicSpline(data["t"], data["series"][name])(times))
            inside.append(np.mean(true <= results.errors[column] + 1e-9))
            assert np.median(results.errors[column][5:] / np.maximum(true[5:], 1e-12)) < 8.0
        assert np.mean(inside) > 0.95, inside
        assert [one["for"] for one in told["coarse_runs"]] == ["spacing", "spacing"]
        kinetic = told["columns"]["kinetic"]
        assert kinetic["order"] > 1.0 and set(kinetic["parts"]) == {"spacing", "dissipation"}
    if comm.size > 1:
        # the same on one rank
        status = run(MPI.COMM_SELF, shared_path / f"alone-{comm.rank}", "--error-bars") if comm.rank == 0 else 0
        if comm.rank == 0:
            mine, alone = (load(shared_path / name).errors for name in ("all", "alone-0"))
            assert status == 0 and mine.keys() == alone.keys()
            for name, values in mine.items():
                assert np.allclose(values, alone[name], rtol=1e-6, atol=1e-9 * np.abs(values).max())
        comm.barrier()


def test_a_coarse_run_that_was_stopped_goes_on_with_the_same_bits(comm, shared_path):
    found, _ = coarse_variants(load_scene(SCENE, SMALL), False)
    with pytest.raises(Interrupted):
        InProcess(comm, shared_path / "stopped", Limits(steps=7)).run(found[0])
    runs, again = ([InProcess(comm, shared_path / name).run(one) for one in found[:2]] for name in ("stopped", "whole"))
    assert [one.record.steps for one in runs] == [one.record.steps for one in again]
    if comm.rank == 0:
        for one, other in zip(runs, again):
            assert all(np.array_equal(one.history[name], other.history[name]) for name in other.history)
    begun = []
    for one in found[:2]:
        InProcess(comm, shared_path / "whole").run(one, on_start=lambda: begun.append(1))
    assert not begun


def test_coarse_runs_that_cannot_be_set_up_or_fail_are_told_and_left_out(comm, shared_path):
    told = []
    campaign = Campaign(comm, shared_path, False, Limits(), told.append, None)
    good, other = coarse_variants(load_scene(SCENE, SMALL), False)[0]
    tables = other.scene.resolved()
    del tables["method"]["cfl"]
    tables["method"] |= {"weights": "fourth-order", "integrator": "leapfrog"}
    tables["bodies"][0]["particles"] = [3, 3]
    bad = Variant(parse_scene(tables), SPACING, other.ratio)
    runs = campaign.run_variants([good, bad], shared_path)
    assert [one.record.status for one in runs] == ["finished", "refused"]
    assert not runs[1].history and runs[1].record.message and sum(runs[1].record.message in line for line in told) == 1


def test_a_target_is_reached_or_the_limit_is_told(comm, shared_path, capsys):
    scene = load_scene(SCENE, SMALL)
    first = RunOptions(target=["corner.displacement_y=15%"])
    assert run_scene(comm, scene, shared_path / "t", first, 0.0) == 0
    said = capsys.readouterr().out
    second = RunOptions(target=["kinetic=1e-9%"], core_seconds=1e-6)
    assert run_scene(comm, scene, shared_path / "t", second, 0.0) == NOT_REACHED == 4
    limited = capsys.readouterr().out
    if comm.rank == 0:
        # what is there is not run again
        assert "coarse run 1 of 2" in said and "coarse run" not in limited
        levels = sorted((shared_path / "t" / "levels").iterdir())
        assert all(len(read_files(level)[1]["time"]) > 2 for level in levels)


def test_a_column_without_a_bar_is_told():
    """One that has a NaN has none at all."""
    values = {"tip.u_x": np.array([0.0, np.nan]), "kinetic": np.array([0.0, 1.0])}
    table = ErrorTable(np.arange(2.0), values, {"kinetic": Bar(np.array([0.0, 0.1]), 2.0, 2.0, 1.25, "order 2.0")})
    wanted = [Target("kinetic", 0.2, True), Target("tip.u_x", 0.2, True)]
    assert worst(table, wanted) is None and no_bar(table, wanted).startswith("tip.u_x=20%")
    assert worst(table, wanted[:1]) == pytest.approx((0.5, 2.0))


def test_a_target_is_a_share_or_a_size():
    assert Target.parse("kinetic=2%", ["kinetic"]) == Target("kinetic", 0.02, True)
    assert Target.parse(" kinetic = 0.5 ", ["kinetic"]) == Target("kinetic", 0.5, False)
    assert str(Target.parse("kinetic=0.25%", ["kinetic"])) == "kinetic=0.25%"
    for text in ("kinetic", "kinetic=two%", "kinetic=-1", "tip.twist=2%", "kinetic 2 %"):
        with pytest.raises(SceneError):
            Target.parse(text, ["kinetic", "strain_energy"])


def run_of(particles, steps, seconds, ratio):
    """A variant that has been run, as far as its cost goes."""
    summary = {"particles": particles, "steps": steps}
    return VariantRun(Variant(None, SPACING, ratio), Record("finished", {}, summary, [], [seconds]))


def test_times_of_runs_are_foretold_from_a_time_a_step_and_one_a_particle():
    """Particles in a plane grow with the square of the resolution, steps as they did."""
    runs = [run_of(n * n, 10 * n, 10 * n * (2e-4 + 1e-6 * n * n), 40.0 / n) for n in (10, 20, 40)]
    assert predicted_seconds(runs, 0.5, 2) == pytest.approx(800 * (2e-4 + 6400e-6))
    assert predicted_seconds(runs[:1], 2.0, 2) == pytest.approx(2 * 4 * runs[0].seconds)
