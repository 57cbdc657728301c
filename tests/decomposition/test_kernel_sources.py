"""What the file of a kernel is named by covers all that is compiled into it."""

import ast
import gc
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from decomposition import kernel_cache, kernel_places
from decomposition.compiled import compiled
from decomposition.kernel_sources import _imported, covered, named
from parsolid.numerics.dispatch import Generic

ROOT = Path(__file__).parents[2]
FILES = [path for room in ("decomposition", "parsolid") for path in sorted((ROOT / room).rglob("*.py"))]


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {name_of(path) for path in FILES}


def imports_of(path: Path) -> set[str]:
    """Modules of the project that a file imports, as Python reads it."""
    name, found = name_of(path), set()
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for one in ast.walk(ast.parse(path.read_text())):
        if isinstance(one, ast.Import):
            found |= {it.name for it in one.names}
        elif isinstance(one, ast.ImportFrom):
            start = start_of(one, package)
            found |= {f"{start}.{it.name}" if f"{start}.{it.name}" in NAMES else start for it in one.names}
    return (found & NAMES) - {name}


def start_of(one: ast.ImportFrom, package: str) -> str:
    above = package.split(".")[: len(package.split(".")) + 1 - one.level]
    return ".".join([*above, *([one.module] if one.module else [])]) if one.level else str(one.module)


def test_every_import_of_the_project_is_followed():
    lost = {name_of(path): imports_of(path) - _imported(name_of(path), path.read_text()) for path in FILES}
    assert not {name: it for name, it in lost.items() if it}


def test_every_implementation_is_followed_by_what_calls_its_function():
    for path in FILES:
        if re.search(r"^@\w+\.(of|otherwise)\b", path.read_text(), re.MULTILINE):
            import_module(name_of(path))
    lost, count = [], 0
    for table in gc.get_objects():
        if not isinstance(table, Generic) or table.stub.__module__ not in NAMES:
            continue
        for kind, function in [*table.implementations.items(), (None, table.default)]:
            classes = frozenset([named(kind)]) if hasattr(kind, "_fields") else frozenset()
            count += 1
            if function is not None and function.__module__ not in covered(frozenset([table.stub.__module__]), classes):
                lost.append((table.stub.__name__, kind, function.__module__))
    assert not lost and count > 400


def _halved(x):
    return 0.5 * x[0]


def test_a_kernel_whose_file_would_not_follow_its_text_has_none(monkeypatch, tmp_path):
    monkeypatch.setattr(kernel_places, "folder", lambda: tmp_path)
    monkeypatch.setattr(kernel_cache, "covered", lambda modules, classes: frozenset())
    with pytest.warns(UserWarning, match=f"_halved is compiled at every start: its file would not follow {__name__}"):
        assert compiled(_halved)(np.ones(1)) == 0.5
    assert not list(tmp_path.glob("*.kernel"))
