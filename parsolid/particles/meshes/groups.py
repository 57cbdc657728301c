"""Named groups of a mesh: meshio's cell_sets and point_sets, physical groups of Gmsh."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.particles.meshes.elements import ELEMENTS

# names that formats give to what nobody has named
_NOT_NAMES = ("gmsh:bounding_entities",)


class MeshGroups(NamedTuple):
    """Groups by name: nodes (k,), elements (k,) as they are counted over all blocks of solid ones, and facets as sorted
    nodes (k, nodes of a facet) by number of nodes."""

    nodes: dict[str, np.ndarray]
    elements: dict[str, np.ndarray]
    facets: dict[str, dict[int, np.ndarray]]

    @property
    def names(self) -> set[str]:
        """Of all groups."""
        return {*self.nodes, *self.elements, *self.facets}


def groups_of(mesh: Any, dimension: int) -> MeshGroups:
    """The groups of a mesh of meshio in `dimension`.

    A Gmsh group without a name is found by its number, unless groups of several dimensions have that number.
    """
    groups = MeshGroups({}, {}, {})
    for name, nodes in (mesh.point_sets or {}).items():
        groups.nodes[name] = np.asarray(nodes, np.int64)
    chosen: dict[str, list[Any]] = {
        name: [np.asarray([] if one is None else one, np.int64) for one in rows]
        for name, rows in (mesh.cell_sets or {}).items()
        if name not in _NOT_NAMES
    }
    # version 4.0 has an element of several groups in the sets of all of them, but with one tag
    for name, rows in _tagged(mesh).items():
        chosen[name] = [np.union1d(*both) for both in zip(chosen[name], rows)] if name in chosen else rows
    for name, rows in chosen.items():
        _add(groups, name, mesh.cells, rows, dimension)
    return groups


def _tagged(mesh: Any) -> dict[str, list[np.ndarray]]:
    """Rows of each block's elements that have the tag of a physical group of Gmsh, by the group's name or number.

    An element has one tag or a row of them; negative ones, of entities that are turned around, count alike.
    """
    tags = [np.abs(own).reshape(len(own), -1 if len(own) else 1) for own in mesh.cell_data.get("gmsh:physical", [])]
    if not tags:
        return {}
    dimensions = [_dimension(block.type) for block in mesh.cells]
    pairs = [(name, np.ravel(numbers).tolist()) for name, numbers in (mesh.field_data or {}).items()]
    names = {(number, of): name for name, own in pairs for number, of in zip(own[::2], own[1::2])}
    found = {(int(tag), of) for own, of in zip(tags, dimensions) for tag in np.unique(own) if tag > 0}
    for tag, of in found - names.keys():
        if str(tag) not in names.values() and sum(number == tag for number, _ in found) == 1:
            names[tag, of] = str(tag)
    rows: dict[str, list[np.ndarray]] = {}
    for (tag, of), name in names.items():
        found_here = [np.flatnonzero((own == tag).any(axis=1) & (here == of)) for own, here in zip(tags, dimensions)]
        rows[name] = [np.concatenate(both) for both in zip(rows[name], found_here)] if name in rows else found_here
    return rows


def _dimension(kind: str) -> int:
    return {"vertex": 0, "line": 1, "triangle": 2, "quad": 2}.get(kind, 3)


def _add(groups: MeshGroups, name: str, blocks: Any, rows: list[np.ndarray], dimension: int) -> None:
    first = 0
    for block, here in zip(blocks, rows):
        solid = block.type in ELEMENTS and ELEMENTS[block.type].dimension == dimension
        nodes = np.asarray(block.data, np.int64)[here]
        if solid:
            groups.elements[name] = np.concatenate([groups.elements.get(name, np.zeros(0, np.int64)), here + first])
            first += len(block.data)
        elif len(here) and _dimension(block.type) == dimension - 1:
            of_width = groups.facets.setdefault(name, {})
            before = of_width.get(nodes.shape[1], nodes[:0])
            of_width[nodes.shape[1]] = np.concatenate([before, np.sort(nodes, axis=1)])
        elif len(here):
            groups.nodes[name] = np.union1d(groups.nodes.get(name, np.zeros(0, np.int64)), nodes)
