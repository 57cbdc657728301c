"""numba's cache in a folder of this package's: what is compiled anew, what is found, and whose folder is used."""

import os
import shutil
import stat
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

import pytest

from parsolid import kernel_cache
from parsolid.kernel_cache import cache_folder, wanted_folder

ROOT = Path(__file__).parents[2]
LIBRARY = """
from parsolid.callee import factor
from parsolid.kernels import kernel

@kernel
def scaled(x):
    return factor(x)

@kernel
def other(x):
    return x
"""
PROGRAM = """
import parsolid.caller as caller
from parsolid.kernels import on_compile
compiled = []
with on_compile(compiled.append):
    results = [caller.scaled(x) for x in {arguments}]
print(*results, *compiled)
"""
CALLEE = "from numba import njit\n\n@njit\ndef factor(x):\n    return {factor} * x\n"


@pytest.fixture
def package(tmp_path):
    """A package of this name with two modules, the kernel in one calling the other."""
    (tmp_path / "parsolid").mkdir()
    (tmp_path / "decomposition").mkdir()
    (tmp_path / "parsolid" / "__init__.py").touch()
    for name in ("kernels", "kernel_cache"):
        shutil.copy(ROOT / "parsolid" / f"{name}.py", tmp_path / "parsolid")
    (tmp_path / "parsolid" / "caller.py").write_text(LIBRARY)
    (tmp_path / "parsolid" / "callee.py").write_text(CALLEE.format(factor=2))
    return tmp_path


def start(package, program):
    """A process that runs a program with the package and a cache of its own."""
    variables = os.environ | {"PYTHONPATH": str(package), "XDG_CACHE_HOME": str(package / "cache")}
    variables.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", program]
    return subprocess.Popen(command, env=variables, cwd=package, stdout=subprocess.PIPE, text=True)


def words(process):
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    return out.split()


def test_an_edited_callee_is_compiled_anew_and_an_undone_edit_is_found(package):
    program = PROGRAM.format(arguments="[3.0]")
    callee = package / "parsolid" / "callee.py"
    assert words(start(package, program)) == ["6.0", "scaled"]
    assert words(start(package, program)) == ["6.0"]
    callee.write_text(CALLEE.format(factor=5))
    assert words(start(package, program)) == ["15.0", "scaled"]
    callee.write_text(CALLEE.format(factor=2))
    assert words(start(package, program)) == ["6.0"]


def test_a_copy_elsewhere_finds_what_the_first_has_compiled(package):
    program = PROGRAM.format(arguments="[3.0]")
    words(start(package, program))
    copy = package / "copy"
    for name in ("parsolid", "decomposition"):
        shutil.copytree(package / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(package / "cache", copy / "cache")
    assert words(start(copy, program)) == ["6.0"]


def test_processes_that_compile_at_once_lose_nothing_and_mix_up_nothing(package):
    arguments = ["[3]", "[3.0]", "[True]", "[2j]"]
    processes = [start(package, PROGRAM.format(arguments=each)) for each in arguments * 2]
    expected = ["6", "6.0", "2", "4j"] * 2
    assert [words(process)[0] for process in processes] == expected
    assert words(start(package, PROGRAM.format(arguments="[3, 3.0, True, 2j]"))) == expected[:4]


def test_an_index_that_cannot_be_read_is_made_anew_and_no_other(package):
    program = PROGRAM.format(arguments="[3.0]")
    other = program.replace("scaled", "other")
    words(start(package, other + program))
    for index in (package / "cache").rglob("caller.scaled-*.nbi"):
        index.write_bytes(index.read_bytes()[:-8])
    assert words(start(package, program)) == ["6.0", "scaled"]
    assert words(start(package, program)) == ["6.0"]
    assert words(start(package, other)) == ["3.0"]


LAW = """
from typing import NamedTuple
from interface import value

class Line(NamedTuple):
    slope: float

Line.role, Line.kind = "test", "line"

@value.of(Line)
def _value(law, x):
    return {factor} * law.slope * x
"""
INTERFACE = """
from parsolid.materials.law_functions import law_function

@law_function
def value(law, x):
    "A law's value."
"""
EVALUATION = """
from pathlib import Path
from parsolid.kernels import kernel, on_compile
from parsolid.materials.registry import from_text
from interface import value

@kernel
def evaluated(law, x):
    return value(law, x)

if __name__ == "__main__":
    import evaluation, sys
    law = from_text("line.py", "Line", Path(sys.argv[1]).read_text())
    compiled = []
    with on_compile(compiled.append):
        result = evaluation.evaluated(law(3.0), 1.0)
    print(result, *compiled)
"""


def test_laws_of_a_users_file_are_found_by_their_text(tmp_path):
    (tmp_path / "interface.py").write_text(INTERFACE)
    (tmp_path / "evaluation.py").write_text(EVALUATION)
    variables = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}", "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def run(factor):
        (tmp_path / "line.py").write_text(LAW.format(factor=factor))
        command = [sys.executable, str(tmp_path / "evaluation.py"), str(tmp_path / "line.py")]
        return subprocess.run(command, env=variables, stdout=subprocess.PIPE, text=True, check=True).stdout.split()

    assert run(2.0) == ["6.0", "evaluated"]
    assert run(5.0) == ["15.0", "evaluated"]
    assert run(2.0) == ["6.0"]
    assert run(5.0) == ["15.0"]


@pytest.fixture
def places(tmp_path, monkeypatch):
    """A user's cache folder and a folder for temporary files; what finds the folder of kernels anew."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return cache_folder.__wrapped__


def test_the_folder_is_private(places):
    folder = places()
    assert folder == wanted_folder() and stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize("mode", [0o770, 0o707])
def test_a_folder_that_others_may_write_to_is_not_used(places, mode):
    wanted_folder().mkdir(parents=True)
    wanted_folder().chmod(mode)
    folder = places()
    assert folder != wanted_folder() and stat.S_IMODE(folder.stat().st_mode) == 0o700
    folder.chmod(mode)
    assert places() not in (wanted_folder(), folder)


@pytest.mark.skipif(os.getuid() != 0, reason="only root gives folders away")
def test_a_folder_of_another_user_is_not_used(places):
    wanted_folder().mkdir(parents=True, mode=0o700)
    os.chown(wanted_folder(), 12345, 12345)
    assert places() != wanted_folder()


def test_a_link_is_not_followed(places, tmp_path):
    wanted_folder().parent.mkdir(parents=True)
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    wanted_folder().symlink_to(tmp_path / "elsewhere")
    assert places() != wanted_folder()


def test_a_home_that_cannot_be_written_is_done_without(places, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert places().parent == tmp_path


def test_folders_that_were_not_used_for_long_are_removed(places):
    beside = wanted_folder().parent
    for name, days in (("kernels-old", 40), ("kernels-recent", 20), ("other", 400)):
        (beside / name).mkdir(parents=True)
        then = os.stat(beside).st_mtime - 86400 * days
        os.utime(beside / name, (then, then))
    folder = places()
    assert sorted(path.name for path in beside.iterdir()) == sorted((folder.name, "kernels-recent", "other"))


def test_packages_without_kernels_have_none():
    sources = (path for name in kernel_cache.WITHOUT_KERNELS for path in (ROOT / "parsolid" / name).rglob("*.py"))
    found = [path for path in sources if "njit" in path.read_text() or "import kernel\n" in path.read_text()]
    assert not found


def test_kernels_of_decomposition_are_kept_there_whatever_is_imported_first():
    program = textwrap.dedent("""
        import decomposition.halo
        import parsolid.kernels
        from parsolid.kernel_cache import cache_folder
        import decomposition.pair_search
        kept = {decomposition.halo._near_box._cache.cache_path, decomposition.pair_search.bounds._cache.cache_path}
        assert kept == {str(cache_folder())}, kept
    """)
    variables = os.environ | {"PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", program], env=variables, check=True)
