"""How the bodies of a scene meet, in words: bonded, in contact, apart, and what flies or lies in another unnoticed."""

from typing import Any

import numpy as np

from parsolid.contact.broad_phase import body_motions, meetings
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.contact import contact_pairs
from parsolid.scene.tie import tied_pairs
from parsolid.scene.warned import Note

# bodies closer than so many of the larger spacing touch
_TOUCHING = 1.5
# so many pairs are named at most
_MOST = 12


def relations(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Note]:
    """Notes on the pairs of bodies of a scene in its present state; collective, the same on all ranks."""
    if len(scene.bodies) == 1 and not scene.contact:
        return []
    names = [body.name or f"bodies.{number}" for number, body in enumerate(scene.bodies)]
    pairs = {one[:2]: one.contact for one in contact_pairs(scene.contact, [body.name for body in scene.bodies])}
    tied = {one[:2] for one in tied_pairs(scene)}
    lower, upper, velocity, spacing = body_motions(comm, len(names), systems)
    first, second = np.triu_indices(len(names), 1)
    between = np.maximum(lower[first] - upper[second], lower[second] - upper[first])
    gaps = np.linalg.norm(np.maximum(between, 0.0), axis=1)
    touching = gaps <= _TOUCHING * np.maximum(spacing[first], spacing[second])
    boxes = [(lower[of], upper[of], velocity[of]) for of in (first, second)]
    times = meetings(boxes[0], boxes[1], np.zeros(len(first)))
    home = {body: system for system in systems for body in system.bodies}
    words = dict.fromkeys(system.settings.touching() for system in systems)
    told: dict[str, list[str]] = {how: [] for how in ("in contact", "tied", *words, "apart")}
    blind: list[str] = []
    idle: list[str] = []
    for i, contact in ((one[0], contact) for one, contact in pairs.items() if one[0] == one[1]):
        told["in contact"].append(f"{names[i]} with itself{_words(contact)}")
    for i, j, touch, when in zip(first.tolist(), second.tolist(), touching, times):
        both = f"{names[i]} and {names[j]}"
        if (i, j) in pairs:
            told["in contact"].append(both + _words(pairs[i, j]))
        elif (i, j) in tied:
            told["tied"].append(both)
        elif touch:
            (told[home[i].settings.touching()] if home[i] is home[j] else idle).append(both)
        else:
            told["apart"].append(both)
            if (home[i] is not home[j] or not home[i].settings.bodies_meet) and when < scene.end_time:
                blind.append(f"{both} (at about t = {when:.3g} s)")
    notes = [Note("bodies", f"bodies {how}: {_listed(which)}") for how, which in told.items() if which]
    if idle:
        near = _listed(idle)
        text = f"close together without [[contact]] or [[tie]], so that nothing acts between them: {near}"
        notes.append(Note("no-interaction", text))
    if blind:
        told_of = _listed(blind)
        text = f"on a collision course without [[contact]], and would pass through each other: {told_of}"
        notes.append(Note("unnoticed-meeting", text))
    return notes


def _words(contact: Any) -> str:
    return f" (friction {contact.friction:g})" if contact.friction else ""


def _listed(which: list[str]) -> str:
    rest = f", and {len(which) - _MOST} more pairs" if len(which) > _MOST else ""
    return ", ".join(which[:_MOST]) + rest
