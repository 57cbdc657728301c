"""Meshes as text of Gmsh's version 2.2, which many programs write: rows of numbers, read at once where meshio takes
them one by one, a sixth of the time.

What is not plain is left to meshio: other versions, parts that are not known here, numbers that are not rising.
"""

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
    groups = {}
    for line in sections.get("PhysicalNames", "0").strip().split("\n")[1:]:
        dimension, number, name = line.split(maxsplit=2)
        groups[name.strip().strip('"')] = np.array([int(number), int(dimension)])
    return meshio.Mesh(nodes[:, 1:], cells, cell_data={"gmsh:physical": physical}, field_data=groups)


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
