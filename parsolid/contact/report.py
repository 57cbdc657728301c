"""Notes on how the bodies of a scene interact: bonded, in contact, tied, apart, or on a collision course."""

from collections.abc import Iterable
from itertools import combinations, islice
from typing import Any

import numpy as np

from decomposition.pair_search import close_boxes
from parsolid.contact.broad_phase import body_motions, meetings
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.codes import Note, Warned
from parsolid.scene.contact import BodyPairs, Contact, tied_pairs

# in the larger of two spacings, the gap of bodies that touch
_TOUCHING = 1.5
# most pairs that are named
_MOST = 12


def describe_contacts(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Note]:
    """Notes on the pairs of bodies of a scene in its present state; collective, the same on all ranks."""
    count = len(scene.bodies)
    if count == 1 and not scene.contact:
        return []
    names = [body.name or f"bodies.{number}" for number, body in enumerate(scene.bodies)]
    lower, upper, velocity, spacing = body_motions(comm, count, systems)
    touching = {body: system.settings.touching() for system in scene.systems for body in system.bodies}
    pairs = {how: _Pairs(names) for how in ("in contact", "tied", *touching.values(), "apart")}
    contacts, tied, bonded = _contacts(scene), {one[:2] for one in tied_pairs(scene)}, scene.bonded
    in_contact = BodyPairs(members for _, members in contacts)
    for contact, members in contacts:
        note = f" (friction {contact.friction:g})" if contact.friction else ""
        if len(members) == 1:
            pairs["in contact"].add([(members[0], members[0])], 1, note)
        pairs["in contact"].add(combinations(members, 2), len(members) * (len(members) - 1) // 2, note)
    pairs["tied"].add(sorted(tied), len(tied))

    def stated(i: int, j: int) -> bool:
        return (i, j) in tied or in_contact.has(i, j)

    near = set()
    for i, j in zip(*(each.tolist() for each in close_boxes(lower, upper, 2.0 * _TOUCHING * spacing))):
        gap = float(np.linalg.norm(np.maximum(np.maximum(lower[i] - upper[j], lower[j] - upper[i]), 0.0)))
        if gap <= _TOUCHING * max(spacing[i], spacing[j]) and bonded.has(i, j):
            near.add((i, j))
            pairs[touching[i]].add([(i, j)], 1)
    known = len(near) + sum(len(each) * (len(each) - 1) // 2 for _, each in contacts) + len(tied)
    apart = ((i, j) for i, j in combinations(range(count), 2) if (i, j) not in near and not stated(i, j))
    pairs["apart"].add(apart, count * (count - 1) // 2 - known)
    # boxes swept until the end of the run
    colliding = _Pairs(names)
    way = np.where(velocity == 0.0, 0.0, velocity * scene.end_time)
    boxes = lower + np.minimum(way, 0.0), upper + np.maximum(way, 0.0)
    first, second = close_boxes(*boxes, 0.0)
    moving = [(lower[of], upper[of], velocity[of]) for of in (first, second)]
    for i, j, when in zip(first.tolist(), second.tolist(), meetings(moving[0], moving[1], np.zeros(len(first)))):
        if when < scene.end_time and (i, j) not in near and not stated(i, j):
            colliding.add([(i, j)], 1, f" (at about t = {when:.3g} s)")
    notes = [Note("bodies", f"bodies {how}: {which}") for how, which in pairs.items() if which.count]
    if colliding.count:
        then = "the run ends there" if scene.undeclared_contact != "warn" else "their methods do there what they do"
        notes.append(Note("collision-course", f"on a collision course without [[contact]]; {then}: {colliding}"))
    return notes


def contact_warnings(scene: Scene, systems: list[ParticleSystem]) -> list[Warned]:
    """Warnings about contacts whose friction is inaccurate."""
    undamped = {body for system in systems if system.undamped for body in system.bodies}
    found = []
    for contact, members in _contacts(scene):
        rattles = undamped & set(members)
        if contact.friction and contact.model == "kernel" and (len(rattles) > 1 or rattles == set(members)):
            names = _Pairs([body.name or f"bodies.{number}" for number, body in enumerate(scene.bodies)])
            names.add(combinations(sorted(rattles), 2), len(rattles) * (len(rattles) - 1) // 2)
            text = (
                f"nothing damps {str(names) or repr(contact.bodies[0])}, so that faces rattle on one another, and "
                "friction, which springs of particles build up anew each time that they have parted, is less than "
                "Coulomb's in the mean: by 2 % on an incline on which a block is put at once, by 0.1 % where its "
                "weight grows slowly"
            )
            found.append(Warned("friction-of-rattling-bodies", text))
    return found


def _contacts(scene: Scene) -> list[tuple[Contact, list[int]]]:
    """The contacts of a scene with the numbers of their bodies, those within one body first."""
    number = {body.name: i for i, body in enumerate(scene.bodies)}
    contacts = [(one, sorted(number[name] for name in one.bodies)) for one in scene.contact]
    return sorted(contacts, key=lambda one: len(one[1]) > 1)


class _Pairs:
    """A text of pairs of bodies that names the first of them and counts the others."""

    def __init__(self, names: list[str]) -> None:
        self.names, self.texts, self.count = names, list[str](), 0

    def add(self, pairs: Iterable[tuple[int, int]], count: int, note: str = "") -> None:
        """Add `count` pairs, of which only those that are named are taken from `pairs`."""
        for i, j in islice(pairs, max(min(_MOST - self.count, count), 0)):
            other = f"and {self.names[j]}" if i != j else "with itself"
            self.texts.append(f"{self.names[i]} {other}{note}")
        self.count += count

    def __str__(self) -> str:
        more = self.count - len(self.texts)
        return ", ".join(self.texts) + (f", and {more} more pairs" if more else "")
