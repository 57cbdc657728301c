"""Meshes of geometry: files of CAD programs and closed surfaces of triangles, meshed by Gmsh's Python package.

Elements are triangles in the plane and tetrahedra in space. Groups are the file's physical groups, and the names of its
faces and volumes; a face without a name is "face-N" by its number in the file, an edge in the plane "edge-N", a volume
"volume-N" (in the plane a surface, "face-N"). The same file and sizes give the same mesh.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from parsolid.scene.shapes import CAD, GEOMETRY, GMSH_GEOMETRY, SURFACES
from parsolid.scene.validation_errors import MeshFault, SceneError, place_in_words, suggestion

# elements around a full turn of a curve, unless given, and the least size that curves ask for, over the size
AROUND, _LEAST = 12, 0.25
# by how much the size grows per distance from where it is smaller
_GROWTH = 0.3
# degrees between facets of a surface of triangles at which there is an edge
EDGE = 40.0
# elements of geometry, by its box, that are refused before they are made
_MOST = 1e8
# triangles up to which a surface is one of flat faces
_FEW = 100
# distance, in units of the file, within which faces without a volume are sewn
_SEWN = 1e-4
# part of the area of all faces that healing and sewing may leave out
_LEFT_OUT = 1e-4
# what OpenCASCADE calls what it has sewn
_NO_NAMES = ("COMPOUND", "SOLID", "SHELL", "FACE")
_KINDS = {1: "line", 2: "triangle", 4: "tetra"}


def is_geometry(path: str, dimension: int) -> bool:
    """Whether a file is one that is meshed first."""
    # a surface of triangles is a solid in space alone
    return path.lower().endswith(GEOMETRY if dimension == 3 else CAD + GMSH_GEOMETRY)


def meshed(stated: Any, dimension: int) -> Any:
    """The mesh of a file of geometry, as meshio has them, coordinates as in the file; stated: `scene.shapes.BodyMesh`,
    sizes in m after its scale. Raises SceneError for one that cannot be meshed."""
    import meshio

    with gmsh_model(stated.file) as gmsh:
        _read(gmsh, stated.file, dimension)
        names = _names(gmsh, dimension)
        _set_sizes(gmsh, stated, dimension, names)
        gmsh.option.setNumber("Mesh.MeshSizeFactor", stated.size_factor)
        try:
            gmsh.model.mesh.generate(dimension)
        except Exception as error:
            raise SceneError(
                [MeshFault("geometry", f"geometry that Gmsh can mesh: {stated.file}", str(error))]
            ) from None
        points, blocks, entities = _elements(gmsh, dimension)
    sets: dict[str, list[Any]] = {}
    for name, members in names.items():
        rows = [np.flatnonzero(np.isin(own, members.get(of, []))) for of, own in entities]
        if any(len(one) for one in rows):
            sets[name] = rows
    return meshio.Mesh(points, blocks, cell_sets=sets)


@contextmanager
def gmsh_model(path: str) -> Iterator[Any]:
    """Gmsh's module, with a model of its own."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        expected = (
            "Gmsh's Python package, which meshes geometry (pip install 'parsolid[cad]'), or a file that is a mesh"
        )
        raise SceneError([MeshFault("geometry", expected, f"none for {path} ({error})")]) from None
    own = not gmsh.isInitialized()
    if own:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        # Gmsh sets it to end the program where nobody reads its output any more
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE))
    try:
        gmsh.model.add("parsolid")
        for option, value in (("General.Terminal", 0), ("General.NumThreads", 1), ("Mesh.OptimizeNetgen", 1)):
            gmsh.option.setNumber(option, value)
        yield gmsh
    finally:
        gmsh.model.remove()
        if own:
            gmsh.finalize()


def _read(gmsh: Any, path: str, dimension: int) -> None:
    """Take a file into the model, with a volume where it is a closed surface. Raises SceneError."""
    left_out = 0.0
    try:
        with _quiet():
            gmsh.merge(path)
            if dimension == 3 and not gmsh.model.getEntities(3) and path.lower().endswith(CAD):
                # IGES has faces alone
                left_out = _make_volumes(gmsh)
    except Exception as error:
        raise SceneError([MeshFault("geometry", "a file that Gmsh reads", f"{path} ({error})")]) from None
    if left_out > _LEFT_OUT:
        expected = "faces that can be sewn to closed surfaces, or a file with volumes (STEP, BREP)"
        found = f"faces that are not, {left_out:.2g} of the area of all, in {path}"
        raise SceneError([MeshFault("geometry", expected, found)])
    if path.lower().endswith(SURFACES):
        _close(gmsh, path)
    if not gmsh.model.getEntities(dimension):
        found = {0: "points", 1: "curves", 2: "surfaces", 3: "volumes"}.get(gmsh.model.getDimension(), "nothing")
        what = "volumes" if dimension == 3 else "surfaces"
        raise SceneError([MeshFault("geometry", f"{what} to be meshed in {dimension}-D", f"{found} in {path}")])


def _make_volumes(gmsh: Any) -> float:
    """Sew faces to closed surfaces and make volumes of these, less those that lie within; the part of the area of all
    faces that is on none."""
    occ, model = gmsh.model.occ, gmsh.model
    area = sum(occ.getMass(2, face) for _, face in occ.getEntities(2))
    occ.healShapes(tolerance=_SEWN, sewFaces=True, makeSolids=False)
    occ.synchronize()
    solids = []
    for faces in _joined(gmsh):
        if model.getBoundary([(2, face) for face in faces]):
            # an open surface
            continue
        loop = occ.addSurfaceLoop(faces, sewing=True)
        solids.append((loop, occ.addVolume([loop])))
    occ.synchronize()
    ends = [model.getBoundary([(3, solid)], recursive=True) or model.getBoundary([(3, solid)]) for _, solid in solids]
    place = [model.getValue(of, abs(tag), [0.5, 0.5][:of]) for (of, tag), *_ in ends]
    around = [
        [a for a, (_, solid) in enumerate(solids) if a != b and model.isInside(3, solid, place[b])]
        for b in range(len(solids))
    ]
    # what lies in an odd number of others is a cavity of the innermost of these
    for a, (loop, solid) in enumerate(solids):
        cavities = [b for b in range(len(solids)) if a in around[b] and len(around[b]) == len(around[a]) + 1]
        if len(around[a]) % 2 == 0 and cavities:
            occ.addVolume([loop, *(solids[b][0] for b in cavities)])
        if len(around[a]) % 2 or cavities:
            occ.remove([(3, solid)])
    occ.synchronize()
    occ.remove([(2, face) for _, face in model.getEntities(2) if not len(model.getAdjacencies(2, face)[0])])
    occ.synchronize()
    return float(1.0 - sum(occ.getMass(2, face) for _, face in occ.getEntities(2)) / area)


def _joined(gmsh: Any) -> list[list[int]]:
    """Faces that curves join, in their order."""
    left, result = [face for _, face in gmsh.model.getEntities(2)], list[list[int]]()
    while left:
        part = [left.pop(0)]
        for face in part:
            curves = gmsh.model.getAdjacencies(2, face)[1]
            near = {int(one) for curve in curves for one in gmsh.model.getAdjacencies(1, curve)[0]}
            part += [one for one in left if one in near]
            left = [one for one in left if one not in near]
        result.append(sorted(part))
    return result


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what OpenCASCADE itself prints."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _close(gmsh: Any, path: str) -> None:
    """Make the volume within a surface of triangles. Raises SceneError for one that is not closed."""
    gmsh.model.mesh.removeDuplicateNodes()
    tags, places, _ = gmsh.model.mesh.getNodes()
    _, triangles = gmsh.model.mesh.getElementsByType(2)
    corners = np.asarray(triangles, np.int64).reshape(-1, 3)
    edges = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    different, count = np.unique(edges, axis=0, return_counts=True)
    wrong = different[count != 2]
    if len(wrong):
        place = np.asarray(places).reshape(-1, 3)[np.flatnonzero(np.asarray(tags) == wrong[0, 0])[0]]
        found = f"{len(wrong)} edges that do not have two triangles, the first at ({place_in_words(place)}) in {path}"
        raise SceneError([MeshFault("open-surface", "a closed surface", found)])
    # few triangles cannot be cut into patches with coordinates of their own, and need not be
    gmsh.model.mesh.classifySurfaces(np.radians(EDGE), True, len(corners) > _FEW, np.pi)
    gmsh.model.mesh.createGeometry()
    gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop([tag for _, tag in gmsh.model.getEntities(2)])])
    gmsh.model.geo.synchronize()


def _names(gmsh: Any, dimension: int) -> dict[str, dict[int, list[int]]]:
    """Numbers of entities by their dimension, of groups and entities by their name."""
    result: dict[str, dict[int, list[int]]] = {}
    words = {3: {3: "volume", 2: "face"}, 2: {2: "face", 1: "edge"}}[dimension]
    for of, word in words.items():
        for _, number in gmsh.model.getEntities(of):
            # STEP has names as paths through its assemblies
            label = gmsh.model.getEntityName(of, number).rsplit("/", 1)[-1]
            label = "" if label in _NO_NAMES else label
            result.setdefault(label or f"{word}-{number}", {}).setdefault(of, []).append(number)
    for of, group in gmsh.model.getPhysicalGroups():
        name = gmsh.model.getPhysicalName(of, group) or str(group)
        result.setdefault(name, {}).setdefault(of, []).extend(gmsh.model.getEntitiesForPhysicalGroup(of, group))
    return result


def _set_sizes(gmsh: Any, stated: Any, dimension: int, names: dict[str, dict[int, list[int]]]) -> None:
    """Sizes of elements: the one for all, smaller ones around curves, and those of `refine`. Raises SceneError for a
    name that is not there."""
    # Gmsh's own files may state sizes
    if stated.size is None and not stated.file.lower().endswith(GMSH_GEOMETRY):
        raise SceneError([MeshFault("geometry", "a size of elements [m] for geometry (the key size)", "none")])
    option = gmsh.option.setNumber
    finest = [one.size / stated.scale for one in stated.refine]
    if stated.size is not None:
        size = stated.size / stated.scale
        ends = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3))
        count = float(np.prod(np.maximum(np.sort(ends[1] - ends[0])[-dimension:] / size, 1.0)))
        if count > _MOST:
            sides = " x ".join(f"{side:.4g}" for side in stated.scale * (ends[1] - ends[0]))
            expected = f"a size for at most {_MOST:g} elements (scale = 1e-3 for millimetres)"
            found = f"{stated.size:g} m in a part of {sides} m"
            raise SceneError([MeshFault("geometry", expected, found, "size")])
        option("Mesh.MeshSizeMax", size)
        option("Mesh.MeshSizeMin", min([_LEAST * size, *finest]))
        option("Mesh.MeshSizeFromCurvature", AROUND if stated.around is None else stated.around)
    fields = []
    for i, (one, least) in enumerate(zip(stated.refine, finest)):
        if one.where not in names:
            known = f"the name of a face or group ({', '.join(map(repr, sorted(names)))}){suggestion(one.where, names)}"
            raise SceneError([MeshFault("unknown-name", known, repr(one.where), f"refine.{i}.where")])
        fields.append(_finer_around(gmsh, names[one.where], least, size if stated.size is not None else least * 8.0))
    if fields:
        smallest = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(smallest, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(smallest)


def _finer_around(gmsh: Any, entities: dict[int, list[int]], least: float, size: float) -> int:
    """A field of sizes that grow with the distance from entities; of a volume, from its surface on, and within it."""
    field = gmsh.model.mesh.field
    distance, growing = field.add("Distance"), field.add("Threshold")
    lists = {0: "PointsList", 1: "CurvesList", 2: "SurfacesList"}
    flat = {of: numbers for of, numbers in entities.items() if of in lists}
    if 3 in entities:
        faces = gmsh.model.getBoundary([(3, number) for number in entities[3]], oriented=False)
        flat.setdefault(2, []).extend(number for _, number in faces)
    for of, numbers in flat.items():
        field.setNumbers(distance, lists[of], numbers)
    field.setNumber(distance, "Sampling", 100)
    for key, value in (
        ("InField", distance),
        ("SizeMin", least),
        ("SizeMax", size),
        ("DistMin", least),
        ("DistMax", least + max(size - least, 0.0) / _GROWTH),
    ):
        field.setNumber(growing, key, value)
    return int(growing)


def _elements(gmsh: Any, dimension: int) -> tuple[np.ndarray, list[Any], list[tuple[int, np.ndarray]]]:
    """Places (nodes, 3); blocks (kind, (elements, nodes)); of each the dimension and numbers (elements,) of entities.

    Nodes of no element, as those of edges that are no edges of elements, are dropped where particles are made.
    """
    tags, places, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    ordered, points = np.asarray(tags)[order], np.asarray(places).reshape(-1, 3)[order]
    blocks, entities = [], []
    for of in (dimension, dimension - 1):
        kind, cells, numbers = {1: 1, 2: 2, 3: 4}[of], [], []
        for _, number in gmsh.model.getEntities(of):
            kinds, _, nodes = gmsh.model.mesh.getElements(of, number)
            for found, own in zip(kinds, nodes):
                if found == kind:
                    cells.append(np.searchsorted(ordered, own).reshape(-1, of + 1))
                    numbers.append(np.full(len(cells[-1]), number))
        if cells:
            blocks.append((_KINDS[kind], np.concatenate(cells)))
            entities.append((of, np.concatenate(numbers)))
    return points, blocks, entities
