"""Which Riemann dissipation acts between the particles of a scene."""

from collections.abc import Iterable
from typing import Any

from parsolid.collective import anywhere
from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.hyperelastic.law import isotropic_shear_modulus
from parsolid.pairs.terms import DirectionalShear, LinearReconstruction, MeanRiemann, RiemannDissipation


def dissipation_of(
    comm: Any, settings: Any, blocks: Iterable[MaterialBlock]
) -> RiemannDissipation | MeanRiemann | None:
    """The dissipation that the settings ask for and the laws of blocks need; collective."""
    # where the reference moves, shear that does not depend on the original direction depends on the moved one
    moves = settings.reference == "updated"
    directional = moves or anywhere(comm, any(isotropic_shear_modulus(block.law) is None for block in blocks))
    if not float(settings.dissipation) > 0.0:
        return None
    reconstruction = LinearReconstruction() if settings.reconstruction else None
    if settings.integrator == "leapfrog":
        return MeanRiemann(reconstruction)
    return RiemannDissipation(reconstruction, DirectionalShear() if directional else None)
