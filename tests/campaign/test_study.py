"""The command `study`: what a study may say, the runs it means, how they are made, kept and judged."""

import argparse
import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import tomli_w
from solids import tables

from parsolid.campaign import subprocess_runs
from parsolid.campaign.cases import cases_of, load_study
from parsolid.campaign.measures import energies_of, momentum_of, not_finite
from parsolid.campaign.records import CRASHED, REFUSED, Record, read_record
from parsolid.campaign.study import error_rows, judge
from parsolid.campaign.subprocess_runs import SubprocessRun, wait
from parsolid.commands.cli import main
from parsolid.commands.study import add_arguments, run_study
from parsolid.scene import SceneError
from parsolid.scene.raw_tables import override_value, toml_value

pytestmark = pytest.mark.serial

SCENE = tomli_w.dumps(
    tables(
        [5, 5],
        material={"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3},
        method={"integrator": "leapfrog"},
        end_time=2e-3,
        title="Block",
        body={"velocity": ["10*X", "0"]},
        probes=[{"name": "total", "quantity": "linear_momentum"}],
        output={"history_steps": 1},
        reference={"series": "series.json", "columns": {"kinetic": "K"}},
    )
)
STUDY = """
title = "Blocks"
[[series]]
name = "block"
scene = "block.toml"
{series}
[[series.axes]]
name = "particles"
settings = [
    {{ label = "5", spacing = 0.25, set = ["bodies.0.particles=[5, 5]"] }},
    {{ label = "9", spacing = 0.125, set = ["bodies.0.particles=[9, 9]"]{setting} }},
]
{more}
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "block.toml").write_text(SCENE)
    (tmp_path / "series.json").write_text(
        json.dumps({"t": [0, 1e-3, 2e-3, 3e-3], "E0": 2e4, "series": {"K": [2e4] * 4}})
    )
    return tmp_path


def write(folder, series="", setting="", more=""):
    path = folder / "study.toml"
    path.write_text(STUDY.format(series=series, setting=setting, more=more))
    return path


def faults(path) -> str:
    with pytest.raises(SceneError) as error:
        cases_of(load_study(path))
    return str(error.value)


def options(path, *words):
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args([str(path), "-o", str(path.parent / "results"), *words])


def test_a_study_tells_all_its_faults_at_once(folder):
    text = faults(write(folder, series='scene_file = "x"\ncombine = "both"\nranks = 0', setting=', expect = "fine"'))
    keys = ("series.0.scene_file", "series.0.combine", "series.0.ranks", "series.0.axes.0.settings.1.expect")
    assert all(f"{key}: expected" in text for key in keys)


@pytest.mark.parametrize(
    ("stated", "told"),
    [
        ({"more": "[[series.axes]]\nkey = 'method.cfl'"}, "series.0.axes.1: "),
        ({"more": "[[series.axes]]\nname = 'x'"}, "series.0.axes.1: "),
        ({"more": "[[series.axes]]\nranks = [2, 2]"}, "series.0.axes.1.ranks.1: "),
        ({"more": "[[series]]\nname = 'block'\nscene = 'block.toml'"}, "series.1.name: "),
        ({"more": "[[series]]\nname = 'b'\nscene = 'no.toml'"}, "series.1.scene: "),
        ({"more": "[[series.axes]]\nranks = [1, 2, 3]", "series": "combine = 'zip'"}, "[2, 3]"),
        ({"series": "bounds = { kinetick = 1.0 }"}, "'kinetic'"),
        ({"series": "orders = { steps = 1 }"}, "orders: "),
        # of a scene, with the run
        ({"more": "[[series.axes]]\nkey = 'method.cfl'\nvalues = [0.5, -1]"}, "block, 5, -1: method.cfl: "),
        # two runs that are the same
        (
            {"more": "[[series]]\nname = 'again'\nscene = 'block.toml'\nset = ['bodies.0.particles=[9, 9]']"},
            "block, 9",
        ),
    ],
)
def test_a_fault_names_its_key(folder, stated, told):
    assert told in faults(write(folder, **stated))


@pytest.mark.parametrize(
    "value", [1, 0.5, 1e-12, True, 'a "b" \\c', [1, [2.5, "x"]], [{"beta": 1.0, "a b": "x\ny"}], []]
)
def test_values_stand_behind_set_as_they_are(value):
    assert override_value(toml_value(value)) == value


def test_axes_make_every_combination(folder):
    path = write(folder, series="ranks = 3", more="[[series.axes]]\nkey = 'method.safety'\nvalues = [0.5, 0.7]")
    cases = cases_of(load_study(path))
    assert [case.title for case in cases] == ["block, 5, 0.5", "block, 5, 0.7", "block, 9, 0.5", "block, 9, 0.7"]
    assert [case.ranks for case in cases] == [3] * 4
    assert [case.particles for case in cases] == [25, 25, 81, 81]
    assert cases[3].overrides == ["bodies.0.particles=[9, 9]", "method.safety=0.7"]
    assert cases[0].line == cases[2].line != cases[1].line
    assert len({case.folder_name for case in cases}) == 4
    cases = cases_of(load_study(write(folder, series="combine = 'zip'", more="[[series.axes]]\nranks = [1, 2]")))
    assert [(case.title, case.ranks) for case in cases] == [("block, 5, 1", 1), ("block, 9, 2", 2)]


def test_a_folder_is_named_after_all_that_the_numbers_depend_on(folder, monkeypatch):
    path, found = write(folder), set()
    load = '[loads]\nhistory = { file = "load.csv" }\nacceleration = ["table(\\"table.csv\\", t)", "0"]'
    (folder / "block.toml").write_text(SCENE + load)
    files = [folder / name for name in ("series.json", "load.csv", "table.csv")]
    for file in files[1:]:
        file.write_text("0,1\n1,1\n")

    def tell() -> set[str]:
        return {case.digest for case in cases_of(load_study(path))}

    found |= tell()
    assert found == tell()
    for file in files:
        file.write_text(file.read_text() + (" " if file.suffix == ".json" else "2,2\n"))
        found |= tell()
    monkeypatch.setattr("parsolid.campaign.variants.source_digest", lambda: "other sources")
    assert len(found | tell()) == 10


def with_errors(folder, errors, **study):
    loaded = load_study(write(folder, **study))
    cases = cases_of(loaded)
    for case, error in zip(cases, errors):
        case.record = Record("finished", ending={"clean": True, "not_finite": []})
        case.measures = {"errors": {"kinetic": error}, "processor_seconds": 2.0}
    judge(loaded, cases)
    return cases


def test_orders_are_observed_between_consecutive_spacings(folder):
    coarse, fine = with_errors(folder, [4e-2, 1e-2])
    assert coarse.orders == {}
    assert fine.orders == {"kinetic": pytest.approx(2.0)}


def test_a_run_is_held_to_what_is_stated(folder):
    series = "orders = { kinetic = 1.9 }\nbounds = { kinetic = 3e-2 }\nother_code = { processor_seconds = 1.0 }"
    coarse, fine = with_errors(folder, [4e-2, 2e-2], series=series)
    time = "processor_seconds 2.00 of the other code, at most 1"
    assert coarse.faults == ["kinetic 0.04, at most 0.03", time]
    assert fine.faults == [time, "order of kinetic 1.00, at least 1.9"]


def test_energies_of_a_history_and_numbers_that_are_not_finite(tmp_path):
    columns = {"step": [0, 1, 2], "time": [0, 1, 2], "dt": [0, 0.5, 0.25], "kinetic": [4.0, 2.0, 1.0]}
    columns |= {"strain_energy": [0.0, 1.0, 1.5], "external_work": [0.0] * 3, "energy_error": [0.0, -0.2, 0.1]}
    columns |= {"material_dissipation": [0.0, 1.0, 0.6], "numerical_dissipation": [0.0, 0.2, 0.4]}
    columns |= {"p.linear_momentum_x": [2.0, 2.0, 2.001], "p.linear_momentum_y": [0.0] * 3}
    history = {name: np.array(values, float) for name, values in columns.items()}
    found = energies_of(history)
    assert found["energy_drift"] == pytest.approx(0.05)
    assert found["numerical_dissipation"] == pytest.approx(0.1)
    assert found["largest_fall"] == pytest.approx(0.1)
    assert found["smallest_step"] == 0.25
    assert momentum_of(history)["momentum_drift"] == pytest.approx(0.001 / 2.001)
    # round-off of a momentum that is zero: over what 2 kg with 4 J could have
    history |= {"p.linear_momentum_x": np.array([0.0, 1e-14, -4e-14])}
    assert momentum_of(history, 2.0)["momentum_drift"] == pytest.approx(1e-14)
    (tmp_path / "history.csv").write_text("step,time,kinetic\n0,0,1\n1,1,nan\n")
    assert not_finite(tmp_path) == ["history.csv: kinetic"]


@pytest.mark.slow
def test_a_study_runs_reports_and_goes_on(folder, comm, capsys):
    path = write(
        folder,
        series="bounds = { energy_drift = 1e-2, momentum_drift = 1e-11 }",
        more="[[series]]\nname = 'one'\nscene = 'block.toml'\nexpect = 'refused'\nset = ['bodies.0.particles=[1, 1]']",
    )
    assert run_study(comm, options(path, "--dry-run")) == 0
    assert "3 runs, 3 to do" in capsys.readouterr().out
    with pytest.raises(SceneError):
        run_study(comm, options(path, "--only", "blok"))
    assert run_study(comm, options(path, "--only", "block")) == 0
    results = folder / "results"
    assert "2 of 3 runs made, 2 as stated, 0 not" in " ".join(capsys.readouterr().out.split())
    pictures = {"error_against_time.png", "error_against_spacing.png"}
    assert {"study.csv", "study.md"} | pictures <= {path.name for path in results.iterdir()}
    records = {p: p.stat().st_mtime_ns for p in results.glob("runs/*/record.json")}
    assert run_study(comm, options(path)) == 0
    assert "2 of 3 runs are there already" in capsys.readouterr().out
    assert {p: p.stat().st_mtime_ns for p in records} == records
    rows = (results / "study.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows] == ["series", "block", "block", "one"]
    assert "refused exit 2" in (results / "study.md").read_text() or "refused,2" in rows[3]
    assert run_study(comm, options(path, "--repetitions", "2", "--only", "block, 5")) == 0
    assert sorted(len(read_record(p.parent).loop_seconds) for p in results.glob("runs/*/record.json")) == [0, 1, 2]


@pytest.mark.slow
def test_a_run_that_takes_too_long_is_ended_and_made_again(folder, comm):
    case = cases_of(load_study(write(folder, series="timeout = 0.05")))[0]
    record = case.subprocess_run.run(folder / "run")
    assert (record.status, record.ending["exit_status"]) == ("timed out", None)
    case.timeout = 600.0
    assert case.subprocess_run.run(folder / "run").status == "finished"


@pytest.mark.parametrize("exit_status, status, programs", [(2, REFUSED, 1), (9, CRASHED, 2)])
def test_a_program_is_made_again_unless_its_end_lasts(tmp_path, monkeypatch, exit_status, status, programs):
    begun = []

    def start(arguments, ranks, **pipes):
        begun.append(arguments)
        code = f"import sys; print('first\\nparsolid: last words'); sys.exit({exit_status})"
        return subprocess.Popen([sys.executable, "-S", "-c", code], start_new_session=True, **pipes)

    monkeypatch.setattr(subprocess_runs, "start", start)
    program = SubprocessRun("a", lambda folder: ["run", "a.toml", "-o", str(folder)], 1, 60.0)
    records = [program.run(tmp_path / "a") for _ in range(2)]
    assert [one.status for one in records] == [status] * 2 and len(begun) == programs
    assert [one.message for one in records] == ["last words"] * 2


def test_a_study_that_is_ended_does_not_wait_for_a_run_that_hears_nothing():
    deaf = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(flush=True); time.sleep(60)"
    process = subprocess.Popen([sys.executable, "-c", deaf], stdout=subprocess.PIPE, start_new_session=True)
    process.stdout.readline()

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    began = time.monotonic()
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    try:
        with pytest.raises(KeyboardInterrupt):
            wait(process, 60.0)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert process.poll() == -signal.SIGKILL and time.monotonic() - began < 5.0


def test_files_of_another_kind_are_told_with_the_command_that_takes_them(folder, capsys):
    scene, study, path = str(folder / "block.toml"), str(write(folder)), folder / "path.toml"
    path.write_text('path = { kind = "shear" }')
    for words, told in (
        (["study", scene], f"parsolid run {scene}"),
        (["run", study], f"parsolid study {study}"),
        (["point", scene], f"parsolid run {scene}"),
        (["check", str(path)], f"parsolid point {path}"),
        (["check", scene, "--ranks", "many"], "--ranks"),
        (["run", scene, "--wall-time", "10m"], "--wall-time"),
    ):
        assert main(words) == 2 and told in capsys.readouterr().err


def test_rows_of_a_report_hold_bounds_and_orders(folder):
    """The finest run has the errors of all; an order that is too low is not as stated, whatever the bound."""
    series = "orders = { kinetic = 1.9 }\nbounds = { kinetic = 3e-2 }"
    for errors, verdicts in (
        ([4e-2, 1e-2], ["not as stated", "as stated"]),
        ([3e-2, 2e-2], ["as stated", "not as stated"]),
    ):
        study = load_study(write(folder, series=series))
        cases = with_errors(folder, errors, series=series)
        for case in cases:
            case.record.summary["particles"], case.record.processor_seconds = case.particles, [2.0]
        rows = error_rows(study, cases)
        assert [(row.error, row.tolerance, row.verdict) for row in rows] == [
            (error, 3e-2, verdict) for error, verdict in zip(errors, verdicts)
        ]
        assert rows[0].levels == [] and [one.value for one in rows[1].levels] == errors
        assert rows[1].source == "series series.json" and rows[1].order is not None
    cases[1].record.status = "failed"
    judge(study, cases)
    assert [row.verdict for row in error_rows(study, cases)][1:] == ["not as stated"]
