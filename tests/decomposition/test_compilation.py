"""The short way of compiling: what kernels give, what it costs and what it leaves of numba, and numba's way where it
fails.
"""

import gc
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit
from numba.core import compiler, ir, postproc, typeinfer, types
from numba.core.codegen import JITCodeLibrary
from numba.core.errors import TypingError
from numba.core.runtime import _nrt_python, rtsys
from numba.extending import register_jitable

from decomposition import compilation, kernel_cache, kernel_places
from decomposition.compiled import compiled

pytestmark = pytest.mark.skipif(kernel_cache.PLAIN, reason="kernels are compiled by numba as it is")


@pytest.fixture(autouse=True)
def _fresh(tmp_path, monkeypatch):
    """Nothing comes from files, and the list of those that fell back is this test's."""
    monkeypatch.setattr(kernel_places, "folder", lambda: tmp_path)
    monkeypatch.setattr(compilation, "FALLEN_BACK", [])


@register_jitable
def _root(x):
    if x < 0.0:
        raise ValueError("a root of what is negative")
    return np.sqrt(x)


@register_jitable
def _sum_of_roots(row):
    total = 0.0
    for k in range(len(row)):
        total += _root(row[k])
    return total


def _roots(table, result):
    for i in range(len(table)):
        result[i] = _sum_of_roots(table[i])


def test_only_the_kernel_is_optimised_and_assembled(monkeypatch):
    names, usual = [], JITCodeLibrary._finalize_specific
    monkeypatch.setattr(JITCodeLibrary, "_finalize_specific", lambda self: (names.append(self.name), usual(self))[1])
    table, result = np.arange(6.0).reshape(2, 3), np.zeros(2)
    compiled(_roots)(table, result)
    # that which all of numba's functions share comes with the first
    assembled = [name for name in names if name != "nrt"]
    assert np.array_equal(result, np.sqrt(table).sum(1)) and not compilation.FALLEN_BACK
    assert assembled == ["_roots"]


def test_an_error_two_calls_deep_is_raised_in_python():
    kernel = compiled(_roots)
    with pytest.raises(ValueError, match="a root of what is negative"):
        kernel(-np.ones((1, 2)), np.zeros(1))


def test_a_function_of_numbas_calls_what_a_kernel_has_compiled():
    table = np.ones((2, 3))
    compiled(_roots)(table, np.zeros(2))

    @njit
    def of_a_user(row):
        return 2.0 * _sum_of_roots(row)

    assert of_a_user(table[0]) == 6.0
    with pytest.raises(ValueError, match="negative"):
        of_a_user(-table[0])


def test_an_array_that_a_kernel_makes_is_freed():
    @compiled
    def made(n):
        return np.full(n, 2.0)

    @compiled
    def used(n):
        return made(n)[0] * len(made(n))

    assert used(4) == 8.0
    _nrt_python.memsys_enable_stats()
    gc.collect()
    before = rtsys.get_allocation_stats()
    for _ in range(100):
        used(4)
    after = rtsys.get_allocation_stats()
    assert after.alloc - before.alloc == after.free - before.free == 200
    # it could not have been foreseen from its names
    assert compilation.FALLEN_BACK == [f"{__name__}.used"]


def test_an_array_that_a_kernel_gives_back_is_the_one_and_kept():
    @compiled
    def parts(a):
        return a[1:], a

    @compiled
    def read_after(n):
        a, total = np.ones(n), 0.0
        for _ in range(3):
            tail, whole = parts(a)
            total += tail[0] + whole[0]
        # memory that was freed too early is taken here
        other = np.full(n, 7.0)
        return a[0] + total + 0.0 * other[0]

    assert read_after(3) == 7.0
    tail, whole = parts(np.arange(3.0))
    assert tail.tolist() == [1.0, 2.0] and whole.tolist() == [0.0, 1.0, 2.0]


class _Row(NamedTuple):
    values: np.ndarray


def test_a_helper_may_give_an_array_out_of_a_tuple():
    @register_jitable
    def values_of(row):
        return row.values

    @compiled
    def total(row):
        values, result = values_of(row), 0.0
        for k in range(len(values)):
            result += values[k]
        return result

    row = _Row(np.arange(4.0))
    counts = sys.getrefcount(row.values)
    assert total(row) == 6.0 and not compilation.FALLEN_BACK
    (text,) = total.inspect_llvm().values()
    assert "NRT_incref" not in text and "NRT_decref" not in text
    after = sys.getrefcount(row.values)
    assert after == counts


def test_an_array_that_a_helper_makes_is_freed():
    @register_jitable
    def made(row):
        return row.values + 1.0

    @compiled
    def used(row):
        return made(row)[1]

    row = _Row(np.arange(4.0))
    assert used(row) == 2.0 and compilation.FALLEN_BACK == [f"{__name__}.used"]
    _nrt_python.memsys_enable_stats()
    before = rtsys.get_allocation_stats()
    for _ in range(10):
        used(row)
    after = rtsys.get_allocation_stats()
    assert after.alloc - before.alloc == after.free - before.free >= 10


def test_helpers_of_kernels_within_one_that_counts_references_count_them():
    @register_jitable
    def first(a, b):
        return a

    @compiled
    def inner(a, b):
        return first(a, b)[0]

    @compiled
    def outer(n):
        return np.ones(n)[0] * inner(first(np.ones(n), np.ones(n)), np.ones(n))

    assert outer(3) == 1.0
    (text,) = inner.inspect_llvm().values()
    assert "NRT_decref" in text and not compilation.FALLEN_BACK


def test_functions_of_others_are_compiled_as_numba_does():
    @njit
    def squares(row):
        return np.array([x * x for x in row])[1:], row[1:]

    @njit
    def total(row):
        return sum([2.0 * x for x in np.sort(row)])

    @compiled
    def kernel(row):
        return total(row)

    @compiled
    def caller(row):
        return squares(row)[0][0]

    row = np.arange(3.0)
    assert kernel(row) == 6.0 and not compilation.FALLEN_BACK
    assert caller(row) == 1.0
    # Python may call them, too
    assert [part.tolist() for part in squares(row)] == [[1.0, 4.0], [1.0, 2.0]]


def test_kernels_that_make_no_arrays_count_no_references():
    table = np.ones((2, 3))
    kernel = compiled(_roots)
    kernel(table, np.zeros(2))
    (text,) = kernel.inspect_llvm().values()
    assert "NRT_incref" not in text and "NRT_decref" not in text
    counts = sys.getrefcount(table)
    for _ in range(10):
        kernel(table, np.zeros(2))
    assert sys.getrefcount(table) == counts


def test_what_the_short_way_does_not_know_numba_compiles():
    @compiled
    def listed(n):
        return sum([k * k for k in range(n)])

    assert listed(4) == 14 and compilation.FALLEN_BACK == [f"{__name__}.listed"]


@pytest.mark.parametrize("name", ["_shortened", "_refuse_owned_arrays", "economies", "KernelLibrary"])
def test_with_another_numba_inside_kernels_are_compiled_all_the_same(name, monkeypatch):
    def broken(*_):
        raise AttributeError("a part of numba that is not there")

    monkeypatch.setattr(compilation, name, broken)

    @compiled
    def kernel(x):
        return _root(x) + 1.0

    assert kernel(4.0) == 3.0 and compilation.FALLEN_BACK == [f"{__name__}.kernel"]


def test_numba_is_as_it_was_also_after_an_error():
    parts = ((compiler.Compiler, "define_pipelines"), (postproc.PostProcessor, "run"), (ir.Inst, "_rec_list_vars"))
    before = [getattr(*part) for part in parts]

    @compiled
    def wrong(x):
        return x.nothing

    with pytest.raises(TypingError, match="nothing"):
        wrong(1.0)
    assert [getattr(*part) for part in parts] == before
    compiled(_roots).compile((types.float64[:, ::1], types.float64[::1]))
    assert [getattr(*part) for part in parts] == before


def test_constraints_are_applied_again_only_where_a_type_has_changed(monkeypatch):
    applied, usual = [], typeinfer.CallConstraint.resolve

    def counted(self, *arguments, **named):
        applied.append(self)
        return usual(self, *arguments, **named)

    def halves(n):
        # first an integer, then a number with halves
        total = 0
        for k in range(n):
            total = total * 2 + 0.5 * k
        return total

    monkeypatch.setattr(typeinfer.CallConstraint, "resolve", counted)
    numbers = []
    for make in (njit, compiled):
        kernel = make(halves)
        applied.clear()
        assert kernel(4) == 5.5 and kernel.nopython_signatures[0].return_type == types.float64
        numbers.append(len(applied))
    assert 0 < numbers[1] < numbers[0]


def test_without_the_short_way_there_is_numbas():
    program = (
        "import sys\nsys.modules['decomposition.economies'] = None\n"
        "from decomposition import compiled as kernels, kernel_cache\nassert kernel_cache.PLAIN\n"
        "print(kernels.compiled(lambda x: 2.0 * x)(1.5))"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=Path(__file__).parents[2], text=True, capture_output=True, check=False
    )
    assert result.stdout == "3.0\n", result.stderr
