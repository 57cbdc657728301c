"""Heat that a scene supplies to particles: sources in bodies, and heat through planes that bound them."""

import numpy as np

from parsolid.boundary.forces import DistributedLoad, Rows
from parsolid.particles.container import Particles
from parsolid.particles.generated import cell_widths
from parsolid.scene.boundaries import HeatFlux
from parsolid.scene.formulas import FormulaVector
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.schema import Scene

# how far from its plane a particle of the surface may be, in its spacings
_REACH = 0.51


class HeatSupply:
    """Heat of a rank's particles; planes: through which heat enters, in the order of `powers`."""

    def __init__(self, scene: Scene, particles: Particles, per_radian: bool):
        """per_radian: areas are multiplied with the radius. All ranks alike."""
        self.particles, self.per_radian = particles, per_radian
        formula, fluxes = scene.loads.heat_source, [one for one in scene.boundaries if isinstance(one, HeatFlux)]
        self.planes = [one.plane for one in fluxes]
        bodies = [body.name for body in scene.bodies]
        self._fluxes = [self._through(one, None if one.body is None else bodies.index(one.body)) for one in fluxes]
        self._source = None
        if formula is not None:
            power = LoadHistory(FormulaVector((formula,)))
            self._source = DistributedLoad(particles, None, lambda rows: np.ones(particles.owned), power)

    def _through(self, flux: HeatFlux, body: int | None) -> DistributedLoad:
        """Heat [W] through the faces of particles at a plane, of all bodies or of one."""
        particles, axis = self.particles, flux.plane.axis
        of, name = particles.owned_rows, "area_across" if "area_across" in particles else "area"
        beyond = flux.plane.offset - of("reference_position")[:, axis]
        here = (np.abs(beyond) <= _REACH * cell_widths(particles)[:, axis]) & (of(name)[:, axis] * beyond > 0.0)
        if body is not None:
            here &= of("body") == body

        def area(rows: Rows) -> np.ndarray:
            radius = particles.owned_rows("reference_position")[rows, 0] if self.per_radian else 1.0
            return np.asarray(np.abs(particles.owned_rows(name)[rows, axis]) * radius)

        return DistributedLoad(particles, particles.selection(here), area, flux.prescribed)

    def powers(self, plane: int, time: float) -> tuple[Rows, np.ndarray]:
        """Rows (k,) of particles at one of the planes and the heat (k,) [W] that enters each at a time [s]."""
        rows, values = self._fluxes[plane].forces(time, False)
        return rows, values[0]

    def sources(self, time: float) -> np.ndarray | None:
        """(owned,) [W/m^3] per reference volume at a time [s]; None without any."""
        return None if self._source is None else self._source.forces(time, False)[1][0]
