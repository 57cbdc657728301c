"""Errors that are asked for: what they are, and which resolution and time they need by the orders that were seen."""

import math
from dataclasses import dataclass

import numpy as np

from parsolid.scene import SceneError

# levels are at most so much finer than the one before, and at least
MOST_FINER, LEAST_FINER = 2.5, 1.2
# a bar is to be a little below what was asked, so that a guess that is a little off still does
AIM = 0.9


@dataclass(frozen=True)
class Target:
    """A column of the history and the bar it is to have at the end: as a share of its largest value, or as such."""

    column: str
    bar: float
    relative: bool

    @classmethod
    def parse(cls, text: str, columns: list[str]) -> "Target":
        """From "tip.twist 2 %" or "tip.twist 0.01". Raises SceneError."""
        words = text.replace("%", " % ").split()
        if len(words) not in (2, 3) or (len(words) == 3 and words[2] != "%"):
            raise SceneError([f'target: expected a column and a bar, as in "tip.twist 2 %", found {text!r}'])
        try:
            bar = float(words[1])
        except ValueError:
            bar = math.nan
        if not 0.0 < bar < math.inf:
            raise SceneError([f"target: expected a positive number after {words[0]}, found {words[1]!r}"])
        if words[0] not in columns:
            raise SceneError([f"target: expected one of {', '.join(columns)}, found {words[0]!r}"])
        return cls(words[0], bar / 100.0 if len(words) == 3 else bar, len(words) == 3)

    def __str__(self) -> str:
        return f"{self.column} {100.0 * self.bar:g} %" if self.relative else f"{self.column} {self.bar:g}"


@dataclass(frozen=True)
class Cost:
    """What a run took: particles, steps, core-seconds of the processor."""

    particles: int
    steps: int
    seconds: float


def finer_by(excess: float, order: float) -> float:
    """How much finer the next level must be for a bar that is `excess` times too large, within what a guess is good
    for.
    """
    return min(MOST_FINER, max(LEAST_FINER, (excess / AIM) ** (1.0 / order)))


def steps_grow(ratios: list[float], steps: list[int]) -> float:
    """The power of the resolution with which the number of steps has grown: 1 of waves, 2 of conduction, 0 of steps
    that are stated; ratios: of the spacings of runs; 1 where there is but one."""
    if len(set(ratios)) < 2:
        return 1.0
    slope = np.polyfit(-np.log(ratios), np.log(np.maximum(steps, 1)), 1)[0]
    return float(min(2.0, max(0.0, slope)))


def predicted_seconds(known: list[Cost], particles: int, steps: float) -> float:
    """Core-seconds of a run, from a time a step and one a particle and step that fit the runs known, the largest best.

    Neither is negative.
    """
    sizes = np.array([one.particles for one in known], float)
    times = np.array([one.seconds / max(1, one.steps) for one in known])
    weights = sizes / sizes.sum()
    mean, size = float(weights @ times), float(weights @ sizes)
    spread = float(weights @ (sizes - size) ** 2)
    slope = float(weights @ ((sizes - size) * (times - mean))) / spread if spread > 0.0 else mean / size
    slope = min(max(slope, 0.0), mean / size)
    return steps * (mean + slope * (particles - size))
