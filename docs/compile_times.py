"""Seconds of the processor that a run's first steps take with no kernel in the cache, compiled by numba as it is and
the short way (`decomposition/compilation.py`): `python docs/compile_times.py [SCENE ...]`.

Both run at the same time, so that they share what else the machine does; the last column is their ratio.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCENES = ("runs/tlsph/column.toml", "runs/peridynamics/plate_with_hole.toml", "runs/mpm/taylor_ofhc.toml")


def started(scene: str, folder: Path, plain: bool) -> subprocess.Popen:
    """A run of four steps with a cache of its own."""
    folder.mkdir()
    values = os.environ | {"NUMBA_CACHE_DIR": str(folder), "PARSOLID_PLAIN_COMPILER": "1" if plain else ""}
    words = ["run", scene, "-q", "--max-steps", "4", "-o", str(folder / "run"), "--set", "output.pictures=false"]
    return subprocess.Popen([sys.executable, "-m", "parsolid", *words], cwd=ROOT, env=values)


def seconds(run: subprocess.Popen) -> float:
    """User and system time of a run, when it has ended."""
    _, status, used = os.wait4(run.pid, 0)
    if status:
        raise SystemExit(f"expected status 0, found {os.waitstatus_to_exitcode(status)}: {run.args}")
    return _total(used)


def _total(used: resource.struct_rusage) -> float:
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Print the table."""
    print("| scene | kernels | numba | short | ratio |\n|---|---|---|---|---|")
    for scene in sys.argv[1:] or SCENES:
        with tempfile.TemporaryDirectory() as place:
            runs = [started(scene, Path(place, name), name == "numba") for name in ("numba", "short")]
            numba, short = map(seconds, runs)
            kernels = len(list(Path(place, "short").glob("*.kernel")))
        print(f"| {scene} | {kernels} | {numba:.1f} | {short:.1f} | {short / numba:.2f} |", flush=True)


if __name__ == "__main__":
    main()
