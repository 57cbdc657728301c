"""Formulas of a scene: numexpr expressions in X, Y, Z and t, checked name by name before they are compiled.

Whole numbers are read as reals ("X/2" halves, whatever X is). Nothing is ever given to `eval`: the text is parsed,
every node is compared with a list of allowed ones, and what numexpr compiles is written anew from the parsed tree.
"""

import ast
import math
import os
from typing import Annotated, Any, NamedTuple

import numexpr
import numpy as np
from pydantic import AfterValidator, PlainSerializer, PlainValidator, ValidationInfo

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import AXES, OnePerDimension, dimension_of, mismatch
from parsolid.scene.time_derivative import TimeDerivative
from parsolid.scene.time_functions import ARGUMENTS, Expansion, Lookup, Moments, misuse
from parsolid.scene.validation_errors import suggestion

# the ranks share the cores already
numexpr.set_num_threads(1)

_NOT_FOR_POINTS = {"sum", "prod", "min", "max", "contains", "copy", "complex", "conj", "imag", "real", "ones_like"}
# numexpr's min and max reduce arrays; those of formulas compare numbers
FUNCTIONS = frozenset(numexpr.expressions.functions) - _NOT_FOR_POINTS | frozenset(ARGUMENTS)
CONSTANTS = {"pi": math.pi}
_NODES = (ast.BinOp, ast.UnaryOp, ast.Compare, ast.Call, ast.Name, ast.Constant, ast.expr_context)
_OPERATORS = (
    ast.Add,
    ast.Sub,
    ast.Mult,
    ast.Div,
    ast.Mod,
    ast.Pow,
    ast.BitAnd,
    ast.BitOr,
    ast.USub,
    ast.UAdd,
    ast.Invert,
)
_COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
# characters of a formula, and operations one within the other, that the compiler stands
LONGEST, DEEPEST = 10_000, 200
_LARGEST = int(np.finfo(float).max)


def _depth(tree: ast.AST) -> int:
    """How deep a tree is, found without recursion; more than DEEPEST is as good as any."""
    layer, depth = [tree], 0
    while layer and depth <= DEEPEST + 1:
        layer, depth = [child for node in layer for child in ast.iter_child_nodes(node)], depth + 1
    return depth


def _wrong_call(node: ast.Call) -> str | None:
    """Why a call is refused; None when it is allowed."""
    if not isinstance(node.func, ast.Name) or node.keywords:
        return f"the call {ast.unparse(node)!r}"
    if node.func.id not in FUNCTIONS:
        return f"the unknown function {node.func.id!r}{suggestion(node.func.id, FUNCTIONS)}"
    return misuse(node) if node.func.id in ARGUMENTS else None


def _objection(node: ast.AST, names: tuple[str, ...]) -> str | None:
    """Why one node of a parsed formula is refused; None when it is allowed."""
    if isinstance(node, ast.BoolOp):
        return "'and' or 'or' (write (a) & (b), (a) | (b))"
    if isinstance(node, ast.Compare) and len(node.ops) > 1:
        return "a chained comparison (write (a < b) & (b < c))"
    if isinstance(node, ast.Call):
        return _wrong_call(node)
    if isinstance(node, ast.Name):
        known = (*names, *CONSTANTS)
        if node.id not in known and node.id not in FUNCTIONS:
            return f"the unknown name {node.id!r}{suggestion(node.id, known)}"
    elif isinstance(node, ast.Constant):
        if type(node.value) not in (int, float) and not hasattr(node, "of_table"):
            return f"{node.value!r}"
        if isinstance(node.value, int) and node.value > _LARGEST:
            return f"a number of {len(str(node.value))} digits"
    elif not isinstance(node, _NODES + _OPERATORS + _COMPARISONS):
        return "'^' (a power is '**')" if isinstance(node, ast.BitXor) else f"{ast.unparse(node)!r}"
    return None


class _AsReals(ast.NodeTransformer):
    def visit_Constant(self, node: Any) -> Any:
        return node if isinstance(node.value, str) else ast.copy_location(ast.Constant(float(node.value)), node)

    def visit_Name(self, node: Any) -> Any:
        return ast.copy_location(ast.Constant(CONSTANTS[node.id]), node) if node.id in CONSTANTS else node


def _brackets(text: str) -> str:
    """What is wrong with the brackets of a text, in words; empty where they are in pairs."""
    opened = 0
    for number, one in enumerate(text, 1):
        opened += (one == "(") - (one == ")")
        if opened < 0:
            return f" (the bracket ')' at character {number} has no '(' before it)"
    return f" ({'one bracket' if opened == 1 else f'{opened} brackets'} '(' without ')')" if opened else ""


def _sound_tree(text: str, names: tuple[str, ...]) -> ast.expr:
    """The parsed text; raises ValueError with what is wrong with it."""
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


def _value_in_time(tree: ast.expr, time: float) -> float | None:
    """Value of a tree without tables at a time [s]; None where it depends on more."""
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} - FUNCTIONS
    if names - {"t"}:
        return None
    try:
        return float(numexpr.evaluate(ast.unparse(tree), {"t": np.float64(time)}, {}))
    except (TypeError, ValueError, RuntimeError, LookupError, AttributeError, ArithmeticError):
        return None


class NotFinite(NamedTuple):
    """A formula that was no finite number at a place [m] and a time [s]."""

    source: str
    value: float
    place: list[float]
    time: float

    def __str__(self) -> str:
        place = ", ".join(f"{one:.6g}" for one in self.place)
        return f"the formula {self.source!r} is {self.value} at X = ({place}), t = {self.time:.6g} s"


# the first of this rank; a failed run tells of it
NOT_FINITE: list[NotFinite] = []


class Formula:
    """One scalar formula; `source` is what the scene says (text or a number), with whole paths of tables.

    jumps, corners: times [s] at which functions of time make it, or its rate, jump. Raises ValueError with what is
    wrong when the text is no formula in the given names.
    """

    def __init__(self, source: str | float, names: tuple[str, ...] = (*AXES, "t"), folder: str = "") -> None:
        """folder: of tables."""
        text = str(source).strip()
        tree = _sound_tree(text, names)
        self.source = _with_whole_paths(text, tree, folder) if "table" in text else source
        expansion = Expansion(folder, _value_in_time)
        try:
            self._take(expansion.visit(_AsReals().visit(tree)), expansion.lookups)
        except RecursionError:
            raise ValueError("a formula that cannot be compiled (too deep)") from None
        self.jumps, self.corners = _sorted(expansion.moments)

    def _take(self, tree: ast.expr, lookups: dict[str, Lookup]) -> None:
        """Become what a tree says; raises ValueError when it cannot be compiled."""
        self.names: tuple[str, ...] = ()
        self._tree, self._lookups = tree, lookups
        called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
        used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in called}
        self._arguments = {name: Formula._of(lookups[name].argument, {}) for name in sorted(used & set(lookups))}
        of_arguments = {name for argument in self._arguments.values() for name in argument.names}
        self._own = tuple(sorted(used))
        self.names = tuple(sorted(used - set(lookups) | of_arguments))
        self._compiled: Any = None
        self._constant = None
        try:
            self._text = ast.unparse(tree)
            with np.errstate(all="ignore"):
                value = self._values(np.zeros((1, len(AXES))), 0.0)[0]
        except (TypeError, ValueError, RuntimeError, LookupError, AttributeError, ArithmeticError) as error:
            raise ValueError(f"a formula that cannot be compiled ({error})") from None
        if not self.names:
            if not math.isfinite(value):
                raise ValueError(f"the value {value} where a finite one is wanted,")
            self._constant = float(value)

    @classmethod
    def _of(cls, tree: ast.expr, lookups: dict[str, Lookup]) -> "Formula":
        result = cls.__new__(cls)
        result.source = ast.unparse(tree)
        result.jumps, result.corners = (), ()
        result._take(tree, lookups)
        return result

    @property
    def is_constant(self) -> bool:
        """Whether it has the same value everywhere and always."""
        return self._constant is not None

    @property
    def is_comparison(self) -> bool:
        """Whether its values are true or false."""
        tree = self._tree
        while isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.Invert):
            tree = tree.operand
        bits = isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.BitAnd | ast.BitOr)
        return bits or isinstance(tree, ast.Compare)

    @property
    def depends_on_time(self) -> bool:
        """Whether t occurs in it."""
        return "t" in self.names

    def evaluate(self, points: np.ndarray, time: float = 0.0) -> np.ndarray:
        """Values (n,) at points (n, d) [m] and a time [s]."""
        if self._constant is not None:
            return np.full(len(points), self._constant)
        values = self._values(points, time)
        if not np.isfinite(values).all() and not NOT_FINITE:
            index = int(np.argmin(np.isfinite(values)))
            NOT_FINITE.append(NotFinite(str(self.source), float(values[index]), points[index].tolist(), time))
        return values

    def _values(self, points: np.ndarray, time: float) -> np.ndarray:
        if self._compiled is None:
            self._compiled = numexpr.NumExpr(self._text, signature=[(name, np.float64) for name in self._own])
        values = self._compiled(*(self._given(name, points, time) for name in self._own))
        if np.iscomplexobj(values):
            # numexpr folds constants as Python does, which makes (-8)**(1/3) complex
            raise ValueError("its value is not real")
        return np.array(np.broadcast_to(values, len(points)), dtype=np.float64)

    def rate(self) -> "Formula":
        """Its derivative in time, after a jump or a corner; raises ValueError for a function that has none here."""
        derivative = TimeDerivative(self._lookups)
        tree = derivative.of(self._tree)
        result = Formula._of(tree, derivative.lookups)
        result.jumps = result.corners = self.corners
        return result

    def _given(self, name: str, points: np.ndarray, time: float) -> Any:
        """What a name stands for."""
        if name in self._arguments:
            lookup, places = self._lookups[name], self._arguments[name].evaluate(points, time)
            return lookup.table.slope(places) if lookup.slopes else lookup.table.at(places)
        return np.float64(time) if name == "t" else points[:, AXES.index(name)]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Formula) and self.source == other.source

    def __hash__(self) -> int:
        return hash(self.source)

    def __repr__(self) -> str:
        return f"Formula({self.source!r})"

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_compiled": None}


def _sorted(moments: Moments) -> tuple[tuple[float, ...], tuple[float, ...]]:
    jumps, corners = (sorted(one for one in found if one >= 0.0) for found in (moments.jumps, moments.corners))
    return tuple(jumps), tuple(sorted({*jumps, *corners}))


def _with_whole_paths(text: str, tree: ast.expr, folder: str) -> str:
    """A formula with the absolute paths of its tables, which are relative to a folder."""
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
        """Whether every component is the same everywhere and always."""
        return all(component is None or component.is_constant for component in self)

    @property
    def depends_on_time(self) -> bool:
        """Whether t occurs in any component."""
        return any(component is not None and component.depends_on_time for component in self)

    @property
    def jumps(self) -> set[float]:
        """Times [s] at which functions of time make it jump."""
        return {time for component in self if component is not None for time in component.jumps}

    @property
    def corners(self) -> set[float]:
        """Those times, and those at which they make its rate jump."""
        return {time for component in self if component is not None for time in component.corners}

    def evaluate(self, points: np.ndarray, time: float = 0.0, out: np.ndarray | None = None) -> np.ndarray:
        """Values (n, components) at points (n, d) [m] and a time [s]; 0 for free components. `out` is
        written if given.
        """
        result = np.zeros((len(points), len(self))) if out is None else out
        for i, component in enumerate(self):
            result[:, i] = 0.0 if component is None else component.evaluate(points, time)
        return result

    @property
    def sources(self) -> list[Any]:
        """What the scene says, component by component."""
        return ["free" if component is None else component.source for component in self]


def _formula(value: Any, info: ValidationInfo, time: bool) -> Formula:
    if isinstance(value, Formula):
        return value
    names = AXES[: dimension_of(info) or 3] + (("t",) if time else ())
    expected = f"a formula in {', '.join(names)}"
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise mismatch(expected, value)
    try:
        return Formula(value, names, (info.context or {}).get("folder", ""))
    except ValueError as error:
        raise mismatch(expected, Phrase(f"{error} in {value!r}")) from None


def _of_place(value: Any, info: ValidationInfo) -> Formula:
    return _formula(value, info, time=False)


def _of_place_and_time(value: Any, info: ValidationInfo) -> Formula:
    return _formula(value, info, time=True)


def _or_free(value: Any, info: ValidationInfo) -> Formula | None:
    return None if value is None or value == "free" else _formula(value, info, time=True)


def _vector_of(validate: Any) -> Any:
    """A list of formulas, one per dimension, that becomes a FormulaVector and is written as a list again."""
    component = Annotated[Any, PlainValidator(validate)]
    return Annotated[
        list[component], OnePerDimension, AfterValidator(FormulaVector), PlainSerializer(lambda vector: vector.sources)
    ]


def _scalar_of(validate: Any) -> Any:
    """A Formula that is written as the text that it came from."""
    return Annotated[Any, PlainValidator(validate), PlainSerializer(lambda formula: formula.source)]


InitialScalar: Any = _scalar_of(_of_place)
Scalar: Any = _scalar_of(_of_place_and_time)
InitialVector: Any = _vector_of(_of_place)
Vector: Any = _vector_of(_of_place_and_time)
VectorOrFree: Any = _vector_of(_or_free)
InitialMatrix = Annotated[
    list[InitialVector],
    OnePerDimension,
    AfterValidator(tuple),
    PlainSerializer(lambda rows: [row.sources for row in rows]),
]
