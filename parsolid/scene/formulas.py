"""Formulas of a scene in X, Y, Z and t, compiled to numpy functions.

Integers are read as floats ("X/2" is a half of X). `eval` is not used: the text is parsed, every node of the tree is
checked against a list of allowed nodes, and terms are built from the tree.
"""

import ast
import math
import os
from collections.abc import Callable, Mapping
from copy import copy
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import AfterValidator, PlainSerializer, PlainValidator, ValidationInfo, WithJsonSchema

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import AXES, OnePerDimension, dimension_of, mismatch
from parsolid.scene.csv_tables import Table
from parsolid.scene.formula_terms import FUNCTIONS, LOGICAL, ONE, OPERATIONS, Term, parts_of
from parsolid.scene.validation_errors import suggestion

# functions with a variable number of arguments, or of texts and times: fewest, most, usage
_OWN = {
    "min": (2, 20, "min(a, b, ...)"),
    "max": (2, 20, "max(a, b, ...)"),
    "clip": (3, 3, "clip(value, lowest, highest)"),
    "ramp": (3, 3, "ramp(t, begin, end)"),
    "step": (2, 2, "step(t, begin)"),
    "table": (1, 3, 'table("file.csv", t, "column")'),
}
_NAMED = frozenset(FUNCTIONS) | frozenset(_OWN)
CONSTANTS = {"pi": math.pi}
_NODES = (ast.BinOp, ast.UnaryOp, ast.Compare, ast.Call, ast.Name, ast.Constant, ast.expr_context)
# limits of the number of characters and of nested operations
LONGEST, DEEPEST = 10_000, 200
_LARGEST = int(np.finfo(float).max)
# relative deviation from a straight line below which a function counts as linear
_STRAIGHT = 1e-9


def _depth(tree: ast.AST) -> int:
    """The depth of a tree, counted without recursion up to DEEPEST + 2."""
    layer, depth = [tree], 0
    while layer and depth <= DEEPEST + 1:
        layer, depth = [child for node in layer for child in ast.iter_child_nodes(node)], depth + 1
    return depth


def _misuse(node: ast.Call, least: int, most: int, usage: str) -> str | None:
    """Why the arguments of a call are refused, None if they are correct; the first and third of `table` are texts."""
    is_text = [isinstance(one, ast.Constant) and isinstance(one.value, str) for one in node.args]
    expected = [usage.startswith("table") and i != 1 for i in range(len(is_text))]
    if least <= len(node.args) <= most and is_text == expected:
        return None
    return f"{ast.unparse(node)!r} (write {usage})"


def _objection(node: ast.AST, names: tuple[str, ...]) -> str | None:
    """Why a node of a parsed formula is refused; None if it is allowed."""
    if isinstance(node, ast.BoolOp):
        return "'and' or 'or' (write (a) & (b), (a) | (b))"
    if isinstance(node, ast.Compare) and len(node.ops) > 1:
        return "a chained comparison (write (a < b) & (b < c))"
    if isinstance(node, ast.Call):
        if not isinstance(node.func, ast.Name) or node.keywords:
            return f"the call {ast.unparse(node)!r}"
        if node.func.id not in _NAMED:
            return f"the unknown function {node.func.id!r}{suggestion(node.func.id, _NAMED)}"
        return _misuse(node, *_OWN[node.func.id]) if node.func.id in _OWN else None
    if isinstance(node, ast.Name):
        known = (*names, *CONSTANTS)
        if node.id not in known and node.id not in _NAMED:
            return f"the unknown name {node.id!r}{suggestion(node.id, known)}"
    elif isinstance(node, ast.Constant):
        if type(node.value) not in (int, float) and not hasattr(node, "of_table"):
            return f"{node.value!r}"
        if isinstance(node.value, int) and node.value > _LARGEST:
            return f"a number of {len(str(node.value))} digits"
    elif not isinstance(node, _NODES) and type(node).__name__ not in OPERATIONS:
        return "'^' (a power is '**')" if isinstance(node, ast.BitXor) else f"{ast.unparse(node)!r}"
    return None


def _brackets(text: str) -> str:
    """A remark on unpaired brackets of a text; empty if there are none."""
    opened = 0
    for number, one in enumerate(text, 1):
        opened += (one == "(") - (one == ")")
        if opened < 0:
            return f" (the bracket ')' at character {number} has no '(' before it)"
    return f" ({'one bracket' if opened == 1 else f'{opened} brackets'} '(' without ')')" if opened else ""


def _checked_tree(text: str, names: tuple[str, ...]) -> ast.expr:
    """The parsed text; raises ValueError if it is not a formula in these names."""
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} characters where {LONGEST} are the most,")
    try:
        tree = ast.parse(text, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError(f"no formula{_brackets(text)}") from None
    if _depth(tree) > DEEPEST:
        raise ValueError(f"more than {DEEPEST} operations one within the other (sums of many terms need brackets)")
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "table":
            for argument in node.args:
                argument.of_table = True  # type: ignore[attr-defined]
    for node in ast.walk(tree.body):
        objection = _objection(node, names)
        if objection:
            raise ValueError(objection)
    return tree.body


class NotFinite(NamedTuple):
    """A formula that is not finite at a point [m] and a time [s]."""

    source: str
    value: float
    place: list[float]
    time: float

    def __str__(self) -> str:
        place = ", ".join(f"{one:.6g}" for one in self.place)
        return f"the formula {self.source!r} is {self.value} at X = ({place}), t = {self.time:.6g} s"


# the first one on this rank, for the message of a failed run
NOT_FINITE: list[NotFinite] = []


class _Compiler:
    """Builds terms from a checked tree.

    folder: of tables; jumps, corners: times [s] at which functions of time make the formula, or its rate, jump, as far
    as their arguments are linear in time
    """

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self.jumps: set[float] = set()
        self.corners: set[float] = set()

    def term(self, node: ast.expr) -> Term:
        """The term of a node; without names in it, a constant. Raises TypeError if that is not a real number."""
        result = self._term(node)
        if result.names or result.looked_up or result.constant is not None:
            return result
        with np.errstate(all="ignore"):
            value = result.value({})
        if not np.isfinite(value):
            power = result.function == "Pow" and np.isnan(value)
            raise TypeError("its value is not real" if power else f"{ast.unparse(node)} is {value}")
        return Term(constant=value)

    def _term(self, node: ast.expr) -> Term:
        if isinstance(node, ast.Constant):
            return Term(constant=np.float64(node.value))  # type: ignore[arg-type]
        if isinstance(node, ast.Name):
            if node.id in _NAMED:
                raise TypeError(f"{node.id} without its arguments")
            return Term(constant=np.float64(CONSTANTS[node.id])) if node.id in CONSTANTS else Term(node.id)
        name, arguments = parts_of(node)
        if name == "table":
            return self._table(*arguments)
        values = [self.term(one) for one in arguments]
        if name in ("min", "max"):
            result, *others = values
            for other in others:
                self._crossing(result, other, self.corners)
                result = Term("minimum" if name == "min" else "maximum", result, other)
            return result
        if name in FUNCTIONS and len(values) != FUNCTIONS[name].takes:
            raise TypeError(f"{name} of {len(values)} numbers in place of {FUNCTIONS[name].takes}")
        for bound in values[1:] if name in _OWN else ():
            self._crossing(values[0], bound, self.jumps if name == "step" else self.corners)
        return Term(name, *values)

    def _table(self, path: Any, place: ast.expr | None = None, column: Any = None) -> Term:
        table = Table(os.path.join(self.folder, path.value), None if column is None else column.value)
        argument = Term("t") if place is None else self.term(place)
        for abscissae, times in ((table.places, self.corners), (table.jumps, self.jumps)):
            for abscissa in abscissae:
                self._crossing(argument, Term(constant=np.float64(abscissa)), times)
        return Term("table", Term(constant=table), argument)

    def _crossing(self, value: Term, bound: Term, times: set[float]) -> None:
        """Add the time at which a value reaches a bound, if their difference is linear in time."""
        difference = Term("Sub", value, bound)
        if difference.looked_up or difference.names != {"t"}:
            return
        if value.function == "t" and bound.constant is not None:
            times.add(float(bound.constant))
            return
        with np.errstate(all="ignore"):
            start, middle, end = (float(difference.in_time()(time)) for time in (0.0, 1.0, 2.0))
        slope = middle - start
        if np.isfinite([start, middle, end]).all() and abs(end - middle - slope) <= _STRAIGHT * abs(slope) != 0.0:
            times.add(-start / slope)


class Product(NamedTuple):
    """A function of time (None: 1) times a constant `mode`, a number or (n,); pointwise: the function returns (n,)."""

    factor: Callable[[float], Any] | None
    mode: Any
    pointwise: bool = False


class Formula:
    """A scalar formula; `source`: the text or number of the scene, with absolute paths of tables.

    folder: of tables; jumps, corners: times [s] at which functions of time make it, or its rate, jump. Raises
    ValueError if the text is not a formula in the given names.
    """

    def __init__(self, source: str | float, names: tuple[str, ...] = (*AXES, "t"), folder: str = "") -> None:
        text = str(source).strip()
        tree = _checked_tree(text, names)
        self.source = _with_whole_paths(text, tree, folder) if "table" in text else source
        compiler = _Compiler(folder)
        try:
            self._term = compiler.term(tree)
            self._values(np.zeros((1, len(AXES))), 0.0)
        except RecursionError:
            raise ValueError("a formula that cannot be compiled (too deep)") from None
        except TypeError as error:
            raise ValueError(f"a formula that cannot be compiled ({error})") from None
        self.jumps = tuple(sorted(one for one in compiler.jumps if one >= 0.0))
        self.corners = tuple(sorted(one for one in compiler.jumps | compiler.corners if one >= 0.0))

    @property
    def names(self) -> frozenset[str]:
        """The coordinates and the time that its value depends on."""
        return self._term.names

    @property
    def is_constant(self) -> bool:
        """Whether its value depends on neither place nor time."""
        return not self._term.names

    @property
    def is_comparison(self) -> bool:
        """Whether its values are true or false."""
        return self._term.function in LOGICAL

    @property
    def depends_on_time(self) -> bool:
        """Whether its value depends on t."""
        return "t" in self._term.names

    def evaluate(self, points: np.ndarray, time: float = 0.0) -> np.ndarray:
        """Values (n,) at points (n, d) [m] and a time [s]."""
        values = self._values(points, time)
        if not np.isfinite(values).all():
            self._note_not_finite(values, points, time)
        return values

    def products(self, points: np.ndarray) -> list[Product]:
        """The values at points (n, d) [m] as a sum of products of a function of time [s] and a mode.

        A formula that is not such a sum becomes one product whose function returns (n,) values. The caller silences
        warnings of numpy.
        """
        places = self._places(points)
        parts = self._term.split()
        if parts is None:
            whole = self._term.known_at(places).value
            return [Product(self._checked(lambda time: whole({"t": np.float64(time)}), points, True), 1.0, True)]
        modes = [mode.value(places) for _, mode in parts]
        if not all(np.isfinite(mode).all() for mode in modes):
            self._note_not_finite(self._values(points, 0.0), points, 0.0)
        return [
            Product(None if factor is ONE else self._checked(factor.in_time(), points, False), mode)
            for (factor, _), mode in zip(parts, modes)
        ]

    def _checked(self, factor: Callable[[float], Any], points: np.ndarray, pointwise: bool) -> Callable[[float], Any]:
        """The factor of a product, which notes values that are not finite, at points (n, d) [m]."""

        def checked(time: float) -> Any:
            value: Any = factor(time) if pointwise else float(factor(time))
            # the sum of squares is faster than isfinite of all values
            if not math.isfinite(value.dot(value) if pointwise else value):
                self._note_not_finite(self._values(points, time), points, time)
            return value

        return checked

    def _note_not_finite(self, values: np.ndarray, points: np.ndarray, time: float) -> None:
        """Remember the first value on this rank that is not finite."""
        if not NOT_FINITE and not np.isfinite(values).all():
            index = int(np.argmin(np.isfinite(values)))
            NOT_FINITE.append(NotFinite(str(self.source), float(values[index]), points[index].tolist(), time))

    def _places(self, points: np.ndarray) -> dict[str, Any]:
        return {name: points[:, AXES.index(name)] for name in self._term.names if name != "t"}

    def _values(self, points: np.ndarray, time: float) -> np.ndarray:
        result = np.empty(len(points))
        with np.errstate(all="ignore"):
            result[:] = self._term.value(self._places(points) | {"t": np.float64(time)})
        return result

    def rate(self) -> "Formula":
        """Its derivative in time, at a jump or corner the right-sided one; raises ValueError if there is no rule."""
        result = copy(self)
        result.source, result.jumps, result._term = f"rate of {self.source}", self.corners, self._term.rate()
        return result

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Formula) and self.source == other.source

    def __hash__(self) -> int:
        return hash(self.source)

    def __repr__(self) -> str:
        return f"Formula({self.source!r})"


def number_of(source: str, values: Mapping[str, float]) -> float:
    """The value of a formula in named numbers, which may not be finite. Raises ValueError for a faulty formula."""
    tree = _checked_tree(source.strip(), tuple(values))
    try:
        value = _Compiler("").term(tree).value
        with np.errstate(all="ignore"):
            return float(value({name: np.float64(number) for name, number in values.items()}))
    except (TypeError, RecursionError) as error:
        raise ValueError(f"a formula that cannot be compiled ({error})") from None


def _with_whole_paths(text: str, tree: ast.expr, folder: str) -> str:
    """The text of a formula with absolute paths of its tables, which are relative to a folder."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and node.func.id == "table"]  # type: ignore
    whole = text.encode()
    for path in sorted((node.args[0] for node in calls), key=lambda one: -one.col_offset):
        full = repr(os.path.abspath(os.path.join(folder, path.value)))  # type: ignore[attr-defined]
        whole = whole[: path.col_offset] + full.encode() + whole[path.end_col_offset :]
    return whole.decode()


class FormulaVector(tuple[Any, ...]):
    """Formulas of the components of a vector field; None stands for a component that is "free"."""

    @property
    def free(self) -> np.ndarray:
        """Which components are free, (d,) bool."""
        return np.array([component is None for component in self])

    @property
    def is_constant(self) -> bool:
        """Whether no component depends on place or time."""
        return all(component is None or component.is_constant for component in self)

    @property
    def depends_on_time(self) -> bool:
        """Whether a component depends on t."""
        return any(component is not None and component.depends_on_time for component in self)

    @property
    def jumps(self) -> set[float]:
        """Times [s] at which functions of time make a component jump."""
        return {time for component in self if component is not None for time in component.jumps}

    @property
    def corners(self) -> set[float]:
        """Times [s] at which functions of time make a component or its rate jump."""
        return {time for component in self if component is not None for time in component.corners}

    def evaluate(self, points: np.ndarray, time: float = 0.0) -> np.ndarray:
        """Values (n, components) at points (n, d) [m] and a time [s]; 0 for free components."""
        result = np.zeros((len(points), len(self)))
        for i, component in enumerate(self):
            if component is not None:
                result[:, i] = component.evaluate(points, time)
        return result

    @property
    def sources(self) -> list[Any]:
        """The sources of the components."""
        return ["free" if component is None else component.source for component in self]


def formula_in(value: Any, names: tuple[str, ...], folder: str = "") -> Formula:
    """The formula of a value in a scene; folder: of tables. Raises PydanticCustomError."""
    if isinstance(value, Formula):
        return value
    expected = f"a formula in {', '.join(names)}"
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise mismatch(expected, value, "formula")
    try:
        return Formula(value, names, folder)
    except ValueError as error:
        raise mismatch(expected, Phrase(f"{error} in {value!r}"), "formula") from None


def _formula(value: Any, info: ValidationInfo, time: bool) -> Formula:
    names = AXES[: dimension_of(info) or 3] + (("t",) if time else ())
    return formula_in(value, names, (info.context or {}).get("folder", ""))


def formula_of_place(value: Any, info: ValidationInfo) -> Formula:
    """The formula of a value in a scene, in the reference coordinates only. Raises PydanticCustomError."""
    return _formula(value, info, time=False)


def _of_place_and_time(value: Any, info: ValidationInfo) -> Formula:
    return _formula(value, info, time=True)


def _or_free(value: Any, info: ValidationInfo) -> Formula | None:
    return None if value is None or value == "free" else _formula(value, info, time=True)


FORMULA = WithJsonSchema({"type": ["string", "number"], "title": "a formula"}, mode="validation")


def _vector_of(validate: Any, counted: Any = OnePerDimension) -> Any:
    """The type of a list of formulas, one per dimension, that is parsed to a FormulaVector."""
    component = Annotated[Any, PlainValidator(validate), FORMULA]
    return Annotated[
        list[component], counted, AfterValidator(FormulaVector), PlainSerializer(lambda vector: vector.sources)
    ]


def _in_space(values: list[Any], info: ValidationInfo) -> list[Any]:
    """Refuse a number of components other than the dimension or three."""
    dimension = dimension_of(info)
    if len(values) not in (3, dimension or len(values)):
        raise mismatch(f"{dimension} components, or 3", Phrase(f"{len(values)}"))
    return values


def _scalar_of(validate: Any) -> Any:
    """The type of a formula, serialized as its source."""
    return Annotated[Any, PlainValidator(validate), PlainSerializer(lambda formula: formula.source), FORMULA]


InitialScalar: Any = _scalar_of(formula_of_place)
Scalar: Any = _scalar_of(_of_place_and_time)
InitialVector: Any = _vector_of(formula_of_place)
# in 2-D also with three components
InitialDirection: Any = _vector_of(formula_of_place, AfterValidator(_in_space))
Vector: Any = _vector_of(_of_place_and_time)
VectorOrFree: Any = _vector_of(_or_free)
InitialMatrix = Annotated[
    list[InitialVector],
    OnePerDimension,
    AfterValidator(tuple),
    PlainSerializer(lambda rows: [row.sources for row in rows]),
]
