"""Weights that friction and ties share are exact for linear fields, or plain where neighbours do not span the space."""

import numpy as np
import pytest

from parsolid.contact.friction import linear_weights


def weights(places: np.ndarray, plain: np.ndarray, dimension: int) -> np.ndarray:
    """w_j [1 + b . (x_j - mean)] at the origin for plain weights (n,) of places (n, 3)."""
    plain = plain / plain.sum()
    mean = plain @ places
    upper = [float(plain @ (places[:, i] * places[:, j])) for i in range(3) for j in range(i, 3)]
    b = linear_weights(dimension, tuple(map(float, mean)), tuple(upper))
    return plain * (1.0 + (places - mean) @ np.array(b))


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_linear_fields_have_their_value(dimension):
    chance = np.random.default_rng(dimension)
    for _ in range(50):
        places = np.zeros((9, 3))
        places[:, :dimension] = chance.normal(size=(9, dimension)) + 0.7
        found = weights(places, chance.uniform(0.1, 1.0, 9), dimension)
        assert abs(found.sum() - 1.0) < 1e-12 and np.abs(found @ places).max() < 1e-10


@pytest.mark.parametrize("dimension", [2, 3])
def test_neighbours_in_a_row_have_plain_weights(dimension):
    places, plain = np.outer(np.arange(1.0, 6.0), [0.6, 0.8, 0.0]), np.full(5, 0.2)
    np.testing.assert_allclose(weights(places, plain, dimension), plain, rtol=1e-15)
