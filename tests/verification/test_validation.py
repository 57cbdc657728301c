"""The studies of validation/ and of `parsolid verify`: all can be read, and the cheap ones agree."""

from pathlib import Path

import pytest

from parsolid.campaign.cases import cases_of, load_study
from parsolid.campaign.comparison import AGREES, Row
from parsolid.campaign.verification import studies_of
from parsolid.commands.cli import main
from parsolid.output.summary import read_summary

ROOT = Path(__file__).parents[2]
STUDIES = [*studies_of([str(ROOT / "validation")]), *studies_of([])]
# study, series that are run: less than a minute of one core in CI, some five more with --long
CHEAP = [
    ("lame", ["peridynamics, infinite plate"]),
    ("brazilian", ["peridynamics"]),
    ("cook", ["tlsph"]),
    ("pad", ["tlsph"]),
    ("coupled_restitution", ["tlsph on mpm"]),
]
LONGER = [
    ("kirsch", ["tlsph, infinite plate"]),
    ("spinning_disc", ["tlsph"]),
    ("taylor_4340", ["mpm, 208 m/s"]),
    ("hugoniot", ["tlsph"]),
    ("springback", ["tlsph, static"]),
    ("die", ["tlsph"]),
    ("bar_vibration", ["tlsph", "peridynamics", "mpm", "ulsph"]),
    ("restitution", ["tlsph", "mpm", "ulsph"]),
    ("upsetting", ["mpm"]),
    ("ball_on_plate", ["peridynamics on tlsph"]),
]
CHEAP += [pytest.param(*one, marks=pytest.mark.long) for one in LONGER]


@pytest.mark.serial
@pytest.mark.parametrize("path", STUDIES, ids=[Path(path).stem for path in STUDIES])
def test_a_study_can_be_read_and_says_what_it_shows(path):
    study = load_study(path)
    cases = cases_of(study)
    asked = any(case.bounds or case.expect or case.series.orders for case in cases)
    assert study.compared or asked


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize(("name", "series"), CHEAP)
def test_a_case_agrees(name, series, tmp_path, capfd):
    only = [word for one in series for word in ("--only", one)]
    assert main(["study", str(ROOT / "validation" / f"{name}.toml"), "-o", str(tmp_path), "--jobs", "2", *only]) == 0
    capfd.readouterr()
    rows = [Row.of(one) for one in read_summary(tmp_path / "summary.json")["rows"]]
    found = [row for row in rows if row.reference is not None]
    assert {row.method for row in found} == set(series)
    assert all(row.verdict in AGREES and row.core_seconds is not None for row in found)
