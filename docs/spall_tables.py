"""Pull-back of the free face in the scenes of spall, see failure.md: python docs/spall_tables.py ulsph 12.5 6.25, where
numbers are spacings [um]; or `mpm`, of which they are cells, and further settings of the method as transfer=apic."""

import subprocess
import sys
import tempfile
from pathlib import Path

from parsolid.output.history import read_history

RUNS = Path(__file__).parent.parent / "runs"
# velocity of the free face, and by how much a break at the strength pulls it back [m/s]
FACE, PULL_BACK = 200.0, 85.27


def overrides(method: str, h: float) -> list[str]:
    """What makes the shipped scene one of spacing h [m], four of them wide."""
    wide = 4.0 * h
    boxes = (([0.0, 0], [5e-3, wide]), ([5e-3, 0], [6.5e-3, wide]))
    result = [f"bodies.{i}.spacing={h}" for i in range(2)]
    result += [f"bodies.{i}.shape.box={{lower={lower},upper={upper}}}" for i, (lower, upper) in enumerate(boxes)]
    result += [f"boundaries.1.plane='Y = {wide:.9g}'", f"probes.0.at=[{6.5e-3 - 0.2 * h},{2.0 * h}]"]
    return result + ([f"method.cell={2.0 * h}"] if method == "mpm" else [])


def first_fall(velocity: list[float]) -> tuple[float, float]:
    """The first highest and the lowest one behind it, from which it rises by a tenth of the face's velocity."""
    highest = lowest = 0.0
    for v in velocity:
        if v > highest and lowest >= highest - 0.1 * FACE:
            highest = lowest = v
        lowest = min(lowest, v)
        if highest > 0.5 * FACE and lowest < highest - 0.2 * FACE and v > lowest + 0.1 * FACE:
            break
    return highest, lowest


def main() -> None:
    """A line for each spacing."""
    method, settings = sys.argv[1], [word for word in sys.argv[2:] if "=" in word]
    for h in (1e-6 * float(word) for word in sys.argv[2:] if "=" not in word):
        words = overrides(method, h if method == "ulsph" else 0.5 * h) + [f"method.{word}" for word in settings]
        with tempfile.TemporaryDirectory() as folder:
            scene = [str(RUNS / method / "spall.toml"), "-q", "-o", folder]
            options = [word for one in words for word in ("--set", one)]
            subprocess.run([sys.executable, "-m", "parsolid", "run", *scene, *options], check=True)
            velocity = read_history(Path(folder) / "history.csv")["surface.velocity_x"]
        highest, lowest = first_fall(velocity)
        print(
            f"{method} {' '.join(settings)}, {1e6 * h:g} um: highest {highest:.1f}, lowest {lowest:.1f} m/s, strength "
            f"{100.0 * ((FACE - lowest) / PULL_BACK - 1.0):+.1f} %, from highest and lowest "
            f"{100.0 * ((highest - lowest) / PULL_BACK - 1.0):+.1f} %",
            flush=True,
        )


if __name__ == "__main__":
    main()
