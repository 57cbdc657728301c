"""The state of a method's particles that another run goes on from: which fields it is, as written, as taken.

It is what settings name as `evolved`: declared fields that an integrator carries on, and from which all else follows
but for forces that the last step has found with velocities within it: these the very same particles go on with.
"""

from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.collective import anywhere, raise_together
from parsolid.particles.initial_fields import meant
from parsolid.particles.law_values import state_variable_fields
from parsolid.scene.previous_results import STATE, PreviousField, StepOfResults, methods_of

# between particles, too
_BOUNDS = {"plastic_strain": (0.0, None), "damage": (0.0, 1.0)}
# components in a file, where vectors and tensors are those in space
_IN_SPACE = {1: (1, 3), 2: (3,), 4: (9,)}
# what follows from the rest of a state
_DERIVED = ("jacobian", "cofactor")


def state_variable_names(system: Any) -> list[str]:
    """Declared fields of a system's state besides its places: those of the settings that the scene has."""
    settings = system.settings
    return _named(system, (*_evolved(system), *settings.state_forces, *settings.contact_variables))


def _evolved(system: Any) -> tuple[str, ...]:
    """Patterns of the fields without which a state is none: the method's, and state variables of laws."""
    settings = system.settings
    return (*settings.state_variables, *state_variable_fields(system.particles), *settings.state_of_particles)


def _named(system: Any, patterns: tuple[str, ...]) -> list[str]:
    return [name for name in system.particles.fields if any(fnmatchcase(name, one) for one in patterns)]


def state_rows(system: Any, name: str) -> np.ndarray | None:
    """One of them by its name in a file, (owned, components); None where the system has none of that name."""
    own = name.removeprefix(STATE)
    return None if own not in state_variable_names(system) else two_axes(system.particles.owned_rows(own))


def two_axes(rows: np.ndarray) -> np.ndarray:
    """Rows (n,) or (n, components) as (n, components), a view."""
    return rows[:, None] if rows.ndim == 1 else rows


def take_state(comm: Any, scene: Any, system: Any, particle_set: Any) -> bool:
    """Put the states of other runs into a system's particles, which are in the order of the particle set; whether there
    are any. Collective.

    Raises SolverError, on all ranks, where results have no such state, or not of particles that must be the same.
    """
    states = [(i, state) for i, state in enumerate(scene.initial) if state.takes_state]
    faults: list[str] = []
    for i, state in states:
        here = np.flatnonzero(meant(scene, state, particle_set.body, particle_set.regions))
        known, kind = methods_of(Path(state.results)), system.settings.kind
        if known and kind not in known:
            found = f"{' and '.join(known)}, of which fields are taken by name"
            faults.append(f"initial.{i}.fields: expected the state of results of {kind}, found those of {found}")
        faults += _taken(system, state.of("velocity"), here, particle_set.position[here], f"initial.{i}.fields")
    raise_together(comm, faults[0] if faults else None)
    return bool(states)


def _steps_with(velocity: PreviousField, name: str, components: int) -> list[StepOfResults]:
    """The blocks of results that have a field of a state, with so many components."""
    widths = _IN_SPACE.get(components, (components,))
    return [step for step in velocity.steps if step.names.get(STATE + name) in widths]


def _taken(system: Any, velocity: PreviousField, here: np.ndarray, places: np.ndarray, key: str) -> Iterator[str]:
    """Put every field of a state into rows (n,) with reference places (n, d) [m]; what was wrong with it."""
    settings = system.settings
    for name in _named(system, _evolved(system)):
        rows = two_axes(system.particles.owned_rows(name))
        steps = _steps_with(velocity, name, rows.shape[1])
        if not steps:
            told = _missing(velocity, name, rows.shape[1])
            yield f"{key}: expected results with the state of this method, {told}{settings.without_state(name)}"
            return
        source = PreviousField(steps, STATE + name, velocity.dimension, rows.shape[1])
        if any(fnmatchcase(name, one) for one in settings.state_of_particles):
            values, same = source.of_particles(places)
            strange = ~same & (values != 0).any(axis=1)
            if strange.any():
                where = _told(places[np.argmax(strange)])
                yield f"{key}: expected the particles of the results, as each has {name} of its own, found ({where})"
                return
            rows[here[same]] = values[same]
            continue
        values = source.components(places)
        if not (near := np.isfinite(values).all(axis=1)).all():
            yield f"{key}: expected results near every particle, found none near ({_told(places[np.argmin(near)])})"
            return
        if name in _BOUNDS:
            values = np.clip(values, *_BOUNDS[name])
        rows[here] = values
    yield from _taken_between(system, velocity, here, places, key)
    # fields of this method's state that results have and the scene has no place for
    own, evolved = state_variable_names(system), _evolved(system)
    needed = _named(system, evolved)
    blocks = [step.names for step in velocity.steps if all(STATE + name in step.names for name in needed)]
    found = [
        [
            name.removeprefix(STATE)
            for name in names
            if any(fnmatchcase(name, STATE + one) for one in evolved)
            and name.removeprefix(STATE) not in (*own, *_DERIVED)
        ]
        for names in blocks
    ]
    if lost := min(found, key=len, default=[]):
        yield f"{key}: expected a scene with all of the state of the results, found none with {', '.join(lost)}"


def _taken_between(
    system: Any, velocity: PreviousField, here: np.ndarray, places: np.ndarray, key: str
) -> Iterator[str]:
    """Put what contact and tools of the results kept with particles into these, if they are the same; what was wrong.

    Others begin as at a start: what they held is no field.
    """
    for name in _named(system, system.settings.contact_variables):
        rows = two_axes(system.particles.owned_rows(name))
        had = [step for step in velocity.steps if STATE + name in step.names]
        if not had:
            continue
        steps = _steps_with(velocity, name, rows.shape[1])
        if not steps:
            yield f"{key}: expected the contacts of the results, between as many bodies, found others"
            return
        values, same = PreviousField(steps, STATE + name, velocity.dimension, rows.shape[1]).of_particles(places)
        rows[here[same]] = values[same]


def _missing(velocity: PreviousField, name: str, components: int) -> str:
    """What a method's state should have and what results have."""
    had = sorted({one.removeprefix(STATE) for step in velocity.steps for one in step.names if STATE in one})
    if name in had:
        return f"{name} with as many components as the laws of this scene have, {components}, found another number"
    found = f"one with {', '.join(had)}" if had else 'none (output.fields = ["state"] writes it)'
    return f"{name} among it, found {found}"


def _told(place: np.ndarray) -> str:
    return ", ".join(f"{one:.6g}" for one in place)


def take_forces(comm: Any, scene: Any, system: Any) -> bool:
    """Put the forces that the runs before ended with into a system's particles, wherever they are now, if all are those
    of results with a state; whether that is so. Collective.
    """
    states = [state for state in scene.initial if state.takes_state]
    if not states:
        return False
    rows = system.particles.owned_rows
    regions = rows("regions") if "regions" in system.particles else None
    body, places = rows("body"), rows("reference_position")
    found: dict[str, np.ndarray] = {}
    for name in _named(system, system.settings.state_forces):
        filled = np.zeros(len(places), bool)
        found[name] = np.zeros_like(two_axes(rows(name)))
        for state in states:
            steps = _steps_with(state.of("velocity"), name, found[name].shape[1])
            here = np.flatnonzero(meant(scene, state, body, regions))
            if steps and len(here):
                source = PreviousField(steps, STATE + name, system.dimension, found[name].shape[1])
                found[name][here], filled[here] = source.of_particles(places[here])
        if anywhere(comm, not filled.all()):
            return False
    for name, values in found.items():
        two_axes(rows(name))[:] = values
    return True
