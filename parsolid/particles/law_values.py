"""Values of hyperelastic laws at each particle, as fields: directions and numbers by reference position, and state
variables (`materials.hyperelastic.at_particles`).

All are rows of one record; those of a law are adjacent. State variables are needed to restart; the others follow from
the scene.
"""

from typing import Any

import numpy as np

from decomposition.slices import Slices
from parsolid.collective import minimum, raise_together
from parsolid.materials.declaration import Direction, StateVariable
from parsolid.materials.hyperelastic.at_particles import Member, members, value_count
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Within
from parsolid.particles.meshes.files import kinds_in, read_with_meshio, solid_mesh
from parsolid.particles.meshes.geometry import is_geometry
from parsolid.particles.meshes.imported import is_imported
from parsolid.particles.meshes.slices import agreed
from parsolid.scene.materials import ValueFault
from parsolid.scene.validation_errors import SceneError

RECORD = "law_values"


def rows_of_laws(laws: list[Any]) -> dict[Any, slice]:
    """Rows of the record for each law with such values; laws with the same members share rows."""
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
    """Declare the record, with values at time 0, where a law needs it; laws: of the scene's bodies. Collective. Raises
    SolverError on all ranks for a direction of length 0, and for a mesh without the data that a scene names."""
    rows = rows_of_laws(laws)
    if not rows:
        return
    total = max(of_law.stop for of_law in rows.values())
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
        for member in members(law):
            note, direction = member.note, isinstance(member.note, Direction)
            name = member.name if member.name not in particles else f"{member.name}_{row}"
            field = Field(
                name,
                particle_set.position.shape[1] if direction else note.components,
                note.unit,
                checkpointed=isinstance(note, StateVariable),
                shown=True,
                mirror="vector" if direction else "scalar",
                layout=Within(RECORD, row),
            )
            particles.declare(field, values[row : row + field.components].T if direction else values[row])
            row += note.components


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


def cell_data_at(
    comm: Any, body: Any, dimension: int, identifiers: np.ndarray, name: str, components: int
) -> np.ndarray:
    """Cell data (n, components) of this rank's particles of a body; identifiers (n,): theirs. components: 1, or 3 of
    directions, of which the sign is of no matter. Particles on nodes have the mean of the elements around. One rank
    reads the file. Raises SceneError on all ranks, also for another mesh than that of the particles. Collective."""
    of_reader: list[np.ndarray] = []
    particles = comm.allreduce(len(identifiers))

    def read() -> None:
        found = _of_particles(body, dimension, name, components)
        if len(found) != particles:
            raise SceneError(
                [f"expected the mesh of the {particles} particles, found {len(found)} in {body.shape.model.file}"]
            )
        of_reader.append(found)

    agreed(comm, read)
    slices = Slices(comm, particles)
    parts = [of_reader[0][slice(*slices.bounds(rank))] for rank in range(comm.size)] if of_reader else None
    first = int(minimum(comm, int(identifiers.min(initial=np.iinfo(np.int64).max))))
    return slices.fetch(identifiers - first, comm.scatter(parts))


def _of_particles(body: Any, dimension: int, name: str, components: int) -> np.ndarray:
    """Data (particles, components) of all of a body's particles in their order, that of its nodes or elements."""
    stated = body.shape.model
    blocks, values, group = _of_elements(stated, dimension, name, components)
    chosen = np.arange(len(values)) if group is None else group
    if not np.isfinite(values[chosen]).all():
        raise SceneError([f"expected cell data {name!r} that are numbers in every element, found others"])
    if body.placed_on != "vertices":
        return values[chosen]
    mine, start, used = np.zeros(len(values), bool), 0, []
    mine[chosen] = True
    for _, cells in blocks:
        here = start + np.flatnonzero(mine[start : start + len(cells)])
        used.append((cells[here - start], values[here]))
        start += len(cells)
    nodes = np.unique(np.concatenate([cells.ravel() for cells, _ in used]))
    count, sums = np.zeros(len(nodes)), np.zeros((len(nodes), components, components))
    for cells, data in used:
        places = np.searchsorted(nodes, cells)
        # of directions the sum of a a^T, which has no sign
        terms = data[:, :, None] * (data[:, None, :] if components > 1 else 1.0)
        for column in places.T:
            np.add.at(sums, column, terms)
            np.add.at(count, column, 1.0)
    if components == 1:
        return sums[:, :, 0] / count[:, None]
    # of vectors that are all 0 none
    there = np.trace(sums, axis1=1, axis2=2) > 0.0
    return np.where(there[:, None], np.linalg.eigh(sums)[1][:, :, -1], 0.0)


def _of_elements(stated: Any, dimension: int, name: str, components: int) -> tuple[list[Any], np.ndarray, Any]:
    """Blocks of solid elements, data (elements, components), and the numbers of a body's group or None."""
    path = stated.file
    if is_imported(path) or is_geometry(path, dimension):
        raise SceneError([f"expected a mesh file of another program, which has cell data, found {path}"])
    mesh = read_with_meshio(path)
    if name not in mesh.cell_data:
        known = ", ".join(map(repr, sorted(mesh.cell_data))) or "none"
        raise SceneError([f"expected the name of cell data of {path} ({known}), found {name!r}"])
    data, found = mesh.cell_data[name], []
    solid = solid_mesh(mesh, dimension)
    for block, values in zip(mesh.cells, data):
        if block.type in kinds_in(dimension) and len(block.data):
            found.append(np.asarray(values, float).reshape(len(block.data), -1))
    values = np.concatenate(found)
    if values.shape[1] != components and not (components == 3 and values.shape[1] == dimension):
        raise SceneError([f"expected cell data of {components} numbers an element, found {values.shape[1]}"])
    values = np.pad(values, ((0, 0), (0, components - values.shape[1])))
    group = None if stated.group is None else np.sort(solid.groups.elements[stated.group])
    return solid.blocks, values, group
