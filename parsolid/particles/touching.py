"""Bodies that touch at the start; a scene must declare them in contact, tied or bonded."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from decomposition.migration import migrate
from decomposition.pair_search import close_boxes, within_reach
from parsolid.collective import maximum
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.contact import ALL, BodyPairs, tied_pairs
from parsolid.scene.schema import Scene
from parsolid.scene.shapes import of_one_mesh
from parsolid.scene.validation_errors import Fault

# in spacings, the distance at which bodies of different methods touch, and the least one for bodies of one method
TOUCHING = 1.5


class ClosePairs(NamedTuple):
    """Pairs `bodies` (n, 2) whose boxes (bodies, 2, d) [m] are within reach of one another; semi_axes (n, d) [m]: of
    the ellipsoid of that reach."""

    bodies: np.ndarray
    semi_axes: np.ndarray
    boxes: np.ndarray

    def where(self, chosen: np.ndarray) -> "ClosePairs":
        """The pairs where a mask (n,) is true."""
        return self._replace(bodies=self.bodies[chosen], semi_axes=self.semi_axes[chosen])


def systems_of_bodies(scene: Scene) -> np.ndarray:
    """Number (bodies,) of the system of each body."""
    home = np.zeros(len(scene.bodies), np.int64)
    for number, system in enumerate(scene.systems):
        home[list(system.bodies)] = number
    return home


def touching_faults(scene: Scene, particle_set: ParticleSet, comm: MPI.Comm) -> list[Fault]:
    """Faults of bodies that touch without contact, tie or bond, and of bonds between bodies that do not touch, the same
    on all ranks; collective."""
    if len(scene.bodies) == 1:
        return []
    home, bonded, contact = systems_of_bodies(scene), scene.bonded, scene.unbonded
    tied = BodyPairs(pair[:2] for pair in tied_pairs(scene))
    rows = _rows_of_bodies(particle_set.body)
    boxes, spacing = _extents(scene, particle_set, comm)
    close = within_touch(scene, boxes, spacing)
    free = [not tied.has(i, j) and (contact is None or not contact.has(i, j)) for i, j in close.bodies.tolist()]
    close = close.where(np.array(free, bool))
    # boxes of particles are as close as their bounds
    boxed = np.array([body.shape.kind == "box" for body in scene.bodies])[close.bodies].all(axis=1)
    uneven = close.where(~boxed)
    boxed[~boxed] = touch(comm, uneven, lambda body: particle_set.position[rows.get(body, slice(0, 0))])[0]
    touching = close.bodies[boxed].tolist()
    shapes = [body.shape for body in scene.bodies]
    silent = [(i, j) for i, j in touching if not bonded.has(i, j) and not of_one_mesh(shapes[i], shapes[j])]
    joined = [(i, j) for i, j in touching if bonded.has(i, j)]
    fields = [(i, j) for i, j in joined if home[i] != home[j]]
    faults = _without_effect(scene, joined)
    if silent:
        expected = "[[contact]], [[tie]] (two methods) or [[bond]] (one method) for all that touch or act on each other"
        faults.append(Fault("touching", "bodies", expected, f"none for {in_words(scene, silent)}"))
    if fields:
        expected = "bonds of bodies that no contact keeps apart, as bodies of this method share a field of velocities"
        faults.append(Fault("refused", "bond", expected, in_words(scene, fields)))
    return faults


def in_words(scene: Scene, pairs: list[tuple[int, int]]) -> str:
    """Names of the bodies of some pairs."""
    names = [repr(body.name) if body.name else f"bodies.{number}" for number, body in enumerate(scene.bodies)]
    return ", ".join(f"{names[i]} and {names[j]}" for i, j in sorted(pairs))


def _without_effect(scene: Scene, joined: list[tuple[int, int]]) -> list[Fault]:
    """Faults of bonds of bodies that touch no other body of the bond; joined: pairs that are bonded and touch."""
    number = {body.name: k for k, body in enumerate(scene.bodies)}
    met: dict[int, set[int]] = {}
    for i, j in joined:
        met.setdefault(i, set()).add(j)
        met.setdefault(j, set()).add(i)
    faults = []
    for k, one in enumerate(scene.bond):
        if one.bodies == ALL:
            alone = [] if joined else ["all"]
        else:
            bodies = {number[name] for name in one.bodies}
            alone = [name for name in one.bodies if met.get(number[name], set()).isdisjoint(bodies)]
        if alone:
            apart = f"{', '.join(map(repr, alone))} apart from the others"
            faults.append(Fault("touching", f"bond.{k}.bodies", "bodies that touch", apart))
    return faults


def _rows_of_bodies(body: np.ndarray) -> dict[int, slice]:
    """The rows of each body with particles; body (n,): of each particle, rising."""
    numbers, first = np.unique(body, return_index=True)
    ends = [*first[1:].tolist(), len(body)]
    return {number: slice(start, end) for number, start, end in zip(numbers.tolist(), first.tolist(), ends)}


def _extents(scene: Scene, particle_set: ParticleSet, comm: MPI.Comm) -> tuple[np.ndarray, np.ndarray]:
    """Boxes (bodies, 2, d) [m] and greatest spacings (bodies, d) [m] of all bodies; collective."""
    extents = np.full((len(scene.bodies), 3, scene.dimension), -np.inf)
    for body, rows in _rows_of_bodies(particle_set.body).items():
        position, spacing = particle_set.position[rows], particle_set.spacing[rows].max(axis=0)
        # particles with their own axes
        widest = spacing if particle_set.axes is None else np.full_like(spacing, spacing.max())
        extents[body] = -position.min(axis=0), position.max(axis=0), widest
    extents = maximum(comm, extents)
    return np.stack((-extents[:, 0], extents[:, 1]), axis=1), extents[:, 2]


def close_pairs(boxes: np.ndarray, home: np.ndarray, own: np.ndarray, others: np.ndarray) -> ClosePairs:
    """Bodies in boxes (bodies, 2, d) [m] that are close to each other.

    home (bodies,): their systems; own, others (bodies, d) [m]: semi-axes of their reach to bodies of the same system
    and of other ones; a pair has the larger of the two bodies' reaches.
    """
    lower, upper = boxes[:, 0], boxes[:, 1]
    first, second = close_boxes(lower, upper, 2.0 * np.maximum(own, others).max(axis=1))
    semi_axes = np.where(
        (home[first] == home[second])[:, None],
        np.maximum(own[first], own[second]),
        np.maximum(others[first], others[second]),
    )
    gap = np.maximum(np.maximum(lower[second] - upper[first], lower[first] - upper[second]), 0.0) / semi_axes
    near = np.flatnonzero((gap**2).sum(axis=1) < 1.0)
    near = near[np.lexsort((second[near], first[near]))]
    return ClosePairs(np.stack((first, second), axis=1)[near], semi_axes[near], boxes)


def within_touch(scene: Scene, boxes: np.ndarray, spacing: np.ndarray) -> ClosePairs:
    """Bodies in boxes (bodies, 2, d) [m], with spacings (bodies, d) [m], that may touch one another.

    Bodies of one method touch where their particles are within the reach of the method.
    """
    settings = [system.settings for system in scene.systems]
    home = systems_of_bodies(scene)
    within = [np.maximum(settings[k].reach(each), TOUCHING * each) for k, each in zip(home, spacing)]
    return close_pairs(boxes, home, np.array(within), TOUCHING * spacing)


def touch(comm: MPI.Comm, pairs: ClosePairs, places_of: Callable[[int], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Which pairs of bodies have particles within reach of one another (n,), and the mean position (n, d) [m] of these,
    the same on all ranks; collective.

    places_of: body -> positions (m, d) [m] of this rank's particles. The particles of a pair go to one rank.
    """
    count, d = pairs.semi_axes.shape
    place, keys = [np.zeros((0, d))], [np.zeros(0, np.int64)]
    # sorted along the longest side of the body, so that each pair takes a layer of particles
    axis = {body: int(np.argmax(pairs.boxes[body, 1] - pairs.boxes[body, 0])) for body in np.unique(pairs.bodies)}
    layers = {}
    for body, along in axis.items():
        places = places_of(body)
        ordered = places[np.argsort(places[:, along], kind="stable")]
        layers[body] = ordered, np.ascontiguousarray(ordered[:, along])
    for number, both in enumerate(pairs.bodies.tolist()):
        for side, body in enumerate(both):
            (lower, upper), scale, along = pairs.boxes[both[1 - side]], pairs.semi_axes[number], axis[body]
            own, coordinate = layers[body]
            ends = lower[along] - scale[along], upper[along] + scale[along]
            own = own[slice(*np.searchsorted(coordinate, ends))]
            gap = np.maximum(np.maximum(lower - own, own - upper), 0.0) / scale
            here = own[(gap**2).sum(axis=1) < 1.0] / scale
            place.append(here)
            keys.append(np.full(len(here), 2 * number + side))
    key = np.concatenate(keys)
    come: dict[str, Any] = migrate(comm, key // 2 % comm.size, {"place": np.concatenate(place), "key": key})
    order = np.argsort(come["key"], kind="stable")
    key, positions = come["key"][order], come["place"][order]
    bounds = np.searchsorted(key, 2 * np.arange(count)[:, None] + np.arange(3))
    result = np.full((count, d), -np.inf)
    for number, (first, middle, last) in enumerate(bounds.tolist()):
        near = within_reach(positions[first:middle], positions[middle:last], 1.0)
        if near.any():
            result[number] = positions[first:middle][near].mean(axis=0) * pairs.semi_axes[number]
    result = maximum(comm, result)
    return np.isfinite(result).all(axis=1), result
