"""`parsolid verify`: studies beside one another, their summaries, and the report of these."""

import json
import shutil
from dataclasses import asdict

import pytest
import tomli_w
from solids import supports, tables

from parsolid.campaign.cases import cases_of, load_study
from parsolid.campaign.comparison import AS_STATED, INSIDE, NEAR, NOT_AS_STATED, OUTSIDE, Row
from parsolid.campaign.subprocess_runs import SubprocessRun, run_concurrently
from parsolid.campaign.verification import ASKED, build_report, folders_of, read_summaries, studies_of
from parsolid.commands.cli import main
from parsolid.output.errors import OutputError
from parsolid.output.summary import read_summary, write_summary
from parsolid.scene import SceneError

pytestmark = pytest.mark.serial

SOFT = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
SCENE = tables(
    [11, 9],
    [1.0, 0.2],
    material=SOFT,
    method={"integrator": "leapfrog", "weights": "best"},
    end_time=4.0,
    title="Bar",
    body={"velocity": ["1e-3*sin(pi*X/2)", 0]},
    boundaries=supports(X=(0.0, "fixed"), Y0=(0.0, "roller"), Y1=(0.2, "roller")),
    probes=[{"name": "tip", "at": [1, 0.1], "fields": ["displacement"]}],
    output={"fields_times": []},
)
# a whole half period: the tip is back after 2 L/c
STUDY = """
title = "Bar"
group = "{group}"
remark = "a remark"
[[series]]
name = "tlsph"
scene = "bar.toml"
{bounds}
[[series.axes]]
name = "particles"
settings = [
    {{ label = "11", spacing = 0.1 }},
    {{ label = "21", spacing = 0.05, set = ["bodies.0.particles=[21, 9]"] }},
]
[[compared]]
quantity = "time of the return"
unit = "s"
value = {value}
source = "d'Alembert"
readings.t = {{ column = "{column}", take = "crossing", level = 0.0, begin = 0.5 }}
{cause}
"""
RETURN = 2.0 / 1.160238702


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "bar.toml").write_text(tomli_w.dumps(SCENE))
    return tmp_path


def write(folder, name="study.toml", value=RETURN, column="tip.displacement_x", cause="", bounds="", group="waves"):
    path = folder / name
    path.write_text(STUDY.format(value=value, column=column, cause=cause, bounds=bounds, group=group))
    return path


@pytest.mark.parametrize(
    "more, told",
    [
        ({"column": "tip.displacement_z"}, ("compared.0.readings", "'tip.displacement_z'")),
        ({"cause": 'series = ["tlsp"]'}, ("compared.0.series.0", "'tlsp'")),
    ],
)
def test_columns_and_series_that_are_not_there_are_refused(folder, more, told):
    with pytest.raises(SceneError) as error:
        cases_of(load_study(write(folder, **more)))
    assert all(word in str(error.value) for word in told)


def test_studies_are_files_or_folders_of_them(folder, tmp_path_factory):
    write(folder)
    assert studies_of([str(folder / "study.toml")]) == [str(folder / "study.toml")]
    assert [one.rpartition("/")[2] for one in studies_of([str(folder)])] == ["bar.toml", "study.toml"]
    for wrong in (str(folder / "no.toml"), str(tmp_path_factory.mktemp("empty"))):
        with pytest.raises(SceneError):
            studies_of([str(folder), wrong])
    names = ["a/b/studies/x.toml", "a/c/studies/x.toml", "d/b/studies/x.toml", "y.toml"]
    found = [one.name for one in folders_of(names, folder)]
    assert found[:2] == ["b_x", "c_x"] and found[3] == "y" and len(set(found)) == 4


def test_faulty_studies_are_refused_before_anything_runs(folder, capsys):
    write(folder, "one.toml", column="tip.nothing")
    write(folder, "two.toml", column="tip.nothing_else")
    words = [str(folder / name) for name in ("one.toml", "two.toml")]
    assert main(["verify", *words, "-o", str(folder / "out")]) == 2
    found = capsys.readouterr().err
    assert all(word in found for word in words)
    assert not (folder / "out").exists()
    assert main(["verify", "--report", "-o", str(folder / "out")]) == 2
    assert main(["verify", words[0], "--report", "-o", str(folder / "out")]) == 2
    # files in the place of folders
    study, file = str(write(folder)), str(folder / "bar.toml")
    for words in (
        ["study", study, "-o"],
        ["verify", study, "-o"],
        ["verify", study, "--page"],
        ["verify", "--report", "-o"],
    ):
        assert main([*words, file]) == 2


def summary(folder, name, rows, **more):
    entries = {"study": name, "group": "waves", "remark": None, "rows": [asdict(row) for row in rows]}
    entries |= {"runs": 1, "faults": [], "core_seconds": 2.5, "processor_seconds": 1.0}
    entries |= {"git_hash": "abc", "host": "here", "cores": "2 cores"}
    (folder / name).mkdir(parents=True)
    write_summary(folder / name / "summary.json", entries | {"written_at": "2026-01-02T03:04:05+00:00"} | more)


def test_a_report_is_that_of_the_summaries(tmp_path):
    one = Row("a", "m", "speed", "m/s", 100.0, 2.0, "x 1900", 103.0, 1.5, 0.03, verdict=INSIDE)
    two = Row("b", "m", "angle", "", 70.0, None, "y 1901", 90.0, None, 0.29, verdict=OUTSIDE, remark="no idea")
    bound = Row("c", "m", "kinetic", error=0.02, tolerance=0.01, verdict=NOT_AS_STATED)
    summary(tmp_path, "first", [one])
    summary(tmp_path, "second", [two, bound], group="cracks", core_seconds=7.5)
    page = tmp_path / "page"
    assert build_report(tmp_path, page) == page / "report.md"
    text = (page / "report.md").read_text()
    assert "10 core-seconds" in text and "abc" in text and "2026-01-02" in text
    rows = [line for line in text.splitlines() if line.startswith("| ") and " m |" in line]
    assert [row.split(" | ")[-1].strip(" |") for row in rows] == [INSIDE, OUTSIDE, NOT_AS_STATED]
    # in per cent of a reference, or as it is
    assert "+3 %" in rows[0] and "+29 %" in rows[1] and "2.00e-02" in rows[2] and "%" not in rows[2]
    assert "103" in rows[0] and "1.5" in rows[0] and "no idea" in text
    assert (page / "waves.png").exists() and (page / "cracks.png").exists()
    assert len((page / "report.csv").read_text().splitlines()) == 4
    assert [len(found.rows) for found in read_summaries(tmp_path)] == [1, 2]
    # what was not written by a study is refused
    (tmp_path / ASKED).write_text("[")
    with pytest.raises(OutputError):
        read_summaries(tmp_path)
    write_summary(tmp_path / ASKED, {"studies": ["second"]})
    assert [len(found.rows) for found in read_summaries(tmp_path)] == [2]
    (tmp_path / ASKED).unlink()
    stated = read_summary(tmp_path / "first" / "summary.json")
    write_summary(tmp_path / "first" / "summary.json", stated | {"rows": [{"case": "a"}]})
    with pytest.raises(OutputError):
        read_summaries(tmp_path)


def test_runs_beside_one_another_are_ended_with_the_iterator(tmp_path, monkeypatch):
    """Of four runs, two at once, one is waited for; the others leave no record."""
    monkeypatch.setattr("parsolid.campaign.subprocess_runs.start", _sleep)
    runs = [
        (SubprocessRun(str(i), lambda folder, i=i: [str(0.1 if i == 0 else 60)], 1, 100.0), tmp_path / str(i))
        for i in range(4)
    ]
    made = run_concurrently(runs, 2, 0)
    number, record, seconds = next(made)
    assert number == 0 and record.status == "finished" and seconds < 30.0
    made.close()
    assert [(tmp_path / str(i) / "record.json").exists() for i in range(4)] == [True, False, False, False]


def _sleep(arguments, ranks, **pipes):
    import subprocess
    import sys

    words = [sys.executable, "-c", "import sys, time; time.sleep(float(sys.argv[1]))", arguments[0]]
    return subprocess.Popen(words, start_new_session=True, **pipes)


@pytest.mark.slow
def test_studies_run_compare_and_report(folder, capsys):
    """A bar against d'Alembert and against a wrong number, with the cause stated and without."""
    good = write(folder, "good.toml", bounds="bounds = { energy_drift = 1e-2 }")
    known = write(folder, "known.toml", value=3.0, cause='cause = "it is wrong"', group="wrong")
    out = folder / "out"
    # what an earlier verification left in the folder is not reported
    summary(out, "earlier", [Row("earlier", "m", "speed", reference=1.0, computed=1.0, verdict=INSIDE)])
    assert main(["verify", str(good), str(known), "-o", str(out), "--jobs", "2"]) == 0
    assert all("earlier" not in (out / name).read_text() for name in ("report.md", "report.csv"))
    assert build_report(out, out / "again").read_text() == (out / "report.md").read_text()
    capsys.readouterr()
    row = Row.of(read_summary(out / "good" / "summary.json")["rows"][0])
    assert row.verdict in (INSIDE, NEAR) and abs(row.computed / RETURN - 1.0) < 0.01
    assert row.bar is not None and [one.particles for one in row.levels] == [99, 189]
    drift = Row.of(read_summary(out / "good" / "summary.json")["rows"][-1])
    assert drift.verdict == AS_STATED and drift.tolerance == 1e-2 and drift.error < 1e-2
    wrong = Row.of(read_summary(out / "known" / "summary.json")["rows"][0])
    assert wrong.verdict == OUTSIDE and wrong.remark == "it is wrong"
    pictures = {"waves.png", "wrong.png", "error_against_time.png", "report.md", "report.csv"}
    assert pictures <= {path.name for path in out.iterdir()}
    # the same page from the summaries alone, elsewhere
    for path in out.glob("*/runs"):
        shutil.rmtree(path)
    assert main(["verify", "--report", "-o", str(out), "--page", str(folder / "page")]) == 0
    assert (folder / "page" / "report.md").read_text() == (out / "report.md").read_text()
    # a miss that nobody has explained
    unknown = write(folder, "unknown.toml", value=3.0)
    assert main(["study", str(unknown), "-o", str(out / "unknown")]) == 3
    assert json.loads((out / "unknown" / "summary.json").read_text())["rows"][0]["verdict"] == OUTSIDE
