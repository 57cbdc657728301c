"""Imported meshes: what bodies take of a mesh file, in an HDF5 file of which every rank reads its own slices.

Layout (format version 1):

    /               attributes format, version, unit (of the coordinates, in words)
    /header         JSON text: `Contents`, and the file that was imported
    /checksums      a digest of the rest of this text, a line's end, JSON: data set -> checksum, "header" -> digest
    /points         (nodes, d) float64, coordinates as in the mesh file
    /elements/<b>   (elements, nodes) int64, of block b: numbers of nodes
    /groups/...     (n,) or (n, nodes of a facet) int64, see `Contents`

A mesh file that meshio reads is brought into the same `Contents` and arrays, so both go the same way from there.
"""

import json
import os
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from parsolid.checksums import digest, sum_of_rows
from parsolid.particles.meshes.elements import lumped_volumes
from parsolid.particles.meshes.files import MeshOfFile, dimension_of, read_file, read_with_meshio, solid_mesh
from parsolid.particles.meshes.groups import MeshGroups
from parsolid.scene.validation_errors import SceneError

FORMAT, VERSION = "parsolid mesh", 1
_UNIT = "as in the mesh file; a scene's scale makes metres of it"
_HDF5 = b"\x89HDF\r\n\x1a\n"


class Contents(NamedTuple):
    """What there is of a mesh beside its arrays: dimension, kinds of elements block by block, kinds of second order,
    groups of nodes (`groups/nodes/<i>`), of elements (`groups/elements/<i>`) and of facets (`groups/facets/<i>`, name
    and nodes of a facet) by their number."""

    dimension: int
    kinds: list[str]
    of_second_order: list[str]
    nodes: list[str]
    elements: list[str]
    facets: list[tuple[str, int]]


def contents_of(mesh: MeshOfFile, dimension: int) -> tuple[Contents, dict[str, np.ndarray]]:
    """A mesh as contents and arrays by the names of data sets."""
    groups = mesh.groups
    facets = [(name, width) for name, by_width in groups.facets.items() for width in by_width]
    kinds, second_order = [kind for kind, _ in mesh.blocks], list(mesh.of_second_order)
    contents = Contents(dimension, kinds, second_order, list(groups.nodes), list(groups.elements), facets)
    arrays = {"points": mesh.points}
    arrays |= {f"elements/{b}": cells for b, (_, cells) in enumerate(mesh.blocks)}
    arrays |= {f"groups/nodes/{i}": groups.nodes[name] for i, name in enumerate(contents.nodes)}
    arrays |= {f"groups/elements/{i}": groups.elements[name] for i, name in enumerate(contents.elements)}
    arrays |= {f"groups/facets/{i}": groups.facets[name][width] for i, (name, width) in enumerate(facets)}
    return contents, arrays


def mesh_of(contents: Contents, arrays: dict[str, np.ndarray]) -> MeshOfFile:
    """The mesh, or a rank's slice of it, of contents and arrays."""
    groups = MeshGroups({}, {}, {})
    groups.nodes.update({name: arrays[f"groups/nodes/{i}"] for i, name in enumerate(contents.nodes)})
    groups.elements.update({name: arrays[f"groups/elements/{i}"] for i, name in enumerate(contents.elements)})
    for i, (name, width) in enumerate(contents.facets):
        groups.facets.setdefault(name, {})[width] = arrays[f"groups/facets/{i}"]
    blocks = [(kind, arrays[f"elements/{b}"]) for b, kind in enumerate(contents.kinds)]
    return MeshOfFile(arrays["points"], blocks, groups, tuple(contents.of_second_order))


def read_mesh(path: str, dimension: int, stated: Any = None) -> MeshOfFile:
    """The whole mesh of any file, on one rank; stated: see `files.read_file`. Raises SceneError for one that cannot be
    used."""
    if not is_imported(path):
        return solid_mesh(read_file(path, dimension, stated), dimension)
    with ImportedMesh(path, dimension) as imported:
        arrays = {name: imported.rows(name, 0, shape[0]) for name, shape in imported.shapes.items()}
        imported.compare({name: sum_of_rows(array, 0) for name, array in arrays.items()})
        return mesh_of(imported.contents, arrays)


def import_mesh(source: str, target: str) -> tuple[Contents, dict[str, np.ndarray]]:
    """Write what bodies take of a mesh file to a new file, which is there whole or not at all.

    Raises SceneError for a mesh that cannot be used or a target that exists, OSError where it cannot be written.
    """
    if os.path.lexists(target):
        raise SceneError([f"target: expected a file that is not there yet, found {target}"])
    if not target.lower().endswith((".h5", ".hdf5")):
        raise SceneError([f"target: expected a name that ends in .h5 or .hdf5, found {target}"])
    if is_imported(source):
        raise SceneError([f"mesh: expected a mesh file of another program, found {source}, which is imported"])
    if not os.path.isfile(source):
        raise SceneError([f"mesh: expected a file, found none of the name {source}"])
    try:
        mesh = read_with_meshio(source)
        dimension = dimension_of(mesh)
        solid = solid_mesh(mesh, dimension)
        for kind, cells in solid.blocks:
            flat = np.count_nonzero(~lumped_volumes(kind, solid.points[cells])[1])
            if flat:
                raise SceneError([f"expected elements of positive volume, found {flat} {kind} inside out or flat"])
        contents, arrays = contents_of(solid, dimension)
    except SceneError as error:
        raise SceneError([f"mesh: {text}" for text in error.faults]) from None
    partial = f"{target}.partial"
    try:
        _write(partial, contents, arrays, source)
        # a link does not replace what another program has put there meanwhile
        os.link(partial, target)
    finally:
        Path(partial).unlink(missing_ok=True)
    return contents, arrays


def _write(path: str, contents: Contents, arrays: dict[str, np.ndarray], source: str) -> None:
    header = json.dumps(contents._asdict() | {"source": os.path.basename(source)}).encode()
    sums: dict[str, Any] = {name: sum_of_rows(array, 0) for name, array in arrays.items()}
    text = json.dumps(sums | {"header": digest(header)}).encode()
    with h5py.File(path, "w", libver="v108", locking=False) as file:
        file.attrs.update({"format": FORMAT, "version": VERSION, "unit": _UNIT})
        for name, array in arrays.items():
            # contiguous, so that a slice is one piece of the file
            file.create_dataset(name, data=array)
        file["header"] = np.void(header)
        file["checksums"] = np.void(digest(text).encode() + b"\n" + text)
    with open(path, "rb") as written:
        os.fsync(written.fileno())


def is_imported(path: str) -> bool:
    """Whether a file is an imported mesh, or an HDF5 file that no reader of meshio is for."""
    try:
        with open(path, "rb") as file:
            if file.read(len(_HDF5)) != _HDF5:
                return False
        if path.lower().endswith((".h5", ".hdf5")):
            return True
        with h5py.File(path, "r", locking=False) as file:
            return _text(file.attrs.get("format")) == FORMAT
    except OSError:
        # said by whoever reads it
        return path.lower().endswith((".h5", ".hdf5"))


def _text(value: Any) -> Any:
    return value.decode(errors="replace") if isinstance(value, bytes) else value


class ImportedMesh:
    """An imported mesh that one rank reads for itself: its contents, and slices of its arrays. A context manager.

    shapes: of the arrays by name.
    """

    def __init__(self, path: str, dimension: int) -> None:
        """Raises SceneError for a file that is damaged, of another program, version or dimension."""
        self.path = path
        try:
            self._file = h5py.File(path, "r", locking=False)
        except OSError as error:
            raise SceneError([f"expected an imported mesh, found {path} ({error})"]) from None
        try:
            self.contents, self._sums = self._checked(dimension)
            self.shapes = self._shapes()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> "ImportedMesh":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def _checked(self, dimension: int) -> tuple[Contents, dict[str, Any]]:
        attributes = self._file.attrs
        found = _text(attributes.get("format"))
        if found != FORMAT:
            raise SceneError([f"expected a file of the format {FORMAT!r}, found {found!r} in {self.path}"])
        if (version := attributes.get("version")) != VERSION:
            raise SceneError([f"expected version {VERSION} of the format, found {version} in {self.path}: import anew"])
        try:
            own, _, text = self._file["checksums"][()].tobytes().partition(b"\n")
            header = self._file["header"][()].tobytes()
            sums: dict[str, Any] = json.loads(text)
            if digest(text).encode() != own or digest(header) != sums.pop("header"):
                raise ValueError("checksums differ")
            values = json.loads(header)
            values["facets"] = [(name, width) for name, width in values["facets"]]
            contents = Contents(*(values[name] for name in Contents._fields))
        except Exception as error:  # what h5py raises depends on where the file is torn
            raise self._damaged(f"the header ({error})") from None
        if contents.dimension != dimension:
            raise SceneError([f"expected a mesh in {dimension}-D, found one in {contents.dimension}-D in {self.path}"])
        return contents, sums

    def _shapes(self) -> dict[str, tuple[int, ...]]:
        try:
            return {name: self._file[name].shape for name in self._sums}
        except Exception as error:  # as above
            raise self._damaged(str(error)) from None

    def rows(self, name: str, first: int, last: int) -> np.ndarray:
        """Rows first .. last-1 of an array. Raises SceneError where they cannot be read."""
        try:
            return np.asarray(self._file[name][first:last])
        except Exception as error:  # as above
            raise self._damaged(f"{name} ({error})") from None

    def compare(self, sums: dict[str, int]) -> None:
        """Raise SceneError unless these are the checksums of all arrays."""
        wrong = [name for name in self._sums if sums.get(name) != self._sums[name]]
        if wrong:
            raise self._damaged(f"{', '.join(wrong)}: checksums differ")

    def _damaged(self, what: str) -> SceneError:
        return SceneError([f"expected an imported mesh as it was written, found damage in {self.path}: {what}"])
