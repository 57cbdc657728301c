"""python -m checks.variants -o docs/variants.md: variants of faults that once went unnoticed, and what happens in each.

Each variant is a small scene with a value known by hand; it runs as a user would run it, on one or three ranks. It is
"right" within its tolerance of that value, "refused" with status 2, "failed" with status 3 and "told" where the energy
check or a warning speaks against a run that is not right. All else is "wrong" and makes the status of this program 1.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

HEAD = "| row | variant | ranks | found over wanted | what happens |\n|---|---|---|---|---|\n"


class Variant(NamedTuple):
    """words: what is varied; tables: of the scene, as JSON; value: of the last rows of the history, see `last`; wanted:
    that value by hand; within: relative tolerance; mesh: writes the scene's mesh into a folder."""

    row: str
    words: str
    tables: dict[str, Any]
    value: Callable[[dict[str, np.ndarray]], float]
    wanted: float
    within: float
    ranks: int = 1
    mesh: Callable[[Path], None] | None = None


def pulled(kind: str, strain: float, rate: float = 0.5, dimension: int = 2, across: int = 10, **method: Any) -> dict:
    """A block between rollers, drawn along X by a plane; see `confined_stress`."""
    upper, count = [1.0, 0.5, 0.5][:dimension], [2 * across, across, across][:dimension]
    velocity = math.copysign(rate, strain)
    body = {"shape": {"box": {"lower": [0.0] * dimension, "upper": upper}}, "particles": count, "placement": "cells"}
    body |= {"velocity": [f"{velocity}*X", *["0"] * (dimension - 1)], "material": NEO}
    rollers = ["X = 0", *(f"{axis} = {end}" for axis in "YZ"[: dimension - 1] for end in (0, 0.5))]
    drawn = {"kind": "velocity", "plane": "X = 1", "velocity": [str(velocity), *["free"] * (dimension - 1)]}
    probe = {"name": "all", "weight": "1", "fields": ["stress"]}
    return {
        "dimension": dimension,
        "end_time": abs(strain) / rate,
        "method": {"kind": kind, **method},
        "bodies": [body],
        "boundaries": [*({"kind": "roller", "plane": plane} for plane in rollers), drawn],
        "probes": [probe],
    }


NEO = {"kind": "neo-hookean", "density": 1000, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
METAL = {
    "kind": "elastic-plastic",
    "density": 1000,
    "specific_heat": 1000,
    "youngs_modulus": 1e6,
    "poissons_ratio": 0.3,
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 1e12, "hardening": 0.0},
}


def confined_stress(strain: float, poisson: float = 0.3, rate_law: bool = False) -> float:
    """Stress [Pa] along X of a block of E = 1 MPa that is stretched along X alone."""
    shear, lame = 0.5e6 / (1.0 + poisson), 1e6 * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    J = 1.0 + strain
    return (lame + 2.0 * shear) * math.log(J) if rate_law else shear * (J - 1.0 / J) + lame * (J - 1.0)


def last(column: str) -> Callable[[dict[str, np.ndarray]], float]:
    """The mean of a column over the last tenth of the run."""

    def value(columns: dict[str, np.ndarray]) -> float:
        late = columns["time"] >= 0.9 * columns["time"][-1]
        return float(columns[column][late].mean())

    return value


def late_stress(strain: float, rate_law: bool = False, poisson: float = 0.3) -> float:
    """What `last` takes of a stress that grows with the strain."""
    parts = np.linspace(0.9, 1.0, 101)
    return float(np.mean([confined_stress(part * strain, poisson, rate_law) for part in parts]))


def with_material(tables: dict, material: dict) -> dict:
    tables["bodies"][0]["material"] = material
    return tables


def tension_in_ulsph() -> Iterator[Variant]:
    """Row A4: an elastic block that is pulled."""
    stress = last("all.stress_xx")

    def one(words: str, tables: dict, strain: float, rate_law: bool, ranks: int = 1, poisson: float = 0.3) -> Variant:
        return Variant("A4", words, tables, stress, late_stress(strain, rate_law, poisson), 0.1, ranks)

    for strain in (0.05, 0.1, 0.2):
        for name, material in (("rubber", NEO), ("metal", METAL)):
            tables = with_material(pulled("ulsph", strain), material)
            yield one(f"{name}, strain {strain}", tables, strain, material is METAL)
    yield one("rubber, strain .1", pulled("ulsph", 0.1), 0.1, False, 3)
    yield one("metal, strain .1", with_material(pulled("ulsph", 0.1), METAL), 0.1, True, 3)
    for nu in (0.1, 0.4):
        tables = with_material(pulled("ulsph", 0.1), NEO | {"poissons_ratio": nu})
        yield one(f"rubber, strain .1, nu {nu}", tables, 0.1, False, 1, nu)
    yield one("rubber, strain .1, 40 x 20", pulled("ulsph", 0.1, across=20), 0.1, False)
    yield one("rubber in space, strain .1", pulled("ulsph", 0.1, dimension=3, across=6), 0.1, False)
    yield one("metal, pressed by .1", with_material(pulled("ulsph", -0.1), METAL), -0.1, True)
    yield one("rubber, smoothing 1.6", pulled("ulsph", 0.1, smoothing=1.6), 0.1, False)


def driven_planes_of_mpm() -> Iterator[Variant]:
    """Row A5: the same in `mpm`, to large strains."""
    stress = last("all.stress_xx")

    def one(words: str, tables: dict, strain: float, within: float = 0.1, ranks: int = 1) -> Variant:
        return Variant("A5", words, tables, stress, late_stress(strain), within, ranks)

    for strain in (0.1, 0.4, 0.6, -0.3):
        yield one(f"strain {strain}", pulled("mpm", strain, cell=0.1), strain)
    yield one("strain .4", pulled("mpm", 0.4, cell=0.1), 0.4, ranks=3)
    yield one("strain .4, four points a cell and axis", pulled("mpm", 0.4, across=20, cell=0.1), 0.4, 0.03)
    for key, word in (("basis", "linear"), ("basis", "cubic-spline"), ("transfer", "flip"), ("transfer", "aflip")):
        yield one(f"strain .4, {key} {word}", pulled("mpm", 0.4, cell=0.1, **{key: word}), 0.4)
    yield one("strain .4, cells of one spacing", pulled("mpm", 0.4, cell=0.05), 0.4)
    yield one("strain .4, in space", pulled("mpm", 0.4, dimension=3, across=6, cell=1.0 / 6.0), 0.4)
    yield one("strain .4, ten times as fast", pulled("mpm", 0.4, rate=5.0, cell=0.1), 0.4)


def meshes_with_nuisances() -> Iterator[Variant]:
    """Row B3: a square of triangles that moves at 1 m/s: its kinetic energy is half its mass."""
    plain: dict[str, Any] = {
        "version": "2.2",
        "noise": 0.0,
        "unused": None,
        "named": True,
        "turned": False,
        "quads": False,
    }
    cases = [("plain", {}, 1), ("plain", {}, 3)]
    cases += [(f"Z noise of {noise:g}", {"noise": noise}, 1) for noise in (1e-17, -1e-15, 1e-13, 1e-3)]
    cases += [(f"a node of no element at Z = {z:g}", {"unused": z}, 1) for z in (0.0, 1.0, -1e9)]
    cases += [("unnamed groups", {"named": False}, 1), ("elements turned", {"turned": True}, 1)]
    cases += [("squares", {"quads": True}, 1), ("squares, Z noise of 1e-17", {"quads": True, "noise": 1e-17}, 3)]
    cases += [("Z noise and an unused node", {"noise": 1e-17, "unused": 1.0}, 3)]
    for words, changed, ranks in cases:
        body = {"shape": {"mesh": {"file": "square.msh"}}, "velocity": ["1", "0"], "material": NEO}
        tables = {"dimension": 2, "end_time": 1e-3, "method": {"kind": "tlsph"}, "bodies": [body]}
        options = plain | changed
        yield Variant(
            "B3", words, tables, last("kinetic"), 500.0, 1e-6, ranks, lambda at, how=options: write(at, **how)
        )


def write(
    folder: Path, version: str, noise: float, unused: float | None, named: bool, turned: bool, quads: bool
) -> None:
    """A unit square of 5 x 5 nodes as a file of Gmsh 2.2, with a group of all elements and one of the side X = 0."""
    n = 5
    nodes = [(i / (n - 1), j / (n - 1), noise * ((i + j) % 2)) for i in range(n) for j in range(n)]
    if unused is not None:
        nodes.append((0.5, 0.5, unused))
    number = lambda i, j: i * n + j + 1  # noqa: E731
    cells = []
    for i in range(n - 1):
        for j in range(n - 1):
            a, b, c, d = number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)
            cells += [(3, [a, b, c, d])] if quads else [(2, [a, b, c]), (2, [a, c, d])]
    cells = [(kind, list(reversed(at))) for kind, at in cells] if turned else cells
    elements = [f"{kind} 2 1 1 {' '.join(map(str, at))}" for kind, at in cells]
    elements += [f"1 2 2 2 {number(0, j)} {number(0, j + 1)}" for j in range(n - 1)]
    lines = ["$MeshFormat", f"{version} 0 8", "$EndMeshFormat"]
    if named:
        lines += ["$PhysicalNames", "2", '1 2 "side"', '2 1 "body"', "$EndPhysicalNames"]
    lines += [
        "$Nodes",
        str(len(nodes)),
        *(f"{k} {x!r} {y!r} {z!r}" for k, (x, y, z) in enumerate(nodes, 1)),
        "$EndNodes",
    ]
    lines += ["$Elements", str(len(elements)), *(f"{k} {one}" for k, one in enumerate(elements, 1)), "$EndElements"]
    (folder / "square.msh").write_text("\n".join(lines) + "\n")


def far_from_the_origin() -> Iterator[Variant]:
    """Row B5: a block that presses itself together stores M e^2/2, but for the layers beside its ends, which waves have
    reached."""

    def block(kind: str, at: list[float], **method: Any) -> dict:
        d = len(at)
        count, material = 8, METAL if kind == "ulsph" else NEO
        body = {"shape": {"box": {"lower": at, "upper": [x + 1.0 for x in at]}}, "particles": [count] * d}
        body |= {"placement": "cells", "material": material, "velocity": [f"-2*(X - {at[0]!r})", *["0"] * (d - 1)]}
        return {"dimension": d, "end_time": 1e-3, "method": {"kind": kind, **method}, "bodies": [body]}

    def stored(columns: dict[str, np.ndarray]) -> float:
        column = next(columns[name] for name in ("strain_energy", "internal_energy") if name in columns)
        return float(column[-1] - column[0])

    modulus = 1e6 * 0.7 / (1.3 * 0.4)
    wanted, within = 0.5 * modulus * 2e-3**2, 0.12
    grid = {"cell": 0.25}
    for at in ([2e5, 0.0], [3e5, -4e6], [-1e8, 1e8], [2.0**31, 0.0], [1e12, 0.0], [1e5, 1e5, -1e7]):
        words = f"mpm at ({', '.join(f'{x:g}' for x in at)})"
        yield Variant("B5", words, block("mpm", at, **grid), stored, wanted, within)
    yield Variant("B5", "mpm at (4.5e5, 5.5e6)", block("mpm", [4.5e5, 5.5e6], **grid), stored, wanted, within, 3)
    # viscous heat would be internal energy, too
    inviscid = {"viscosity": {"linear": 0.0, "quadratic": 0.0}}
    for kind, method in (("tlsph", {}), ("peridynamics", {}), ("ulsph", inviscid)):
        for ranks in (1, 3):
            tables = block(kind, [4.5e5, 5.5e6], **method)
            yield Variant("B5", f"{kind} at (4.5e5, 5.5e6)", tables, stored, wanted, within, ranks)
    stated = block("mpm", [4.5e5, 5.5e6], **grid, origin=[4.5e5, 5.5e6])
    yield Variant("B5", "mpm at (4.5e5, 5.5e6), origin stated", stated, stored, wanted, within)


ROWS = [tension_in_ulsph, driven_planes_of_mpm, meshes_with_nuisances, far_from_the_origin]


def columns_of(path: Path) -> dict[str, np.ndarray]:
    """The columns of a history."""
    table = np.genfromtxt(path, delimiter=",", names=True, deletechars="", comments="#")
    return {name: np.atleast_1d(table[name]) for name in table.dtype.names}


def toml(value: Any) -> str:
    """A value as TOML has it in one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def result(variant: Variant) -> tuple[float, str]:
    """The value over that wanted, NaN without one, and what happens."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        if variant.mesh is not None:
            variant.mesh(folder)
        tables = variant.tables | {"output": {"pictures": False, "history_steps": 1}}
        scene = folder / "scene.toml"
        scene.write_text("\n".join(f"{key} = {toml(value)}" for key, value in tables.items()))
        launch = ["mpirun", "-n", str(variant.ranks)] if variant.ranks > 1 else []
        command = [*launch, sys.executable, "-m", "parsolid", "run", str(scene), "-o", str(folder / "out"), "-q"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
        if done.returncode in (2, 3):
            message = [line for line in done.stderr.splitlines() if line.strip()]
            said = next((line for line in message if "expected" in line or "failed" in line), message[0])
            return math.nan, f"{ {2: 'refused', 3: 'failed'}[done.returncode] }: {said.strip()[:160]}"
        if done.returncode:
            return math.nan, f"wrong: status {done.returncode}"
        summary = json.loads((folder / "out" / "summary.json").read_text())
        ratio = variant.value(columns_of(folder / "out" / "history.csv")) / variant.wanted
    if abs(ratio - 1.0) <= variant.within:
        return ratio, "right"
    codes = [summary["energy_check_code"], *(one["code"] for one in summary["warnings"])]
    told = ", ".join(code for code in codes if code)
    return ratio, f"told: {told}" if told else "wrong"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m checks.variants", description=__doc__)
    parser.add_argument("-o", "--output", help="a file for the table")
    parser.add_argument("--only", default="", help="rows whose name has this in it")
    given = parser.parse_args()
    lines, wrong = [], 0
    for row in ROWS:
        for variant in row():
            if given.only not in variant.row:
                continue
            ratio, words = result(variant)
            wrong += words.startswith("wrong")
            shown = "-" if math.isnan(ratio) else f"{ratio:.4g}"
            lines.append(f"| {variant.row} | {variant.words} | {variant.ranks} | {shown} | {words.replace('|', '/')} |")
            print(lines[-1], flush=True)
    if given.output:
        title = (
            "# Variants of faults\n\nWritten by `python -m checks.variants -o docs/variants.md`: runs whose value is "
            "known by hand, around faults that once went unnoticed. A4: an elastic block that is pulled in `ulsph`; "
            "A5: the same in `mpm`, to large strains; B3: what mesh programs leave in files; B5: far from the origin."
        )
        Path(given.output).write_text(f"{title}\n\n{HEAD}" + "\n".join(lines) + "\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
