"""A mesh made anew within the surface of a given one, of longer or shorter edges, by Gmsh's Python package.

Nodes of the new surface lie on the facets of the given one, whose edges above a dihedral angle stay; everywhere the
length of edges is that of the given mesh times a factor. Elements are triangles in the plane and tetrahedra in space.
Groups go to what is nearest.
"""

from typing import Any

import numpy as np

from parsolid.particles.meshes.elements import ELEMENTS
from parsolid.particles.meshes.geometry import EDGE, gmsh_model
from parsolid.scene.validation_errors import MeshFault, SceneError

# how far apart facets at one place are whose normals differ by 90 degrees, in lengths of their edges
_TURNED = 2.0
# what Gmsh calls lists of numbers at the nodes of elements
_LISTS = {"triangle": "ST", "quad": "SQ", "tetra": "SS", "hexahedron": "SH", "wedge": "SI", "pyramid": "SY"}


def remeshed(given: Any, factor: float, path: str) -> Any:
    """The mesh of meshio within the surface of a given one (`files.MeshOfFile`) with edges longer by a factor; path: of
    its file, for messages. Raises SceneError where Gmsh makes none."""
    import meshio

    d = given.points.shape[1]
    facets = _surface(given.points, given.blocks)
    simplices = _simplices(facets) if d == 3 else _simplices([cells for _, cells in given.blocks])
    with gmsh_model(path) as gmsh:
        try:
            for patches in (False, True):
                try:
                    _set_surface(gmsh, given.points, simplices, patches)
                    break
                except Exception:
                    # a surface without an edge, or with handles, has no single map to a plane; in patches it has
                    if patches:
                        raise
                    gmsh.model.remove()
                    gmsh.model.add("parsolid")
            _set_sizes(gmsh, given, factor)
            gmsh.model.mesh.generate(d)
        except Exception as error:
            raise SceneError([MeshFault("geometry", f"a surface that Gmsh can mesh: {path}", str(error))]) from None
        tags, places, _ = gmsh.model.mesh.getNodes()
        order = np.argsort(tags)
        points = np.asarray(places).reshape(-1, 3)[order, :d]
        found = gmsh.model.mesh.getElementsByType({2: 2, 3: 4}[d])[1]
        cells = np.searchsorted(np.asarray(tags)[order], found).reshape(-1, d + 1)
    if not len(cells):
        raise SceneError([MeshFault("geometry", f"a surface that Gmsh can mesh: {path}", "no elements within it")])
    used, cells = np.unique(cells, return_inverse=True)
    cells = cells.reshape(-1, d + 1)
    mesh = meshio.Mesh(points[used], [({2: "triangle", 3: "tetra"}[d], cells)])
    _take_groups(mesh, given, facets)
    return mesh


def _surface(points: np.ndarray, blocks: list[tuple[str, np.ndarray]]) -> list[np.ndarray]:
    """Facets (k, nodes) of one element alone, by number of nodes, whose order turns their normals outward."""
    gathered: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for kind, cells in blocks:
        middle = points[cells].mean(axis=1)
        for facet in ELEMENTS[kind].facets:
            gathered.setdefault(len(facet), []).append((cells[:, facet], middle))
    result = []
    for pieces in gathered.values():
        nodes, inside = (np.concatenate(column) for column in zip(*pieces))
        _, first, count = np.unique(np.sort(nodes, axis=1), axis=0, return_index=True, return_counts=True)
        alone = np.sort(first[count == 1])
        nodes = nodes[alone]
        inward = np.einsum("ni,ni->n", _normals(points, nodes), inside[alone] - points[nodes[:, 0]]) > 0.0
        nodes[inward] = nodes[inward, ::-1]
        result.append(nodes)
    return result


def _normals(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Unit vectors (k, d) across facets (k, nodes) by their first nodes."""
    along = points[facets[:, 1]] - points[facets[:, 0]]
    if points.shape[1] == 2:
        across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    else:
        across = np.cross(along, points[facets[:, 2]] - points[facets[:, 0]])
    return np.asarray(across / np.linalg.norm(across, axis=1)[:, None])


def _simplices(cells: list[np.ndarray]) -> np.ndarray:
    """Triangles (k, 3) of triangles and quads."""
    return np.concatenate([one[:, [0, i, i + 1]] for one in cells for i in range(1, one.shape[1] - 1)])


def _set_surface(gmsh: Any, points: np.ndarray, triangles: np.ndarray, patches: bool) -> None:
    """Give Gmsh a surface of triangles, cut at its edges, with the volume within it; patches: cut into such as have a
    map to a plane."""
    d, used = points.shape[1], np.unique(triangles)
    surface = gmsh.model.addDiscreteEntity(2)
    gmsh.model.mesh.addNodes(2, surface, used + 1, np.pad(points[used], ((0, 0), (0, 3 - d))).ravel())
    gmsh.model.mesh.addElementsByType(surface, 2, [], (triangles + 1).ravel())
    gmsh.model.mesh.classifySurfaces(np.radians(EDGE), True, patches, np.radians(EDGE))
    gmsh.model.mesh.createGeometry()
    if d == 3:
        loop = gmsh.model.geo.addSurfaceLoop([tag for _, tag in gmsh.model.getEntities(2)])
        gmsh.model.geo.addVolume([loop])
        gmsh.model.geo.synchronize()


def _set_sizes(gmsh: Any, given: Any, factor: float) -> None:
    """Let edges be as long as those of a given mesh around, times a factor."""
    points, d = given.points, given.points.shape[1]
    ends = np.concatenate([cells[:, edge] for kind, cells in given.blocks for edge in ELEMENTS[kind].edges])
    ends = np.unique(np.sort(ends, axis=1), axis=0)
    length = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    met = np.bincount(ends.ravel(), minlength=len(points))
    size = np.bincount(ends.ravel(), np.repeat(length, 2), len(points)) / np.maximum(met, 1)
    view, places = gmsh.view.add("sizes"), np.pad(points, ((0, 0), (0, 3 - d)))
    for kind, cells in given.blocks:
        rows = np.concatenate([places[cells].transpose(0, 2, 1).reshape(len(cells), -1), size[cells]], axis=1)
        gmsh.view.addListData(view, _LISTS[kind], len(cells), rows.ravel())
    field = gmsh.model.mesh.field
    sizes = field.add("PostView")
    field.setNumber(sizes, "ViewTag", view)
    field.setNumber(sizes, "UseClosest", 1)
    field.setAsBackgroundMesh(sizes)
    for name in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
        gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)
    gmsh.option.setNumber("Mesh.MeshSizeFactor", factor)


def _take_groups(mesh: Any, given: Any, facets: list[np.ndarray]) -> None:
    """Give a new mesh, of meshio and of one block, the groups of a given one: elements and facets those of the nearest
    ones, nodes those of facets that have no other, and else the nearest."""
    import meshio
    from scipy.spatial import cKDTree

    groups, cells = given.groups, mesh.cells[0].data
    (skin,) = _surface(mesh.points, [(mesh.cells[0].type, cells)])
    mesh.cells.append(meshio.CellBlock({2: "line", 3: "triangle"}[given.points.shape[1]], skin))
    middles = np.concatenate([given.points[own].mean(axis=1) for _, own in given.blocks])
    element = cKDTree(middles).query(mesh.points[cells].mean(axis=1))[1]
    scale = float(np.mean([np.linalg.norm(given.points[own[:, 0]] - given.points[own[:, 1]], axis=1).mean()
                           for own in facets]))  # fmt: skip

    def placed(points: np.ndarray, own: np.ndarray) -> np.ndarray:
        return np.concatenate([points[own].mean(axis=1), _TURNED * scale * _normals(points, own)], axis=1)

    nearest = cKDTree(np.concatenate([placed(given.points, own) for own in facets]))
    facet = nearest.query(placed(mesh.points, skin))[1]
    for name, rows in groups.elements.items():
        mesh.cell_sets[name] = [np.flatnonzero(np.isin(element, rows)), np.zeros(0, np.int64)]
    for name, by_width in groups.facets.items():
        chosen = [_among(own, by_width.get(own.shape[1], own[:0])) for own in facets]
        before = mesh.cell_sets.get(name, [np.zeros(0, np.int64)])[0]
        mesh.cell_sets[name] = [before, np.flatnonzero(np.concatenate(chosen)[facet])]
    for name, nodes in groups.nodes.items():
        whole = np.concatenate([np.isin(own, nodes).all(axis=1) for own in facets])
        alone = np.setdiff1d(nodes, np.concatenate([own[np.isin(own, nodes).all(axis=1)].ravel() for own in facets]))
        near = cKDTree(mesh.points).query(given.points[alone])[1]
        mesh.point_sets[name] = np.union1d(skin[whole[facet]].ravel(), near)


def _among(rows: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Which rows (n, k), in any order of their numbers, are among others (m, k), sorted."""
    _, number = np.unique(np.concatenate([others, np.sort(rows, axis=1)]), axis=0, return_inverse=True)
    return np.isin(number.ravel()[len(others) :], number.ravel()[: len(others)])
