"""Meshes as text of Gmsh's version 2.2, which many programs write: rows of numbers, read at once where meshio takes
them one by one, a sixth of the time.

What is not plain is left to meshio: other versions, parts that are not known here.
"""

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

# Gmsh's kinds of elements and their nodes
_KINDS = {1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8), 6: ("wedge", 6)}
_KINDS |= {7: ("pyramid", 5), 15: ("vertex", 1)}
_PLAIN = {"MeshFormat", "PhysicalNames", "Nodes", "Elements"}


def read_gmsh_text(path: str) -> Any:
    """A mesh of meshio, with physical groups as meshio's own reader gives them; None for any other file."""
    with open(path, "rb") as file:
        if not file.read(40).replace(b"\r", b"").startswith(b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"):
            return None
    try:
        sections = _sections(Path(path).read_text(encoding="utf-8").replace("\r", ""))
        return None if sections is None or not {"Nodes", "Elements"} <= sections.keys() else _mesh(sections)
    except (ValueError, IndexError, KeyError):
        # meshio says what is wrong with it
        return None


def complete_groups(mesh: Any, path: str) -> Any:
    """The mesh that meshio has read of a Gmsh file, with the groups that its reader drops.

    These are the first of two groups of one name, in version 4.1 all groups of an entity but the first, and those whose
    number is negative, since they take a curve or a surface against its direction.
    """
    with open(path, "rb") as file:
        if file.readline().strip() != b"$MeshFormat":
            return mesh
        version, binary, width = file.readline().split()
        between = "" if binary == b"1" else " "
        groups: dict[tuple[int, int], list[int]] = {}
        while (line := file.readline().strip()) not in (b"", b"$Nodes"):
            if line == b"$PhysicalNames":
                count = file.readline()
                mesh.field_data = _names(b"".join([count, *islice(file, int(count))]).decode())
            elif line == b"$Entities" and version == b"4.1":
                groups = _groups_of_entities(file, between, f"u{int(width)}")
        # blocks, nodes, least and largest number; meshio takes node 0 for the last one
        if line and version == b"4.1" and np.fromfile(file, f"u{int(width)}", 4, sep=between)[2] == 0:
            raise ValueError("expected numbers of nodes from 1 on, found 0")
    if groups:
        entities = [(block.dim, int(tags[0])) for block, tags in zip(mesh.cells, mesh.cell_data["gmsh:geometrical"])]
        most = max(len(own) for own in groups.values())
        rows = [[*groups[entity], *[0] * (most - len(groups[entity]))] for entity in entities]
        mesh.cell_data["gmsh:physical"] = [np.tile(row, (len(own.data), 1)) for row, own in zip(rows, mesh.cells)]
    return mesh


def _groups_of_entities(file: Any, between: str, size: str) -> dict[tuple[int, int], list[int]]:
    """Numbers of groups by dimension and tag of an entity; between: numbers, size: the type of counts."""

    def taken(kind: str, count: int) -> list[Any]:
        return np.fromfile(file, kind, count, sep=between).tolist()

    result = {}
    for dimension, entities in enumerate(taken(size, 4)):
        for _ in range(entities):
            (tag,) = taken("i4", 1)
            taken("f8", 6 if dimension else 3)
            result[dimension, tag] = taken("i4", *taken(size, 1))
            if dimension:
                taken("i4", *taken(size, 1))
    return result


def _sections(text: str) -> dict[str, str] | None:
    """Text between $NAME and $EndNAME, by name; None where there is one that is not known, or one twice."""
    result: dict[str, str] = {}
    end = 0
    while (begin := text.find("$", end)) >= 0:
        first = text.index("\n", begin)
        name = text[begin + 1 : first].strip()
        last = text.find(f"$End{name}", first)
        if name not in _PLAIN or name in result or last < 0:
            return None
        result[name] = text[first + 1 : last]
        end = last + len(name) + 4
    return result


def _mesh(sections: dict[str, str]) -> Any:
    import meshio

    count, rows = sections["Nodes"].split("\n", 1)
    nodes = np.fromstring(rows, sep=" ").reshape(int(count), 4)
    nodes = nodes[np.argsort(nodes[:, 0], kind="stable")]
    numbers = nodes[:, 0].astype(np.int64)
    if (np.diff(numbers) <= 0).any():
        raise ValueError
    cells, physical = [], []
    for kind, tags, of in _blocks(sections["Elements"]):
        place = np.searchsorted(numbers, of)
        if (place >= len(numbers)).any() or (numbers[place] != of).any():
            raise ValueError
        cells.append((kind, place))
        physical.append(tags[:, 0])
    names = _names(sections.get("PhysicalNames", "0"))
    return meshio.Mesh(nodes[:, 1:], cells, cell_data={"gmsh:physical": physical}, field_data=names)


def _names(text: str) -> dict[str, np.ndarray]:
    """(groups, 2) number and dimension by name: a curve and a surface may share one."""
    result: dict[str, list[list[int]]] = {}
    for line in text.strip().split("\n")[1:]:
        dimension, number, name = line.split(maxsplit=2)
        result.setdefault(name.strip().strip('"'), []).append([int(number), int(dimension)])
    return {name: np.array(pairs) for name, pairs in result.items()}


def _blocks(text: str) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Kind, tags (n, tags) and numbers of the nodes (n, nodes) of stretches of elements of one kind."""
    count, rows = text.split("\n", 1)
    flat, at, result, total = np.fromstring(rows, dtype=np.int64, sep=" "), 0, [], 0
    while at < len(flat):
        kind, width = _KINDS[int(flat[at + 1])]
        tags = int(flat[at + 2])
        row = 3 + tags + width
        table = flat[at : at + (len(flat) - at) // row * row].reshape(-1, row)
        # numbers of elements rise, so that what begins another stretch is not taken for a row of this one
        alike = (table[:, 1:3] == table[0, 1:3]).all(axis=1)
        alike[1:] &= table[1:, 0] == table[:-1, 0] + 1
        many = len(alike) if alike.all() else int(np.argmin(alike))
        if tags < 1 or not many:
            raise ValueError
        result.append((kind, table[:many, 3 : 3 + tags], table[:many, 3 + tags :]))
        at, total = at + many * row, total + many
        # kinds that take turns are many stretches
        if len(result) > 1000:
            raise ValueError
    if total != int(count):
        raise ValueError
    return result
