"""Fixtures of the output tests; they run on any number of ranks: mpirun -n 3 python -m pytest tests/output."""

import numpy as np
import pytest


@pytest.fixture
def pieces(comm):
    """(total, first, last): uneven contiguous shares of particles; rank 0 has none when there are several."""
    total = 23
    cuts = [0] + [total * rank // max(comm.size - 1, 1) for rank in range(comm.size)] + [total]
    cuts = [*cuts[: comm.size], total]
    return total, cuts[comm.rank], cuts[comm.rank + 1]


@pytest.fixture
def fields(pieces):
    """Arrays of all kinds and strides whose values depend on the particle only."""
    _, first, last = pieces
    number = np.arange(first, last)
    wide = np.empty((6, len(number) + 5))
    wide[:, : len(number)] = number * np.pi + np.arange(6)[:, np.newaxis]
    padded = np.sqrt(number[:, np.newaxis] + np.arange(4.0))
    return {
        "identifier": number.astype(np.int64),
        "body": (number % 3).astype(np.int32),
        "broken": (number % 2).astype(np.uint8),
        "momentum": wide.T[: len(number)],
        "position": padded[:, :3],
        "jacobian": 1.0 / (1.0 + number),
    }
