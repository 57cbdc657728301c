"""Terms of formulas: their values, their rates in time, and their splitting into functions of time and of place.

A term is a constant, a name, or a function of other terms. The table FUNCTIONS has the numpy function of each name and
the rule for its rate in time, which is also a term; at a jump or corner it is the right-sided rate.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property, partial
from typing import Any, NamedTuple

import numpy as np

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
OPERATIONS: dict[str, Function] = (
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

    def __init__(self, function: str = "", *arguments: "Term", constant: Any = None) -> None:
        """function: a name of OPERATIONS; the name itself if there are neither arguments nor a constant."""
        self.function, self.arguments, self.constant = function, arguments, constant
        own = () if arguments or constant is not None else (function,)
        self.names: frozenset[str] = frozenset(own).union(*(one.names for one in arguments))
        self.looked_up: bool = function == "table" or any(one.looked_up for one in arguments)
        all_logical = bool(arguments) and all(one.logical for one in arguments)
        self.logical: bool = function in LOGICAL or isinstance(constant, np.bool_) or all_logical

    def __getstate__(self) -> dict[str, Any]:
        # the cached function cannot be pickled
        return {name: value for name, value in vars(self).items() if name != "value"}

    @cached_property
    def value(self) -> Callable[[Any], Any]:
        """The value as a function of a mapping name -> value, a number or (n,)."""
        if self.constant is not None:
            value = self.constant
            return lambda known: value
        if not self.arguments:
            return operator.itemgetter(self.function)
        return _composed(OPERATIONS[self.function].value, [one.value for one in self.arguments])

    def in_time(self) -> Callable[[float], Any]:
        """The value of a term in t alone as a function of time [s]."""
        of_float, value = self._of_float(), self.value

        def at(time: float) -> Any:
            try:
                return of_float(time)
            except (ArithmeticError, ValueError):
                with np.errstate(all="ignore"):
                    return value({"t": np.float64(time)})

        return at

    def _of_float(self) -> Callable[[float], Any]:
        """The value of a term in t alone by functions of Python floats, which may raise errors, see `Function`."""
        if self.constant is not None:
            value = self.constant.item() if isinstance(self.constant, np.generic) else self.constant
            return lambda time: value
        if not self.arguments:
            return lambda time: time
        function, arguments = OPERATIONS[self.function], [one._of_float() for one in self.arguments]
        if self.function != "where" and self.function not in LOGICAL and any(one.logical for one in self.arguments):
            # sums of booleans are booleans in numpy
            return lambda time: function.value(*[np.asarray(one(time))[()] for one in arguments])
        apply = function.number or function.value
        *known, last = self.arguments
        if not last.arguments and last.constant is None and all(one.constant is not None for one in known):
            # of constants and t itself
            return partial(apply, *(one(0.0) for one in arguments[:-1]))
        return _composed(apply, arguments)

    def known_at(self, places: Mapping[str, Any]) -> "Term":
        """The term in t alone at points; places: X, Y, Z -> coordinates (n,) [m]."""
        if "t" not in self.names:
            return Term(constant=np.asarray(self.value(places))[()])
        return Term(self.function, *(one.known_at(places) for one in self.arguments))

    def split(self) -> list[tuple["Term", "Term"]] | None:
        """Its value as a sum of products (term in t alone, term in place alone); None if it is not such a sum."""
        if "t" not in self.names:
            return [(ONE, self)]
        if len(self.names) == 1:
            return [(self, ONE)]
        if self.function not in ("Add", "Sub", "Mult", "Div") or any(one.logical for one in self.arguments):
            return None
        left, right = (one.split() for one in self.arguments)
        if left is None or right is None:
            return None
        if self.function == "Add":
            return left + right
        if self.function == "Sub":
            return left + [(factor, Term("USub", mode)) for factor, mode in right]
        if self.function == "Mult" and len(left) == 1:
            left, right = right, left
        # a product of two sums is not expanded, because its terms may cancel
        if len(right) > 1:
            return None
        (by_factor, by_mode) = right[0]
        return [(self._with(factor, by_factor), self._with(mode, by_mode)) for factor, mode in left]

    def _with(self, a: "Term", b: "Term") -> "Term":
        """This product or quotient with other arguments, without factors 1."""
        if b is ONE:
            return a
        return b if a is ONE and self.function == "Mult" else Term(self.function, a, b)

    def rate(self) -> "Term":
        """Its rate in time, ZERO if it changes only by jumps. Raises ValueError for a function without a rule."""
        if not self.arguments:
            return ONE if self.function == "t" else ZERO
        rule = OPERATIONS[self.function].rate
        rates = [one.rate() for one in self.arguments] if rule != "0" else []
        if all(one is ZERO for one in rates):
            return ZERO
        if rule is None:
            raise ValueError(f"no rate of {self.function!r}")
        if self.function == "Pow" and rates[1] is ZERO:
            rule = "b*a**(b - 1)*da"
        named = dict(zip("abc", self.arguments)) | {f"d{name}": one for name, one in zip("abc", rates)}
        return _by_rule(_parsed(rule), named)


def _composed(function: Callable[..., Any], arguments: list[Callable[[Any], Any]]) -> Callable[[Any], Any]:
    """A function of functions; those of one and two arguments are called faster than by a list."""
    if len(arguments) == 1:
        (first,) = arguments
        return lambda x: function(first(x))
    if len(arguments) == 2:
        first, second = arguments
        return lambda x: function(first(x), second(x))
    return lambda x: function(*[one(x) for one in arguments])


ONE, ZERO = Term(constant=np.float64(1.0)), Term(constant=np.float64(0.0))


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
    function, nodes = parts_of(node)
    arguments = [_by_rule(one, named) for one in nodes]
    zero = [one is ZERO for one in arguments]
    if (function == "Mult" and any(zero)) or (function in ("Div", "USub") and zero[0]):
        return ZERO
    if function == "where" and all(zero[1:]):
        return ZERO
    if function in ("Add", "Sub") and zero[1]:
        return arguments[0]
    if function in ("Add", "Sub") and zero[0]:
        return arguments[1] if function == "Add" else Term("USub", arguments[1])
    return Term(function, *arguments)
