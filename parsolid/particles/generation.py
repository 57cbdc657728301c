"""From a scene to particles: every rank makes its own contiguous share of the ids, and no rank more than that."""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.pair_search import close_boxes
from decomposition.slices import Slices
from parsolid.collective import minimum
from parsolid.machine import free_bytes
from parsolid.materials.declaration import Phrase
from parsolid.particles.agreement import agree
from parsolid.particles.fillings import filling_of
from parsolid.particles.initial_fields import meant
from parsolid.particles.lattice import Filling
from parsolid.particles.marks import mark_lattice
from parsolid.particles.meshes.filling import MeshFilling
from parsolid.particles.meshes.slices import MeshSlices, whole_mesh
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.regions import NOBODY, nearest_particles, particles_of, selected
from parsolid.particles.touching import touching_faults
from parsolid.scene.base_model import LEAST, MOST
from parsolid.scene.bodies import Extent
from parsolid.scene.boundaries import Condition, MotionCondition, Support
from parsolid.scene.checks import unbounded_plane
from parsolid.scene.codes import Note
from parsolid.scene.formulas import Formula, FormulaVector
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.named_regions import Region, uses_of_regions
from parsolid.scene.previous_results import PreviousField
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import MeshFault, SceneError, fault, key_path, place_in_words, suggestion

# shares of the end time at which values are compared
_MOMENTS = (0.0, 0.1372, 0.4619, 0.8317, 1.0)
# relative difference below which two values are equal
_SAME = 1e-9
# share of a spacing: distance of particles on a plane, which a support with images holds
_ON_PLANE = 1e-6
# shares of a spacing: round-off, and the greatest displacement by jitter
_ROUND_OFF, _JITTER = 1e-6, 0.5
# least memory [bytes] of a particle with its fields, lists and work arrays in any method
LEAST_BYTES = 300


def generate(scene: Scene, comm: MPI.Comm, meshes: dict[Any, MeshSlices] | None = None) -> ParticleSet:
    """This rank's share of the scene's particles (collective).

    meshes: those that have been read, by their keys, to which those of bodies are added.

    Global ids run body by body in the order of each body's lattice or mesh; rank r has the ids from r N / size. Raises
    SceneError, the same on all ranks, for a mesh that cannot be used, too many particles for the memory, a body without
    particles, within another one or touching one without contact, tie or bond, a plane that bounds no mesh, a region
    without particles, a probe away from all particles, and a formula that is not finite at some particle.
    """
    fillings, known = _fillings(scene, comm, {} if meshes is None else meshes), scene.named_regions
    agree(comm, _mark_meshes(scene, fillings, known))
    check_memory(comm, sum(filling.count for filling in fillings))
    ends = np.cumsum([filling.count for filling in fillings])
    share = Slices(comm, int(ends[-1]))
    pieces = []
    for i, filling in enumerate(fillings):
        start = int(ends[i]) - filling.count
        low, high = max(share.first - start, 0), min(share.last - start, filling.count)
        if isinstance(filling, MeshFilling):
            filling.scatter(start, share)
        if low < high:
            piece = filling.piece(low, high)
            if known and piece.regions is None:
                mark_lattice(piece, known, scene.bodies[i].placed_on == "vertices")
            piece.identifier += start
            piece.body[:] = i
            pieces.append(piece)
    coarsest = max(filling.coarsest for filling in fillings)
    meshed = any(isinstance(filling, MeshFilling) for filling in fillings)
    particle_set = ParticleSet.joined(pieces, scene.dimension, len(known), meshed)
    particle_set.meshes = {
        filling.body.shape.model.mesh_key: filling.whole
        for filling in fillings
        if isinstance(filling, MeshFilling) and filling.body.placed_on == "vertices"
    }
    # notes on nodes left out of meshes, and on elements that were turned
    notes, files = list[Note](), set()
    for i, filling in enumerate(fillings):
        if not isinstance(filling, MeshFilling):
            continue
        key = filling.body.shape.model.mesh_key
        if filling.unused and key not in files:
            notes.append(Note("unused-nodes", f"bodies.{i}: {filling.unused} nodes of no element, which are left out"))
        files.add(key)
        if filling.turned:
            text = f"{filling.turned} elements whose nodes are ordered inside out, which are turned"
            notes.append(Note("turned-elements", f"bodies.{i}: {text}"))
    particle_set.notes = notes
    agree(comm, overlap_faults(scene, fillings, particle_set, comm))
    agree(comm, touching_faults(scene, particle_set, comm))
    del fillings
    everywhere = np.ones(len(particle_set), bool)
    chosen = [selected(scene, one, particle_set, comm) if one.on_particles else everywhere for one in scene.boundaries]
    # regions without particles: of boundaries (chosen), probes, initial states and output
    named = uses_of_regions(scene)
    keys = {place[1]: place for place, _ in named if place[0] == "boundaries"}
    masks: list[tuple[tuple[Any, ...], Any]] = [(keys.get(i, ("boundaries", i)), mask) for i, mask in enumerate(chosen)]
    for place, name in named:
        if place[0] != "boundaries":
            masks.append((place, particles_of(name, scene, particle_set)))
    count = np.array([mask.sum() for _, mask in masks], np.int64)
    comm.Allreduce(MPI.IN_PLACE, count, op=MPI.SUM)
    faults = _distant_probes(scene, particle_set, coarsest, comm)
    faults += [fault(place, "a region that holds particles", int(n)) for (place, _), n in zip(masks, count) if n == 0]
    agree(comm, faults + _not_finite(scene, particle_set, chosen, comm))
    agree(comm, contradictions(scene, particle_set.position, particle_set.spacing.min(axis=1), chosen, comm))
    return particle_set


def check_memory(comm: MPI.Comm, particles: int) -> None:
    """Raise SceneError, on all ranks, when their memory is too small for so many particles; collective."""
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = free_bytes() / machine.size
    machine.Free()
    room = minimum(comm, share) * comm.size
    needed = particles * LEAST_BYTES
    if needed > room:
        free = f"the {room / 2**30:.3g} GiB of memory which are free on {comm.size} rank{'s' * (comm.size > 1)}"
        found = f"{particles:,}, which take at least {needed / 2**30:.3g} GiB"
        raise SceneError([f"bodies: expected particles that fit into {free}, found {found}"])


def _fillings(scene: Scene, comm: MPI.Comm, meshes: dict[Any, MeshSlices]) -> list[Filling]:
    fillings: dict[int, Filling] = {}
    faults: list[str] = []
    groups: dict[Any, list[str]] = {}
    # bodies whose elements hold together by shared nodes alone
    by_nodes = {
        body
        for one in scene.systems
        for body, bonds in zip(one.bodies, one.settings.bonding(scene, one.bodies))
        if not bonds
    }
    for body in scene.bodies:
        if body.shape.kind == "mesh" and body.shape.model.group is not None:
            groups.setdefault(body.shape.model.mesh_key, []).append(body.shape.model.group)
    for i, body in enumerate(scene.bodies):
        try:
            if body.shape.kind != "mesh":
                fillings[i] = filling_of(body, scene.dimension, comm)
                continue
            mesh = whole_mesh(comm, body.shape.model, scene.dimension, meshes)
            own = groups.get(body.shape.model.mesh_key, ())
            fillings[i] = filling_of(body, scene.dimension, comm, mesh, own, i in by_nodes)
        except SceneError as error:
            place = ("bodies", i, "shape", "mesh")
            faults += [
                one.at(place) if isinstance(one, MeshFault) else f"{key_path((*place, 'file'))}: {one}"
                for one in error.faults
            ]
    agree(comm, faults)
    for i, filling in fillings.items():
        if filling.count < 2:
            faults.append(fault(("bodies", i), "a body of at least two particles", filling.count))
        size = filling.upper - filling.lower
        if not (np.isfinite(size).all() and LEAST < size.min() and np.abs([filling.lower, filling.upper]).max() < MOST):
            faults.append(fault(("bodies", i), f"a body with sides from {LEAST:g} to {MOST:g} m", size.tolist()))
    extents = {i: Extent(one.lower, one.upper, one.coarsest) for i, one in fillings.items()}
    for i, boundary in enumerate(scene.boundaries):
        faults += [fault(*detail) for detail in unbounded_plane(i, boundary, scene.bodies, extents)]
    agree(comm, faults)
    return list(fillings.values())


def _mark_meshes(scene: Scene, fillings: list[Filling], known: dict[str, Region]) -> list[str]:
    """Mark the particles of meshes in regions; returns faults of groups that no mesh has."""
    meshes = [filling for filling in fillings if isinstance(filling, MeshFilling)] if known else []
    for mesh in meshes:
        mesh.mark(known)
    there = sorted({name for mesh in meshes for name in mesh.groups})
    faults: list[str] = []
    for name, region in known.items():
        for group in sorted(region.groups({}) - set(there) if not region.parts else ()):
            known_names = ", ".join(map(repr, [*(one.name for one in scene.regions), *there])) or "there is none"
            what = f"the name of a region or of a group of a mesh ({known_names}){suggestion(group, there)}"
            places: list[tuple[Any, ...]] = [
                ("regions", i, "group") for i, one in enumerate(scene.regions) if one.name == name
            ]
            places += [place for place, used in uses_of_regions(scene) if used == name]
            faults.append(fault(places[0] if places else ("regions",), what, group))
    return faults


def _distant_probes(scene: Scene, particle_set: ParticleSet, coarsest: float, comm: MPI.Comm) -> list[str]:
    probes = [(i, probe.at) for i, probe in enumerate(scene.probes) if probe.at is not None]
    if not probes:
        return []
    _, distance = nearest_particles(
        comm, particle_set.identifier, particle_set.position, np.array([at for _, at in probes])
    )
    # a cell's corner is half a diagonal away from its particle
    reach = coarsest * max(1.0, 0.5 * np.sqrt(scene.dimension)) * (1.0 + 1e-9)
    return [
        fault(("probes", i, "at"), f"a point within one spacing of a particle (the nearest is {away:g} m away)", at)
        for (i, at), away in zip(probes, distance)
        if away > reach
    ]


def _formulas(
    scene: Scene, particle_set: ParticleSet, chosen: list[np.ndarray]
) -> Iterator[tuple[tuple[Any, ...], FormulaVector | PreviousField, np.ndarray]]:
    """Every formula and every field of results of the scene: key, formula, and the particles at which it is needed."""
    for i, body in enumerate(scene.bodies):
        here = particle_set.body == i
        for key in ("velocity", "displacement"):
            if getattr(body, key) is not None:
                yield ("bodies", i, key), getattr(body, key), here
        for key in ("temperature", "micro_rate"):
            if getattr(body, key) is not None:
                yield ("bodies", i, key), _as_vector(getattr(body, key)), here
        for row, formulas in enumerate(body.deformation_gradient or ()):
            yield ("bodies", i, "deformation_gradient", row), formulas, here
    for i, state in enumerate(scene.initial):
        here = meant(scene, state, particle_set.body, particle_set.regions)
        for key in ("velocity", "displacement", "temperature"):
            if getattr(state, key) is not None:
                yield ("initial", i, key), _as_vector(getattr(state, key)), here
        for values in state.of_results:
            yield ("initial", i, "results"), values, here
        for key in ("deformation_gradient", "stress"):
            for row, formulas in enumerate(getattr(state, key) or ()):
                yield ("initial", i, key, row), formulas, here
    for i, boundary in enumerate(scene.boundaries):
        for key, formulas in boundary.formulas.items():
            yield ("boundaries", i, key), formulas, chosen[i]
    for key in ("body_force", "acceleration", "heat_source"):
        if getattr(scene.loads, key) is not None:
            yield ("loads", key), _as_vector(getattr(scene.loads, key)), np.ones(len(particle_set), bool)


def _as_vector(formulas: Formula | FormulaVector) -> FormulaVector:
    return FormulaVector((formulas,)) if isinstance(formulas, Formula) else formulas


def _not_finite(scene: Scene, particle_set: ParticleSet, chosen: list[np.ndarray], comm: MPI.Comm) -> list[str]:
    """Faults of formulas that are not finite at time 0, and of temperatures below 0 K; each names the particle of
    lowest id of all ranks."""
    first: list[Any] = []
    faults: list[Any] = []
    for key, formulas, here in _formulas(scene, particle_set, chosen):
        rows = np.flatnonzero(here)
        values = formulas.evaluate(particle_set.position[rows]).reshape(len(rows), len(formulas))
        wanted, sound = f"a finite value of a size up to {MOST:g}", np.abs(values) <= MOST
        of_results = isinstance(formulas, PreviousField)
        if isinstance(formulas, PreviousField):
            wanted = f"{formulas.name} of particles of the results near by"
        if key[0] in ("bodies", "initial") and key[-1] == "temperature":
            wanted, sound = "a temperature of at least 0 K", sound & (values >= 0.0)
        if key[0] == "bodies" and key[-1] == "micro_rate":
            wanted, sound = "a rate that is not negative (plastic flow does not run backwards)", sound & (values >= 0.0)
        for component in range(len(formulas)):
            bad = rows[~sound[:, component]]
            worst = bad[np.argmin(particle_set.identifier[bad])] if len(bad) else None
            first.append(NOBODY if worst is None else particle_set.identifier[worst])
            if worst is None:
                faults.append(None)
                continue
            place = place_in_words(particle_set.position[worst])
            value = values[np.searchsorted(rows, worst), component]
            faults.append(
                f"{key_path(key if of_results or len(formulas) == 1 else (*key, component))}: "
                f"expected {wanted} at every particle, "
                f"found {value} at particle {particle_set.identifier[worst]} ({place})"
            )
    mine = np.array(first, np.int64)
    lowest = np.empty_like(mine)
    comm.Allreduce(mine, lowest, op=MPI.MIN)
    return [text for text, own, low in zip(faults, mine, lowest) if text is not None and own == low]


def contradictions(
    scene: Scene, places: np.ndarray, spacing: Any, chosen: list[np.ndarray], comm: MPI.Comm, what: str = "particles"
) -> list[str]:
    """Faults of conditions that prescribe different values of a component of the same particles, or nodes of a grid,
    the same on all ranks. Collective.

    places (n, d) [m], spacing, a number or (n,) [m]: of this rank's particles; chosen: for each condition which of them
    (n,) bool. Equal values are no fault: planes of rest and of symmetry meet at edges. Supports with images hold only
    the particles on their plane; supports of oblique surfaces hold no component.
    """
    held: dict[int, np.ndarray] = {}
    for i, (one, here) in enumerate(zip(scene.boundaries, chosen)):
        components = _held(one, places, spacing, here)
        if components is not None:
            held[i] = components
    pairs = list(itertools.combinations(held, 2))
    counts = np.zeros((len(pairs), scene.dimension), np.int64)
    for k, (j, i) in enumerate(pairs):
        both = held[j] & held[i]
        for axis in np.flatnonzero(both.any(axis=0)):
            points = np.ascontiguousarray(places[both[:, axis]])
            counts[k, axis] = _unlike(scene, scene.boundaries[j], scene.boundaries[i], points, int(axis)).sum()
    comm.Allreduce(MPI.IN_PLACE, counts, op=MPI.SUM)
    faults: list[str] = []
    for (j, i), row in zip(pairs, counts):
        axes = np.flatnonzero(row)
        if len(axes):
            along = " and ".join("XYZ"[axis] for axis in axes)
            expected = (
                f"no other motion along {along} of {what} that boundaries.{j} ({scene.boundaries[j].kind!r}) holds"
            )
            faults.append(fault(("boundaries", i), expected, Phrase(f"{row.max()} {what} in both"), "contradiction"))
    return faults


def _held(condition: Condition, places: np.ndarray, spacing: Any, here: np.ndarray) -> np.ndarray | None:
    """Components (n, d) bool that a condition holds; None without any."""
    d = places.shape[1]
    if isinstance(condition, MotionCondition):
        return np.asarray(here[:, None] & ~condition.prescribed.free[:d])
    if not isinstance(condition, Support) or (condition.plane is None and condition.kind != "fixed"):
        return None
    if condition.plane is None:
        return np.repeat(here[:, None], d, axis=1)
    if condition.mirror:
        away = np.abs(places[:, condition.plane.axis] - condition.plane.offset)
        here = here & (away <= _ON_PLANE * spacing)
    return np.asarray(here[:, None] & condition.holds(d))


def _unlike(scene: Scene, first: Condition, second: Condition, points: np.ndarray, axis: int) -> np.ndarray:
    """At which points (n, d) [m] two conditions prescribe different values of a component; a velocity and a
    displacement are equal where both are 0."""
    result = np.zeros(len(points), bool)
    same_quantity = _quantity(first) in (None, _quantity(second)) or _quantity(second) is None
    for moment in _MOMENTS:
        values = [_values(one, points, moment * scene.end_time) for one in (first, second)]
        # relative to the whole vectors
        rounding = _SAME * np.linalg.norm(values, axis=2).max(axis=0)
        one, other = (value[:, axis] for value in values)
        result |= np.abs(one - other) > rounding if same_quantity else np.maximum(abs(one), abs(other)) > rounding
    return result


def _quantity(condition: Any) -> str | None:
    """ "velocity" or "displacement"; None at rest."""
    if isinstance(condition, Support):
        return None if condition.velocity is None else "velocity"
    return str(condition.quantity)


def _values(condition: Any, points: np.ndarray, time: float) -> np.ndarray:
    """Values (n, d) at points (n, d) [m] and a time [s]; 0 of components that are free."""
    d = points.shape[1]
    if isinstance(condition, Support):
        if condition.velocity is None:
            return np.zeros(points.shape)
        return np.asarray(LoadHistory(condition.velocity).evaluate(points, time)[:, :d])
    return np.asarray(np.where(condition.prescribed.free[:d], 0.0, condition.prescribed.evaluate(points, time)[:, :d]))


def overlap_faults(scene: Scene, fillings: list[Any], particle_set: ParticleSet, comm: MPI.Comm) -> list[str]:
    """Faults of bodies with particles inside other bodies, the same on all ranks; collective.

    Particles on a surface are not inside.
    """
    lower, upper = (np.array([getattr(one, name) for one in fillings], float) for name in ("lower", "upper"))
    close = [(i, j) for i, j in np.transpose(close_boxes(lower, upper, 0.0)).tolist() if _near(fillings, i, j)]
    pairs = sorted([*close, *((j, i) for i, j in close)])
    counts = np.zeros(len(pairs), np.int64)
    for number, (outer, inner) in enumerate(pairs):
        shape: Any = scene.bodies[outer].shape
        places = particle_set.position[particle_set.body == inner]
        moved = scene.bodies[outer].jitter or scene.bodies[inner].jitter
        margin = (_JITTER if moved else _ROUND_OFF) * max(fillings[outer].coarsest, fillings[inner].coarsest)
        if shape.kind == "mesh":
            # collective
            counts[number] = fillings[outer].inside(places, margin)
        elif len(places):
            counts[number] = np.count_nonzero(shape.model.inside(places, margin))
    comm.Allreduce(MPI.IN_PLACE, counts, op=MPI.SUM)
    return [
        fault(
            ("bodies", inner),
            "a body that lies in no other",
            Phrase(f"{count} particles of {_name(scene, inner)} inside {_name(scene, outer)}"),
        )
        for (outer, inner), count in zip(pairs, counts)
        if count
    ]


def _near(fillings: list[Any], i: int, j: int) -> bool:
    one, other = fillings[i], fillings[j]
    return bool((one.lower < other.upper).all() and (other.lower < one.upper).all())


def _name(scene: Scene, number: int) -> str:
    return repr(scene.bodies[number].name or f"bodies.{number}")
