"""`parsolid keys`: the keys of a scene as text, as JSON Schema for editors, and as a scene to start from."""

import json
import re
import textwrap
import tomllib
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from importlib.resources import files
from math import inf
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from parsolid.collective import SolverError, raise_together
from parsolid.point.schema import MaterialPoint
from parsolid.scene.base_model import SceneModel
from parsolid.scene.methods import method_kinds
from parsolid.scene.raw_tables import toml_value
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import suggestion

_HEADER = re.compile(r"^\[+([A-Za-z_.]+)\]+$")
_KEY = re.compile(r"^([A-Za-z_]+) = ")
_COLUMN = 60
_WIDTH = 100
_WORDS = {"number": "a number", "integer": "a whole number", "boolean": "true or false", "string": "a text"}
_BOUNDS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
_LENGTHS = {"minItems": "at least", "maxItems": "at most"}


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    path = "only this key or table, such as bodies.material or method.tlsph.smoothing"
    parser.add_argument("path", nargs="?", default="", metavar="PATH", help=path)
    schema = "print JSON Schema instead, for editors that complete and check TOML"
    parser.add_argument("--json", action="store_true", help=schema)
    new = "write a commented scene of this method to start from instead"
    parser.add_argument("--new", metavar="METHOD", help=new)
    parser.add_argument("-o", "--output", metavar="FILE", help="with --new: a new file (default scene.toml)")


def run_keys(comm: Any, options: Any) -> int:
    """Print keys with meaning, unit, default and bounds, print the schema, or write a scene; exit status 0. Collective.

    Raises SolverError on all ranks for an unknown path or method, an existing file, or arguments that exclude each
    other.
    """
    words = [word for word in ("path", "json", "new") if getattr(options, word)]
    if len(words) > 1 or (options.output and options.new is None):
        found = f"{len(words)} of them" if len(words) > 1 else "-o without --new"
        raise SolverError(f"keys: expected PATH, --json or --new METHOD [-o FILE], found {found}")
    if options.new is not None:
        write_scene(comm, options.new, options.output or "scene.toml")
    elif options.json:
        if comm.rank == 0:
            print(json.dumps(scene_schema(), indent=1), flush=True)
    else:
        text = listing(options.path)
        if comm.rank == 0:
            print(text, flush=True)
    return 0


class _TomlSchema(GenerateJsonSchema):
    """JSON Schema without null, infinite defaults and titles of keys."""

    def nullable_schema(self, schema: Any) -> Any:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: Any) -> Any:
        made = super().default_schema(schema)
        if made.get("default", "") in (None, inf):
            del made["default"]
        return made

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def scene_schema() -> dict[str, Any]:
    """The schema of a scene."""
    schema = Scene.model_json_schema(schema_generator=_TomlSchema)
    return {"$schema": _TomlSchema.schema_dialect, **schema, "title": "A scene of parsolid"}


@dataclass(frozen=True)
class Key:
    """A key of a table.

    words: its type; tables: tables that it accepts, by kind ("" for a table without kinds); default: as TOML, None if
    the key is required; meaning: its description
    """

    name: str
    words: str
    tables: "dict[str, Table]"
    default: str | None
    meaning: str


@dataclass(frozen=True)
class Table:
    """The schema of a table; known: schemas of all tables by the names of references."""

    schema: dict[str, Any]
    known: dict[str, Any]

    @classmethod
    def of(cls, model: type[SceneModel]) -> "Table":
        """The table of a model."""
        schema = model.model_json_schema(schema_generator=_TomlSchema)
        return cls(schema, schema.get("$defs", {}))

    @property
    def meaning(self) -> str:
        """The description of the table."""
        return str(self.schema.get("description", ""))

    @property
    def needed(self) -> list[str]:
        """The required keys."""
        # keys that are required unless a library has them
        of_library = [rule["anyOf"][0] for rule in self.schema.get("allOf", ()) if "anyOf" in rule]
        return [key for part in (self.schema, *of_library) for key in part.get("required", ())]

    @property
    def keys(self) -> dict[str, Key]:
        """The keys in the order of their declaration."""
        return {name: self._key(name, schema) for name, schema in self.schema.get("properties", {}).items()}

    def _key(self, name: str, schema: dict[str, Any]) -> Key:
        # the first of several tables without kinds: others are short forms
        tables: dict[str, Table] = {}
        for kind, table in self._tables(schema):
            tables.setdefault(kind, table)
        meaning = schema.get("description", "")
        if not meaning and (name == "kind" or len(tables) == 1):
            meaning = self.meaning if name == "kind" else next(iter(tables.values())).meaning
        default = None if name in self.needed else _default(schema.get("default"))
        return Key(name, self._words(schema), tables, default, meaning)

    def _tables(self, schema: dict[str, Any]) -> "list[tuple[str, Table]]":
        """Kinds and tables that a key accepts, alone or in a list."""
        if "$ref" in schema:
            table = Table(self.known[schema["$ref"].rpartition("/")[2]], self.known)
            kind = table.schema.get("properties", {}).get("kind", {})
            kinds = kind.get("enum", [kind.get("const")]) if "kind" in table.needed else [""]
            return [(name, table) for name in kinds]
        parts = [schema["items"]] if "items" in schema else schema.get("anyOf", schema.get("oneOf", ()))
        return [found for part in parts for found in self._tables(part)]

    def _words(self, schema: dict[str, Any]) -> str:
        """The type of the values of a schema, in words."""
        if "$ref" in schema or "properties" in schema:
            return "a table"
        if "title" in schema:
            return str(schema["title"])
        if choices := schema.get("anyOf", schema.get("oneOf")):
            return " or ".join(dict.fromkeys(map(self._words, choices)))
        if "enum" in schema or "const" in schema:
            return " or ".join(dict.fromkeys(map(toml_value, schema.get("enum", [schema.get("const")]))))
        if schema.get("type") == "array":
            lengths = [f"{words} {schema[key]}" for key, words in _LENGTHS.items() if key in schema]
            many = self._words(schema["items"]).removeprefix("a ")
            return f"a list ({', '.join(lengths)}) of: {many}" if lengths else f"a list of: {many}"
        if schema.get("type") == "object":
            return f"a table of {self._words(schema['additionalProperties']).removeprefix('a ')}s"
        bounds = [f"{sign} {schema[key]:g}" for key, sign in _BOUNDS.items() if key in schema]
        return " ".join([_WORDS.get(schema.get("type", ""), "any value"), " and ".join(bounds)]).strip()


def _default(value: Any) -> str:
    """A default in TOML or in words."""
    if value is None:
        return "none"
    return "as its keys" if isinstance(value, dict) and value else toml_value(value)


def listing(path: str = "") -> str:
    """All keys, or those at a path of keys and kinds; a single word that begins no path is searched in all tables.

    Raises SolverError for an unknown path, with the known keys.
    """
    table = Table.of(Scene)
    words = [word for word in path.split(".") if word and not word.isdigit()]
    place = ""
    if len(words) == 1 and words[0] not in Scene.model_fields:
        # also a plural, as in "materials"
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
    """All keys as a page of the manual."""
    head = "# Every key of a scene\n\nOutput of `parsolid keys`; `parsolid keys method.mpm` prints a part of it.\n"
    return f"{head}\n```text\n{listing()}\n```\n"


def write_scene(comm: Any, method: str, path: str) -> None:
    """Write a scene to start from. Collective: rank 0 writes. Raises SolverError on all ranks."""
    if method not in method_kinds():
        known = f"expected one of {', '.join(method_kinds())}{suggestion(method, method_kinds())}"
        raise SolverError(f"--new: {known}, found {method!r}")
    fault = None
    if comm.rank == 0:
        try:
            with open(Path(path), "x", encoding="utf-8") as file:
                file.write(starting_scene(method))
            print(f"{path}: try `parsolid run {path} --ranks 2`", flush=True)
        except FileExistsError:
            fault = f"{path}: expected a new file, found an existing one, which is kept"
        except OSError as error:
            fault = f"{path}: expected a file that can be written, found {error.strerror}"
    raise_together(comm, fault)


def starting_scene(method: str) -> str:
    """The text of a small scene of a method that runs in seconds, with comments on all keys of the method."""
    text = (files("parsolid.methods") / method / "example.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    lines: list[str] = []
    scene = Table.of(Scene)
    stated: Any
    open_keys = scene.keys
    place: list[str] = []
    # number of tables so far, by header
    count: Counter[str] = Counter()
    for line in text.splitlines():
        header, key = _HEADER.match(line), _KEY.match(line)
        if (header or not line) and place == ["method"]:
            # keys that the scene does not state, as comments
            for name, other in open_keys.items():
                if name not in tables["method"]:
                    value = other.words if other.default in (None, "none", "as its keys") else other.default
                    lines.append(_commented(f"# {name} = {value}", other.meaning))
            place = []
        if header:
            place = header[1].split(".")
            count[header[1]] += 1
            # finds the table by the kinds that the text states; of a list the present entry
            table, stated = scene, tables
            for depth, word in enumerate(place, 1):
                is_list = isinstance(stated[word], list)
                stated = stated[word][count[".".join(place[:depth])] - 1] if is_list else stated[word]
                kinds = table.keys[word].tables
                table = kinds[""] if "" in kinds else kinds[stated["kind"]]
            open_keys = table.keys
        if key and key[1] in open_keys:
            line = _commented(line, open_keys.pop(key[1]).meaning)
        lines.append(line)
    return "\n".join(lines) + "\n"


def _commented(line: str, meaning: str) -> str:
    return f"{line:<{_COLUMN}}  # {meaning}" if meaning else line


def _named(word: str, table: Table, place: str, seen: set[int]) -> Iterator[str]:
    """All keys and kinds with a name, in a table and the tables in it; seen: ids of schemas that were searched."""
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
    """The word of a path if it is known. Raises SolverError otherwise."""
    if word not in known:
        expected = f"one of {', '.join(known)}{f' after {place}' if place else ''}"
        raise SolverError(f"keys {path}: expected {expected}, found {word!r}{suggestion(word, known)}")
    return word


def _table(table: Table, place: str, whole: bool) -> Iterator[str]:
    """All keys of a table and of tables in it, with kinds only if `whole`."""
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
    """The text of a key: path, type and default, and its meaning below."""
    default = "" if key.default is None else f"; default {key.default}"
    takes = key.words
    if len(key.tables) > 1:
        takes += f" (kind: {', '.join(key.tables)})"
    need = "" if key.default is not None else "; needed"
    head = textwrap.fill(f"{place}: {takes}{default}{need}", _WIDTH, subsequent_indent="    ")
    return f"{head}\n{textwrap.fill(key.meaning, _WIDTH, initial_indent='    ', subsequent_indent='    ')}".rstrip()
