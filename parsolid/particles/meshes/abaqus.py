"""Meshes of Abaqus input files: flat files, and parts with their instances.

meshio's own reader keeps the nodes of the last part alone, ignores where an instance stands, and knows few element
types.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

# nodes of an element -> meshio's name, by family
_SOLID = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 15: "wedge15", 20: "hexahedron20"}
_SURFACE = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"}
_LINE = {"T2D2": "line", "T3D2": "line", "B21": "line", "B31": "line", "T2D3": "line3", "T3D3": "line3", "B22": "line3"}
_NODES = {"pyramid": 5, "wedge": 6, "hexahedron": 8, "tetra10": 10, "wedge15": 15, "hexahedron20": 20}
_NODES |= {"line": 2, "line3": 3, "triangle": 3, "quad": 4, "tetra": 4, "triangle6": 6, "quad8": 8}


class _Block(NamedTuple):
    """A keyword with its parameters (upper-case keys) and its rows of data."""

    keyword: str
    parameters: dict[str, str]
    rows: list[list[str]]


class _Part:
    """Nodes, elements and sets of a part, or of a flat file; numbers are those of the file."""

    def __init__(self) -> None:
        self.nodes: dict[int, list[float]] = {}
        self.elements: list[tuple[str, np.ndarray, np.ndarray]] = []
        self.node_sets: dict[str, list[int]] = {}
        self.element_sets: dict[str, list[int]] = {}

    def add(self, block: _Block) -> None:
        """Take in a block of nodes, elements or of a set. Raises ValueError."""
        name = block.parameters
        if block.keyword == "NODE":
            for row in block.rows:
                self.nodes[int(row[0])] = [float(x) for x in [*row[1:4], "0", "0"][:3]]
            if "NSET" in name:
                self.node_sets.setdefault(name["NSET"], []).extend(int(row[0]) for row in block.rows)
        elif block.keyword == "ELEMENT":
            kind = _kind_of(name.get("TYPE", ""))
            numbers = np.array([int(x) for row in block.rows for x in row if x], np.int64)
            if len(numbers) % (_NODES[kind] + 1):
                raise ValueError(f"an element of type {name['TYPE']} that has not {_NODES[kind]} nodes")
            table = numbers.reshape(-1, _NODES[kind] + 1)
            self.elements.append((kind, table[:, 0], table[:, 1:]))
            if "ELSET" in name:
                self.element_sets.setdefault(name["ELSET"], []).extend(table[:, 0].tolist())
        elif block.keyword == "NSET":
            self.node_sets.setdefault(name["NSET"], []).extend(_members(block, self.node_sets))
        elif block.keyword == "ELSET":
            self.element_sets.setdefault(name["ELSET"], []).extend(_members(block, self.element_sets))


def _kind_of(stated: str) -> str:
    """meshio's name of an Abaqus element type. Raises ValueError for one that is not known."""
    name = stated.upper()
    if name.rstrip("H") in _LINE:
        return _LINE[name.rstrip("H")]
    found = re.match(r"(C3D|CPS|CPE|CAX|STRI|S|R3D|M3D|SFM3D)(\d+)", name)
    kinds = {} if found is None else _SOLID if found[1] == "C3D" else _SURFACE
    # STRI65 is the triangle of 6 nodes
    nodes = 0 if found is None else 6 if name == "STRI65" else int(found[2])
    if nodes not in kinds:
        raise ValueError(f"the element type {stated or '(none)'}, which is not known")
    return kinds[nodes]


def _members(block: _Block, known: dict[str, list[int]]) -> list[int]:
    """Numbers of a set: a list, ranges (GENERATE), or names of other sets."""
    if "GENERATE" in block.parameters:
        result: list[Any] = []
        for row in block.rows:
            first, last, *step = [int(x) for x in row if x]
            result.extend(range(first, last + 1, *step))
        return result
    words = [word for row in block.rows for word in row if word]
    return [number for word in words for number in ([int(word)] if word.lstrip("-").isdigit() else known[word])]


def _blocks(path: Path) -> Iterator[_Block]:
    """The blocks of a file and of those that it includes."""
    current: _Block | None = None
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if not text.startswith("*"):
            if current is not None:
                current.rows.append([word.strip() for word in text.split(",")])
            continue
        if current is not None:
            yield current
        keyword, *rest = [word.strip() for word in text[1:].split(",")]
        pairs = [word.partition("=") for word in rest if word]
        current = _Block(
            keyword.upper(), {key.strip().upper(): value.strip().strip('"') for key, _, value in pairs}, []
        )
        if current.keyword == "INCLUDE":
            yield from _blocks(path.parent / current.parameters["INPUT"])
            current = None
    if current is not None:
        yield current


def _placed(points: np.ndarray, rows: list[list[str]]) -> np.ndarray:
    """Points (n, 3) of a part where its instance stands: shifted, then turned about an axis through two points."""
    if rows:
        points = points + np.array([float(x) for x in (rows[0] + ["0", "0", "0"])[:3]])
    if len(rows) > 1:
        numbers = np.array([float(x) for x in rows[1][:7]])
        start, axis, angle = numbers[:3], numbers[3:6] - numbers[:3], np.radians(numbers[6])
        axis = axis / np.linalg.norm(axis)
        arm = points - start
        along = (arm @ axis)[:, None] * axis
        points = start + along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(axis, arm)
    return points


def read_abaqus(path: str) -> Any:
    """A mesh of meshio with its named sets; a set of an instance is also found as INSTANCE.SET.

    Raises ValueError for what is not known.
    """
    flat, parts, instances = _Part(), dict[str, _Part](), list[tuple[str, str, list[list[str]]]]()
    of_assembly: list[_Block] = []
    part, inside_assembly = flat, False
    for block in _blocks(Path(path)):
        if block.keyword == "PART":
            part = parts.setdefault(block.parameters["NAME"], _Part())
        elif block.keyword == "END PART":
            part = flat
        elif block.keyword in ("ASSEMBLY", "END ASSEMBLY"):
            inside_assembly = block.keyword == "ASSEMBLY"
        elif block.keyword == "INSTANCE":
            instances.append((block.parameters["NAME"], block.parameters["PART"], block.rows))
        elif inside_assembly and block.keyword in ("NSET", "ELSET") and "INSTANCE" in block.parameters:
            of_assembly.append(block)
        elif block.keyword in ("NODE", "ELEMENT", "NSET", "ELSET"):
            part.add(block)
    if parts and not instances:
        raise ValueError("parts without an instance")
    chosen = [(name, parts[of], rows) for name, of, rows in instances] if parts else [("", flat, [])]
    return _mesh(chosen, of_assembly)


def _mesh(chosen: list[tuple[str, _Part, list[list[str]]]], of_assembly: list[_Block]) -> Any:
    """One mesh of all instances (name, part, rows that place it)."""
    import meshio

    points, first = [np.zeros((0, 3))], 0
    cells: list[Any] = []
    node_sets: dict[str, list[np.ndarray]] = {}
    element_sets: dict[str, dict[int, np.ndarray]] = {}
    for name, part, rows in chosen:
        numbers = np.array(sorted(part.nodes), np.int64)
        points.append(_placed(np.array([part.nodes[n] for n in numbers.tolist()]).reshape(-1, 3), rows))
        own_nodes, own_elements = dict(part.node_sets), dict(part.element_sets)
        for block in of_assembly:
            if block.parameters["INSTANCE"] == name:
                key = "NSET" if block.keyword == "NSET" else "ELSET"
                sets = own_nodes if key == "NSET" else own_elements
                sets[block.parameters[key]] = [*sets.get(block.parameters[key], []), *_members(block, sets)]
        for label, members in own_nodes.items():
            for full in {label, f"{name}.{label}" if name else label}:
                node_sets.setdefault(full, []).append(first + _rows(numbers, np.array(members, np.int64)))
        for kind, ids, nodes in part.elements:
            for label, members in own_elements.items():
                for full in {label, f"{name}.{label}" if name else label}:
                    element_sets.setdefault(full, {})[len(cells)] = np.flatnonzero(np.isin(ids, members))
            cells.append((kind, first + _rows(numbers, nodes)))
        first += len(numbers)
    nothing = np.zeros(0, np.int64)
    return meshio.Mesh(
        np.concatenate(points),
        cells,
        point_sets={name: np.concatenate(rows) for name, rows in node_sets.items()},
        cell_sets={name: [own.get(k, nothing) for k in range(len(cells))] for name, own in element_sets.items()},
    )


def _rows(numbers: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Where numbers, which rise, have the wanted ones. Raises ValueError where they lack one."""
    rows = np.minimum(np.searchsorted(numbers, wanted), max(len(numbers) - 1, 0))
    lacking = wanted[numbers[rows] != wanted] if len(numbers) else wanted.ravel()
    if lacking.size:
        raise ValueError(f"node {lacking.ravel()[0]}, which is not in the file")
    return rows
