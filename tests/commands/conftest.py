"""Files of material points for all ranks."""

import pytest

from parsolid.point.schema import load_point


@pytest.fixture
def write(shared_path, comm):
    """Writes a file for all ranks; its path."""

    def make(text, name="path.toml"):
        path = shared_path / name
        if comm.rank == 0:
            path.write_text(text)
        comm.barrier()
        return path

    return make


@pytest.fixture
def point_of(write):
    """A point stated as TOML."""
    return lambda text: load_point(write(text))
