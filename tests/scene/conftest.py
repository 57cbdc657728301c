"""Fixtures of small scenes, as tables to change at will."""

import copy

import pytest
from plain_tables import CUBE, MATERIAL, SQUARE

from parsolid.scene import parse_scene


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
