"""What hyperelastic laws have of each particle, as a field of the particles: directions and numbers by reference place,
and state variables (`materials.hyperelastic.at_particles`).

All are rows of one record, where each law finds its own one after the other. State variables are needed to restart;
the rest follows from the scene.
"""

from typing import Any

import numpy as np

from parsolid.collective import raise_together
from parsolid.materials.declaration import Direction, StateVariable
from parsolid.materials.hyperelastic.at_particles import Member, members, value_count
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Within
from parsolid.particles.meshes.cell_data import cell_data_at
from parsolid.scene.materials import ValueFault
from parsolid.scene.validation_errors import SceneError

RECORD = "law_values"


def rows_of_laws(laws: list[Any]) -> dict[Any, slice]:
    """Rows of the record for each law that has any; laws with the same members share theirs."""
    known: dict[tuple[Member, ...], slice] = {}
    result, total = {}, 0
    for law in laws:
        own = members(law) if hasattr(law, "branch_moduli") else ()
        if own and own not in known:
            known[own] = slice(total, total + value_count(law))
            total = known[own].stop
        if own:
            result[law] = known[own]
    return result


def flat_values(particles: Particles, rows: slice | None) -> tuple[np.ndarray, int] | None:
    """Rows of the record as `at_particle` takes them, a flat array and its stride; None without rows."""
    if rows is None:
        return None
    values = particles.storage(RECORD)[rows]
    return values.ravel(), values.shape[1]


def declare_law_values(comm: Any, scene: Any, particles: Particles, particle_set: Any, laws: list[Any]) -> None:
    """Declare the record, filled for time 0, where any law needs it; laws: of the scene's bodies. Collective. Raises
    SolverError on all ranks for what is no direction, and for a mesh without the data that a scene names."""
    rows = rows_of_laws(laws)
    if not rows:
        return
    total = max(one.stop for one in rows.values())
    values, fault, owned = np.zeros((total, particles.owned)), None, particles.owned
    for i, (body, law) in enumerate(zip(scene.bodies, laws)):
        if law not in rows:
            continue
        here = np.flatnonzero(particle_set.body[:owned] == i)
        try:
            of_cells = _cell_data(comm, body, scene.dimension, particle_set.identifier[here])
            bands = scene.method.band(particle_set.spacing[here])
            values[rows[law], here] = body.material.values_at(particle_set.position[here], of_cells, bands)
        except (SceneError, ValueFault) as error:
            fault = fault or f"bodies.{i}.material.{error}"
    raise_together(comm, fault)
    # a field of one component is (n,)
    particles.declare(Field(RECORD, total, "", layout=Columns()), values.T if total > 1 else values[0])
    # each member is a field within the record, by its name
    for first, law in {place.start: law for law, place in rows.items()}.items():
        row = first
        for one in members(law):
            direction = isinstance(one.note, Direction)
            count = particle_set.position.shape[1] if direction else one.note.components
            told: dict[str, Any] = {"checkpointed": isinstance(one.note, StateVariable), "shown": True}
            told |= {"mirror": "vector" if direction else "scalar", "layout": Within(RECORD, row)}
            name = one.name if one.name not in particles else f"{one.name}_{row}"
            particles.declare(
                Field(name, count, one.note.unit, **told), values[row : row + count].T if direction else values[row]
            )
            row += one.note.components


def state_variable_fields(particles: Particles) -> tuple[str, ...]:
    """Names of the fields that are state variables of laws."""
    return tuple(
        one.name
        for one in particles.fields.values()
        if one.checkpointed and isinstance(one.layout, Within) and one.layout.record == RECORD
    )


def _cell_data(comm: Any, body: Any, dimension: int, identifiers: np.ndarray) -> dict[str, np.ndarray]:
    """Cell data of a body's particles (n, components) by the names of members, none without a mesh. Raises SceneError
    on all ranks for a file that cannot be read or lacks them. Collective."""
    found: dict[str, np.ndarray] = {}
    if body.shape.kind != "mesh":
        return found
    for member, (name, components) in body.material.cell_data.items():
        try:
            found[member] = cell_data_at(comm, body, dimension, identifiers, name, components)
        except SceneError as error:
            raise SceneError([f"{member}.cell_data: {error}"]) from error
    return found
