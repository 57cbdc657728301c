"""Kernels from files in a process without numba: what they give, and what happens when numba comes."""

import ast
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numba import typeof

from decomposition import kernel_places
from decomposition.argument_kinds import kind_of
from decomposition.kernel_files import symbols_of
from parsolid.numerics.lanes import load

ROOT = Path(__file__).parents[2]
KERNELS = """import sys
from typing import NamedTuple
import numpy as np
from decomposition.compiled import compiled, LISTENERS
from decomposition.recalled import Recalled
from decomposition.deferred import register_jitable
from parsolid.numerics.wide_lanes import WIDE

told = []
LISTENERS.append(told.append)


class Pair(NamedTuple):
    first: np.ndarray
    second: float


@register_jitable
def twice(x):
    return 2.0 * x


@compiled
def doubled(pair, offset=0.5):
    if offset < 0.0:
        raise ValueError("an offset is negative")
    total = pair.second + offset
    for k in range(len(pair.first)):
        total += twice(pair.first[k])
    return total


@compiled(error_model="numpy")
def split(values, k):
    return Pair(values[:k].copy(), values[k] / 2)


def closed_over(kernel):
    @compiled
    def outer(x):
        return kernel(x) + 1.0

    return outer


@compiled
def seconds(one, other):
    return one.second + 10.0 * other.second


@compiled
def eight_or_four(values):
    return WIDE


def show(*results):
    print(*results, told, "numba" in sys.modules)
"""


@pytest.fixture
def run(tmp_path):
    """What a program prints, in a process of its own with the kernels of a folder of its own."""
    (tmp_path / "kernels.py").write_text(KERNELS)
    values = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    values |= {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT), "NUMBA_SLP_VECTORIZE": "1"}

    def printed(program: str, before: str = "", **more: str) -> str:
        command = [sys.executable, "-c", f"{before}\nfrom kernels import *\n{program}"]
        done = subprocess.run(command, cwd=tmp_path, env=values | more, text=True, capture_output=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    return printed


class Two(NamedTuple):
    a: object
    b: object


class Empty(NamedTuple):
    pass


def _read_only():
    values = np.zeros(3)
    values.flags.writeable = False
    return values


_VALUES = [
    *(1, -1, 1.0, True, None, np.float64(1.0), np.float32(1.0), np.int64(1), np.uint8(1), np.bool_(True)),
    *(np.zeros((3, 4)), np.zeros((3, 4)).T, np.zeros((3, 4))[:, ::2], np.zeros(()), np.zeros((1, 1)), _read_only()),
    *(np.zeros(3, np.int32), np.zeros(3, bool), np.zeros(3, np.uint8), np.zeros(2, complex), np.zeros((0, 3))),
    *((1, 2), (1, 2.0), (), ((1,), (2,)), Two(1, 2), Two(1.0, None), Two(np.zeros((2, 2)), (1, 2)), Empty()),
    (Two(1, (None, True)),),
]


@pytest.mark.parametrize("value", _VALUES, ids=lambda value: str(typeof(value)))
def test_types_are_named_as_numba_names_them(value):
    assert kind_of(value).name == str(typeof(value))


@pytest.mark.parametrize("value", [1 << 63, "text", [1.0], np.zeros(2, "S3"), np.zeros(2, ">f8"), (1, "text"), print])
def test_what_is_not_known_is_numbas_affair(value):
    assert kind_of(value).name is None


def test_classes_of_one_name_are_told_apart():
    def made():
        class Pair(NamedTuple):
            a: float

        return Pair

    first, second = made(), made()
    assert kind_of(first(1.0)) is kind_of(first(2.0)) is not kind_of(second(1.0))
    assert kind_of(first(1.0)).code != kind_of(second(1.0)).code
    assert kind_of((first(1.0), 2)).classes == ((__name__, first.__qualname__, ("a",)),)


@pytest.mark.slow
def test_a_file_is_called_without_numba(run):
    program = "show(doubled(Pair(np.arange(2.0), 1.0), 0.5), split(np.arange(3.0), 2))"
    values = "3.5 Pair(first=array([0., 1.]), second=1.0)"
    assert run(program) == f"{values} ['doubled', 'split'] True"
    assert run(program) == f"{values} [] False"
    # other types of the same kernel are compiled, and what was there before is called on
    more = "show(doubled(Pair(np.arange(2), 1.0), 0.5), doubled(Pair(np.arange(2.0), 1.0), 0.5))"
    assert run(f"{program}; {more}; {program}").splitlines() == [
        f"{values} [] False",
        "3.5 3.5 ['doubled'] True",
        f"{values} ['doubled'] True",
    ]


_LINKED_BY_LLVM = """
from decomposition import direct_linking
direct_linking.linked = lambda code, address_of: None
"""


@pytest.mark.slow
@pytest.mark.skipif(os.uname().machine != "x86_64", reason="LLVM links on other processors")
def test_a_file_is_called_without_llvm(run):
    call = "show(doubled(Pair(np.arange(2.0), 1.0), 0.5), split(np.arange(3.0), 2))"
    program = f"{call}; print('llvmlite' in sys.modules)"
    values = "3.5 Pair(first=array([0., 1.]), second=1.0)"
    assert run(program).splitlines() == [f"{values} ['doubled', 'split'] True", "True"]
    assert run(program).splitlines() == [f"{values} [] False", "False"]
    # what is asked for in another way than usual LLVM links
    assert run(program, _LINKED_BY_LLVM).splitlines() == [f"{values} [] False", "True"]


@pytest.mark.slow
def test_what_numba_decides_is_left_to_it(run):
    plain = "show(doubled(Pair(np.arange(2.0), 1.0), 0.5))"
    assert run(plain) == "3.5 ['doubled'] True"
    assert run("show(doubled(Pair(np.arange(2.0), 1.0)))").startswith("3.5")
    assert run(f"doubled(Pair(np.arange(2.0), 1.0), offset=0.5); {plain}").startswith("3.5")
    # settings of numba's that change machine code are seen
    assert run(plain, NUMBA_OPT="1") == "3.5 ['doubled'] True"
    assert run(plain, PARSOLID_PLAIN_COMPILER="1").endswith("True")
    assert run(plain, NUMBA_SLP_VECTORIZE="0") == "3.5 ['doubled'] True"
    assert run(plain) == "3.5 [] False"


@pytest.mark.slow
def test_errors_are_raised_without_numba(run):
    program = """
try:
    doubled(Pair(np.arange(2.0), 1.0), -1.0)
except ValueError as error:
    show(error)
"""
    assert run(program) == "an offset is negative ['doubled'] True"
    assert run(program).startswith("an offset is negative []")


@pytest.mark.slow
def test_numba_may_come_at_any_time(run):
    call = "show(doubled(Pair(np.arange(2.0), 1.0), 0.5))"
    run(call)
    program = f"""
{call}
import numba
print(doubled.entry_point((Pair(np.arange(2.0), 1.0), 0.5)) is not None)
{call}

@numba.njit
def both(pair):
    return doubled(pair, 0.5) + twice(pair.second)

print(both(Pair(np.arange(2.0), 1.0)))
recalled, pair, offset = Recalled(doubled), Pair(np.arange(2.0), 1.0), 0.5
print([recalled(pair, offset) for _ in range(3)])
"""
    assert run(program).splitlines() == [
        "3.5 [] False",
        "True",
        "3.5 [] True",
        "5.5",
        "[3.5, 3.5, 3.5]",
    ]


@pytest.mark.slow
def test_threads_may_call_a_file_at_once(run):
    program = """
import threading

def work():
    ready.wait()
    for kernel, arguments in ((doubled, (pair, 0.5)), (split, (pair.first, 1)), (seconds, (pair, pair))):
        kernel(*arguments)
    try:
        doubled(pair, -1.0)
    except ValueError:
        raised.append(1)

sys.setswitchinterval(1e-6)
pair, ready, raised = Pair(np.arange(2.0), 1.0), threading.Barrier(8), []
threads = [threading.Thread(target=work) for _ in range(8)]
for one in threads:
    one.start()
for one in threads:
    one.join()
show(len(raised))
"""
    run(program)
    # six of ten such processes ended by a signal
    assert {run(program) for _ in range(6)} == {"8 [] False"}


@pytest.mark.slow
def test_classes_of_one_name_have_files_of_their_own(run, tmp_path):
    (tmp_path / "others.py").write_text(
        "from typing import NamedTuple\nclass Pair(NamedTuple):\n    second: float\n    first: object\n"
    )
    program = "import others; mine, other = Pair(1.0, 2.0), others.Pair(first=1.0, second=2.0); show(seconds({}))"
    assert run(program.format("mine, other")) == "22.0 ['seconds'] True"
    assert run(program.format("other, mine")) == "22.0 ['seconds'] True"
    assert run(program.format("other, mine")) == "22.0 [] False"


@pytest.mark.slow
def test_a_kernel_in_a_closure_is_read_anew(run, tmp_path):
    inner = "from decomposition.compiled import compiled\n@compiled\ndef inner(x):\n    return {} * x\n"
    program = "from inner import inner; show(closed_over(inner)(1.0))"
    (tmp_path / "inner.py").write_text(inner.format(2.0))
    run(program)
    assert run(program) == "3.0 [] False"
    (tmp_path / "inner.py").write_text(inner.format(7.125))
    assert run(program).startswith("8.125")


_NARROWER = """
import llvmlite.binding as llvm

can = llvm.get_host_cpu_features()
can["avx512f"] = False
llvm.get_host_cpu_features = lambda: can
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "setting", [{"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+avx2"}, {"NUMBA_CPU_NAME": "generic"}, {}], ids=str
)
def test_a_folder_of_two_processors_has_lanes_for_both(run, setting):
    program = "show(WIDE == eight_or_four(np.zeros(1)))"
    assert run(program, **setting).startswith("True")
    assert run(program, _NARROWER, **setting).startswith("True")


@pytest.mark.slow
@pytest.mark.parametrize("words", ["", "yes"])
def test_a_setting_that_is_no_number_is_numbas_affair(run, words):
    assert run("show(doubled(Pair(np.arange(2.0), 1.0), 0.5))", NUMBA_SLP_VECTORIZE=words).startswith("3.5")


@pytest.mark.slow
def test_a_dispatcher_that_is_made_otherwise_is_left_to_numba(run):
    before = """
from decomposition import machine_code

class Otherwise(machine_code.in_c().dispatcher.Dispatcher):
    def __init__(self, *arguments):
        raise TypeError("expected other arguments")

parts = machine_code.in_c()
class Parts:
    Dispatcher, typeof_init = Otherwise, parts.dispatcher.typeof_init

machine_code.in_c = lambda: parts._replace(dispatcher=Parts)
"""
    assert run("show(doubled(Pair(np.arange(2.0), 1.0), 0.5))", before) == "3.5 ['doubled'] True"


def test_a_user_without_a_home_has_kernels_in_a_temporary_folder(monkeypatch):
    def none():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", none)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert kernel_places.wanted_folder().parent == Path(tempfile.gettempdir())
    monkeypatch.setenv("NUMBA_CACHE_DIR", "chosen")
    assert kernel_places.wanted_folder() == Path("chosen")


def test_kernels_of_others_are_not_run(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    found = kernel_places.folder.__wrapped__
    own = tmp_path / f"parsolid-kernels-{os.getuid()}"
    assert found() == own
    own.chmod(0o777)
    assert found() != own
    own.rename(tmp_path / "another")
    own.symlink_to(tmp_path / "another")
    (tmp_path / "another").chmod(0o700)
    assert found() != own


def test_what_is_for_kernels_alone_says_so():
    with pytest.raises(NotImplementedError, match="compiled kernels alone"):
        load(np.zeros(4), 0)


def test_no_kernel_leaves_arguments_to_numba():
    """Arguments that are not given are numba's affair, which a job would import for them at every start."""
    found = []
    for path in (*ROOT.glob("parsolid/**/*.py"), *ROOT.glob("decomposition/*.py")):
        for one in ast.walk(ast.parse(path.read_text())):
            if isinstance(one, ast.FunctionDef) and any("compiled" in ast.unparse(it) for it in one.decorator_list):
                found += [f"{path}: {one.name}"] if one.args.defaults else []
    assert not found


def test_symbols_of_another_format_are_not_known():
    assert symbols_of(b"\xcf\xfa\xed\xfe" + bytes(64)) is None
