"""Leapfrog (velocity Verlet) of particle methods with one evaluation of forces a step: kick, drift, evaluate, kick.

    v' = v + dt/2 (F + D + L)/m,   x += dt v',   forces of the new state,   v = v' + dt/2 (F + D + L)/m

F: internal forces; D: dissipative forces (Riemann dissipation, artificial viscosity); L: loads, what holds particles,
and forces of contact, tools and ties, whose work is a change of the energy that these store. Works are
those on v', the velocity in the middle of the step, in both halves: the work of a force over a step is the mean of both
ends times the displacement. Kinetic energy then changes by all works and by the difference of the kinetic offset,
sum m |dt a/2|^2 / 2 with the total acceleration a, of both ends of the step: velocity Verlet conserves
m/2 v(-1/2).v(+1/2), which is the kinetic energy less this offset (Hairer, Lubich and Wanner, Geometric Numerical
Integration, 2006, section I.5). The offset swings with the forces and does not grow; nothing but this file books it.
Where dt changes, the offset of the same forces changes, too: that energy the scheme takes or gives, as numerical
dissipation.

That is all where forces are linear. In general the mean of both ends of a step errs in the work of a force with a
potential U by U'''[dx, dx, dx]/12, the change from step to step of (dt^2 a.M a + dx.U'' dx)/12 at one place: the second
difference of positions is dt^2 a, so that this is what x(n) - x(n-1), which moves as x does, has of energy. It is taken
from the offset where a method asks for it (`WorkOffset`), with dx.U'' dx by the change of the forces over the step, to
the order dt^3. What it changes within a step, and does not with forces of U alone, is what dissipative forces and loads
do beyond the mean of both ends: numerical dissipation.

An impulse P at the end of a step, where contact has begun or ended within it, works on v', too, or on the mean velocity
of the common step where a system takes several of its own; what it changes of the kinetic energy besides, of second
order in dt, is energy that the scheme gives: negative numerical dissipation.

Rule of integrators. State are positions, velocities, the laws' variables, and the forces of the last evaluation; a
restart puts them back and evaluates nothing, so that it has the same bits. `advance_positions` opens the step: kick by
the forces at hand, drift, prescribed motion; afterwards positions are those of the step's end. `complete_step` sends
positions to ghosts, takes laws through the step, evaluates forces once, tells the stable step as soon as it is known,
kicks, and books all energies. Every kick reads `external_force`; the closing one reads `external_impulse`, too, and
sets it to 0. An integrator that evaluates forces more often than once (SSP-RK3) is refused where bodies meet.
"""

from typing import Any

import numpy as np

from parsolid.boundary.conditions import COMMON_START, EXTERNAL_FORCE, EXTERNAL_IMPULSE, Conditions
from parsolid.boundary.forces import tributary_mass
from parsolid.kernels import reduction
from parsolid.particles.container import Particles

# of half a step [J]: work of external forces, energy taken by dissipative ones, kinetic offset, and by how much the
# dissipation would be larger with the mean of the velocities before and after
KickEnergies = tuple[float, float, float, float]


@reduction
def kick(n, opening, half, v, force, damping, mass, share, external, interaction, free, loads, loaded):
    """v after half a step `half` [s] of n particles; see `KickEnergies` for what it gives.

    v [m/s], force, damping or None [N], all (d, n or more); mass (n,) [kg] of whole particles; share (n,): the part of
    a particle on this side of mirror planes, None where all are whole; external (d, n) [N] on that part, or None;
    interaction: the same of contact, tools and ties, whose work is not counted; free (d, n): 0 where a component does
    not follow forces, else 1, or None; loads, loaded: what `external` is, None there, of few particles, and their rows
    (k,), else None. opening: whether this is the first half of a step, so that its middle is after the kick.
    """
    work, dissipated, offset, centred = 0.0, 0.0, 0.0, 0.0
    for c in range(v.shape[0]):
        velocity, internal = v[c], force[c]
        for a in range(n):
            whole = mass[a]
            part = whole
            acting = internal[a]
            resistance = 0.0
            if damping is not None:
                resistance = damping[c, a]
                acting += resistance
            if share is not None:
                part = share[a] * whole
                resistance *= share[a]
            change = half * acting / whole
            if external is not None:
                change += half * external[c, a] / part
            if interaction is not None:
                change += half * interaction[c, a] / part
            if free is not None:
                change *= free[c, a]
            old = velocity[a]
            new = old + change
            velocity[a] = new
            middle = new if opening else old
            offset += part * change * change
            if external is not None:
                work += external[c, a] * middle
            dissipated -= resistance * middle
            centred += resistance * change if opening else -resistance * change
        if loads is not None:
            of_loads = loads[c]
            for i in range(loaded.size):
                a = loaded[i]
                part = mass[a] if share is None else share[a] * mass[a]
                acting = internal[a]
                resistance = 0.0
                if damping is not None:
                    acting += damping[c, a]
                    resistance = damping[c, a] * part / mass[a]
                others, change = half * acting / mass[a], half * of_loads[a] / part
                if interaction is not None:
                    others += half * interaction[c, a] / part
                if free is not None:
                    others *= free[c, a]
                    change *= free[c, a]
                before = velocity[a]
                velocity[a] = before + change
                work += of_loads[a] * (velocity[a] if opening else before - others)
                offset += part * change * (2.0 * others + change)
                dissipated -= resistance * change if opening else 0.0
                centred += resistance * change if opening else -resistance * change
    return half * work, half * dissipated, 0.5 * offset, 0.5 * half * centred


@reduction
def drift(first, last, step, v, x):
    """x += step v of particles first..last-1, both (d, n or more); the sum of all velocities, finite if each is."""
    total = 0.0
    for c in range(v.shape[0]):
        velocity, place = v[c, first:last], x[c, first:last]
        for a in range(last - first):
            place[a] += step * velocity[a]
            total += velocity[a]
    return total


@reduction
def kinetic_energy(n, v, mass, share):
    """Sum of 1/2 m v^2 [J] of n particles; share as in `kick`."""
    energy = 0.0
    for c in range(v.shape[0]):
        velocity = v[c]
        for a in range(n):
            part = mass[a]
            if share is not None:
                part *= share[a]
            energy += part * velocity[a] * velocity[a]
    return 0.5 * energy


@reduction
def works_of_changes(n, before, middle, after, old, new, share):
    """Sums of (2 after - middle).(new - old) and of (2 before - middle).(new - old) [W] over n particles, of velocities
    [m/s] and forces [N], all (d, n or more); share as in `kick`."""
    end, start = 0.0, 0.0
    for c in range(before.shape[0]):
        v0, v1, v2, F0, F1 = before[c], middle[c], after[c], old[c], new[c]
        for a in range(n):
            change = F1[a] - F0[a]
            if share is not None:
                change *= share[a]
            end += (2.0 * v2[a] - v1[a]) * change
            start += (2.0 * v0[a] - v1[a]) * change
    return end, start


class WorkOffset:
    """The part of the kinetic offset that is due to third derivatives of the potential of forces, see above.

    energy: at the end of the last step [J], of this rank, None where no step was before or loads have jumped.
    """

    def __init__(self) -> None:
        self.energy: float | None = None
        self._before = self._middle = self._force = np.zeros((0, 0))

    def open(self, velocity: np.ndarray, force: np.ndarray) -> None:
        """Before the opening kick."""
        self._before, self._force = velocity.copy(), force.copy()

    def close(self, velocity: np.ndarray) -> None:
        """Before the closing kick."""
        self._middle = velocity.copy()

    def end(
        self, n: int, step: float, last: float, first: float, second: float, arrays: tuple[Any, ...]
    ) -> tuple[float, float]:
        """After a step [s] and one before [s]: by how much the offset has grown, and what is numerical dissipation [J];
        first, second: kinetic offsets [J] of its kicks; arrays: velocity, force and share of particles."""
        velocity, force, share = arrays
        end, start = works_of_changes(n, self._before, self._middle, velocity, self._force, force, share)
        # 8 times the kinetic offset is dt^2 a.M a
        now, begun = (8.0 * second - step * end) / 12.0, (8.0 * first - step * start) / 12.0
        before = begun if self.energy is None or last <= 0.0 else self.energy
        stretched = before * ((step / last) ** 2 - 1.0) if last > 0.0 else 0.0
        self.energy = now
        return before - now, begun - now - stretched


class ImpulseAtEnd:
    """The impulses (EXTERNAL_IMPULSE) of a step on a rank's particles: made before its closing kick, acts after it.

    rows (k,): particles that have one; change (k, d): of their velocities [m/s].
    """

    def __init__(self, particles: Particles, common_step: float):
        """common_step [s]: of all systems, in which this one may take several. Velocities are those in the middle."""
        impulse, self.velocity = particles.owned_rows(EXTERNAL_IMPULSE), particles.owned_rows("velocity")
        self.particles, self.rows = particles, np.flatnonzero(impulse.any(axis=1))
        self.impulse, self.middle = impulse[self.rows], self.velocity[self.rows]
        if COMMON_START in particles and common_step > 0.0:
            moved = particles.owned_rows("position")[self.rows] - particles.owned_rows(COMMON_START)[self.rows]
            self.middle = moved / common_step
        self.change = np.zeros_like(self.middle)
        impulse[:] = 0.0

    def act(self, constrained: np.ndarray | None) -> float:
        """Change velocities, but not components that are constrained (owned, d); the kinetic energy [J] that this gives
        beyond the work of the impulses in the middle of the step."""
        if not len(self.rows):
            return 0.0
        rows = self.rows
        change = self.impulse / tributary_mass(self.particles, rows)[:, None]
        if constrained is not None:
            change[constrained[rows]] = 0.0
        before, self.change = self.velocity[rows], change
        self.velocity[rows] = before + change
        free = np.where(change != 0.0, self.impulse, 0.0)
        return float(np.sum(free * (before + 0.5 * change - self.middle)))


def taken_by_step_change(offset: float, last: float, step: float) -> float:
    """Energy [J] that the scheme takes because a step [s] is longer than the last one (or gives, if shorter), of the
    kinetic offset [J] of its opening kick.

    The offset of the same forces is (dt/dt_last)^2 times that of the last closing kick. The scheme does not give the
    difference back, so that it is numerical dissipation and no part of the offset, which vanishes with forces.
    """
    return offset * (1.0 - (last / step) ** 2) if last > 0.0 and step > 0.0 else 0.0


class Leapfrog:
    """Half kicks of a rank's particles with their boundary conditions, and the energies of a step.

    The particles have fields "velocity" and "position" in columns (d, n), and "mass". Where contact, tools or ties act
    on them they have "external_force" and "external_impulse" (d, n), too: the force [N] of the present places, of which
    each kick takes its half, and impulses [N s] that the closing kick adds once.
    """

    def __init__(self, particles: Particles, conditions: Conditions, force: str, damping: str | None = None):
        """force, damping: names of fields (d, n) [N] of whole particles."""
        self.particles, self.conditions, self._force, self._damping = particles, conditions, force, damping
        self.opening: KickEnergies = (0.0, 0.0, 0.0, 0.0)
        self.closing = self.opening
        # of the last step, None where nothing acts between bodies; the energy [J] that it gave beyond its work
        self.impulse: ImpulseAtEnd | None = None
        # particles that move as one, see `tlsph.shared_nodes`; their internal forces are shared already
        self.shared: Any = None
        self.given = 0.0
        # where energies are to be balanced to the third order of the step
        self.work_offset: WorkOffset | None = None
        # forces (d, n) [N] of the last half kick from loads and inclined rollers, None without
        self.external: np.ndarray | None = None
        # length [s] of the step before the present one, 0 at the start and after a jump of the loads
        self.last_step = 0.0

    def open_step(self, time: float, step: float) -> None:
        """Opening half kick of a step [s] from a time [s]; drifts follow, then `place`."""
        if self.work_offset is not None:
            self.work_offset.open(*self._arrays()[1:3])
        self.conditions.begin_with_mean(time, step)
        self.opening = self._half_kick(True, time, step)

    def place(self, time: float, step: float) -> None:
        """After the drifts of a step [s] that ends at a time [s]: prescribed motion, and works of the first half."""
        self.conditions.place(time, step)
        self.conditions.observe(0.5 * step)

    def close_step(self, time: float, step: float, substeps: int = 1) -> None:
        """Closing half kick of a step [s] that ends at a time [s]; substeps: of the system in a common one."""
        if self.work_offset is not None:
            self.work_offset.close(self._arrays()[1])
        if EXTERNAL_IMPULSE in self.particles:
            if self.shared is not None:
                self.shared.share(self.particles.owned_rows(EXTERNAL_IMPULSE).T)
            self.impulse = ImpulseAtEnd(self.particles, substeps * step)
        self.closing = self._half_kick(False, time, step)
        if self.impulse is not None:
            self.given = self.impulse.act(self.conditions.constrained)
        self.conditions.end_motion(time)

    def book(self, step: float, ledger: Any, internal: float, offset_term: str | None) -> None:
        """Enter the energies of a step [s] into the ledger; internal: what laws have dissipated [J]; offset_term: under
        which the ledger has the change of the kinetic offset, None where it has not."""
        (work, dissipated, first, _), (more, also, second, _) = self.opening, self.closing
        work += more + self.conditions.end_step(step, ledger)
        taken, grown = taken_by_step_change(first, self.last_step, step), 0.0
        if self.work_offset is not None:
            owned, velocity, force, _, _, share, _ = self._arrays()
            of_step = step, self.last_step, first, second, (velocity, force, share)
            grown, more = self.work_offset.end(owned, *of_step)
            taken, grown = taken + more, grown - more
        self.last_step = step
        ledger.add(1.0, internal, dissipated + also - self.given + taken, work)
        if offset_term is not None:
            ledger.add_term(offset_term, second - first + taken + grown)

    def _half_kick(self, opening: bool, time: float, step: float) -> KickEnergies:
        conditions = self.conditions
        owned, velocity, force, damping, mass, share, interaction = self._arrays()
        external = conditions.external_force(time, force, damping, before_jump=not opening)
        if not opening:
            conditions.observe(0.5 * step)
        if self.shared is not None:
            external, interaction = self._shared(external), self._shared(interaction)
        self.external = external
        on_all, on_some, loaded = external, None, None
        if conditions.loaded is not None and self.shared is None and not conditions.rollers:
            on_all, on_some, loaded = None, external, conditions.loaded
        arrays = velocity, force, damping, mass, share, on_all, interaction, conditions.free, on_some, loaded
        energies: KickEnergies = kick(owned, opening, 0.5 * step, *arrays)
        return energies

    def _shared(self, force: np.ndarray | None) -> np.ndarray | None:
        """A force (d, n) of which particles that move as one have their shares; collective."""
        if force is None:
            return None
        result = force.copy()
        self.shared.share(result)
        return result

    def _arrays(self) -> tuple[Any, ...]:
        """Number of particles, velocities, forces, masses of whole ones, their parts on this side of mirror planes, and
        forces of contact, as kernels take them; found once for as long as there are no other arrays."""
        return self.particles.kept(("arrays of kicks", self), self._find_arrays)

    def _find_arrays(self) -> tuple[Any, ...]:
        storage, of = self.particles.storage, self.particles.owned_rows
        return (
            *(self.particles.owned, storage("velocity"), storage(self._force)),
            None if self._damping is None else storage(self._damping),
            *(of("mass"), of("share") if "share" in self.particles else None),
            storage(EXTERNAL_FORCE) if EXTERNAL_FORCE in self.particles else None,
        )
