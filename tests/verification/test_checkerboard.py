"""The number that tells a checkerboard from a smooth field."""

import numpy as np
import pytest
from checkerboard import checkerboard_content


def lattice(*counts):
    return np.meshgrid(*(np.arange(count) for count in counts), indexing="ij")


def test_a_checkerboard_has_all_and_a_linear_field_nothing():
    i, j, k = lattice(9, 12, 3)
    assert checkerboard_content((-1.0) ** (i + j)) == pytest.approx(1.0, rel=1e-14)
    # the layers count for nothing, whatever happens across them
    assert checkerboard_content((-1.0) ** (i + j + k)) == pytest.approx(1.0, rel=1e-14)
    assert checkerboard_content(3.0 + 2.0 * i - j + 5.0 * k) < 1e-14
    assert checkerboard_content(np.zeros((9, 12))) == 0.0


def test_a_wave_has_the_product_of_its_sines():
    i, j = lattice(60, 40)
    values = np.exp(1j * (0.5 * i + 0.3 * j))
    expected = np.sin(0.25) ** 2 * np.sin(0.15) ** 2
    parts = [checkerboard_content(part) for part in (values.real, values.imag)]
    assert parts == pytest.approx([expected, expected], rel=0.01)


def test_stripes_are_alternation_along_one_direction_only():
    i, j = lattice(8, 9)
    stripes = (-1.0) ** i + 0.0 * j
    assert checkerboard_content(stripes, [0]) == pytest.approx(1.0)
    assert checkerboard_content(stripes) == 0.0


@pytest.mark.parametrize("shape, directions", [((3, 4), None), ((9, 2), [1])])
def test_too_few_points(shape, directions):
    with pytest.raises(ValueError, match="directions: expected at least one, of three points or more"):
        checkerboard_content(np.ones(shape), directions)
