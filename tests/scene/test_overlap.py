"""Bodies in one another are refused by their names, neighbours are not, for every shape on any number of ranks."""

import pytest
from plain_tables import MATERIAL

from parsolid.particles.generation import generate
from parsolid.scene import SceneError, parse_scene
from parsolid.scene.schema import Scene


def scene(dimension: int, *bodies: tuple[dict, list[int]], bond=True, **more) -> Scene:
    tables = [
        {"name": name, "shape": shape, "particles": particles, "material": MATERIAL} | more
        for name, (shape, particles) in zip("ab", bodies)
    ]
    data = {"dimension": dimension, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": tables}
    return parse_scene(data | {"bond": [{"bodies": ["a", "b"]}] if bond else []})


def box(lower, upper) -> tuple[dict, list[int]]:
    return {"box": {"lower": lower, "upper": upper}}, [5] * len(lower)


SQUARE, CUBE = box([0.0, 0.0], [1.0, 1.0]), box([0.0, 0.0, 0.0], [1.0, 1.0, 1.0])
DISC = {"sphere": {"centre": [1.5, 0.5], "radius": 0.5}}, [8, 8]
HOLED = {"perforated_box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0], "centre": [0.5, 0.5], "radius": 0.4}}, [12, 12]
RING = {"cylindrical_shell": {"centre": [0.0, 0.0], "radius": 1.0, "thickness": 0.2, "angles": [0.0, 90.0]}}, [20, 3]
LONG = {"cylindrical_shell": RING[0]["cylindrical_shell"] | {"angles": [0.0, 270.0]}}, [60, 3]
ROD = {"cylinder": {"base": [0.0, 0.0, 0.0], "axis": "Z", "radius": 0.5, "length": 1.0, "part": "quarter"}}, [6, 6, 6]
TUBE = {"base": [0.0, 0.0, 0.0], "axis": "Z", "radius": 0.25, "thickness": 0.3, "length": 1.0}
REST = {"cylindrical_shell": TUBE | {"angles": [90.0, 360.0]}}, [20, 4, 3]
PIPE = {"cylindrical_shell": TUBE | {"axis": "X", "radius": 1.0, "thickness": 0.2}}, [40, 4, 3]

APART = {
    "beside a box": (2, SQUARE, box([1.0, 0.0], [2.0, 1.0])),
    "beside a disc": (2, SQUARE, DISC),
    "in a hole": (2, HOLED, ({"sphere": {"centre": [0.5, 0.5], "radius": 0.4}}, [8, 8])),
    "in a corner": (2, HOLED, box([0.3, 0.3], [0.7, 0.7])),
    "behind a sector's end": (2, RING, box([0.9, -0.2], [1.1, 0.0])),
    # its end is a face of the box, and other parts of it lie on the box's far side
    "at a long sector's end": (2, LONG, box([0.5, -0.5], [1.1, 0.0])),
    "at its other end": (2, LONG, box([0.0, -1.1], [0.5, -0.9])),
    "within a sector": (2, RING, box([0.0, 0.0], [0.5, 0.5])),
    "behind a quarter": (3, ROD, box([-0.5, 0.0, 0.0], [0.0, 1.0, 1.0])),
    "around the rest of a quarter": (3, ROD, REST),
    "on a rod": (3, ROD, box([0.0, 0.0, 1.0], [1.0, 1.0, 2.0])),
    "in a pipe": (3, PIPE, box([0.0, -0.5, -0.5], [1.0, 0.5, 0.5])),
}
TOGETHER = {
    "the same box": (2, SQUARE, SQUARE),
    "by a little": (2, SQUARE, box([0.99, 0.0], [2.0, 1.0])),
    "one in the other": (3, CUBE, box([0.4, 0.4, 0.4], [0.6, 0.6, 0.6])),
    "a disc in a box": (2, SQUARE, ({"sphere": {"centre": [0.9, 0.5], "radius": 0.3}}, [8, 8])),
    "a box in a disc": (2, DISC, box([1.4, 0.4], [1.6, 0.6])),
    "over a hole": (2, HOLED, box([0.3, 0.3], [0.95, 0.7])),
    "in a sector": (2, RING, box([0.6, 0.6], [0.8, 0.8])),
    "in a rod": (3, ROD, box([0.1, 0.1, 0.1], [0.2, 0.2, 0.2])),
    "through a pipe": (3, PIPE, box([0.2, 0.9, -0.1], [0.8, 1.05, 0.1])),
}


@pytest.mark.parametrize("name", APART)
def test_neighbours_are_apart(comm, name):
    """They touch, which bonds alone allow."""
    dimension, one, other = APART[name]
    assert comm.allreduce(len(generate(scene(dimension, one, other), comm))) > 10
    with pytest.raises(SceneError) as caught:
        generate(scene(dimension, other, one, bond=False), comm)
    (fault,) = caught.value.faults
    assert (fault.code, fault.key) == ("touching", "bodies") and "'a' and 'b'" in fault.found


@pytest.mark.parametrize("name", TOGETHER)
def test_bodies_in_one_another_are_refused_with_their_names(comm, name):
    dimension, one, other = TOGETHER[name]
    for bodies in ((one, other), (other, one)):
        with pytest.raises(SceneError, match=r"^bodies.\d: .*('a'.*'b'|'b'.*'a')") as caught:
            generate(scene(dimension, *bodies), comm)
        assert len(set(comm.allgather(str(caught.value)))) == 1


def test_jitter_alone_is_no_overlap(comm):
    bodies = SQUARE, box([1.0, 0.0], [2.0, 1.0])
    generate(scene(2, *bodies, jitter=0.4, placement="cells"), comm)
    # cells cut by a surface are moved across it
    generate(scene(2, *APART["in a hole"][1:], jitter=0.45, placement="cells"), comm)
