"""Loads on all bodies, at the reference positions of whatever particles a rank has."""

import numpy as np

from parsolid.scene.load_histories import LoadHistory


class BodyLoads:
    """Acceleration and heat of a scene's loads; `accelerates` and `heats` say whether there is any."""

    def __init__(self, scene, density):
        """density (bodies,) [kg/m^3]."""
        self.density = np.asarray(density, float)
        self.per_volume, self.per_mass = (
            None if formulas is None else LoadHistory(formulas, scene.loads)
            for formulas in (scene.loads.body_force, scene.loads.acceleration)
        )
        self.heating = scene.loads.heat_source
        self.manufactured = None
        if scene.loads.manufactured:
            # scipy takes half a second to import, which a run without it is spared
            from parsolid.exact import SOLUTIONS

            self.manufactured = SOLUTIONS[scene.reference.exact].of_scene(scene)
        self.accelerates = any(load is not None for load in (self.per_volume, self.per_mass, self.manufactured))
        self.heats = self.heating is not None
        changing = [load.depends_on_time for load in (self.per_volume, self.per_mass) if load is not None]
        self.steady = self.manufactured is None and not any(changing)

    def acceleration(self, body: np.ndarray, positions: np.ndarray, time: float) -> np.ndarray:
        """(n, d) [m/s^2] of particles with body index (n,) and reference position (n, d) [m] at a time [s]."""
        result = np.zeros(positions.shape)
        if self.per_volume is not None:
            result += self.per_volume.evaluate(positions, time) / self.density[body][:, None]
        if self.per_mass is not None:
            result += self.per_mass.evaluate(positions, time)
        if self.manufactured is not None:
            result += self.manufactured.body_force(positions, time)
        return result

    def heat(self, positions: np.ndarray, time: float) -> np.ndarray:
        """(n,) [W/m^3] per reference volume of particles with reference position (n, d) [m] at a time [s]."""
        return self.heating.evaluate(positions, time)
