"""Terms of formulas: numpy functions of values and, where they are asked for, of rates of change in time.

A term is a tree of constants, names, functions and tables, which are read from CSV files. Its rate is found with dual
numbers: every value has its rate, None where it does not change in time; at a jump or a corner it is the one after it.
"""

import csv
import math
import operator
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def read_csv_table(path: str, column: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Places and values (rows,) of a file of two or more columns of numbers; a first line of numbers is a row.

    column: name of the values' column, the second one unless given. Blank lines are left out. Raises ValueError with
    the line at fault.
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
            raise ValueError(
                f"line {line} of {file_name!r} without two finite numbers between commas: {','.join(words)!r}"
            )
        rows.append(pair)
    if not rows:
        raise ValueError(f"no rows of numbers in {file_name!r}")
    places, values = np.array(rows, float).T
    return places, values


class Dual(NamedTuple):
    """A value and its rate in time, both numbers or (n,) arrays."""

    value: Any
    rate: Any = None


class Function(NamedTuple):
    """A function that takes so many values.

    rate: that of its value, from the value and the duals that are given, None where it has none; flat: whether it is 0
    wherever there is one; number: the value of Python's numbers, found five times as fast, None where numpy alone has
    it; where it raises ArithmeticError or ValueError, numpy has inf or nan.
    """

    value: Callable[..., Any]
    takes: int = 1
    rate: Callable[..., Any] | None = None
    flat: bool = False
    number: Callable[..., Any] | None = None


def _sum(a: Any, b: Any) -> Any:
    return b if a is None else a if b is None else a + b


def _product(rate: Any, factor: Any) -> Any:
    return None if rate is None else rate * factor


# whole exponents of which powers are products
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


def _rate_of_power(value: Any, a: Dual, b: Dual) -> Any:
    if b.rate is None:
        return a.rate * b.value * _power(a.value, b.value - 1.0)
    return value * _sum(b.rate * np.log(a.value), _product(a.rate, b.value / a.value))


def _where(condition: Any, a: Any, b: Any) -> Any:
    if np.asarray(condition).dtype != bool:
        raise TypeError("where() wants a comparison first")
    return np.where(condition, a, b)


def _chosen(first: Any, a: Dual, b: Dual) -> Any:
    rates = [0.0 if one.rate is None else one.rate for one in (a, b)]
    return rates[0 if first else 1] if isinstance(first, bool) else np.where(first, *rates)


def _rate_of_clip(value: Any, x: Dual, lowest: Dual, highest: Dual) -> Any:
    larger = Dual(np.maximum(x.value, lowest.value), _chosen(x.value >= lowest.value, x, lowest))
    return _chosen(larger.value < highest.value, larger, highest)


def _share(x: Any, begin: Any, end: Any) -> Any:
    return (x - begin) / (end - begin)


def _rate_of_ramp(value: Any, x: Dual, begin: Dual, end: Dual) -> Any:
    share, width = _share(x.value, begin.value, end.value), end.value - begin.value
    rate = _sum(_product(x.rate, 1.0 / width), _product(begin.rate, (share - 1.0) / width))
    rate = _sum(rate, _product(end.rate, -share / width))
    return _rate_of_clip(value, Dual(share, rate), Dual(0.0), Dual(1.0))


# d f(x) / dx by a module: numpy, or math for Python's numbers
_SLOPES: dict[str, Callable[[Any, Any], Any]] = {
    "sin": lambda by, x: by.cos(x),
    "cos": lambda by, x: -by.sin(x),
    "tan": lambda by, x: 1.0 + by.tan(x) ** 2,
    "exp": lambda by, x: by.exp(x),
    "expm1": lambda by, x: by.exp(x),
    "log": lambda by, x: 1.0 / x,
    "log1p": lambda by, x: 1.0 / (1.0 + x),
    "log2": lambda by, x: 1.0 / (x * by.log(2.0)),
    "log10": lambda by, x: 1.0 / (x * by.log(10.0)),
    "sqrt": lambda by, x: 0.5 / by.sqrt(x),
    "sinh": lambda by, x: by.cosh(x),
    "cosh": lambda by, x: by.sinh(x),
    "tanh": lambda by, x: 1.0 - by.tanh(x) ** 2,
    "arctan": lambda by, x: 1.0 / (1.0 + x * x),
    "arcsin": lambda by, x: 1.0 / by.sqrt(1.0 - x * x),
    "arccos": lambda by, x: -1.0 / by.sqrt(1.0 - x * x),
    "arcsinh": lambda by, x: 1.0 / by.sqrt(x * x + 1.0),
    "arccosh": lambda by, x: 1.0 / by.sqrt(x * x - 1.0),
    "arctanh": lambda by, x: 1.0 / (1.0 - x * x),
    "abs": lambda by, x: np.sign(x),
}


def _with_slope(name: str) -> Function:
    slope = _SLOPES[name]

    def rate(value: Any, x: Dual) -> Any:
        return slope(math if type(x.value) is float else np, x.value) * x.rate

    number = abs if name == "abs" else getattr(math, name.replace("arc", "a"))
    return Function(getattr(np, name), 1, rate, number=number)


_FLAT = ("sign", "floor", "ceil", "round", "trunc", "isnan", "isinf", "isfinite", "signbit")
# what a formula may call
FUNCTIONS: dict[str, Function] = {
    **{name: _with_slope(name) for name in _SLOPES},
    **{name: Function(getattr(np, name), 1, flat=True) for name in _FLAT},
    **{name: Function(getattr(np, name), 2) for name in ("arctan2", "fmod", "hypot", "copysign", "nextafter")},
    # as C and Fortran call it
    "atan2": Function(np.arctan2, 2),
    "where": Function(
        _where,
        3,
        lambda value, condition, a, b: _chosen(condition.value, a, b),
        number=lambda condition, a, b: a if condition else b,
    ),
    # where both are equal, what the first does after a corner of time that rises; what is not a number stays
    "minimum": Function(
        np.minimum,
        2,
        lambda value, a, b: _chosen(a.value < b.value, a, b),
        number=lambda a, b: a if a < b or math.isnan(a) else b,
    ),
    "maximum": Function(
        np.maximum,
        2,
        lambda value, a, b: _chosen(a.value >= b.value, a, b),
        number=lambda a, b: a if a > b or math.isnan(a) else b,
    ),
    "clip": Function(
        lambda x, lowest, highest: np.minimum(np.maximum(x, lowest), highest),
        3,
        _rate_of_clip,
        number=lambda x, lowest, highest: min(max(x, lowest), highest),
    ),
    "ramp": Function(
        lambda *given: np.minimum(np.maximum(_share(*given), 0.0), 1.0),
        3,
        _rate_of_ramp,
        number=lambda *given: 0.0 if (share := _share(*given)) < 0.0 else min(share, 1.0),
    ),
    "step": Function(
        lambda x, begin: np.where(x < begin, 0.0, 1.0),
        2,
        flat=True,
        number=lambda x, begin: 0.0 if x < begin else 1.0,
    ),
}
# operators, by their names in a parsed text; those whose values are true or false first
_LOGICAL: dict[str, tuple[Any, Any]] = {
    "Lt": (np.less, operator.lt),
    "LtE": (np.less_equal, operator.le),
    "Gt": (np.greater, operator.gt),
    "GtE": (np.greater_equal, operator.ge),
    "Eq": (np.equal, operator.eq),
    "NotEq": (np.not_equal, operator.ne),
    "BitAnd": (np.bitwise_and, operator.and_),
    "BitOr": (np.bitwise_or, operator.or_),
    "Invert": (np.invert, operator.not_),
}
LOGICAL = frozenset(_LOGICAL)


def _arithmetic(function: Callable[..., Any], rate: Callable[..., Any]) -> Function:
    return Function(function, rate=rate, number=function)


_OPERATORS: dict[str, Function] = {
    **{name: Function(function, flat=True, number=number) for name, (function, number) in _LOGICAL.items()},
    "Add": _arithmetic(operator.add, lambda value, a, b: _sum(a.rate, b.rate)),
    "Sub": _arithmetic(operator.sub, lambda value, a, b: _sum(a.rate, _product(b.rate, -1.0))),
    "Mult": _arithmetic(operator.mul, lambda value, a, b: _sum(_product(a.rate, b.value), _product(b.rate, a.value))),
    "Div": _arithmetic(
        operator.truediv, lambda value, a, b: _sum(_product(a.rate, 1.0 / b.value), _product(b.rate, -value / b.value))
    ),
    # of a negative number Python's own power is complex
    "Pow": Function(_power, rate=_rate_of_power, number=lambda a, b: _power(a, b) if b in _WHOLE else math.pow(a, b)),
    "Mod": Function(np.fmod),
    "USub": _arithmetic(operator.neg, lambda value, a: -a.rate),
    "UAdd": _arithmetic(operator.pos, lambda value, a: a.rate),
}


def _by_numpy(function: Callable[..., Any], *numbers: float) -> float:
    """A function of numbers for which Python has no value."""
    with np.errstate(all="ignore"):
        return float(function(*map(np.float64, numbers)))


def _in_time(function: Callable[..., Any], given: Sequence[Callable[[Any], Any]], fast: Any) -> Callable[[Any], Any]:
    """A function of functions of time, as a function of time; fast: the same of Python's numbers, if these are given
    and there is one."""
    if fast is None:
        return lambda time: function(*[one(time) for one in given])
    first, second = given[0], given[-1]

    def of_one(time: float) -> Any:
        number = first(time)
        try:
            return fast(number)
        except (ArithmeticError, ValueError):
            return _by_numpy(function, number)

    def of_two(time: float) -> Any:
        a, b = first(time), second(time)
        try:
            return fast(a, b)
        except (ArithmeticError, ValueError):
            return _by_numpy(function, a, b)

    def of_several(time: float) -> Any:
        numbers = [one(time) for one in given]
        try:
            return fast(*numbers)
        except (ArithmeticError, ValueError):
            return _by_numpy(function, *numbers)

    return {1: of_one, 2: of_two}.get(len(given), of_several)


class Product(NamedTuple):
    """A function of time (None: 1) times what is the same at all times, a number or (n,); pointwise: whether the
    function has (n,) values, too."""

    factor: Callable[[Any], Any] | None
    mode: Any
    pointwise: bool = False

    def over(self, other: "Product", divide: Callable[[Any, Any], Any]) -> "Product":
        """This and another one, multiplied or divided."""
        mode, pointwise = divide(self.mode, other.mode), self.pointwise or other.pointwise
        if other.factor is None:
            return Product(self.factor, mode, pointwise)
        factors = [self.factor or (lambda time: 1.0), other.factor]
        return Product(_in_time(divide, factors, None if pointwise else divide), mode, pointwise)


class Term:
    """Part of a formula; names: those that its value depends on; looked_up: whether a table is in it; has_rate: whether
    its value changes in time other than by jumps; logical: whether it may be true or false, which no numbers add to."""

    names: frozenset[str] = frozenset()
    looked_up = has_rate = logical = False

    def value(self, known: Mapping[str, Any]) -> Any:
        """The value, of those that the names stand for."""
        raise NotImplementedError

    def at(self, places: Mapping[str, Any]) -> Callable[[Any], Any]:
        """The value as a function of time alone, at coordinates (n,); what does not change in time is found once."""
        if "t" in self.names:
            return self._in_time_at(places)
        value = self.value(places)
        number = value.item() if isinstance(value, np.generic) else value
        return lambda time: number

    def _in_time_at(self, places: Mapping[str, Any]) -> Callable[[Any], Any]:
        """See `at`, of a term with time in it."""
        raise NotImplementedError

    def products(self, places: Mapping[str, Any]) -> list[Product]:
        """The value at coordinates (n,) as a sum of products; of one alone, whose factor has (n,) values, where it is
        no such sum."""
        if "t" not in self.names:
            return [Product(None, self.value(places))]
        if len(self.names) == 1:
            return [Product(self.at(places), 1.0)]
        return self._separated(places) or [Product(self.at(places), 1.0, True)]

    def _separated(self, places: Mapping[str, Any]) -> list[Product]:
        """See `products`, of a term with time in it; nothing where it is no such sum."""
        return []

    def dual_at(self, places: Mapping[str, Any], fast: bool) -> Callable[[Any], Dual]:
        """The value and its rate in time as a function of time, at coordinates (n,); fast: with Python's numbers, which
        raise ArithmeticError or ValueError where numpy has inf or nan. Raises ValueError for a function that has no
        rate."""
        if self.has_rate:
            return self._dual_in_time_at(places, fast and self.names == {"t"})
        value = self.at(places)
        return lambda time: Dual(value(time))

    def _dual_in_time_at(self, places: Mapping[str, Any], fast: bool) -> Callable[[Any], Dual]:
        """See `dual_at`, of a term with a rate."""
        raise NotImplementedError

    def in_time(self, time: float) -> float | None:
        """The value at a time [s]; None where it depends on more, or on a table."""
        return None if self.looked_up or self.names - {"t"} else float(self.value({"t": np.float64(time)}))


class Constant(Term):
    """A number, or true or false."""

    def __init__(self, number: Any) -> None:
        self.number, self.logical = number, isinstance(number, np.bool_)

    def value(self, known: Mapping[str, Any]) -> Any:
        return self.number


class Name(Term):
    """A coordinate or the time."""

    def __init__(self, name: str) -> None:
        self.name, self.names, self.has_rate = name, frozenset((name,)), name == "t"

    def value(self, known: Mapping[str, Any]) -> Any:
        return known[self.name]

    def _in_time_at(self, places: Mapping[str, Any]) -> Callable[[Any], Any]:
        return lambda time: time

    def _dual_in_time_at(self, places: Mapping[str, Any], fast: bool) -> Callable[[Any], Dual]:
        return lambda time: Dual(time, 1.0)


class Applied(Term):
    """A function or an operator of other terms."""

    def __init__(self, name: str, *arguments: Term) -> None:
        self.name, self.arguments = name, arguments
        self.names = frozenset().union(*(one.names for one in arguments))
        self.looked_up = any(one.looked_up for one in arguments)
        self.has_rate = not self.function.flat and any(one.has_rate for one in arguments)
        self.logical = name in LOGICAL or all(one.logical for one in arguments)

    @property
    def function(self) -> Function:
        """What is applied."""
        return _OPERATORS[self.name] if self.name in _OPERATORS else FUNCTIONS[self.name]

    @property
    def _of_numbers(self) -> Callable[..., Any] | None:
        """What is applied to Python's numbers, None where nothing but numpy has it."""
        if self.name != "where" and self.name not in LOGICAL and any(one.logical for one in self.arguments):
            # of which sums are true or false themselves in numpy
            return lambda *given: self.function.value(*(np.asarray(one)[()] for one in given))
        return self.function.number

    def value(self, known: Mapping[str, Any]) -> Any:
        return self.function.value(*[one.value(known) for one in self.arguments])

    def _in_time_at(self, places: Mapping[str, Any]) -> Callable[[Any], Any]:
        function, fast, given = self.function.value, None, self.arguments
        if self.names == {"t"}:
            fast = self._of_numbers
            if len(given) == 2 and fast is not None and not given[0].names and not given[0].looked_up:
                constant, given = given[0].value(places), given[1:]
                function, fast = partial(function, constant), partial(fast, constant.item())
        return _in_time(function, [one.at(places) for one in given], fast)

    def _separated(self, places: Mapping[str, Any]) -> list[Product]:
        if self.name not in ("Add", "Sub", "Mult", "Div") or any(one.logical for one in self.arguments):
            return []
        left, right = (one.products(places) for one in self.arguments)
        if self.name in ("Add", "Sub"):
            sign = 1.0 if self.name == "Add" else -1.0
            return [*left, *(one._replace(mode=sign * one.mode) for one in right)]
        # of two sums the product may cancel
        if len(right) == 1:
            return [one.over(right[0], self.function.value) for one in left]
        return (
            [one.over(left[0], self.function.value) for one in right] if (len(left), self.name) == (1, "Mult") else []
        )

    def _dual_in_time_at(self, places: Mapping[str, Any], fast: bool) -> Callable[[Any], Dual]:
        if self.function.rate is None:
            raise ValueError(f"no rate of {self.name!r}")
        rate, given = self.function.rate, [one.dual_at(places, fast) for one in self.arguments]
        function = self._of_numbers if fast and self._of_numbers is not None else self.function.value

        def of_one(time: Any) -> Dual:
            only = given[0](time)
            value = function(only.value)
            return Dual(value, rate(value, only))

        def of_several(time: Any) -> Dual:
            duals = [one(time) for one in given]
            value = function(*[one.value for one in duals])
            return Dual(value, rate(value, *duals))

        return of_one if len(given) == 1 else of_several


class Looked(Term):
    """The values of a table at those of a term."""

    looked_up = True

    def __init__(self, table: "Table", argument: Term) -> None:
        self.table, self.argument, self.names, self.has_rate = table, argument, argument.names, argument.has_rate

    def value(self, known: Mapping[str, Any]) -> Any:
        return self.table.at(self.argument.value(known))

    def _in_time_at(self, places: Mapping[str, Any]) -> Callable[[Any], Any]:
        table, argument = self.table, self.argument.at(places)
        return lambda time: table.at(argument(time))

    def _dual_in_time_at(self, places: Mapping[str, Any], fast: bool) -> Callable[[Any], Dual]:
        table, argument = self.table, self.argument.dual_at(places, fast)

        def dual(time: Any) -> Dual:
            place = argument(time)
            return Dual(table.at(place.value), table.slope(place.value) * place.rate)

        return dual


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
