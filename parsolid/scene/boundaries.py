"""Boundary conditions of a scene: the keys of each kind's table, and the type of all of them.

What a kind does to particles is in the package `boundary`; which kinds a method takes stands in its settings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar, Union

import numpy as np
from pydantic import Field, ValidationInfo, WrapValidator, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import (
    Name,
    NotNegative,
    Plane,
    Point,
    SceneModel,
    check_kind,
    dimension_of,
    kinds_of,
    method_of,
    reject,
)
from parsolid.scene.formulas import Formula, FormulaVector, Scalar, Vector, VectorOrFree
from parsolid.scene.load_histories import LoadHistory, RigidMotion, Timed
from parsolid.scene.named_regions import RegionName
from parsolid.scene.regions import Beside, InBall, InBox, Named, NearestTo, OnPlane, Region
from parsolid.scene.shapes import Box, Sphere
from parsolid.scene.validation_errors import NOTHING

# kind -> the model of its table
BOUNDARY_KINDS: dict[str, type[Condition]] = {}


class Condition(SceneModel):
    """A boundary condition with a literal field `kind`; its keys are those of its table in the scene.

    on_particles: it is about particles of a region, else about nodes of a grid, wherever particles are;
    needs_bounding_plane: its plane must bound a body.
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
        """The key `where` of kinds that hold in regions with a name."""
        return getattr(self, "where", None)

    @property
    def reports(self) -> str | None:
        """The name under which its force, moment and work are told, None unless that is asked for."""
        return getattr(self, "name", None) if getattr(self, "reaction", None) else None

    @property
    def region(self) -> Region:
        """Where it holds: the one of its places that is given, unless a kind says otherwise."""
        stated: dict[str, Any] = {key: getattr(self, key, None) for key in ("box", "ball", "point")}
        if self.region_name is not None:
            return Named(self.region_name)
        if self.plane is not None:
            return OnPlane(self.plane)
        if stated["box"] is not None:
            return InBox(stated["box"].lower, stated["box"].upper)
        if stated["ball"] is not None:
            return InBall(stated["ball"].centre, stated["ball"].radius)
        return NearestTo(stated["point"])

    @property
    def formulas(self) -> dict[str, FormulaVector]:
        """All formulas, by their key."""
        stated = {key: getattr(self, key) for key in type(self).model_fields}
        vectors = {key: FormulaVector((one,)) if isinstance(one, Formula) else one for key, one in stated.items()}
        return {key: one for key, one in vectors.items() if isinstance(one, FormulaVector)}

    @property
    def prescribed(self) -> Any:
        """The values in time of the only formulas, a `LoadHistory`; a `RigidMotion` of a rotation."""
        (formulas,) = self.formulas.values()
        return LoadHistory(formulas, self if isinstance(self, Timed) else None)


class Reporting(SceneModel):
    """Keys of conditions that can tell what force they take.

    reaction: columns name.force, name.moment (about `moment_about`, the origin unless given) and name.work in the
    history
    """

    name: Name | None = Field(None, description="what its forces are called in history.csv")
    reaction: Literal[True] | None = Field(None, description="force, moment and work in the history, by the name")
    moment_about: Point | None = Field(None, description="the point of the moments [m], the origin unless given")

    @model_validator(mode="after")
    def _named(self) -> Reporting:
        if self.reaction and self.name is None:
            reject((("reaction",), "a name, for the columns of the history", NOTHING))
        if self.moment_about is not None and not self.reaction:
            reject((("moment_about",), "no such key without reaction = true", self.moment_about))
        return self


Kind = TypeVar("Kind", bound=Condition)


def boundary_kind(model: type[Kind]) -> type[Kind]:
    """Enter a kind in the table; raises ValueError for one that is there."""
    for kind in kinds_of(model):
        if kind in BOUNDARY_KINDS:
            raise ValueError(f"boundary kinds: expected one of the name {kind!r}, found two")
        BOUNDARY_KINDS[kind] = model
    return model


class OnSurface(Condition, Reporting):
    """A condition on a body's surface: on a plane that bounds it, or in a region with a name."""

    exactly_one: ClassVar[tuple[tuple[str, ...], ...]] = (("plane", "where"),)
    needs_bounding_plane: ClassVar[bool] = True
    plane: Plane | None = Field(None, description="a plane such as 'Y = 0' that bounds the body")
    where: RegionName | None = Field(None, description="a region with a name, or a group of a mesh")
    body: Name | None = Field(None, description="only this body is meant; all of them unless given")


@boundary_kind
class Pressure(OnSurface, Timed):
    """Pressure [Pa] on a body's surface: on a plane that bounds it, in a region with a name, in a box or a ball.

    On a plane and in a region it is on the deformed surface, against its present normal: -p da = -p cof(F) dA. In
    peridynamics it is per reference area, on all of the surface within the region, box or ball, which must hold what
    lies within two horizons of that surface, and no other free surface.
    """

    exactly_one: ClassVar = (("plane", "where", "box", "ball"),)
    kind: Literal["pressure"]
    box: Box | None = None
    ball: Sphere | None = None
    pressure: Scalar = Field(description="a formula in X, Y, Z, t [Pa]")

    @model_validator(mode="after")
    def _known_place(self, info: ValidationInfo) -> Pressure:
        method: Any = method_of(info)
        known, (places,) = getattr(method, "pressed", ()), self.exactly_one
        wrong = [key for key in places if getattr(self, key) is not None and key not in known]
        if method is not None and wrong:
            reject(((wrong[0],), f"one of {', '.join(known)} with this method", Phrase(wrong[0])))
        return self


@boundary_kind
class Spring(OnSurface):
    """Springs and dashpots from the surface to rest: a traction -k u - c v per reference area.

    along: "normal" for the part along the reference normal alone
    """

    kind: Literal["spring"]
    stiffness: NotNegative = Field(0.0, description="stiffness per reference area [Pa/m]")
    damping: NotNegative = Field(0.0, description="damping per reference area [Pa s/m]")
    along: Literal["all", "normal"] = Field("all", description="all directions, or the normal alone")

    @model_validator(mode="after")
    def _has_a_coefficient(self) -> Spring:
        if not self.stiffness and not self.damping:
            reject((("stiffness",), "a stiffness or a damping above 0", NOTHING))
        return self


@boundary_kind
class Traction(OnSurface, Timed):
    """Traction [Pa] per reference area on a plane that bounds the body, or on its surface in a region with a name."""

    kind: Literal["traction"]
    traction: Vector = Field(description="a formula in X, Y, Z, t for each component [Pa]")


@boundary_kind
class Support(OnSurface):
    """A support on a plane that bounds the body, or in a region with a name.

    fixed          no velocity
    roller         no velocity along the normal, no shear traction: a plane of symmetry
    antisymmetric  no velocity in the plane, no normal traction: the image moves with v' = -R v, R the reflection

    With `mirror` the particles have images beyond the plane; without it the particles on the plane are clamped only,
    which leaves first-order errors beside the plane. In a region with a name no particle has images: "fixed" holds all
    particles there, "roller" and "antisymmetric" those of the body's surface there, along and across its normal.

    A plane with a `velocity` moves: the components that the kind holds are those of the plane. Images lie at the
    present place of the plane and move with v' = Q v + 2 w, which is exact for a linear velocity.
    """

    kind: Literal["fixed", "roller", "antisymmetric"]
    mirror: bool = Field(
        True, description="particles have images beyond the plane; without them those on the plane are clamped only"
    )

    velocity: VectorOrFree | None = Field(
        None,
        description="of the plane [m/s], formulas in t, 'free' where the kind holds nothing; at rest unless given",
    )

    @model_validator(mode="before")
    @classmethod
    def _no_images(cls, table: Any) -> Any:
        """Regions with a name have no images."""
        return {"mirror": False} | table if isinstance(table, dict) and table.get("where") is not None else table

    def holds(self, dimension: int) -> np.ndarray:
        """Which components (d,) of the velocity the plane has."""
        assert self.plane is not None
        normal = np.arange(dimension) == self.plane.axis
        return np.array({"roller": normal, "fixed": normal | True, "antisymmetric": ~normal}[self.kind])

    @model_validator(mode="after")
    def _sound(self) -> Support:
        if self.where is not None and self.mirror:
            reject((("mirror",), "false in a region with a name (images are beyond a plane)", self.mirror))
        if self.velocity is None:
            return self
        if self.plane is None or not self.mirror:
            reject((("velocity",), "no such key without images beyond a plane", self.velocity.sources))
        for i, (one, held) in enumerate(zip(self.velocity, self.holds(len(self.velocity)))):
            if held != (one is not None):
                expected = "a formula in t" if held else "'free', as this kind holds nothing there"
                reject((("velocity", i), expected, "free" if one is None else one.source))
            elif one is not None and set(one.names) - {"t"}:
                reject((("velocity", i), "a formula in t alone", one.source))
        return self


class RegionCondition(Condition):
    """A condition on a region: one with a name, a plane, a box, a ball, or the particle nearest to a point."""

    exactly_one: ClassVar = (("where", "plane", "box", "ball", "point"),)
    where: RegionName | None = Field(None, description="a region with a name, or a group of a mesh")
    plane: Plane | None = Field(None, description="a plane such as 'Y = 0'; particles on it are meant")
    box: Box | None = None
    ball: Sphere | None = None
    point: Point | None = Field(None, description="the particle nearest to this point [m] is meant")
    body: Name | None = Field(None, description="only this body is meant; all of them unless given")


class MotionCondition(Condition):
    """A condition that prescribes motion; quantity: "velocity" [m/s] or "displacement" [m], whose values in time are
    `prescribed`. Components that are None in its formulas are free."""

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
    """A layer of fictitious particles, the part of a body on one side of a plane, with prescribed displacement.

    As wide as the horizon it holds the rest of the body at the plane (Galadima et al., section 8), with an error of
    first order.
    """

    kind: Literal["layer"]
    plane: Plane = Field(description="a plane such as 'Y = 0' through the body")
    side: Literal["above", "below"] = Field(description="'above' or 'below': where along the plane's axis the layer is")
    body: Name | None = Field(None, description="only this body is meant; all of them unless given")
    displacement: VectorOrFree | None = Field(
        None, description="a formula or 'free' for each component [m], zero unless given"
    )

    @property
    def region(self) -> Region:
        """One side of the plane."""
        return Beside(self.plane, self.side)

    @property
    def prescribed(self) -> LoadHistory:
        """The displacement in time."""
        return LoadHistory(self.displacement or FormulaVector([Formula(0.0)] * 3), self)


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
    def _about_an_axis(self, info: ValidationInfo) -> Rotation:
        dimension = dimension_of(info) or len(self.centre)
        if dimension == 3 and (self.axis is None or not np.linalg.norm(self.axis) > 0.0):
            reject((("axis",), "a direction that is not zero", NOTHING if self.axis is None else self.axis))
        if dimension == 2 and self.axis is not None:
            reject((("axis",), "no such key in 2-D (the axis points out of the plane)", self.axis))
        moved = [(("displacement", i), one) for i, one in enumerate(self.displacement or ())]
        for key, formula in [(("angle",), self.angle), *moved]:
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
    def prescribed(self) -> RigidMotion:
        """The displacement in time; `prescribed.velocity()` is its velocity."""
        return RigidMotion(self.centre, self.axis, self.angle, self.displacement)


@boundary_kind
class Wall(Condition, Reporting):
    """A rigid plane that moves with a constant velocity, and on one side of which all bodies are."""

    on_particles: ClassVar[bool] = False
    body: ClassVar[None] = None  # type: ignore[misc]
    kind: Literal["wall"]
    plane: Plane = Field(description="a plane such as 'Y = 0': where the wall is at time 0")
    side: Literal["above", "below"] = Field(
        description="'above' or 'below': where along the plane's axis the bodies are"
    )
    velocity: Point | None = Field(None, description="the velocity of the wall [m/s], at rest unless given")
    contact: Literal["frictionless", "sticking"] = Field(
        "frictionless", description='"frictionless": the wall\'s normal velocity; "sticking": its whole velocity'
    )


class OnHeatedPlane(Condition):
    """A condition on the heat of bodies at a plane."""

    on_particles: ClassVar[bool] = False
    plane: Plane = Field(description="a plane such as 'Y = 0' that bounds the body")
    body: Name | None = Field(None, description="only this body is meant; all of them unless given")


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


def of_method(value: Any, handler: Any, info: ValidationInfo) -> Any:
    """Refuse kinds that the scene's method does not know, or that of the body which a table names."""
    if isinstance(value, dict):
        method, kind = method_of(info, value), value.get("kind")
        known = [one for one in getattr(method, "boundaries", BOUNDARY_KINDS) if one in BOUNDARY_KINDS]
        why = getattr(method, "refused", {}).get(kind, "") if isinstance(kind, str) else ""
        check_kind(value, info, BOUNDARY_KINDS, known, why)
    return handler(value)


def union_of_kinds() -> Any:
    """The type of a boundary's table, of one of the kinds that are entered."""
    kinds: Any = Union[tuple(dict.fromkeys(BOUNDARY_KINDS.values()))]  # noqa: UP007
    return Annotated[kinds, Field(discriminator="kind"), WrapValidator(of_method)]


Boundary: Any = union_of_kinds()
