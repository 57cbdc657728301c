"""Fixtures of the tests of whole runs. Each starts its own ranks, so they run only where pytest itself is on one."""

from pathlib import Path

import pytest
from small_scenes import write

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.parent == HERE:
            item.add_marker(pytest.mark.mpi(ranks=[1]))


@pytest.fixture
def scene_file(tmp_path):
    """Writes a scene and gives its path."""

    def make(scene, name="scene"):
        return write(scene, tmp_path / f"{name}.toml")

    return make
