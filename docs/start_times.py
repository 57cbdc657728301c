"""Seconds of the processor and memory of small jobs whose kernels are in the cache, of two checkouts in turn:
`python docs/start_times.py OLD_TREE NEW_TREE [SCENE ...]`. The least of four turns; the first, not counted, compiles.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

SCENES = ("runs/tlsph/pull.toml", "runs/mpm/cosine_mode.toml")
TURNS = 4


def used(tree: Path, place: Path, scene: str) -> tuple[float, int]:
    """User and system seconds of a run of twenty steps, and its largest memory [MB]."""
    values = os.environ | {"NUMBA_CACHE_DIR": str(place), "PYTHONPATH": str(tree)}
    words = ["run", scene, "-q", "--max-steps", "20", "--set", "output.pictures=false", "-o", str(place / "run")]
    run = subprocess.Popen([sys.executable, "-m", "parsolid", *words], cwd=tree, env=values)
    _, status, found = os.wait4(run.pid, 0)
    if status:
        raise SystemExit(f"expected status 0, found {os.waitstatus_to_exitcode(status)}: {tree} {scene}")
    return found.ru_utime + found.ru_stime, found.ru_maxrss // 1024


def main() -> None:
    """Print the table."""
    trees = [Path(word).resolve() for word in sys.argv[1:3]]
    print("| scene | old, s | new, s | ratio | old, MB | new, MB |\n|---|---|---|---|---|---|")
    for scene in sys.argv[3:] or SCENES:
        with tempfile.TemporaryDirectory() as folder:
            places = [Path(folder, name) for name in ("old", "new")]
            runs: list[list[tuple[float, int]]] = [[], []]
            for _ in range(1 + TURNS):
                for tree, place, found in zip(trees, places, runs, strict=True):
                    found.append(used(tree, place, scene))
        (old, old_memory), (new, new_memory) = (min(found[1:]) for found in runs)
        print(f"| {scene} | {old:.2f} | {new:.2f} | {new / old:.2f} | {old_memory} | {new_memory} |", flush=True)


if __name__ == "__main__":
    main()
