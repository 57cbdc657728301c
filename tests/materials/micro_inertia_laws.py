"""The library's steel with micro-inertia, with and without what can be left out."""

import numpy as np
from pydantic import TypeAdapter

from parsolid.materials.plastic import micro_inertia_solve as solve
from parsolid.materials.plastic.micro_inertia import in_numbers
from parsolid.materials.registry import law_of
from parsolid.scene.materials import Material

LIBRARY = {"kind": "micro-inertia", "library": "4340 steel, Rahaman"}


def stated(changes):
    """The law of the library's table with changes."""
    return law_of(TypeAdapter(Material).validate_python(LIBRARY | changes))


# without gradients, which a material point has not
STEEL = stated(
    dict.fromkeys(("energetic_length", "hardening_length", "dissipative_length", "flux_relaxation_time"), 0.0)
)


def classical():
    """Without micro-inertia and relaxation."""
    return STEEL._replace(inertia_length=None, stress_relaxation_time=None)


def solved(law, increments, x):
    """(6, n) of `advance_micro` from (10, n) in the order of its rows, with increments of the law."""
    result = np.empty((6, x.shape[1]))
    for first in range(0, x.shape[1], solve.TILE):
        count = min(solve.TILE, x.shape[1] - first)
        tile = solve.new_tile()
        rows = tile.reshape(solve.ROWS, solve.TILE)
        rows[solve.DENSITY : solve.NEW_RATE, :count] = x[:, first : first + count]
        solve.advance_micro(in_numbers(law), increments, tile)
        result[:, first : first + count] = rows[solve.NEW_RATE : solve.LOST + 1, :count]
    return result


def advance(law, increments, *state):
    """The same of one particle, a tuple."""
    return tuple(solved(law, increments, np.array(state, float)[:, None])[:, 0].tolist())
