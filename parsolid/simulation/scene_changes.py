"""What of a scene a continued run may have otherwise than the run whose checkpoint it reads.

Everything that the scene says is compared, files by what is in them. Some keys may change as they like, a table of
factors after the time of the checkpoint; others may where the user names them, since what follows is well defined; the
rest says what the state in the checkpoint is, so that another value of it means nothing there. Which is which stands at
the tables that have them (`on_restart` of `base_model.SceneModel`).
"""

import fnmatch
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from parsolid.checksums import digest
from parsolid.scene import Scene
from parsolid.scene.base_model import OnRestart, on_restart
from parsolid.scene.codes import Note
from parsolid.scene.load_histories import FactorHistory
from parsolid.scene.validation_errors import NOTHING, describe, key_path

# keys that scenes may leave out, by the name and the kind of the table that they are in, with the values that hold
# then: to state such a value is no change
_WEIGHTS: dict[str, dict[str, Any]] = {"tlsph": {"weights": "kernel"}}
LEFT_OUT: dict[str, dict[str, dict[str, Any]]] = {
    "stabilisation": {"shear-scaled": {"coefficient": 0.35}},
    "method": _WEIGHTS,
    "methods": _WEIGHTS,
}

# of a formula
_TABLE = re.compile(r"""table\((["'])(/.*?)\1""")


class Change(NamedTuple):
    """A key with its values in the checkpoint and in the scene.

    later: they differ after the checkpoint only; rule: what the scene's tables say of the key.
    """

    key: str
    before: Any
    now: Any
    later: bool
    rule: OnRestart | None = None

    def of(self, patterns: tuple[str, ...]) -> bool:
        """Whether the key is one of the patterns' or within a table of theirs."""
        return any(fnmatch.fnmatchcase(self.key, one) or f"{self.key}.".startswith(f"{one}.") for one in patterns)


def contents(scene: Scene) -> dict[str, Any]:
    """The resolved scene as JSON holds it, with what is in files in place of their paths; for one rank alone.

    Raises OSError when a file is not there any more.
    """
    tables: dict[str, Any] = json.loads(json.dumps(_contents(scene.resolved())))
    return tables


def completed(value: Any) -> Any:
    """The contents of a scene with the keys of `LEFT_OUT`."""
    if isinstance(value, list):
        return [completed(part) for part in value]
    if not isinstance(value, dict):
        return value
    result = {key: completed(part) for key, part in value.items()}
    for key in LEFT_OUT.keys() & result.keys():
        result[key] = _completed_by_kind(LEFT_OUT[key], result[key])
    return result


def _completed_by_kind(known: dict[str, dict[str, Any]], value: Any) -> Any:
    if isinstance(value, list):
        return [_completed_by_kind(known, part) for part in value]
    # the method of a body is a name
    return known.get(value.get("kind", ""), {}) | value if isinstance(value, dict) else value


def _contents(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _history(part) if key == "history" else _contents(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_contents(part) for part in value]
    if isinstance(value, str) and os.path.isabs(value):
        # a law is a file and the class in it
        path, colon, name = value.rpartition(":")
        file = Path(value if not colon or os.path.exists(value) else path)
        if file.is_file():
            return f"{file.name}{colon and ':' + name} (content {digest(file.read_bytes())})"
    return _TABLE.sub(_table, value) if isinstance(value, str) else value


def _table(found: re.Match[str]) -> str:
    """The beginning of a formula's table, with what is in its file."""
    file = Path(found[2])
    return f"table({file.name} (content {digest(file.read_bytes())})"


def _history(value: Any) -> Any:
    is_file = isinstance(value, dict) and "file" in value
    return {"rows": FactorHistory.model_construct(**value).table} if is_file else value


def changes(before: Any, now: Any, time: float) -> Iterator[Change]:
    """Where the contents of two scenes differ; time [s]: of the checkpoint."""
    for place, change in _differences(before, now, time, ()):
        rule = on_restart(place, now, Scene) or on_restart(place, before, Scene)
        yield change._replace(rule=OnRestart.FIXED if place[::2] == ("methods", "name") else rule)


def _differences(before: Any, now: Any, time: float, place: tuple[Any, ...]) -> Iterator[tuple[Any, Change]]:
    if before == now:
        return
    if isinstance(before, dict) and isinstance(now, dict):
        if place and place[-1] == "history" and "rows" in before and "rows" in now:
            later = _alike_until(time, before, now)
            yield (*place, "rows"), Change(key_path((*place, "rows")), before["rows"], now["rows"], later)
            return
        for key in [*before, *(key for key in now if key not in before)]:
            yield from _differences(before.get(key, NOTHING), now.get(key, NOTHING), time, (*place, key))
    elif _tables(before) and _tables(now):
        for number in range(max(len(before), len(now))):
            old, new = (tables[number] if number < len(tables) else NOTHING for tables in (before, now))
            yield from _differences(old, new, time, (*place, number))
    else:
        later = bool(place) and place[-1] == "jumps" and _until(time, before) == _until(time, now)
        yield place, Change(key_path(place), before, now, later)


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(entry, dict) for entry in value)


def _alike_until(time: float, *histories: dict[str, Any]) -> bool:
    """Whether factors are the same up to a time [s]."""
    found = []
    for history in histories:
        rows = [row for row in history["rows"] if row[0] <= time]
        found.append((rows, FactorHistory.model_construct(rows=history["rows"]).factor(time)))
    return found[0] == found[1]


def _until(time: float, jumps: Any) -> list[float]:
    return [jump for jump in jumps if jump <= time] if isinstance(jumps, list) else []


def faults_and_notes(
    found: list[Change], allowed: tuple[str, ...], source: Path, time: float
) -> tuple[list[str], list[Note]]:
    """Faults, and notes on what was accepted; allowed: keys that the user allows to change, and all within them."""
    faults, notes = list[str](), list[Note]()
    for change in found:
        fixed = change.rule is OnRestart.FIXED
        if change.later or (not fixed and (change.rule is not None or change.of(allowed))):
            if change.rule is not OnRestart.SILENT:
                then = f"{describe(change.before)} until the checkpoint at t = {time:.6g} s"
                notes.append(Note("restart-change", f"{change.key}: {then}, from there on {describe(change.now)}"))
            continue
        hint = "" if fixed else f" (where that is meant: --allow-change {change.key})"
        expected = f"{describe(change.before)} as in the checkpoint {source}"
        faults.append(f"{change.key}: expected {expected}, found {describe(change.now)}{hint}")
    unused = [key for key in allowed if not any(change.of((key,)) for change in found)]
    faults += [f"--allow-change {key}: expected a key that has changed since {source}, found none" for key in unused]
    return faults, notes
