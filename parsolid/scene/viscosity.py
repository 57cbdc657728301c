"""Artificial viscosity of shocks as a scene states it."""

from pydantic import Field

from parsolid.scene.base_model import NotNegative, SceneModel


class ArtificialViscosity(SceneModel):
    """Bulk viscosity in compression, q = rho h |tr d| (quadratic h |tr d| + linear c) with the edge h of a cell or the
    particle spacing; its work becomes internal energy.
    """

    linear: NotNegative = Field(0.2, description="factor of the sound speed")
    quadratic: NotNegative = Field(2.0, description="factor of the velocity jump over a cell or spacing")
