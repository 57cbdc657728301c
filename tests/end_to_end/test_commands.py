"""What the commands print and leave behind."""

import h5py
import numpy as np
import pytest
import tomli_w
from command_line import all_done, many, parsolid
from run_results import assert_same_bits, history, state, summary
from small_scenes import COLUMN, ONE, PUNCH, changed, write

from parsolid.checksums import with_checksum
from parsolid.output import vtkhdf
from parsolid.scene import load_scene

RANKS = 2
SUMMARY = ["scene", "method", "dimension", "particles", "pairs", "ranks", "steps", "end_time", "status", "errors"]
SUMMARY += ["wall_seconds", "setup_seconds", "particle_steps_per_second_per_rank", "nanoseconds_per_pair"]
SUMMARY += ["communication_share", "energy_error_share", "energy_error_share_largest", "spurious_energy_gain"]
SUMMARY += ["numerical_dissipation", "numerical_dissipation_share", "energy_check", "energy_check_reason"]
SUMMARY += ["peak_memory_bytes_per_rank"]


@pytest.fixture(scope="module")
def jobs(tmp_path_factory):
    """(folder, results by name) of some commands run in one job."""
    folder = tmp_path_factory.mktemp("commands")
    elastic = write(PUNCH, folder / "elastic.toml")
    viscous = write(changed(PUNCH, {"bodies.0.material.branches": ONE}), folder / "viscous.toml")
    column = write(COLUMN, folder / "column.toml")
    end, cells = ["--end-time", "2e-3"], "bodies.0.particles=[7, 8]"

    def quietly(scene, name, *words):
        return [scene, "-q", "-o", folder / name, *words]

    more = ["--end-time", "0.02", "--profile", "--log", folder / "quiet.log"]
    commands = {
        "check elastic": ["check", elastic],
        "check viscous": ["check", viscous],
        "dry run": ["run", elastic, "--dry-run", "-o", folder / "never"],
        "quiet": quietly(column, "quiet", *more),
        "told": [elastic, "-o", folder / "told", *end],
        "verbose": ["run", elastic, "-v", "-o", folder / "verbose", *end],
        "set": quietly(elastic, "set", "--set", "method.cfl=0.5", "--set", cells, *end),
        "empty branches": quietly(elastic, "empty", "--set", "bodies.0.material.branches=[]", *end),
        "viscous": quietly(viscous, "viscous", *end),
    }
    results = dict(zip(commands, many(list(commands.values()), RANKS, folder / "job")))
    all_done(list(results.values()))
    # what a run says of its own scene is enough to run it again
    all_done(many([[folder / "set" / "scene.toml", "-q", "-o", folder / "again"]], RANKS, folder / "again-job"))
    return folder, results


def table(text: str) -> dict[str, str]:
    """Lines of a report by what they begin with."""
    return {line[:28].strip(): line[28:].strip() for line in text.splitlines()}


def number(text: str) -> float:
    """The number that a line of a report begins with."""
    return float(text.split(maxsplit=1)[0].replace(",", ""))


def test_check_shows_no_branches_where_there_are_none(jobs):
    elastic, viscous = (jobs[1][name][0].out for name in ("check elastic", "check viscous"))
    assert "viscous_strain_inverse_1" in viscous and "viscous" not in elastic
    one, other = table(elastic), table(viscous)
    assert number(one["bytes a particle"]) < number(other["bytes a particle"])
    assert number(one["bytes sent a step"]) <= number(other["bytes sent a step"])
    assert one["particles"].startswith("81 ") and one["pairs"] == other["pairs"] and int(one["pairs"]) > 200
    assert {"ghosts", "peak memory a rank", "time step", "steps", "estimated wall time"} <= set(one)
    assert table(jobs[1]["dry run"][0].out)["particles"] == one["particles"] and not (jobs[0] / "never").exists()


def test_a_scene_without_branches_has_none_in_its_checkpoint_and_the_same_bits_as_one_with_an_empty_list(jobs):
    folder = jobs[0]
    fields = state(folder / "told")[1]
    assert not any("viscous" in name for name in fields) and "viscous_strain_inverse_1" in state(folder / "viscous")[1]
    assert_same_bits(folder / "empty", folder / "told")


def test_only_one_rank_talks_and_none_when_told_to_be_quiet(jobs):
    for name, ranks in jobs[1].items():
        assert not any(rank.err for rank in ranks) and not any(rank.out for rank in ranks[1:]), name
    for name in ("quiet", "set", "viscous"):
        assert jobs[1][name][0].out == ""
    told, verbose = jobs[1]["told"][0].out, jobs[1]["verbose"][0].out
    assert told.startswith("Small punch: 81 particles") and "energy error" in told
    assert len(verbose.splitlines()) >= len(told.splitlines())


def test_the_summary_says_what_was_run(jobs):
    found = summary(jobs[0] / "quiet")
    assert set(SUMMARY) <= set(found)
    assert found["scene"] == "Small column" and found["method"] == "tlsph" and found["dimension"] == 3
    assert found["particles"] == 5 * 9 * 5 and found["ranks"] == RANKS and found["status"] == "finished"
    assert found["steps"] == history(jobs[0] / "quiet")["step"][-1] and found["end_time"] == 0.02
    assert abs(found["energy_error_share"]) < 1e-2 and found["errors"] == {}
    assert 0.0 < found["communication_share"] < 1.0 and found["peak_memory_bytes_per_rank"] > 1e7
    assert all(found[name] > 0.0 for name in SUMMARY if name.endswith(("seconds", "pair", "rank", "pairs")))
    phases, ranks = found["phases"], found["phases_by_rank"]
    assert sum(phases.values()) == pytest.approx(found["wall_seconds"]) and found["load_imbalance"] >= 1.0
    assert all(len(ranks[name]) == RANKS and phases[name] > 0.0 for name in ("set_up", "forces", "output"))
    assert all(sum(ranks[name]) == pytest.approx(RANKS * phases[name]) for name in ranks)
    assert {"git_hash", "versions"} <= set(found) and found["versions"]["parsolid"]


def test_a_quiet_run_tells_its_log_and_each_rank_its_functions(jobs):
    log = (jobs[0] / "quiet.log").read_text().splitlines()
    assert log[0].startswith("--- parsolid") and log[1] == "Small column: 225 particles, to t = 0.02 s"
    assert any(line.startswith("time: ") and "load imbalance" in line for line in log)
    for rank in range(RANKS):
        told = (jobs[0] / "quiet" / f"profile-{rank}.txt").read_text()
        assert told.startswith(f"rank {rank} of {RANKS}") and "loop.py" in told


def test_the_resolved_scene_holds_what_the_command_line_changed_and_runs_again(jobs):
    folder = jobs[0]
    resolved = load_scene(folder / "set" / "scene.toml")
    assert resolved.method.cfl == 0.5 and resolved.end_time == 2e-3 and resolved.bodies[0].particles == [7, 8]
    assert "dissipation" in (folder / "set" / "scene.toml").read_text()
    assert with_checksum(tomli_w.dumps(resolved.resolved())) == (folder / "set" / "scene.toml").read_text()
    assert_same_bits(folder / "again", folder / "set")


def test_fields_open_in_pyvista_at_all_times(jobs):
    pyvista = pytest.importorskip("pyvista")
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    path = jobs[0] / "quiet" / "fields.vtkhdf"
    times = vtkhdf.published(path)[1]
    assert times.tolist() == pytest.approx([0.0, 0.01, 0.02])
    # pyvista's own reader class has no times for this format yet
    reader = pyvista.get_reader(path).reader
    reader.UpdateInformation()
    steps = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    assert list(steps) == times.tolist()
    for at in times:
        reader.UpdateTimeStep(at)
        mesh = pyvista.wrap(reader.GetOutputDataObject(0))
        assert mesh.n_points == 5 * 9 * 5
        assert set(mesh.point_data) >= {"displacement", "velocity", "pressure", "jacobian", "von_mises_stress"}
        reference = np.asarray(mesh.points) - np.asarray(mesh["displacement"])
        assert np.abs(reference[:, 1]).max() == pytest.approx(2.0, abs=1e-5)
    fields = state(jobs[0] / "quiet")[1]
    assert np.array_equal(np.asarray(mesh.points)[fields["identifier"]], fields["position"])


def test_without_arguments_the_column_twists_from_any_folder(tmp_path):
    result = parsolid("--end-time", "1e-3", ranks=RANKS, folder=tmp_path)
    # after a line on kernels, where they have to be compiled
    assert "\nTwisting column: 3969 particles, to t = 0.001 s" in f"\n{result.out}"
    folder = tmp_path / "results" / "twisting_column"
    found = summary(folder)
    assert found["status"] == "finished" and found["particles"] == 9 * 49 * 9
    assert set(found["errors"]) >= {"kinetic", "strain_energy"}
    with h5py.File(folder / "checkpoint.h5") as file:
        assert file["particles/identifier"].shape == (3969,)
