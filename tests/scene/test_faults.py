"""Broken scenes: each names its key, what was expected and what was found."""

import pytest
from small_scenes import changed

from parsolid.particles.agreement import agree
from parsolid.particles.generation import generate
from parsolid.scene import SceneError, load_scene, packaged_scene, parse_scene


def shell(**keys):
    return {
        "cylindrical_shell": {"base": [0.0, 0.0, 0.0], "axis": "Z", "radius": 1.0, "thickness": 0.1, "length": 1.0}
        | keys
    }


PROBE = {"name": "p", "at": [0.0, 0.0, 0.0], "fields": ["velocity"]}


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("methd.cfl=1", "methd: .*did you mean 'method'"),
        (
            "bodies.7.particles=[1,2,3]",
            "--set bodies.7.particles: expected an index from 0 to 0 after bodies, found '7'",
        ),
        ("title.x=1", "--set title.x: expected a table at title, found 'Twisting column'"),
        ("method.cfl", "--set method.cfl: expected key.path=value, found 'method.cfl'"),
        ("output.nonsense=", "--set output.nonsense: expected .* found 'nonsense'"),
        ("outptu.nonsense=", "--set outptu.nonsense: expected .* found 'outptu'"),
        ("=3", "--set =3: expected key.path=value"),
        ("method.cfl=fast", "method.cfl: expected a number, found 'fast'"),
    ],
)
def test_broken_override(override, message):
    with pytest.raises(SceneError, match=message):
        load_scene(packaged_scene(), [override])


HOSTILE = [
    ("end_time = " + "9" * 5_000, "expected TOML, found a fault: Exceeds the limit"),
    (f"end_time = {2**63}", "end_time: expected a whole number of 64 bits, as TOML has them, found a larger one"),
    ("title = " + "[" * 3_000 + "]" * 3_000, "expected TOML, found tables or lists nested too deeply"),
    ("title = " + "[" * 100 + "]" * 100, "title.0.0: expected at most 32 tables or lists one within the other"),
    (".".join("a" * 3_000) + " = 1", "a.a.a: expected at most 32 tables or lists one within the other, found more"),
    ('[reference]\nseries = "a\\u0000b.json"', "reference.series: expected a text without NUL"),
    ('[[bodies]]\nshape = {mesh = {file = "\\u0000"}}', "bodies.0.shape.mesh.file: expected a text without NUL"),
]


def test_an_override_that_is_hostile_is_a_fault():
    for override in (f"end_time={'9' * 5_000}", f"method.cfl={'[' * 3_000}", f"bodies.0.seed={2**64}", "title=[\0]"):
        with pytest.raises(SceneError):
            load_scene(packaged_scene(), [override])


def test_files_that_are_no_scenes(tmp_path):
    with pytest.raises(SceneError, match="none.toml: expected a readable scene, found No such file"):
        load_scene(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("title = \ndimension = 2")
    with pytest.raises(SceneError, match="bad.toml: expected TOML, found a fault: .*line 1"):
        load_scene(tmp_path / "bad.toml")
    for number, (text, words) in enumerate(HOSTILE):
        (tmp_path / f"{number}.toml").write_text(text)
        with pytest.raises(SceneError, match=words) as caught:
            load_scene(tmp_path / f"{number}.toml")
        assert all(len(line) < 300 for line in caught.value.faults)
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(SceneError, match="bytes.toml: expected TOML"):
        load_scene(tmp_path / "bytes.toml")


# found at particles: changes, and the key
AT_GENERATION = {
    "velocity": ({"bodies.0.velocity": ["0", "log(X)", "0"]}, "bodies.0.velocity.1"),
    "gradient": (
        {"bodies.0.deformation_gradient": [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "sqrt(0.5-X)"]]},
        "bodies.0.deformation_gradient.2.2",
    ),
    "as good as infinite": ({"bodies.0.velocity": ["0", "1e308", "0"]}, "bodies.0.velocity.1"),
    "load": ({"loads.body_force": ["1/(Z-3)", "0", "0"]}, "loads.body_force.0"),
    "traction": (
        {"boundaries": [{"kind": "traction", "plane": "X = 1", "traction": ["sqrt(X-1)", "0", "arccos(Y)"]}]},
        "boundaries.0.traction.2",
    ),
    "more than the memory": ({"bodies.0.particles": [9_000, 9_000, 9_000]}, "bodies"),
    "too small for floats": ({"bodies.0.shape.box.upper": [1e-60, 1.0, 1.0]}, "bodies.0"),
    "far away": ({"bodies.0.shape.box.lower": [-1e60, 0.0, 0.0]}, "bodies.0"),
    "empty region": (
        {
            "boundaries": [
                {"kind": "velocity", "ball": {"centre": [9.0, 0.0, 0.0], "radius": 1.0}, "velocity": [0, 0, 0]}
            ]
        },
        "boundaries.0",
    ),
    "probe in a hole": (
        {"bodies.0.shape": shell(), "bodies.0.particles": [40, 5, 2], "probes": [PROBE | {"at": [0.0, 0.0, 0.5]}]},
        "probes.0.at",
    ),
}


@pytest.mark.parametrize(("changes", "key"), AT_GENERATION.values(), ids=AT_GENERATION)
def test_fault_at_generation_is_the_same_on_all_ranks(cube, comm, changes, key):
    scene = parse_scene(changed(cube, changes))
    with pytest.raises(SceneError) as caught:
        generate(scene, comm)
    assert [fault.partition(": ")[0] for fault in caught.value.faults] == [key]
    assert len(set(comm.allgather(str(caught.value)))) == 1


def test_ranks_agree(comm):
    agree(comm, [])
    mine = [f"fault of rank {comm.rank}", "fault of all"] if comm.rank == comm.size - 1 else ["fault of all"]
    with pytest.raises(SceneError) as caught:
        agree(comm, mine)
    assert sorted(caught.value.faults) == ["fault of all", f"fault of rank {comm.size - 1}"]
