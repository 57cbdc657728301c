"""Fracture of a peridynamic body: from the scene's damage settings to bonds that break at the end of a step.

Bonds are looked at in every settled state. Breaking them changes the forces everywhere near, and evaluating those anew
takes all ranks; so what a rank has found waits until the ranks have agreed, with the next time step, that some rank
found something. The bonds then break at the beginning of that step, at the displacement at which they were found.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from parsolid.collective import anywhere, maximum, minimum, raise_together
from parsolid.materials.damage.fracture import breaking_limit
from parsolid.methods.peridynamics.bond_damage import BondDamage, Limits
from parsolid.methods.peridynamics.bond_damage_kernels import Energy, Stretch
from parsolid.methods.peridynamics.cracks import distance, patch_of
from parsolid.methods.protocol import BrokenPairs
from parsolid.pairs.lists import mutual
from parsolid.pairs.terms import ShearScaled

# a particle with this share of its bonds broken is on a crack: the two sides of a plane cut are damaged by less than a
# half
ON_CRACK = 0.35


class NoFracture:
    """All bonds are whole and stay so.

    found: whether this rank has found bonds that fail in the last state it looked at; found_anywhere: whether any rank
    had, told before the next step; breaks: how often bonds have broken, the same on all ranks. late: whether the stable
    step follows from the new forces.
    """

    found = False
    found_anywhere = False
    late = False
    breaks = 0

    def __init__(self, owned: int, dimension: int) -> None:
        self.owned, self.dimension = owned, dimension

    # --- in a step ---------------------------------------------------------------------------------------------

    def before_forces(self, report: Callable[[], None]) -> None:
        """Report on the step as soon as particles have moved, unless bonds may fail or stiffness changes."""
        if not self.late:
            report()

    def after_forces(self, report: Callable[[], None]) -> None:
        """Report on what is known only now; bonds that fail in the new state are part of it."""
        if self.late:
            report()

    def look(self) -> None:
        """Look for bonds that fail in the state just evaluated."""

    def ranks_find(self) -> bool:
        """Look, and tell whether any rank has found some; collective."""
        return False

    def break_what_ranks_found(self, ledger: Any) -> None:
        """Break what ranks have found, before the next step moves anything; collective where they have."""

    def break_bonds(self, ledger: Any) -> None:
        """Break what any rank has found, and evaluate the forces of the state anew; collective."""

    def safety(self, settings: Any) -> float:
        """The stable step over its limit; settings: `settings.Explicit`."""
        return settings.safety

    def broken_pairs(self) -> BrokenPairs | None:
        """See `ParticleSystem.broken_pairs`."""
        return None

    # --- for a restart and the output --------------------------------------------------------------------------

    def pack(self) -> None:
        """Bring what a checkpoint needs up to date."""

    def resume(self) -> None:
        """Break the bonds of a state that was put back; collective."""

    def take_over(self) -> None:
        """Break the bonds of the state of another run; collective.

        Raises SolverError, on all ranks, where its particles had other neighbours.
        """

    def damage_of(self, first: int, last: int) -> np.ndarray:
        """Share (n,) of the family's volume that particles first..last-1 are no longer bonded to."""
        return np.zeros(last - first)

    def broken_bonds(self) -> float:
        """This rank's share of the bonds that have broken since the start, those of pre-cracks not among them."""
        return 0.0

    def tip(self) -> np.ndarray:
        """Reference position (d,) [m] of the crack's tip, NaN without any; the same on all ranks. Collective."""
        return np.full(self.dimension, np.nan)


class PreCracks(NoFracture):
    """Bonds that are broken from the start, and no others."""

    def __init__(self, comm: Any, scene: Any, particle_set: Any, forces: Any) -> None:
        """particle_set: this rank's sorted particles; forces: `forces.Forces` with all bonds whole. Collective."""
        super().__init__(*particle_set.position.shape)
        self.comm, self.engine, self.history = comm, forces.engine, forces.history
        self.positions = particle_set.position
        bonds, resistance = forces.engine.bond_system, _resistance(scene, particle_set)
        self.damage = BondDamage(comm, forces.engine.particles, bonds, resistance, _limits(scene))
        lower = minimum(comm, particle_set.position.min(axis=0, initial=np.inf))
        upper = maximum(comm, particle_set.position.max(axis=0, initial=-np.inf))
        self.patches = [patch_of(crack, lower, upper) for crack in scene.method.pre_cracks]
        self.damage.introduce(self.patches)
        self._initial, self._cut_at_start = self.damage.damage.copy(), self._gone()
        self.engine.install_shape()

    def broken_pairs(self) -> BrokenPairs | None:
        """Those of pre-cracks, and those that have failed."""
        return self.damage.broken_pairs()

    def pack(self) -> None:
        """Bring the bits of all broken bonds up to date."""
        self.damage.pack()

    def resume(self) -> None:
        """Break the bonds of a state that was put back; collective."""
        self.damage.unpack()
        self.engine.install_shape()

    def take_over(self) -> None:
        """Break the bonds of the state of another run; collective."""
        fault = "initial: expected the bonds of the results (their horizon and bodies), found particles with other ones"
        raise_together(self.comm, None if self.damage.take_over() else fault)
        self.engine.install_shape()

    def damage_of(self, first: int, last: int) -> np.ndarray:
        """Share (n,) of the family's volume that particles first..last-1 are no longer bonded to."""
        return self.damage.damage[first:last]

    def broken_bonds(self) -> float:
        """This rank's share of the bonds that have broken since the start, those of pre-cracks not among them."""
        return self._gone() - self._cut_at_start

    def _gone(self) -> float:
        lists = self.damage.lists
        return sum((1.0 if mutual(pairs) else 0.5) * np.count_nonzero(pairs.weight == 0.0) for pairs in lists)

    def tip(self) -> np.ndarray:
        """Reference position (d,) [m] of the crack's tip, of the particles on grown cracks the farthest from all
        pre-cracks.

        Of several equally far the last by its coordinates; NaN without any. Collective, the same on any number of
        ranks.
        """
        damage = self.damage.damage
        rows = np.flatnonzero((damage > ON_CRACK) & (damage > self._initial))
        mine = []
        if len(rows) and self.patches:
            far = np.min([distance(patch, self.positions[rows]) for patch in self.patches], axis=0)
            mine = [(float(far[i]), *map(float, self.positions[rows[i]])) for i in np.flatnonzero(far == far.max())]
        found = [one for piece in self.comm.allgather(mine) for one in piece]
        return np.array(max(found)[1:]) if found else np.full(self.positions.shape[1], np.nan)


class Fracture(PreCracks):
    """Bonds that break where a criterion says so, see `bond_damage.BondDamage`."""

    def __init__(self, comm: Any, scene: Any, particle_set: Any, forces: Any) -> None:
        super().__init__(comm, scene, particle_set, forces)
        self.settings = scene.method.damage
        self.pending: Any = None

    @property
    def criterion(self) -> Any:
        """What makes a bond fail, over the present arrays."""
        engine, resistance = self.engine, self.damage.resistance
        if self.settings.criterion == "stretch":
            return Stretch(resistance)
        control = 1.0 if isinstance(engine.stabiliser, ShearScaled) else None
        return Energy(resistance, engine.record, control, engine.bond_system.volume)

    @property
    def found(self) -> bool:  # type: ignore[override]
        """Whether this rank has found bonds that fail."""
        return self.pending is not None

    def before_forces(self, report: Callable[[], None]) -> None:
        """Nothing is known yet."""

    def after_forces(self, report: Callable[[], None]) -> None:
        """Bonds that fail in the new state are part of what is reported."""
        self.look()
        report()

    def look(self) -> None:
        """Look for bonds that fail in the state just evaluated."""
        self.pending = self.damage.inspect(self.criterion)

    def ranks_find(self) -> bool:
        """Look, and tell whether any rank has found some; collective."""
        self.look()
        return anywhere(self.comm, self.found)

    def break_what_ranks_found(self, ledger: Any) -> None:
        """Break what ranks have found, before the next step moves anything; collective where they have."""
        if self.found_anywhere:
            self.break_bonds(ledger)

    def break_bonds(self, ledger: Any) -> None:
        """Break what any rank has found, and evaluate the forces of the state anew; collective."""
        self.breaks += 1
        stored = self.history.stored_energy()
        if self.pending is not None:
            self.damage.cut(self.pending)
            self.engine.install_shape()
            self.pending = None
        self.history.evaluate_anew()
        ledger.add_term("dissipation_fracture", stored - self.history.stored_energy())

    def safety(self, settings: Any) -> float:
        """The stable step over its limit; settings: `settings.Explicit`."""
        return min(settings.safety, settings.damage_safety)


def fracture_of(comm: Any, scene: Any, particle_set: Any, forces: Any) -> NoFracture:
    """What of fracture a scene has; as the constructor of `PreCracks`. Collective."""
    if scene.method.damage is not None:
        return Fracture(comm, scene, particle_set, forces)
    if scene.method.pre_cracks:
        return PreCracks(comm, scene, particle_set, forces)
    return NoFracture(*particle_set.position.shape)


def _resistance(scene: Any, particle_set: Any) -> np.ndarray:
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


def _limits(scene: Any) -> Limits:
    settings = scene.method.damage
    if settings is None:
        return Limits(0.0, 1.0)
    return Limits(settings.least_shape_ratio, settings.largest_damage)
