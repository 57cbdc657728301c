"""Broken scenes: each names its key, what was expected and what was found."""

import pytest
from small_scenes import changed

from parsolid.particles.agreement import agree
from parsolid.particles.generation import generate
from parsolid.scene import SceneError, load_scene, packaged_scene, parse_scene

SHELL = {"base": [0.0, 0.0, 0.0], "axis": "Z", "radius": 1.0, "thickness": 0.1, "length": 1.0}
HOLLOW = {"bodies.0.shape": {"cylindrical_shell": SHELL}, "bodies.0.particles": [40, 5, 2]}
BALL = {"kind": "velocity", "ball": {"centre": [9.0, 0.0, 0.0], "radius": 1.0}, "velocity": [0, 0, 0]}
PROBE = {"name": "p", "at": [0.0, 0.0, 0.5], "fields": ["velocity"]}


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("methd.cfl=1", "methd"),
        ("bodies.7.particles=[1,2,3]", "--set bodies.7.particles"),
        ("title.x=1", "--set title.x"),
        ("method.cfl", "--set method.cfl"),
        ("output.nonsense=", "--set output.nonsense"),
        ("outptu.nonsense=", "--set outptu.nonsense"),
        ("=3", "--set =3"),
        ("method.cfl=fast", "method.cfl"),
    ],
)
def test_broken_override(override, key):
    with pytest.raises(SceneError, match=f"^{key}: "):
        load_scene(packaged_scene(), [override])


HOSTILE = [
    "end_time = " + "9" * 5_000,
    f"end_time = {2**63}",
    "title = " + "[" * 3_000 + "]" * 3_000,
    "title = " + "[" * 100 + "]" * 100,
    ".".join("a" * 3_000) + " = 1",
    '[reference]\nseries = "a\\u0000b.json"',
    '[[bodies]]\nshape = {mesh = {file = "\\u0000"}}',
    "title = \ndimension = 2",
    "\xff\xfe",
]


def test_an_override_that_is_hostile_is_a_fault():
    for override in (f"end_time={'9' * 5_000}", f"method.cfl={'[' * 3_000}", f"bodies.0.seed={2**64}", "title=[\0]"):
        with pytest.raises(SceneError):
            load_scene(packaged_scene(), [override])


def test_files_that_are_no_scenes(tmp_path):
    with pytest.raises(SceneError, match="none.toml: "):
        load_scene(tmp_path / "none.toml")
    for number, text in enumerate(HOSTILE):
        (tmp_path / f"{number}.toml").write_bytes(text.encode("latin-1"))
        with pytest.raises(SceneError) as caught:
            load_scene(tmp_path / f"{number}.toml")
        assert all(len(line) < 300 for line in caught.value.faults)


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
    "empty region": ({"boundaries": [BALL]}, "boundaries.0"),
    "probe in a hole": (HOLLOW | {"probes": [PROBE]}, "probes.0.at"),
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
