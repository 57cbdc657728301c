"""Named regions of a scene: groups of meshes, shapes, planes of any direction, formulas, and combinations of them."""

from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PlainSerializer, PlainValidator, ValidationInfo, field_validator, model_validator

from parsolid.scene.base_model import Direction, Name, Plane, Point, SceneModel, dimension_of, mismatch, reject
from parsolid.scene.formulas import Formula, InitialScalar
from parsolid.scene.shapes import Shape
from parsolid.scene.validation_errors import suggestion

RegionName = Annotated[str, Field(min_length=1, description="the name of a region, or of a group of a mesh")]

# name of a group of a mesh -> which points (n,) are in it
Groups = Callable[[str], np.ndarray]


class ObliquePlane(SceneModel):
    """A plane of any direction."""

    point: Point = Field(description="a point of the plane [m]")
    normal: Direction = Field(description="its normal, of any length")

    def height(self, places: np.ndarray) -> np.ndarray:
        """Signed distances (n,) [m] of points (n, d), positive on the normal's side."""
        normal = np.array(self.normal)
        return np.asarray((places - np.array(self.point)) @ normal / np.linalg.norm(normal))


def _plane(value: Any, info: ValidationInfo) -> Plane | ObliquePlane:
    if isinstance(value, Plane | ObliquePlane):
        return value
    if isinstance(value, dict):
        return ObliquePlane.model_validate(value, context=info.context)
    return Plane.parse(value, dimension_of(info))


def _stated(plane: Any) -> Any:
    return plane.model_dump() if isinstance(plane, ObliquePlane) else str(plane)


AnyPlane: Any = Annotated[
    Any, PlainValidator(_plane, json_schema_input_type=Plane | ObliquePlane), PlainSerializer(_stated)
]


class Region(SceneModel):
    """A part of space or of a mesh that boundaries, probes, initial states and the output name with `where`.

    all_of, any_of, none_of    names of other regions, or of groups of meshes
    """

    only_with: ClassVar = (("side", "plane"),)
    exactly_one: ClassVar = (("group", "plane", "shape", "formula", "all_of", "any_of", "none_of"),)
    name: Name
    group: str | None = Field(None, description="a group of a mesh: cell_sets or point_sets, a physical group of Gmsh")
    plane: AnyPlane | None = Field(
        None, description='"Y = 0", or { point = [...], normal = [...] }; with side: "above" is the side of its normal'
    )
    side: Literal["on", "above", "below"] | None = Field(None, description="of the plane (default: on it)")
    shape: Shape | None = Field(None, description="the inside of a shape, as of bodies, but not a mesh")
    formula: InitialScalar | None = Field(
        None, description='a comparison in X, Y, Z, such as "X**2 + Y**2 < 0.012**2"; parts are joined by &, | and ~'
    )
    all_of: Annotated[list[str], Field(min_length=1)] | None = Field(None, description="intersection of regions")
    any_of: Annotated[list[str], Field(min_length=1)] | None = Field(None, description="union of regions")
    none_of: Annotated[list[str], Field(min_length=1)] | None = Field(None, description="outside of all these regions")

    @field_validator("formula")
    @classmethod
    def _comparison(cls, formula: Formula) -> Formula:
        if formula is not None and not formula.is_comparison:
            raise mismatch("a comparison such as 'X**2 + Y**2 < 0.01'", formula.source)
        return formula

    @model_validator(mode="after")
    def _consistent(self) -> "Region":
        if self.shape is not None and self.shape.mesh is not None:
            known = ", ".join(key for key in self.shape.exactly_one[0] if key != "mesh")
            reject((("shape",), f"one of {known} (the groups of a mesh have names)", "mesh"))
        return self

    @property
    def parts(self) -> list[str]:
        """Names of the regions that it combines."""
        return self.all_of or self.any_of or self.none_of or []

    def contains(
        self, places: np.ndarray, tolerance: np.ndarray | float, known: Mapping[str, "Region"], groups: Groups
    ) -> np.ndarray:
        """Which points (n, d) [m] are in it, (n,) bool, within a tolerance [m]; known: all regions by name."""
        if self.group is not None:
            return groups(self.group)
        if self.plane is not None:
            height = self.plane.height(places)
            if self.side in (None, "on"):
                return np.asarray(np.abs(height) <= tolerance)
            return np.asarray((height if self.side == "above" else -height) >= -np.asarray(tolerance))
        if self.shape is not None:
            return np.asarray(self.shape.model.inside(places, -float(np.max(tolerance, initial=0.0))))
        if self.formula is not None:
            return np.asarray(self.formula.evaluate(np.ascontiguousarray(places)) != 0.0)
        parts = [known[name].contains(places, tolerance, known, groups) for name in self.parts]
        if self.all_of is not None:
            return np.asarray(np.logical_and.reduce(parts))
        inside = np.asarray(np.logical_or.reduce(parts))
        return inside if self.any_of is not None else ~inside

    def groups(self, known: Mapping[str, "Region"]) -> set[str]:
        """Names of the groups of meshes in it and in the regions that it combines."""
        own = set() if self.group is None else {self.group}
        return own.union(*(known[name].groups(known) for name in self.parts))


def all_regions(stated: list[Region], wanted: list[str]) -> dict[str, Region]:
    """The regions of a scene by name, then a region for each group of a mesh that is named directly."""
    known = {region.name: region for region in stated}
    names = [*wanted, *(name for region in stated for name in region.parts)]
    return known | {name: Region.model_construct(name=name, group=name) for name in names if name not in known}


def uses_of_regions(scene: Any) -> list[tuple[tuple[str | int, ...], str]]:
    """Location and name of every region that boundaries, probes, initial states and output of a scene name."""
    uses: list[tuple[tuple[str | int, ...], Any]] = []
    uses += [(("boundaries", i, "where"), one.region_name) for i, one in enumerate(scene.boundaries)]
    uses += [(("probes", i, "where"), one.where) for i, one in enumerate(scene.probes)]
    uses += [(("initial", i, "where"), one.where) for i, one in enumerate(scene.initial)]
    uses.append((("output", "where"), scene.output.where))
    return [(place, name) for place, name in uses if name is not None]


def region_details(scene: Any, named: set[str], shape_unknown: bool) -> list[Any]:
    """Faults of a scene's regions and of what names them: (place, expected, found); named: regions that what is left
    out names; shape_unknown: there may be meshes that are not known."""
    stated, uses = scene.regions, uses_of_regions(scene)
    meshes = shape_unknown or any(body.shape.kind == "mesh" for body in scene.bodies)
    details: list[Any] = []
    own = [region.name for region in stated]
    names = ", ".join(own) or "there is none"
    for place, name in uses:
        if not meshes and name not in own:
            details.append((place, f"the name of a region ({names}){suggestion(name, own)}", name, "unknown-name"))
    seen: dict[str, Region] = {}
    later, used = set(own), {*named, *(name for _, name in uses), *(name for region in stated for name in region.parts)}
    for i, region in enumerate(stated):
        key: tuple[Any, ...] = ("regions", i)
        later.discard(region.name)
        if region.name in seen:
            details.append(((*key, "name"), "a name that no region before has", region.name, "repeated"))
        if region.name not in used:
            expected = "a region that a boundary, a probe, an initial state or the output names with where"
            details.append(((*key, "name"), expected, region.name))
        for name in region.parts:
            if name in later or name == region.name:
                details.append((key, "names of regions that stand before", name))
            elif name not in seen and not meshes:
                details.append((key, f"names of regions ({', '.join(seen) or 'there are none'})", name))
        if region.group is not None and not meshes:
            details.append(((*key, "group"), "a body with a mesh, whose group it is", region.group))
        seen[region.name] = region
    return details
