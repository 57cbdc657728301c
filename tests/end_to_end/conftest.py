"""Fixtures of the tests of whole runs. Each starts its own ranks, so they run only where pytest itself is on one."""

import pytest
from command_line import end_crews
from small_scenes import write


@pytest.fixture(scope="session", autouse=True)
def crews():
    """The ranks that run lists of commands are let go at the end."""
    yield
    end_crews()


@pytest.fixture
def scene_file(tmp_path):
    """Writes a scene and gives its path."""

    def make(scene, name="scene"):
        return write(scene, tmp_path / f"{name}.toml")

    return make
