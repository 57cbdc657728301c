"""Loads and prescribed motion over time: formulas that may jump, tables of factors, rigid motion.

Most are sums of products of a function of time and a function of place, and only the former is evaluated each step.
"""

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import SceneModel, Times, reject
from parsolid.scene.csv_tables import read_csv_table
from parsolid.scene.formulas import Formula, FormulaVector, Scalar, Vector
from parsolid.scene.shapes import ExistingFile


class SpaceTimeFunction:
    """A vector function of reference position and time."""

    @property
    def depends_on_time(self) -> bool:
        """Whether the values depend on time."""
        return True

    @property
    def jump_times(self) -> Sequence[float]:
        """Times [s] at which the values jump."""
        return ()

    @property
    def two_sided_times(self) -> frozenset[float]:
        """Times [s] at which the values just before and just after differ."""
        return frozenset(self.jump_times)

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """Values (n, components) at points (n, d) [m] and a time [s]; at a jump the values after it, or before it."""
        raise NotImplementedError

    def at(self, points: np.ndarray) -> Callable[[float, bool], Sequence[Any]]:
        """The components at points (n, d) [m] as a function of `time` and `before`, see `evaluate`.

        Each is (n,), or a number if it is the same at all points. The caller silences warnings of numpy.
        """
        return lambda time, before: list(self.evaluate(points, time, before).T)


class Mode(NamedTuple):
    """A term of one component: `values`, a number or (n,), times the factor with an index (None: 1)."""

    component: int
    factor: int | None
    values: Any


class Separated(NamedTuple):
    """A function at given points: each component is the sum of its modes times their factors.

    factors(time, before): all factors at a time [s], see `SpaceTimeFunction.evaluate`; pointwise: for each factor
    whether it is (n,), because the function is not a product, or a number
    """

    components: int
    factors: Callable[[float, bool], Sequence[Any]]
    pointwise: list[bool]
    modes: list[Mode]

    def values(self, time: float, before: bool) -> list[Any]:
        """Each component: a number if it is the same at all points, or (n,)."""
        factors = self.factors(time, before)
        result: list[Any] = [0.0] * self.components
        for component, number, values in self.modes:
            result[component] = result[component] + (values if number is None else factors[number] * values)
        return result


class SeparatedFunction(SpaceTimeFunction):
    """A function given by factors in time and modes in space."""

    def separated(self, points: np.ndarray) -> Separated:
        """The values at points (n, d) [m]."""
        raise NotImplementedError

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        with np.errstate(all="ignore"):
            values = self.separated(points).values(time, before)
        result = np.empty((len(points), len(values)))
        for i, one in enumerate(values):
            result[:, i] = one
        return result

    def at(self, points: np.ndarray) -> Callable[[float, bool], Sequence[Any]]:
        with np.errstate(all="ignore"):
            return self.separated(points).values


# distance in time from a jump to just before and just after it: relative to its time, at least this in s
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
        """The rows, from the scene or the file."""
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

    history: FactorHistory | None = Field(None, description="a factor on its formulas")
    jumps: Times | None = Field(
        None,
        description="times [s] at which the formulas themselves jump; quasi-static solutions insert a step of length "
        "zero there",
    )

    @property
    def jump_times(self) -> list[float]:
        """Times [s] at which formulas or history jump."""
        return sorted({*(self.jumps or ()), *(self.history.jumps if self.history is not None else ())})


class LoadHistory(SeparatedFunction):
    """Formulas with the history and jumps of a `Timed` table.

    jumps: times [s] at which formulas are evaluated just before or just after
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
        return self.history is not None or self.formulas.depends_on_time

    def component(self, index: int) -> "LoadHistory":
        """A function of one component only."""
        result = copy(self)
        result.formulas = FormulaVector((self.formulas[index],))
        return result

    @property
    def free(self) -> np.ndarray:
        """Which components are free, (d,) bool."""
        return self.formulas.free

    def separated(self, points: np.ndarray) -> Separated:
        functions: list[Any] = []
        modes, pointwise, history = [], list[bool](), self.history
        with np.errstate(all="ignore"):
            products = [(i, one) for i, each in enumerate(self.formulas) if each for one in each.products(points)]
        for component, (function, mode, is_pointwise) in products:
            if function is None and history is None:
                modes.append(Mode(component, None, mode))
                continue
            modes.append(Mode(component, len(functions), mode))
            functions.append(function or (lambda time: 1.0))
            pointwise.append(is_pointwise)

        def factors(time: float, before: bool) -> list[Any]:
            near = _beside_jump(time, before, self.jumps)
            if history is None:
                return [function(near) for function in functions]
            scale = history.factor(time, before)
            return [scale * function(near) for function in functions]

        return Separated(len(self.formulas), factors, pointwise, modes)


def _beside_jump(time: float, before: bool, jumps: Sequence[float]) -> float:
    """The time [s], or if it is a jump, a time just before or just after it."""
    if time in jumps:
        return time + (-1.0 if before else 1.0) * NEAR * max(1.0, time)
    return time


def corner_times(scene: Any) -> set[float]:
    """Times [s] at which steps must end: corners and jumps of loads and boundaries, jumps of velocities of tools."""
    loads = [scene.loads.body_force, scene.loads.acceleration, scene.loads.heat_source]
    loads += [formulas for boundary in scene.boundaries for formulas in boundary.formulas.values()]
    corners = {time for formulas in loads if formulas is not None for time in formulas.corners}
    return corners | {time for tool in scene.tools if tool.motion is not None for time in tool.motion.jumps}


class Loads(Timed):
    """Loads on all bodies: force [N/m^3] and heat [W/m^3] per reference volume, acceleration [m/s^2].

    history and jumps apply to the force and the acceleration; manufactured: add the body force of the exact solution of
    the scene's reference
    """

    body_force: Vector | None = Field(None, description="a formula for each component [N/m^3]")
    acceleration: Vector | None = Field(None, description="a formula for each component [m/s^2], such as gravity")
    heat_source: Scalar | None = Field(None, description="a formula [W/m^3]")
    manufactured: Literal[True] | None = Field(None, description="add the body force of the reference's solution")


class RigidMotion(SeparatedFunction):
    """The displacement or velocity of the rigid motion x = c + d(t) + R(angle(t)) (X - c).

    jumps: times [s] at which a rate jumps
    """

    def __init__(
        self,
        centre: Sequence[float],
        axis: Sequence[float] | None,
        angle: Formula,
        displacement: FormulaVector | None,
        quantity: str = "displacement",
    ):
        self.dimension = len(centre)
        self.arguments = centre, axis, angle, displacement
        self.quantity = quantity
        self.centre = np.array(centre)
        direction = np.array([0.0, 0.0, 1.0] if axis is None else axis)
        x, y, z = direction / np.linalg.norm(direction)
        self.spin = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        moved = displacement if displacement is not None else [Formula(0.0)] * self.dimension
        self.formulas = FormulaVector((angle, *moved))
        self.rates = FormulaVector([one.rate() for one in self.formulas])
        self.jumps = tuple(sorted(self.formulas.corners))

    @property
    def free(self) -> np.ndarray:
        return np.zeros(self.dimension, bool)

    @property
    def jump_times(self) -> list[float]:
        """Times [s] at which the motion jumps."""
        return sorted(self.formulas.jumps)

    @property
    def two_sided_times(self) -> frozenset[float]:
        return frozenset(self.jumps)

    def velocity(self) -> "RigidMotion":
        """The velocity of the motion."""
        return RigidMotion(*self.arguments, "velocity")

    def separated(self, points: np.ndarray) -> Separated:
        d, origin, is_velocity = self.dimension, np.zeros((1, 3)), self.quantity == "velocity"
        arm = (points - self.centre).T
        # R - 1 = sin S + (1 - cos) S^2 with the spin S; explicit sums have the same rounding for any number of points
        turns = [sum(matrix[:d, j, None] * arm[j] for j in range(d)) for matrix in (self.spin, self.spin @ self.spin)]
        modes = [Mode(c, i, turned[c]) for i, turned in enumerate(turns) for c in range(d)]
        angle, *displacements = [_function_of_time(one, origin) for one in self.formulas]
        rate, *velocities = [_function_of_time(one, origin) for one in self.rates]
        translations = []
        if not all(one.is_constant for one in self.formulas[1:]):
            translations = velocities if is_velocity else displacements
            modes += [Mode(c, 2 + c, 1.0) for c in range(d)]

        def factors(time: float, before: bool) -> list[float]:
            time = _beside_jump(time, before, self.jumps)
            turn = angle(time)
            sin, cos = (math.sin(turn), math.cos(turn)) if math.isfinite(turn) else (math.nan, math.nan)
            rotation = [sin, 1.0 - cos]
            if is_velocity:
                speed = rate(time)
                rotation = [speed * cos, speed * sin]
            return rotation + [translation(time) for translation in translations]

        return Separated(d, factors, [False] * (2 + len(translations)), modes)


def _function_of_time(formula: Formula, origin: np.ndarray) -> Callable[[float], float]:
    """A formula in t alone as a function of time [s]."""
    products = formula.products(origin)
    return lambda time: sum(float(mode) * (1.0 if factor is None else factor(time)) for factor, mode, _ in products)
