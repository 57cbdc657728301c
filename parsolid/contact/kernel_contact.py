"""Contact by a threshold on the other body's colour: energy, forces and friction of all bodies that a scene names.

    c_i = sum over the other body of V_j W(|x_i - x_j|),   g_i = max(0, c_i - c0_i)/s_i,   U = sum kappa A_i g_i^2/4

The forces are the gradient of U, between pairs and along their connection, so that momentum and angular momentum are
kept; friction is a tangential spring of stiffness kappa A_i/2 a particle, with Coulomb's limit (Cundall and Strack,
Geotechnique 29, 1979), whose reaction is spread by weights exact for linear fields. They act as impulses between the
steps of all systems.
"""

from typing import Any

import numpy as np

from parsolid.collective import maximum, raise_together
from parsolid.contact import passes
from parsolid.contact.boxes import Boxes
from parsolid.contact.depth import fill_depths
from parsolid.contact.lists import Entries
from parsolid.contact.sides import sides_of, slots_of
from parsolid.contact.within import WithinBodies
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import EnergyLedger, ParticleSystem
from parsolid.particles.declaration import Field, Rows
from parsolid.scene import Scene
from parsolid.scene.contact import CONTACT_TERMS

# steps between looks at how far particles have moved, where bodies are near and where all are apart; lists are asked
# for when they may not hold until twice the next look, and for as many steps more
_LOOKS, _AHEAD = {True: 4, False: 16}, 4
# penetration at the start that is refused, in the smaller spacing
_TOO_DEEP = 1.0


def declare_fields(scene: Scene, system: ParticleSystem) -> None:
    """What particles carry of contact, those of all bodies of a system, before its state is set."""
    slots, d = slots_of(scene), system.dimension
    if not slots:
        return
    system.expect_kicks()
    particles = system.particles
    vector: dict[str, Any] = {"mirror": "vector", "layout": Rows(d)}
    particles.declare(Field("contact_depth", slots, "1", checkpointed=True, layout=Rows(slots)))
    particles.declare(Field("contact_listed", d, "m", **vector))
    particles.declare(Field("contact_place", d, "m", **vector))
    particles.declare(Field("contact_force", d, "N", shown=True, **vector))
    if any(one.friction for one in scene.contact):
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
        self.restarted = False
        self.rebuilds, self.energy, self.stuck = 0, 0.0, 0.0
        self._placed: tuple[int | None, ...] = ()
        self._steps, self._nearest, self._clean = 0, np.inf, False

    def begin(self, time: float) -> None:
        """Thresholds of a new state, lists, and forces; collective. Raises SolverError on all ranks where bodies lie in
        one another, or are one layer of particles."""
        if not self.restarted:
            fill_depths(self.comm, self.sides, self.systems, self.names)
        self.rebuild(time)
        deepest = self.evaluate(None, held=True)
        raise_together(self.comm, self._overlap(deepest) if self.rebuilds == 1 and not self.restarted else None)

    def _overlap(self, deepest: tuple[float, int]) -> str | None:
        depth, where = deepest
        if where < 0:
            return None
        side = self.sides.sides[self.entries.side[where]]
        least = min(self.sides.facts[body].spacing for body in (side.own, side.other))
        if depth <= _TOO_DEEP * least:
            return None
        return (
            f"contact: expected bodies that do not lie in one another at the start, found {self.names[side.own]} "
            f"{depth / least:.2g} spacings deep in {self.names[side.other]}"
        )

    def state(self) -> dict[str, Any]:
        """That there is one."""
        return {"rebuilds": self.rebuilds}

    def set_state(self, state: dict[str, Any]) -> None:
        """The thresholds are those of the checkpoint."""
        self.restarted, self.rebuilds = True, state["rebuilds"]

    # --- in a step ----------------------------------------------------------------------------------------------

    def before(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Half a kick with the forces of the last evaluation; new lists where a rank has asked for them."""
        if self.news_anywhere:
            self.rebuild(time)
        self.kick(step)

    def after(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces in the new places, half a kick, and what went into the ledger."""
        placed = self.placements
        if None in placed or placed != self._placed:
            self.rebuild(time)
        if self.entries.segments or self.energy or self.stuck:
            energy, stuck = self.energy, self.stuck
            self.evaluate(ledger, held=step == 0.0)
            ledger.add_term("contact_energy", self.energy - energy)
            ledger.add_term("stick_energy", self.stuck - stuck)
            self.kick(step)
        self._steps += 1
        interval = _LOOKS[bool(self.boxes.near.any())]
        if not self.news and self._steps % interval == 0:
            self.news = self.boxes.used_up(time, (2.0 * interval + _AHEAD) * step)

    @property
    def placements(self) -> tuple[int | None, ...]:
        """Of all systems."""
        return tuple(system.placements for system in self.systems)

    def kick(self, step: float) -> None:
        """Half a step [s] of the forces."""
        if step == 0.0:
            return
        for system in self.systems if self.energy or self.stuck or self._nearest < np.inf else ():
            force = system.particles.owned_rows("contact_force")
            rows = np.flatnonzero(passes.acting(force))
            if len(rows):
                share = system.share[: system.owned][rows, None]
                system.kick(0.5 * step * share * force[rows], rows)

    def stable_step(self) -> float:
        """Of the stiffest contact whose bodies see one another on this rank, by the present places alone, so that it
        does not depend on when lists were made."""
        return self._nearest

    def energies(self) -> tuple[float, float]:
        """What contact and sticking store."""
        return 0.0, self.energy + self.stuck

    # --- lists ----------------------------------------------------------------------------------------------------

    def rebuild(self, time: float) -> None:
        """Boxes, entries and lists in the present places; collective."""
        self._placed = self.placements
        self.boxes.agree(time)
        self.within.look()
        self.entries.build(self.boxes, self.within.excluded if self.within.any else None)
        self.rebuilds += 1
        self.news, self._steps, self._clean = False, 0, False
        for system in self.systems:
            rows = system.particles.owned_rows
            rows("contact_listed")[:] = rows("position")
            if self.rebuilds == 1 or self.restarted:
                rows("contact_place")[:] = rows("position")
        entries, d = self.entries, self.systems[0].dimension
        chosen = [self.sides.sides[one.side] for one in entries.segments]
        count = [one.last - one.first for one in entries.segments]
        owned, whole = entries.owned, entries.owned + entries.halo.ghosts
        self.place, self.moved = np.zeros((whole, d)), np.zeros((whole, d) if self.rubs else (0, d))
        self.record = np.zeros((whole, 2 + 3 * d if self.rubs else 1))
        self.force, self.colour, self.lost = np.zeros((owned, d)), np.zeros(owned), np.zeros(owned)
        shares = [
            self.systems[one.system].share[: self.systems[one.system].owned][one.rows] for one in entries.segments
        ]
        self.share = np.concatenate(shares or [np.zeros(0)])
        volume = entries.gathered("volume") / self.share
        self.volume = entries.halo.with_ghosts(volume)
        self.constants = np.zeros((owned, 5))
        self.friction = np.repeat([side.friction for side in chosen], count)
        for one, side in zip(entries.segments, chosen):
            here = slice(one.first, one.last)
            depths = self._of_slot("contact_depth", one, side.slot, 1)[:, 0]
            colour, steepness = side.threshold(depths)
            least = self.within.least_thresholds(one.system, side, one.rows, d)
            colour = colour if least is None else np.maximum(colour, least)
            self.constants[here, 0], self.constants[here, 1] = colour, 1.0 / steepness
            self.constants[here, 2] = 0.5 * side.stiffness * self._areas(one, volume[here])
            self.constants[here, 3:] = 1.0 / side.reach, side.norm
        self.matter = passes.Matter(self.place, self.volume, self.share, self.constants)
        self.lists = passes.Lists(entries.start, entries.neighbour, entries.code, entries.table)
        told = [self.place, self.moved] if self.rubs else [self.place]
        self.first, self.second = entries.halo.exchange(told), entries.halo.exchange([self.record])

    def _areas(self, one: Any, volume: np.ndarray) -> np.ndarray:
        """Area [m^2] of a face that a particle stands for: its own where it lies on one, volume over spacing."""
        system, side = self.systems[one.system], self.sides.sides[one.side]
        rows, facts = system.particles.owned_rows, self.sides.facts[side.own]
        spacing = np.prod(rows("spacing")[one.rows], axis=1) ** (1.0 / system.dimension)
        result = volume / spacing
        if facts.nodal and "area" in system.particles:
            area = np.abs(rows("area")[one.rows]) / self.share[one.first : one.last, None]
            result = np.maximum(result, area.max(axis=1))
        return np.asarray(result)

    def _of_slot(self, name: str, one: Any, slot: int, width: int) -> np.ndarray:
        """Values (k, width) of a field in one slot of the particles of a segment."""
        field = self.systems[one.system].particles.storage(name)
        return np.ascontiguousarray(field[one.rows, slot * width : (slot + 1) * width])

    # --- forces ---------------------------------------------------------------------------------------------------

    def evaluate(self, ledger: EnergyLedger | None, held: bool) -> tuple[float, int]:
        """Energy, forces and friction in the present places; the deepest penetration [m], and of which entry.

        held: the stick history stays as it is.
        """
        entries, owned = self.entries, self.entries.owned
        self.place[:owned] = entries.gathered("position")
        if self.rubs:
            self.moved[:owned] = self.place[:owned] - entries.gathered("contact_place")
        self._exchange(self.first)
        self.energy, *deepest = passes.colours(owned, self.matter, self.lists, self.colour, self.record)
        seen = (one.side for one in entries.segments if self.colour[one.first : one.last].any())
        self._nearest = min((self.sides.sides[side].longest for side in seen), default=np.inf)
        self.stuck = 0.0
        if self.rubs:
            self._rub(ledger, True if held else None)
        self._exchange(self.second)
        passes.forces(owned, self.matter, self.lists, self.record, True if self.rubs else None, self.force)
        self._hand_over(ledger)
        return float(deepest[0]), int(deepest[1])

    def _rub(self, ledger: EnergyLedger | None, held: Any) -> None:
        """Friction of the owned entries, whose history the particles keep."""
        entries, d = self.entries, self.place.shape[1]
        parts = [(one, self.sides.sides[one.side].slot) for one in entries.segments]
        stick = np.concatenate(
            [np.zeros((0, d)), *(self._of_slot("contact_stick", one, slot, d) for one, slot in parts)]
        )
        arrays = self.moved, self.friction, self.colour, stick, self.record, self.lost
        self.stuck = passes.friction(entries.owned, held, self.matter, self.lists, *arrays)
        for one, slot in parts:
            field = self.systems[one.system].particles.storage("contact_stick")
            field[one.rows, slot * d : (slot + 1) * d] = stick[one.first : one.last]
        if ledger is not None:
            ledger.add_term("friction_dissipation", float(self.lost.sum()))

    def _hand_over(self, ledger: EnergyLedger | None) -> None:
        """Forces to the particles; work of those who guide particles in contact."""
        work = 0.0
        for index, system in enumerate(self.systems):
            here = [one for one in self.entries.segments if one.system == index]
            rows = system.particles.owned_rows
            force, place = rows("contact_force"), rows("contact_place")
            held = system.held_components() if ledger is not None else None
            if held is not None:
                moved = np.where(held, rows("position") - place, 0.0) * system.share[: system.owned, None]
                work -= 0.5 * float(np.sum(moved * force))
            for rows_of in [one.rows for one in here] if self._clean else [slice(None)]:
                force[rows_of] = 0.0
            for one in here:
                force[one.rows] += self.force[one.first : one.last]
            if held is not None:
                work -= 0.5 * float(np.sum(moved * force))
            if self.rubs or held is not None:
                place[:] = rows("position")
        self._clean = True
        if ledger is not None:
            ledger.add(1.0, 0.0, 0.0, work)

    def _exchange(self, message: Any) -> None:
        if not message.silent:
            message.start()
            message.finish()

    def numbers(self) -> dict[str, int]:
        """Entries and pairs that are near."""
        return {"contact entries": self.entries.owned, "contact pairs": len(self.entries.neighbour) // 2}


def build_contact(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Interaction]:
    """The contact of a scene, if it has any; collective."""
    return [KernelContact(comm, scene, systems)] if scene.contact else []


def deepest(comm: Any, contact: KernelContact) -> float:
    """The deepest penetration of the present state [m]; collective."""
    return maximum(comm, contact.evaluate(None, held=True)[0])
