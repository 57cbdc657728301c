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
from parsolid.scene.contact import BodyPairs, tied_pairs

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
    colliding, stated, bonded = _Pairs(names), _Stated(scene), scene.bonded
    for contact, members in stated.contacts:
        note = f" (friction {contact.friction:g})" if contact.friction else ""
        if len(members) == 1:
            pairs["in contact"].add(f"{names[members[0]]} with itself{note}")
        pairs["in contact"].add_all(combinations(members, 2), len(members) * (len(members) - 1) // 2, note)
    for pair in stated.tied:
        pairs["tied"].add_all([pair], 1)
    near = set()
    for i, j in zip(*(each.tolist() for each in close_boxes(lower, upper, 2.0 * _TOUCHING * spacing))):
        gap = float(np.linalg.norm(np.maximum(np.maximum(lower[i] - upper[j], lower[j] - upper[i]), 0.0)))
        if gap <= _TOUCHING * max(spacing[i], spacing[j]) and bonded.has(i, j):
            near.add((i, j))
            pairs[touching[i]].add_all([(i, j)], 1)
    apart = ((i, j) for i, j in combinations(range(count), 2) if (i, j) not in near and not stated.has(i, j))
    pairs["apart"].add_all(apart, count * (count - 1) // 2 - len(near) - stated.count)
    # boxes swept until the end of the run
    way = np.where(velocity == 0.0, 0.0, velocity * scene.end_time)
    boxes = lower + np.minimum(way, 0.0), upper + np.maximum(way, 0.0)
    first, second = close_boxes(*boxes, 0.0)
    moving = [(lower[of], upper[of], velocity[of]) for of in (first, second)]
    for i, j, when in zip(first.tolist(), second.tolist(), meetings(moving[0], moving[1], np.zeros(len(first)))):
        if when < scene.end_time and (i, j) not in near and not stated.has(i, j):
            colliding.add_all([(i, j)], 1, f" (at about t = {when:.3g} s)")
    notes = [Note("bodies", f"bodies {how}: {which}") for how, which in pairs.items() if which.count]
    if colliding.count:
        then = "the run ends there" if scene.undeclared_contact != "warn" else "their methods do there what they do"
        notes.append(Note("collision-course", f"on a collision course without [[contact]]; {then}: {colliding}"))
    return notes


def contact_warnings(scene: Scene, systems: list[ParticleSystem]) -> list[Warned]:
    """Warnings about contacts whose friction is inaccurate."""
    undamped = {body for system in systems if system.undamped for body in system.bodies}
    found = []
    for contact, members in _Stated(scene).contacts:
        rattles = undamped & set(members)
        if contact.friction and contact.model == "kernel" and (len(rattles) > 1 or rattles == set(members)):
            names = _Pairs([body.name or f"bodies.{number}" for number, body in enumerate(scene.bodies)])
            names.add_all(combinations(sorted(rattles), 2), len(rattles) * (len(rattles) - 1) // 2)
            text = (
                f"nothing damps {str(names) or repr(contact.bodies[0])}, so that faces rattle on one another, and "
                "friction, which springs of particles build up anew each time that they have parted, is less than "
                "Coulomb's in the mean: by 2 % on an incline on which a block is put at once, by 0.1 % where its "
                "weight grows slowly"
            )
            found.append(Warned("friction-of-rattling-bodies", text))
    return found


class _Stated:
    """Pairs of bodies in contact or tied by a scene. contacts: with the numbers of their bodies, those within one body
    first; count: number of pairs of two bodies."""

    def __init__(self, scene: Scene) -> None:
        number = {body.name: i for i, body in enumerate(scene.bodies)}
        self.contacts = [(one, sorted(number[name] for name in one.bodies)) for one in scene.contact]
        self.contacts.sort(key=lambda one: len(one[1]) > 1)
        self.tied = {one[:2] for one in tied_pairs(scene)}
        self._in_contact = BodyPairs(members for _, members in self.contacts)
        self.count = len(self.tied) + sum(len(each) * (len(each) - 1) // 2 for _, each in self.contacts)

    def has(self, i: int, j: int) -> bool:
        """Whether two bodies are in contact or tied."""
        return (i, j) in self.tied or self._in_contact.has(i, j)


class _Pairs:
    """A text of pairs of bodies that names the first of them and counts the others."""

    def __init__(self, names: list[str]) -> None:
        self.names, self.texts, self.count = names, list[str](), 0

    def add(self, text: str) -> None:
        """Add a pair, described by a text."""
        self.texts += [text] if self.count < _MOST else []
        self.count += 1

    def add_all(self, pairs: Iterable[tuple[int, int]], count: int, note: str = "") -> None:
        """Add `count` pairs, of which only those that are named are taken from `pairs`."""
        named = islice(pairs, max(min(_MOST - self.count, count), 0))
        self.texts += [f"{self.names[i]} and {self.names[j]}{note}" for i, j in named]
        self.count += count

    def __str__(self) -> str:
        more = self.count - len(self.texts)
        return ", ".join(self.texts) + (f", and {more} more pairs" if more else "")
