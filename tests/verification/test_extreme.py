"""The fast ones of the stiff and extreme cases, from `stiff_and_extreme.toml` of both methods' studies."""

from functools import cache
from pathlib import Path

import pytest

from parsolid.campaign.cases import cases_of, load_study
from parsolid.campaign.measures import measures_of, not_finite
from parsolid.campaign.records import Record, read_files
from parsolid.commands.cli import main

RUNS = Path(__file__).parents[2] / "runs"
METHODS = ("tlsph", "mpm", "ulsph")
STATUS = {"stable": 0, "failure": 3, "refused": 2}
FAST = (
    "punch, relaxation time over time step, 0.001",
    "punch, relaxation time over time step, 1",
    "punch, relaxation time over time step, 1000",
    "punch, ten branches, tau = 1e-7 to 10 s",
    "punch, velocity, 1",
    "punch, velocity, 3",
    "punch, time step too long, 1.3",
    "punch, spacing ratio, 65 x 9 (1:8)",
    "a single layer of particles",
    "tensile, beta 0, past 1.6 ms, 15 x 15",
    "a body of one particle, 1 x 1",
    "shear, rate, 1e7 /s",
    "shear at 1e5 /s, heated through melting",
    "plate impact, particle speed, 10000 m/s",
    "Taylor bar, cell, 4 mm",
    "plastic layer, conductivity over copper's, 1e4, to 1e-6 s",
    "Taylor bar, time step too long, cfl, 3",
    "a plane of symmetry between nodes",
    "both at once, 1e-12 m^2, 1e-9 s",
    "time step, 1.5",
    "particles across, 17 x 5",
)


@cache
def cases(*methods: str) -> dict:
    studies = [load_study(RUNS / method / "studies/stiff_and_extreme.toml") for method in methods]
    return {case.title: case for study in studies for case in cases_of(study)}


@pytest.mark.serial
@pytest.mark.slow
@pytest.mark.parametrize("title", FAST)
def test_a_case_ends_as_the_study_says(title, comm, shared_path, capfd):
    case = cases(*METHODS)[title]
    folder = shared_path / "run"
    status = main([*case.arguments(folder), "--quiet", "--set", "output.pictures=false"])
    said = capfd.readouterr().err
    assert status == STATUS[case.expect or "stable"], said
    if comm.rank > 0:
        return
    assert said.count("parsolid: ") == (status != 0)
    assert "Traceback" not in said
    assert not_finite(folder) == []
    if status == 0:
        summary, history = read_files(folder)
        found = measures_of(Record("finished", history, summary, [1.0], [1.0]))
        assert case.bounds, "a stable case without a bound says nothing"
        for name, bound in case.bounds.items():
            assert found[name] <= bound, name


def test_every_case_states_a_bound_or_an_ending():
    for case in cases(*METHODS).values():
        assert case.bounds or case.expect in ("failure", "refused"), case.title
    for case in cases("tlsph").values():
        assert case.ranks == 2, case.title
