"""Loads on all bodies."""

from typing import Literal

from pydantic import Field, ValidationInfo, model_validator

from parsolid.scene.base_model import method_of, reject
from parsolid.scene.formulas import Scalar, Vector
from parsolid.scene.load_histories import Timed


class Loads(Timed):
    """Loads on all bodies: force [N/m^3] and heat [W/m^3] per reference volume, acceleration [m/s^2].

    history and jumps are those of the force and the acceleration.
    manufactured: also the body force under which the exact solution of the scene's reference holds.
    """

    body_force: Vector | None = Field(None, description="a formula for each component [N/m^3]")
    acceleration: Vector | None = Field(None, description="a formula for each component [m/s^2]: gravity, say")
    heat_source: Scalar | None = Field(None, description="a formula [W/m^3]")
    manufactured: Literal[True] | None = Field(None, description="add the body force of the reference's solution")

    @model_validator(mode="after")
    def _known_to_method(self, info: ValidationInfo) -> "Loads":
        method = method_of(info)
        known: tuple[str, ...] = getattr(method, "loads", ())
        stated = self.model_fields_set - Timed.model_fields.keys() if method else set()
        unknown = [key for key in stated if key not in known]
        reject(*(((key,), f"one of {', '.join(known)} with this method", key) for key in unknown))
        return self
