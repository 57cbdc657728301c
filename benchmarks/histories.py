"""python benchmarks/histories.py [SCENE ...]: does this checkout still give the histories of an earlier one?

Runs the scenes of `benchmarks/frozen/` with both checkouts and compares every column of their histories; in the new
checkout each run is also stopped in the middle and restarted, which must give the same bits.

    --old, --new   a folder with a checkout, or a commit (checked out beside this one by `git worktree`);
                   by default the commit of the frozen scenes, and this checkout
    --ranks        numbers of ranks of the new checkout; the old one runs on one (--old-ranks)
    --steps        of each run
    --tolerance    of a column, over its scale
    --apart        columns that are compared apart from the others, such as those that book what others did before

The scale of a column is its largest value; components of a vector share the largest of theirs, and energies count at
least a thousandth of the largest energy. Status 1 when a scene fails or differs.
"""

import argparse
import csv
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
FROZEN = HERE / "frozen"
FROZEN_AT = "3013504"  # the commit whose histories are to be kept
TIME_LIMIT = 3600.0  # [s] of a job


# --- checkouts


def checkout(words: str, place: Path) -> Path:
    """The folder of a checkout: itself, or a work tree of a commit below `place`."""
    if (Path(words) / "parsolid").is_dir():
        return Path(words).resolve()
    folder = place / words
    subprocess.run(["git", "worktree", "add", "-q", "--detach", folder, words], cwd=HERE, check=True)
    return folder


def clean_commit(folder: Path) -> str | None:
    """The commit of a checkout without changes; None where there are some."""
    told = [
        subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=False)
        for words in (("status", "--porcelain", "-uno"), ("rev-parse", "HEAD"))
    ]
    return told[1].stdout.strip() if not any(each.returncode for each in told) and not told[0].stdout else None


def environment(folder: Path) -> dict[str, str]:
    """Variables for programs of a checkout."""
    return os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1"}


# --- runs

# scenes are in the words of versions before 0.2, which both checkouts read but for these
_BOND = 'bond=[{bodies="all"}]'
_SINCE_0_2 = {
    "tlsph_two_boxes": [_BOND],
    "ulsph_micro_inertia": [_BOND],
    "ulsph_micro": [_BOND],
    "ulsph_micro_clamped": ["boundaries.1.kind=micro-hard", "boundaries.2.kind=micro-hard"],
    "mesh": ["bodies.0.placement=vertices"],
}


def present_words(folder: Path, scene: str) -> list[str]:
    """Options of a command line that state a scene in the words of a checkout."""
    sources = (folder / "parsolid" / "scene").rglob("*.py")
    present = any('"vertices"' in path.read_text() for path in sources)
    return [word for change in _SINCE_0_2.get(scene, []) if present for word in ("--set", change)]


def run_scenes(folder: Path, ranks: int, steps: int, scenes: list[Path], restarts: bool, place: Path) -> None:
    """Run scenes with one checkout, all in one job; the results of a scene are in place/<scene>/{whole,halves}."""
    jobs = []
    for scene in scenes:
        where, stated = place / scene.stem, [str(scene), *present_words(folder, scene.stem)]
        jobs.append([["run", *stated, "-q", "-o", str(where / "whole"), "--max-steps", str(steps)]])
        if restarts:
            halves = ["-q", "-o", str(where / "halves"), "--max-steps"]
            first, second = str(steps // 2), str(steps - steps // 2)
            jobs[-1] += [["run", *stated, *halves, first], ["run", "--restart", *halves, second]]
    place.mkdir(parents=True, exist_ok=True)
    (place / "jobs.json").write_text(json.dumps(jobs))
    command = ["mpirun", "-n", str(ranks), sys.executable, str(HERE / "histories.py"), "--job", str(place)]
    ended = subprocess.run(
        command, env=environment(folder), timeout=TIME_LIMIT, capture_output=True, text=True, check=False
    )
    (place / "said.txt").write_text(ended.stdout + ended.stderr)


def run_job(place: Path) -> None:
    """On every rank: the command lines of a job, each list of them until one fails."""
    from mpi4py import MPI

    from parsolid.commands.cli import main

    for commands in json.loads((place / "jobs.json").read_text()):
        for command in commands:
            MPI.COMM_WORLD.Barrier()
            if main(command) not in (0, None):
                break


def kept_reference(folder: Path, ranks: int, steps: int, scenes: list[Path], place: Path) -> dict[str, Path]:
    """Histories of the old checkout; those of a commit are kept in the user's cache folder and run once."""
    commit = clean_commit(folder)
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "parsolid" / "histories"
    found, missing = {}, []
    for scene in scenes:
        words = hashlib.sha256(scene.read_bytes()).hexdigest()[:12]
        found[scene.stem] = (base / str(commit) / f"{scene.stem}-{words}-{ranks}-{steps}.csv").absolute()
        if commit is None or not found[scene.stem].exists():
            missing.append(scene)
    run_scenes(folder, ranks, steps, missing, False, place) if missing else None
    for scene in missing:
        history = place / scene.stem / "whole" / "history.csv"
        if commit is None or not history.exists():
            found[scene.stem] = history
            continue
        found[scene.stem].parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(history, found[scene.stem])
    return found


# --- comparison


def table(path: Path) -> dict[str, np.ndarray]:
    """Columns of a history by their present names."""
    with path.open() as file:
        rows = list(csv.reader(file))
    columns = dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))
    return present_names(columns)


# names of columns before 0.2 -> present ones; of several with one present name the sum
FORMER = {
    "dissipation_internal": "material_dissipation",
    "dissipation_numerical": "numerical_dissipation",
    "dissipation_fracture": "fracture_dissipation",
    "work_external": "external_work",
    "work_fixed_walls": "fixed_wall_work",
    "deleted_stored": "deleted_internal_energy",
    "stored": "stored_energy",
    "strain_energy": "stored_energy",
    "internal_energy": "stored_energy",
    "balance": "energy_error",
    "leapfrog_oscillation": "kinetic_offset",
    "contact_oscillation": "kinetic_offset",
}


def present_names(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns of a history of any version by one set of names, one for what is stored, with heat in it or without."""
    result: dict[str, np.ndarray] = {}
    for name, values in columns.items():
        present = FORMER.get(name, name)
        result[present] = result[present] + values if present in result else values
    return result


def scales(columns: dict[str, np.ndarray]) -> dict[str, float]:
    """What a difference in each column is measured by."""
    largest = {name: float(np.nanmax(np.abs(values), initial=0.0)) for name, values in columns.items()}
    vectors: dict[str, float] = {}
    for name, value in largest.items():
        vector = re.sub(r"_[xyz]{1,2}$", "", name)
        vectors[vector] = max(value, vectors.get(vector, 0.0))
    # columns without a point in their names are energies, but for the first three
    energies = [name for name in largest if "." not in name and name not in ("step", "time", "dt")]
    energy = max((largest[name] for name in energies), default=0.0)
    floor = dict.fromkeys(energies, 1e-3 * energy)
    return {name: max(vectors[re.sub(r"_[xyz]{1,2}$", "", name)], floor.get(name, 0.0), 1e-300) for name in largest}


def difference(one: Path, other: Path, without: Sequence[str] = (), only: Sequence[str] = ()) -> tuple[float, str]:
    """The largest difference of two histories over the scale of its column, and what to say about it.

    without: columns that do not count; only: where given, the columns that count.
    """
    if not (one.exists() and other.exists()):
        return np.inf, "no history"
    wanted, found = (
        {name: values for name, values in table(path).items() if name not in without and (not only or name in only)}
        for path in (one, other)
    )
    scale_of = scales(table(one))
    if wanted.keys() != found.keys():
        return np.inf, "columns: " + ", ".join(sorted(wanted.keys() ^ found.keys()))
    lengths = [max(map(len, columns.values()), default=0) for columns in (wanted, found)]
    if lengths[0] != lengths[1]:
        return np.inf, f"{lengths[0]} and {lengths[1]} rows"
    worst, where = 0.0, ""
    for name in wanted:
        scale = scale_of[name]
        if (np.isnan(wanted[name]) != np.isnan(found[name])).any():
            return np.inf, f"{name}: nan"
        apart = np.abs(found[name] - wanted[name]) / scale
        if np.isnan(apart).all():
            continue
        if np.nanmax(apart) > worst:
            worst, where = float(np.nanmax(apart)), f"{name}, row {int(np.nanargmax(apart))}"
    return worst, where


def compare(old: Path, new: Path, scenes: list[Path], words: argparse.Namespace, place: Path) -> int:
    """Print a line a scene; the number of faults."""
    reference = kept_reference(old, words.old_ranks, words.steps, scenes, place / "old")
    for ranks in words.ranks:
        run_scenes(new, ranks, words.steps, scenes, not words.no_restarts, place / str(ranks))
    faults = 0
    heads = [head for ranks in words.ranks for head in (f"{ranks} ranks", *["apart"][: len(words.apart)], "restart")]
    print(f"{'scene':34s}{'rows':>6s}" + "".join(f"{head:>10s}" for head in heads) + "  worst column")
    for scene in scenes:
        name = scene.stem
        told, worst = [], (0.0, "")
        for ranks in words.ranks:
            folder = place / str(ranks) / name
            against_old = difference(reference[name], folder / "whole" / "history.csv", without=words.apart)
            restarted = (0.0, "not asked for")
            if not words.no_restarts:
                restarted = difference(folder / "whole" / "history.csv", folder / "halves" / "history.csv")
                restarted = (restarted[0], f"restart on {ranks} ranks: {restarted[1]}")
            told.append(against_old[0])
            if words.apart:
                told.append(difference(reference[name], folder / "whole" / "history.csv", only=words.apart)[0])
            told.append(restarted[0])
            faults += against_old[0] > words.tolerance or restarted[0] > 0.0
            worst = max(worst, against_old, restarted)
        rows = len(table(reference[name])["step"]) if reference[name].exists() else 0
        print(f"{name:34s}{rows:6d}" + "".join(f"{value:10.1e}" for value in told) + f"  {worst[1]}", flush=True)
    print(f"{len(scenes)} scenes, {faults} faults (tolerance {words.tolerance:g}, restarts to the bit)")
    return faults


def main() -> int:
    """Compare two checkouts, or run the part of one rank."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="only scenes whose names contain one of these")
    parser.add_argument("--old", default=FROZEN_AT)
    parser.add_argument("--new", default=str(HERE.parent))
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 4])
    parser.add_argument("--old-ranks", type=int, default=1)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--tolerance", type=float, default=1e-9)
    parser.add_argument("--apart", nargs="+", default=[], metavar="COLUMN")
    parser.add_argument("--no-restarts", action="store_true")
    parser.add_argument("--keep", type=Path, help="folder for all results, else they are deleted")
    parser.add_argument("--job", type=Path, help=argparse.SUPPRESS)
    words = parser.parse_args()
    if words.job:
        run_job(words.job)
        return 0
    scenes = [path for path in sorted(FROZEN.glob("*.toml")) if any(part in path.stem for part in words.scenes or [""])]
    with tempfile.TemporaryDirectory() as temporary:
        place = words.keep or Path(temporary)
        trees = [checkout(each, Path(temporary)) for each in (words.old, words.new)]
        try:
            return int(compare(*trees, scenes, words, place) > 0)
        finally:
            for tree in trees:
                if Path(temporary) in tree.parents:
                    subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=HERE, check=True)


if __name__ == "__main__":
    sys.exit(main())
