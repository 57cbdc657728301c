"""Kernels from files: a call needs their machine code alone, the compilation of a caller what stands behind it."""

import gc
import os
import time

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

from decomposition import kernel_cache, kernel_places, loaded_kernels
from decomposition.compiled import compiled
from decomposition.loaded_kernels import LoadedKernel


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch):
    """The folder of a test's kernels."""
    monkeypatch.setattr(kernel_places, "folder", lambda: tmp_path)
    return tmp_path


def _total(row):
    total = 0.0
    for k in range(len(row)):
        if row[k] < 0.0:
            raise ValueError("a part is negative")
        total += row[k]
    return total


def _made(n):
    return np.full(n, 2.0), n


def loaded(function, *arguments):
    """A kernel of a function that was called once before, by another dispatcher, and is in a file since."""
    compiled(function)(*arguments)
    kernel = compiled(function)
    kernel(*arguments)
    (found,) = kernel.overloads.values()
    assert isinstance(found, LoadedKernel) and sum(kernel.stats.cache_hits.values()) == 1
    return kernel, found


def test_a_call_reads_the_machine_code_alone_and_raises_what_it_raised():
    kernel, found = loaded(_total, np.arange(3.0))
    assert kernel(np.arange(4.0)) == 6.0 and "_result" not in vars(found)
    with pytest.raises(ValueError, match="a part is negative"):
        kernel(-np.ones(2))


@pytest.mark.parametrize("there", [True, False])
def test_a_caller_is_compiled_with_a_loaded_kernel_also_when_its_file_is_gone(there, files):
    kernel, found = loaded(_total, np.arange(3.0))
    for path in () if there else files.glob("*.kernel"):
        path.unlink()

    @compiled
    def doubled(row):
        return 2.0 * kernel(row)

    assert doubled(np.arange(4.0)) == 12.0 and found.signature.return_type.name == "float64"
    with pytest.raises(ValueError, match="a part is negative"):
        doubled(-np.ones(2))


def test_arrays_that_a_loaded_kernel_makes_are_freed():
    kernel, _ = loaded(_made, 3)
    rtsys.initialize(kernel.targetctx)
    _nrt_python.memsys_enable_stats()
    gc.collect()
    before = rtsys.get_allocation_stats()
    for _ in range(50):
        values, number = kernel(4)
        assert values.tolist() == [2.0] * 4 and number == 4
    del values
    after = rtsys.get_allocation_stats()
    assert after.alloc - before.alloc == after.free - before.free == 50


@pytest.mark.parametrize("name", ["_dynfunc", "_counts_references"])
def test_with_another_numba_inside_kernels_are_compiled_each_time(name, monkeypatch):
    monkeypatch.setattr(loaded_kernels, name, None)
    for _ in range(2):
        kernel = compiled(_total)
        assert kernel(np.arange(3.0)) == 3.0 and not kernel.stats.cache_hits


@pytest.mark.parametrize("cut", [1, 10_000, -40])
def test_a_file_that_is_cut_off_is_as_good_as_none(cut, files):
    kernel = compiled(_total)
    kernel(np.arange(3.0))
    (path,) = files.glob("*.kernel")
    content = path.read_bytes()
    path.write_bytes(content[:cut])
    again = compiled(_total)
    assert again(np.arange(3.0)) == 3.0 and not again.stats.cache_hits
    assert len(path.read_bytes()) == len(content)


def test_what_a_killed_writer_has_left_is_removed_after_a_day(files):
    for name, days in ((".new-old", 2.0), (".new-now", 0.0), ("used.kernel", 2.0)):
        (files / name).touch()
        os.utime(files / name, (time.time() - 86400.0 * days,) * 2)
    kernel_cache._forget_unused.__wrapped__(files)
    assert sorted(path.name for path in files.iterdir()) == [".new-now", "used.kernel"]
