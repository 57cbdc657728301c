"""python benchmarks/paired.py [CASE ...]: how fast is this checkout, against an earlier one?

Runs scenes of `benchmarks/timed/` with both checkouts in alternation and prints nanoseconds a particle and step, as the
processor time of the time loop without its first step, and the median and quartiles of the ratios new/old of all pairs.

    --old, --new   a folder with a checkout, or a commit, as in histories.py
    --pairs        of runs
    --start        instead: processor seconds and memory of a process with its kernels compiled, and a cold start
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from histories import FROZEN_AT, HERE, checkout, environment, present_words

TIMED = HERE / "timed"

# case: scene, steps, ranks; the loops take .3 to .6 s of the frozen commit
CASES = {
    "box_24": ("box_24", 400, 1),
    "box_24_cells": ("box_24_cells", 400, 1),
    "box_48": ("box_48", 41, 1),
    "kernel_085": ("kernel_085", 400, 1),
    "kernel_120": ("kernel_120", 300, 1),
    "kernel_rk3": ("kernel_rk3", 150, 1),
    "mesh": ("mesh", 6000, 1),
    "irregular": ("irregular", 1000, 1),
    "perforated": ("perforated", 700, 1),
    "pd_lattice": ("pd_lattice", 300, 1),
    "pd_list": ("pd_list", 400, 1),
    "pd_bonds": ("pd_bonds", 250, 1),
    "mpm": ("mpm", 300, 1),
    "mpm_hyperelastic": ("mpm_hyperelastic", 300, 1),
    "ulsph": ("ulsph", 100, 1),
    "ulsph_micro": ("ulsph_micro", 200, 1),
    "contact_blocks": ("contact_blocks", 100, 1),
    "contact_tool": ("contact_tool", 600, 1),
    "box_48_two_ranks": ("box_48", 41, 2),
    "irregular_two_ranks": ("irregular", 1000, 2),
}


def run(
    folder: Path, scene: str, steps: int, ranks: int, cache: Path | None = None, bytecode: Path | None = None
) -> dict:
    """The summary of one run; `cache`: an empty folder for compiled kernels instead of the user's; `bytecode`: where
    Python keeps compiled modules, which are compiled anew if there is none."""
    with tempfile.TemporaryDirectory() as results:
        command = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        stated = [str(TIMED / f"{scene}.toml"), *present_words(folder, scene)] if scene else []
        command += [sys.executable, "-m", "parsolid", "run", *stated, "-q"]
        command += ["-o", results, "--max-steps", str(steps), "--set", "output.pictures=false"]
        variables = environment(folder) | ({"XDG_CACHE_HOME": str(cache)} if cache else {})
        if bytecode is not None:
            variables = variables | {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(bytecode)}
        ended = subprocess.run(command, env=variables, cwd=results, capture_output=True, text=True, check=False)
        path = Path(results) / "summary.json"
        if not path.exists():
            raise SystemExit(f"{folder}: {scene}: {ended.stdout}{ended.stderr}")
        return json.loads(path.read_text())


def nanoseconds(summary: dict) -> float:
    """Processor time of rank 0 a particle and step, times the ranks, without the first step."""
    spent = summary["loop_processor_seconds"] - summary["first_step_processor_seconds"]
    steps = summary["steps_this_run" if "steps_this_run" in summary else "steps_of_this_call"]
    return 1e9 * spent * summary["ranks"] / summary["particles"] / (steps - 1)


def compare(old: Path, new: Path, names: list[str], pairs: int) -> None:
    """Print a line a case."""
    print(f"{'case':22s}{'old ns':>9s}{'new ns':>9s}{'ratio':>8s}{'quartiles':>14s}")
    for name in names:
        times = []
        run(old, *CASES[name]), run(new, *CASES[name])  # compiles what is missing
        for pair in range(pairs):
            both = {tree: nanoseconds(run(tree, *CASES[name])) for tree in ((old, new), (new, old))[pair % 2]}
            times.append((both[old], both[new]))
        found = np.array(times)
        low, ratio, high = np.percentile(found[:, 1] / found[:, 0], [25, 50, 75])
        before, now = np.median(found, axis=0)
        print(f"{name:22s}{before:9.1f}{now:9.1f}{ratio:8.2f}{low:8.2f}{high:6.2f}", flush=True)


def started(
    folder: Path, steps: int, cache: Path | None = None, bytecode: Path | None = None
) -> tuple[float, float, float]:
    """Processor seconds with those of child processes, wall seconds and MB of so many steps of the main example."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    summary = run(folder, "", steps, 1, cache, bytecode)
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return spent, wall, summary["peak_memory_bytes_per_rank"] / 1e6


def start_up(trees: list[Path], repeats: int) -> None:
    """Print what a process costs until its first step, with modules and kernels compiled before, and with modules
    alone."""
    print(f"{'checkout':30s}{'warm CPU s':>12s}{'MB':>8s}{'cold CPU s':>12s}{'wall s':>8s}")
    for tree in trees:
        with tempfile.TemporaryDirectory() as modules, tempfile.TemporaryDirectory() as empty:
            started(tree, 1, None, Path(modules))
            warm = np.median([started(tree, 1, None, Path(modules)) for _ in range(repeats)], axis=0)
            cold = started(tree, 1, Path(empty), Path(modules))
        told = f"{warm[0]:12.2f}{warm[2]:8.0f}{cold[0]:12.1f}{cold[1]:8.1f}"
        print(f"{os.path.relpath(tree, HERE)[-29:]:30s}{told}", flush=True)


def main() -> int:
    """Compare two checkouts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help="only cases whose names contain one of these")
    parser.add_argument("--old", default=FROZEN_AT)
    parser.add_argument("--new", default=str(HERE.parent))
    parser.add_argument("--pairs", type=int, default=15)
    parser.add_argument("--start", action="store_true")
    words = parser.parse_args()
    names = [name for name in CASES if any(part in name for part in words.cases or [""])]
    with tempfile.TemporaryDirectory() as temporary:
        trees = [checkout(each, Path(temporary)) for each in (words.old, words.new)]
        try:
            if words.start:
                start_up(trees, words.pairs)
            else:
                compare(*trees, names, words.pairs)
        finally:
            for tree in trees:
                if Path(temporary) in tree.parents:
                    subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=HERE, check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
