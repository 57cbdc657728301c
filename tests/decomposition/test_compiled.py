"""The files of compiled kernels: one process compiles, others wait for it; what was edited is compiled anew, and
nothing else.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from numba.extending import register_jitable

from decomposition.compiled import compiled

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
# two modules of a user: the kernel calls what the other one holds
CALLEE = "from decomposition.compiled import compiled\n\n\n@compiled\ndef twice(x):\n    return {factor} * x\n"
KERNEL = """import sys
from decomposition.compiled import compiled
from callee import twice


@compiled
def kernel(x):
    return twice(x) + 1.0


@compiled
def lonely(x):
    return x - 1.0
"""
SHOW = """import sys, time
import kernels
from decomposition.compiled import LISTENERS
compiled = []
LISTENERS.append(compiled.append)
if len(sys.argv) > 1:
    time.sleep(max(0.0, float(sys.argv[1]) - time.time()))
value = kernels.kernel(2.0)
print(value, int("kernel" not in compiled))
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with the two modules and a program that calls the kernel."""
    (tmp_path / "callee.py").write_text(CALLEE.format(factor="2.0"))
    (tmp_path / "kernels.py").write_text(KERNEL)
    (tmp_path / "show.py").write_text(SHOW)
    return tmp_path


def start(folder, *words):
    values = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(ROOT)}
    # edits within a second of each other would be taken from the same bytecode
    values["PYTHONDONTWRITEBYTECODE"] = "1"
    command = [sys.executable, *map(str, words)]
    return subprocess.Popen(command, cwd=folder, env=values, text=True, stdout=subprocess.PIPE)


def shown(job) -> tuple[float, int]:
    """The kernel's value, and whether it came from a file."""
    out, _ = job.communicate(timeout=120)
    assert job.returncode == 0
    value, hits = out.split()
    return float(value), int(hits)


def test_two_processes_at_once_compile_once(folder):
    at_once = time.time() + 5.0
    results = [shown(job) for job in [start(folder, "show.py", at_once) for _ in range(2)]]
    assert sorted(results) == [(5.0, 0), (5.0, 1)]


def test_a_killed_process_keeps_nobody_waiting(folder):
    hold = "import time, kernels, callee; from decomposition import kernel_cache as c\n"
    hold += "c._PATIENCE = 1e9; take = c._reserve; "
    hold += "c._reserve = lambda path: (take(path), print('has it', flush=True), time.sleep(1e9))\n"
    hold += "kernels.kernel(2.0)"
    (folder / "hold.py").write_text(hold)
    holder = start(folder, "hold.py")
    assert holder.stdout.readline().strip() == "has it"
    waiting = start(folder, "show.py")
    time.sleep(4.0)
    assert waiting.poll() is None, "expected it to wait for the process that has the kernel"
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert shown(waiting) == (5.0, 0)


def test_a_failed_compilation_frees_the_kernel(folder):
    fail = "import kernels, numba\nfrom decomposition import kernel_cache as c\n"
    fail += "try:\n    kernels.kernel('text')\nexcept numba.TypingError:\n    print(len(c._RESERVED), 0)"
    (folder / "fail.py").write_text(fail)
    assert shown(start(folder, "fail.py")) == (0.0, 0)


def test_an_edited_callee_is_compiled_into_its_caller(folder):
    assert shown(start(folder, "show.py")) == (5.0, 0)
    assert shown(start(folder, "show.py")) == (5.0, 1)
    (folder / "callee.py").write_text(CALLEE.format(factor="3.0"))
    assert shown(start(folder, "show.py")) == (7.0, 0)
    # back again: the old file is still right
    (folder / "callee.py").write_text(CALLEE.format(factor="2.0"))
    assert shown(start(folder, "show.py")) == (5.0, 1)


def test_an_edit_of_another_module_compiles_nothing(folder):
    (folder / "other.py").write_text("number = 1\n")
    assert shown(start(folder, "show.py")) == (5.0, 0)
    (folder / "other.py").write_text("number = 2\n")
    assert shown(start(folder, "show.py")) == (5.0, 1)


def test_a_damaged_file_is_compiled_anew(folder):
    assert shown(start(folder, "show.py")) == (5.0, 0)
    for path in (folder / "cache").glob("kernels.kernel-*"):
        path.write_bytes(path.read_bytes()[:-10])
    assert shown(start(folder, "show.py")) == (5.0, 0)
    assert shown(start(folder, "show.py")) == (5.0, 1)


def test_a_folder_that_cannot_be_written_costs_time_only(folder):
    (folder / "cache").write_text("a file where the folder should be")
    value, _ = shown(start(folder, "show.py"))
    assert value == 5.0


def test_who_listens_is_told_what_is_compiled_and_not_what_is_loaded(folder):
    program = (
        "from decomposition.compiled import LISTENERS\nLISTENERS.append(print)\nimport kernels\nkernels.kernel(2.0)\n"
    )
    (folder / "listen.py").write_text(program)
    told = [start(folder, "listen.py").communicate(timeout=120)[0].split() for _ in range(2)]
    assert told == [["kernel", "twice"], []]


@register_jitable
def thrice(x):
    """What a kernel calls."""
    return 3.0 * x


@compiled
def sixfold(x):
    """A kernel."""
    return 2.0 * thrice(x)


def test_no_entry_points_for_c_are_compiled():
    # nothing can be looked at in what comes from a file
    sixfold._cache.disable()
    assert sixfold(2.0) == 12.0
    assert "cfunc" not in next(iter(sixfold.inspect_llvm().values()))
