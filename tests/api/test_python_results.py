"""What Python offers beyond the page: jobs of their own, errors, tables against files."""

import json
import pickle
import signal
import warnings
from pathlib import Path

import numpy as np
import pytest

import parsolid
from parsolid.api import pictures
from parsolid.collective import SolverError
from parsolid.scene import SceneError, parse_scene
from parsolid.simulation.loop import RunFailed

SCENE = {
    "dimension": 2,
    "end_time": 1e-3,
    "method": {"kind": "tlsph"},
    "bodies": [
        {
            "shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}},
            "particles": [9, 9],
            "velocity": ["0", "-20*Y"],
            "material": {"kind": "neo-hookean", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.4},
        }
    ],
    "output": {"fields": ["displacement", "stress"], "fields_interval": 5e-4, "pictures": False},
}
RUBBER = SCENE["bodies"][0]["material"]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return parsolid.run(SCENE, output=tmp_path_factory.mktemp("run") / "here")


@pytest.mark.slow
def test_a_job_of_its_own_leaves_what_a_run_in_this_process_leaves(tmp_path):
    """With the same options, which act in both."""
    overrides = ("bodies.0.particles=[8,8]", "end_time=5e-4")
    here, there = (parsolid.run(SCENE, output=tmp_path / str(n), ranks=n, overrides=overrides) for n in (None, 2))
    for results, ranks in ((here, 1), (there, 2)):
        assert results.summary["ranks"] == ranks and results.summary["particles"] == 64
        assert results.summary["end_time"] == 5e-4
    for name, values in here.columns.items():
        if name != "wall_time":
            np.testing.assert_allclose(there.columns[name], values, rtol=1e-9, atol=1e-9 * np.abs(values).max())


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [None, 2])
def test_results_of_a_run_with_a_target_are_those_of_its_last_level(ranks, tmp_path):
    overrides = ("end_time=4e-3", "bodies.0.particles=[17,17]")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reached = parsolid.run(SCENE, tmp_path / "a", ranks, overrides=overrides, target=["kinetic=50%"])
    assert reached.columns["time"][-1] == 4e-3 and reached.directory.parent == tmp_path / "a" / "levels"
    target = {"target": ["kinetic=1e-9%"], "core_seconds": 1e-6}
    with pytest.warns(UserWarning, match="target"):
        missed = parsolid.run(SCENE, tmp_path / "b", ranks, overrides=overrides, **target)
    assert missed.directory.parent == tmp_path / "b" / "levels" and missed.errors["kinetic"].shape[0] > 1


def test_fields_and_history_are_those_of_the_files(results):
    assert list(results.fields) == [0.0, 5e-4, 1e-3]
    assert results.fields[4e-4].time == 5e-4
    start, end = results.fields[0.0], results.fields[1e-3]
    moved = end["position"] - start["position"]
    np.testing.assert_allclose(moved, end["displacement"], atol=1e-6 * np.abs(moved).max())
    assert {"position", "body", "volume", "stress"} <= set(end)
    assert end["stress"].shape == (81, 3, 3) and end["body"].shape == (81,)
    with pytest.raises(SceneError, match="'strss'"):
        end["strss"]
    with pytest.raises(SceneError, match="found 2"):
        results.fields[2.0]
    pytest.importorskip("pandas")
    assert results.history["kinetic"].to_numpy().tolist() == results.columns["kinetic"].tolist()
    assert results.history.loc[0.0, "kinetic"] == results.columns["kinetic"][0]


def test_pictures(results):
    pytest.importorskip("matplotlib").use("Agg")
    axes = results.plot("kinetic")
    assert axes.lines[0].get_ydata().tolist() == results.columns["kinetic"].tolist()
    with pytest.raises(SceneError, match="found 'kinetc'"):
        results.plot("kinetc")
    pytest.importorskip("pyvista")
    cloud = results.to_pyvista(1e-3)
    assert cloud.n_points == 81 and cloud.point_data["stress"].shape == (81, 9)


def test_what_is_wrong_is_told_as_on_the_command_line(tmp_path):
    assert parsolid.SceneError is SceneError and parsolid.SolverError is SolverError
    assert parsolid.RunFailed is RunFailed and issubclass(parsolid.OutputError, Exception)
    for ranks in (None, 2):
        with pytest.raises((SceneError, SolverError), match="end_time: "):
            parsolid.run(SCENE | {"end_time": -1}, output=tmp_path / "none", ranks=ranks)
    with pytest.raises(SceneError, match="folder of a run"):
        parsolid.load(tmp_path)
    assert not (tmp_path / "none").exists()
    with pytest.raises(SceneError, match="material.youngs_modulus: "):
        parsolid.material("neo-hookean", **(RUBBER | {"kind": "neo-hookean", "youngs_modulus": -1.0}))
    with pytest.raises(AttributeError, match="laod"):
        parsolid.laod


@pytest.mark.parametrize(
    "words",
    [
        *({"ranks": ranks} for ranks in (0, "2", True)),
        *({"max_steps": steps} for steps in (0, 1.5)),
        {"wall_time": -1.0},
        {"core_seconds": float("nan")},
        *({"overrides": words} for words in ("end_time=1e-4", None)),
        {"target": "kinetic=1%"},
        {"allow_change": "end_time"},
    ],
)
def test_arguments_that_the_command_line_refuses_are_refused_and_nothing_is_written(words, tmp_path):
    with pytest.raises(SolverError) as found:
        parsolid.run(SCENE, output=tmp_path / "none", **words)
    assert str(found.value).partition(":")[0] == next(iter(words)) and not (tmp_path / "none").exists()


@pytest.mark.parametrize("scene", [None, [SCENE], 3])
@pytest.mark.parametrize("function", [parsolid.run, parsolid.check, parsolid.Simulation])
def test_what_is_no_scene_is_refused(function, scene):
    with pytest.raises(SceneError) as found:
        function(scene)
    assert [fault.partition(":")[0] for fault in found.value.faults] == ["scene"]


@pytest.mark.parametrize(
    ("key", "call"),
    [
        *(("ranks", lambda ranks=ranks: parsolid.check(SCENE, ranks=ranks)) for ranks in ("a", 0, 1.5)),
        ("restart", lambda: parsolid.Simulation(SCENE, restart=True)),
        ("step", lambda: parsolid.Simulation(SCENE).step(1.5)),
        ("step", lambda: parsolid.Simulation(SCENE).step(0)),
        ("run", lambda: parsolid.Simulation(SCENE).run("end")),
        ("on_step", lambda: parsolid.Simulation(SCENE).on_step(None)),
        ("every", lambda: parsolid.Simulation(SCENE).on_step(print, every=5)),
    ],
)
def test_arguments_that_cannot_be_used_are_refused(key, call):
    with pytest.raises(SolverError) as found:
        call()
    assert str(found.value).partition(":")[0] == key


def test_a_run_gives_the_signals_back(tmp_path):
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
    before = [signal.getsignal(number) for number in numbers]
    assert parsolid.run(SCENE, output=tmp_path / "new", restart=None, max_steps=2).summary["steps"] == 2
    assert [signal.getsignal(number) for number in numbers] == before


def test_a_material_has_the_stress_of_its_energy_and_its_wave_speeds():
    keys = {key: value for key, value in RUBBER.items() if key != "kind"}
    rubber = parsolid.material("neo-hookean", **keys)
    F = np.eye(3) + 0.2 * np.random.default_rng(1).standard_normal((4, 3, 3))
    change = 1e-6 * np.outer([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    slope = (rubber.energy(F + change) - rubber.energy(F - change)) / 2e-6
    np.testing.assert_allclose(rubber.stress(F)[:, 0, 1], slope, rtol=1e-5, atol=1e-6 * 17e6)
    E, nu, rho = RUBBER["youngs_modulus"], RUBBER["poissons_ratio"], RUBBER["density"]
    shear, pressure = E / 2.0 / (1.0 + nu), E * (1.0 - nu) / (1.0 + nu) / (1.0 - 2.0 * nu)
    speeds = rubber.wave_speeds(np.eye(3), [0.0, 2.0, 0.0])
    np.testing.assert_allclose(speeds, np.sqrt(np.array([shear, shear, pressure]) / rho), rtol=1e-6)
    with pytest.raises(ValueError, match=r"found \(2, 2\)"):
        rubber.energy(np.eye(2))
    copper = parsolid.material("elastic-plastic", library="OFHC copper, mechanical threshold")
    with pytest.raises(TypeError, match="integrate"):
        copper.stress(np.eye(3))


def test_steps_by_hand_are_those_of_the_run(results):
    simulation = parsolid.Simulation(SCENE)
    seen = []
    simulation.on_step(lambda now: seen.append(now.time))
    assert simulation.run(1.0) == 1e-3 and simulation.finished
    assert len(seen) == simulation.steps == results.summary["steps"] and seen[-1] == 1e-3
    found, expected = simulation.energies(), results.columns
    assert found["kinetic"] == expected["kinetic"][-1]
    assert found["energy_error"] == pytest.approx(expected["energy_error"][-1], rel=1e-6) != 0.0
    position = simulation.field("position")
    assert position.shape == (81, 2)
    with pytest.raises(KeyError, match="velocty"):
        simulation.arrays("velocty")
    with pytest.raises(KeyError, match="presure"):
        simulation.field("presure")
    with pytest.raises(ValueError, match="step: "):
        simulation.step(-1)
    with pytest.raises(ValueError, match="run: "):
        simulation.run(5e-4)
    with pytest.raises(SceneError, match="'kinetc'.*'kinetic'"):
        results.columns["kinetc"]
    stated = json.loads((Path(results.directory) / "summary.json").read_text())
    assert stated.pop("checksum") and stated == results.summary


def test_a_scene_made_of_arguments_is_that_of_the_tables(tmp_path):
    scene = parsolid.Scene(**SCENE)
    same = parse_scene(SCENE | {"output": SCENE["output"] | {"directory": "results/scene"}})
    assert scene.resolved() == same.resolved()
    assert pickle.loads(pickle.dumps(scene)) == scene and isinstance(scene, type(parse_scene(SCENE)))
    other = parsolid.Scene(**(SCENE | {"bodies": [SCENE["bodies"][0] | {"particles": np.array([9, 9])}]}))
    assert other.bodies[0].particles == scene.bodies[0].particles
    with pytest.raises(SceneError) as error:
        parsolid.Scene(dimension=2, end_time=-1.0, method={"kind": "tlsph"}, bodies=[], bodis=[])
    assert [fault.partition(":")[0] for fault in error.value.faults] == ["end_time", "bodies", "bodis"]


PROBED = SCENE | {
    "boundaries": [{"kind": "fixed", "plane": "Y = 0", "mirror": False, "name": "ground", "reaction": True}],
    "probes": [{"name": "corner", "at": [1.0, 1.0], "fields": ["displacement"]}],
    "output": SCENE["output"] | {"history_steps": 1},
}


def test_a_stepped_run_leaves_what_a_run_leaves_and_goes_on_to_the_bit(comm, shared_path):
    whole = parsolid.run(PROBED, output=shared_path / "whole")
    written, seen = [], []
    with parsolid.Simulation(PROBED, output=shared_path / "pieces", comm=comm) as simulation:
        simulation.on_step(lambda now: seen.append(now.steps))
        simulation.step(2)
        probes = simulation.probes()
        assert seen == [1, 2] and not simulation.finished

    class Times(parsolid.Output):
        every = parsolid.Cadence(steps=2)

        def write(self, simulation):
            written.append(simulation.clock.step)

    for name in ("corner.displacement_y", "ground.force_y"):
        assert probes[name] == whole.columns[name][2]
    stopped = parsolid.load(shared_path / "pieces")
    assert stopped.summary["status"] == "stopped" and len(stopped.columns["time"]) == 3
    comm.Barrier()
    folder = shared_path / "pieces"
    with parsolid.Simulation(PROBED, output=folder, restart=folder, outputs=[Times()], comm=comm) as simulation:
        simulation.run()
        assert simulation.finished
    again = parsolid.load(folder)
    assert again.summary["status"] == "finished" and written == list(range(4, whole.summary["steps"] + 1, 2))
    for name, values in whole.columns.items():
        assert again.columns[name].tobytes() == values.tobytes(), name
    assert list(again.fields) == list(whole.fields)
    assert again.fields[1e-3]["stress"].tobytes() == whole.fields[1e-3]["stress"].tobytes()


@pytest.mark.parametrize("written", [False, True])
def test_what_a_script_adds_to_the_velocities_ends_its_run(comm, shared_path, written):
    folder = shared_path / "pushed" if written else None

    def push(simulation):
        for velocity in simulation.arrays("velocity"):
            velocity *= 1.1

    with pytest.raises(RunFailed) as failure, parsolid.Simulation(SCENE | {"end_time": 1.0}, folder) as simulation:
        simulation.on_step(push)
        simulation.run()
    assert simulation.steps < 100 and "method.balance_limit" in str(failure.value)
    comm.Barrier()
    if folder is not None:
        summary = parsolid.load(folder).summary
        assert (summary["status"], summary["steps"]) == ("failed", simulation.steps) and summary["fault"]


def test_options_act_in_this_process(tmp_path):
    stopped = parsolid.run(SCENE, output=tmp_path / "late", wall_time=1e-3)
    assert stopped.summary["status"] == "interrupted"
    with pytest.raises(SceneError, match="--set bodies.7.particles"):
        parsolid.run(SCENE, output=tmp_path / "none", overrides=["bodies.7.particles=1"])


def test_the_report_of_a_check_has_what_a_run_takes(results):
    report = parsolid.check(SCENE)
    assert report.particles == results.summary["particles"] and report.pairs == results.summary["pairs"]
    assert report.stable_step > 0.0 and report.steps >= 3 and f"{report.pairs:,}" in str(report)
    thin = SCENE["bodies"][0] | {"particles": [9, 2]}
    assert [one.code for one in parsolid.check(SCENE | {"bodies": [thin]}).warnings] == []
    with pytest.raises(SceneError):
        parsolid.check(SCENE | {"end_time": -1.0})


@pytest.mark.parametrize(
    "stated, seconds, drawn", [(None, 0.1, False), (None, 1e3, True), (True, 0.1, True), (False, 1e3, False)]
)
def test_a_run_draws_when_the_scene_says_so_or_it_has_taken_long(comm, tmp_path, monkeypatch, stated, seconds, drawn):
    pytest.importorskip("pyvista")
    calls = []
    monkeypatch.setattr(pictures, "draw", calls.append)
    pictures.draw_at_end(comm, tmp_path, stated, seconds)
    assert calls == [tmp_path] * (drawn and comm.rank == 0)


def test_a_script_under_mpirun_is_a_run_on_all_its_ranks(comm, shared_path):
    results = parsolid.run(SCENE, output=shared_path / "all")
    assert results.summary["ranks"] == comm.size
    if comm.size > 1:
        with pytest.raises(SolverError, match="ranks: expected none"):
            parsolid.run(SCENE, output=shared_path / "all", ranks=2)
