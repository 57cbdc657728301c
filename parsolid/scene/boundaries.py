"""Boundary conditions of a scene, told apart by their `kind`."""

from typing import ClassVar, Literal

from pydantic import Field, ValidationInfo, model_validator

from parsolid.scene.base_model import Plane, Point, SceneModel, by_kind, method_of, reject
from parsolid.scene.bodies import Name
from parsolid.scene.formulas import Formula, FormulaVector, Scalar, Vector, VectorOrFree
from parsolid.scene.load_histories import LoadHistory, Timed
from parsolid.scene.shapes import Box, Sphere
from parsolid.scene.walls import HeatFlux, PrescribedTemperature, Wall


class ParticleCondition(SceneModel):
    """A condition on the particles of a region."""

    on_particles: ClassVar[bool] = True


class Support(ParticleCondition):
    """A support on a plane that bounds the body.

    fixed          no velocity
    roller         no velocity along the normal, no shear traction: a plane of symmetry
    antisymmetric  no velocity in the plane, no normal traction: the image moves with v' = -R v, R the reflection

    With `mirror` the particles have images beyond the plane; without it the particles on the plane are clamped only, which
    leaves first-order errors beside the plane.
    """

    kind: Literal["fixed", "roller", "antisymmetric"]
    plane: Plane = Field(description="a plane such as 'Y = 0' that bounds the body")
    body: Name | None = None
    mirror: bool = True


class RegionCondition(ParticleCondition):
    """A condition on a region: a plane, a box, a ball, or the particle nearest to a point."""

    exactly_one: ClassVar = (("plane", "box", "ball", "point"),)
    plane: Plane | None = None
    box: Box | None = None
    ball: Sphere | None = None
    point: Point | None = None
    body: Name | None = None


class PrescribedVelocity(RegionCondition):
    """Velocity [m/s] prescribed over a region; components that are "free" follow the equation of motion."""

    kind: Literal["velocity"]
    velocity: VectorOrFree = Field(description="a formula in X, Y, Z, t or 'free' for each component [m/s]")


class PrescribedDisplacement(RegionCondition, Timed):
    """Displacement [m] prescribed over a region; components that are "free" follow the equation of motion."""

    kind: Literal["displacement"]
    displacement: VectorOrFree = Field(description="a formula in X, Y, Z, t or 'free' for each component [m]")

    @property
    def course(self) -> LoadHistory:
        """The displacement in time."""
        return LoadHistory(self.displacement, self)


class FictitiousLayer(ParticleCondition, Timed):
    """A layer of fictitious particles, the part of a body on one side of a plane through it, with prescribed displacement [m].

    As wide as the horizon it holds the rest of the body at the plane (Galadima et al., section 8), with an error of first order.
    """

    kind: Literal["layer"]
    plane: Plane = Field(description="a plane such as 'Y = 0' through the body")
    side: Literal["above", "below"] = Field(description="'above' or 'below': where along the plane's axis the layer is")
    body: Name | None = None
    displacement: VectorOrFree | None = Field(
        None, description="a formula or 'free' for each component [m], zero unless given"
    )

    @property
    def course(self) -> LoadHistory:
        """The displacement in time."""
        return LoadHistory(self.displacement or FormulaVector([Formula(0.0)] * 3), self)


class Traction(ParticleCondition, Timed):
    """Traction [Pa] per reference area on a plane that bounds the body."""

    kind: Literal["traction"]
    plane: Plane = Field(description="a plane such as 'Y = 0' that bounds the body")
    body: Name | None = None
    traction: Vector = Field(description="a formula in X, Y, Z, t for each component [Pa]")

    @property
    def course(self) -> LoadHistory:
        """The traction in time."""
        return LoadHistory(self.traction, self)


_KINDS = (
    Support,
    PrescribedVelocity,
    PrescribedDisplacement,
    FictitiousLayer,
    Traction,
    Wall,
    PrescribedTemperature,
    HeatFlux,
)
Boundary = by_kind(*_KINDS, known="boundaries")


class Loads(Timed):
    """Loads on all bodies: a force [N/m^3] per reference volume, an acceleration [m/s^2], heat [W/m^3] per reference volume.

    history and jumps are those of the force and the acceleration.
    manufactured: also the body force under which the exact solution of the scene's reference holds.
    """

    body_force: Vector | None = None
    acceleration: Vector | None = None
    heat_source: Scalar | None = None
    manufactured: Literal[True] | None = None

    @model_validator(mode="after")
    def _known_to_method(self, info: ValidationInfo) -> "Loads":
        method = method_of(info)
        stated = self.model_fields_set - Timed.model_fields.keys() if method else ()
        unknown = [key for key in stated if key not in method.loads]
        reject(*(((key,), f"one of {', '.join(method.loads)} with this method", key) for key in unknown))
        return self
