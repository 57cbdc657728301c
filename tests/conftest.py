"""Tests on any number of ranks: `pytest`, or `mpirun -n 3 python -m pytest`; a failure on one rank is one on all.

On one rank all tests run, on several those with the mark `mpi`, which all tests have that take a fixture of all ranks,
`comm` or `shared_path`, but those with the mark `serial`; on three ranks only those of rooms that make or compare what
ranks exchange, and those that ask for three. All ranks run their tests in step. After each phase of a test they tell
each other how it went, so that a test that fails on one rank fails on all, and rank 0 reports it. A rank that fails
while the others wait for it inside the test would leave them waiting for ever; then, after a grace, it shows its
failure and ends the whole job.
"""

import faulthandler
import importlib
import os
import pkgutil
import shutil
import sys
import time
import zlib
from collections import Counter
from functools import cache
from pathlib import Path
from types import FunctionType

import pytest

# ranks that wait give the processor away, for there are often more of them than processors; before MPI starts (MPICH)
os.environ.setdefault("MPIR_CVAR_CH4_PROGRESS_THROTTLE", "1")
os.environ.setdefault("MPIR_CVAR_CH4_PROGRESS_THROTTLE_NO_PROGRESS_COUNT", "256")
# files of tests in memory where there is room: runs make sure that theirs are on the disk, which all ranks wait for
if os.path.isdir("/dev/shm") and shutil.disk_usage("/dev/shm").free > 4e9:
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", "/dev/shm")

from mpi4py import MPI

# before numpy, which most tests import first: no threads for linear algebra, which spin beside other tests
import parsolid

import numpy as np  # isort: skip
from numba.extending import is_jitted  # isort: skip

from parsolid.tiles import TILE as WHOLE_TILE  # isort: skip

WORLD = MPI.COMM_WORLD
# a rank that failed waits this long for the others, and every phase of a test may take that long, in seconds
GRACE, LONGEST = 60.0, 600.0
_PASSED, _SKIPPED, _FAILED = range(3)
# names of the number of particles in a tile
_TILES = ("TILE", "PART")
# of several ranks: a communicator of their own for the talk about tests, and the error stream before pytest takes it
_talk, _errors = None, None


def _agree(mine: int, name: str, text: str, patience: float) -> np.ndarray:
    """Every rank's number; ends the job, showing the text, when the others do not come."""
    everyone = np.zeros(_talk.size, np.int64)
    request = _talk.Iallgather(np.array([mine]), everyone)
    end = time.monotonic() + patience
    while not request.Test():
        if time.monotonic() > end:
            _abort(f"{name}: rank {_talk.rank} waited {patience:.0f} s in vain for the others\n{text}")
        time.sleep(2e-4)
    return everyone


def _abort(message: str) -> None:
    print(f"\n{message}\n", file=_errors, flush=True)
    WORLD.Abort(1)


def pytest_addoption(parser):
    parser.addoption("--long", action="store_true", help="also run tests that take minutes, and all on 3 ranks")


_MARKERS = (
    "mpi: ranks talk to each other; runs on any number of them (set for all tests that use comm or shared_path)",
    "serial: runs on one rank only, for no rank talks to another in what it checks",
    "ranks(*numbers): runs on these numbers of ranks only",
    "slow: about a second of the processor or more with warm kernels; the fast set is -m 'not slow'",
    "verification: against exact solutions, other codes or published results (set in verification and exact)",
    "long: takes minutes; runs only with --long",
)


@pytest.hookimpl(trylast=True)
def pytest_configure(config):
    global _talk, _errors
    if WORLD.size > 1:
        # not before: while conftest is imported, pytest captures the error stream
        _talk, _errors = WORLD.Dup(), os.fdopen(os.dup(2), "w")
    for marker in _MARKERS:
        config.addinivalue_line("markers", marker)
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if WORLD.rank > 0 and reporter is not None:
        # rank 0 reports for all
        reporter._tw._file = open(os.devnull, "w")
    if hasattr(config.option, "loadscopereorder"):
        # workers take files in the order of `_in_turn`
        config.option.loadscopereorder = False


# rooms of which every test compares with a solution from elsewhere, and those that start whole runs
_VERIFYING, _SLOW = ("verification", "exact"), ("verification", "end_to_end")
# rooms that run on three ranks as well
_ON_THREE = ("contracts", "decomposition", "output", "pairs")
# files of many rooms first, then those that take long, and short ones last, so that all workers end together
_LATER = {"docs": 1, "end_to_end": 1, "decomposition": 2, "kernels": 2, "scene": 2}
# after the scenes that compile its kernels: at the same time both workers would compile them
_LATER_FILES = {"test_restarts.py": 1}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Mark what communicates and what verifies; leave out what is for another number of ranks, or long."""
    if hasattr(config, "workerinput"):
        _in_turn(items)
    for item in items:
        ranks = item.get_closest_marker("ranks")
        if ranks is not None and item.get_closest_marker("serial") and ranks.args != (1,):
            raise pytest.UsageError(f"{item.nodeid}: expected one of the marks 'ranks' and 'serial', found both")
        if {"comm", "shared_path"} & set(item.fixturenames) and not item.get_closest_marker("serial"):
            item.add_marker(pytest.mark.mpi)
        room = _room(item)
        if room in _VERIFYING:
            item.add_marker(pytest.mark.verification)
        if room in _SLOW or item.get_closest_marker("long"):
            item.add_marker(pytest.mark.slow)
    left = [item for item in items if not _runs(config, item)]
    if left:
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if item not in set(left)]


def _room(item) -> str:
    return item.path.relative_to(Path(__file__).parent).parts[0]


def _in_turn(items) -> None:
    """Sort tests by file, of each kind those with most tests first."""
    count = Counter(item.path for item in items)

    def turn(item) -> int:
        return _LATER_FILES.get(item.path.name, _LATER.get(_room(item), 0))

    items.sort(key=lambda item: (turn(item), -count[item.path], item.path))


def _runs(config, item) -> bool:
    ranks = item.get_closest_marker("ranks")
    if item.get_closest_marker("long") and not config.getoption("long"):
        return False
    if ranks is not None:
        return WORLD.size in ranks.args
    if WORLD.size == 3 and _room(item) not in _ON_THREE and not config.getoption("long"):
        return False
    return WORLD.size == 1 or item.get_closest_marker("mpi") is not None


def pytest_collection_finish(session):
    if _talk is None:
        return
    found = zlib.crc32("\n".join(item.nodeid for item in session.items).encode())
    everyone = _agree(found, "collection", "", GRACE)
    if len(set(everyone.tolist())) > 1:
        _abort(f"collection: rank {WORLD.rank} found {len(session.items)} tests, not the same as the others")


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    if _talk is not None:
        # all ranks waiting for each other: show where, and end the job
        faulthandler.dump_traceback_later(LONGEST, exit=True, file=_errors)
    try:
        return (yield)
    finally:
        if _talk is not None:
            faulthandler.cancel_dump_traceback_later()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if _talk is None:
        return report
    mine = _FAILED if report.failed else _SKIPPED if report.skipped else _PASSED
    name = f"{item.nodeid} ({report.when})"
    everyone = _agree(mine, name, report.longreprtext, GRACE if mine == _FAILED else LONGEST)
    if len(set(everyone.tolist())) == 1 and mine != _FAILED:
        return report
    texts = _talk.allgather(report.longreprtext if report.failed else None)
    words = ("passed", "skipped", "failed")
    summary = [f"rank {rank} {words[outcome]}" for rank, outcome in enumerate(everyone)]
    parts = [f"--- rank {rank} ---\n{text}" for rank, text in enumerate(texts) if text]
    report.outcome = "failed"
    report.longrepr = "\n".join([", ".join(summary), *parts])
    return report


@pytest.fixture(scope="session")
def comm():
    """All ranks of this run, one when it was not started by mpirun."""
    return WORLD


def _names():
    """(module, name, value) of all names in modules of this package and of its tests."""
    tests = str(Path(__file__).parent)
    for name, module in list(sys.modules.items()):
        ours = name.partition(".")[0] in ("decomposition", "parsolid")
        if ours or str(getattr(module, "__file__", None)).startswith(tests):
            yield from ((module, key, it) for key, it in list(vars(module).items()))


@cache
def _import_kernels() -> None:
    for folder in ("boundary", "contact", "materials", "methods", "pairs", "solvers"):
        place = Path(parsolid.__file__).parent / folder
        for module in pkgutil.walk_packages([str(place)], f"parsolid.{folder}."):
            importlib.import_module(module.name)


@pytest.fixture
def plain_python():
    """Kernels are the Python functions that they were made of, with tiles of one particle: nothing is compiled for laws
    that one test alone has."""
    kernels, changed = {}, []
    _import_kernels()
    for module, key, it in _names():
        if is_jitted(it):
            changed.append((module, key, it))
            setattr(module, key, it.py_func)
            # others are made of functions that kernels take as they are
            if (module.__name__, key) == (it.py_func.__module__, it.py_func.__name__):
                kernels[it.py_func] = it
        elif key in _TILES and it == WHOLE_TILE:
            changed.append((module, key, it))
            setattr(module, key, 1)
    known = set(sys.modules)
    yield
    for module, key, it in changed:
        setattr(module, key, it)
    # modules that the test was the first to import
    for module, key, it in _names():
        if module.__name__ not in known:
            if key in _TILES and it == 1:
                setattr(module, key, WHOLE_TILE)
            elif isinstance(it, FunctionType) and it in kernels:
                setattr(module, key, kernels[it])


@pytest.fixture
def shared_path(tmp_path):
    """A fresh folder that is the same on all ranks, unlike tmp_path."""
    return Path(WORLD.bcast(str(tmp_path)))
