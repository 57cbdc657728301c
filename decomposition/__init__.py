"""Domain decomposition for particles and points on many processors: MPI and geometry, no physics.

    partition    bisect: weighted recursive coordinate bisection in parallel
    migration    migrate: hand rows of arrays to their new owners
    neighbours   order_along_cells, half_pairs: cell-list search
    halo         Halo, Exchange: ghost layers, owner -> ghost and ghost -> owner
    grid         RankGrid, Mirror: cells owned by ranks, nodes shared between them, particles handed over by cell
    reduction    sums, ordered_sum, MinimumAhead

No rank ever holds all points. Every result has the same order, to the bit, for the same input on the same ranks.
The public names below are loaded when they are first used.
"""

from importlib import import_module
from typing import Any

_HOME = {
    "bisect": "partition",
    "migrate": "migration",
    "order_along_cells": "neighbours",
    "half_pairs": "neighbours",
    "Halo": "halo",
    "Exchange": "halo",
    "RankGrid": "grid",
    "Mirror": "occupied",
    "sums": "reduction",
    "ordered_sum": "reduction",
    "MinimumAhead": "reduction",
}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
