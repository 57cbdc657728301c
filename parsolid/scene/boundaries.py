"""Tables of the boundary conditions of a scene, by kind.

The package `boundary` applies them; the settings of a method list the kinds that it accepts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar, Union

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from parsolid.scene.base_model import (
    Name,
    NotNegative,
    Plane,
    Point,
    SceneModel,
    dimension_of,
    kinds_of,
    reject,
)
from parsolid.scene.formulas import Formula, FormulaVector, Scalar, Vector, VectorOrFree
from parsolid.scene.load_histories import LoadHistory, RigidMotion, Timed
from parsolid.scene.named_regions import RegionName
from parsolid.scene.regions import AtPlane, InShape, Named, NearestTo, Region
from parsolid.scene.shapes import Box, Sphere
from parsolid.scene.validation_errors import NOTHING

# kind -> the model of its table
BOUNDARY_KINDS: dict[str, type[Condition]] = {}


class Condition(SceneModel):
    """A boundary condition.

    on_particles: it acts on the particles of a region, not on a plane for all particles; needs_bounding_plane: its
    plane must bound a body
    """

    on_particles: ClassVar[bool] = True
    needs_bounding_plane: ClassVar[bool] = False
    if TYPE_CHECKING:
        # fields of the kinds, in the order of their tables
        kind: str
        plane: Plane | None
        body: str | None

    @property
    def region_name(self) -> str | None:
        """The name of its region, the key `where`; None for other places."""
        return getattr(self, "where", None)

    @property
    def reports(self) -> str | None:
        """The name in the columns of its force, moment and work; None if they are not requested."""
        return getattr(self, "name", None) if getattr(self, "reaction", None) else None

    @property
    def region(self) -> Region:
        """The region it acts on."""
        if self.region_name is not None:
            return Named(self.region_name)
        if self.plane is not None:
            return AtPlane(self.plane)
        shape = getattr(self, "box", None) or getattr(self, "ball", None)
        return InShape(shape) if shape is not None else NearestTo(getattr(self, "point"))  # noqa: B009

    @property
    def formulas(self) -> dict[str, FormulaVector]:
        """Key -> formulas."""
        result = {}
        for key in type(self).model_fields:
            value = getattr(self, key)
            if isinstance(value, Formula):
                result[key] = FormulaVector((value,))
            elif isinstance(value, FormulaVector):
                result[key] = value
        return result

    @property
    def prescribed(self) -> Any:
        """The prescribed values over time: a `LoadHistory` of the only formulas, or the `RigidMotion` of a rotation."""
        (formulas,) = self.formulas.values()
        return LoadHistory(formulas, self if isinstance(self, Timed) else None)


class Reporting(SceneModel):
    """Keys of conditions that can report their force.

    reaction: write columns name.force, name.moment (about `moment_about`) and name.work
    """

    only_with: ClassVar = (("reaction", "name"), ("moment_about", "reaction"))
    name: Name | None = Field(None, description="the name of its force in history.csv")
    reaction: Literal[True] | None = Field(None, description="write force, moment and work as columns of history.csv")
    moment_about: Point | None = Field(None, description="the reference point of moments [m] (default: the origin)")


Kind = TypeVar("Kind", bound=Condition)


def boundary_kind(model: type[Kind]) -> type[Kind]:
    """Register the table of a kind; raises ValueError for a kind that is registered already."""
    for kind in kinds_of(model):
        if kind in BOUNDARY_KINDS:
            raise ValueError(f"boundary kinds: expected one of the name {kind!r}, found two")
        BOUNDARY_KINDS[kind] = model
    return model


class OnSurface(Condition, Reporting):
    """A condition on a body's surface: on a plane that bounds it, or in a named region."""

    exactly_one: ClassVar[tuple[tuple[str, ...], ...]] = (("plane", "where"),)
    needs_bounding_plane: ClassVar[bool] = True
    plane: Plane | None = Field(None, description="a plane such as 'Y = 0' that bounds the body")
    where: RegionName | None = Field(None, description="a named region, or a group of a mesh")
    body: Name | None = Field(None, description="the body it acts on (default: all)")


@boundary_kind
class Pressure(OnSurface, Timed):
    """Pressure [Pa] on a body's surface: on a plane that bounds it, in a named region, a box or a ball.

    On a plane and in a region it acts on the deformed surface, against its present normal: -p da = -p cof(F) dA. In
    peridynamics it is per reference area, on all of the surface within the region, box or ball, which must contain all
    particles within two horizons of that surface and no other free surface.
    """

    exactly_one: ClassVar = (("plane", "where", "box", "ball"),)
    kind: Literal["pressure"]
    box: Box | None = None
    ball: Sphere | None = None
    pressure: Scalar = Field(description="a formula in X, Y, Z, t [Pa]")


@boundary_kind
class Spring(OnSurface):
    """Springs and dashpots from the surface to rest: a traction -k u - c v per reference area.

    along: "normal" for the component along the reference normal only
    """

    kind: Literal["spring"]
    stiffness: NotNegative = Field(0.0, description="stiffness per reference area [Pa/m]")
    damping: NotNegative = Field(0.0, description="damping per reference area [Pa s/m]")
    along: Literal["all", "normal"] = Field("all", description="all directions, or the normal only")

    @model_validator(mode="after")
    def _has_a_coefficient(self) -> Spring:
        if not self.stiffness and not self.damping:
            reject((("stiffness",), "a stiffness or a damping above 0", NOTHING))
        return self


@boundary_kind
class Traction(OnSurface, Timed):
    """Traction [Pa] per reference area on a plane that bounds the body, or on its surface in a named region."""

    kind: Literal["traction"]
    traction: Vector = Field(description="a formula in X, Y, Z, t for each component [Pa]")


@boundary_kind
class Support(OnSurface):
    """A support on a plane that bounds the body, or in a named region.

    fixed          no velocity
    roller         no velocity along the normal, no shear traction: a plane of symmetry
    antisymmetric  no velocity in the plane, no normal traction: the image moves with v' = -R v, R the reflection

    With `mirror` the particles have images beyond the plane; without it only the particles on the plane are clamped,
    with first-order errors near the plane. In a named region no particle has images: "fixed" holds all particles there,
    "roller" and "antisymmetric" those of the body's surface there, along and across its normal.

    A plane with a `velocity` moves: particles on it have its velocity in the components that the kind holds. Images
    follow the plane and move with v' = Q v + 2 w, which is exact for a linear velocity.
    """

    kind: Literal["fixed", "roller", "antisymmetric"]
    mirror: bool = Field(
        True, description="particles have images beyond the plane; without images only those on the plane are clamped"
    )

    velocity: VectorOrFree | None = Field(
        None,
        description="of the plane [m/s], formulas in t, 'free' for components that the kind does not hold (default: 0)",
    )

    @model_validator(mode="before")
    @classmethod
    def _no_images(cls, table: Any) -> Any:
        """In a named region `mirror` is false by default."""
        return {"mirror": False} | table if isinstance(table, dict) and table.get("where") is not None else table

    def holds(self, dimension: int) -> np.ndarray:
        """Which components (d,) of the velocity are held."""
        assert self.plane is not None
        normal = np.arange(dimension) == self.plane.axis
        if self.kind == "fixed":
            return np.ones(dimension, bool)
        return normal if self.kind == "roller" else ~normal

    @model_validator(mode="after")
    def _consistent(self) -> Support:
        if self.where is not None and self.mirror:
            reject((("mirror",), "false in a named region (images are beyond a plane)", self.mirror))
        if self.velocity is None:
            return self
        if self.plane is None or not self.mirror:
            reject((("velocity",), "no such key without images beyond a plane", self.velocity.sources))
        for i, (formula, held) in enumerate(zip(self.velocity, self.holds(len(self.velocity)))):
            if held != (formula is not None):
                expected = "a formula in t" if held else "'free', because this kind does not hold this component"
                reject((("velocity", i), expected, "free" if formula is None else formula.source))
            elif formula is not None and set(formula.names) - {"t"}:
                reject((("velocity", i), "a formula in t only", formula.source))
        return self


class RegionCondition(Condition):
    """A condition on a named region, a plane, a box, a ball, or the particle nearest to a point."""

    exactly_one: ClassVar = (("where", "plane", "box", "ball", "point"),)
    where: RegionName | None = Field(None, description="a named region, or a group of a mesh")
    plane: Plane | None = Field(None, description="a plane such as 'Y = 0': the particles on it")
    box: Box | None = None
    ball: Sphere | None = None
    point: Point | None = Field(None, description="a point [m]: the particle nearest to it")
    body: Name | None = Field(None, description="the body it acts on (default: all)")


class MotionCondition(Condition):
    """A condition that prescribes motion.

    quantity: "velocity" [m/s] or "displacement" [m]; `prescribed` gives its values over time. Components that are None
    in its formulas are free.
    """

    quantity: ClassVar[Literal["velocity", "displacement"]] = "displacement"


@boundary_kind
class PrescribedVelocity(RegionCondition, Reporting, MotionCondition):
    """Velocity [m/s] prescribed over a region; components that are "free" follow the equation of motion."""

    quantity: ClassVar[Literal["velocity", "displacement"]] = "velocity"
    kind: Literal["velocity"]
    velocity: VectorOrFree = Field(description="a formula in X, Y, Z, t or 'free' for each component [m/s]")


@boundary_kind
class PrescribedDisplacement(RegionCondition, Timed, Reporting, MotionCondition):
    """Displacement [m] prescribed over a region; components that are "free" follow the equation of motion."""

    kind: Literal["displacement"]
    displacement: VectorOrFree = Field(description="a formula in X, Y, Z, t or 'free' for each component [m]")


@boundary_kind
class FictitiousLayer(Timed, Reporting, MotionCondition):
    """A fictitious layer with prescribed displacement: the part of a body on one side of a plane.

    With the width of the horizon it holds the rest of the body at the plane with a first-order error (Galadima et al.,
    section 8).
    """

    kind: Literal["layer"]
    plane: Plane = Field(description="a plane such as 'Y = 0' through the body")
    side: Literal["above", "below"] = Field(description="'above' or 'below': where along the plane's axis the layer is")
    body: Name | None = Field(None, description="the body it acts on (default: all)")
    displacement: VectorOrFree | None = Field(None, description="a formula or 'free' per component [m] (default: 0)")

    @property
    def region(self) -> Region:
        """One side of the plane."""
        return AtPlane(self.plane, self.side)

    @property
    def prescribed(self) -> LoadHistory:
        """The displacement in time."""
        return LoadHistory(self.displacement or FormulaVector([Formula(0.0)] * 3), self)


@boundary_kind
class Rotation(RegionCondition, Reporting, MotionCondition):
    """Rotation of a region by an angle [rad] about an axis through a point, which may be displaced [m].

    axis: direction in 3-D, right-handed; in 2-D the axis points out of the plane
    """

    kind: Literal["rotation"]
    centre: Point = Field(description="a point of the axis [m]")
    axis: Point | None = Field(None, description="the direction of the axis, in 3-D")
    angle: Scalar = Field(description="a formula in t, 0 at the start [rad]")
    displacement: Vector | None = Field(None, description="of the axis, formulas in t, 0 at the start [m]")

    @model_validator(mode="after")
    def _about_an_axis(self, info: ValidationInfo) -> Rotation:
        dimension = dimension_of(info) or len(self.centre)
        if dimension == 3 and (self.axis is None or not np.linalg.norm(self.axis) > 0.0):
            reject((("axis",), "a direction that is not zero", NOTHING if self.axis is None else self.axis))
        if dimension == 2 and self.axis is not None:
            reject((("axis",), "no such key in 2-D (the axis points out of the plane)", self.axis))
        moved = [(("displacement", i), one) for i, one in enumerate(self.displacement or ())]
        for key, formula in [(("angle",), self.angle), *moved]:
            if set(formula.names) - {"t"}:
                reject((key, "a formula in t only", formula.source))
            start = float(formula.evaluate(np.zeros((1, 3)))[0])
            if abs(start) > 1e-12:
                reject((key, "a formula that is 0 at the start", start))
            try:
                formula.rate()
            except ValueError as error:
                reject((key, f"a formula that can be differentiated in time ({error})", formula.source))
        return self

    @property
    def prescribed(self) -> RigidMotion:
        """The displacement in time; `prescribed.velocity()` is its velocity."""
        return RigidMotion(self.centre, self.axis, self.angle, self.displacement)


@boundary_kind
class Wall(Condition, Reporting):
    """A rigid plane with a constant velocity; all bodies are on one side of it."""

    on_particles: ClassVar[bool] = False
    body: ClassVar[None] = None  # type: ignore[misc]
    kind: Literal["wall"]
    plane: Plane = Field(description="a plane such as 'Y = 0': where the wall is at time 0")
    side: Literal["above", "below"] = Field(description="the side of the plane, along its axis, with the bodies")
    velocity: Point | None = Field(None, description="the velocity of the wall [m/s] (default: 0)")
    contact: Literal["frictionless", "sticking"] = Field(
        "frictionless",
        description='bodies take the wall\'s normal velocity ("frictionless") or its whole velocity ("sticking")',
    )


class OnHeatedPlane(Condition):
    """A thermal condition at a plane."""

    on_particles: ClassVar[bool] = False
    plane: Plane = Field(description="a plane such as 'Y = 0' that bounds the body")
    body: Name | None = Field(None, description="the body it acts on (default: all)")


@boundary_kind
class PrescribedTemperature(OnHeatedPlane):
    """Temperature [K] on a plane."""

    kind: Literal["temperature"]
    temperature: Scalar = Field(description="a formula in X, Y, Z, t [K]")

    @model_validator(mode="after")
    def _absolute(self) -> PrescribedTemperature:
        if self.temperature.is_constant and self.temperature.evaluate(np.zeros((1, 3)))[0] < 0.0:
            reject((("temperature",), "an absolute temperature", self.temperature.source))
        return self


@boundary_kind
class HeatFlux(OnHeatedPlane):
    """Heat [W/m^2] into a body through a plane that bounds it; planes without any condition are insulated."""

    kind: Literal["heat-flux"]
    heat_flux: Scalar = Field(description="a formula in X, Y, Z, t [W/m^2]")


@boundary_kind
class MicroHard(RegionCondition):
    """No plastic flow: v^p = 0 in a region; surfaces without it are micro-free (no micro-traction)."""

    kind: Literal["micro-hard"]


def union_of_kinds() -> Any:
    """The type of a boundary's table, of one of the registered kinds."""
    kinds: Any = Union[tuple(dict.fromkeys(BOUNDARY_KINDS.values()))]  # noqa: UP007
    return Annotated[kinds, Field(discriminator="kind")]


Boundary: Any = union_of_kinds()
