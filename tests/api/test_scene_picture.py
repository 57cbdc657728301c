"""The picture of a scene before it is run: what it shows, the same on any number of ranks, and the file."""

import numpy as np
import pytest
from PIL import Image

import parsolid
from parsolid.api.picture_data import picture_data
from parsolid.api.scene_picture import draw_scene
from parsolid.scene import SceneError, parse_scene

SOFT = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}


def tables(dimension: int = 2, **more) -> dict:
    """Three cubes of 4 cells along each side: two bonded, pulled on the far side, and one on its way to them."""
    bodies = []
    for name, lower, speed in (("left", 0.0, 0.0), ("right", 1.0, 0.0), ("shot", 3.0, -2.0)):
        box = {"lower": [lower] + [0.0] * (dimension - 1), "upper": [lower + 1.0] + [1.0] * (dimension - 1)}
        body = {"name": name, "shape": {"box": box}, "spacing": 0.25, "placement": "cells", "material": SOFT}
        bodies.append(body | {"velocity": [speed] + [0.0] * (dimension - 1)})
    pull = ["-2*t", "0", "0"][:dimension]
    return {
        "dimension": dimension,
        "end_time": 1.0,
        "method": {"kind": "tlsph"},
        "bodies": bodies,
        "regions": [{"name": "corner", "shape": {"box": {"lower": [0.0] * dimension, "upper": [0.2] * dimension}}}],
        "boundaries": [
            {"kind": "traction", "plane": "X = 0", "traction": pull, "body": "left"},
            {"kind": "fixed", "where": "corner", "mirror": False},
        ],
        "bond": [{"bodies": ["left", "right"]}],
        "contact": [{"bodies": ["right", "shot"]}],
    } | more


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_is_drawn_is_what_the_scene_states(comm, dimension):
    data = picture_data(comm, parse_scene(tables(dimension)))
    if comm.rank > 0:
        assert data is None
        return
    a_face = 4 ** (dimension - 1)
    assert len(data.position) == 3 * 4 * a_face
    assert np.array_equal(data.velocity[:, 0], [0.0, 0.0, -2.0]) and not data.velocity[:, 1:].any()
    marks = {one.kind: one for one in data.marks}
    assert [one.kind for one in data.marks] == ["region", "load", "support", "contact", "bond"]
    assert len(marks["region"].rows) == 1 and np.array_equal(marks["support"].rows, marks["region"].rows)
    load = marks["load"]
    assert len(load.rows) == a_face and (data.position[load.rows, 0] == 0.125).all()
    expected = np.zeros((a_face, dimension))
    expected[:, 0] = -1.0
    np.testing.assert_array_equal(load.arrows, expected)
    assert len(marks["contact"].rows) == 0 and "apart" in marks["contact"].label
    bonded = data.position[marks["bond"].rows, 0]
    assert set(bonded) == {0.875, 1.125}
    assert data.outer.sum() == len(data.position) - 3 * 2**dimension


def test_a_picture_has_the_colours_of_what_it_shows(shared_path, comm):
    for dimension in (2, 3):
        path = shared_path / "new" / f"{dimension}.png"
        draw_scene(comm, parse_scene(tables(dimension)), path)
        comm.Barrier()
        seen = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3).astype(int)
        assert len(seen) > 200_000
        red = (seen[:, 0] > 150) & (seen[:, 1:] < 80).all(axis=1)
        green = (seen[:, 1] > seen[:, 0] + 25) & (seen[:, 1] > seen[:, 2] + 25)
        assert red.sum() > 200 and green.sum() > 200


def test_other_files_are_refused(tmp_path):
    for name in ("scene.docx", "scene"):
        with pytest.raises(SceneError, match="^picture: "):
            parsolid.check(tables(), picture=tmp_path / name)
    (tmp_path / "file").write_text("")
    with pytest.raises(SceneError, match="^picture: "):
        parsolid.check(tables(), picture=tmp_path / "file" / "scene.png")
