"""python -m checks.formula_attack --number 20000: formulas put together at random, hostile words among them.

Each is refused with a message (ValueError) or gives as many real numbers as there are points; while it is read and
evaluated no file is opened, no module loaded, no process started, no socket made (Python's audit hooks see it). Prints
what became of them; status 1 when one did anything else.
"""

import argparse
import random
import sys
import warnings
from collections import Counter

import numpy as np

from parsolid.scene.formulas import Formula

POINTS = np.array([[0.25, 2.0, -1.0], [1.0, 3.0, 4.0]])
WORDS = (
    *(
        "X",
        "Y",
        "Z",
        "t",
        "pi",
        "1",
        "0",
        "2.5",
        "-3",
        "1e308",
        "1e-320",
        "9" * 400,
        "0x10",
        "1_0",
        "1j",
        "True",
        "None",
    ),
    *(
        "+",
        "-",
        "*",
        "/",
        "**",
        "%",
        "//",
        "@",
        "<",
        "<=",
        "==",
        "!=",
        "&",
        "|",
        "~",
        "^",
        "<<",
        "and",
        "or",
        "not",
        "in",
    ),
    *("(", ")", "(", ")", ",", "[", "]", "{", "}", ".", ":", ":=", ";", "=", "\n", "\\", "#", "\0", "\ufeff", "é", "٣"),
    *("sin(", "where(", "arctan2(", "exp(", "sqrt(", "log(", "arccos(", "table(", "mean(", "sum(", "float(", "abs("),
    *("__import__('os').system('touch hostile')", "open('/etc/passwd').read()", "X.__class__.__mro__", "().__class__"),
    *(
        "eval('1')",
        "exec('1')",
        "globals()",
        "getattr(X, 'T')",
        "lambda: 0",
        "[x for x in X]",
        "f'{X}'",
        "'text'",
        "b'1'",
    ),
    *(
        "X if Y else Z",
        "yield",
        "await X",
        "import os",
        "def f(): 0",
        "print(X)",
        "X.tofile('hostile')",
        "_numexpr_last",
    ),
    *("evaluate('X')", "complex(X, Y)", "real(X)", "min(X, Y)", "sin", "numexpr", "np.sin(X)", "__builtins__"),
)
WATCHED = ("open", "import", "os.", "subprocess.", "socket.", "shutil.", "ctypes.", "pty.", "webbrowser.")
_seen: list[str] = []
_watching = False


def _hook(event: str, arguments: tuple) -> None:
    if _watching and event.startswith(WATCHED):
        _seen.append(f"{event} {arguments}")


def drawn(chance: random.Random) -> str:
    """A formula: words in a row, or operations within one another with a word in a wrong place now and then."""
    if chance.random() < 0.4:
        return chance.choice(("", " ")).join(chance.choices(WORDS, k=chance.randint(1, 12)))

    def term(depth: int) -> str:
        if depth == 0 or chance.random() < 0.2:
            return chance.choice(WORDS[:9] if chance.random() < 0.95 else WORDS)
        way = chance.random()
        if way < 0.6:
            return f"({term(depth - 1)} {chance.choice(('+', '-', '*', '/', '**', '%', '<', '&'))} {term(depth - 1)})"
        name = chance.choice(("sin", "sqrt", "log", "exp", "arccos", "tanh", "where", "arctan2", "abs"))
        parts = {"where": 3, "arctan2": 2}.get(name, 1)
        return f"{name}({', '.join(term(depth - 1) for _ in range(parts))})"

    return term(chance.randint(1, 6))


def became(text: str) -> str:
    """What a formula did."""
    try:
        with np.errstate(all="ignore"):
            values = Formula(text).evaluate(POINTS, 0.5)
    except ValueError as error:
        return "refused" if str(error) else "refused without a word"
    except Exception as error:
        return f"{type(error).__name__}: {error}"[:200]
    return "a value" if values.shape == (2,) and values.dtype == float else f"{values.dtype} {values.shape}"


def main() -> int:
    """Attack with so many formulas."""
    global _watching
    parser = argparse.ArgumentParser(prog="python -m checks.formula_attack", description=__doc__)
    parser.add_argument("--number", type=int, default=20000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    warnings.simplefilter("error")
    # what is loaded once is loaded now
    became("sin(X) + where(X < 1, 2, 3)"), became("sn(X)"), became("(-8)**0.5"), became("é")
    sys.addaudithook(_hook)
    chance, ended, faults = random.Random(options.seed), Counter[str](), 0
    for _ in range(options.number):
        text = drawn(chance)
        _watching = True
        found = became(text)
        _watching = False
        ended[found if found in ("refused", "a value") else "fault"] += 1
        if found not in ("refused", "a value") or _seen:
            faults += 1
            print(f"FAULT {text!r}: {found} {_seen[:3]}", flush=True)
            _seen.clear()
    print(f"{options.number} formulas (seed {options.seed}): {dict(ended)}, {faults} faults")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
