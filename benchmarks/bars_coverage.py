"""How often the true error lies within the error bar: docs/error-bars.md, by `python benchmarks/bars_coverage.py`.

Every scene below is run at several resolutions with its coarse runs, into results/coverage, where runs are kept by
digest; every column of the history whose true values are known is a case at several times. `--report` makes the tables
of what has been run.
"""

import argparse
import pickle
import sys
import time as clock
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from parsolid.campaign.coarsening import NotCoarsened, coarsen, parsed
from parsolid.campaign.error_bars import error_table, on_times
from parsolid.campaign.in_process import InProcess
from parsolid.campaign.orders import kind_of
from parsolid.campaign.recovery import COLUMN
from parsolid.campaign.reference import exact_values, series_of
from parsolid.campaign.variants import SPACING, Variant, coarse_variants, history_only
from parsolid.scene.loading import apply_override, parse_scene, read_tables

ROOT = Path(__file__).parents[1]
RATIOS = (1.0, 1.4, 2.0, 2.8)
# of the end time, at which bars are compared with true errors
SHARES = (0.15, 0.3, 0.5, 0.75, 1.0)


class Scene(NamedTuple):
    """A scene of the coverage: its file below runs, overrides, further probes, and columns with their true values.

    truth: column -> series of the reference, or a number; of exact solutions probes are compared with the solution.
    formulas: column -> its true values at times [s]. finer: where nothing else is known, the spacing over the scene's
    of a run of the same scene that columns (`truth`, names alone) are compared with. tables: in place of the file's.
    """

    name: str
    file: str
    overrides: tuple[str, ...] = ()
    probes: tuple[dict[str, Any], ...] = ()
    truth: dict[str, Any] = {}
    ratios: tuple[float, ...] = RATIOS
    formulas: dict[str, Callable[[np.ndarray], np.ndarray]] = {}
    finer: float | None = None
    tables: dict[str, Any] | None = None


def at(name: str, place: list[float], *fields: str) -> dict[str, Any]:
    return {"name": name, "at": place, "fields": list(fields)}


def mode(name: str, weight: str, *fields: str) -> dict[str, Any]:
    return {"name": name, "weight": weight, "fields": list(fields)}


def bars_that_meet(
    energy: float, meets: float, crossed: float, left: str, speed: float
) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """Two equal elastic bars that meet at a time [s] with opposite speeds, sides guided; crossed: L/c [s]; energy [J]:
    of both. left: column of the velocity at the middle of the left one.
    """
    share = lambda t: np.clip(np.abs(t - meets - crossed) / crossed, 0.0, 1.0)  # noqa: E731
    return {
        "kinetic": lambda t: energy * share(t),
        "strain_energy": lambda t: energy * (1.0 - share(t)),
        left: lambda t: speed * ((t < meets + 0.5 * crossed) * 1.0 - (t > meets + 1.5 * crossed)),
    }


def slides(acceleration: float, grows: float, evenly: bool) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """A block that slides from rest, whose load grows evenly, or as half a cosine does, over a time [s]."""

    def speed(times: np.ndarray) -> np.ndarray:
        early = np.minimum(times, grows)
        swing = (
            early**2 / (2.0 * grows) if evenly else early / 2.0 - np.sin(np.pi * early / grows) * grows / (2 * np.pi)
        )
        return acceleration * (swing + times - early)

    return {"block.velocity_x": speed}


def plates_that_meet() -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """runs/ulsph/linear_impact.toml until its fronts are at the free ends."""
    from parsolid.exact.micro_inertia import ElasticImpact
    from parsolid.scene import load_scene

    exact = ElasticImpact.of_scene(load_scene(ROOT / "runs" / "ulsph" / "linear_impact.toml"))
    law = load_scene(ROOT / "runs" / "ulsph" / "linear_impact.toml").bodies[0].material.micro_inertia_law()
    energy = 0.5 * law.density * exact.speed**2 * 2.0 * 25.4e-3 * 2.5e-3
    return {
        "kinetic": lambda t: energy * (1.0 - exact.wave_speed * t / 25.4e-3),
        "strain_energy": lambda t: energy * exact.wave_speed * t / 25.4e-3,
        "inner.stress_xx": lambda t: np.where(exact.wave_speed * t > 5.4e-3, exact.stress, 0.0),
    }


STORED = {"kinetic": "K", "strain_energy": "W"}
ENERGIES = STORED | {"material_dissipation": "Dint"}
CORNER = ENERGIES | {"corner.displacement_y": "uy_11", "corner.velocity_y": "vy_11"}
ELASTIC = {name: series for name, series in CORNER.items() if series != "Dint"}
TIP = ENERGIES | {"tip.twist": "twist_C"}
TWIST = STORED | {"tip.twist": "twist"}
BENT = STORED | {"tip.displacement_x": "ux"}
PLATE = ("velocity", "displacement", "first_piola_kirchhoff_stress")
SERIES = "reference.series=reference/"
CELLS = ("bodies.0.particles=[24, 12]", "bodies.0.placement=cells")
METAL = (
    "bodies.0.material={kind='elastic-plastic', density=1000, youngs_modulus=1e7, poissons_ratio=0.1, "
    "specific_heat=400, taylor_quinney=0.9, flow_stress={kind='linear-hardening', yield_stress=1e9, hardening=1e6}}"
)
NO_BRANCHES = "bodies.0.material.branches=[]"
# a slab of 20 mm by 2.5 mm
NARROW = (
    "bodies.0.particles=[192, 24]",
    "method.cell=2.0833333333333333e-4",
    "bodies.0.shape.box.upper=[0.02, 0.0025]",
)
WAVE = (
    at("inner", [0.25, 0.5], "velocity", "displacement", "stress"),
    mode("mode", "sin(pi*X)", "velocity", "displacement"),
)
SCENES = [
    Scene("punch, beta 3", "tlsph/punch.toml", ("bodies.0.particles=[49, 49]",), truth=CORNER),
    Scene(
        "punch, beta 0",
        "tlsph/punch.toml",
        ("bodies.0.particles=[41, 41]", NO_BRANCHES, f"{SERIES}punch_b0.json"),
        truth=ELASTIC,
    ),
    Scene("tensile, beta 3", "tlsph/tensile.toml", ("bodies.0.particles=[41, 41]",), truth=CORNER),
    Scene(
        "tensile, beta 0",
        "tlsph/tensile.toml",
        ("bodies.0.particles=[57, 57]", NO_BRANCHES, f"{SERIES}tensile_b0.json", "end_time=0.0016"),
        truth=ELASTIC,
    ),
    Scene("tensile smooth, beta 3", "tlsph/tensile_smooth.toml", ("bodies.0.particles=[41, 41]",), truth=CORNER),
    Scene(
        "tensile smooth, beta 0",
        "tlsph/tensile_smooth.toml",
        ("bodies.0.particles=[57, 57]", NO_BRANCHES, f"{SERIES}tensile_smooth_b0.json", "end_time=0.0016"),
        truth=ELASTIC,
    ),
    Scene(
        "punch, leapfrog",
        "tlsph/punch.toml",
        ("bodies.0.particles=[41, 41]", "method.integrator=leapfrog"),
        truth=CORNER,
    ),
    Scene(
        "punch, best weights",
        "tlsph/punch.toml",
        ("bodies.0.particles=[41, 41]", "method.weights=best", "method.integrator=leapfrog"),
        truth=CORNER,
    ),
    Scene(
        "manufactured plate",
        "tlsph/manufactured_plate.toml",
        ("bodies.0.particles=[41, 41]", "end_time=0.02"),
        (
            at("edge", [1.0, 0.5], *PLATE),
            at("inner", [0.3, 0.7], *PLATE),
            mode("mode", "sin(pi*X/2)*cos(pi*Y/2)", "velocity", "displacement"),
        ),
    ),
    Scene("column, beta 1", "tlsph/column.toml", ("bodies.0.particles=[9, 49, 9]",), truth=TIP, ratios=(1.0, 1.33)),
    Scene(
        "column, beta 0",
        "tlsph/column.toml",
        ("bodies.0.particles=[9, 49, 9]", NO_BRANCHES, f"{SERIES}../reference/column_b0.json"),
        truth={k: v for k, v in TIP.items() if v != "Dint"},
        ratios=(1.33,),
    ),
    Scene("torsion", "tlsph/torsion.toml", ("bodies.0.particles=[9, 49, 9]",), truth=TWIST, ratios=(1.0, 1.33)),
    Scene("bending", "tlsph/bending.toml", ("bodies.0.particles=[9, 25, 9]",), truth=BENT, ratios=(1.0, 1.33)),
    Scene(
        "vibrating bar",
        "peridynamics/vibrating_bar.toml",
        ("bodies.0.particles=[400]",),
        (at("third", [0.3], "displacement"),),
    ),
    Scene(
        "vibrating bar, m = 2",
        "peridynamics/vibrating_bar.toml",
        ("bodies.0.particles=[300]", "method.horizon_ratio=2"),
    ),
    Scene(
        "creep bar",
        "peridynamics/creep_bar.toml",
        ("bodies.0.particles=[160]", "end_time=10.0"),
        (mode("mean", "X", "displacement"),),
    ),
    Scene(
        "creep plate",
        "peridynamics/plate.toml",
        ("bodies.0.particles=[24, 24]", "end_time=5.0"),
        (mode("mean", "X", "displacement"),),
    ),
    Scene(
        "plate with a hole",
        "peridynamics/plate_with_hole.toml",
        ("bodies.0.particles=[40, 40]",),
        truth={"mean.displacement_x": "mean_x", "mean.displacement_y": "mean_y"},
        ratios=(1.0, 1.33, 2.0),
    ),
    Scene(
        "cosine mode, grid",
        "mpm/cosine_mode.toml",
        (*NARROW, "boundaries.3.plane=Y = 0.0025"),
        (
            mode("mode", "cos(pi*X/0.02)", "temperature"),
            at("end", [0.0, 0.0], "temperature"),
            at("third", [0.013, 0.0], "temperature"),
        ),
        ratios=(1.0, 1.5, 2.0),
    ),
    Scene(
        "heated slab",
        "mpm/heated_slab.toml",
        (*NARROW, "boundaries.4.plane=Y = 0.0025"),
        (
            at("quarter", [0.005, 0.0], "temperature"),
            at("end", [0.02, 0.0], "temperature"),
            at("tenth", [0.002, 0.0], "temperature"),
        ),
        ratios=(1.0, 1.5, 2.0),
    ),
    Scene(
        "axis-aligned",
        "mpm/axis_aligned.toml",
        ("bodies.0.particles=[48, 48]", "method.cell=0.041666666666666667"),
        WAVE,
        ratios=(1.0, 1.5, 2.0),
    ),
    Scene(
        "axis-aligned, linear basis",
        "mpm/axis_aligned.toml",
        ("bodies.0.particles=[48, 48]", "method.cell=0.041666666666666667", "method.basis=linear"),
        WAVE,
        ratios=(1.0, 1.5),
    ),
    Scene(
        "vortex",
        "mpm/vortex.toml",
        ("bodies.0.particles=[252, 20]", "method.cell=0.05"),
        (at("middle", [1.0, 0.0], "displacement", "velocity"), mode("mode", "Y", "velocity", "displacement")),
        ratios=(1.0, 1.4),
    ),
    Scene(
        "plastic layer",
        "mpm/plastic_layer.toml",
        ("bodies.0.particles=[16, 40]", "method.cell=5e-5"),
        (at("quarter", [2e-4, 2.5e-4], "temperature"),),
        ratios=(1.0, 1.25, 2.0),
    ),
    Scene(
        "heat wave",
        "ulsph/cosine_mode.toml",
        ("bodies.0.particles=[60, 18]",),
        (at("start", [0.0, 0.0], "temperature"), at("third", [3.3e-3, 1e-3], "temperature")),
        ratios=(1.0, 1.4, 2.0),
    ),
    Scene(
        "pulse of heat",
        "ulsph/heat_pulse.toml",
        ("bodies.0.particles=[120, 12]",),
        (at("there", [4e-3, 5e-4], "temperature"), mode("mode", "cos(2*pi*X/10e-3)", "temperature")),
        ratios=(1.0, 1.4),
    ),
    Scene(
        "micro layer",
        "ulsph/micro_layer.toml",
        (),
        (at("quarter", [0.125e-3, 0.25e-3], "plastic_strain", "micro_stress"),),
        ratios=(1.0, 1.4),
    ),
    Scene(
        "micro wave",
        "ulsph/micro_wave.toml",
        (),
        (at("middle", [0.1e-3, 0.5e-3], "plastic_strain", "micro_rate"),),
        ratios=(1.0, 1.4),
    ),
    Scene(
        "free micro wave",
        "ulsph/free_micro_wave.toml",
        ("bodies.0.particles=[10, 40]",),
        (at("quarter", [0.1e-3, 0.25e-3], "plastic_strain", "micro_rate"),),
        ratios=(1.0, 1.4),
    ),
    Scene(
        "two bars, contact",
        "contact/bars.toml",
        (
            "bodies.0.shape.box.lower=[-1.0002, 0]",
            "bodies.0.shape.box.upper=[-0.0002, 0.24]",
            "bodies.0.velocity=[0.0005, 0]",
            "bodies.1.velocity=[-0.0005, 0]",
            "bodies.0.spacing=0.02",
            "bodies.1.spacing=0.02",
        ),
        (at("left", [-0.5002, 0.12], "velocity"),),
        ratios=(1.0, 1.4),
        formulas=bars_that_meet(6e-8, 0.2, 1.0, "left.velocity_x", 0.0005),
    ),
    Scene(
        "two bars, SPH and material points",
        "mixed/bars.toml",
        (
            "bodies.0.shape.box.lower=[-1.001, 0]",
            "bodies.0.shape.box.upper=[-0.001, 0.2]",
            "bodies.0.velocity=[0.1301, 0]",
            "bodies.1.velocity=[-0.1301, 0]",
            "probes.0.at=[-0.501, 0.1]",
        ),
        ratios=(1.0, 1.4),
        formulas=bars_that_meet(200.0 * 0.1301**2, 0.001 / 0.2602, 1.0 / 151.281, "left.velocity_x", 0.1301),
    ),
    Scene(
        "block on an incline, contact",
        "contact/incline.toml",
        ("bodies.0.particles=[49, 9]", "bodies.1.particles=[21, 11]"),
        ratios=(1.0,),
        formulas=slides(8.94427e-5 - 0.3 * 1.788854e-4, 40.0, True),
    ),
    *(
        Scene(
            f"block on an incline, tool, {kind}",
            "tools/incline.toml",
            (f"method={{kind='{kind}', balance_limit=100, {more}}}", *body),
            ratios=(1.0,),
            formulas=slides(4.472135955 - 0.3 * 8.94427191, 0.2, False),
        )
        for kind, more, body in (
            ("tlsph", "integrator='leapfrog'", ("bodies.0.particles=[25, 13]",)),
            ("mpm", "cell=0.083333333333333333, geometry='plane-strain'", (*CELLS, METAL)),
            ("ulsph", "viscosity={linear=1, quadratic=1}", (*CELLS, METAL)),
            (
                "peridynamics",
                "horizon_ratio=3, solution={kind='explicit'}",
                (*CELLS, "bodies.0.material.kind=linear-elastic"),
            ),
        )
    ),
    Scene(
        "linear impact, contact",
        "ulsph/linear_impact.toml",
        ("output.history_interval=1.5e-8",),
        (at("inner", [20e-3, 1.25e-3], "stress"),),
        ratios=(1.0, 1.4),
        formulas=plates_that_meet(),
    ),
    Scene(
        "pressed cylinder, tool",
        "tools/hertz.toml",
        ("bodies.0.particles=[33, 33]",),
        truth=dict.fromkeys(("kinetic", "strain_energy", "external_work", "cylinder.force_y"), ""),
        ratios=(1.0,),
        finer=0.4,
    ),
    Scene(
        "Taylor bar, wall",
        "mpm/taylor.toml",
        ("bodies.0.spacing=4e-4", "method.cell=8e-4"),
        truth=dict.fromkeys(("kinetic", "internal_energy", "rod.upper_bounds_x", "rod.upper_bounds_y"), ""),
        ratios=(1.0,),
        finer=0.4,
    ),
    Scene(
        "oblique discs, contact",
        "contact/discs.toml",
        ("bodies.0.particles=[40, 40]", "bodies.1.particles=[40, 40]"),
        truth=dict.fromkeys(("kinetic", "strain_energy"), ""),
        ratios=(1.0, 1.4),
        finer=0.4,
    ),
]


def tables_of(one: Scene) -> dict[str, Any]:
    tables = read_tables(ROOT / "runs" / one.file, "scene") if one.tables is None else one.tables
    for override in one.overrides:
        fault = apply_override(tables, override)
        assert fault is None, fault
    tables.setdefault("probes", []).extend(one.probes)
    tables.setdefault("output", {})["directory"] = "unused"
    tables["output"]["pictures"] = False
    return tables


def truth_of(one: Scene, scene: Any, columns: list[str], folder: Path) -> dict[str, Any]:
    """Column -> function of times that gives its true values."""
    if one.formulas:
        return dict(one.formulas)
    if one.finer is not None:
        tables = history_only(scene, coarsen(scene, one.finer, 0.0).tables, 1.0)
        done = InProcess(MPI.COMM_WORLD, folder).run(Variant(parsed(tables, False, 1.0), SPACING, 1.0))
        print(f"{one.name}: {done.record.particles} particles for reference, {done.seconds:.2f} s", flush=True)
        return {c: partial(on_times, done.history, c) for c in one.truth if c in done.history}
    if scene.reference.series is not None:
        reference = scene.reference.model_copy(update={"columns": dict(one.truth)})
        return dict(series_of(scene.model_copy(update={"reference": reference})))
    found = {column: exact_values(scene, column) for column in columns}
    return {column: values for column, values in found.items() if values is not None}


def run(one: Scene, folder: Path) -> list[dict[str, Any]]:
    """Main runs of a scene with their coarse runs."""
    comm = MPI.COMM_WORLD
    found = []
    top = parse_scene(tables_of(one), (ROOT / "runs" / one.file).parent)
    for ratio in one.ratios:
        try:
            scene = top if ratio == 1.0 else parsed(coarsen(top, ratio).tables, False, ratio)
        except NotCoarsened as reason:
            print(f"{one.name} at {ratio}: {reason}", flush=True)
            continue
        plans, refused = coarse_variants(scene, False)
        output = {"fields_times": [], "pictures": False}
        output |= {k: v for k, v in scene.resolved()["output"].items() if k.startswith("history")}
        main = Variant(parsed(scene.resolved() | {"output": output}, False, ratio), SPACING, 1.0)
        if any(main.digest == earlier["runs"][-1].variant.digest for earlier in found):
            # a ratio that rounds to the lattice of another one
            continue
        began, runs = clock.process_time(), []
        runs += [InProcess(comm, folder).run(plan) for plan in [*plans, main]]
        told = [f"{r.variant.purpose} {r.ratio:.2f} {r.seconds:.2f} s {r.record.message or ''}" for r in runs]
        print(f"{one.name:<28} ratio {ratio:<5} {told} {refused} {clock.process_time() - began:.1f} s", flush=True)
        history = runs[-1].history
        truth = truth_of(one, scene, list(history), folder) if history else {}
        rows = [int(np.argmin(np.abs(history["time"] - share * scene.end_time))) for share in SHARES] if history else []
        true = {column: value(history["time"][rows]) for column, value in truth.items() if column in history}
        found.append(
            {
                "scene": one.name,
                "ratio": ratio,
                "runs": runs,
                "true": true,
                "rows": rows,
                "refused": refused,
                "tables": scene.resolved(),
            }
        )
    return found


class Case(NamedTuple):
    """A column at a time: true error and bar over the largest value of the column."""

    scene: str
    method: str
    kind: str
    ratio: float
    column: str
    share: float
    error: float
    bar: float
    verdict: str


def method_of(scene: Any) -> str:
    """The methods of a scene, and whether bodies or tools touch."""
    kinds = "+".join(dict.fromkeys(system.settings.kind for system in scene.systems))
    return f"{kinds}, contact" if scene.contact or len(scene.bodies) > 1 else f"{kinds}, tool" if scene.tools else kinds


def cases_of(folder: Path, alone: bool = False) -> tuple[list[Case], int]:
    """All cases of what has been run, and how many have no bar because resolutions differ by as much as a column;
    alone: with the bars of recovery, of runs without coarser ones."""
    cases, without = [], 0
    for file in sorted(folder.glob("*.pickle")):
        for found in pickle.loads(file.read_bytes()):
            *others, own = found["runs"]
            if not own.history:
                continue
            scene = parse_scene(found["tables"])
            if alone and scene.method.integrator != "static":
                continue
            known = ("step", "time", *found["true"], *((COLUMN, "strain_energy") if alone else ()))
            table = error_table(scene, {name: own.history[name] for name in known}, [] if alone else others)
            time = own.history["time"]
            rows = [int(np.argmin(np.abs(time - share * scene.end_time))) for share in SHARES]
            for column, true in found["true"].items():
                values = own.history[column]
                largest = float(np.abs(values).max())
                family = [np.abs(v).max() for n, v in own.history.items() if n[:-1] == column[:-1]]
                if column not in table.bars or largest <= 1e-9 * max(family) or np.abs(true).max() <= 1e-9 * largest:
                    continue
                for share, row, wanted in zip(SHARES, rows, true if len(true) == len(SHARES) else true[rows]):
                    if scene.method.kind == "tlsph" and scene.method.integrator == "static" and share < 1.0:
                        # the same case
                        continue
                    error, bar = abs(values[row] - wanted) / largest, table.bars[column].error[row] / largest
                    without += not np.isfinite(bar)
                    # below this it is the reference's error, or there is none
                    if error >= 1e-7 and np.isfinite(bar):
                        kind, verdict = kind_of(column, scene), table.bars[column].verdict
                        method = method_of(scene)
                        one = Case(found["scene"], method, kind, found["ratio"], column, share, error, bar, verdict)
                        cases.append(one)
    return cases, without


def print_rows(title: str, cases: list[Case], key: Any) -> None:
    """A table in Markdown, one row a value of the key."""
    print(f"\n| {title} | cases | inside | median bar/error | median error | median bar |")
    print("|---|---:|---:|---:|---:|---:|")
    for name in [*sorted({key(one) for one in cases}), None]:
        rows = [one for one in cases if name is None or key(one) == name]
        inside = np.mean([one.error <= one.bar for one in rows])
        ratio = np.median([one.bar / one.error for one in rows])
        sizes = [np.median([one.error for one in rows]), np.median([one.bar for one in rows])]
        told = f"{100 * inside:.1f} % | {ratio:.1f} | {100 * sizes[0]:.2g} % | {100 * sizes[1]:.2g} %"
        print(f"| {name or 'all'} | {len(rows)} | {told} |")


def report(folder: Path, alone: bool = False) -> None:
    """Tables by method and kind and by scene, and every miss; alone: see `cases_of`."""
    cases, without = cases_of(folder, alone)
    seen = [one for one in cases if one.method == "tlsph" or one.scene.startswith("vibrating bar")]
    print_rows("part", cases, lambda one: "constants chosen on" if one in seen else "judged on")
    print_rows("method, kind", cases, lambda one: f"{one.method}, {one.kind}")
    print_rows("scene", cases, lambda one: one.scene)
    print(f"\n{without} further values have no bar, for resolutions differ by as much as the column varies.\n")
    for one in cases:
        if one.error > one.bar:
            where = f"{one.scene}, spacing x {one.ratio:g}, {one.column} at {one.share:g} of the time"
            print(f"- {where}: error {100 * one.error:.2g} %, bar {100 * one.bar:.2g} % ({one.verdict})")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", default="", help="scenes with this in their name")
    parser.add_argument("--report", action="store_true", help="tables of what has been run")
    parser.add_argument("-o", default="results/coverage")
    options = parser.parse_args()
    folder = Path(options.o)
    if options.report:
        report(folder)
        return
    folder.mkdir(parents=True, exist_ok=True)
    for one in SCENES:
        kept = folder / f"{one.name.replace(' ', '_')}.pickle"
        if options.only in one.name and not kept.exists():
            try:
                kept.write_bytes(pickle.dumps(run(one, folder)))
            except Exception as error:  # the others are of use without it
                print(f"{one.name}: {type(error).__name__}: {str(error)[:300]}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
