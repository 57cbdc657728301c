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
        "data",
        metavar="DATA.csv",
        help="columns kind (uniaxial, equibiaxial, pure-shear, torsion), stretch, stress; time of held sheets",
    )
    parser.add_argument("--law", required=True, metavar="KIND", help="of hyperelastic materials, such as yeoh or ogden")
    fixed = "hold a parameter of the law, such as alpha_1=1.3; may be repeated"
    parser.add_argument("--fix", action="append", default=[], metavar="NAME=VALUE", help=fixed)
    parser.add_argument(
        "--angle", type=float, metavar="DEGREES", help="of fibres in the sheet from the first axis; on both sides of it"
    )
    parser.add_argument("-o", "--output", metavar="FILE.csv", help="write the curve beside the points")


def run_fit(comm: Any, options: Any) -> int:
    """Print the parameters with their 95 % intervals as a table of a scene, on rank 0; the exit status.

    Raises SolverError for faulty data, an unknown law or unknown parameters.
    """
    if comm.rank > 0:
        return DONE
    from parsolid.materials import registry
    from parsolid.output.log import print_line
    from parsolid.point.fit import directions_at, fit, fit_branches, fitted_parameters, has_fibres, law_with
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
        if sum(other.partition("=")[0] == name for other in options.fix) > 1:
            raise SolverError(f"--fix {name}: expected it once, found it twice")
        if name not in known_names:
            raise SolverError(f"--fix: expected one of {', '.join(known_names)}, found {name!r}")
    if has_fibres(options.law) != (options.angle is not None):
        expected = "an angle of the fibres" if options.angle is None else "no angle of a law without fibres"
        raise SolverError(f"--angle: expected {expected}, found {'none' if options.angle is None else options.angle}")
    if options.angle is not None and not abs(options.angle) <= 180.0:
        raise SolverError(f"--angle: expected a number from -180 to 180, found {options.angle:g}")
    if options.output and Path(options.output).resolve() == Path(options.data).resolve():
        raise SolverError(f"-o: expected another file than the data, found {options.output}")
    tests, relaxed = read_tests(options.data)
    free = sum(name not in fixed for name in known_names)
    different = sum(len({*one.stretch} - {one.at_rest}) for one in tests)
    if different < free:
        raise SolverError(
            f"{options.data}: expected {free} different stretches for {free} parameters, found {different}"
        )
    angle, branches = options.angle or 0.0, None
    try:
        found = fit(options.law, tests, fixed, angle)
        if relaxed:
            law = law_with(options.law, dict(zip(found.names, found.values)) | fixed, angle)
            branches = fit_branches(law, relaxed)
    except ValueError as error:
        raise SolverError(f"--law {options.law}: expected {error}, found none") from error
    print_line(f"[bodies.material]\nkind = {json.dumps(options.law)}")
    for name, value, spread in zip(found.names, found.values, found.spread):
        print_line(f"{name} = {value:.6g}    # +- {spread:.2g}")
    for name, value in fixed.items():
        print_line(f"{name} = {value:g}    # held")
    for name, stated in directions_at(options.law, options.angle or 0.0).items():
        print_line(f"{name} = {{ vector = [{', '.join(f'{x:.6g}' for x in stated['vector'])}] }}")
    if branches is not None:
        terms = [f"{{ modulus = {mu:.6g}, tau = {tau:.6g} }}" for mu, tau in zip(branches.moduli, branches.times)]
        print_line(f"branches = [{', '.join(terms)}]    # moduli +- {', '.join(f'{x:.2g}' for x in branches.spread)}")
        print_line(f"# held: root mean square of the differences {branches.error:.3g} of the largest stress")
    points = sum(len(one.stretch) for one in tests)
    print_line(f"# {points} points: rms of the differences {found.error:.3g} of the largest stress of a test")
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


def read_tests(path: str) -> tuple[list[Any], list[Any]]:
    """The equilibrium tests of a file and the relaxation tests (rows with a time), one each per kind. Raises
    SolverError with the line."""
    import numpy as np

    from parsolid.point.fit import KINDS, TORSION, Measured, Relaxed

    slow: dict[str, list[tuple[float, float]]] = {}
    held: dict[str, list[tuple[float, float, float]]] = {}
    try:
        with Path(path).open(newline="", encoding="utf-8") as file:
            rows = csv.DictReader(file)
            table, columns = list(rows), list(rows.fieldnames or ())
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SolverError(f"{path}: expected a file that can be read, found {error}") from error
    if not {"stretch", "stress"} <= set(columns):
        raise SolverError(f"{path}: expected columns kind, stretch, stress, found {', '.join(columns) or 'nothing'}")
    if len(set(columns)) < len(columns):
        raise SolverError(f"{path}: expected columns of different names, found {', '.join(columns)}")
    for number, row in enumerate(table, 2):
        if None in row:
            raise SolverError(f"{path}, line {number}: expected {len(columns)} values, found more")
        kind, here = row.get("kind") or "uniaxial", f"{path}, line {number}"
        if kind not in KINDS:
            raise SolverError(f"{here}: expected one of {', '.join(KINDS)}, found {kind!r}")
        stretch, stress = _number(row["stretch"]), _number(row["stress"])
        if not ((0.0 < stretch or kind == TORSION) and abs(stretch) < np.inf and abs(stress) < np.inf):
            stated = f"{row['stretch']}, {row['stress']}"
            raise SolverError(f"{here}: expected a stretch above 0 and a stress [Pa], found {stated}")
        if not (row.get("time") or "").strip():
            slow.setdefault(kind, []).append((stretch, stress))
            continue
        time = _number(row["time"])
        if not 0.0 < time < np.inf or kind == TORSION:
            raise SolverError(f"{here}: expected a time above 0 [s] of a sheet, found {row['time']} of {kind}")
        held.setdefault(kind, []).append((time, stretch, stress))
    tests = [Measured(kind, *np.array(points).T) for kind, points in slow.items()]
    if not tests or not all((one.stretch != one.at_rest).any() and one.stress.any() for one in tests):
        raise SolverError(f"{path}: expected points with stretch and stress in each test, found none")
    return tests, [Relaxed(kind, *np.array(points).T) for kind, points in held.items()]


def _number(text: str | None) -> float:
    try:
        return float(text or "")
    except ValueError:
        return float("nan")
