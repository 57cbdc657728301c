"""A hyperelastic law whose energy a scene states as a formula, differentiated by sympy at set-up.

The formula is read as arithmetic of known names alone (a whitelist of its syntax; nothing is evaluated), checked, and
written with its derivatives as the source of a law like those of this package, which kernels compile. sympy is imported
by such scenes alone.
"""

import ast
import hashlib
import itertools
import keyword
import operator
from functools import cache
from typing import Annotated, Any

from parsolid import kernel_cache
from parsolid.materials import registry
from parsolid.materials.declaration import Density, Parameter, Phrase, law

_STRETCHES = ("lambda1", "lambda2", "lambda3")
VARIABLES = ("I1", "I2", "J", "I1bar", "I2bar", *_STRETCHES, *(f"{name}bar" for name in _STRETCHES))
FUNCTIONS = ("exp", "log", "sqrt", "erf", "Max", "Min")
_OPERATORS: dict[type, Any] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
# characters of a formula, its numeric exponents and bits of its whole numbers
_MOST_CHARACTERS, _MOST_EXPONENT, _MOST_BITS = 2000, 64, 256
# share of the moduli that stress and energy may be at rest
_AT_REST = 1e-9
# stretches near rest at which a formula is tried, in every order
_TRIED = (1.1, 0.95, 1.23)
# of the law that is written; scenes ask for "formula"
_KIND = "formula-of-a-scene"


@law("hyperelastic", "formula")
class StatedFormula:
    """W [J/m^3] as a formula of I1, I2, J, I1bar, I2bar, lambda1, lambda1bar, ... and constants, by +, -, *, /, **,
    exp, log, sqrt, erf, Max, Min. At rest it has neither energy nor stress."""

    density: Density
    energy: Annotated[str, Parameter("J/m^3", "such as 'mu/2*(I1bar - 3) + K/2*(J - 1)**2'")]
    constants: Annotated[dict[str, float], Parameter("1", "those of the formula by name, in SI units")]

    def faults(self) -> list[tuple[tuple[Any, ...], str, object]]:
        return list(_faults(self.energy, tuple(sorted(self.constants.items()))))

    def equilibrium_law(self) -> Any:
        return _law_with(self.energy, tuple(sorted(self.constants.items())))._replace(density=float(self.density))


class FormulaError(Exception):
    """A fault of a formula: what was expected, and what was found."""

    def __init__(self, expected: str, found: object) -> None:
        super().__init__(expected)
        self.expected, self.found = expected, found


def _sympy() -> Any:
    try:
        import sympy
    except ImportError as error:
        raise FormulaError("sympy to be installed (pip install 'parsolid[formula]')", Phrase("no sympy")) from error
    return sympy


# --- reading ------------------------------------------------------------------------------------------------------


def expression_of(text: str, constants: tuple[str, ...]) -> Any:
    """The formula as sympy has it. Raises FormulaError."""
    sympy = _sympy()
    try:
        if len(text) > _MOST_CHARACTERS:
            raise ValueError
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise FormulaError(f"a formula of at most {_MOST_CHARACTERS} characters", text[:200]) from error
    known = {name: sympy.Symbol(name, positive=True) for name in VARIABLES}
    known |= {name: sympy.Symbol(name, real=True) for name in constants}

    def read(node: ast.AST) -> Any:
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            return _bounded(sympy.Integer(node.value) if type(node.value) is int else sympy.Float(node.value, 17), text)
        if isinstance(node, ast.Name) and node.id in known:
            return known[node.id]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            value = read(node.operand)
            return -value if isinstance(node.op, ast.USub) else value
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            first, second = read(node.left), read(node.right)
            if isinstance(node.op, ast.Pow) and second.is_number and not abs(second) <= _MOST_EXPONENT:
                raise FormulaError(f"exponents of at most {_MOST_EXPONENT}", ast.unparse(node))
            return _bounded(_OPERATORS[type(node.op)](first, second), text)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            many = node.func.id in ("Max", "Min")
            if node.func.id in FUNCTIONS and (len(node.args) == 1 or (many and len(node.args) > 1)):
                return _bounded(getattr(sympy, node.func.id)(*map(read, node.args)), text)
        found = node.id if isinstance(node, ast.Name) else ast.unparse(node)
        raise FormulaError(f"arithmetic of {', '.join((*VARIABLES, *constants))} and {', '.join(FUNCTIONS)}", found)

    try:
        return read(tree)
    except RecursionError as error:
        raise FormulaError("a formula with fewer parentheses in one another", text[:200]) from error


def _bounded(value: Any, text: str) -> Any:
    """The value. Raises FormulaError for one that is no finite real number, and for whole numbers and fractions of more
    than `_MOST_BITS` bits, which would take sympy's time."""
    large = value.is_Rational and max(int(value.p).bit_length(), int(value.q).bit_length()) > _MOST_BITS
    if large or (value.is_number and not (value.is_real and value.is_finite)):
        raise FormulaError("numbers that are finite", text[:200])
    return value


# --- writing ------------------------------------------------------------------------------------------------------


def _written(e: Any, names: dict[str, str]) -> str:
    """An expression as arithmetic of this package's functions."""
    sympy = _sympy()

    def of(one: Any) -> str:
        return _written(one, names)

    if e.is_Symbol:
        return names.get(e.name, e.name)
    if (e.is_number and not e.args) or e.is_Rational:
        if not e.is_real:
            raise FormulaError("arithmetic of real numbers", str(e))
        return repr(float(e))
    if e.is_Add:
        return "(" + " + ".join(map(of, e.args)) + ")"
    if e.is_Mul:
        return "(" + " * ".join(map(of, e.args)) + ")"
    if e.is_Pow:
        base, exponent = e.args
        if exponent.is_Integer:
            whole = int(exponent)
            return f"({of(base)} ** {whole})" if whole > 0 else f"(1.0 / {of(base)} ** {-whole})"
        if abs(exponent) == sympy.Rational(1, 2):
            return f"({of(base)} ** 0.5)" if exponent > 0 else f"(1.0 / {of(base)} ** 0.5)"
        return f"power({of(base)}, {of(exponent)})"
    if isinstance(e, sympy.Max | sympy.Min):
        word, (first, *rest) = ("max" if isinstance(e, sympy.Max) else "min"), map(of, e.args)
        for one in rest:
            first = f"{word}({first}, {one})"
        return first
    if isinstance(e, sympy.Heaviside):
        return f"(1.0 if {of(e.args[0])} > 0.0 else 0.0)"
    if isinstance(e, sympy.DiracDelta):
        # the curvature of a kink, which no wave has
        return "0.0"
    if isinstance(e, sympy.Abs):
        # of the root of a square
        return f"abs({of(e.args[0])})"
    if isinstance(e, sympy.sign):
        return f"(1.0 if {of(e.args[0])} > 0.0 else -1.0)"
    name = type(e).__name__
    if name not in FUNCTIONS:
        raise FormulaError(f"arithmetic of {', '.join(FUNCTIONS)}", name)
    return f"{name}({', '.join(map(of, e.args))})"


def _body(expressions: list[Any], names: dict[str, str]) -> tuple[list[str], list[str]]:
    """Lines that compute what expressions have in common, and each expression."""
    sympy = _sympy()
    shared, reduced = sympy.cse(expressions, symbols=sympy.numbered_symbols("x"), order="canonical")
    lines = [f"    {symbol.name} = {_written(e, names)}" for symbol, e in shared]
    return lines, [_written(e, names) for e in reduced]


_HEAD = '''"""Written from the formula {text!r}."""

from typing import NamedTuple

from parsolid.elementary import erf, exp, log, power
from parsolid.materials.declaration import law
from parsolid.materials.hyperelastic.functions import energy, pressure_waves, stress
from parsolid.materials.hyperelastic.stretches import stretch_waves
from parsolid.principal import from_principal, principal
from parsolid.tensors import combine, combine_symmetric, contract, cross, general, gram, matmul


@law("hyperelastic", {kind!r})
class Formula(NamedTuple):
    density: float
{fields}    branch_moduli: tuple | None
    relaxation_times: tuple | None
'''
_STATE = {
    "I1": "    I1 = contract(F, F)",
    "I2": "    I2 = contract(H, H)",
    "stretches": "    squares, axes = principal(gram(F))\n"
    "    lambda1, lambda2, lambda3 = squares[0] ** 0.5, squares[1] ** 0.5, squares[2] ** 0.5",
}


def source_of(text: str, constants: tuple[str, ...]) -> str:
    """The source of the law: energy, stress and pressure waves. Raises FormulaError."""
    sympy = _sympy()
    s = {name: sympy.Symbol(name, positive=True) for name in VARIABLES}
    shrink = s["J"] ** sympy.Rational(-1, 3)
    bars = {s["I1bar"]: shrink**2 * s["I1"], s["I2bar"]: shrink**4 * s["I2"]}
    bars |= {s[f"{name}bar"]: shrink * s[name] for name in _STRETCHES}
    terms = sympy.Add.make_args(sympy.expand_mul(expression_of(text, constants)))
    parts = [[one for one in terms if (_variables(one) == {"J"}) == alone] for alone in (True, False)]
    of_volume, rest = (sympy.Add(*part).subs(bars) for part in parts)
    W = of_volume + rest
    names = {name: f"law.c_{name}" for name in constants}
    fields = "".join(f"    c_{name}: float\n" for name in constants)
    lines, (value,) = _body([W], names)
    written = [
        _HEAD.format(text=text, fields=fields, kind=_KIND),
        "\n".join(
            ["@energy.of(Formula)", "def _energy(law, F, H, J):", *_state_lines(W), *lines, f"    return {value}\n"]
        ),
        _stress_source(W, s, names),
    ]
    return "\n\n".join([*written, _waves_source(of_volume, rest, s, names)])


def _variables(e: Any) -> set[str]:
    """Names of the variables of an expression, without constants."""
    return {symbol.name for symbol in e.free_symbols} & set(VARIABLES)


def _state_lines(W: Any) -> list[str]:
    """Lines that compute the variables of an energy from F, H and J."""
    used = _variables(W)
    lines = [_STATE[name] for name in ("I1", "I2") if name in used]
    return [*lines, _STATE["stretches"]] if used & {*_STRETCHES} else lines


def _stress_source(W: Any, s: Any, names: dict[str, str]) -> str:
    slopes = [W.diff(s[name]) for name in ("I1", "I2", "J", *_STRETCHES)]
    lines, (first, second, volume, *along) = _body(slopes, names)
    result = [f"    P = combine(2.0 * ({first}), F, {volume}, H)"]
    if slopes[1] != 0:
        result.append(f"    P = combine(1.0, P, 2.0 * ({second}), cross(H, F))")
    if any(slope != 0 for slope in slopes[3:]):
        over = ", ".join(f"({one}) / {name}" for one, name in zip(along, _STRETCHES))
        result.append(f"    P = combine(1.0, P, 1.0, matmul(F, general(from_principal(({over}), axes))))")
    head = ["@stress.of(Formula)", "def _stress(law, F, H, J):", *_state_lines(W)]
    return "\n".join([*head, *lines, *result, "    return P\n"])


def _waves_source(of_volume: Any, rest: Any, s: Any, names: dict[str, str]) -> str:
    """Terms of J alone exactly, the others by stretches."""
    a, b, c = (s[name] for name in _STRETCHES)
    squares = {s["I1"]: a**2 + b**2 + c**2, s["I2"]: (a * b) ** 2 + (a * c) ** 2 + (b * c) ** 2}
    rest = rest.subs(squares | {s["J"]: a * b * c})
    pairs = [(a, a), (b, b), (c, c), (a, b), (a, c), (b, c)]
    slopes = [rest.diff(one) for one in (a, b, c)]
    lines, found = _body([*slopes, *(rest.diff(i).diff(j) for i, j in pairs), of_volume.diff(s["J"], 2)], names)
    return "\n".join(
        [
            "@pressure_waves.of(Formula)",
            "def _waves(law, F, H, J):",
            _STATE["stretches"],
            *lines,
            f"    Q = stretch_waves(squares, axes, ({', '.join(found[:3])}), ({', '.join(found[3:9])}))",
            f"    return combine_symmetric(1.0, Q, max({found[9]}, 0.0), gram(H))\n",
        ]
    )


# --- the law, and what is checked -----------------------------------------------------------------------------------


@cache
def _law_of(text: str, constants: tuple[str, ...]) -> Any:
    """The NamedTuple of a formula; its source is kept in the folder of kernels."""
    source = source_of(text, constants)
    path = kernel_cache.cache_folder() / f"formula_{hashlib.sha256(source.encode()).hexdigest()[:16]}.py"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source, encoding="utf-8")
    except OSError:
        # the file is for who reads it; the law is made of the text
        pass
    return registry.from_text(str(path), "Formula", source)


def _law_with(text: str, constants: tuple[tuple[str, float], ...]) -> Any:
    return _law_of(text, tuple(name for name, _ in constants))(
        1.0, *(float(value) for _, value in constants), None, None
    )


@cache
def _faults(text: str, constants: tuple[tuple[str, float], ...]) -> tuple[Any, ...]:
    """(key, expected, found) of a formula with its constants."""
    names = tuple(name for name, _ in constants)
    strange = [
        name for name in names if not name.isidentifier() or keyword.iskeyword(name) or name in (*VARIABLES, *FUNCTIONS)
    ]
    if strange:
        return tuple(
            (("constants", name), "a name of letters that the formula has no meaning for", name) for name in strange
        )
    try:
        formula = expression_of(text, names)
        used = {symbol.name for symbol in formula.free_symbols}
        unused = [name for name in names if name not in used]
        if unused:
            return tuple((("constants", name), "a constant of the formula", name) for name in unused)
        # a root or a logarithm of a negative number near rest
        a, b, c = _TRIED
        J = a * b * c
        first, second = a * a + b * b + c * c, (a * b) ** 2 + (a * c) ** 2 + (b * c) ** 2
        shrink = J ** (-1.0 / 3.0)
        state = (first, second, J, shrink**2 * first, shrink**4 * second, a, b, c, shrink * a, shrink * b, shrink * c)
        values = dict(zip(VARIABLES, state)) | dict(constants)
        found = formula.subs({symbol: values[symbol.name] for symbol in formula.free_symbols}).evalf()
        if not (found.is_real and found.is_finite):
            raise FormulaError("a formula of real numbers near rest", Phrase(str(found)))
        _check(_law_with(text, constants))
    except FormulaError as error:
        return ((("energy",), error.expected, error.found),)
    except registry.LawError as error:
        return ((("energy",), str(error), text[:200]),)
    return ()


def _check(law: Any) -> None:
    """Raise FormulaError for a law that has energy or stress at rest, does not resist changes of shape and volume, or
    is not the same along all axes."""
    from parsolid.materials.hyperelastic import functions as of
    from parsolid.tensors import IDENTITY

    def at(stretches: tuple[float, ...]) -> float:
        a, b, c = stretches
        return float(of.energy_of(law, (a, 0.0, 0.0, 0.0, b, 0.0, 0.0, 0.0, c)))

    try:
        energy, stress = float(of.energy(law, IDENTITY, IDENTITY, 1.0)), of.stress(law, IDENTITY, IDENTITY, 1.0)
        shear, lame = map(float, of.elastic_moduli(law))
        of.pressure_waves(law, IDENTITY, IDENTITY, 1.0)
        exchanged = [at(tried) for tried in itertools.permutations(_TRIED)]
    except (ArithmeticError, ValueError, TypeError) as error:
        # such as the root of a negative number
        raise FormulaError("a formula that has values near rest", Phrase(str(error))) from error
    bulk = lame + 2.0 / 3.0 * shear
    if not shear > 0.0:
        raise FormulaError("a shear modulus above 0 at rest", shear)
    if not bulk > 0.0:
        raise FormulaError("a bulk modulus above 0 at rest", bulk)
    scale = _AT_REST * (shear + bulk)
    if not abs(energy) <= scale:
        raise FormulaError("no energy at rest", energy)
    if not max(map(abs, stress)) <= scale:
        raise FormulaError("no stress at rest", max(map(abs, stress)))
    if max(exchanged) - min(exchanged) > scale:
        raise FormulaError("the same energy where two stretches are exchanged", max(exchanged) - min(exchanged))
