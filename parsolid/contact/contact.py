"""Contact by a threshold on the other body's volume fraction ("colour"): all bodies that a scene names.

    c_i = sum over the other body of V_j W(|x_i - x_j|),   g_i = max(0, c_i - c0_i)/s_i,   U = sum kappa A_i g_i^2/4

The forces are the gradient of U, between pairs and along their connection, so that momentum and angular momentum are
kept; friction is a tangential spring of stiffness kappa A_i/2 a particle, with Coulomb's limit, whose reaction is
spread by weights exact for linear fields. A step reads: `Search` has the candidates, `forces` finds penetrations and
forces in the new places, `Host` gives them to particles, `StepRule` says how long the next step may be, and
`BroadPhase` when lists are used up.
"""

from typing import Any

import numpy as np

from parsolid.collective import maximum, minimum, raise_together
from parsolid.contact import forces
from parsolid.contact.body_pairs import areas_of, body_pairs, slots_of
from parsolid.contact.broad_phase import BroadPhase
from parsolid.contact.depth import fill_depths, overlap
from parsolid.contact.forces import Pressure, Rubbing
from parsolid.contact.host import Host
from parsolid.contact.search import Search, Segment
from parsolid.contact.time_step import FAST, Seen, StepRule, penetrations_after, taken_by_deletion
from parsolid.contact.within import WithinBodies
from parsolid.methods.failure_fields import DELETED_STORED
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import EnergyLedger, ParticleSystem
from parsolid.of_ranks import OfRanks, own_share
from parsolid.particles.declaration import Field, Rows
from parsolid.scene import Scene
from parsolid.scene.contact import CONTACT_TERMS, of_model

# steps between looks at how far particles have moved, at least and at most, where bodies are near and where all are
# apart; lists are asked for when they may not hold until twice the next look, and for as many steps more
_LEAST_STEPS, _MOST_STEPS, _AHEAD = 4, {True: 16, False: 256}, 4
# steps from when lists are made to the end of the first that they bound
_UNSEEN = 3.0


def declare_fields(scene: Scene, system: ParticleSystem) -> None:
    """What particles carry of contact, those of all bodies of a system, before its state is set."""
    slots, d = slots_of(scene), system.dimension
    if not slots:
        return
    system.take_external_forces(keep_rows=True)
    particles = system.particles
    vector: dict[str, Any] = {"mirror": "vector", "layout": Rows(d)}
    particles.declare(Field("contact_depth", slots, "1", checkpointed=True, layout=Rows(slots)))
    particles.declare(Field("contact_level", slots, "m", layout=Rows(slots)))
    particles.declare(Field("contact_listed", d, "m", **vector))
    # place at the start of a step
    particles.declare(Field("contact_start", d, "m", **vector))
    particles.declare(Field("contact_force", d, "N", shown=True, checkpointed=True, **vector))
    if any(one.friction for one in of_model(scene.contact, "kernel")):
        particles.declare(Field("contact_stick", slots * d, "m", checkpointed=True, layout=Rows(slots * d)))


class KernelContact(Interaction):
    """All contacts of a scene, on one rank. energy, stuck [J]: stored in penetrations, and in springs of friction;
    checkpoint: what `set_state` was given, None once used."""

    terms = CONTACT_TERMS

    def __init__(self, comm: Any, scene: Scene, systems: list[ParticleSystem]) -> None:
        """systems: of the scene, whose particles have the fields of `declare_fields`. Collective."""
        self.comm, self.systems = comm, systems
        self.names = [body.name or f"bodies.{i}" for i, body in enumerate(scene.bodies)]
        self.body_pairs = body_pairs(comm, scene, systems)
        self.boxes = BroadPhase(comm, len(scene.bodies), self.body_pairs, systems)
        self.search, self.within = Search(comm, self.body_pairs, systems), WithinBodies(self.body_pairs, systems)
        self.steps = StepRule(self.body_pairs)
        self.rubs = any(pair.law.friction for pair in self.body_pairs.pairs)
        self.warms = self.rubs and any(system.takes_heat for system in systems)
        self.deletes = any("deleted_mass" in system.particles for system in systems)
        self.checkpoint: dict[str, Any] | None = None
        self.rebuilds, self.energy, self.stuck = 0, 0.0, 0.0
        self._placed: tuple[int | None, ...] = ()
        self._steps_to_look = 0
        self.hosts: list[Host] = []

    def begin(self, time: float) -> None:
        """Thresholds of a new state, lists, and forces; collective. Raises SolverError on all ranks where bodies lie in
        one another, or are one layer of particles."""
        kept, steps = self.checkpoint, self.steps
        if kept is None:
            for system in self.systems:
                system.particles.owned_rows("contact_force")[:] = 0.0
            fill_depths(self.comm, self.body_pairs, self.systems, self.names)
            stable = minimum(self.comm, min(one.stable_step() for one in self.systems))
            steps.last = max(steps.shortest, stable)
        self.rebuild(time)
        # found anew, forces of friction differ from those that made them in the last bits
        forces_kept = [one.forces[0].copy() for one in self.hosts]
        depth, where = self.find_forces(None, held=True)
        steps.begin(self._seen(), self._penetrations_after(2.0 * steps.last * self._velocity()))
        if kept is None:
            pushed = self._penetrations_after(0.5 * steps.shortest**2 * self._acceleration())
            pressed = minimum(self.comm, steps.from_rest(self._seen(), pushed))
            steps.start_with(pressed, self.boxes.expires - time)
        else:
            self._take_back(kept, forces_kept)
        for one in self.hosts:
            one.give(0.0)
        first, self.checkpoint = kept is None and self.rebuilds == 1, None
        number = next((one.pair for one in self.search.segments if first and 0 <= where < one.last), None)
        pair = None if number is None else self.body_pairs.pairs[number]
        raise_together(self.comm, overlap(depth, pair, self.body_pairs, self.names) if pair is not None else None)

    def _take_back(self, kept: dict[str, Any], forces_kept: list[np.ndarray]) -> None:
        """Forces, energies and steps of a checkpoint for those found anew; on other ranks only the forces."""
        for one, force in zip(self.hosts, forces_kept):
            one.resume(force)
        same = len(kept["energies"]) == self.comm.size
        if same:
            self.energy, self.stuck = kept["energies"][self.comm.rank]
        if self.search.segments:
            self.steps.allowed = float(kept["steps"][self.comm.rank, 0] if same else kept["steps"].min())

    def state(self) -> dict[str, Any]:
        """Its energies on each rank, and the steps that these allow."""
        rule = self.steps
        allowed, at_start = (min(1e300, step) for step in (rule.allowed, rule.at_start))
        return {
            "energies": OfRanks(self.energy, self.stuck),
            "starting": [at_start, rule.starting],
            "steps": OfRanks(allowed),
            "step": rule.last,
            "rebuilds": self.rebuilds,
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """The thresholds are those of the checkpoint."""
        self.checkpoint, self.rebuilds, self.steps.last = state, state["rebuilds"], state["step"]
        self.steps.at_start, self.steps.starting = state["starting"]
        # until `begin` finds them, for the energy of the whole state
        self.energy, self.stuck = own_share(self.comm, state["energies"])

    # --- in a step ----------------------------------------------------------------------------------------------

    def start_step(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """New lists where a rank has asked for them."""
        self.steps.last = step or self.steps.last
        if self.news_anywhere:
            energy = self.energy
            self.rebuild(time)
            self._find_penetrations(known=False)
            # nothing has moved: the same but for the last bits
            self.energy = energy
            for system in self.systems:
                # the start of the step, of particles that were no candidates, too
                start, position = map(system.particles.owned_rows, ("contact_start", "position"))
                start[:] = position

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces in the new places, and what went into the ledger."""
        # where all are apart no row is in any list
        if self.boxes.any_near and (None in self.placements or self.placements != self._placed):
            self.rebuild(time)
        if self.search.segments or self.energy or self.stuck:
            energy, stuck = self.energy, self.stuck
            self.find_forces(ledger, held=step == 0.0)
            ledger.add_term("contact_energy", self.energy - energy)
            ledger.add_term("stick_energy", self.stuck - stuck)
            for one in self.hosts:
                one.give(step)
        if step > 0.0:
            self.steps.starting = max(self.steps.starting - 1, 0)
        self._steps_to_look -= 1
        if self._steps_to_look <= 0 and not self.news:
            self._look(time, step)

    def _look(self, time: float, step: float) -> None:
        """Ask for lists where they may not hold until twice the next look."""
        most = _MOST_STEPS[self.boxes.any_near]
        left = self.boxes.time_left(time, (2 * most + _AHEAD) * step)
        steps = most if step == 0.0 else int((left / step - _AHEAD) / 2.0)
        self.news, self._steps_to_look = steps < _LEAST_STEPS, steps

    @property
    def placements(self) -> tuple[int | None, ...]:
        """Of all systems."""
        return tuple(system.placements for system in self.systems)

    def stable_step(self) -> float:
        """Of the stiffest contact whose bodies see one another on this rank."""
        return self.steps.step

    def energies(self) -> tuple[float, float]:
        """What contact and sticking store."""
        return 0.0, self.energy + self.stuck

    # --- lists ----------------------------------------------------------------------------------------------------

    def rebuild(self, time: float) -> None:
        """Boxes, candidates and lists in the present places; collective."""
        self._placed = self.placements
        self.boxes.agree(time)
        self.within.look()
        for system in self.systems:
            rows = system.particles.owned_rows
            rows("contact_listed")[:] = rows("position")
            if self.rebuilds == 0 or self.checkpoint is not None:
                rows("contact_start")[:] = rows("position")
        fast = self._reach_ahead()
        last = self.steps.last
        prune = not fast and self.boxes.time_left(time, 2 * _AHEAD * last) >= _AHEAD * last
        self.search.build(self.boxes, self.within.excluded if self.within.any else None, self._constants, prune)
        self.rebuilds += 1
        self.news, self._steps_to_look = fast, 1
        if not self.search.segments:
            self.steps.allowed = np.inf
        self._make_room()

    def _reach_ahead(self) -> bool:
        """Let lists reach farther where particles are so fast that they use them up before they can be made anew; then
        all may press. Collective."""
        rule = self.steps
        soon = max(rule.last, rule.shortest)
        fastest = maximum(self.comm, self.boxes.fastest(_AHEAD * soon))
        fast = bool(fastest * soon > FAST * self.boxes.reach.min())
        # the step may get as long as systems allow before contact has a say
        rule.unseen = minimum(self.comm, min(one.stable_step() for one in self.systems)) if fast else 0.0
        if fast:
            self.boxes.reach_beyond(_UNSEEN * fastest * max(soon, rule.unseen))
        return fast

    def _make_room(self) -> None:
        """Arrays and messages of the present candidates."""
        search, owned, whole = self.search, self.search.owned, len(self.search.points.rows)
        laws = [(self.body_pairs.pairs[one.pair], one.last - one.first) for one in search.segments]
        of_law = [
            np.repeat([getattr(pair.law, name) for pair, _ in laws], [count for _, count in laws])
            for name in ("friction", "longest")
        ]
        friction, self.longest = (np.asarray(values, float) for values in of_law)
        self.pressure = Pressure(np.zeros(owned), self._from_fields("contact_level", 1).ravel(), *np.zeros((2, whole)))
        self.force, self.correction, self.heat = np.zeros((owned, 3)), np.zeros((owned, 3)), np.zeros(owned)
        vectors = [np.zeros((whole, 3)) for _ in range(3)]
        self.rubbing: Any = None
        sent = [self.pressure.pull, self.pressure.correction]
        if self.rubs:
            lost, per_colour, given = np.zeros(owned), np.zeros(whole), np.zeros(whole)
            self.rubbing = Rubbing._make([friction, np.zeros((owned, 3)), lost, per_colour, *vectors, given])
            sent += [self.rubbing.per_colour, *vectors] + ([self.rubbing.given] if self.warms else [])
        self.places = search.halo.forward(search.points.rows, search.points.moved)
        self.pressures = search.halo.forward(*sent)
        self.hosts = [Host(system, i, search) for i, system in enumerate(self.systems)]

    def _constants(self, segments: list[Segment], volume: np.ndarray, share: np.ndarray) -> list[np.ndarray]:
        """Threshold, slope, stiffness, 1/R and norm (n,) of candidates with whole volumes (n,) [m^3]."""
        result = np.zeros((5, len(volume)))
        for one in segments:
            pair, here = self.body_pairs.pairs[one.pair], slice(one.first, one.last)
            system = self.systems[one.system]
            inside = system.particles.storage("contact_depth")[one.rows, pair.slot]
            colour, steepness = pair.law.threshold(inside)
            least = self.within.least_thresholds(one.system, pair, one.rows, system.dimension)
            nodal = self.body_pairs.kinds[pair.own].nodal
            area = areas_of(system, one.rows, volume[here], share[here] if nodal else None)
            result[0, here] = colour if least is None else np.maximum(colour, least)
            result[1, here], result[2, here] = 1.0 / steepness, 0.5 * pair.law.stiffness * area
            result[3, here], result[4, here] = 1.0 / pair.law.reach, pair.law.norm
        return list(result)

    def _from_fields(self, name: str, width: int) -> np.ndarray:
        """Values (owned, width) of the candidates, of a field with so many columns for each pair of a body."""
        result = np.zeros((self.search.owned, width))
        for one in self.search.segments:
            first = self.body_pairs.pairs[one.pair].slot * width
            field = self.systems[one.system].particles.storage(name)
            result[one.first : one.last] = field[one.rows, first : first + width]
        return result

    def _to_fields(self, name: str, values: np.ndarray) -> None:
        """Take `_from_fields` back."""
        width = values.shape[1]
        for one in self.search.segments:
            first = self.body_pairs.pairs[one.pair].slot * width
            field = self.systems[one.system].particles.storage(name)
            field[one.rows, first : first + width] = values[one.first : one.last]

    # --- forces ---------------------------------------------------------------------------------------------------

    def find_forces(self, ledger: EnergyLedger | None, held: bool) -> tuple[float, int]:
        """Energy, forces and friction in the present places; the deepest penetration [m], and of which candidate.

        held: nothing has moved since the last evaluation, or it is the first; the springs of friction stay as they are.
        """
        search, pressure, rubbing = self.search, self.pressure, self.rubbing
        before, volume, active = (
            pressure.penetration.copy(),
            search.points.rows[:, 3].copy(),
            search.pairs.active.copy(),
        )
        if self.deletes and not held:
            search.leave_out_deleted()
        deepest = self._find_penetrations(known=not held)
        if ledger is not None and (volume != search.points.rows[:, 3]).any():
            ledger.add_term(DELETED_STORED, taken_by_deletion(search.points, search.pairs, volume, active))
        if not held:
            self.steps.update(self._seen(), before)
        if rubbing is not None:
            self._rub(ledger, follows=not held)
        _send(self.pressures)
        forces.normal_forces(search.points, search.pairs, pressure.pull, self.force)
        corrects = forces.normal_forces(search.points, search.pairs, pressure.correction, self.correction)
        if rubbing is not None:
            forces.add_tractions(search.points, search.pairs, rubbing, self.force)
            if ledger is not None and self.warms:
                self._warm(ledger)
        for one in self.hosts:
            one.take(self.force, self.correction if corrects else None)
        return deepest

    def _find_penetrations(self, known: bool) -> tuple[float, int]:
        """Places, penetrations and energy; the deepest and of which candidate; collective among neighbours. known:
        whether the penetrations at the start of the step are."""
        points = self.search.points
        for one in self.search.segments:
            rows, here, d = self.systems[one.system].particles.owned_rows, slice(one.first, one.last), points.dimension
            place = rows("position")[one.rows]
            points.rows[here, :d], points.moved[here, :d] = place, place - rows("contact_start")[one.rows]
        _send(self.places)
        self.energy, deepest, where = forces.find_penetrations(points, self.search.pairs, known, self.pressure)
        self._to_fields("contact_level", self.pressure.penetration[:, None])
        return float(deepest), int(where)

    def _rub(self, ledger: EnergyLedger | None, follows: bool) -> None:
        """Friction of the owned candidates, whose springs the particles keep."""
        search, rubbing, d = self.search, self.rubbing, self.search.points.dimension
        rubbing.stretch[:, :d] = self._from_fields("contact_stick", d)
        self.stuck = forces.rub(search.points, search.pairs, follows, self.pressure, rubbing)
        self._to_fields("contact_stick", rubbing.stretch[:, :d])
        if ledger is not None:
            ledger.add_term("friction_dissipation", float(rubbing.lost.sum()))
        if self.warms:
            forces.own_heat(search.points.share, rubbing, self.heat)

    def _warm(self, ledger: EnergyLedger) -> None:
        """Half of what friction took to each of two bodies, where their laws have temperatures."""
        forces.add_others_heat(self.search.points, self.search.pairs, self.rubbing.given, self.heat)
        stored = sum(one.warm(self.heat) for one in self.hosts if one.system.takes_heat)
        if stored:
            ledger.add_term("friction_heat", stored)

    # --- what the step rule looks at ------------------------------------------------------------------------------

    def _seen(self) -> Seen:
        return Seen(self.search.points, self.search.pairs, self.pressure, self.longest)

    def _penetrations_after(self, displacement: np.ndarray) -> np.ndarray:
        """Penetrations (owned,) [m] when owned candidates have moved by displacements (owned, 3) [m]; collective."""
        return penetrations_after(self.search.points, self.search.pairs, self.search.halo.with_ghosts(displacement))

    def _velocity(self) -> np.ndarray:
        velocity = np.zeros((self.search.owned, 3))
        velocity[:, : self.search.points.dimension] = self.search.gathered("velocity")
        return velocity

    def _acceleration(self) -> np.ndarray:
        """By the forces of contact [m/s^2]."""
        result = np.zeros((self.search.owned, 3))
        force = self.search.gathered("contact_force")
        result[:, : force.shape[1]] = force / self.search.gathered("mass")[:, None]
        return result

    def numbers(self) -> dict[str, int]:
        """Candidates and pairs that are near."""
        return {"contact candidates": self.search.owned, "contact pairs": len(self.search.pairs.neighbour) // 2}


def _send(message: Any) -> None:
    if not message.silent:
        message.start()
        message.finish()


def build_contact(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Interaction]:
    """The contact of a scene by forces between particles, if it has any; collective."""
    return [KernelContact(comm, scene, systems)] if of_model(scene.contact, "kernel") else []
