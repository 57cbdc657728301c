"""Weibull's spread of strength, drawn from a particle's identifier alone: the same on any ranks and after a restart."""

import math
from typing import Any

import numpy as np

from parsolid.materials.failure.failure import Scatter

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)


def strengths(scatter: Scatter, identifier: np.ndarray) -> np.ndarray:
    """Factors (n,) of mean 1 with the distribution 1 - exp(-(Gamma(1 + 1/m) x)^m) of particles' identifiers (n,)."""
    with np.errstate(over="ignore"):
        # Steele, Lea & Flood 2014, SplitMix64, twice: the seed spreads before the particle is added
        start = _mixed(np.uint64(scatter.seed) * _GOLDEN + _GOLDEN)
        bits = _mixed(start + (identifier.astype(np.uint64) + np.uint64(1)) * _GOLDEN)
    uniform = ((bits >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
    return np.asarray((-np.log1p(-uniform)) ** (1.0 / scatter.modulus) / math.gamma(1.0 + 1.0 / scatter.modulus))


def _mixed(z: Any) -> Any:
    z = (z ^ (z >> np.uint64(30))) * _FIRST
    z = (z ^ (z >> np.uint64(27))) * _SECOND
    return np.asarray(z ^ (z >> np.uint64(31)))
