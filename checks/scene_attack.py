"""python -m checks.scene_attack --number 10000: change scenes at random; each is read, runs two steps, or is refused.

Every scene of `runs/` and every small scene of the tests gets tables of another one, or tables and keys that it does
not have, or is changed in one to three places, or both. One of `runs/` is read and validated; a small one goes through
the whole program for two steps (one in `--every`). What ends with anything but a scene, a message, or a status of 0, 2,
3 or 75, warns of its arithmetic, lasts over three minutes, or takes its process along is a fault, and is kept in the
folder `--keep`. Status 1 when there was one.
"""

import argparse
import contextlib
import io
import json
import multiprocessing
import random
import signal
import sys
import tempfile
import time
import tomllib
import traceback
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "end_to_end"))

from mutations import grafted, mutated
from small_scenes import write

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from soak import SCENES

ROOT = Path(__file__).parents[1]
# seconds that a scene may take, kernels that it compiles included
PATIENCE = 180
# scenes that one process changes; another takes over then, so that what it leaves behind does not add up
BATCH = 200


def shipped() -> dict[str, dict]:
    """Tables of all scenes in `runs/`, by path."""
    tables = {str(path.relative_to(ROOT)): tomllib.loads(path.read_text()) for path in ROOT.glob("runs/**/*.toml")}
    return {path: scene for path, scene in tables.items() if "bodies" in scene}


def read(scene: dict, folder: Path) -> str:
    """What became of a scene that is only read: "a scene", "refused", or a traceback."""
    from parsolid.scene import SceneError, parse_scene

    try:
        parse_scene(scene, folder)
    except SceneError as error:
        return "refused" if str(error).strip() else "refused without a word"
    return "a scene"


def run(scene: dict, folder: Path) -> str:
    """What became of a scene that runs for two steps."""
    from parsolid.commands.cli import main

    path = write(scene, folder / "scene.toml")
    told = io.StringIO()
    with contextlib.redirect_stderr(told), contextlib.redirect_stdout(io.StringIO()):
        arguments = [path, "-o", folder / "output", "--max-steps", "2", "--wall-time", "30", "-q"]
        status = main([str(argument) for argument in arguments])
    return f"status {status}" if status in (0, 2, 3, 75) else f"status {status}: {told.getvalue()}"


def _late(*_: Any) -> None:
    raise TimeoutError(f"more than {PATIENCE} s")


def batch(seed: int, first: int, every: int, outbox: Any) -> None:
    """Change scenes first, first + 1, ...; tells (number, scene's name, what became of it)."""
    signal.signal(signal.SIGALRM, _late)
    # a warning of numpy's beside a run is a message that nobody meant
    warnings.simplefilter("error", RuntimeWarning)
    runs = shipped()
    for number in range(first, first + BATCH):
        chance = random.Random(f"{seed} {number}")
        whole = number % every == 0
        name = chance.choice(sorted(SCENES if whole else runs))
        scene = SCENES[name] if whole else runs[name]
        way = chance.random()
        if way < 0.5:
            scene = grafted(scene, [*SCENES.values()] if whole else [*runs.values()], chance)
        # a graft alone is the most likely to be sound
        scene = mutated(scene, chance) if way > 0.25 else scene
        outbox.send((number, name, scene, None))
        with tempfile.TemporaryDirectory() as folder:
            signal.alarm(PATIENCE)
            try:
                found = run(scene, Path(folder)) if whole else read(scene, (ROOT / name).parent)
            except BaseException:
                found = traceback.format_exc()
            signal.alarm(0)
        outbox.send((number, name, scene, found))
    outbox.close()


def attack(seed: int, number: int, every: int, keep: Path) -> tuple[Counter[str], int]:
    """How many scenes became what, and how many faults there were."""
    ended: Counter[str] = Counter()
    faults = 0
    context = multiprocessing.get_context("spawn")
    for first in range(0, number, BATCH):
        inbox, outbox = context.Pipe(duplex=False)
        worker = context.Process(target=batch, args=(seed, first, every, outbox))
        worker.start()
        outbox.close()
        last: Any = None
        while True:
            try:
                last = inbox.recv()
            except EOFError:
                break
            if last[3] is None:
                continue
            ended[last[3] if len(last[3]) < 30 else "fault"] += 1
            faults += _kept(keep, last, last[3])
        worker.join()
        if worker.exitcode:
            faults += _kept(keep, last, f"fault: the process ended with {worker.exitcode}")
        print(f"{first + BATCH}: {dict(ended)}, {faults} faults", flush=True)
    return ended, faults


def _kept(keep: Path, told: tuple, found: str) -> bool:
    """Whether this is a fault; it is kept then."""
    if found in ("a scene", "refused", "status 0", "status 2", "status 3", "status 75"):
        return False
    keep.mkdir(parents=True, exist_ok=True)
    number, name, scene, _ = told
    (keep / f"{number}.txt").write_text(f"{name}\n{found}\n{json.dumps(scene, indent=1)}\n")
    return True


def main() -> int:
    """Attack with so many scenes, and print what became of them."""
    parser = argparse.ArgumentParser(prog="python -m checks.scene_attack", description=__doc__)
    parser.add_argument("--number", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every", type=int, default=10, help="one in so many is a small scene that also runs")
    parser.add_argument("--keep", type=Path, default=Path("scene_attack"), help="folder for the scenes with a fault")
    options = parser.parse_args()
    began = time.monotonic()
    ended, faults = attack(options.seed, options.number, options.every, options.keep)
    for word, count in sorted(ended.items()):
        print(f"{count:7d}  {word}")
    print(f"{faults} faults in {time.monotonic() - began:.0f} s (seed {options.seed})")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
