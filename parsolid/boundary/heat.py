"""Heat that a scene supplies to particles: sources in bodies, and heat through planes that bound them."""

import numpy as np

from parsolid.boundary.declarations import Declarations, SurfaceHeat
from parsolid.boundary.loads import InTime, Load
from parsolid.boundary.rows import Chosen, Everywhere
from parsolid.particles.container import Particles
from parsolid.scene.formulas import FormulaVector
from parsolid.scene.load_histories import LoadHistory

# how far from its plane a particle of the surface may be, in its spacings
_REACH = 0.51


class HeatSupply:
    """Heat of a rank's particles: `surfaces` are loads [W] on the particles at `planes`."""

    def __init__(self, declared: Declarations, particles: Particles, per_radian: bool):
        """per_radian: areas are multiplied with the radius."""
        self.particles, self.per_radian, formula = particles, per_radian, declared.scene.loads.heat_source
        ones, course = lambda rows: np.ones(particles.owned), None
        if formula is not None:
            course = LoadHistory(FormulaVector((formula,)))
        self._sources = InTime(particles, [Load(particles, Everywhere(), ones, course)] if course else [], 1)
        self.planes = [one.plane for one in declared.of(SurfaceHeat)]
        self.surfaces = [self._surface(declared, one) for one in declared.of(SurfaceHeat)]

    def _surface(self, declared: Declarations, one: SurfaceHeat) -> Load:
        body = None if one.where.body is None else declared.bodies[one.where.body]
        particles, plane = self.particles, one.plane

        def at_plane() -> np.ndarray:
            rows = particles.owned_rows
            beyond = plane.offset - rows("reference_position")[:, plane.axis]
            here = np.abs(beyond) <= _REACH * rows("spacing")[:, plane.axis]
            here &= rows("area")[:, plane.axis] * beyond > 0.0
            return here if body is None else np.asarray(here & (rows("body") == body))

        def area(rows: np.ndarray | slice) -> np.ndarray:
            radius = particles.owned_rows("reference_position")[rows, 0] if self.per_radian else 1.0
            return np.asarray(np.abs(particles.owned_rows("area")[rows, plane.axis]) * radius)

        return Load(particles, Chosen(particles, at_plane), area, one.course)

    def sources(self, time: float) -> np.ndarray | None:
        """(owned,) [W/m^3] per reference volume at a time [s]; None without any."""
        return self._sources.at(time)[:, 0] if self._sources.acting else None
