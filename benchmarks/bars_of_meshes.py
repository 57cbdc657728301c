"""How often the true error of bodies from meshes lies within the bar: docs/error-bars.md.

python benchmarks/bars_of_meshes.py [--only WORDS] [--report]. Every part is meshed from geometry, and given as a mesh
of which coarser ones are made within its own surface.
"""

import argparse
import pickle
from collections.abc import Iterator
from functools import partial
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import gmsh
from bars_coverage import BENT, CORNER, ROOT, TWIST, Scene, report, run

from parsolid.scene.loading import read_tables

NU, LOAD = 0.3, 1e-5
SOFT = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": NU}
SYMMETRY = [{"kind": "roller", "plane": f"{axis} = 0"} for axis in "XYZ"]
R = "sqrt(X**2 + Y**2)"
PARTS = {
    "square": "Rectangle(1) = {0,0,0,1,1};",
    "column": "Box(1) = {-.5,0,-.5,1,6,1};",
    "beam": "Box(1) = {-.5,0,-.5,1,3,1};",
    "quarter": "Disk(1)={0,0,0,2}; Disk(2)={0,0,0,1}; Rectangle(3)={0,0,0,2,2}; "
    "BooleanDifference(4)={Surface{1}; Delete;}{Surface{2}; Delete;}; "
    "BooleanIntersection(5)={Surface{4}; Delete;}{Surface{3}; Delete;};",
    "ring": "Disk(1)={0,0,0,2}; Disk(2)={0,0,0,1}; BooleanDifference(4)={Surface{1}; Delete;}{Surface{2}; Delete;};",
    "plate": "Disk(1)={0,0,0,4}; Disk(2)={0,0,0,1}; Rectangle(3)={0,0,0,4,4}; "
    "BooleanDifference(4)={Surface{1}; Delete;}{Surface{2}; Delete;}; "
    "BooleanIntersection(5)={Surface{4}; Delete;}{Surface{3}; Delete;};",
    "shell": "Sphere(1)={0,0,0,2}; Sphere(2)={0,0,0,1}; Box(3)={0,0,0,2,2,2}; "
    "BooleanDifference(4)={Volume{1}; Delete;}{Volume{2}; Delete;}; "
    "BooleanIntersection(5)={Volume{4}; Delete;}{Volume{3}; Delete;};",
    "cook": "Point(1)={0,0,0}; Point(2)={48,44,0}; Point(3)={48,60,0}; Point(4)={0,44,0}; "
    "Line(1)={1,2}; Line(2)={2,3}; Line(3)={3,4}; Line(4)={4,1}; Curve Loop(1)={1,2,3,4}; Plane Surface(1)={1};",
    "angle": "Rectangle(1)={0,0,0,4,1}; Rectangle(2)={0,0,0,1,4}; "
    "BooleanUnion(3)={Surface{1}; Delete;}{Surface{2}; Delete;};",
}
# length of edges of the finest mesh
SIZES = {
    "square": 1 / 40,
    "column": 1 / 6,
    "beam": 1 / 6,
    "quarter": 1 / 16,
    "ring": 1 / 14,
    "plate": 1 / 12,
    "shell": 1 / 7,
    "cook": 2.0,
    "angle": 1 / 14,
}
SOLID = ("column", "beam", "shell")


def mesh_of(part: str, folder: Path, given: bool) -> dict[str, Any]:
    """The shape of a body: geometry, or the same as a mesh."""
    file = folder / f"{part}.geo"
    file.write_text(f'SetFactory("OpenCASCADE"); {PARTS[part]}\n')
    if not given:
        return {"file": str(file), "size": SIZES[part]}
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.merge(str(file))
    for key, value in (("MeshSizeMax", SIZES[part]), ("MeshSizeFromCurvature", 12), ("OptimizeNetgen", 1)):
        gmsh.option.setNumber(f"Mesh.{key}", value)
    gmsh.model.mesh.generate(3 if part in SOLID else 2)
    gmsh.write(str(file.with_suffix(".msh")))
    gmsh.finalize()
    return {"file": str(file.with_suffix(".msh"))}


def moving(name: str, part: str, file: str, truth: dict[str, str], **rest: Any) -> Iterator[tuple[str, Any]]:
    """A motion with a reference, of a scene below runs."""
    yield part, Scene(name, file, truth=truth, tables=read_tables(ROOT / "runs" / file, "scene") | rest, ratios=RATIOS)


def grown(value: float, power: int, times: Any) -> Any:
    """A value that grows with a power of the load."""
    return value * times**power


def at_rest(
    name: str, part: str, values: dict[str, float] | tuple[str, ...], probes: list[dict[str, Any]], **rest: Any
) -> Iterator[tuple[str, Any]]:
    """An equilibrium in small strain: columns at the whole load, or those that a mesh of finer elements knows."""
    tables = {"dimension": 3 if part in SOLID else 2, "end_time": 1.0, "probes": probes} | rest
    tables |= {"method": {"kind": "tlsph", "integrator": "static"}, "bodies": [{"material": SOFT}]}
    tables["output"] = {"history_interval": 0.25}
    if isinstance(values, tuple):
        yield part, Scene(name, "", tables=tables, truth=dict.fromkeys(values, ""), finer=0.4, ratios=RATIOS)
    else:
        formulas = {c: partial(grown, value, 2 if c == "strain_energy" else 1) for c, value in values.items()}
        yield part, Scene(name, "", tables=tables, formulas=formulas, ratios=RATIOS)


RATIOS = (1.0, 1.4, 2.0)
WATCHED = {"name": "recovery", "quantity": "element_variation"}


def parts() -> Iterator[tuple[str, Any]]:
    """Names of parts, and what is done with them."""
    yield from moving("punch", "square", "tlsph/punch.toml", CORNER)
    yield from moving("tensile", "square", "tlsph/tensile_smooth.toml", CORNER)
    yield from moving("torsion", "column", "tlsph/torsion.toml", TWIST)
    yield from moving("bending", "beam", "tlsph/bending.toml", BENT)
    place = [cos(0.6), sin(0.6)]
    edge = {"name": "bore", "formula": f"{R} < 1.001"}
    bore = {"kind": "pressure", "where": "bore", "pressure": f"{LOAD}*t"}
    u = LOAD * (1 + NU) * ((1 - 2 * NU) + 4.0) / 3.0
    watched = [
        {"name": "side", "at": place, "fields": ["displacement"]},
        {"name": "end", "at": [1.0, 0.0], "fields": ["displacement", "nodal_stress"]},
        {"name": "outer", "at": [0.0, 2.0], "fields": ["displacement"]},
    ]
    known = {
        "side.displacement_x": u * place[0],
        "side.displacement_y": u * place[1],
        "end.displacement_x": u,
        "end.nodal_stress_yy": LOAD * 5 / 3,
        "outer.displacement_y": LOAD * 4 * (1 - NU**2) / 3,
        "strain_energy": LOAD * u * pi / 4,
    }
    two = {"boundaries": [*SYMMETRY[:2], bore], "regions": [edge]}
    yield from at_rest("pressurised cylinder", "quarter", known, watched, **two)
    edge3 = {"name": "bore", "formula": "sqrt(X**2 + Y**2 + Z**2) < 1.001"}
    u3 = LOAD / 7 * ((1 - 2 * NU) + (1 + NU) * 4)
    far = {"name": "far", "at": [0, 0, 2.0], "fields": ["displacement"]}
    end = {"name": "end", "at": [1.0, 0, 0], "fields": ["displacement"]}
    known = {
        "end.displacement_x": u3,
        "far.displacement_z": LOAD / 7 * 2 * ((1 - 2 * NU) + (1 + NU) / 2),
        "strain_energy": LOAD * u3 * pi / 4,
    }
    yield from at_rest("pressurised sphere", "shell", known, [far, end], boundaries=[*SYMMETRY, bore], regions=[edge3])
    ends = [edge, {"name": "rim", "formula": f"{R} > 1.999"}]
    turned = {"kind": "rotation", "where": "bore", "centre": [0, 0], "angle": f"{LOAD}*t", "reaction": True}
    held = {"kind": "fixed", "where": "rim", "name": "rim"}
    torque = 4 * pi / (2 + 2 * NU) * LOAD / (1 - 1 / 4)
    ring = [{"name": "middle", "at": [1.5, 0.0], "fields": ["displacement"]}]
    swung = LOAD * (1.5 / 3) * (4 / 1.5**2 - 1)
    yield from at_rest(
        "turned bushing",
        "ring",
        {"turned.moment": torque, "middle.displacement_y": swung, "strain_energy": 0.5 * torque * LOAD},
        ring,
        boundaries=[turned | {"name": "turned"}, held],
        regions=ends,
    )
    c2, s2, a2 = f"((X**2 - Y**2)/{R}**2)", f"(2*X*Y/{R}**2)", f"(1/{R}**2)"
    radial = f"({LOAD / 2}*(1 - {a2}) + {LOAD / 2}*(1 - 4*{a2} + 3*{a2}**2)*{c2})"
    shear = f"(-{LOAD / 2}*(1 + 2*{a2} - 3*{a2}**2)*{s2})"
    pull = [f"t*({radial}*X - {shear}*Y)/{R}", f"t*({radial}*Y + {shear}*X)/{R}"]
    top = [
        {"name": "top", "at": [0.0, 1.0], "fields": ["nodal_stress", "displacement"]},
        {"name": "side", "at": [1.0, 0.0], "fields": ["nodal_stress", "displacement"]},
    ]
    known = {
        "top.nodal_stress_xx": 3 * LOAD,
        "side.nodal_stress_yy": -LOAD,
        "side.displacement_x": 3 * LOAD * (1 - NU**2),
        "top.displacement_y": -LOAD * (1 - NU**2),
    }
    outside = {"kind": "traction", "where": "outside", "traction": pull}
    yield from at_rest(
        "plate with hole",
        "plate",
        known,
        top,
        boundaries=[*SYMMETRY[:2], outside],
        regions=[{"name": "outside", "formula": f"{R} > 3.999"}],
    )
    for name, part, place, held, load in (
        ("Cook's membrane", "cook", [48, 60], "X = 0", LOAD),
        ("angle", "angle", [4, 0.5], "Y = 4", -LOAD),
    ):
        tip = [{"name": "tip", "at": place, "fields": ["displacement"]}]
        pulled = {"kind": "traction", "plane": f"X = {place[0]}", "traction": ["0", f"{load}*t"]}
        sides = [{"kind": "fixed", "plane": held}, pulled]
        yield from at_rest(name, part, ("tip.displacement_y", "strain_energy"), tip, boundaries=sides)


def main() -> None:
    """Run what is missing, or print tables of what has been run."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", default="")
    parser.add_argument("--report", action="store_true")
    parser.add_argument("-o", default="results/coverage_of_meshes")
    options = parser.parse_args()
    folder = Path(options.o)
    folder.mkdir(parents=True, exist_ok=True)
    if options.report:
        report(folder)
        print("\nBy recovery, of the finest run alone:")
        report(folder, True)
        return
    for part, one in parts():
        for given in (False, True):
            name = f"{one.name}, {'mesh' if given else 'geometry'}"
            kept = folder / f"{name.replace(' ', '_')}.pickle"
            if options.only not in name or kept.exists():
                continue
            body = {
                key: value for key, value in one.tables["bodies"][0].items() if key not in ("particles", "placement")
            }
            if given and one.formulas:
                # those of a mesh converge to what its own facets enclose
                known = [column for column in one.formulas if not column.startswith("side.displacement")]
                one = one._replace(formulas={}, truth=dict.fromkeys(known, ""), finer=0.4)
            tables = one.tables | {"bodies": [body | {"shape": mesh_of(part, folder.resolve(), given)}]}
            tables["probes"] = [*tables["probes"], WATCHED]
            if tables["method"].get("integrator") != "static":
                tables["method"] = {"kind": "tlsph"}
            kept.write_bytes(pickle.dumps(run(one._replace(name=name, tables=tables), folder)))


if __name__ == "__main__":
    main()
