"""How loads go in time: formulas that may jump, and tables of factors."""

import itertools
from bisect import bisect_left, bisect_right
from copy import copy
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import NotNegative, SceneModel, reject
from parsolid.scene.csv_table import read_csv_table
from parsolid.scene.formulas import FormulaVector
from parsolid.scene.shapes import ExistingFile
from parsolid.scene.space_time import Mode, Separated, SeparatedFunction

# just before and just after a jump, relative to its time [1] and absolute [s]
NEAR = 1e-13


class FactorHistory(SceneModel):
    """A factor that is linear in time between rows of (time [s], factor); a repeated time is a jump.

    It is 0 before the first row and constant after the last. Rows stand in the scene or in a CSV file.
    """

    exactly_one: ClassVar = (("rows", "file"),)
    rows: list[Annotated[list[float], Field(min_length=2, max_length=2)]] | None = Field(
        None, min_length=1, description="pairs of time [s] and factor"
    )
    file: ExistingFile | None = Field(None, description="a CSV file of times [s] and factors")

    @model_validator(mode="after")
    def _in_order(self) -> "FactorHistory":
        key = "rows" if self.file is None else "file"
        try:
            times = [time for time, _ in self.table]
        except ValueError as error:
            reject(((key,), "a CSV file of two columns of numbers", Phrase(f"{self.file} ({error})")))
        if not times or not np.isfinite(self.table).all():
            reject(((key,), "finite numbers", self.file or self.rows))
        late = [(i, time) for i, (before, time) in enumerate(zip([0.0, *times], times)) if time < before]
        if late:
            place = (key, late[0][0]) if self.file is None else (key,)
            reject((place, "times from 0 on that do not fall", late[0][1]))
        return self

    @property
    def table(self) -> list[list[float]]:
        """The rows, wherever they stand."""
        if self.rows is not None:
            return self.rows
        assert self.file is not None
        return np.stack(read_csv_table(str(self.file)), axis=1).tolist()

    @property
    def jumps(self) -> list[float]:
        """Times [s] at which the factor jumps."""
        rows = [[self.table[0][0], 0.0], *self.table]
        return sorted(
            {end for (begin, before), (end, after) in itertools.pairwise(rows) if begin == end and before != after}
        )

    def factor(self, time: float, before: bool = False) -> float:
        """The factor at a time [s]: just after its jump, or just before."""
        times, factors = self._columns
        if time < times[0] or (before and time == times[0]):
            return 0.0
        end = bisect_left(times, time) if before else bisect_right(times, time)
        if end == len(times):
            return factors[-1]
        begin, width = times[end - 1], times[end] - times[end - 1]
        return factors[end - 1] + (factors[end] - factors[end - 1]) * (time - begin) / width

    @cached_property
    def _columns(self) -> tuple[list[float], list[float]]:
        """Times [s] and factors of all rows."""
        times, factors = zip(*self.table)
        return list(map(float, times)), list(map(float, factors))


class Timed(SceneModel):
    """Keys of a load that changes in time."""

    history: FactorHistory | None = Field(None, description="a factor of its formulas")
    jumps: list[NotNegative] | None = Field(
        None,
        description="times [s] at which the formulas themselves jump; quasi-static solutions insert a step of length "
        "zero there",
    )

    @model_validator(mode="after")
    def _rising(self) -> "Timed":
        jumps = self.jumps or []
        late = [(i, after) for i, (before, after) in enumerate(itertools.pairwise(jumps), 1) if after <= before]
        reject(*((("jumps", i), "a time later than the one before", time) for i, time in late))
        return self

    @property
    def jump_times(self) -> list[float]:
        """Times [s] at which formulas or history jump."""
        return sorted({*(self.jumps or ()), *(self.history.jumps if self.history is not None else ())})


class LoadHistory(SeparatedFunction):
    """Formulas with the history and jumps of a `Timed` table, if they have any.

    jumps: times [s] at which the formulas are taken just before or just after.
    """

    def __init__(self, formulas: FormulaVector, timed: Timed | None = None):
        self.formulas, self.timed = formulas, timed
        self.history = timed.history if timed is not None else None
        stated = (timed.jumps or ()) if timed is not None else ()
        self.jumps = tuple(sorted({*stated, *formulas.corners}))

    @property
    def jump_times(self) -> list[float]:
        """Times [s] at which formulas or history jump."""
        return sorted({*(self.timed.jump_times if self.timed is not None else ()), *self.formulas.jumps})

    @property
    def two_sided_times(self) -> frozenset[float]:
        return frozenset((*self.jump_times, *self.jumps))

    @property
    def depends_on_time(self) -> bool:
        """Whether the values change in time."""
        return self.history is not None or self.formulas.depends_on_time

    def component(self, index: int) -> "LoadHistory":
        """One component alone, in the same time."""
        result = copy(self)
        result.formulas = FormulaVector((self.formulas[index],))
        return result

    @property
    def free(self) -> np.ndarray:
        """Which components are free, (d,) bool."""
        return self.formulas.free

    def separated(self, points: np.ndarray) -> Separated:
        factors: list[Any] = []
        modes, pointwise, history = [], list[bool](), self.history
        with np.errstate(all="ignore"):
            products = [(i, one) for i, each in enumerate(self.formulas) if each for one in each.products(points)]
        for component, (factor, mode, of_place) in products:
            if factor is None and history is None:
                modes.append(Mode(component, None, mode))
                continue
            modes.append(Mode(component, len(factors), mode))
            factors.append(factor or (lambda time: 1.0))
            pointwise.append(of_place)

        def found(time: float, before: bool) -> list[Any]:
            near = self._beside(time, before)
            if history is None:
                return [one(near) for one in factors]
            scale = history.factor(time, before)
            return [scale * one(near) for one in factors]

        return Separated(len(self.formulas), found, pointwise, modes)

    def _beside(self, time: float, before: bool) -> float:
        """Where formulas are evaluated for a time [s]: of a jump just after, or just before it."""
        if time in self.jumps:
            return time + (-1.0 if before else 1.0) * NEAR * max(1.0, time)
        return time


def corner_times(scene: Any) -> set[float]:
    """Times [s] at which functions of time turn a corner in what a scene prescribes, and steps must end."""
    loads = (scene.loads.body_force, scene.loads.acceleration, scene.loads.heat_source)
    stated = [formulas for boundary in scene.boundaries for formulas in boundary.formulas.values()]
    return {time for formulas in (*stated, *loads) if formulas is not None for time in formulas.corners}
