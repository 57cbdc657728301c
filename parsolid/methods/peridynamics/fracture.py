"""Fracture of a peridynamic body: from the scene's damage settings to bonds that break at the end of a step.

Bonds are looked at in every settled state. Breaking them changes the forces everywhere near, and evaluating those anew takes all
ranks; so what a rank has found waits until the ranks have agreed, with the next time step, that some rank found something. The
bonds then break at the beginning of that step, at the displacement at which they were found.
"""

import numpy as np

from parsolid.collective import maximum, minimum
from parsolid.materials.damage.fracture import breaking_limit
from parsolid.methods.peridynamics.bond_damage import BondDamage, Limits
from parsolid.methods.peridynamics.bond_damage_kernels import Energy, Stretch
from parsolid.methods.peridynamics.cracks import distance, patch_of
from parsolid.pairs.layout import ShearScaled

# a particle with this share of its bonds broken is on a crack: the two sides of a plane cut are damaged by less than a half
ON_CRACK = 0.35


class Fracture:
    """Bonds of one rank's particles that break, see `bond_damage.BondDamage`."""

    def __init__(self, comm, scene, particle_set, engine):
        """particle_set: this rank's sorted particles; engine: `bond_force.BondForce` with all bonds whole. Collective."""
        self.comm, self.engine, self.positions = comm, engine, particle_set.position
        self.damage = BondDamage(
            comm,
            engine.space,
            engine.bond_system,
            engine.kinematics,
            particle_set.body,
            _resistance(scene, particle_set),
            _limits(scene),
        )
        engine.accompany([engine.displacement, self.damage.resistance])
        self.criterion = self._criterion(scene.method.damage)
        self.pending = None
        lower = minimum(comm, particle_set.position.min(axis=0, initial=np.inf))
        upper = maximum(comm, particle_set.position.max(axis=0, initial=-np.inf))
        self.patches = [patch_of(crack, lower, upper) for crack in scene.method.pre_cracks]
        self.damage.introduce(self.patches)
        self._initial, self._cut_at_start = self.damage.damage.copy(), self._gone()
        engine.install_shape()

    def _criterion(self, settings):
        if settings is None:
            return None
        engine, resistance = self.engine, self.damage.resistance
        if settings.criterion == "stretch":
            return Stretch(resistance)
        control = 1.0 if isinstance(engine.stabiliser, ShearScaled) else None
        return Energy(resistance, engine.record, control, engine.bond_system.volume)

    def look(self) -> bool:
        """Look for bonds that fail in the state just evaluated; whether this rank found any."""
        if self.criterion is not None:
            self.pending = self.damage.inspect(self.criterion)
        return self.pending is not None

    def break_found(self) -> None:
        """Break what `look` has found; forces are to be evaluated anew."""
        if self.pending is not None:
            self.damage.cut(self.pending)
            self.engine.install_shape()
            self.pending = None

    def resume(self) -> None:
        """Break the bonds of a state that was put back into the table; collective."""
        self.damage.unpack()
        self.engine.install_shape()

    # --- what is seen of it -----------------------------------------------------------------------------------

    def broken_bonds(self) -> float:
        """This rank's share of the bonds that have broken since the start, those of pre-cracks not among them."""
        return self._gone() - self._cut_at_start

    def _gone(self) -> float:
        lists = self.damage.lists
        return sum((1.0 if bonds.both else 0.5) * np.count_nonzero(bonds.pairs.weight == 0.0) for bonds in lists)

    def tip(self) -> np.ndarray:
        """Reference position (d,) [m] of the crack's tip, of the particles on grown cracks the farthest from all pre-cracks.

        Of several equally far the last by its coordinates; NaN without any. Collective, the same on any number of ranks.
        """
        damage = self.damage.damage
        rows = np.flatnonzero((damage > ON_CRACK) & (damage > self._initial))
        mine = []
        if len(rows) and self.patches:
            far = np.min([distance(patch, self.positions[rows]) for patch in self.patches], axis=0)
            mine = [(float(far[i]), *map(float, self.positions[rows[i]])) for i in np.flatnonzero(far == far.max())]
        found = [one for piece in self.comm.allgather(mine) for one in piece]
        return np.array(max(found)[1:]) if found else np.full(self.positions.shape[1], np.nan)


def _resistance(scene, particle_set) -> np.ndarray:
    """The limit of the criterion (n,) for each particle, infinite without one."""
    settings = scene.method.damage
    result = np.full(len(particle_set.position), np.inf)
    if settings is None:
        return result
    state = scene.method.state(scene.dimension)
    for number, body in enumerate(scene.bodies):
        for spacing in np.unique(particle_set.spacing[particle_set.body == number].max(axis=1, initial=0.0)):
            rows = (particle_set.body == number) & (particle_set.spacing.max(axis=1) == spacing)
            horizon = scene.method.horizon(spacing)
            result[rows] = breaking_limit(settings, body.material, state, scene.method.influence, horizon)
    return result


def _limits(scene) -> Limits:
    settings = scene.method.damage
    if settings is None:
        return Limits(0.0, 1.0)
    return Limits(settings.least_shape_ratio, settings.largest_damage)
