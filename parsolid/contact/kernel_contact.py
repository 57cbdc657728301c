"""Contact by a threshold on the other body's colour: energy, forces and friction of all bodies that a scene names.

    c_i = sum over the other body of V_j W(|x_i - x_j|),   g_i = max(0, c_i - c0_i)/s_i,   U = sum kappa A_i g_i^2/4

The forces are the gradient of U, between pairs and along their connection, so that momentum and angular momentum are
kept; friction is a tangential spring of stiffness kappa A_i/2 a particle, with Coulomb's limit (Cundall and Strack,
Geotechnique 29, 1979), whose reaction is spread by weights exact for linear fields.
"""

from typing import Any

import numpy as np

from parsolid.collective import maximum, minimum, raise_together
from parsolid.contact import passes, pressing
from parsolid.contact.boxes import Boxes
from parsolid.contact.closing import FAST, Seen, closing_step, first_step, step_ahead, step_from_rest
from parsolid.contact.depth import fill_depths, overlap
from parsolid.contact.friction_kernels import friction
from parsolid.contact.heat_kernels import others_heat, own_heat
from parsolid.contact.list_kernels import give_levels, take_places
from parsolid.contact.lists import Entries, Segment
from parsolid.contact.recipients import Recipient
from parsolid.contact.sides import areas_of, sides_of, slots_of
from parsolid.contact.within import WithinBodies
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import EnergyLedger, ParticleSystem
from parsolid.particles.declaration import Field, Rows
from parsolid.scene import Scene
from parsolid.scene.contact import CONTACT_TERMS, of_model

# steps between looks at how far particles have moved, at least and at most, where bodies are near and where all are
# apart; lists are asked for when they may not hold until twice the next look, and for as many steps more
_LEAST_STEPS, _MOST_STEPS, _AHEAD = 4, {True: 16, False: 256}, 4
# steps from when lists are made to the end of the first that they bound
_UNSEEN = 3.0
# ends of steps until contact has seen what was apart at the start and met within two steps
_STARTING = 3


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
    """All contacts of a scene, on one rank."""

    terms = CONTACT_TERMS

    def __init__(self, comm: Any, scene: Scene, systems: list[ParticleSystem]) -> None:
        """systems: of the scene, whose particles have the fields of `declare_fields`. Collective."""
        self.comm, self.systems = comm, systems
        self.names = [body.name or f"bodies.{i}" for i, body in enumerate(scene.bodies)]
        self.sides = sides_of(comm, scene, systems)
        self.boxes = Boxes(comm, len(scene.bodies), self.sides, systems)
        self.entries, self.within = Entries(comm, self.sides, systems), WithinBodies(self.sides, systems)
        self.rubs = any(side.friction for side in self.sides.sides)
        self.warms = self.rubs and any(system.takes_heat for system in systems)
        self.restarted, self.rebuilds, self.energy, self.stuck = False, 0, 0.0, 0.0
        # of a checkpoint of as many ranks; the step that it allows, but for those of earlier versions
        self._energies: tuple[float, float] | None = None
        self._kept: float | None = None
        self._placed: tuple[int | None, ...] = ()
        self._until_look, self._nearest = 0, np.inf
        # what bodies that are apart allow of a step [s] from the start, and of how many steps yet
        self._starting = np.inf, 0
        # what systems allow of a step [s] where bodies come so fast that contact looks ahead, else 0
        self._free = 0.0
        self._step = self._soon = min(side.longest for side in self.sides.sides)
        self.recipients: list[Recipient] = []

    def begin(self, time: float) -> None:
        """Thresholds of a new state, lists, and forces; collective. Raises SolverError on all ranks where bodies lie in
        one another, or are one layer of particles."""
        if not self.restarted:
            fill_depths(self.comm, self.sides, self.systems, self.names)
            self._step = max(self._soon, minimum(self.comm, min(one.stable_step() for one in self.systems)))
        self.rebuild(time)
        # found anew, forces of friction differ from those that made them in the last bits
        kept = [one.forces[0].copy() for one in self.recipients] if self.restarted else []
        self._colours(anew=True, ahead=2.0 * self._step)
        ahead = self.level.copy()
        deepest = self._find_forces(None, held=True)
        if not self.restarted:
            # of no speed yet, what presses at the start is seen to go by its forces alone
            self._colours(anew=True, ahead=self._soon, pushed=True)
            pushed, _ = self.level.copy(), self._find_forces(None, held=True)
            pressed = minimum(self.comm, step_from_rest(self._seen(), pushed, self._soon))
            self._starting = min(max(0.5 * (self.boxes.expires - time), self._soon), pressed), _STARTING
        self._nearest = first_step(self._seen(), ahead, 2.0 * self._step)
        if self._kept is not None and self.entries.segments:
            self._nearest = self._kept
        for one, force in zip(self.recipients, kept):
            one.resume(force)
        if self._energies is not None:
            self.energy, self.stuck = self._energies
        for one in self.recipients:
            one.give(0.0)
        first, self.restarted = not self.restarted, False
        depth, where = deepest if first and self.rebuilds == 1 else (0.0, -1)
        side = next((self.sides.sides[one.side] for one in self.entries.segments if where < one.last), None)
        raise_together(self.comm, overlap(depth, side, self.sides, self.names) if side and where >= 0 else None)

    def state(self) -> dict[str, Any]:
        """That there is one, its energies on each rank, and the steps that these allow; collective."""
        energies, step = self.comm.allgather((self.energy, self.stuck)), min(1e300, self._nearest)
        steps = {"steps": self.comm.allgather(step), "step": self._step, "rebuilds": self.rebuilds}
        return {"energies": energies, "starting": [min(1e300, self._starting[0]), self._starting[1]]} | steps

    def set_state(self, state: dict[str, Any]) -> None:
        """The thresholds are those of the checkpoint."""
        self.restarted, self.rebuilds, self._step = True, state["rebuilds"], state.get("step", self._step)
        self._starting = tuple(state.get("starting", (np.inf, 0)))
        steps, same = state.get("steps"), len(state["energies"]) == self.comm.size
        self._kept = steps and (steps[self.comm.rank] if same else min(steps))
        if same:
            self.energy, self.stuck = self._energies = tuple(state["energies"][self.comm.rank])
        elif self.comm.rank == 0:
            # until `begin` finds them, for the energy of the whole state
            self.energy, self.stuck = np.sum(state["energies"], axis=0)

    # --- in a step ----------------------------------------------------------------------------------------------

    def start_step(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """New lists where a rank has asked for them."""
        self._step = step or self._step
        if self.news_anywhere:
            energy = self.energy
            self.rebuild(time)
            self._colours(anew=True)
            # nothing has moved: the same but for the last bits
            self.energy = energy
            for system in self.systems:
                # the start of the step, of particles that had no entry, too
                start, position = map(system.particles.owned_rows, ("contact_start", "position"))
                start[:] = position

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces in the new places, and what went into the ledger."""
        # where all are apart no row is in any list
        if self.boxes.any_near:
            placed = self.placements
            if None in placed or placed != self._placed:
                self.rebuild(time)
        if self.entries.segments or self.energy or self.stuck:
            energy, stuck = self.energy, self.stuck
            self._find_forces(ledger, held=step == 0.0)
            ledger.add_term("contact_energy", self.energy - energy)
            ledger.add_term("stick_energy", self.stuck - stuck)
            for one in self.recipients:
                one.give(step)
        self._starting = self._starting[0], max(self._starting[1] - (step > 0.0), 0)
        self._until_look -= 1
        if self._until_look <= 0 and not self.news:
            self._look(time, step)

    def _look(self, time: float, step: float) -> None:
        """Ask for lists where they may not hold until twice the next look."""
        most = _MOST_STEPS[self.boxes.any_near]
        left = self.boxes.time_left(time, (2 * most + _AHEAD) * step)
        steps = most if step == 0.0 else int((left / step - _AHEAD) / 2.0)
        self.news, self._until_look = steps < _LEAST_STEPS, steps

    @property
    def placements(self) -> tuple[int | None, ...]:
        """Of all systems."""
        return tuple(system.placements for system in self.systems)

    def stable_step(self) -> float:
        """Of the stiffest contact whose bodies see one another on this rank, by the present places alone, so that it
        does not depend on when lists were made."""
        apart, steps = self._starting
        return min(self._nearest, apart) if steps else self._nearest

    def energies(self) -> tuple[float, float]:
        """What contact and sticking store."""
        return 0.0, self.energy + self.stuck

    # --- lists ----------------------------------------------------------------------------------------------------

    def rebuild(self, time: float) -> None:
        """Boxes, entries and lists in the present places; collective."""
        self._placed = self.placements
        self.boxes.agree(time)
        self.within.look()
        for system in self.systems:
            rows = system.particles.owned_rows
            rows("contact_listed")[:] = rows("position")
            if self.rebuilds == 0 or self.restarted:
                rows("contact_start")[:] = rows("position")
        # particles so fast that they use up their lists before they can be made anew may all press
        soon = max(self._step, self._soon)
        fastest = maximum(self.comm, self.boxes.fastest(_AHEAD * soon))
        fast = bool(fastest * soon > FAST * self.boxes.reach.min())
        # the step may get as long as systems allow before contact has a say
        self._free = minimum(self.comm, min(one.stable_step() for one in self.systems)) if fast else 0.0
        if fast:
            self.boxes.reach_beyond(_UNSEEN * fastest * max(soon, self._free))
        prune = not fast and self.boxes.time_left(time, 2 * _AHEAD * self._step) >= _AHEAD * self._step
        self.entries.build(self.boxes, self.within.excluded if self.within.any else None, self._constants, prune)
        self.rebuilds += 1
        # what contact sees ahead of those must not depend on when lists were made
        self.news, self._until_look = fast, 1
        self._nearest = self._nearest if self.entries.segments else np.inf
        entries, d = self.entries, self.systems[0].dimension
        owned, whole = entries.owned, entries.owned + entries.halo.ghosts
        self.place, self.moved = np.zeros((whole, d)), np.zeros((whole, d))
        self.record = np.zeros((whole, 3 + 3 * d + self.warms if self.rubs else 2))
        self.force, self.extra = np.zeros((owned, d)), np.zeros((owned, d))
        self.colour, self.lost, self.heat = np.zeros(owned), np.zeros(owned), np.zeros(owned)
        slots = [(one, self.sides.sides[one.side].slot) for one in entries.segments]
        level = [self._of_slot("contact_level", one, slot, 1)[:, 0] for one, slot in slots]
        self.level = np.concatenate(level or [np.zeros(0)])
        sides = [self.sides.sides[one.side] for one in entries.segments]
        self.friction = np.repeat([side.friction for side in sides], [one.last - one.first for one in entries.segments])
        self.longest = np.repeat([side.longest for side in sides], [one.last - one.first for one in entries.segments])
        self.matter = passes.Matter(self.place, entries.volume, entries.share, entries.constants)
        self.first, self.second = entries.halo.forward(self.place, self.moved), entries.halo.forward(self.record)
        self.recipients = [Recipient(system, i, entries) for i, system in enumerate(self.systems)]

    def _constants(self, segments: list[Segment], volume: np.ndarray) -> np.ndarray:
        """Of `passes`, (n, 5), of the entries of segments with volumes (n,) [m^3]."""
        result = np.zeros((len(volume), 5))
        for one in segments:
            side, here = self.sides.sides[one.side], slice(one.first, one.last)
            colour, steepness = side.threshold(self._of_slot("contact_depth", one, side.slot, 1)[:, 0])
            least = self.within.least_thresholds(one.system, side, one.rows, self.systems[0].dimension)
            colour = colour if least is None else np.maximum(colour, least)
            result[here, 0], result[here, 1] = colour, 1.0 / steepness
            system, nodal = self.systems[one.system], self.sides.facts[side.own].nodal
            area = areas_of(system, one.rows, volume[here], self.entries.share[here] if nodal else None)
            result[here, 2] = 0.5 * side.stiffness * area
            result[here, 3:] = 1.0 / side.reach, side.norm
        return result

    def _of_slot(self, name: str, one: Segment, slot: int, width: int) -> np.ndarray:
        """Values (k, width) of a field in one slot of the particles of a segment."""
        field = self.systems[one.system].particles.storage(name)
        return np.ascontiguousarray(field[one.rows, slot * width : (slot + 1) * width])

    # --- forces ---------------------------------------------------------------------------------------------------

    def _find_forces(self, ledger: EnergyLedger | None, held: bool) -> tuple[float, int]:
        """Energy, forces and friction in the present places; the deepest penetration [m], and of which entry.

        held: nothing has moved since the last evaluation, or it is the first; the stick history stays as it is.
        """
        entries, owned = self.entries, self.entries.owned
        before = self.level.copy()
        deepest = self._colours(anew=held)
        if not held:
            soon = max(self._step, self._soon, self._free)
            going_on = self.matter, entries.lists, self.level, self.moved, self._step, soon
            self._nearest = min(closing_step(self._seen(), before, self._step), step_ahead(*going_on))
        self.stuck = 0.0
        if self.rubs:
            self._rub(ledger, True if held else None)
        self._exchange(self.second)
        lists = entries.lists
        pressing.forces(owned, self.matter, lists, self.record, 0, True if self.rubs else None, self.force)
        opens_or_closes = pressing.forces(owned, self.matter, lists, self.record, 1, None, self.extra)
        if ledger is not None and self.warms:
            self._warm(ledger)
        for one in self.recipients:
            one.take(self.force, self.extra if opens_or_closes else None)
        return deepest

    def _seen(self) -> Seen:
        return Seen(self.colour, self.entries.constants, self.longest, self.level)

    def _colours(self, anew: bool, ahead: float = 0.0, pushed: bool = False) -> tuple[float, int]:
        """Places, colours, penetrations and energy; the deepest and of which entry; collective among neighbours.

        anew: the penetrations at the start of the step are not known, or nothing has moved in it; ahead: of places in
        a time [s], by velocities or pushed from rest.
        """
        entries, owned = self.entries, self.entries.owned
        for one in entries.segments:
            rows = self.systems[one.system].particles.owned_rows
            take_places(one.rows, one.first, rows("position"), rows("contact_start"), self.place, self.moved)
            if ahead:
                mass = self.systems[one.system].mass[one.rows, None]
                speed = 0.5 * ahead * rows("contact_force")[one.rows] / mass if pushed else rows("velocity")[one.rows]
                self.place[one.first : one.last] += ahead * speed
        self._exchange(self.first)
        arrays = True if anew else None, self.colour, self.level, self.record
        self.energy, deepest, where = pressing.colours(owned, self.matter, entries.lists, *arrays)
        for one in entries.segments:
            field, slot = self.systems[one.system].particles.storage("contact_level"), self.sides.sides[one.side].slot
            give_levels(self.level, one.first, one.rows, slot, field)
        return float(deepest), int(where)

    def _rub(self, ledger: EnergyLedger | None, held: Any) -> None:
        """Friction of the owned entries, whose history the particles keep."""
        entries, d = self.entries, self.place.shape[1]
        parts = [(one, self.sides.sides[one.side].slot) for one in entries.segments]
        stick = np.concatenate(
            [np.zeros((0, d)), *(self._of_slot("contact_stick", one, slot, d) for one, slot in parts)]
        )
        arrays = self.moved, self.friction, self.colour, stick, self.record, self.lost
        self.stuck = friction(entries.owned, held, self.matter, entries.lists, *arrays)
        for one, slot in parts:
            field = self.systems[one.system].particles.storage("contact_stick")
            field[one.rows, slot * d : (slot + 1) * d] = stick[one.first : one.last]
        if ledger is not None:
            ledger.add_term("friction_dissipation", float(self.lost.sum()))
        if self.warms:
            own_heat(entries.owned, self.matter, self.lost, self.record, self.record.shape[1] - 1, self.heat)

    def _warm(self, ledger: EnergyLedger) -> None:
        """Half of what friction took to each of two bodies, where their laws have temperatures."""
        column = self.record.shape[1] - 1
        others_heat(self.entries.owned, self.matter, self.entries.lists, self.record, column, self.heat)
        stored = sum(one.warm(self.heat) for one in self.recipients if one.system.takes_heat)
        if stored:
            ledger.add_term("friction_heat", stored)

    def _exchange(self, message: Any) -> None:
        if not message.silent:
            message.start()
            message.finish()

    def numbers(self) -> dict[str, int]:
        """Entries and pairs that are near."""
        return {"contact entries": self.entries.owned, "contact pairs": len(self.entries.lists.neighbour) // 2}


def build_contact(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Interaction]:
    """The contact of a scene by forces between particles, if it has any; collective."""
    return [KernelContact(comm, scene, systems)] if of_model(scene.contact, "kernel") else []
