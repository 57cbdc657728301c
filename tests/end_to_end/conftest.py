"""Fixtures of the tests of whole runs. Each starts its own ranks, so they run only where pytest itself is on one."""

import pytest
from command_line import end_crews


@pytest.fixture(scope="session", autouse=True)
def crews():
    """The ranks that run lists of commands are let go at the end."""
    yield
    end_crews()
