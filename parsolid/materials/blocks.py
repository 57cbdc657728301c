"""Bodies grouped by material: each block of a rank's particles is a contiguous range that shares one law."""

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass
class MaterialBlock:
    """Particles first..last-1 with one law."""

    first: int
    last: int
    law: Any


def material_blocks(laws: list[Any], body: np.ndarray) -> tuple[list[MaterialBlock], np.ndarray]:
    """Groups of particles (n,) sorted by law, and their densities (n,) [kg/m^3], from one law a body."""
    distinct, number = block_numbers(laws, body)
    bounds = np.searchsorted(number, np.arange(len(distinct) + 1))
    return blocks_between(bounds, distinct), np.array([law.density for law in laws])[body]


def block_numbers(laws: list[Any], body: np.ndarray) -> tuple[list[Any], np.ndarray]:
    """Distinct laws in order of appearance, and each particle's index (n,) into them, from one law a body."""
    distinct = list(dict.fromkeys(laws))
    number = np.array([distinct.index(law) for law in laws], np.int64)
    return distinct, number[body]


def blocks_between(bounds: np.ndarray, laws: list[Any]) -> list[MaterialBlock]:
    """Particles that share a law, law after law; law g has rows bounds[g] .. bounds[g + 1] - 1, maybe none."""
    ends = bounds.tolist()
    return [MaterialBlock(first, last, law) for first, last, law in zip(ends, ends[1:], laws) if last > first]
