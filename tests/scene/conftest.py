"""Small scenes to test with, as plain tables."""

import copy

import pytest

from parsolid.scene import parse_scene

MATERIAL = {"kind": "mooney-rivlin", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.45}
SQUARE = {
    "dimension": 2,
    "end_time": 1.0,
    "method": {"kind": "tlsph"},
    "bodies": [
        {"shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 2.0]}}, "particles": [3, 5], "material": MATERIAL},
    ],
}
CUBE = {
    "dimension": 3,
    "end_time": 1.0,
    "method": {"kind": "tlsph"},
    "bodies": [
        {
            "name": "cube",
            "shape": {"box": {"lower": [0.0, 0.0, 0.0], "upper": [1.0, 2.0, 3.0]}},
            "particles": [3, 5, 7],
            "material": MATERIAL,
        },
    ],
}


@pytest.fixture
def square():
    """A rectangle of 3 x 5 particles, tables to change at will."""
    return copy.deepcopy(SQUARE)


@pytest.fixture
def cube():
    """A box of 3 x 5 x 7 particles, tables to change at will."""
    return copy.deepcopy(CUBE)


@pytest.fixture
def scene_of(square, cube):
    """A scene with one body of the given shape and filling, in 2-D or 3-D."""

    def make(dimension, shape, **filling):
        data = square if dimension == 2 else cube
        data["bodies"] = [{"shape": shape, "material": MATERIAL, **filling}]
        return parse_scene(data)

    return make
