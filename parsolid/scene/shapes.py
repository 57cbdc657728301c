"""Tables of the shapes of bodies; lengths in m, angles in degrees."""

import os
from math import ceil, cos, floor, radians, sin
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from parsolid.scene.base_model import Point, Positive, SceneModel, dimension_of, mismatch, reject
from parsolid.scene.validation_errors import NOTHING

AxisName = Literal["X", "Y", "Z"]

# file name extensions of geometry, which Gmsh meshes: CAD, Gmsh's own format, and surfaces of triangles
CAD = (".step", ".stp", ".brep", ".brp", ".iges", ".igs")
GMSH_GEOMETRY = (".geo", ".geo_unrolled")
SURFACES = (".stl",)
GEOMETRY = CAD + GMSH_GEOMETRY + SURFACES

# lower and upper corner [m] of the box around a shape
Bounds = tuple[list[float], list[float]]


def _existing_file(path: str, info: ValidationInfo) -> str:
    """The absolute path of a file named relative to the scene's folder."""
    full = os.path.abspath(os.path.join((info.context or {}).get("folder", ""), path))
    if not os.path.isfile(full):
        raise mismatch("an existing file", full, "file")
    return full


def _existing_folder(path: str, info: ValidationInfo) -> str:
    """The absolute path of a folder named relative to the scene's folder, or to the working folder."""
    beside_scene = os.path.join((info.context or {}).get("folder", ""), path)
    for folder in (beside_scene, path):
        if os.path.isdir(folder):
            return os.path.abspath(folder)
    raise mismatch("an existing folder", os.path.abspath(beside_scene), "file")


ExistingFile = Annotated[str, AfterValidator(_existing_file)]
ExistingFolder = Annotated[str, AfterValidator(_existing_folder)]


class SolidShape(SceneModel):
    """A shape that is filled with a lattice."""

    def bounds(self) -> Bounds:
        """The bounding box."""
        raise NotImplementedError

    def lengths(self) -> list[float]:
        """Lengths [m] along the directions of its lattice."""
        lower, upper = self.bounds()
        return [high - low for low, high in zip(lower, upper)]

    def inside(self, places: np.ndarray, margin: np.ndarray | float) -> np.ndarray:
        """Which points (n, d) [m] are farther inside than a margin [m] or (n,) [m]; below 0 it enlarges the shape."""
        raise NotImplementedError


class Box(SolidShape):
    """An axis-aligned box (rectangle in 2-D) from `lower` to `upper`."""

    lower: Point = Field(description="the lower corner [m]")
    upper: Point = Field(description="the upper corner [m]")

    @model_validator(mode="after")
    def _extended(self) -> "Box":
        sides = enumerate(zip(self.lower, self.upper))
        reject(*((("upper", i), f"more than lower = {low:g}", high) for i, (low, high) in sides if not high > low))
        return self

    def bounds(self) -> Bounds:
        return [float(place) for place in self.lower], [float(place) for place in self.upper]

    def inside(self, places: np.ndarray, margin: np.ndarray | float) -> np.ndarray:
        margin = np.reshape(margin, (-1, 1))
        within = (places > np.array(self.lower) + margin) & (places < np.array(self.upper) - margin)
        return np.asarray(within.all(axis=1))


class PerforatedBox(Box):
    """A box without a round hole (in 3-D: a ball), which may be cut by the box's faces."""

    centre: Point = Field(description="the centre of the hole [m]")
    radius: Positive = Field(description="the radius of the hole [m]")

    def cells_outside_hole(self, numbers: list[int]) -> int:
        """The number of cells with their centres outside the hole, but at most 2; numbers: of cells along each axis.

        The two centres farthest from the hole decide.
        """
        farthest, least_loss = 0.0, float("inf")
        for low, high, centre, number in zip(self.lower, self.upper, self.centre, numbers):
            ends = sorted({0, 1, number - 2, number - 1} & set(range(number)))
            squares = sorted((low + (i + 0.5) / number * (high - low) - centre) ** 2 for i in ends)
            farthest += squares[-1]
            if len(squares) > 1:
                least_loss = min(least_loss, squares[-1] - squares[-2])
        return sum(square >= self.radius**2 for square in (farthest, farthest - least_loss))

    def inside(self, places: np.ndarray, margin: np.ndarray | float) -> np.ndarray:
        return super().inside(places, margin) & (_distance(places, self.centre) > self.radius + margin)


class Cylinder(SolidShape):
    """A solid circular cylinder from the centre `base` of one end along `axis`; 3-D only.

    part: "half" and "quarter" keep the part above the base's coordinate along the first or both of the other axes
    """

    base: Point = Field(description="the centre of the lower end [m]")
    axis: AxisName = Field(description="the direction of the axis")
    radius: Positive = Field(description="the radius [m]")
    length: Positive = Field(description="the length [m]")
    part: Literal["whole", "half", "quarter"] = Field("whole", description="the part of it, for symmetry planes")

    @property
    def halved(self) -> list[int]:
        """Axes along which only the part above the base is kept."""
        planes = {"whole": 0, "half": 1, "quarter": 2}[self.part]
        return [i for i in range(3) if i != "XYZ".index(self.axis)][:planes]

    def bounds(self) -> Bounds:
        along, lower = "XYZ".index(self.axis), [place - self.radius for place in self.base]
        upper = [place + self.radius for place in self.base]
        lower[along], upper[along] = float(self.base[along]), self.base[along] + self.length
        for i in self.halved:
            lower[i] = float(self.base[i])
        return lower, upper

    def inside(self, places: np.ndarray, margin: np.ndarray | float) -> np.ndarray:
        axis = "XYZ".index(self.axis)
        from_base = places - np.array(self.base)
        across = [i for i in range(3) if i != axis]
        inside = np.linalg.norm(from_base[:, across], axis=1) < self.radius - margin
        inside &= (from_base[:, axis] > margin) & (from_base[:, axis] < self.length - margin)
        for i in self.halved:
            inside &= from_base[:, i] > margin
        return np.asarray(inside)


class CylindricalShell(SolidShape):
    """A cylindrical shell or a sector of one (a ring sector in 2-D) of mid-surface `radius`.

    3-D: `base` is the centre of the lower end, `axis` the direction of `length`. 2-D: `centre` alone.
    `angles` [degrees] run from the next axis in the cycle X, Y, Z: about Z from X to Y, about X from Y to Z, about Y
    from Z to X. A span of 360 is a closed ring.
    """

    exactly_one: ClassVar = (("base", "centre"),)
    base: Point | None = Field(None, description="in 3-D the centre of the lower end [m]")
    centre: Point | None = Field(None, description="in 2-D the centre [m]")
    axis: AxisName | None = Field(None, description="in 3-D the direction of the axis")
    radius: Positive = Field(description="the radius of the mid-surface [m]")
    thickness: Positive = Field(description="the thickness [m]")
    length: Positive | None = Field(None, description="in 3-D the length [m]")
    angles: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
        [0.0, 360.0], description="begin and end around the axis [degrees]"
    )

    @property
    def closed(self) -> bool:
        """Whether the hoop direction closes on itself."""
        return self.angles[1] - self.angles[0] == 360.0

    @property
    def origin(self) -> list[float]:
        """The centre, of the lower end in 3-D [m]."""
        return self.base or self.centre or []

    @property
    def normal(self) -> int:
        """The index of its axis."""
        return 2 if self.axis is None else "XYZ".index(self.axis)

    def bounds(self) -> Bounds:
        """From the ends of the sector and its crossings of the axes."""
        first, last = self.angles
        crossings = [90.0 * i for i in range(ceil(first / 90.0), floor(last / 90.0) + 1)]
        lower, upper = [float(place) for place in self.origin], [float(place) for place in self.origin]
        for k, function in ((1, cos), (2, sin)):
            axis = (self.normal + k) % 3
            reach = [function(radians(angle)) for angle in (first, last, *crossings)]
            # exactly 0 on planes of symmetry, like the particles
            reach = [0.0 if abs(value) < 1e-15 else value for value in reach]
            radii = [self.radius + 0.5 * sign * self.thickness for sign in (-1.0, 1.0)]
            lower[axis] += min(radius * value for radius in radii for value in reach)
            upper[axis] += max(radius * value for radius in radii for value in reach)
        if self.length is not None:
            upper[self.normal] += self.length
        return lower, upper

    def lengths(self) -> list[float]:
        """Arc length of the mid-surface, length (in 3-D), thickness."""
        axial = [] if self.length is None else [self.length]
        return [self.radius * radians(self.angles[1] - self.angles[0]), *axial, self.thickness]

    def inside(self, places: np.ndarray, margin: np.ndarray | float) -> np.ndarray:
        from_centre = places - np.array(self.origin)
        first, second = from_centre[:, (self.normal + 1) % 3], from_centre[:, (self.normal + 2) % 3]
        inside = np.abs(np.hypot(first, second) - self.radius) < 0.5 * self.thickness - margin
        if self.length is not None:
            inside &= (from_centre[:, self.normal] > margin) & (from_centre[:, self.normal] < self.length - margin)
        if not self.closed:
            begin, end = np.radians(self.angles)
            turned = (np.arctan2(second, first) - begin) % (2.0 * np.pi)
            slack = margin / self.radius
            inside &= (turned > slack) & (turned < end - begin - slack)
        return np.asarray(inside)

    @field_validator("angles")
    @classmethod
    def _span(cls, angles: list[float]) -> list[float]:
        if not 0.0 < angles[1] - angles[0] <= 360.0:
            raise mismatch("[from, to] with 0 < to - from <= 360 degrees", angles)
        return angles

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> "CylindricalShell":
        dimension = dimension_of(info) or len(self.base or self.centre or ())
        details: list[Any] = []
        if self.thickness >= 2.0 * self.radius:
            details.append((("thickness",), f"less than the diameter {2.0 * self.radius:g}", self.thickness))
        for key, value in (("base", self.base), ("axis", self.axis), ("length", self.length)):
            if dimension == 3 and value is None:
                details.append(((key,), "a value in 3-D", NOTHING))
            if dimension == 2 and value is not None:
                details.append(((key,), "no such key in 2-D (use centre)", value))
        reject(*details)
        return self


class Sphere(SolidShape):
    """A solid sphere (a disc in 2-D)."""

    centre: Point = Field(description="the centre [m]")
    radius: Positive = Field(description="the radius [m]")

    def bounds(self) -> Bounds:
        return [place - self.radius for place in self.centre], [place + self.radius for place in self.centre]

    def inside(self, places: np.ndarray, margin: np.ndarray | float) -> np.ndarray:
        return _distance(places, self.centre) < self.radius - margin


def _distance(places: np.ndarray, centre: list[float]) -> np.ndarray:
    return np.asarray(np.linalg.norm(places - np.array(centre), axis=1))


class MeshFile(SceneModel):
    """A mesh in a format that meshio reads, or imported; its coordinates are multiplied by `scale`."""

    file: ExistingFile = Field(description="the mesh file, or one of `parsolid import`, relative to the scene")
    scale: Positive = Field(1.0, description="factor on its coordinates: 0.001 for a mesh in mm")


def of_one_mesh(one: Any, other: Any) -> bool:
    """Whether two shapes are groups of one mesh, so that the bodies share nodes where they touch."""
    meshes = one.kind == other.kind == "mesh" and one.model.mesh_key == other.model.mesh_key
    return bool(meshes and None not in (one.model.group, other.model.group))


class Refinement(SceneModel):
    """A part of geometry with smaller elements."""

    where: str = Field(description="the name of a face, an edge, a volume or a group of the geometry")
    size: Positive = Field(description="the edge length of elements there [m]")


class BodyMesh(MeshFile):
    """All solid elements of a mesh, or those of a group. Bodies with groups of one file are bonded where they share
    nodes. Geometry (STEP, BREP, IGES, .geo, closed STL) is meshed by Gmsh with the sizes here."""

    group: str | None = Field(None, description="use only the elements of this group of the mesh")
    size: Positive | None = Field(None, description="of geometry: the edge length of elements [m]")
    around: Annotated[int, Field(ge=0, le=360)] | None = Field(
        None, description="of geometry: elements around a full turn of curved faces (default: 12); 0: by `size` only"
    )
    refine: list[Refinement] = Field([], description="of geometry: parts with smaller elements")
    size_factor: Positive = Field(
        1.0, description="factor on the size of all elements; other than 1, Gmsh meshes the part again in its surface"
    )

    @property
    def of_geometry(self) -> bool:
        """Whether the file is geometry, which Gmsh meshes."""
        return self.file.lower().endswith(GEOMETRY)

    @property
    def mesh_key(self) -> tuple[Any, ...]:
        """A key that is equal for bodies with elements of the same mesh."""
        finer = tuple((one.where, one.size) for one in self.refine)
        return self.file, self.scale, self.size, self.around, finer, self.size_factor

    @model_validator(mode="after")
    def _sizes_of_geometry(self) -> "BodyMesh":
        if not self.of_geometry:
            stated = [key for key in ("size", "around", "refine") if key in self.model_fields_set]
            expected = "no such key for a mesh, only for geometry (STEP, BREP, IGES, .geo, STL)"
            reject(*(((key,), expected, getattr(self, key)) for key in stated if getattr(self, key)))
            if self.group is not None and self.size_factor != 1.0:
                expected = "1 for a group of a mesh, whose nodes other bodies share"
                reject((("size_factor",), expected, self.size_factor))
        return self


class OneShape(SceneModel):
    """A table with exactly one key of a group: `kind` is the key, `model` its value."""

    @property
    def kind(self) -> str:
        """The key that is given."""
        return next(key for key in self.exactly_one[0] if getattr(self, key) is not None)

    @property
    def model(self) -> Any:
        """The table of the key that is given."""
        return getattr(self, self.kind)


class Shape(OneShape):
    """Exactly one shape; `kind` names it and `model` is its table."""

    exactly_one: ClassVar = (("box", "perforated_box", "cylinder", "cylindrical_shell", "sphere", "mesh"),)
    box: Box | None = None
    perforated_box: PerforatedBox | None = None
    cylinder: Cylinder | None = None
    cylindrical_shell: CylindricalShell | None = None
    sphere: Sphere | None = None
    mesh: BodyMesh | None = Field(None, description="a mesh; shape = { file = ... } is short for it")

    @model_validator(mode="after")
    def _fits_dimension(self, info: ValidationInfo) -> "Shape":
        if dimension_of(info) == 1 and self.perforated_box is not None:
            reject((("perforated_box",), "a shape of 2-D or 3-D", "perforated_box"))
        if dimension_of(info) == 2 and self.cylinder is not None:
            reject((("cylinder",), "a 2-D shape (a disc is a sphere)", "cylinder"))
        return self


def _as_mesh(value: Any) -> Any:
    """The short form { file = ... } of a mesh as { mesh = { file = ... } }."""
    if not isinstance(value, dict) or "file" not in value:
        return value
    # `--set` may add a key of the long form to the short one
    short = {key: part for key, part in value.items() if key != "mesh"}
    mesh = value.get("mesh", {})
    return {"mesh": short | mesh if isinstance(mesh, dict) else mesh}


BodyShape = Annotated[Shape, BeforeValidator(_as_mesh, json_schema_input_type=Shape | BodyMesh)]
