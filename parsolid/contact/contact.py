"""Contact by a threshold on the other body's volume fraction ("colour"): all bodies that a scene names.

    c_i = sum over the other body of V_j W(|x_i - x_j|),   g_i = max(0, c_i - c0_i)/s_i,   U = sum kappa A_i g_i^2/4

The forces are the gradient of U, between pairs and along their connection, so that momentum and angular momentum are
kept; friction is a tangential spring of stiffness kappa A_i/2 a particle, with Coulomb's limit, whose reaction is
spread by weights exact for linear fields. `Search` holds the candidates and their pairs, `forces` computes
penetrations and forces, `StepRule` bounds the next step, `BroadPhase` tells how long the lists remain valid.
"""

from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.collective import SolverError, maximum, minimum, raise_together
from parsolid.contact import forces
from parsolid.contact.bodies import ContactBodies, most_partners, share_of
from parsolid.contact.broad_phase import BroadPhase
from parsolid.contact.columns import Columns
from parsolid.contact.depth import fill_depths
from parsolid.contact.forces import APART, FREE, PRESSED, STICKS, Candidates, Friction, Pairs, Pressure
from parsolid.contact.search import Search
from parsolid.contact.time_step import FAST, SEEN, StepRule, penetrations_after
from parsolid.contact.trials import ROUGH, Trial, TriedContact
from parsolid.kernels import kernel
from parsolid.methods.failure_fields import DELETED_INTERNAL
from parsolid.methods.protocol import EnergyLedger, ParticleSystem
from parsolid.particles.declaration import Field, Rows
from parsolid.particles.generated import cell_volumes
from parsolid.per_rank import PerRank, own_share
from parsolid.scene import Scene
from parsolid.scene.contact import CONTACT_TERMS, of_model

# steps for which the lists are to last: fewer are left when new ones are requested
_AHEAD = 4
# steps between the making of lists and the end of the first step whose length depends on them
_UNSEEN = 3.0
# share of the lists' margin that particles may use before lists are made anew: when a state is kept, and in trials
_KEPT, _TRIED = 0.1, 0.5
# of a spacing, round-off of penetrations
_TOUCHING = 1e-9
# most bodies within reach of one particle
_PARTNERS = 12


@kernel
def add_to_rows(row, part, source, target):
    """Add vectors (n, 3) of candidates, times their shares (n,) of their particles, to rows of (particles, d)."""
    for m in range(len(row)):
        for i in range(target.shape[1]):
            target[row[m], i] += part[m] * source[m, i]


def declare_fields(scene: Scene, system: ParticleSystem) -> None:
    """Declare the fields of contact on all particles of a system, before its state is set."""
    columns, d = min(most_partners(scene), _PARTNERS), system.dimension
    if not columns:
        return
    system.take_external_forces(keep_rows=True)
    particles = system.particles
    vector: dict[str, Any] = {"mirror": "vector", "layout": Rows(d)}
    # contact_depth: depth below the own surface, see `ContactBodies.columns`; the others have a column for each other
    # body that is near: its number, the penetration, and the stretch of the spring of friction
    particles.declare(Field("contact_partner", columns, "1", checkpointed=True, whole=True, layout=Rows(columns)), -1)
    particles.declare(Field("contact_depth", columns, "1", checkpointed=True, layout=Rows(columns)))
    particles.declare(Field("contact_level", columns, "m", layout=Rows(columns)))
    if any(one.friction for one in of_model(scene.contact, "kernel")):
        particles.declare(Field("contact_stick", columns * d, "m", checkpointed=True, layout=Rows(columns * d)))
    particles.declare(Field("contact_listed", d, "m", **vector))
    particles.declare(Field("contact_start", d, "m", **vector))
    particles.declare(Field("contact_force", d, "N", shown=True, checkpointed=True, **vector))


def taken_by_deletion(points: Candidates, pairs: Pairs, volume: np.ndarray, active: np.ndarray) -> float:
    """Contact energy [J] that is removed with the particles deleted in the last step; volume (n,) [m^3], active (m,):
    before the deletion.

    Forces of deleted particles act at the start of the step only, others at both ends. Where a penetration goes from d
    to e, the work of half a step and the change of k e^2/2 leave k d e/2.
    """
    whole = points.rows.copy()
    whole[:, 3] = volume
    taken = 0.0
    for sign, rows, who in ((1.0, whole, active), (-1.0, points.rows, pairs.active)):
        of = points._replace(rows=rows), pairs._replace(active=who)
        before, now = (np.maximum(penetrations_after(*of, time * points.moved), 0.0) for time in (-1.0, 0.0))
        taken += sign * 0.5 * float(np.sum(points.share * points.stiffness * before * now))
    return taken


class KernelContact(TriedContact):
    """All contacts of a scene, on one rank. energy, stuck [J]: stored in penetrations, and in springs of friction;
    checkpoint: the state given to `set_state`, None after `begin`."""

    # differences of colours over shorter ways are round-off
    terms, local, difference = CONTACT_TERMS, False, 1e-5

    def __init__(self, comm: Any, scene: Scene, systems: list[ParticleSystem]) -> None:
        """systems: of the scene, whose particles have the fields of `declare_fields`. Collective."""
        self.comm, self.systems = comm, systems
        self.names = [body.name or f"bodies.{i}" for i, body in enumerate(scene.bodies)]
        self.contact_bodies = ContactBodies(comm, scene, systems)
        self.broad_phase = BroadPhase(comm, len(scene.bodies), self.contact_bodies, systems)
        self.most = min(most_partners(scene), _PARTNERS)
        self.search = Search(comm, self.broad_phase, systems, self.most)
        self.step_rule = StepRule(self.contact_bodies)
        most = max(map(len, self.contact_bodies.columns.values()))
        if most > _PARTNERS:
            raise SolverError(
                f"contact: expected at most {_PARTNERS} kinds of bodies, by spacing, that one may touch, found {most}"
            )
        self.rubs = any(law.friction for _, law in self.contact_bodies.laws)
        self.warms = self.rubs and any(system.takes_heat for system in systems)
        self.deletes = any("deleted_mass" in system.particles for system in systems)
        self.checkpoint: dict[str, Any] | None = None
        self.rebuilds, self.energy, self.stuck, self.deleted = 0, 0.0, 0.0, 0.0
        self.corrects = False
        # least gap [m] of pairs that lists may leave out
        self.apart = (1.0 - SEEN) * min(float(law.colour[0] / law.slope.max()) for _, law in self.contact_bodies.laws)
        # energy of a face of a body of mean volume that penetrates by the roughness of its lattice
        volume, kinds, d = 0.0, self.contact_bodies.kinds, scene.dimension
        for system in systems:
            numbers = np.array(system.bodies)[system.particles.owned_rows("body")]
            volume += float(cell_volumes(system.particles)[np.isin(numbers, list(kinds))].sum())
        volume = float(sums(comm, [volume])[0]) / len(kinds)
        deepest = max(law.stiffness * own.spacing**2 for own, law in self.contact_bodies.laws) * ROUGH**2
        self.roughness = 0.25 * deepest * volume ** ((d - 1.0) / d)
        self._placed: tuple[int | None, ...] = ()
        # whether contact_force may still hold forces of earlier lists
        self._listed_anew = False

    def begin(self, time: float) -> None:
        """Thresholds of a new state, lists, and forces; collective. Raises SolverError on all ranks where bodies
        overlap, or consist of one layer of particles."""
        kept, steps = self.checkpoint, self.step_rule
        if kept is None:
            for system in self.systems:
                system.particles.owned_rows("contact_force")[:] = 0.0
            fill_depths(self.comm, self.contact_bodies, self.systems, self.names)
            stable = minimum(self.comm, min(system.stable_step() for system in self.systems))
            steps.last = max(steps.shortest, stable)
        self.rebuild(time, any(system.bounded for system in self.systems))
        # forces of friction computed again differ from those of the checkpoint in the last bits
        forces_kept = [system.particles.owned_rows("contact_force").copy() for system in self.systems]
        depth, where = self.find_forces(held=True)
        steps.begin(self._penetrations_after(2.0 * steps.last * self.search.gathered("velocity")))
        if kept is None:
            acceleration = self.search.gathered("contact_force") / self.search.gathered("mass")[:, None]
            pushed = self._penetrations_after(0.5 * steps.shortest**2 * acceleration)
            steps.start_from_rest(self.comm, pushed, self.broad_phase.expires - time)
        else:
            for system, force in zip(self.systems, forces_kept):
                system.particles.owned_rows("contact_force")[:] = force
            # energies and steps of each rank, where the number of ranks is that of the checkpoint
            same = len(kept["energies"]) == self.comm.size
            if same:
                self.energy, self.stuck = kept["energies"][self.comm.rank]
            if self.search.segments:
                steps.allowed = float(kept["steps"][self.comm.rank, 0] if same else kept["steps"].min())
        self.act(0.0)
        self.book_stored(None, contact_energy=self.energy, stick_energy=self.stuck)
        first, self.checkpoint = kept is None and self.rebuilds == 1, None
        fault = None
        if first and where >= 0:
            both = [int(bodies[self.search.pair[where]]) for bodies in (self.broad_phase.own, self.broad_phase.other)]
            least = min(self.contact_bodies.kinds[body].spacing for body in both)
            if depth > least:
                own, other = (self.names[body] for body in both)
                fault = (
                    "contact: expected bodies that do not lie in one another at the start, found "
                    f"{own} {depth / least:.2g} spacings deep in {other}"
                )
        raise_together(self.comm, fault)

    def state(self) -> dict[str, Any]:
        """Energies and largest steps of each rank, for a checkpoint."""
        rule = self.step_rule
        allowed, at_start = (min(1e300, step) for step in (rule.allowed, rule.at_start))
        return {
            "energies": PerRank(self.energy, self.stuck),
            "starting": [at_start, rule.starting],
            "steps": PerRank(allowed),
            "step": rule.last,
            "rebuilds": self.rebuilds,
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back `state`; the thresholds are fields of the checkpoint."""
        self.checkpoint, self.rebuilds, self.step_rule.last = state, state["rebuilds"], state["step"]
        self.step_rule.at_start, self.step_rule.starting = state["starting"]
        # the total energy of the state is asked for before `begin`
        self.energy, self.stuck = own_share(self.comm, state["energies"])

    # --- in a step ----------------------------------------------------------------------------------------------

    def start_step(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """New lists where a rank has asked for them."""
        self.step_rule.last = step or self.step_rule.last
        if self.rebuild_anywhere:
            energy = self.energy
            self.rebuild(time)
            self._find_penetrations(known=False)
            # nothing has moved, so only the last bits differ
            self.energy = energy
            for system in self.systems:
                start, position = map(system.particles.owned_rows, ("contact_start", "position"))
                start[:] = position

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces at the new positions; books energies; requests new lists where the present ones may not last."""
        placed = tuple(system.placements for system in self.systems)
        if self.broad_phase.any_near and (None in placed or placed != self._placed):
            self.rebuild(time)
        if self.search.segments or self.energy or self.stuck:
            self.find_forces(held=step == 0.0)
            self.book(ledger)
            self.act(step)
        if step > 0.0:
            self.step_rule.starting = max(self.step_rule.starting - 1, 0)
        self.rebuild_needed = self.rebuild_needed or self.broad_phase.time_left(time, _AHEAD * step) < _AHEAD * step

    def stable_step(self) -> float:
        """Largest step [s] that contact allows on this rank."""
        return self.step_rule.step

    def energies(self) -> tuple[float, float]:
        """Kinetic energy, and energy stored by contact and friction [J]."""
        return 0.0, self.energy + self.stuck

    # --- lists ----------------------------------------------------------------------------------------------------

    def rebuild(self, time: float, moves: bool = True) -> None:
        """Boxes, candidates and lists at the present positions; moves: whether velocities count. Collective."""
        self._placed = tuple(system.placements for system in self.systems)
        self.broad_phase.agree(time)
        for system in self.systems:
            rows = system.particles.owned_rows
            rows("contact_listed")[:] = rows("position")
            if self.rebuilds == 0 or self.checkpoint is not None:
                rows("contact_start")[:] = rows("position")
        self.rebuild_needed, last = moves and self._reach_ahead(), self.step_rule.last
        lasts = not moves or self.broad_phase.time_left(time, _AHEAD * last) >= _AHEAD * last
        self.search.build(prune=lasts and not self.rebuild_needed)
        self.rebuilds += 1
        if not self.search.segments:
            self.step_rule.allowed = np.inf
        self._allocate()

    def _reach_ahead(self) -> bool:
        """Widen the lists where particles are too fast for them to be renewed in time; returns whether they are. Then
        no candidate is left out. Collective."""
        rule = self.step_rule
        soon = max(rule.last, rule.shortest)
        fastest = maximum(self.comm, self.broad_phase.fastest(_AHEAD * soon))
        fast = bool(fastest * soon > FAST * min(law.reach for _, law in self.contact_bodies.laws))
        # until contact bounds the step, it may grow to what the systems allow
        rule.unseen = minimum(self.comm, min(system.stable_step() for system in self.systems)) if fast else 0.0
        if fast:
            self.broad_phase.reach_beyond(_UNSEEN * fastest * max(soon, rule.unseen))
        return fast

    def _allocate(self) -> None:
        """Arrays and messages of the present candidates; collective."""
        search, owned, whole = self.search, self.search.owned, len(self.search.points.rows)
        d, columns = search.points.dimension, Columns(self.comm, search, self.most)
        self.candidate_fields = columns
        laws = [law for _, law in self.contact_bodies.laws]
        coefficient, longest = (
            np.array([getattr(law, name) for law in laws], float)[self.broad_phase.law[search.pair]]
            for name in ("friction", "longest")
        )
        # of a new candidate the colour was 0
        blind = -search.points.threshold * search.points.per_slope
        before = np.where(columns.fresh, blind, columns.read("contact_level", 1).ravel())
        columns.write("contact_level", before[:, None])
        self.pressure = Pressure._make([np.zeros(owned), before, np.full(owned, FREE), *np.zeros((2, whole))])
        rule = self.step_rule
        rule.points, rule.pairs, rule.pressure, rule.longest = search.points, search.pairs, self.pressure, longest
        self.force, self.correction, self.heat = np.zeros((owned, 3)), np.zeros((owned, 3)), np.zeros(owned)
        self.friction: Any = None
        sent = [self.pressure.pull, self.pressure.correction]
        if self.rubs:
            columns.write("contact_stick", np.where(columns.fresh[:, None], 0.0, columns.read("contact_stick", d)))
            own = coefficient, np.zeros((owned, 3)), np.zeros(owned), np.zeros((owned, 3)), np.zeros(owned)
            vectors = [np.zeros((whole, 3)) for _ in range(3)]
            self.friction = Friction._make([*own, np.zeros(whole), *vectors, np.zeros(whole)])
            sent += [self.friction.per_colour, *vectors] + ([self.friction.given] if self.warms else [])
        self.places = search.halo.forward(search.points.rows, search.points.moved)
        self.pressures = search.halo.forward(*sent)
        # share of a candidate over that of its particle, not 1 where a plane is of one body alone
        self.part = search.points.share.copy()
        for segment in search.segments:
            self.part[segment.here] /= share_of(segment.particles, segment.rows)
        self._listed_anew = True

    # --- forces ---------------------------------------------------------------------------------------------------

    def find_forces(self, held: bool, tried: bool = False) -> tuple[float, int]:
        """Energy, forces and friction at the present positions; returns the deepest penetration [m] and its candidate.

        held: whether this is the first evaluation, or nothing has moved since the last; springs of friction are kept.
        tried: whether positions are those of a trial, which begins no next step. Collective among neighbours.
        """
        search, pressure, friction, d = self.search, self.pressure, self.friction, self.search.points.dimension
        before, self.deleted = pressure.penetration.copy(), 0.0
        if self.deletes and not held:
            volume, active = search.points.rows[:, 3].copy(), search.pairs.active.copy()
            search.leave_out_deleted()
        deepest = self._find_penetrations(known=not held)
        if self.deletes and not held and (volume != search.points.rows[:, 3]).any():
            self.deleted = taken_by_deletion(search.points, search.pairs, volume, active)
        if not held and not tried:
            self.step_rule.update(before)
        if friction is not None:
            friction.stretch[:, :d] = self.candidate_fields.read("contact_stick", d)
            self.stuck = forces.friction_tractions(search.points, search.pairs, not held, pressure, friction)
            self.candidate_fields.write("contact_stick", friction.stretch[:, :d])
            if self.warms:
                forces.own_heat(search.points.share, friction, self.heat)
        self.pressures.now()
        forces.normal_forces(search.points, search.pairs, pressure.pull, self.force)
        self.corrects = forces.normal_forces(search.points, search.pairs, pressure.correction, self.correction)
        if friction is not None:
            forces.add_tractions(search.points, search.pairs, friction, self.force)
        for system in self.systems if self._listed_anew else ():
            system.particles.owned_rows("contact_force")[:] = 0.0
        for segment in search.segments:
            of, here, acted_on = segment.particles.owned_rows, segment.here, segment.particle_rows
            of("contact_force")[acted_on] = 0.0
            if not tried:
                of("contact_start")[acted_on] = of("position")[acted_on]
            add_to_rows(segment.rows, self.part[here], self.force[here], of("contact_force"))
        self._listed_anew = False
        return deepest

    def act(self, step: float) -> None:
        """Add the forces to the external forces, and the corrections over a step [s] to the external impulses."""
        for segment in self.search.segments:
            particles, rows = segment.particles, segment.particle_rows
            share, of = share_of(particles, rows)[:, None], particles.owned_rows
            of(EXTERNAL_FORCE)[rows] += share * of("contact_force")[rows]
            if self.corrects and step > 0.0:
                here = segment.here
                part = 0.5 * step * self.search.points.share[here]
                add_to_rows(segment.rows, part, self.correction[here], of(EXTERNAL_IMPULSE))

    def _find_penetrations(self, known: bool) -> tuple[float, int]:
        """Penetrations and energy; returns the deepest penetration [m] and its candidate; collective among neighbours.
        known: whether the penetrations at the start of the step are known."""
        points = self.search.points
        for segment in self.search.segments:
            rows, here, d = segment.particles.owned_rows, segment.here, points.dimension
            place = rows("position")[segment.rows]
            points.rows[here, :d], points.moved[here, :d] = place, place - rows("contact_start")[segment.rows]
        self.places.now()
        self.energy, deepest, where = forces.find_penetrations(points, self.search.pairs, known, self.pressure)
        self.candidate_fields.write("contact_level", self.pressure.penetration[:, None])
        return float(deepest), int(where)

    def book(self, ledger: EnergyLedger) -> None:
        """Book the energies of the last forces, and heat each of the two bodies with half the work of friction, where
        their laws have temperatures."""
        self.book_stored(ledger, contact_energy=self.energy, stick_energy=self.stuck)
        if self.deleted:
            ledger.add_term(DELETED_INTERNAL, self.deleted)
        if self.rubs:
            ledger.add_term("friction_dissipation", self.lost())
        if not self.warms:
            return
        forces.add_others_heat(self.search.points, self.search.pairs, self.friction.given, self.heat)
        stored = 0.0
        for segment in self.search.segments:
            system = segment.system
            if system.takes_heat:
                heat = (self.part * self.heat)[segment.here]
                taken = np.bincount(segment.rows, heat, minlength=system.particles.owned)
                warmed = np.flatnonzero(taken)
                stored += system.take_heat(taken[warmed], warmed)
        if stored:
            ledger.add_term("friction_heat", stored)

    # --- in steps that are solved for -----------------------------------------------------------------------------

    def keep(self, ledger: EnergyLedger | None) -> None:
        """See `Interaction`."""
        super().keep(ledger)
        for system in self.systems:
            system.particles.owned_rows("contact_start")[:] = system.particles.owned_rows("position")
        self._listed_memory = self.kept_memory
        self._build_where_moved(_KEPT, self._trial.time)

    def memory(self) -> list[np.ndarray]:
        """See `TriedContact`."""
        names = ["contact_level", "contact_stick", "contact_partner"]
        of = [system.particles for system in self.systems]
        return [each.owned_rows(name) for name in names for each in of if name in each]

    def _build_where_moved(self, part: float, time: float) -> None:
        """Make lists anew at a time [s] where a particle has used a part of the lists' margin, and bring the kept state
        into their columns; collective."""
        most = 0.0
        for system in self.systems:
            of = system.particles.owned_rows
            moved = of("position") - of("contact_listed")
            most = max(most, float(np.einsum("ni,ni->n", moved, moved).max(initial=0.0)))
        most = float(np.sqrt(maximum(self.comm, most)))
        # no lists are made of positions that are not finite
        if part * float(self.broad_phase.beyond.min()) < most < np.inf:
            self.recall(self.kept_memory)
            self.rebuild(time, moves=False)
            self._listed_memory = [field.copy() for field in self.memory()]

    def evaluate_trial(self, trial: Trial) -> None:
        """See `TriedContact`."""
        if trial.deeper == 0.0:
            self._build_where_moved(_TRIED, trial.time)
        self.pressure.branch[:] = FREE if trial.deeper == 0.0 else self._branch
        self.recall(self._listed_memory)
        self.pressure.penetration[:] = self.candidate_fields.read("contact_level", 1).ravel()
        self.find_forces(held=trial.still, tried=True)
        self.act(trial.over if trial.mean else 0.0)

    def fix_branches(self, trial: Trial) -> None:
        """See `TriedContact`; in a trial without displacement, faces that just touch press and stick."""
        least = -_TOUCHING * self.narrowest if trial.still else 0.0
        self._branch = np.where(self.pressure.penetration > least, STICKS if trial.still else PRESSED, APART)

    def lost(self) -> float:
        """See `Interaction`."""
        return float(self.friction.lost.sum()) if self.rubs else 0.0

    def clearances(self) -> np.ndarray:
        """See `Interaction`: (bodies,) [m], of each body to any other, on the particles of either."""
        result = np.full(self.broad_phase.bodies, self.apart)
        for bodies in (self.broad_phase.own, self.broad_phase.other):
            np.minimum.at(result, bodies[self.search.pair], -self.pressure.penetration)
        return result

    def settle(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """See `Interaction`; a motion that follows begins with short steps and new lists."""
        super().settle(time, step, ledger)
        self.rebuild_needed, self.step_rule.allowed = True, min(self.step_rule.allowed, self.step_rule.shortest)

    # --- what the step rule looks at ------------------------------------------------------------------------------

    def _penetrations_after(self, displacement: np.ndarray) -> np.ndarray:
        """Penetrations (owned,) [m] after displacements (owned, d) [m] of the candidates; collective."""
        moved = np.pad(displacement, ((0, 0), (0, 3 - displacement.shape[1])))
        return penetrations_after(self.search.points, self.search.pairs, self.search.halo.with_ghosts(moved))
