"""Tables of rigid tools: shapes in contact with bodies, with prescribed motion or with mass."""

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import (
    AXES,
    Detail,
    Direction,
    FaultDetail,
    Name,
    NotNegative,
    OneOrMore,
    Point,
    Positive,
    SceneModel,
    dimension_of,
    reject,
)
from parsolid.scene.formulas import Scalar, Vector
from parsolid.scene.shapes import AxisName, Box, MeshFile, OneShape, Sphere
from parsolid.scene.validation_errors import NOTHING

# vectors in a tool's columns of the history
_WATCHED = ("force", "moment", "place", "rotation")


class HalfSpaceOfTool(SceneModel):
    """The half-space below a plane; bodies are on the side of its normal."""

    point: Point = Field(description="a point of the plane [m]")
    normal: Direction = Field(description="the normal of any length, towards the bodies")


class CylinderOfTool(SceneModel):
    """A solid circular cylinder from the centre `base` of one end along `axis`; infinite without a length."""

    base: Point = Field(description="the centre of the lower end, or a point of the axis [m]")
    axis: AxisName = Field(description="the direction of the axis")
    radius: Positive = Field(description="the radius [m]")
    length: Positive | None = Field(None, description="the length [m] (default: infinite)")


class ToolShape(OneShape):
    """Exactly one shape of a tool."""

    exactly_one: ClassVar = (("plane", "sphere", "cylinder", "box", "mesh"),)
    plane: HalfSpaceOfTool | None = None
    sphere: Sphere | None = None
    cylinder: CylinderOfTool | None = None
    box: Box | None = None
    mesh: MeshFile | None = None

    @property
    def unbounded(self) -> bool:
        """Whether it is infinite."""
        return self.kind == "plane" or (self.cylinder is not None and self.cylinder.length is None)

    @model_validator(mode="after")
    def _fits_dimension(self, info: ValidationInfo) -> "ToolShape":
        dimension = dimension_of(info)
        if dimension in (1, 2) and self.kind == "cylinder":
            reject((("cylinder",), "a shape of this dimension (a disc is a sphere)", "cylinder"))
        if dimension == 1 and self.kind == "mesh":
            reject((("mesh",), "a shape of 2-D or 3-D", "mesh"))
        return self


class Motion(SceneModel):
    """Motion as formulas of the time t."""

    only_with: ClassVar = (("about", "rate"),)
    velocity: Vector | None = Field(None, description="a formula in t for each component [m/s]")
    rate: Scalar | None = Field(
        None,
        description="angular velocity [rad/s] about the axis (Z in 2-D) through `about` (default: the tool's position)",
    )
    axis: Point | None = Field(None, description="the direction of the axis of rotation, in 3-D")
    about: Point | None = Field(None, description="a point of the axis of rotation at time 0 [m]")

    @property
    def jumps(self) -> set[float]:
        """Times [s] at which the velocity or the angular velocity jumps."""
        formulas = (*(self.velocity or ()), *([] if self.rate is None else [self.rate]))
        return {time for formula in formulas for time in formula.jumps}

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> "Motion":
        details: list[Any] = []
        dimension = dimension_of(info) or 3
        formulas = [*(self.velocity or ()), *([] if self.rate is None else [self.rate])]
        if any(set(formula.names) - {"t"} for formula in formulas):
            details.append(((), "formulas in t alone", Phrase("one of X, Y, Z")))
        if self.velocity is None and self.rate is None:
            details.append(((), "velocity, rate or both", Phrase("none")))
        if self.rate is not None and dimension == 1:
            details.append((("rate",), "no such key in 1-D", self.rate.source))
        if self.rate is not None and dimension == 3 and not any(self.axis or ()):
            details.append((("axis",), "a direction, for a rotation in 3-D", self.axis or NOTHING))
        if self.axis is not None and (self.rate is None or dimension < 3):
            details.append((("axis",), "no such key but with a rate in 3-D", self.axis))
        reject(*details)
        return self


class Tool(SceneModel):
    """A rigid body in contact with bodies: at rest, with a prescribed motion, or with a mass and equations of motion.

    velocity, spin: at time 0 [m/s], [rad/s] (a number in 2-D)
    """

    at_most_one: ClassVar = (("motion", "mass"),)
    only_with: ClassVar = (("inertia", "mass"), ("free", "mass"), ("velocity", "mass"), ("spin", "mass"))
    name: Name = Field(description="a name without '.' and ',', for the columns of the history")
    shape: ToolShape
    bodies: Annotated[list[str], Field(min_length=1)] | None = Field(
        None, description="names of bodies in contact with it (default: all)"
    )
    friction: NotNegative = Field(0.0, description="Coulomb's coefficient")
    stiffness: Annotated[float, Field(ge=0.01, le=100)] = Field(
        1.0, description="contact stiffness: the pressure is stiffness M/h times the penetration, M the P-wave modulus"
    )
    motion: Motion | None = None
    mass: Positive | None = Field(
        None, description="of the tool [kg], per metre of thickness in 2-D; gravity of [loads] then acts on it, too"
    )
    inertia: Annotated[list[Positive], Field(min_length=1), OneOrMore] | None = Field(
        None,
        description="about the centre [kg m^2]: a number in 2-D, three about X, Y, Z in 3-D (default: of the shape)",
    )
    free: list[Literal["X", "Y", "Z", "rotation"]] | None = Field(
        None, description='components that follow the forces: "X", "Y", "Z", "rotation" (default: all)'
    )
    velocity: Point | None = Field(None, description="at time 0 [m/s]")
    spin: Annotated[list[float], OneOrMore] | None = Field(None, description="initial angular velocity [rad/s]")

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> "Tool":
        dimension = dimension_of(info) or 3
        if dimension == 1 and self.friction:
            reject((("friction",), "no friction in 1-D, where nothing slides", self.friction))
        if self.mass is None:
            return self
        details, turns = list[Any](), self.turns(dimension)
        count = {2: 1, 3: 3}.get(dimension, 0)
        for key in ("inertia", "spin"):
            value = getattr(self, key)
            if value is not None and not turns:
                details.append(((key,), "no such key for a tool that does not turn", value))
            elif value is not None and len(value) != count:
                details.append(((key,), f"{count} numbers in {dimension}-D", value))
        if self.free is not None and "rotation" in self.free and (self.shape.unbounded or dimension == 1):
            details.append((("free",), "no rotation of an endless shape, or in 1-D", self.free))
        beyond = [axis for axis in self.free or () if axis in AXES[dimension:]]
        details += [(("free",), f"axes of {dimension}-D", axis) for axis in beyond]
        for axis, speed in zip(AXES, self.velocity or ()):
            if speed and axis not in self.translations(dimension):
                details.append((("velocity",), f"no velocity along {axis}, which is not free", self.velocity))
        reject(*details)
        return self

    def translations(self, dimension: int) -> tuple[str, ...]:
        """Axes along which it can move freely."""
        axes = AXES[:dimension]
        return tuple(axis for axis in axes if self.free is None or axis in self.free)

    def turns(self, dimension: int) -> bool:
        """Whether it can rotate freely."""
        if self.shape.unbounded or dimension == 1:
            return False
        return self.free is None or "rotation" in self.free

    def columns(self, dimension: int) -> list[str]:
        """Columns of the history: force [N] and moment [N m] about its position, position [m] and rotation [rad]."""
        axes = [axis.lower() for axis in AXES[:dimension]]
        around = {1: [], 2: [""], 3: ["_x", "_y", "_z"]}[dimension]
        along = [f"_{axis}" for axis in axes]
        suffixes = {"force": along, "moment": around, "place": along, "rotation": around}
        return [f"{self.name}.{what}{suffix}" for what in _WATCHED for suffix in suffixes[what]]


def tool_faults(scene: Any) -> list[FaultDetail]:
    """Faults of names that a tool shares with a probe or another tool."""
    faults: list[FaultDetail] = []
    taken = {probe.name for probe in scene.probes}
    for i, tool in enumerate(scene.tools):
        if tool.name in taken:
            expected = "a name other than that of a probe or tool before it"
            faults.append((("tools", i, "name"), expected, tool.name, "repeated"))
        taken.add(tool.name)
    return faults


def tool_motion_faults(scene: Any) -> list[Detail]:
    """Faults of tools with methods: equilibrium, methods without motion, motion across the axis in axisymmetry."""
    details: list[Detail] = []
    for system in scene.systems:
        names, method = {scene.bodies[number].name for number in system.bodies}, system.settings
        tools = [(i, one) for i, one in enumerate(scene.tools) if one.bodies is None or names.intersection(one.bodies)]
        if tools and getattr(getattr(method, "solution", None), "kind", None) == "quasi-static":
            expected = 'method.solution.kind = "explicit" (equilibrium knows no impulses)'
            details.append((("tools",), expected, len(tools)))
        if tools and not getattr(method, "motion", True):
            details.append((("tools",), "method.motion = true", len(tools)))
        if getattr(method, "geometry", None) != "axisymmetric":
            continue
        for i, tool in tools:
            motion = tool.motion
            if motion is not None and motion.rate is not None:
                details.append((("tools", i, "motion", "rate"), "no rotation in axisymmetry", motion.rate.source))
            if motion is not None and motion.velocity is not None:
                radial = motion.velocity[0]
                if not radial.is_constant or radial.evaluate(np.zeros((1, 2)))[0] != 0.0:
                    where = ("tools", i, "motion", "velocity", 0)
                    details.append((where, "0 along X, which is the radius", radial.source))
            if tool.mass is not None and tool.free != ["Y"]:
                details.append((("tools", i, "free"), '["Y"] in axisymmetry', tool.free or NOTHING))
    return list({place: (place, expected, found) for place, expected, found in details}.values())
