"""`pareto`: which options a scene has, which are dropped, what is on the envelope, and what is refused."""

import argparse
import csv
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.campaign.in_process import VariantRun
from parsolid.campaign.options import Option, options_of
from parsolid.campaign.pareto import Configuration, SuccessiveHalving, envelope, plan_of, seconds_for, time_to
from parsolid.campaign.records import Record
from parsolid.campaign.reference import observed_reference, series_of
from parsolid.campaign.variants import SPACING, Variant
from parsolid.commands.pareto import add_arguments, run_pareto
from parsolid.scene import SceneError, load_scene

RUNS = Path(__file__).parents[2] / "runs"
SCENE = RUNS / "tlsph" / "tensile_smooth.toml"
SMALL = ("bodies.0.particles=[9, 9]", "end_time=0.0002")


def options(folder, *words, column="strain_energy"):
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    sets = [word for one in SMALL for word in ("--set", one)]
    return parser.parse_args([str(SCENE), "--column", column, "-o", str(folder), *sets, *words])


def names(plan):
    return {one.option.name for one in plan.configurations}


def test_a_scene_has_the_choices_that_its_laws_and_boundaries_allow():
    plan = plan_of(load_scene(SCENE), "strain_energy", [], False)
    expected = {"as the scene", "integrator leapfrog", "h/dx 1", "method peridynamics", "method mpm"}
    assert expected | {"method ulsph"} <= names(plan)
    taylor = plan_of(load_scene(RUNS / "ulsph" / "taylor.toml"), "kinetic", ["method", "dissipation"], False)
    assert names(taylor) == {"as the scene", "dissipation off", "dissipation linear 1 quadratic 1", "method mpm"}
    grid = taylor.variant(Option((("method", "kind", "mpm"),)), 0).scene
    assert grid.method.cell == pytest.approx(2 * 0.5 * (25.4e-3 / 26 + 3.81e-3 / 4), rel=0.05)
    axisymmetric = plan_of(load_scene(RUNS / "mpm" / "taylor.toml"), "kinetic", ["method"], False)
    assert "method ulsph: method.geometry: expected" in "\n".join(axisymmetric.refused)


def test_changes_that_do_not_go_together_are_refused():
    plan = plan_of(load_scene(SCENE, list(SMALL)), "strain_energy", ["integrator"], False)
    leapfrog = next(option for option in options_of(plan.scene, ["integrator"]))
    assert plan.add(Option((*leapfrog.changes, ("step", "cfl", 0.5)))) is None
    assert "method.cfl: expected" in plan.refused[-1]
    assert plan.add(Option((("kernel", "kernel", "wendland-c2"),))) is None and "changes nothing" in plan.refused[-1]


def test_kernels_are_no_choice_where_all_weights_are_in_closed_form():
    """Runs with them are the same to the last bit: the least error for its time would be chance's."""
    best = ["method.weights=best", "method.integrator=leapfrog"]
    plan = plan_of(load_scene(SCENE, [*SMALL, *best]), "strain_energy", [], False)
    assert not any(name.startswith(("kernel ", "h/dx ")) for name in names(plan))
    assert "kernel quintic-spline: it changes nothing here" in plan.refused
    assert {"weights kernel", "dissipation 0.3"} <= names(plan)
    together = Option((("weights", "weights", "kernel"), ("kernel", "kernel", "quintic-spline")))
    added = plan.add(together)
    assert added is plan.configurations[-1] and added.option is together


def test_a_run_that_fails_or_costs_too_much_drops_its_option():
    def run(variant):
        message = "it broke" if variant == ("b", 1) else None
        return VariantRun(SimpleNamespace(lattices=variant), Record("", message=message, processor_seconds=[2.0]))

    plan = SimpleNamespace(variant=lambda option, level: (option.name, level), work=lambda level: 4.0**level)
    search = SuccessiveHalving(plan, SimpleNamespace(comm=MPI.COMM_SELF, run=run), 1e3, lambda words: None)
    good, poor, dear = (Configuration(SimpleNamespace(name=name)) for name in "abc")
    plan.configurations = [good, poor, dear]
    for one in (good, poor):
        search.advance(one, 1, "here")
    assert good.dropped is None and [one.variant.lattices for one in good.runs] == [("a", 0), ("a", 1)]
    assert poor.dropped is not None and [one.variant.lattices for one in poor.runs] == [("b", 0)]
    assert search.spent == 6.0
    # the first level is foretold by the scene's own run
    search.budget = 7.9
    search.advance(dear, 1, "here")
    assert dear.dropped is not None and not dear.runs and search.spent == 6.0


def made(option, levels, column="q"):
    """A configuration of runs with (ratio, seconds, error) each; its column swings with that error."""
    scene = SimpleNamespace(systems=[], end_time=1.0)
    time = np.linspace(0.0, 1.0, 101)
    one = Configuration(option)
    for ratio, seconds, error in levels:
        record = Record(
            "finished", {"time": time, column: (1.0 + error) * np.sin(3.0 * time)}, {}, [seconds], [seconds]
        )
        one.runs.append(VariantRun(Variant(scene, SPACING, ratio), record))
        one.errors.append(error)
    return one


def test_the_envelope_has_what_nothing_else_beats_and_times_follow_power_laws():
    good = made(Option(), [(4.0, 1.0, 0.16), (2.0, 8.0, 0.04), (1.0, 64.0, 0.01)])
    poor = made(Option((("a", "a", 1),)), [(4.0, 0.5, 0.4), (2.0, 9.0, 0.05)])
    found = envelope(SimpleNamespace(configurations=[good, poor]))
    assert [(seconds, error) for seconds, error, *_ in found] == [(0.5, 0.4), (1.0, 0.16), (8.0, 0.04), (64.0, 0.01)]
    assert found[0][2] is poor and all(point[2] is good for point in found[1:])
    assert time_to(good, 0.0025, 2) == pytest.approx(64.0 * 4.0**1.5) and time_to(good, 0.01, 2) == 64.0
    assert seconds_for(good, 0.02) == pytest.approx(8.0 * 8.0**0.5) and seconds_for(good, 0.5) == 1.0
    assert seconds_for(poor, 0.04) == float("inf")
    stuck = made(Option(), [(2.0, 1.0, 0.1), (1.0, 8.0, 0.1)])
    assert time_to(stuck, 0.05, 2) > 100.0 * 8.0


def test_without_a_reference_the_limit_of_the_best_is_the_reference(monkeypatch):
    monkeypatch.setattr("parsolid.campaign.reference.order_in_spacing", lambda column, scene: 2.0)
    good = made(Option(), [(4.0, 1.0, 0.16), (2.0, 8.0, 0.04), (1.0, 64.0, 0.01)])
    poor = made(Option((("a", "a", 1),)), [(4.0, 0.5, 0.4), (2.0, 9.0, -0.3)])
    families = [(one.option.name, one.runs) for one in (good, poor)]
    found = observed_reference(SimpleNamespace(end_time=1.0), "q", families)
    assert "'as the scene' from 3" in found.words and found.uncertain < 0.03
    assert np.allclose(found.values, np.sin(3.0 * found.times), atol=2e-4)


@pytest.mark.slow
def test_choices_are_run_within_the_budget_kept_and_reported(comm, shared_path, capsys):
    words = ["--axis", "integrator"]
    assert run_pareto(comm, options(shared_path, *words)) == 0
    said = capsys.readouterr().out
    if comm.rank == 0:
        assert "pareto: expected:" in said and "for an error of" in said
        assert said.index("integrator leapfrog") < said.index("pareto: expected:") < said.index("level 1 of")
        with open(shared_path / "pareto.csv") as file:
            rows = list(csv.DictReader(file))
        assert {row["choice"] for row in rows} == {"as the scene", "integrator leapfrog"}
        assert any(row["envelope"] == "1" for row in rows) and (shared_path / "pareto.png").exists()
        assert "true values: the scene's series" in (shared_path / "pareto.md").read_text()
        runs = {path: path.stat().st_mtime_ns for path in shared_path.glob("runs/*/summary.json")}
    # all of it is there; and of a budget that is used up nothing more is run
    assert run_pareto(comm, options(shared_path, *words)) == 0
    if comm.rank == 0:
        assert runs == {path: path.stat().st_mtime_ns for path in shared_path.glob("runs/*/summary.json")}
    assert run_pareto(comm, options(shared_path / "little", *words, "--core-seconds", "1e-9")) == 0
    if comm.rank == 0:
        assert capsys.readouterr().out.count("the budget: about") == 2
        assert len(list(shared_path.glob("little/runs/*/summary.json"))) == 1


@pytest.mark.serial
@pytest.mark.parametrize("words, column", [([], "kinetick"), (["--axis", "basis"], "kinetic")])
def test_what_is_not_there_is_refused(comm, tmp_path, words, column):
    with pytest.raises(SceneError):
        run_pareto(comm, options(tmp_path / "results", *words, column=column))
    assert not (tmp_path / "results").exists()


def test_series_are_those_of_the_scene(tmp_path):
    (tmp_path / "s.json").write_text(json.dumps({"t": [0, 1, 2, 3], "series": {"K": [1, 2, 4, 7], "u": [0, 1, 0, 1]}}))
    reference = SimpleNamespace(series=str(tmp_path / "s.json"), columns={"kinetic": "K"})
    (column, values), *others = series_of(SimpleNamespace(reference=reference)).items()
    assert column == "kinetic" and not others and values(2.0) == pytest.approx(4.0)
    assert series_of(SimpleNamespace(reference=None)) == {}
