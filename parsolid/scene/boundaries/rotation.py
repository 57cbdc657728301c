"""Rigid motion prescribed over a region: a rotation about an axis, which may move."""

from typing import Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from parsolid.scene.base_model import Point, dimension_of, reject
from parsolid.scene.boundaries.condition import Reporting, boundary_kind
from parsolid.scene.boundaries.prescribed import MotionCondition, RegionCondition
from parsolid.scene.formulas import Formula, Scalar, Vector
from parsolid.scene.load_histories import RigidMotion
from parsolid.scene.validation_errors import NOTHING


@boundary_kind
class Rotation(RegionCondition, Reporting, MotionCondition):
    """Rotation by an angle [rad] about an axis through a point, which may be displaced [m]; of every particle of a
    region.

    axis: its direction in space, right-handed; in 2-D the axis points out of the plane
    """

    kind: Literal["rotation"]
    centre: Point = Field(description="a point of the axis [m]")
    axis: Point | None = Field(None, description="the direction of the axis, in 3-D")
    angle: Scalar = Field(description="a formula in t, 0 at the start [rad]")
    displacement: Vector | None = Field(None, description="of the axis, formulas in t, 0 at the start [m]")

    @model_validator(mode="after")
    def _about_an_axis(self, info: ValidationInfo) -> "Rotation":
        dimension = dimension_of(info) or len(self.centre)
        if dimension == 3 and (self.axis is None or not np.linalg.norm(self.axis) > 0.0):
            reject((("axis",), "a direction that is not zero", NOTHING if self.axis is None else self.axis))
        if dimension == 2 and self.axis is not None:
            reject((("axis",), "no such key in 2-D (the axis points out of the plane)", self.axis))
        for key, formula in self._formulas:
            if set(formula.names) - {"t"}:
                reject((key, "a formula in t alone", formula.source))
            start = float(formula.evaluate(np.zeros((1, 3)))[0])
            if abs(start) > 1e-12:
                reject((key, "a formula that is 0 at the start", start))
            try:
                formula.rate()
            except ValueError as error:
                reject((key, f"a formula that can be differentiated in time ({error})", formula.source))
        return self

    @property
    def _formulas(self) -> list[tuple[tuple[str | int, ...], Formula]]:
        moved = [(("displacement", i), one) for i, one in enumerate(self.displacement or ())]
        return [(("angle",), self.angle), *moved]

    @property
    def prescribed(self) -> RigidMotion:
        """The displacement in time; `prescribed.velocity()` is its velocity."""
        return RigidMotion(self.centre, self.axis, self.angle, self.displacement)
