"""python -m checks.bit_flips --number 300: one bit of any file that a run has left is changed, and all of it is read.

Of each flip either an error tells, or nothing that is read differs. Prints what happened to each file; status 1 when a
change went unseen.
"""

import argparse
import contextlib
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "end_to_end"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "output"))

from flipped_bits import flip
from small_scenes import SCENES, write

from parsolid.commands.cli import main as command
from parsolid.output.checkpoint import read_checkpoint
from parsolid.output.errors import OutputError
from parsolid.output.results import load
from parsolid.scene import SceneError

# bytes of numbers are many more than those of texts: half of the flips are in the small files
_SMALL = 0.5


def content(folder: Path) -> list:
    """All that a user or a restart reads: columns, fields, summary, scene and checkpoints."""
    results = load(folder)
    found: list = [sorted(results.scene.items(), key=str), sorted(results.summary.items(), key=str)]
    found += [(name, values.tobytes()) for name, values in results.columns.items()]
    for time in results.times:
        fields = results.fields[time]
        found += [(time, name, np.asarray(fields[name]).tobytes()) for name in fields]
    for path in sorted(folder.glob("checkpoint*.h5")):
        header, systems, rows = read_checkpoint(MPI.COMM_SELF, path)
        found += [str(header), rows.tobytes()]
        found += [(name, values.tobytes()) for fields in systems for name, values in fields.items()]
    return found


def attack(folder: Path, number: int, chance: random.Random) -> Counter:
    """What happened: (file, outcome) -> how often."""
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.stat().st_size)
    expected, seen = content(folder), Counter()
    for _ in range(number):
        weights = [1.0 if chance.random() < _SMALL else path.stat().st_size for path in files]
        (path,) = chance.choices(files, weights)
        place, bit = chance.randrange(path.stat().st_size), chance.randrange(8)
        flip(path, place, bit)
        try:
            outcome = "nothing differs" if content(folder) == expected else "UNSEEN"
        except (OutputError, SceneError):
            outcome = "told"
        except Exception as error:
            outcome = f"FAULT {type(error).__name__}: {error}"
        flip(path, place, bit)
        if outcome not in ("told", "nothing differs"):
            print(f"{path.name}: bit {bit} of byte {place}: {outcome}", flush=True)
        seen[path.name, outcome.split(":")[0]] += 1
    return seen


def main() -> int:
    """Run small scenes and flip bits of what they leave."""
    parser = argparse.ArgumentParser(prog="python -m checks.bit_flips", description=__doc__)
    parser.add_argument("--number", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("scenes", nargs="*", default=["driven", "moving"], help=f"of {', '.join(SCENES)}")
    options = parser.parse_args()
    seen: Counter = Counter()
    with tempfile.TemporaryDirectory() as name:
        for scene in options.scenes:
            path, folder = Path(name) / f"{scene}.toml", Path(name) / scene
            write(SCENES[scene], path)
            with contextlib.suppress(SystemExit):
                words = ["run", str(path), "-q", "-o", str(folder), "--set", "output.checkpoint_steps=20"]
                assert command(words) in (0, None)
            seen += attack(folder, options.number // len(options.scenes), random.Random(options.seed))
    for (file, outcome), count in sorted(seen.items()):
        print(f"{file:<24} {outcome:<16} {count}")
    return int(any(outcome not in ("told", "nothing differs") for _, outcome in seen))


if __name__ == "__main__":
    sys.exit(main())
