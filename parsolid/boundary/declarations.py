"""What the boundary conditions of a scene mean: plain things, each of one type, that methods take or refuse by type."""

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeVar

from parsolid.boundary.mirror_planes import MirrorPlane
from parsolid.collective import SolverError
from parsolid.scene.base_model import Plane
from parsolid.scene.boundaries import Condition
from parsolid.scene.formulas import Formula
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.rigid_motion import RigidMotion
from parsolid.scene.schema import Scene


@dataclass(frozen=True)
class Declared:
    """One thing that a condition means.

    key: the condition's place in the scene; where: the condition itself, with its body and its region; sort: which of
    several of its type it is.
    """

    name: ClassVar[str]
    key: str
    where: Condition

    @property
    def sort(self) -> str:
        """The kind of a plane, the quantity of a motion."""
        return ""


@dataclass(frozen=True)
class Support(Declared):
    """A plane that holds some components of what lies on it; mirrored: with images beyond it."""

    name: ClassVar[str] = "a support"
    plane: MirrorPlane
    mirrored: bool

    @property
    def sort(self) -> str:
        return self.plane.kind


@dataclass(frozen=True)
class HeldRegion(Declared):
    """Particles of a region with a name that do not move, or not along or across the normal of the surface there."""

    name: ClassVar[str] = "a support in a region"
    kind: str

    @property
    def sort(self) -> str:
        return self.kind


@dataclass(frozen=True)
class PrescribedMotion(Declared):
    """A velocity [m/s] or displacement [m] in a region; the last one holds; turn: the motion of a rotation."""

    name: ClassVar[str] = "a prescribed motion"
    quantity: Literal["velocity", "displacement"]
    course: LoadHistory | RigidMotion
    turn: RigidMotion | None = None

    @property
    def sort(self) -> str:
        return self.quantity


@dataclass(frozen=True)
class SurfaceTraction(Declared):
    """A traction [Pa] on a plane that bounds a body."""

    name: ClassVar[str] = "a traction"
    plane: Plane
    course: LoadHistory


@dataclass(frozen=True)
class RegionTraction(Declared):
    """A traction [Pa] on the surface of bodies in a region with a name."""

    name: ClassVar[str] = "a traction in a region"
    course: LoadHistory


@dataclass(frozen=True)
class SurfacePressure(Declared):
    """A pressure [Pa] on the present surface; in peridynamics per reference area, in the condition's region."""

    name: ClassVar[str] = "a pressure"
    course: LoadHistory


@dataclass(frozen=True)
class SurfaceSpring(Declared):
    """Springs [Pa/m] and dashpots [Pa s/m] to rest, along the normal alone or in all directions."""

    name: ClassVar[str] = "springs"
    stiffness: float
    damping: float
    normal: bool


@dataclass(frozen=True)
class RigidWall(Declared):
    """A plane that moves with a velocity [m/s], on one side of which bodies stay."""

    name: ClassVar[str] = "a wall"
    plane: Plane
    side: Literal["above", "below"]
    velocity: list[float] | None
    sticking: bool


@dataclass(frozen=True)
class TemperaturePlane(Declared):
    """A plane at a temperature [K]."""

    name: ClassVar[str] = "a temperature"
    plane: Plane
    formula: Formula


@dataclass(frozen=True)
class SurfaceHeat(Declared):
    """Heat [W/m^2] into a body through a plane that bounds it."""

    name: ClassVar[str] = "a heat flux"
    plane: Plane
    course: LoadHistory


@dataclass(frozen=True)
class HeldMicroVelocity(Declared):
    """No micro-velocity in a region."""

    name: ClassVar[str] = "a held micro-velocity"


Some = TypeVar("Some", bound=Declared)


class Declarations:
    """All that the conditions of a scene mean, in the order of the scene; conditions call its verbs."""

    def __init__(self, scene: Scene, *takes: type[Declared]):
        """takes: the types that a method takes.

        Raises SolverError, the same on all ranks, for a condition that means another, or nothing.
        """
        self.scene, self.dimension, self.takes = scene, scene.dimension, takes
        self.bodies = {body.name: index for index, body in enumerate(scene.bodies) if body.name is not None}
        self.all: list[Declared] = []
        for index, boundary in enumerate(scene.boundaries):
            self._key = f"boundaries.{index}"
            before = len(self.all)
            boundary.declare(self)
            if len(self.all) == before:
                raise SolverError(f"{self._key}.kind: expected a condition with a meaning, found {boundary.kind!r}")

    def of(self, wanted: type[Some], *sorts: str) -> list[Some]:
        """All of a type; raises SolverError for one of another sort than these, where any are given."""
        found = [one for one in self.all if isinstance(one, wanted)]
        for one in found:
            if sorts and one.sort not in sorts:
                known = " or ".join(map(repr, sorts))
                raise SolverError(f"{one.key}.kind: expected {known} with this method, found {one.where.kind!r}")
        return found

    def _plane(self, where: Condition) -> Plane:
        if where.plane is None:
            raise SolverError(f"{self._key}.plane: expected a plane, found nothing")
        return where.plane

    def _add(self, one: Declared) -> None:
        if not isinstance(one, self.takes):
            known = ", ".join(kind.name for kind in self.takes)
            raise SolverError(
                f"{one.key}.kind: expected one that means {known} with this method, "
                f"found {one.where.kind!r}, which means {one.name}"
            )
        self.all.append(one)

    # --- verbs of the conditions --------------------------------------------------------------------------------

    def support(self, where: Condition, kind: str, mirrored: bool = True) -> None:
        """A mirror plane, or a clamp of the particles on it; kind: "fixed", "roller" or "antisymmetric"."""
        plane, body = self._plane(where), None if where.body is None else self.bodies[where.body]
        mirror = MirrorPlane(plane.axis, plane.offset, kind, body)
        self._add(Support(self._key, where, mirror, mirrored))

    def hold(self, where: Condition, kind: str) -> None:
        """A support without images in the condition's region; kind: "fixed", "roller" or "antisymmetric"."""
        self._add(HeldRegion(self._key, where, kind))

    def prescribe(
        self, where: Condition, quantity: Literal["velocity", "displacement"], course: LoadHistory | RigidMotion
    ) -> None:
        """Motion in the condition's region; components that are None in its formulas are free.

        Methods that take no displacement have the velocity of a rotation.
        """
        turn = course if isinstance(course, RigidMotion) else None
        if turn is not None and quantity not in self.scene.method.prescribes:
            quantity, course = "velocity", turn.velocity()
        self._add(PrescribedMotion(self._key, where, quantity, course, turn))

    def traction(self, where: Condition, course: LoadHistory) -> None:
        """A traction on the condition's plane, or on the surface in its region."""
        if where.plane is None:
            self._add(RegionTraction(self._key, where, course))
        else:
            self._add(SurfaceTraction(self._key, where, where.plane, course))

    def pressure(self, where: Condition, course: LoadHistory) -> None:
        """A pressure on a surface."""
        self._add(SurfacePressure(self._key, where, course))

    def springs(self, where: Condition, stiffness: float, damping: float, normal: bool) -> None:
        """Springs and dashpots on the surface."""
        self._add(SurfaceSpring(self._key, where, stiffness, damping, normal))

    def wall(
        self, where: Condition, side: Literal["above", "below"], velocity: list[float] | None, sticking: bool
    ) -> None:
        """A rigid wall that starts at the condition's plane."""
        self._add(RigidWall(self._key, where, self._plane(where), side, velocity, sticking))

    def temperature(self, where: Condition, formula: Formula) -> None:
        """A temperature on the condition's plane."""
        self._add(TemperaturePlane(self._key, where, self._plane(where), formula))

    def heat_flux(self, where: Condition, course: LoadHistory) -> None:
        """Heat through the condition's plane."""
        self._add(SurfaceHeat(self._key, where, self._plane(where), course))

    def hold_micro_velocity(self, where: Condition) -> None:
        """No micro-velocity in the condition's region."""
        self._add(HeldMicroVelocity(self._key, where))
