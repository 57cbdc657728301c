"""Every operation on four lanes, against the same operation on numbers."""

import math

import numpy as np
import pytest

from decomposition.compiled import compiled
from parsolid.numerics import lanes as simd

_reverse = simd.swizzle(3, 2, 1, 0)
_mixed = simd.shuffle(4, 1, 7, 2)


@compiled
def arithmetic(values, result):
    x, y = simd.load(values, 0, 0), simd.load(values, 1, 0)
    simd.store(result, 0, 0, x + y)
    simd.store(result, 1, 0, x - y)
    simd.store(result, 2, 0, x * y)
    simd.store(result, 3, 0, x / y)
    simd.store(result, 4, 0, -x)
    simd.store(result, 5, 0, math.sqrt(x))
    simd.store(result, 6, 0, simd.fused(x, y, 2.0))
    simd.store(result, 7, 0, 3 - x)
    simd.store(result, 8, 0, x * 0.5 + 1)
    simd.store(result, 9, 0, 1.0 / x)
    simd.store(result, 10, 0, min(x, y))
    simd.store(result, 11, 0, max(x, 1.0))


@compiled
def lanes_moved(values, result):
    x, y, z, w = simd.load(values, 0, 0), simd.load(values, 1, 0), simd.load(values, 2, 0), simd.load(values, 3, 0)
    simd.store(result, 0, 0, _reverse(x))
    simd.store(result, 1, 0, simd.without_fourth(x))
    simd.store(result, 2, 0, simd.horizontal_sums(x, y, z, w))
    simd.store(result, 3, 0, simd.broadcast(simd.lane(x, 2)))
    simd.store(result, 4, 0, simd.from_floats(1.0, 2.0, 3.0, 4.0))
    columns = simd.transpose(x, y, z, w)
    for k in range(4):
        simd.store(result, 5 + k, 0, columns[k])
    simd.store(result, 9, 0, simd.broadcast(simd.total(x)))
    simd.store(result, 10, 0, _mixed(x, y))


@compiled
def partly_stored(values, result, count):
    simd.store_first(result, 0, 1, simd.load(values, 0, 0), count)


@compiled
def positive(values):
    return simd.all_positive(simd.load(values, 0, 0))


@pytest.fixture
def values():
    return np.random.default_rng(1).uniform(0.5, 2.0, (4, 4))


def test_arithmetic(values):
    result = np.zeros((12, 4))
    arithmetic(values, result)
    x, y = values[0], values[1]
    exact = [x + y, x - y, x * y, x / y, -x, np.sqrt(x)]
    np.testing.assert_array_equal(result[:6], exact)
    np.testing.assert_allclose(result[6:10], [x * y + 2.0, 3 - x, x * 0.5 + 1, 1.0 / x], rtol=1e-15)
    np.testing.assert_array_equal(result[10:], [np.minimum(x, y), np.maximum(x, 1.0)])


def test_moving_lanes(values):
    result = np.zeros((11, 4))
    lanes_moved(values, result)
    np.testing.assert_array_equal(result[0], values[0, ::-1])
    np.testing.assert_array_equal(result[1], [*values[0, :3], 0.0])
    np.testing.assert_allclose(result[2], values.sum(axis=1), rtol=1e-15)
    np.testing.assert_array_equal(result[3], values[0, 2])
    np.testing.assert_array_equal(result[4], [1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(result[5:9], values.T)
    np.testing.assert_allclose(result[9], values[0].sum(), rtol=1e-15)
    np.testing.assert_array_equal(result[10], [values[1, 0], values[0, 1], values[1, 3], values[0, 2]])


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4])
def test_a_partial_store_leaves_the_rest_alone(values, count):
    result = np.full((2, 6), 7.0)
    partly_stored(values, result, count)
    wanted = np.full((2, 6), 7.0)
    wanted[0, 1 : 1 + count] = values[0, :count]
    np.testing.assert_array_equal(result, wanted)


@pytest.mark.parametrize("bad", [0.0, -1.0, -0.0, math.nan])
@pytest.mark.parametrize("place", [0, 3])
def test_all_positive_sees_every_lane(values, bad, place):
    assert positive(values)
    values[0, place] = bad
    assert not positive(values)


@pytest.mark.parametrize("shape", [(5, 8), (19, 12), (3,)])
def test_aligned_arrays_begin_on_cache_lines(shape):
    array = simd.aligned_zeros(shape)
    assert array.shape == shape and array.ctypes.data % 64 == 0 and not array.any() and array.flags.c_contiguous


def test_padding_is_to_whole_lanes():
    assert [simd.padded(n) for n in (0, 1, 4, 5)] == [0, 4, 4, 8]
