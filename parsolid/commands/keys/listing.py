"""The keys of a scene as text: one key a paragraph, in the order of the scene's tables."""

import textwrap
from collections.abc import Collection, Iterator

from parsolid.collective import SolverError
from parsolid.commands.keys.description import Key, Table
from parsolid.point.schema import MaterialPoint
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import suggestion

_WIDTH = 100


def listing(path: str = "") -> str:
    """All keys, or those at a path. A path names keys and, where a table has kinds, one of them or none; one word that
    no path begins with is looked for in all tables.

    Raises SolverError for a path that leads nowhere, with what there is.
    """
    table = Table.of(Scene)
    words = [word for word in path.split(".") if word and not word.isdigit()]
    place = ""
    if len(words) == 1 and words[0] not in Scene.model_fields:
        # one word for several, as in "materials", and tables of the command `point`
        for word in dict.fromkeys((words[0], words[0].removesuffix("s"))):
            if found := list(_named(word, table, "", set())):
                return "\n\n".join(found)
    if words and words[0] not in Scene.model_fields and words[0] in MaterialPoint.model_fields:
        table = Table.of(MaterialPoint)
    while words:
        known = table.keys
        key = known[_among(known, words.pop(0), place, path)]
        place, kinds = f"{place}.{key.name}".lstrip("."), key.tables
        if not kinds and words:
            raise SolverError(f"keys {path}: expected nothing after {place}, which is no table, found {words[0]!r}")
        if not kinds:
            return _one(key, place)
        if "" not in kinds and not words:
            return "\n\n".join([_one(key, place), *_kinds(key, place)])
        if "" not in kinds:
            kind = _among(kinds, words.pop(0), place, path)
            place = f"{place}.{kind}"
        table = kinds["" if "" in kinds else kind]
    return "\n\n".join(_table(table, place, not place))


def page() -> str:
    """All keys as a page of docs."""
    head = "# Every key of a scene\n\nWhat `parsolid keys` prints; `parsolid keys method.mpm` prints a part of it.\n"
    return f"{head}\n```text\n{listing()}\n```\n"


def _named(word: str, table: Table, place: str, seen: set[int]) -> Iterator[str]:
    """Every key of a name, and every kind of a table, in a table and those within; of a table that is in several, where
    it is first. seen: schemas of tables that were looked through."""
    for key in table.keys.values():
        here = f"{place}.{key.name}".lstrip(".")
        if key.name == word:
            yield _one(key, here)
        for kind, one in key.tables.items():
            if id(one.schema) not in seen:
                seen.add(id(one.schema))
                there = f"{here}.{kind}" if kind else here
                yield from _table(one, there, False) if kind == word else _named(word, one, there, seen)


def _among(known: Collection[str], word: str, place: str, path: str) -> str:
    """A word of a path. Raises SolverError where it is none of those known."""
    if word not in known:
        there = f" after {place}" if place else ""
        raise SolverError(
            f"keys {path}: expected one of {', '.join(known)}{there}, found {word!r}{suggestion(word, known)}"
        )
    return word


def _table(table: Table, place: str, whole: bool) -> Iterator[str]:
    """Every key of a table, and of the tables within that have no kinds."""
    if place and table.meaning:
        yield f"[{place}]  {table.meaning}"
    for key in table.keys.values():
        here = f"{place}.{key.name}" if place else key.name
        yield _one(key, here)
        if "" in key.tables:
            yield from _table(key.tables[""], here, whole)
        elif whole:
            yield from _kinds(key, here)


def _kinds(key: Key, place: str) -> Iterator[str]:
    """The tables of all kinds of a key."""
    for kind, table in key.tables.items():
        yield from _table(table, f"{place}.{kind}", False)


def _one(key: Key, place: str) -> str:
    """One key: its place, what it takes, its default; its meaning below."""
    default = "" if key.default is None else f"; default {key.default}"
    takes = key.words
    if len(key.tables) > 1:
        takes += f" (kind: {', '.join(key.tables)})"
    need = "" if key.default is not None else "; needed"
    head = textwrap.fill(f"{place}: {takes}{default}{need}", _WIDTH, subsequent_indent="    ")
    return f"{head}\n{textwrap.fill(key.meaning, _WIDTH, initial_indent='    ', subsequent_indent='    ')}".rstrip()
