"""What a scene states of a law's members that particles have values of: directions and numbers by reference place."""

from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, PlainSerializer, PlainValidator, ValidationInfo, WithJsonSchema

from parsolid.materials.declaration import BandWidth, Direction
from parsolid.scene.base_model import SceneModel
from parsolid.scene.formulas import InitialDirection, InitialScalar, formula_of_place


class OfCells(SceneModel):
    """Values that the elements of the body's mesh have in its file."""

    cell_data: Annotated[str, Field(min_length=1)] = Field(description="the name of the data in the mesh file")


class StatedDirection(SceneModel):
    """A direction at each particle; its length is of no matter."""

    exactly_one: ClassVar = (("angle", "vector", "cell_data"),)
    angle: InitialScalar | None = Field(None, description="angle [rad] from X to Y, a formula of the reference place")
    vector: InitialDirection | None = Field(None, description="components, formulas of the reference place")
    cell_data: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="the name of a vector that elements have in the mesh file of the body"
    )

    def evaluate(self, points: np.ndarray) -> np.ndarray:
        """Vectors (n, 3) at points (n, d) [m], of any length; not of cell data."""
        result = np.zeros((len(points), 3))
        if self.angle is not None:
            angle = self.angle.evaluate(points)
            result[:, 0], result[:, 1] = np.cos(angle), np.sin(angle)
        else:
            assert self.vector is not None
            result[:, : len(self.vector)] = self.vector.evaluate(points)
        return result


def _number(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, OfCells):
        return value
    if isinstance(value, dict):
        return OfCells.model_validate(value, context=info.context)
    return formula_of_place(value, info)


def _stated(value: Any) -> Any:
    return value.model_dump() if isinstance(value, OfCells) else value.source


# a formula, or a table with `cell_data`
_NUMBER = WithJsonSchema({"type": ["string", "number", "object"], "title": "a formula or cell_data"}, mode="validation")
StatedNumber: Any = Annotated[Any, PlainValidator(_number), PlainSerializer(_stated), _NUMBER]


def field_of_particles(note: Any) -> tuple[Any, Any]:
    """Type and field of a table for a member that particles have values of, state variables apart."""
    told = f"{note.description} [{note.unit}]" if note.unit != "1" else note.description
    if isinstance(note, Direction):
        needed: dict[str, Any] = {} if note.needed else {"default": None}
        kind = StatedDirection if note.needed else StatedDirection | None
        return kind, Field(**needed, description=f"a table: angle, vector or cell_data; the direction {told}".strip())
    if isinstance(note, BandWidth):
        return StatedNumber | None, Field(None, description=f"the width of the band of {told}; of the spacing if none")
    return StatedNumber, Field(description=told or None)
