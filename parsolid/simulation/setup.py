"""The systems of a scene: each body's particles go to the method that has the body.

States at time 0 that no run should start from are refused: matter inside out, a deformation gradient of another motion.
"""

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from parsolid.collective import SolverError, raise_together
from parsolid.contact.interactions import declare_interactions
from parsolid.methods import method_class
from parsolid.methods.protocol import ParticleSystem
from parsolid.observables.declared import Observables
from parsolid.output.errors import OutputError
from parsolid.output.fields import check_step
from parsolid.particles.distribution import distribute, take
from parsolid.particles.generation import generate
from parsolid.particles.initial_fields import initial_deformation_gradient, initial_displacement, taken_from_results
from parsolid.particles.meshes.slices import MeshSlices
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene, SceneError
from parsolid.scene.method_settings import named_observables
from parsolid.scene.systems import SystemOfScene, qualify_keys
from parsolid.scene.validation_errors import fault
from parsolid.simulation.restart import Restart

# of a spacing, for differences of the formulas; what they may be off by, over 1 + |grad u|
_DIFFERENCE, _TOLERANCE = 1e-5, 1e-3
# that counts as one
_STRAIN = 1e-8
# energy that the balance has the round-off of, over modulus times volume: 1e-12 of it, see `energy_check`, is four to
# five times what one bit of J is worth in the particles' strain energy
_ROUNDED = 1e-3


# numbers that are not finite are what is looked for
@np.errstate(all="ignore")
def refuse_unsound_start(comm: Any, scene: Scene, system: ParticleSystem, particle_set: ParticleSet) -> None:
    """scene, particle_set: of the system alone. Raises SolverError, on all ranks, which names the key; collective."""
    raise_together(comm, _misfit(scene, system, particle_set))
    raise_together(comm, _inside_out(scene, system))
    raise_together(comm, _strained(scene, system, particle_set))


def refuse_damaged_results(comm: Any, scene: Scene) -> None:
    """Raises SolverError, on all ranks, where results that a start is taken from are not as they were written;
    collective."""
    fault = None
    if comm.rank == 0:
        taken = [one.steps for state in scene.initial if state.results for one in state.of_results]
        try:
            for step in {step.path: step for steps in taken for step in steps}.values():
                check_step(step.path, step.first // max(1, step.count), step.count)
        except OutputError as error:
            fault = str(error)
    raise_together(comm, fault)


def _inside_out(scene: Scene, system: ParticleSystem) -> str | None:
    found = system.first_invalid() if system.owned else None
    if found is None:
        return None
    index, what = found
    rows = system.particles.owned_rows
    body = int(rows("body")[index])
    place = _numbers(rows("reference_position")[index])
    number = int(rows("identifier")[index])
    stated = [key for key in ("deformation_gradient", "displacement") if getattr(scene.bodies[body], key) is not None]
    key = ".".join(["bodies", str(system.bodies[body]), *stated[:1]])
    expected = "a start that is not folded" if stated or scene.initial else "a start that the method can hold"
    return f"{key}: expected {expected}, found particle {number} at X = ({place}): {what}"


def _strained(scene: Scene, system: ParticleSystem, particle_set: ParticleSet) -> str | None:
    """The first particle that starts folded, or with a strain of which its law has no stress."""
    place, body = particle_set.position, particle_set.body
    first = body[:1], place[:1], _first(particle_set.regions)
    given = initial_deformation_gradient(scene, *first) is not None
    if not len(particle_set) or (not given and initial_displacement(scene, *first) is None):
        return None
    small = _DIFFERENCE * float(particle_set.spacing.min())
    F = np.stack(
        [_column(scene, particle_set, axis, step) for axis, step in enumerate(small * np.eye(len(place[0])))], 2
    )
    stated = ~taken_from_results(scene, body, particle_set.regions)
    folded = stated & (~(np.linalg.det(F) > 0.0) | _turned_inside_out(scene, particle_set))
    if folded.any():
        return _start_of(system, particle_set, folded, "a start that is not folded")
    carries = [getattr(type(one.material).declared, "of_strain", True) for one in scene.bodies]
    # rounding of places far away is no strain
    rounding = np.finfo(float).eps * (1.0 + np.abs(system.particles.owned_rows("position")).max(initial=0.0)) / small
    expected = "no strain (this law's stress is integrated in time, not of a strain)"
    wanted = initial_deformation_gradient(scene, body, place, particle_set.regions)
    for key, gradient in (("displacement", F), ("deformation_gradient", F if wanted is None else wanted[0])):
        strain = np.abs(gradient.swapaxes(1, 2) @ gradient - np.eye(len(place[0]))).max(axis=(1, 2))
        lost = stated & (strain > _STRAIN + 10.0 * rounding) & ~np.array(carries)[body]
        if lost.any():
            return _start_of(system, particle_set, lost, expected, key)
    return None


def _turned_inside_out(scene: Scene, particle_set: ParticleSet) -> np.ndarray:
    """Which particles (n,) bool of boxes a displacement that jumps turns over with the next ones along the axes."""
    result = np.zeros(len(particle_set), bool)
    for number, body in enumerate(scene.bodies):
        here = particle_set.body == number
        if body.shape.box is None or not here.any():
            continue
        # to the next particle of the box, or to the one before
        place, steps = particle_set.position, np.eye(scene.dimension) * particle_set.spacing[here].max(axis=0)
        columns = []
        for axis, step in enumerate(steps):
            inside = place[:, axis] + 0.99 * step[axis] < body.shape.box.upper[axis]
            ahead, behind = (_column(scene, particle_set, axis, sign * step) for sign in (1.0, -1.0))
            columns.append(np.where(inside[:, None], ahead, behind))
        result |= here & (np.linalg.det(np.stack(columns, 2)) <= 0.0)
    return result


def _first(regions: np.ndarray | None) -> np.ndarray | None:
    return None if regions is None else regions[:1]


def _start_of(
    system: ParticleSystem, particle_set: ParticleSet, bad: np.ndarray, expected: str, key: str = "displacement"
) -> str:
    index = int(np.argmax(bad))
    key = f"bodies.{system.bodies[int(particle_set.body[index])]}.{key}"
    return f"{key}: expected {expected}, found one at X = ({_numbers(particle_set.position[index])})"


def _misfit(scene: Scene, system: ParticleSystem, particle_set: ParticleSet) -> str | None:
    """The first particle whose deformation gradient is neither 1 + grad u from one side nor from the other."""
    given = initial_deformation_gradient(scene, particle_set.body, particle_set.position, particle_set.regions)
    if given is None or not len(particle_set):
        return None
    stated, where = given
    where = where & ~taken_from_results(scene, particle_set.body, particle_set.regions)
    off = np.zeros(len(particle_set))
    small = _DIFFERENCE * float(particle_set.spacing.min())
    for axis, step in enumerate(small * np.eye(scene.dimension)):
        # at a kink of the formula, either side will do
        sides = [_column(scene, particle_set, axis, sign * step) for sign in (1.0, -1.0)]
        misses = [np.abs(stated[:, :, axis] - side).max(axis=1) / (1.0 + np.abs(side).max(axis=1)) for side in sides]
        off = np.maximum(off, np.minimum(*misses))
    # what is not a number fits nothing
    bad = where & ~(off <= _TOLERANCE)
    if not bad.any():
        return None
    index = int(np.argmax(bad))
    body = system.bodies[int(particle_set.body[index])]
    return (
        f"bodies.{body}.deformation_gradient: expected 1 + the gradient of bodies.{body}.displacement, found one that "
        f"differs from it by {off[index]:.3g} of its size at X = ({_numbers(particle_set.position[index])})"
    )


def _column(scene: Scene, particle_set: ParticleSet, axis: int, step: np.ndarray) -> np.ndarray:
    """Column (n, d) of 1 + grad u along an axis, by a difference to one side."""
    place, body = particle_set.position, particle_set.body
    result = np.zeros_like(place)
    here, there = (initial_displacement(scene, body, at, particle_set.regions) for at in (place, place + step))
    if here is not None and there is not None:
        result = (there - here) / step[axis]
    result[:, axis] += 1.0
    return result


def _numbers(values: np.ndarray) -> str:
    return ", ".join(f"{value:.6g}" for value in values)


def build_systems(
    comm: Any, scene: Scene, restart: Restart | None, meshes: dict[Any, MeshSlices] | None = None
) -> tuple[list[ParticleSystem], list[ParticleSet]]:
    """Systems in their state at time 0, or in that of a restart, and the sorted particles of each; collective.

    meshes: see `generation.generate`. Raises SceneError or SolverError on all ranks when the scene cannot be set up.
    """
    plans = scene.systems
    if not restart:
        refuse_damaged_results(comm, scene)
    if restart and not restart.same_ranks:
        restart.distribute(scene)
    drawn = restart.particle_sets if restart else _generated(comm, scene, plans, meshes)
    systems: list[ParticleSystem] = []
    particle_sets, orders = [], []
    for plan, particle_set in zip(plans, drawn):
        kind, part = method_class(plan.settings), scene.part(plan)
        order = np.arange(len(particle_set))
        with _keys_of(scene, plan):
            if not (restart and restart.same_ranks):
                order = kind.sort(comm, part, particle_set)
            particle_sets.append(take(particle_set, order))
            orders.append(order)
            system = kind(comm, part, particle_sets[-1])
            system.bodies, system.name = plan.bodies, plan.name
            declare_interactions(scene, system)
            systems.append(system)
            if not restart:
                system.begin(part, particle_sets[-1])
            # rounding of J alone gives strain energies of the modulus times it
            modulus = np.array([system.wave_modulus(body)[0] for body in range(len(plan.bodies))])
            stiffness = comm.allreduce(float(modulus[particle_sets[-1].body] @ particle_sets[-1].volume))
            system.energy_scale = max(system.energy_scale, _ROUNDED * stiffness)
        if not restart:
            refuse_unsound_start(comm, part, system, particle_sets[-1])
    for particle_set in particle_sets:
        particle_set.meshes.clear()
    if restart:
        restart.apply_state(systems, orders)
    # fields that the scene's methods may have, but not with these options
    observables = Observables(systems)
    of_methods = {name for system in scene.systems for name in system.settings.field_kinds(scene.dimension)}
    faults = [
        fault(place, "a field that a method of this scene has with its options", name)
        for place, name in named_observables(scene)
        if place[-1] != "quantity" and name in of_methods and not observables.has(name)
    ]
    if faults:
        raise SceneError(faults)
    return systems, particle_sets


@contextmanager
def _keys_of(scene: Scene, plan: SystemOfScene) -> Iterator[None]:
    """Errors of a system, which knows its own part of the scene alone, in the keys of the whole scene."""
    try:
        yield
    except SceneError as error:
        raise SceneError([qualify_keys(scene, plan, text) for text in error.faults]) from error
    except SolverError as error:
        raise SolverError(qualify_keys(scene, plan, str(error))) from error


def _generated(
    comm: Any, scene: Scene, plans: tuple[SystemOfScene, ...], meshes: dict[Any, MeshSlices] | None
) -> list[ParticleSet]:
    """This rank's particles of each system, whose bodies are numbered anew from 0; collective."""
    whole = generate(scene, comm, meshes)
    pieces = []
    for plan in plans:
        piece = whole
        if len(plans) > 1:
            piece = take(whole, np.flatnonzero(np.isin(whole.body, plan.bodies)))
            number = np.zeros(len(scene.bodies), whole.body.dtype)
            number[list(plan.bodies)] = np.arange(len(plan.bodies))
            piece = dataclasses.replace(piece, body=number[piece.body])
        owner = method_class(plan.settings).owners(comm, scene.part(plan), piece)
        pieces.append(distribute(comm, piece, owner=owner))
    return pieces
