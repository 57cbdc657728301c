"""Derivatives of formulas in time, from tree to tree; at a jump or a corner, the one after it."""

import ast
from collections.abc import Callable
from dataclasses import replace

from parsolid.scene.time_functions import Lookup, call

_ZERO, _ONE, _TWO = (ast.Constant(value) for value in (0.0, 1.0, 2.0))
# functions that jump from one constant to another, or say whether
_FLAT = {"sign", "floor", "ceil", "round", "trunc", "isnan", "isinf", "isfinite", "signbit"}


def _times(a: ast.expr, b: ast.expr) -> ast.expr:
    if _ZERO in (a, b):
        return _ZERO
    return b if a is _ONE else a if b is _ONE else ast.BinOp(a, ast.Mult(), b)


def _plus(a: ast.expr, b: ast.expr) -> ast.expr:
    return b if a is _ZERO else a if b is _ZERO else ast.BinOp(a, ast.Add(), b)


def _minus(a: ast.expr, b: ast.expr) -> ast.expr:
    if b is _ZERO:
        return a
    return ast.UnaryOp(ast.USub(), b) if a is _ZERO else ast.BinOp(a, ast.Sub(), b)


def _over(a: ast.expr, b: ast.expr) -> ast.expr:
    return _ZERO if a is _ZERO else ast.BinOp(a, ast.Div(), b)


def _square(a: ast.expr) -> ast.expr:
    return ast.BinOp(a, ast.Mult(), a)


# d f(x) / dx
_OF_ONE: dict[str, Callable[[ast.expr], ast.expr]] = {
    "sin": lambda x: call("cos", x),
    "cos": lambda x: _minus(_ZERO, call("sin", x)),
    "tan": lambda x: _plus(_ONE, _square(call("tan", x))),
    "exp": lambda x: call("exp", x),
    "expm1": lambda x: call("exp", x),
    "log": lambda x: _over(_ONE, x),
    "log1p": lambda x: _over(_ONE, _plus(_ONE, x)),
    "sqrt": lambda x: _over(ast.Constant(0.5), call("sqrt", x)),
    "sinh": lambda x: call("cosh", x),
    "cosh": lambda x: call("sinh", x),
    "tanh": lambda x: _minus(_ONE, _square(call("tanh", x))),
    "arctan": lambda x: _over(_ONE, _plus(_ONE, _square(x))),
    "arcsin": lambda x: _over(_ONE, call("sqrt", _minus(_ONE, _square(x)))),
    "arccos": lambda x: _minus(_ZERO, _over(_ONE, call("sqrt", _minus(_ONE, _square(x))))),
    "abs": lambda x: call("sign", x),
}


class TimeDerivative:
    """d/dt of trees; lookups: what names stand for, with the slopes of those whose argument depends on time added."""

    def __init__(self, lookups: dict[str, Lookup]) -> None:
        self.lookups = dict(lookups)

    def of(self, tree: ast.expr) -> ast.expr:
        """The derivative; raises ValueError for a function that has none here."""
        if isinstance(tree, ast.Constant):
            return _ZERO
        if isinstance(tree, ast.Name):
            return self._of_name(tree)
        if isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.USub | ast.UAdd):
            inner = self.of(tree.operand)
            return inner if isinstance(tree.op, ast.UAdd) else _minus(_ZERO, inner)
        if isinstance(tree, ast.BinOp):
            return self._of_pair(tree)
        if isinstance(tree, ast.Call):
            return self._of_call(tree.func.id, tree.args)  # type: ignore[attr-defined]
        raise ValueError(f"no rate of {ast.unparse(tree)!r}")

    def _of_name(self, tree: ast.Name) -> ast.expr:
        if tree.id not in self.lookups:
            return _ONE if tree.id == "t" else _ZERO
        lookup = self.lookups[tree.id]
        inner = self.of(lookup.argument)
        if inner is _ZERO:
            return _ZERO
        name = f"slope_of_{tree.id}"
        self.lookups[name] = replace(lookup, slopes=True)
        return _times(ast.Name(name, ast.Load()), inner)

    def _of_pair(self, tree: ast.BinOp) -> ast.expr:
        a, b = tree.left, tree.right
        da, db = self.of(a), self.of(b)
        if isinstance(tree.op, ast.Add):
            return _plus(da, db)
        if isinstance(tree.op, ast.Sub):
            return _minus(da, db)
        if isinstance(tree.op, ast.Mult):
            return _plus(_times(da, b), _times(a, db))
        if isinstance(tree.op, ast.Div):
            return _minus(_over(da, b), _over(_times(a, db), _square(b)))
        if isinstance(tree.op, ast.Pow) and db is _ZERO:
            less = ast.BinOp(b, ast.Sub(), _ONE)
            return _times(_times(b, ast.BinOp(a, ast.Pow(), less)), da)
        if isinstance(tree.op, ast.Pow):
            of_logarithm = _plus(_times(db, call("log", a)), _over(_times(b, da), a))
            return _times(tree, of_logarithm)
        if da is _ZERO and db is _ZERO:
            return _ZERO
        raise ValueError(f"no rate of {ast.unparse(tree)!r}")

    def _of_call(self, name: str, values: list[ast.expr]) -> ast.expr:
        if name == "where":
            a, b = self.of(values[1]), self.of(values[2])
            return _ZERO if a is _ZERO and b is _ZERO else call("where", values[0], a, b)
        rates = [self.of(value) for value in values]
        if name in _FLAT or all(rate is _ZERO for rate in rates):
            return _ZERO
        if name in ("minimum", "maximum"):
            # where both are equal, what the first does after a corner of time that rises
            less = ast.Compare(values[0], [ast.Lt() if name == "minimum" else ast.GtE()], [values[1]])
            return call("where", less, *rates)
        if name in _OF_ONE:
            return _times(_OF_ONE[name](values[0]), rates[0])
        raise ValueError(f"no rate of {name!r}")
