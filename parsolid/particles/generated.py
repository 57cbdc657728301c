"""The fields that every particle has from its generation on, whatever the method."""

from typing import Any

import numpy as np

from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Rows, Within

# field of the volumes of cells, where the field "volume" has the weights of a quadrature
CELL_VOLUME = "cell_volume"


def cell_volumes(particles: Particles) -> np.ndarray:
    """Volumes (owned,) [m^3] of the particles' cells."""
    return np.asarray(particles.owned_rows(CELL_VOLUME if CELL_VOLUME in particles else "volume"))


def widths(spacing: np.ndarray, axes: np.ndarray | None) -> np.ndarray:
    """Widths (n, d) [m] along X, Y, Z, to first order, of cells with spacings (n, d) [m] along their own axes (rows of
    (n, d * d) or (n, d, d)), those of space where there are none."""
    if axes is None:
        return spacing
    return np.einsum("nk,nki->ni", spacing, np.abs(axes.reshape(*spacing.shape, -1)))


def cell_widths(particles: Particles) -> np.ndarray:
    """Widths (owned, d) [m] along X, Y, Z of the particles' cells in the reference."""
    axes = particles.owned_rows("axes") if "axes" in particles else None
    return widths(particles.owned_rows("spacing"), axes)


def declare_generated(
    particles: Particles, particle_set: Any, told: tuple[str, ...] = (), **layouts: Rows | Columns | Within
) -> None:
    """Declare identifier, reference position, volume, spacing, axes where there are some, and area of a rank's
    `ParticleSet`.

    told: names of the fields that ghosts have, in the message "reference"; layouts: of fields by name, rows unless
    given.
    """
    count, d = particle_set.position.shape

    def declare(name: str, components: int, unit: str, values: np.ndarray, **more: Any) -> None:
        ghosts: dict[str, Any] = {"ghosts": "forward", "message": "reference"} if name in told else {}
        layout = layouts.get(name, Rows())
        particles.declare(Field(name, components, unit, checkpointed=True, layout=layout, **ghosts, **more), values)

    declare("identifier", 1, "1", particle_set.identifier, shown=True, whole=True)
    declare("reference_position", d, "m", particle_set.position, mirror="vector")
    declare("volume", 1, "m^3", particle_set.volume)
    declare("spacing", d, "m", particle_set.spacing, mirror="vector")
    if particle_set.axes is not None:
        declare("axes", d * d, "1", particle_set.axes.reshape(count, d * d), mirror="tensor")
    declare("area", d, "m^2", particle_set.area, mirror="vector")
    if particle_set.area_across is not None:
        declare("area_across", d, "m^2", particle_set.area_across, mirror="vector")
    if particle_set.regions is not None:
        # as vectors, so that one column is a column too
        many: dict[str, Any] = {"checkpointed": True, "mirror": "vector"}
        regions, surfaces = particle_set.regions, particle_set.surfaces
        particles.declare(Field("regions", regions.shape[1], "bits", **many, whole=True), regions)
        particles.declare(Field("surfaces", surfaces.shape[1], "bits", **many), surfaces)
