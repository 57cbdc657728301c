"""python -m checks.histories --ranks 1 2 3: every scene of `runs/` with every probe has the same history on any ranks.

Each scene takes `--steps` steps with its own probes and, at the particle in the middle of its first body's, one of
every field and quantity that it accepts; its histories are compared column by column with those of the first number of
ranks. A vector or tensor is measured by its largest component, a field at a particle by what it is anywhere, and a sum
of all particles by what its terms add up to without their signs, for symmetry makes much of this vanish. Prints a line
a scene; status 1 when a difference exceeds `--tolerance`, a scene fails, or one has no history on some ranks.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]


def scenes(only: str) -> dict[str, Path]:
    """The scenes of `runs/` that a run takes, by a name for their folders."""
    found = {}
    for path in sorted(ROOT.glob("runs/**/*.toml")):
        name = "-".join(path.relative_to(ROOT / "runs").with_suffix("").parts)
        if "bodies" in tomllib.loads(path.read_text()) and only in name:
            found[name] = path
    return found


def watched(path: Path) -> Any:
    """The scene with a probe of every field and quantity that it accepts."""
    from parsolid.particles.fillings import filling_of
    from parsolid.scene import SceneError, load_scene, parse_scene
    from parsolid.scene.observed import QUANTITIES, probed_fields

    scene = load_scene(path)
    data = tomllib.loads(path.read_text())
    d, filling = scene.dimension, filling_of(scene.bodies[0], scene.dimension)
    middle = filling.piece(filling.count // 2, filling.count // 2 + 1).position[0].tolist()
    kinds = [system.settings for system in scene.systems]
    fields = dict.fromkeys([*probed_fields(), *(name for each in kinds for name in each.field_kinds(d))])
    quantities = dict.fromkeys([*QUANTITIES, *(name for each in kinds for name in each.extra_quantities)])
    more: list[dict[str, Any]] = []
    for name in fields:
        axis = {"axis": "Z"} if name == "twist" and d == 3 else {}
        more.append({"name": f"all_{name}", "at": middle, "fields": [name]} | axis)
    more += [{"name": f"sum_{name}", "quantity": name} for name in quantities]
    own = data.get("probes", [])
    data["output"] = {"history_steps": 1, "pictures": False}
    if "manufactured" not in data.get("loads", {}):
        # a manufactured load is that of its solution
        data.pop("reference", None)
    while True:
        data["probes"] = own + more
        try:
            return parse_scene(data, path.parent)
        except SceneError as error:
            wrong = {int(number) - len(own) for number in re.findall(r"probes\.(\d+)", str(error))}
            if not wrong or min(wrong) < 0:
                raise
            more = [probe for number, probe in enumerate(more) if number not in wrong]


def run_all(folder: Path, steps: int, only: str) -> None:
    """On all ranks of this job: so many steps of every scene, each history in a file of its own."""
    from mpi4py import MPI

    sys.path.insert(0, str(ROOT / "tests"))
    from solids import run_into

    comm = MPI.COMM_WORLD
    for name, path in scenes(only).items():
        output = folder / f"{name}-{comm.size}"
        try:
            recorder = run_into(output, comm, watched(path), steps)
            found = sizes(recorder.simulation)
            if comm.rank == 0:
                (folder / f"{name}-{comm.size}.sizes").write_text(json.dumps(found))
        except Exception as error:
            (folder / f"{name}-{comm.size}.{comm.rank}.failed").write_text(f"{type(error).__name__}: {error}"[:500])
        comm.Barrier()


def sizes(sim: Any) -> dict[str, float]:
    """By name of a field its largest value anywhere, and the mass [kg] and extent [m] of all; collective."""
    from mpi4py import MPI

    from parsolid.observables.declared import field_of
    from parsolid.scene.observed import probed_fields

    systems, comm = sim.systems, sim.comm
    kinds = [*probed_fields(), *(name for one in systems for name in one.settings.field_kinds(sim.scene.dimension))]
    found = {}
    for name in dict.fromkeys([*kinds, "position"]):
        fields = [field_of(one, name) for one in systems if one.owned]
        largest = max([0.0, *(float(np.nanmax(np.abs(values))) for values in fields if values is not None)])
        found[name] = float(comm.allreduce(largest, MPI.MAX))
    mass = sum(float((one.mass[: one.owned] * one.share[: one.owned]).sum()) for one in systems)
    return found | {"mass": comm.allreduce(mass)}


def terms(measured: dict[str, float], kinetic: float) -> dict[str, float]:
    """The scale of every field and of what symmetry makes vanish; kinetic: the largest energy of motion [J]."""
    momentum = np.sqrt(2.0 * measured["mass"] * kinetic)
    sums = {"linear_momentum": momentum, "angular_momentum": momentum * measured["position"]}
    # a pressure is what three components add up to, and heat and entropy are made of other energies
    sums |= {name: measured["stress"] for name in ("pressure", "von_mises_stress") if "stress" in measured}
    if measured.get("temperature"):
        sums |= {"heat": kinetic, "entropy": kinetic / measured["temperature"]}
    return measured | sums | {"centre_of_mass": measured["position"]}


def largest_difference(one: Path, other: Path) -> tuple[float, str, int]:
    """The largest difference over the scale of its vector or tensor, its column, and the number of columns."""
    tables = []
    for folder in (one, other):
        lines = (folder / "history.csv").read_text().splitlines()
        names = lines[0].split(",")
        tables.append(np.array([[float(value) for value in line.split(",")] for line in lines[1:]]))
    if tables[0].shape != tables[1].shape:
        return np.inf, "rows", len(names)
    groups: dict[str, list[int]] = {}
    energies = re.compile(r"^(?!step$|time$|dt$)[a-z_]+$")
    for column, name in enumerate(names):
        group = "energies" if energies.match(name) else re.sub(r"_[xyz]{1,2}$", "", name)
        groups.setdefault(group, []).append(column)
    worst, where = 0.0, ""
    kinetic = np.abs(tables[0][:, names.index("kinetic")]).max()
    natural = terms(json.loads(one.with_name(f"{one.name}.sizes").read_text()), kinetic)
    for group, columns in groups.items():
        wanted, found = (table[:, columns] for table in tables)
        if (np.isnan(found) != np.isnan(wanted)).any():
            return np.inf, group, len(names)
        if np.isnan(wanted).all():
            # a crack that is not there has no tip
            continue
        scale = max(np.nanmax(np.abs(wanted)), natural.get(group.rpartition(".")[2], 0.0), 1e-300)
        # of forces at their distances, and the other way round: symmetry makes either vanish
        about, reach = group.rpartition(".")[0], max(natural["position"], 1e-300)
        if group.endswith(".moment"):
            scale = max(scale, reach * np.abs(tables[0][:, groups[f"{about}.force"]]).max())
        if group.endswith(".force") and f"{about}.moment" in groups:
            scale = max(scale, np.abs(tables[0][:, groups[f"{about}.moment"]]).max() / reach)
        if group == "energies" and np.abs(tables[0][:, names.index("energy_error")]).max() > 0.1 * scale:
            # pure heat: what is left of mechanical energies is round-off
            continue
        difference = float(np.nanmax(np.abs(found - wanted)) / scale)
        if difference > worst:
            worst, where = difference, group
    return worst, where, len(names)


def judge(folder: Path, names: list[str], ranks: list[int], tolerance: float) -> int:
    """Print a line a scene; how many are at fault."""
    faults = 0
    for name in names:
        failed = [path.read_text() for path in sorted(folder.glob(f"{name}-*.failed"))]
        words, worst = [], 0.0
        for number in ranks[1:] if not failed else ():
            difference, where, columns = largest_difference(folder / f"{name}-{ranks[0]}", folder / f"{name}-{number}")
            words.append(f"{number} ranks {difference:.1e} ({where or 'nothing'})")
            worst = max(worst, difference)
        fault = bool(failed) or not worst <= tolerance
        faults += fault
        told = failed[0] if failed else f"{columns} columns, " + ", ".join(words)
        print(f"{'FAULT ' if fault else ''}{name}: {told}", flush=True)
    return faults


def main() -> int:
    """Run all scenes on each number of ranks, one job a number, and compare."""
    parser = argparse.ArgumentParser(prog="python -m checks.histories", description=__doc__)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--only", default="", help="a part of the scenes' names")
    parser.add_argument("--tolerance", type=float, default=1e-9)
    parser.add_argument("--in", dest="folder", type=Path, help="run here on the ranks of this job, and compare nothing")
    options = parser.parse_args()
    if options.folder:
        run_all(options.folder, options.steps, options.only)
        return 0
    with tempfile.TemporaryDirectory() as place:
        for number in options.ranks:
            words = ["--steps", str(options.steps), "--only", options.only, "--in", place]
            command = ["mpirun", "-n", str(number), sys.executable, "-m", "checks.histories", *words]
            subprocess.run(command, check=True, cwd=ROOT, env=os.environ, timeout=7200, stdout=subprocess.DEVNULL)
        names = list(scenes(options.only))
        faults = judge(Path(place), names, options.ranks, options.tolerance)
    print(f"{len(names)} scenes, {options.steps} steps, ranks {options.ranks}: {faults} at fault")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
