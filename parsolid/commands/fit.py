"""`parsolid fit`: parameters of a hyperelastic law from measured stretches and nominal stresses."""

import csv
import json
from pathlib import Path
from typing import Any

from parsolid.collective import SolverError
from parsolid.exit_status import DONE


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    parser.add_argument(
        "data", metavar="DATA.csv", help="columns kind (uniaxial, equibiaxial, pure-shear, torsion), stretch, stress"
    )
    parser.add_argument("--law", required=True, metavar="KIND", help="of hyperelastic materials, such as yeoh or ogden")
    fixed = "hold a parameter of the law, such as alpha_1=1.3; may be repeated"
    parser.add_argument("--fix", action="append", default=[], metavar="NAME=VALUE", help=fixed)
    parser.add_argument(
        "--angle", type=float, metavar="DEGREES", help="of fibres in the sheet from the first axis; on both sides of it"
    )
    parser.add_argument("-o", "--output", metavar="FILE.csv", help="write the curve beside the points")


def run_fit(comm: Any, options: Any) -> int:
    """Print the parameters with their 95 % intervals, ready for a scene; the exit status. On rank 0.

    Raises SolverError for data, a law or parameters that are none.
    """
    if comm.rank > 0:
        return DONE
    from parsolid.materials import registry
    from parsolid.output.log import print_line
    from parsolid.point.fit import directions_at, fit, fitted_parameters, has_fibres
    from parsolid.scene.validation_errors import suggestion

    kinds = [kind for kind in registry.kinds("hyperelastic") if kind != "formula" and fitted_parameters(kind)]
    if options.law not in kinds:
        known = f"expected one of {', '.join(kinds)}{suggestion(options.law, kinds)}"
        raise SolverError(f"--law: {known}, found {options.law!r}")
    known_names, fixed = fitted_parameters(options.law), {}
    for text in options.fix:
        name, _, value = text.partition("=")
        try:
            fixed[name] = float(value)
        except ValueError:
            raise SolverError(f"--fix {name}: expected a number, found {value!r}") from None
        if name not in known_names:
            raise SolverError(f"--fix: expected one of {', '.join(known_names)}, found {name!r}")
    if has_fibres(options.law) != (options.angle is not None):
        expected = "an angle of the fibres" if options.angle is None else "no angle of a law without fibres"
        raise SolverError(f"--angle: expected {expected}, found {'none' if options.angle is None else options.angle}")
    tests = read_tests(options.data)
    try:
        found = fit(options.law, tests, fixed, options.angle or 0.0)
    except ValueError as error:
        raise SolverError(f"--law {options.law}: expected {error}, found none") from error
    print_line(f"[bodies.material]\nkind = {json.dumps(options.law)}")
    for name, value, spread in zip(found.names, found.values, found.spread):
        print_line(f"{name} = {value:.6g}    # +- {spread:.2g}")
    for name, value in fixed.items():
        print_line(f"{name} = {value:g}    # held")
    for name, stated in directions_at(options.law, options.angle or 0.0).items():
        print_line(f"{name} = {{ vector = [{', '.join(f'{x:.6g}' for x in stated['vector'])}] }}")
    points = sum(len(one.stretch) for one in tests)
    print_line(
        f"# {points} points: root mean square of the differences {found.error:.3g} of the largest stress of a test"
    )
    if options.output:
        try:
            with Path(options.output).open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(["kind", "stretch", "stress", "fitted"])
                for one, curve in zip(tests, found.curves):
                    writer.writerows([one.kind, a, s, f"{c:.6g}"] for a, s, c in zip(one.stretch, one.stress, curve))
        except OSError as error:
            raise SolverError(f"-o: expected a file that can be written, found {error}") from error
    return DONE


def read_tests(path: str) -> list[Any]:
    """The tests of a file by their kinds. Raises SolverError with the line."""
    import numpy as np

    from parsolid.point.fit import KINDS, TORSION, Measured

    found: dict[str, list[tuple[float, float]]] = {}
    try:
        with Path(path).open(newline="", encoding="utf-8") as file:
            rows = csv.DictReader(file)
            table, columns = list(rows), list(rows.fieldnames or ())
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SolverError(f"{path}: expected a file that can be read, found {error}") from error
    if not {"stretch", "stress"} <= set(columns):
        raise SolverError(f"{path}: expected columns kind, stretch, stress, found {', '.join(columns) or 'nothing'}")
    for number, row in enumerate(table, 2):
        kind, here = row.get("kind") or "uniaxial", f"{path}, line {number}"
        if kind not in KINDS:
            raise SolverError(f"{here}: expected one of {', '.join(KINDS)}, found {kind!r}")
        stretch, stress = _number(row["stretch"]), _number(row["stress"])
        if not ((0.0 < stretch or kind == TORSION) and abs(stretch) < np.inf and abs(stress) < np.inf):
            stated = f"{row['stretch']}, {row['stress']}"
            raise SolverError(f"{here}: expected a stretch above 0 and a stress [Pa], found {stated}")
        found.setdefault(kind, []).append((stretch, stress))
    tests = [Measured(kind, *np.array(points).T) for kind, points in found.items()]
    if not tests or not all((one.stretch != one.at_rest).any() and one.stress.any() for one in tests):
        raise SolverError(f"{path}: expected points with stretch and stress in each test, found none")
    return tests


def _number(text: str | None) -> float:
    try:
        return float(text or "")
    except ValueError:
        return float("nan")
