"""How loads and prescribed motion go in time: formulas that may jump, tables of factors, rigid motion.

Most are sums of products of a function of time and one of place, of which only the former are found anew.
"""

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import SceneModel, Times, method_of, reject
from parsolid.scene.formula_terms import read_csv_table
from parsolid.scene.formulas import Formula, FormulaVector, Scalar, Vector
from parsolid.scene.shapes import ExistingFile


class SpaceTimeFunction:
    """Values (components) at reference places and times."""

    @property
    def depends_on_time(self) -> bool:
        """Whether they change."""
        return True

    @property
    def jump_times(self) -> Sequence[float]:
        """Times [s] at which they jump."""
        return ()

    @property
    def two_sided_times(self) -> frozenset[float]:
        """Times [s] at which the values just before and just after differ."""
        return frozenset(self.jump_times)

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """Values (n, components) at points (n, d) [m] and a time [s]; where they jump just after, or just before it."""
        raise NotImplementedError

    def at(self, points: np.ndarray) -> Callable[[float, bool], Sequence[Any]]:
        """The components at points (n, d) [m] as a function of `time` and `before`, see `evaluate`: (n,), or a number
        where it is the same at all points. Warnings of numpy are the caller's to silence."""
        return lambda time, before: list(self.evaluate(points, time, before).T)


class Mode(NamedTuple):
    """What a factor in time (by its number; None: 1) is multiplied by in one component: a number, or (n,)."""

    component: int
    factor: int | None
    values: Any


class Separated(NamedTuple):
    """A function at some places: each component is the sum of its modes times their factors.

    factors(time, before): at a time [s], see `SpaceTimeFunction.evaluate`; pointwise: whether each is (n,), of what is
    no such product, else it is a number.
    """

    components: int
    factors: Callable[[float, bool], Sequence[Any]]
    pointwise: list[bool]
    modes: list[Mode]

    def values(self, time: float, before: bool) -> list[Any]:
        """Of each component a number, where it is the same at all places, or (n,)."""
        factors = self.factors(time, before)
        result: list[Any] = [0.0] * self.components
        for component, number, values in self.modes:
            result[component] = result[component] + (values if number is None else factors[number] * values)
        return result


class SeparatedFunction(SpaceTimeFunction):
    """A function that is known by its factors and modes."""

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
    """Times [s] at which functions of time turn a corner in what a scene prescribes, or velocities of tools jump, and
    steps must end."""
    loads = (scene.loads.body_force, scene.loads.acceleration, scene.loads.heat_source)
    stated = [formulas for boundary in scene.boundaries for formulas in boundary.formulas.values()]
    turns = {time for formulas in (*stated, *loads) if formulas is not None for time in formulas.corners}
    return turns | {time for tool in scene.tools if tool.motion is not None for time in tool.motion.jumps}


class Loads(Timed):
    """Loads on all bodies: force [N/m^3] and heat [W/m^3] per reference volume, acceleration [m/s^2].

    history and jumps are those of the force and the acceleration.
    manufactured: also the body force under which the exact solution of the scene's reference holds.
    """

    body_force: Vector | None = Field(None, description="a formula for each component [N/m^3]")
    acceleration: Vector | None = Field(None, description="a formula for each component [m/s^2]: gravity, say")
    heat_source: Scalar | None = Field(None, description="a formula [W/m^3]")
    manufactured: Literal[True] | None = Field(None, description="add the body force of the reference's solution")

    @model_validator(mode="after")
    def _known_to_method(self, info: ValidationInfo) -> "Loads":
        method = method_of(info)
        known: tuple[str, ...] = getattr(method, "loads", ())
        stated = self.model_fields_set - Timed.model_fields.keys() if method else set()
        unknown = [key for key in stated if key not in known]
        reject(*(((key,), f"one of {', '.join(known)} with this method", key) for key in unknown))
        return self


class RigidMotion(SeparatedFunction):
    """The displacement, or the velocity, of x = c + d(t) + R(angle(t)) (X - c).

    jumps: times [s] at which a rate jumps.
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
        self.stated = centre, axis, angle, displacement
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
        return RigidMotion(*self.stated, "velocity")

    def separated(self, points: np.ndarray) -> Separated:
        d, origin, is_velocity = self.dimension, np.zeros((1, 3)), self.quantity == "velocity"
        arm = (points - self.centre).T
        # R - 1 = sin S + (1 - cos) S^2 with the spin S, and S^3 = -S; sums that are the same whatever the other points
        turns = [sum(matrix[:d, j, None] * arm[j] for j in range(d)) for matrix in (self.spin, self.spin @ self.spin)]
        modes = [Mode(c, i, turned[c]) for i, turned in enumerate(turns) for c in range(d)]
        angle, *moved = [_alone(one, origin) for one in self.formulas]
        rate, *speeds = [_alone(one, origin) for one in self.rates]
        added = []
        if not all(one.is_constant for one in self.formulas[1:]):
            added, modes = speeds if is_velocity else moved, [*modes, *(Mode(c, 2 + c, 1.0) for c in range(d))]

        def factors(time: float, before: bool) -> list[float]:
            if time in self.jumps:
                time += (-1.0 if before else 1.0) * NEAR * max(1.0, time)
            turn = angle(time)
            sin, cos = (math.sin(turn), math.cos(turn)) if math.isfinite(turn) else (math.nan, math.nan)
            speed = rate(time) if is_velocity else 1.0
            turning = [speed * cos, speed * sin] if is_velocity else [sin, 1.0 - cos]
            return turning + [one(time) for one in added]

        return Separated(d, factors, [False] * (2 + len(added)), modes)


def _alone(formula: Formula, origin: np.ndarray) -> Callable[[float], float]:
    """A formula in t alone as a function of time [s]."""
    products = formula.products(origin)
    return lambda time: sum(float(mode) * (1.0 if factor is None else factor(time)) for factor, mode, _ in products)
