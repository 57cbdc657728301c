"""Rules of the house: lengths, arrows between rooms, copies, what an import costs; each test lists what breaks one."""

import ast
import os
import re
import subprocess
import sys
from collections import defaultdict
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINE, FILE, FUNCTION, COPY = 120, 350, 50, 6
# a room may import from its own row and the rows below it
ROWS = (
    ("parsolid.api",),
    ("parsolid.commands", "parsolid.__main__"),
    ("parsolid.errors",),
    ("parsolid.simulation",),
    ("parsolid.contact",),
    ("parsolid.methods.tlsph", "parsolid.methods.peridynamics", "parsolid.methods.mpm", "parsolid.methods.ulsph"),
    ("parsolid.methods",),
    ("parsolid.particles", "parsolid.boundary", "parsolid.output"),
    ("parsolid.scene", "parsolid.exact"),
    (
        "parsolid.pairs",
        "parsolid.solvers",
        "parsolid.observables",
        "parsolid.particles.particle_set",
        "parsolid.particles.declaration",
    ),
    ("parsolid.materials",),
    ("parsolid.numerics",),
    ("parsolid", "decomposition"),
)
# the rooms of kernels know neither messages nor files
WITHOUT_MESSAGES, MESSAGES = ("parsolid.numerics", "parsolid.materials"), ("mpi4py", "h5py")


@cache
def sources() -> dict[str, str]:
    """Path below the root -> text, of both packages."""
    files = [path for package in ("parsolid", "decomposition") for path in sorted((ROOT / package).rglob("*.py"))]
    assert len(files) > 100, "expected the packages beside the tests"
    return {str(path.relative_to(ROOT)): path.read_text() for path in files}


@cache
def nodes_of(text: str) -> list[ast.AST]:
    """All nodes of a module, those of a level before those below them."""
    return list(ast.walk(ast.parse(text)))


def none_of(violations) -> None:
    violations = list(violations)
    assert not violations, f"{len(violations)} of them:\n" + "\n".join(violations)


def test_no_long_line():
    none_of(
        f"{path}:{number}: {len(line)} columns"
        for path, text in sources().items()
        for number, line in enumerate(text.splitlines(), 1)
        if len(line) > LINE
    )


def test_no_long_file():
    lengths = {path: len(text.splitlines()) for path, text in sources().items()}
    none_of(f"{path}: {length} lines" for path, length in lengths.items() if length > FILE)


def functions(text: str):
    """Functions of a module with how many lines they take, from `def` to their end."""
    for node in nodes_of(text):
        if isinstance(node, ast.FunctionDef):
            yield node.name, node.lineno, node.end_lineno - node.lineno + 1


def test_no_long_function():
    none_of(
        f"{path}:{line}: {name} has {length} lines"
        for path, text in sources().items()
        for name, line, length in functions(text)
        if length > FUNCTION
    )


# --- arrows ------------------------------------------------------------------------------------------------------


def package_of(path: str) -> str:
    return path.rpartition("/")[0].replace("/", ".")


def module_of(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def imports_of(text: str, package: str) -> list[tuple[int, str]]:
    """Line and full name of what a module imports, anywhere in it; nothing that only a type checker reads."""
    found, hidden = [], set()
    for node in nodes_of(text):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in text and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            hidden |= {id(inner) for part in node.body for inner in ast.walk(part)}
        if id(node) in hidden:
            continue
        if isinstance(node, ast.ImportFrom):
            start = ".".join(filter(None, [package if node.level else "", node.module]))
            assert node.level < 2, "expected full names in imports, or a single dot"
            found += [(node.lineno, f"{start}.{alias.name}") for alias in node.names]
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
    return found


def room_of(name: str) -> tuple[int, str] | None:
    """Row and room of a module or of a name in it; None for what is not ours."""
    owners = [
        (len(room), row, room) for row, rooms in enumerate(ROWS) for room in rooms if f"{name}.".startswith(f"{room}.")
    ]
    return max(owners)[1:] if owners else None


def arrows_up(path: str, text: str) -> list[str]:
    row, room = room_of(module_of(path))
    wrong = []
    for line, name in imports_of(text, package_of(path)):
        there = room_of(name)
        if there is None:
            continue
        siblings = there[1] != room and there[0] == row and room.startswith("parsolid.methods.")
        if there[0] < row or siblings or (room == "decomposition" and there[1] != room):
            wrong.append(f"{path}:{line}: {room} imports {name}")
    return wrong


def test_arrows_go_down():
    none_of(wrong for path, text in sources().items() for wrong in arrows_up(path, text))


def test_kernels_know_neither_messages_nor_files():
    none_of(
        f"{path}:{line}: {name}"
        for path, text in sources().items()
        if module_of(path).startswith(WITHOUT_MESSAGES)
        for line, name in imports_of(text, package_of(path))
        if name.partition(".")[0] in MESSAGES
    )


# --- copies ------------------------------------------------------------------------------------------------------


def counted(text: str) -> list[tuple[int, str]]:
    """Lines that count, without white space: no blank ones, comments, docstrings, imports, lone punctuation."""
    skipped = set()
    for node in nodes_of(text):
        string = (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        )
        if string or isinstance(node, ast.Import | ast.ImportFrom):
            skipped |= set(range(node.lineno, node.end_lineno + 1))
    lines = ((number, re.sub(r"\s+", "", line.partition("  #")[0])) for number, line in enumerate(text.splitlines(), 1))
    return [
        (number, line) for number, line in lines if number not in skipped and re.search(r"\w", line) and line[0] != "#"
    ]


def copies(texts: dict[str, str], length: int = COPY) -> list[str]:
    """Pairs of places that share so many counted lines, each run once."""
    places = defaultdict(list)
    for path, text in texts.items():
        lines = counted(text)
        for start in range(len(lines) - length + 1):
            window = lines[start : start + length]
            places[tuple(line for _, line in window)].append((path, window[0][0], window[-1][0]))
    found, reached = [], {}
    for stands in places.values():
        for (one, first, last), (other, begin, end) in pairwise(stands):
            # the windows of a longer run follow each other: only the first is told
            overlaps = reached.get((one, other), (-1, -1))
            if first > overlaps[0] or begin > overlaps[1]:
                found.append(f"{one}:{first}-{last} ~ {other}:{begin}-{end}")
            reached[one, other] = (last, end)
    return found


def test_no_copied_lines():
    none_of(copies(sources()))


def test_copies_are_found():
    body = "".join(f"    value_{number} = {number} + other\n" for number in range(7))
    texts = {"one.py": f"def one(other):\n{body}", "two.py": f"def two(other):\n    # said\n{body}    return other\n"}
    assert copies(texts) == ["one.py:2-7 ~ two.py:3-8"]
    assert copies(texts, 8) == []


# --- what an import costs ----------------------------------------------------------------------------------------


def test_an_import_makes_no_folder_and_is_quick(tmp_path):
    """The best of three, in processor seconds: the machine may be at work."""
    code = "import time; start = time.process_time(); import parsolid; print(time.process_time() - start)"
    values = {
        "HOME": str(tmp_path),
        "PATH": os.environ["PATH"],
        "PYTHONPATH": str(ROOT),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-c", code]
    seconds = [float(subprocess.check_output(command, env=values, cwd=tmp_path, text=True)) for _ in range(3)]
    assert list(tmp_path.iterdir()) == [] and min(seconds) < 0.3


@pytest.mark.parametrize("first", ["parsolid", "conftest"])
def test_a_rank_has_no_threads_for_linear_algebra(first, tmp_path):
    """A long product wakes those of a BLAS, which then spin beside other ranks for as long as more products come."""
    code = (
        f"import os, {first}; before = len(os.listdir('/proc/self/task')); import numpy; a = numpy.ones(10**6); a @ a; "
        "numpy.ones((300, 300)) @ numpy.ones((300, 300)); print(len(os.listdir('/proc/self/task')) - before)"
    )
    values = {"PATH": os.environ["PATH"], "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}"}
    assert int(subprocess.check_output([sys.executable, "-c", code], env=values, cwd=tmp_path, text=True)) == 0


@pytest.mark.parametrize(
    "text, length", [("def f():\n    pass\n", 2), ("class A:\n    def f(self):\n\n        pass\n", 3)]
)
def test_functions_are_measured(text, length):
    assert [lines for _, _, lines in functions(text)] == [length]


def test_arrows_up_are_found():
    text = "from parsolid.methods.mpm.grid import Grid\nfrom decomposition.cells import build\nimport numpy\n"
    assert [
        len(arrows_up(f"parsolid/{path}.py", text)) for path in ("materials/law", "methods/tlsph/a", "simulation/b")
    ] == [1, 1, 0]
    assert arrows_up("decomposition/halo.py", "from parsolid import collective\n") != []


# --- documents ---------------------------------------------------------------------------------------------------


def test_every_test_is_in_the_list_and_none_else():
    """docs/tests.md, made by `python -m pytest --collect-only -q --properties=docs/tests.md`."""
    there, file = set(), None
    for line in (ROOT / "docs" / "tests.md").read_text().splitlines():
        file = line.removeprefix("## ") if line.startswith("## ") else file
        if line.startswith("- ") and file:
            there.add((file, re.sub(r"( \(\d+\))?(: [a-z, ]+)?$", "", line.removeprefix("- "))))
    tests = ROOT / "tests"
    wanted = {
        (str(path.relative_to(tests)), node.name.removeprefix("test_").replace("_", " "))
        for path in tests.rglob("test_*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }
    none_of(f"{file}: {name}" for file, name in sorted(there ^ wanted))


def test_pages_of_the_api_say_what_the_docstrings_say():
    """docs/api, made by `python docs/make_api.py`."""
    made = subprocess.run(
        [sys.executable, ROOT / "docs" / "make_api.py", "--check"], capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stdout + made.stderr
