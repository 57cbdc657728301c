"""Pages of public functions and classes, made from docstrings: `python docs/make_api.py`, a page a room in docs/api.

Nothing is imported: the text of the modules is read, so that it runs without MPI and the compiler. `--check` writes
nothing and fails when a page is not what its sources say.
"""

import argparse
import ast
import sys
from collections.abc import Iterator
from inspect import cleandoc
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = Path(__file__).resolve().parent / "api"
PACKAGES = ("decomposition", "parsolid")
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def room_of(path: Path) -> str:
    """The page of a module: its package, or the first folder below parsolid, a method each by itself."""
    parts = path.relative_to(ROOT).parts[:-1]
    depth = 3 if parts[1:2] == ("methods",) else 2
    return ".".join(parts[:depth])


def is_public(node: ast.AST) -> bool:
    """Whether a definition has a page: its name has no underscore before it, and it says what it does."""
    return isinstance(node, Definition) and not node.name.startswith("_") and ast.get_docstring(node) is not None


def signature(node: Definition) -> str:
    """As it is called: of a class, with the arguments of its `__init__` or its fields."""
    if not isinstance(node, ast.ClassDef):
        result = f" -> {ast.unparse(node.returns)}" if node.returns is not None else ""
        return f"{node.name}({ast.unparse(node.args)}){result}"
    for inner in node.body:
        if isinstance(inner, ast.FunctionDef) and inner.name == "__init__":
            inner.args.args = inner.args.args[1:]
            return f"class {node.name}({ast.unparse(inner.args)})"
    fields = [ast.unparse(inner) for inner in node.body if isinstance(inner, ast.AnnAssign)]
    bases = ", ".join(ast.unparse(base) for base in node.bases)
    return f"class {node.name}({bases})" + "".join(f"\n    {field}" for field in fields)


def entry(node: Definition, level: int) -> Iterator[str]:
    """Heading, signature and docstring of a definition; of a class also its public methods."""
    about = cleandoc(ast.get_docstring(node) or "")
    yield f"{'#' * level} `{node.name}`\n\n```python\n{signature(node)}\n```\n\n{about}\n"
    if isinstance(node, ast.ClassDef):
        for inner in node.body:
            if isinstance(inner, ast.FunctionDef) and inner.name == "__init__" and ast.get_docstring(inner):
                yield f"{cleandoc(ast.get_docstring(inner) or '')}\n"
            elif is_public(inner):
                yield from entry(inner, level + 1)  # type: ignore[arg-type]


def module_text(path: Path) -> str:
    """The section of one module; empty when it has nothing public."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    parts = [part for node in tree.body if is_public(node) for part in entry(node, 3)]  # type: ignore[arg-type]
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    about = ast.get_docstring(tree) or ""
    return "\n".join([f"## {name}\n\n{about}\n", *parts]) if parts else ""


def pages() -> dict[str, str]:
    """Name of each page -> its text, the table of contents among them."""
    rooms: dict[str, list[Path]] = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            rooms.setdefault(room_of(path), []).append(path)
    found, contents = (
        {},
        ["# API\n\nMade from the docstrings by `python docs/make_api.py`.\n\n| room | what it is |\n|---|---|"],
    )
    for room, paths in sorted(rooms.items()):
        sections = [text for path in paths if (text := module_text(path))]
        start = ROOT / room.replace(".", "/") / "__init__.py"
        about = (ast.get_docstring(ast.parse(start.read_text(encoding="utf-8"))) or "") if start.exists() else ""
        if sections:
            found[f"{room}.md"] = f"# {room}\n\n" + "\n".join(sections)
            contents.append(f"| [{room}]({room}.md) | {' '.join(about.partition(chr(10) * 2)[0].split())} |")
    return found | {"README.md": "\n".join(contents) + "\n"}


def main(arguments: list[str]) -> int:
    """Write the pages, or with --check tell those that differ; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail when a page differs")
    check, wanted = parser.parse_args(arguments).check, pages()
    there = {path.name: path.read_text(encoding="utf-8") for path in PAGES.glob("*.md")}
    different = sorted(name for name in wanted.keys() | there.keys() if wanted.get(name) != there.get(name))
    if check:
        print(
            "".join(f"docs/api/{name}: not what the docstrings say; python docs/make_api.py\n" for name in different),
            end="",
        )
        return 1 if different else 0
    PAGES.mkdir(exist_ok=True)
    for name in different:
        path = PAGES / name
        path.write_text(wanted[name], encoding="utf-8") if name in wanted else path.unlink()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
