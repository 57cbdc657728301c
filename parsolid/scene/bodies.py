"""Bodies of a scene: a shape filled with particles, its material, its initial state."""

from functools import lru_cache
from math import prod
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import (
    Name,
    OneOrMore,
    OnRestart,
    Positive,
    SceneModel,
    dimension_of,
    mismatch,
    reject,
)
from parsolid.scene.formulas import InitialMatrix, InitialScalar, InitialVector
from parsolid.scene.materials import Material
from parsolid.scene.shapes import BodyShape
from parsolid.scene.validation_errors import NOTHING

Placement = Literal["vertices", "cells"]

# relative spacings along an axis
Grading = Annotated[list[Annotated[float, Field(ge=1e-3, le=1e3)]], Field(min_length=1, max_length=3)]

# largest number of particles of a body
MOST_PARTICLES = 10**12

# shapes whose lattice is cut by a surface
_CUT = ("cylinder", "sphere", "perforated_box")
# cut shapes that may have particles at the corners of cells, because their cells are not scaled
_WITH_CORNERS = ("perforated_box",)


@lru_cache(maxsize=64)
def graded_shares(count: int, grading: tuple[float, ...]) -> np.ndarray:
    """Positions (count,) of nodes on a line from exactly 0 to exactly 1.

    grading: relative spacings at node numbers in equal distances from the first to the last; in between the logarithm
    of the spacing is a linear function (of two values) or a parabola (of three) of the node number.
    """
    knots = np.linspace(0.0, 1.0, len(grading))
    logarithms = np.polynomial.Polynomial.fit(knots, np.log(grading), len(grading) - 1)
    spacings = np.exp(logarithms((np.arange(count - 1) + 0.5) / (count - 1)))
    places = np.concatenate(([0.0], np.cumsum(spacings)))
    result: np.ndarray = places / places[-1]
    # the cached array is shared
    result.flags.writeable = False
    return result


class Extent(NamedTuple):
    """Bounds (d,) [m] of a body and its largest particle spacing [m]."""

    lower: np.ndarray
    upper: np.ndarray
    coarsest: float


class FilledShape(SceneModel):
    """A shape and the particles that fill it."""

    at_most_one: ClassVar = (("particles", "spacing"),)
    on_restart: ClassVar = dict.fromkeys(
        ("name", "shape", "particles", "spacing", "placement", "jitter", "seed"), OnRestart.FIXED
    )
    name: Name | None = Field(None, description="by which other tables call the body")
    shape: BodyShape
    particles: list[Annotated[int, Field(ge=1, le=10**12)]] | None = Field(
        None,
        description="number of particles along each of the shape's own directions: X, Y, Z of a box and of the "
        "bounding box of a cylinder or sphere; hoop, axial, radial of a shell (hoop, radial in 2-D)",
    )
    spacing: Annotated[list[Positive], OneOrMore] | None = Field(
        None,
        description="distance of particles [m] along the same directions, or one for all; rounded so that whole "
        "numbers fit",
    )
    placement: Placement | None = Field(
        None,
        description='"vertices": on the boundary too, with trapezoid volumes (of a perforated box at corners of its '
        'cells); "cells": in the middle of equal cells, of mpm and ulsph the only one',
    )
    jitter: float = Field(
        0.0,
        ge=0.0,
        lt=0.5,
        description="random offset of each particle as a fraction of the spacing, the same on any number of ranks; "
        "particles on the boundary stay",
    )
    seed: int = Field(0, ge=0, description="of the random offsets")

    @field_validator("particles", "spacing")
    @classmethod
    def _one_each(cls, value: list[Any] | None, info: ValidationInfo) -> list[Any] | None:
        """One number per direction; a single spacing is that of all directions."""
        dimension = dimension_of(info)
        if value is None or dimension is None or len(value) == dimension:
            return value
        if info.field_name == "particles":
            raise mismatch(f"{dimension} numbers (one per direction)", value, "length")
        if len(value) != 1:
            raise mismatch(f"one number or {dimension} numbers (one per direction)", value, "length")
        return value

    @model_validator(mode="after")
    def _filled(self) -> "FilledShape":
        details: list[Any] = []
        counted = self.particles is not None or self.spacing is not None
        if self.shape.kind == "mesh" and counted:
            key = "particles" if self.particles is not None else "spacing"
            details.append(((key,), "no such key with a mesh (it has its own particles)", getattr(self, key)))
        if self.shape.kind != "mesh" and not counted:
            details.append(((), "exactly one of particles, spacing", Phrase("none")))
        if self.shape.kind in _CUT and self.shape.kind not in _WITH_CORNERS and self.placement == "vertices":
            expected = f"'cells' for a {self.shape.kind} (its lattice is cut by the surface)"
            details.append((("placement",), expected, "vertices"))
        reject(*details)
        return self

    @property
    def placed_on(self) -> Placement:
        """The placement, by default that of the shape."""
        return self.placement or ("cells" if self.shape.kind in _CUT else "vertices")

    def numbers(self) -> list[int]:
        """Number of lattice points along each of the shape's directions."""
        if self.particles is not None:
            return list(self.particles)
        lengths, spacing = self.shape.model.lengths(), self.spacing or []
        spacings = spacing if len(spacing) == len(lengths) else spacing * len(lengths)
        # the upper limit keeps an absurd spacing countable, so that it can be refused
        intervals = [max(1, round(min(a / b, 2.0 * MOST_PARTICLES))) for a, b in zip(lengths, spacings)]
        return [number + ends for number, ends in zip(intervals, self._on_ends())]

    def _on_ends(self) -> list[bool]:
        """For each direction whether there are particles at both ends."""
        shape = self.shape.model
        closed = [getattr(shape, "closed", False)] + [False] * (len(shape.lengths()) - 1)
        return [self.placed_on == "vertices" and not is_closed for is_closed in closed]

    def extent(self) -> Extent:
        """Bounds and largest spacing; not for meshes."""
        lower, upper = map(np.array, self.shape.model.bounds())
        # the spacing of a single particle is the whole length
        shape, numbers = self.shape.model, self.numbers()
        intervals = [n - 1 if ends and n > 1 else n for n, ends in zip(numbers, self._on_ends())]
        spacings = [length / number for length, number in zip(shape.lengths(), intervals)]
        if self.shape.kind == "cylindrical_shell":
            # the spacing along the outer hoop
            spacings[0] *= 1.0 + 0.5 * shape.thickness / shape.radius
        for axis, grading in enumerate(getattr(self, "grading", None) or ()):
            if len(grading) > 1:
                steps = np.diff(graded_shares(numbers[axis], tuple(grading)))
                spacings[axis] *= float(steps.max()) * intervals[axis]
        return Extent(lower, upper, max(spacings))

    def lattice_faults(self) -> list[tuple[str, object]]:
        """Faults (expected, found) of a lattice with too many particles or fewer than two."""
        numbers, holed = self.numbers(), self.shape.kind == "perforated_box"
        if prod(numbers) > MOST_PARTICLES:
            return [(f"at most {MOST_PARTICLES:g} particles", Phrase(f"{prod(numbers):g}"))]
        if holed and self.placed_on == "vertices" and min(numbers) < 2:
            return [("two nodes or more along each direction of a perforated box", numbers)]
        count = prod(numbers)
        if holed and self.placed_on == "vertices":
            # a cell has at least two corners
            count = 2 * self.shape.model.cells_outside_hole([number - 1 for number in numbers])
        elif holed:
            count = self.shape.model.cells_outside_hole(numbers)
        return [("a body of at least two particles", count)] if count < 2 else []


class Body(FilledShape):
    """One body: a filled shape, its material and its initial state.

    The initial deformation gradient is by default that of `displacement`, or the identity.
    """

    on_restart: ClassVar = dict.fromkeys(
        ("velocity", "displacement", "deformation_gradient", "temperature", "method"), OnRestart.FIXED
    )
    velocity: InitialVector | None = Field(None, description="a formula in X, Y, Z for each component [m/s]")
    displacement: InitialVector | None = Field(None, description="the initial one, a formula for each component [m]")
    deformation_gradient: InitialMatrix | None = Field(None, description="the initial one, rows of formulas")
    temperature: InitialScalar | None = Field(None, description="initial temperature [K] (default: of the material)")
    micro_rate: InitialScalar | None = Field(None, description="the initial micro-velocity v^p [1/s] (default: 0)")
    thermal_reference: Literal["stress-free", "at-constant-volume"] | None = Field(
        None, description="'stress-free' at the initial temperature (default), or heated 'at-constant-volume' to it"
    )
    grading: list[Grading] | None = Field(
        None,
        description="of nodes of a box, for each axis: relative spacings at the first, middle and last node, at the "
        "first and last, or [1]",
    )
    method: Name | None = Field(None, validate_default=True, description="the name of one of several methods")
    material: Material = Field(description="a table with the key kind")

    @field_validator("method")
    @classmethod
    def _one_of_several(cls, value: str | None, info: ValidationInfo) -> str | None:
        named = (info.context or {}).get("methods", [value])
        if named is None and value is not None:
            raise mismatch("no such key where all bodies have one method", value)
        if named is not None and value not in named and (value is not None or len(named) > 1):
            raise mismatch(f"one of {', '.join(map(repr, named))}", NOTHING if value is None else value)
        return value

    @field_validator("grading")
    @classmethod
    def _one_per_axis(cls, value: Any, info: ValidationInfo) -> Any:
        dimension = dimension_of(info)
        if value is not None and dimension is not None and len(value) != dimension:
            raise mismatch(f"{dimension} lists (one per axis)", value)
        return value

    @model_validator(mode="after")
    def _keys_have_effect(self) -> "Body":
        details: list[Any] = []
        even = self.shape.kind != "box" or self.placed_on != "vertices" or self.jitter > 0.0
        if self.grading is not None and even:
            expected = 'no such key but for a box with placement = "vertices" and no jitter'
            details.append((("grading",), expected, self.grading))
        if self.thermal_reference is not None and (self.temperature is None or self.material.kind != "elastic-plastic"):
            expected = "no such key but for an elastic-plastic body with a temperature"
            details.append((("thermal_reference",), expected, self.thermal_reference))
        if self.micro_rate is not None and not getattr(self.material, "inertia_length", None):
            expected = "no such key but for a body of micro-inertia with an inertia_length"
            details.append((("micro_rate",), expected, self.micro_rate.source))
        reject(*details)
        return self
