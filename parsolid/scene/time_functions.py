"""Functions that formulas have beside those of numexpr: min, max, clip, ramp, step and tables of CSV files.

They become nodes that numexpr knows; a table becomes a name whose values are looked up before. Times at which they make
a formula jump, or turn a corner, are found where their arguments are linear in time, so that steps end there.
"""

import ast
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from parsolid.scene.csv_table import read_csv_table

# number of arguments, at least and at most
ARGUMENTS = {"min": (2, 20), "max": (2, 20), "clip": (3, 3), "ramp": (3, 3), "step": (2, 2), "table": (1, 3)}
USAGE = {
    "min": "min(a, b, ...)",
    "max": "max(a, b, ...)",
    "clip": "clip(value, lowest, highest)",
    "ramp": "ramp(t, begin, end)",
    "step": "step(t, begin)",
    "table": 'table("file.csv", t, "column")',
}
# how far from a straight line, of its values, what counts as linear may be
_STRAIGHT = 1e-9


class Table:
    """Two columns of a CSV file: linear between rows, constant outside; a repeated place jumps."""

    def __init__(self, path: str, column: str | None = None) -> None:
        """column: the name of the values' column, the second one unless given. Raises ValueError for a file that is no
        such table."""
        self.places, self.values = read_csv_table(path, column)
        if (np.diff(self.places) < 0.0).any():
            raise ValueError(f"a first column that falls in {os.path.basename(path)!r}")

    def at(self, places: np.ndarray) -> np.ndarray:
        """Values at places, after a jump."""
        return np.interp(places, self.places, self.values)

    def slope(self, places: np.ndarray) -> np.ndarray:
        """Slopes at places, after a corner; 0 outside."""
        after = np.searchsorted(self.places, places, side="right")
        inside = (after > 0) & (after < len(self.places))
        end = np.where(inside, after, 1)
        if len(self.places) == 1:
            return np.zeros(np.shape(places))
        rise, run = self.values[end] - self.values[end - 1], self.places[end] - self.places[end - 1]
        return np.where(inside, rise / np.where(run > 0.0, run, 1.0), 0.0)

    @property
    def jumps(self) -> np.ndarray:
        """Places at which the values jump."""
        return self.places[1:][np.diff(self.places) == 0.0]


@dataclass
class Lookup:
    """A name in a formula whose values are those of a table, or its slopes, at what a tree says."""

    table: Table
    argument: ast.expr
    slopes: bool = False


@dataclass
class Moments:
    """Times at which a formula jumps, and at which its rate may."""

    jumps: set[float] = field(default_factory=set)
    corners: set[float] = field(default_factory=set)


def misuse(node: ast.Call) -> str | None:
    """Why a call of one of these functions is refused; None when it is sound."""
    name = node.func.id  # type: ignore[attr-defined]
    least, most = ARGUMENTS[name]
    texts = [isinstance(one, ast.Constant) and isinstance(one.value, str) for one in node.args]
    wanted = [name == "table" and i != 1 for i in range(len(texts))]
    sound = least <= len(node.args) <= most and texts == wanted
    return None if sound else f"{ast.unparse(node)!r} (write {USAGE[name]})"


class Expansion(ast.NodeTransformer):
    """Rewrites calls of these functions; `moments` and `lookups` (by name) are what it has found."""

    def __init__(self, folder: str, value: Callable[[ast.expr, float], float | None]) -> None:
        """value: of a tree at a time, None where it depends on more than time."""
        self.folder, self.value = folder, value
        self.moments, self.lookups = Moments(), dict[str, Lookup]()

    def visit_Call(self, node: ast.Call) -> Any:
        """A call, from the inside."""
        self.generic_visit(node)
        name = node.func.id  # type: ignore[attr-defined]
        return getattr(self, f"_{name}")(*node.args) if name in ARGUMENTS else node

    def _extreme(self, name: str, *values: ast.expr) -> ast.expr:
        result, *others = values
        for other in others:
            self._crossing(ast.BinOp(result, ast.Sub(), other), self.moments.corners)
            result = call(name, result, other)
        return result

    def _min(self, *values: ast.expr) -> ast.expr:
        return self._extreme("minimum", *values)

    def _max(self, *values: ast.expr) -> ast.expr:
        return self._extreme("maximum", *values)

    def _clip(self, value: ast.expr, lowest: ast.expr, highest: ast.expr) -> ast.expr:
        for bound in (lowest, highest):
            self._crossing(ast.BinOp(value, ast.Sub(), bound), self.moments.corners)
        return call("minimum", call("maximum", value, lowest), highest)

    def _ramp(self, value: ast.expr, begin: ast.expr, end: ast.expr) -> ast.expr:
        for bound in (begin, end):
            self._crossing(ast.BinOp(value, ast.Sub(), bound), self.moments.corners)
        share = ast.BinOp(ast.BinOp(value, ast.Sub(), begin), ast.Div(), ast.BinOp(end, ast.Sub(), begin))
        return call("minimum", call("maximum", share, ast.Constant(0.0)), ast.Constant(1.0))

    def _step(self, value: ast.expr, begin: ast.expr) -> ast.expr:
        self._crossing(ast.BinOp(value, ast.Sub(), begin), self.moments.jumps)
        return call("where", ast.Compare(value, [ast.Lt()], [begin]), ast.Constant(0.0), ast.Constant(1.0))

    def _table(self, path: Any, value: ast.expr | None = None, column: Any = None) -> ast.expr:
        table = Table(os.path.join(self.folder, path.value), None if column is None else column.value)
        argument = value if value is not None else ast.Name("t", ast.Load())
        for places, found in ((table.places, self.moments.corners), (table.jumps, self.moments.jumps)):
            for place in places:
                self._crossing(ast.BinOp(argument, ast.Sub(), ast.Constant(float(place))), found)
        name = f"table_{len(self.lookups)}"
        self.lookups[name] = Lookup(table, argument)
        return ast.Name(name, ast.Load())

    def _crossing(self, difference: ast.BinOp, found: set[float]) -> None:
        """Note when a difference that is linear in time vanishes."""
        constant = self.value(difference.right, 0.0)
        if isinstance(difference.left, ast.Name) and difference.left.id == "t" and constant is not None:
            found.add(constant)
            return
        values = [self.value(difference, time) for time in (0.0, 1.0, 2.0)]
        if any(one is None or not np.isfinite(one) for one in values):
            return
        start, middle, end = values
        slope = middle - start  # type: ignore[operator]
        if slope != 0.0 and abs(end - middle - slope) <= _STRAIGHT * abs(slope):  # type: ignore[operator]
            found.add(-start / slope)  # type: ignore[operator]


def call(name: str, *arguments: ast.expr) -> ast.expr:
    """A call of a function of numexpr."""
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), [])
