"""Terms of formulas: their values, their rates in time, and their splitting into functions of time and of place.

A term is a tree of constants, names and functions. Its rate is also a term, made by the rules of the table FUNCTIONS;
at a jump or corner it is the right-sided rate.
"""

import ast
import csv
import math
import operator
import os
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def read_csv_table(path: str, column: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """First column and a column of values, (rows,) each, of a CSV file with or without a line of names.

    column: name of the column of values (default: the second column). Blank lines are skipped. Raises ValueError with
    the faulty line.
    """
    file_name = os.path.basename(path)
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            lines = [(reader.line_num, [word.strip() for word in row]) for row in reader if any(map(str.strip, row))]
    except (OSError, ValueError, csv.Error) as error:
        raise ValueError(f"no CSV file {file_name!r} ({getattr(error, 'strerror', None) or error})") from None
    names: list[str] = []
    if lines and all(_number(word) is None for word in lines[0][1]):
        names = lines.pop(0)[1]
    if column is not None and column not in names:
        raise ValueError(f"no column {column!r} among {', '.join(names) or '(no names)'} of {file_name!r}")
    number = 1 if column is None else names.index(column)
    rows = []
    for line, words in lines:
        pair = [_number(words[k]) if k < len(words) else None for k in (0, number)]
        if None in pair or not np.isfinite(np.array(pair, float)).all():
            text = ",".join(words)
            raise ValueError(f"line {line} of {file_name!r} without two finite numbers between commas: {text!r}")
        rows.append(pair)
    if not rows:
        raise ValueError(f"no rows of numbers in {file_name!r}")
    places, values = np.array(rows, float).T
    return places, values


class Table:
    """Two columns of a CSV file: linear between rows, constant outside; a repeated abscissa is a jump."""

    def __init__(self, path: str, column: str | None = None) -> None:
        """column: name of the column of values (default: the second). Raises ValueError for a faulty file."""
        self.places, self.values = read_csv_table(path, column)
        if (np.diff(self.places) < 0.0).any():
            raise ValueError(f"a first column that falls in {os.path.basename(path)!r}")

    def at(self, places: np.ndarray) -> np.ndarray:
        """Values at abscissae; at a jump the value after it."""
        return np.interp(places, self.places, self.values)

    def slope(self, places: np.ndarray) -> np.ndarray:
        """Slopes at abscissae, at a corner the slope after it; 0 outside the table."""
        after = np.searchsorted(self.places, places, side="right")
        inside = (after > 0) & (after < len(self.places))
        end = np.where(inside, after, 1)
        if len(self.places) == 1:
            return np.zeros(np.shape(places))
        rise, run = self.values[end] - self.values[end - 1], self.places[end] - self.places[end - 1]
        return np.where(inside, rise / np.where(run > 0.0, run, 1.0), 0.0)

    @property
    def jumps(self) -> np.ndarray:
        """Abscissae at which the values jump."""
        return self.places[1:][np.diff(self.places) == 0.0]


# exponents for which powers are computed as products
_WHOLE = frozenset(map(float, range(1, 17)))


def _power(base: Any, exponent: Any) -> Any:
    if not isinstance(exponent, float) or exponent not in _WHOLE:
        return base**exponent
    result, square, left = None, base, int(exponent)
    while left:
        if left & 1:
            result = square if result is None else result * square
        left >>= 1
        square = square * square if left else square
    return result


def _where(condition: Any, a: Any, b: Any) -> Any:
    if np.asarray(condition).dtype != bool:
        raise TypeError("where() wants a comparison first")
    return np.where(condition, a, b)


def _ramp_of_numbers(x: float, begin: float, end: float) -> float:
    share = (x - begin) / (end - begin)
    return 0.0 if share < 0.0 else min(share, 1.0)


class Function(NamedTuple):
    """A function of formulas.

    value: the numpy function; takes: number of arguments; rate: its rate in time, a formula of the arguments a, b, c
    and their rates da, db, dc, or None; number: the same function of Python floats, five times as fast, or None; it may
    raise ArithmeticError or ValueError where numpy gives inf or nan
    """

    value: Callable[..., Any]
    takes: int = 1
    rate: str | None = None
    number: Callable[..., Any] | None = None


_RATES = {
    "sin": "cos(a)*da",
    "cos": "-sin(a)*da",
    "tan": "(1 + tan(a)**2)*da",
    "exp": "exp(a)*da",
    "expm1": "exp(a)*da",
    "log": "da/a",
    "log1p": "da/(1 + a)",
    "log2": "da/(a*log(2))",
    "log10": "da/(a*log(10))",
    "sqrt": "0.5*da/sqrt(a)",
    "sinh": "cosh(a)*da",
    "cosh": "sinh(a)*da",
    "tanh": "(1 - tanh(a)**2)*da",
    "arctan": "da/(1 + a*a)",
    "arcsin": "da/sqrt(1 - a*a)",
    "arccos": "-da/sqrt(1 - a*a)",
    "arcsinh": "da/sqrt(a*a + 1)",
    "arccosh": "da/sqrt(a*a - 1)",
    "arctanh": "da/(1 - a*a)",
}
_FLAT = ("sign", "floor", "ceil", "round", "trunc", "isnan", "isinf", "isfinite", "signbit")
# functions by name
FUNCTIONS: dict[str, Function] = {
    **{
        name: Function(getattr(np, name), 1, rate, getattr(math, name.replace("arc", "a")))
        for name, rate in _RATES.items()
    },
    "abs": Function(np.abs, 1, "sign(a)*da", abs),
    **{name: Function(getattr(np, name), 1, "0") for name in _FLAT},
    **{name: Function(getattr(np, name), 2) for name in ("arctan2", "fmod", "hypot", "copysign", "nextafter")},
    "atan2": Function(np.arctan2, 2),
    "where": Function(_where, 3, "where(a, db, dc)", lambda condition, a, b: a if condition else b),
    # rates at a = b are right-sided if a rises faster than b; nan is kept
    "minimum": Function(np.minimum, 2, "where(a < b, da, db)", lambda a, b: a if a < b or math.isnan(a) else b),
    "maximum": Function(np.maximum, 2, "where(a >= b, da, db)", lambda a, b: a if a > b or math.isnan(a) else b),
    "clip": Function(
        lambda x, lowest, highest: np.minimum(np.maximum(x, lowest), highest),
        3,
        "where(maximum(a, b) < c, where(a >= b, da, db), dc)",
        lambda x, lowest, highest: min(max(x, lowest), highest),
    ),
    "ramp": Function(
        lambda x, begin, end: np.minimum(np.maximum((x - begin) / (end - begin), 0.0), 1.0),
        3,
        "where(((a - b)/(c - b) >= 0) & ((a - b)/(c - b) < 1), (da + ((a - c)*db - (a - b)*dc)/(c - b))/(c - b), 0)",
        _ramp_of_numbers,
    ),
    "step": Function(lambda x, begin: np.where(x < begin, 0.0, 1.0), 2, "0", lambda x, b: 0.0 if x < b else 1.0),
}
# operators with logical values, by their names in the syntax tree
LOGICAL: dict[str, Function] = {
    "Lt": Function(np.less, 2, "0", operator.lt),
    "LtE": Function(np.less_equal, 2, "0", operator.le),
    "Gt": Function(np.greater, 2, "0", operator.gt),
    "GtE": Function(np.greater_equal, 2, "0", operator.ge),
    "Eq": Function(np.equal, 2, "0", operator.eq),
    "NotEq": Function(np.not_equal, 2, "0", operator.ne),
    "BitAnd": Function(np.bitwise_and, 2, "0", operator.and_),
    "BitOr": Function(np.bitwise_or, 2, "0", operator.or_),
    "Invert": Function(np.invert, 1, "0", operator.not_),
}
_APPLIED: dict[str, Function] = (
    FUNCTIONS
    | LOGICAL
    | {
        "Add": Function(operator.add, 2, "da + db", operator.add),
        "Sub": Function(operator.sub, 2, "da - db", operator.sub),
        "Mult": Function(operator.mul, 2, "da*b + db*a", operator.mul),
        "Div": Function(operator.truediv, 2, "da/b - a*db/b/b", operator.truediv),
        # math.pow: the power of a negative float is complex in Python
        "Pow": Function(
            _power, 2, "a**b*(db*log(a) + da*b/a)", lambda a, b: _power(a, b) if b in _WHOLE else math.pow(a, b)
        ),
        "Mod": Function(np.fmod, 2),
        "USub": Function(operator.neg, 1, "-da", operator.neg),
        "UAdd": Function(operator.pos, 1, "da", operator.pos),
        # the first argument is a Table
        "table": Function(lambda table, place: table.at(place), 2, "slope(a, b)*db"),
        "slope": Function(lambda table, place: table.slope(place), 2, "0"),
    }
)


class Term:
    """A constant, a name, or a function of other terms.

    names: those that its value depends on; looked_up: whether it contains a table; logical: whether its value may be
    boolean
    """

    names: frozenset[str]
    looked_up: bool
    logical: bool

    def __init__(self, of: str = "", *arguments: "Term", constant: Any = None) -> None:
        """of: the function or operator, or a name if there are neither arguments nor a constant."""
        self.of, self.arguments, self.constant = of, arguments, constant
        own = () if arguments or constant is not None else (of,)
        self.names = frozenset(own).union(*(one.names for one in arguments))
        self.looked_up = of == "table" or any(one.looked_up for one in arguments)
        parts = [one.logical for one in arguments]
        self.logical = of in LOGICAL or isinstance(constant, np.bool_) or (parts != [] and all(parts))

    def __getstate__(self) -> dict[str, Any]:
        # the cached function cannot be pickled
        return {name: value for name, value in vars(self).items() if name != "value"}

    @cached_property
    def value(self) -> Callable[[Any], Any]:
        """The value as a function of a mapping name -> value, see `evaluator`."""
        return self.evaluator()

    def evaluator(self, fast: bool = False) -> Callable[[Any], Any]:
        """The value as a function of a mapping name -> value.

        fast: as a function of the time alone, a Python float; it may raise ArithmeticError or ValueError where numpy
        gives inf or nan
        """
        if self.constant is not None:
            value = self.constant.item() if fast and isinstance(self.constant, np.generic) else self.constant
            return lambda known: value
        if not self.arguments:
            return (lambda time: time) if fast else operator.itemgetter(self.of)
        function = _APPLIED[self.of]
        apply, given = function.value, [one.evaluator(fast) for one in self.arguments]
        if fast and self.of != "where" and self.of not in LOGICAL and any(one.logical for one in self.arguments):
            # sums of booleans are booleans in numpy
            return lambda known: function.value(*[np.asarray(one(known))[()] for one in given])
        if fast and function.number is not None:
            apply = function.number
        if len(given) == 1:
            (first,) = given
            return lambda known: apply(first(known))
        if len(given) == 2:
            first, second = given
            return lambda known: apply(first(known), second(known))
        return lambda known: apply(*[one(known) for one in given])

    def in_time(self) -> Callable[[float], Any]:
        """The value of a term in t alone as a function of time [s]."""
        fast, plain = self.evaluator(True), self.evaluator()

        def value(time: float) -> Any:
            try:
                return fast(time)
            except (ArithmeticError, ValueError):
                with np.errstate(all="ignore"):
                    return plain({"t": np.float64(time)})

        return value

    def known_at(self, places: Mapping[str, Any]) -> "Term":
        """The term in t alone at points; places: X, Y, Z -> coordinates (n,) [m]."""
        if "t" not in self.names:
            return Term(constant=np.asarray(self.value(places))[()])
        return Term(self.of, *(one.known_at(places) for one in self.arguments))

    def split(self) -> list[tuple["Term", "Term"]] | None:
        """Its value as a sum of products (term in t alone, term in place alone); None if it is not such a sum."""
        if "t" not in self.names:
            return [(ONE, self)]
        if len(self.names) == 1:
            return [(self, ONE)]
        if self.of not in ("Add", "Sub", "Mult", "Div") or any(one.logical for one in self.arguments):
            return None
        left, right = (one.split() for one in self.arguments)
        if left is None or right is None:
            return None
        if self.of in ("Add", "Sub"):
            return left + [(f, Term("USub", mode) if self.of == "Sub" else mode) for f, mode in right]
        if self.of == "Mult" and len(left) == 1:
            left, right = right, left
        # a product of two sums is not expanded, because its terms may cancel
        if len(right) > 1:
            return None
        return [(_over(self.of, f, right[0][0]), _over(self.of, mode, right[0][1])) for f, mode in left]

    def rate(self) -> "Term":
        """Its rate in time, ZERO if it changes only by jumps. Raises ValueError for a function without a rule."""
        if not self.arguments:
            return ONE if self.of == "t" else ZERO
        rule = _APPLIED[self.of].rate
        rates = [one.rate() for one in self.arguments] if rule != "0" else []
        if all(one is ZERO for one in rates):
            return ZERO
        if rule is None:
            raise ValueError(f"no rate of {self.of!r}")
        if self.of == "Pow" and rates[1] is ZERO:
            rule = "b*a**(b - 1)*da"
        named = dict(zip("abc", self.arguments)) | {f"d{name}": one for name, one in zip("abc", rates)}
        return _by_rule(_parsed(rule), named)


ONE, ZERO = Term(constant=np.float64(1.0)), Term(constant=np.float64(0.0))


def _over(of: str, a: Term, b: Term) -> Term:
    """The product or quotient of two terms, without factors 1."""
    if b is ONE:
        return a
    return b if a is ONE and of == "Mult" else Term(of, a, b)


@cache
def _parsed(rule: str) -> ast.expr:
    return ast.parse(rule, mode="eval").body


def parts_of(node: ast.expr) -> tuple[str, Sequence[ast.expr]]:
    """The function or operator of a node of the syntax tree, and the nodes of its arguments."""
    if isinstance(node, ast.BinOp):
        return type(node.op).__name__, (node.left, node.right)
    if isinstance(node, ast.Compare):
        return type(node.ops[0]).__name__, (node.left, node.comparators[0])
    if isinstance(node, ast.UnaryOp):
        return type(node.op).__name__, (node.operand,)
    assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    return node.func.id, node.args


def _by_rule(node: ast.expr, named: Mapping[str, Term]) -> Term:
    """The term of a rule; parts with a factor zero are left out, because their other factors may not be finite."""
    if isinstance(node, ast.Name):
        return named[node.id]
    if isinstance(node, ast.Constant):
        return Term(constant=np.float64(node.value)) if node.value else ZERO  # type: ignore[arg-type]
    of, nodes = parts_of(node)
    given = [_by_rule(one, named) for one in nodes]
    zero = [one is ZERO for one in given]
    if (of == "Mult" and any(zero)) or (of in ("Div", "USub") and zero[0]) or (of == "where" and all(zero[1:])):
        return ZERO
    if of in ("Add", "Sub") and zero[1]:
        return given[0]
    if of in ("Add", "Sub") and zero[0]:
        return given[1] if of == "Add" else Term("USub", given[1])
    return Term(of, *given)
