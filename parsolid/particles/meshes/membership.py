"""Which nodes, elements and facets of a mesh are in regions: in their places, and in the groups of the mesh."""

from collections.abc import Mapping

import numpy as np

from parsolid.particles.marks import TOLERANCE
from parsolid.particles.meshes.slices import MeshSlices
from parsolid.particles.meshes.topology import Facets
from parsolid.scene.named_regions import Region


class Membership:
    """What of a rank's slices of a mesh is in which of the known regions.

    edge (kept nodes,) [m]: see `topology.mean_edge`, for the tolerance.
    """

    def __init__(
        self, mesh: MeshSlices, known: Mapping[str, Region], edge: np.ndarray, whole: MeshSlices | None = None
    ) -> None:
        """whole: the mesh of which a body has a part, where it is not all. Collective."""
        self.whole = whole or mesh
        self.mesh, self.known, self.tolerance = mesh, known, TOLERANCE * edge
        self.names = sorted(set().union(*(region.groups(known) for region in known.values())))
        # (kept nodes, groups): nodes of a group, of its elements and of its facets
        self.of_nodes = self._nodes_of_groups()

    def _nodes_of_groups(self) -> np.ndarray:
        # nodes that bodies share are in the groups of all of them
        mesh, groups = self.whole, self.mesh.groups
        result = np.zeros((len(mesh.nodes), len(self.names)), bool)
        if not self.names:
            return result
        numbers, flags = [np.zeros(0, np.int64)], [np.zeros((0, len(self.names)), bool)]
        of_elements = np.zeros((len(mesh.local.nodes), len(self.names)), bool)
        for i, name in enumerate(self.names):
            result[groups.nodes.get(name, np.zeros(0, np.int64)) - mesh.nodes.first, i] = True
            start, chosen = 0, mesh.elements.fetch(mesh.local.numbers, self._kept(name))
            for _, cells in mesh.local.blocks:
                of_elements[cells[chosen[start : start + len(cells)]], i] = True
                start += len(cells)
            for rows in groups.facets.get(name, {}).values():
                numbers.append(rows.ravel())
                flags.append(np.arange(len(self.names)) == np.full((rows.size, 1), i))
        some = of_elements.any(axis=1)
        numbers.append(mesh.local.nodes[some])
        flags.append(of_elements[some])
        come = mesh.nodes.deliver(np.concatenate(numbers), flags=np.concatenate(flags))
        np.logical_or.at(result, come["number"], come["flags"])
        return result

    def _kept(self, name: str) -> np.ndarray:
        """Which of the kept elements are in a group."""
        result = np.zeros(len(self.mesh.elements), bool)
        result[self.mesh.groups.elements.get(name, np.zeros(0, np.int64)) - self.mesh.elements.first] = True
        return result

    def nodes(self) -> np.ndarray:
        """Which kept nodes (n, regions) are in which region."""

        def of_group(name: str) -> np.ndarray:
            return self.of_nodes[:, self.names.index(name)]

        regions = self.known.values()
        return np.stack([one.contains(self.mesh.points, self.tolerance, self.known, of_group) for one in regions], 1)

    def elements(self, middle: np.ndarray, size: np.ndarray) -> np.ndarray:
        """Which kept elements (n, regions), of middles (n, d) [m] and sizes (n,) [m], are in which region."""
        regions = self.known.values()
        return np.stack([one.contains(middle, TOLERANCE * size, self.known, self._kept) for one in regions], axis=1)

    def facets(self, facets: Facets) -> list[np.ndarray]:
        """For facets by number of nodes, which (k, regions) are in which region: those of which all nodes are, or
        where a group has facets of its own, these. Collective."""
        local, nodes = self.mesh.local, self.mesh.nodes
        tolerance = nodes.fetch(local.nodes, self.tolerance)
        flags = np.zeros((len(local.nodes), 0), bool)
        if self.names:
            flags = nodes.fetch(local.nodes, self.of_nodes)
        result = []
        for _, corners, _ in facets:
            flat, width = corners.ravel(), corners.shape[1]
            members = np.asarray(flags[corners].all(axis=1))
            with_facets = [i for i, name in enumerate(self.names) if name in self.mesh.facet_names]
            if with_facets:
                rows = np.sort(local.nodes[corners], axis=1)
                members[:, with_facets] = nodes.ask(rows[:, 0], self._own_facets, rows=rows)[:, with_facets]

            def of_group(name: str, members: np.ndarray = members, width: int = width) -> np.ndarray:
                return np.repeat(members[:, self.names.index(name)], width)

            inside = [
                one.contains(local.points[flat], tolerance[flat], self.known, of_group).reshape(-1, width).all(axis=1)
                for one in self.known.values()
            ]
            result.append(np.stack(inside, axis=1))
        return result

    def _own_facets(self, asked: dict[str, np.ndarray]) -> np.ndarray:
        """Which facets, rows (k, nodes) of sorted numbers, of which the first is this rank's own, are facets of which
        group (k, groups)."""
        rows = asked["rows"]
        result = np.zeros((len(rows), len(self.names)), bool)
        for i, name in enumerate(self.names):
            own = self.mesh.groups.facets.get(name, {}).get(rows.shape[1], rows[:0])
            if len(own) and len(rows):
                _, number = np.unique(np.concatenate([own, rows]), axis=0, return_inverse=True)
                result[:, i] = np.isin(number.ravel()[len(own) :], number.ravel()[: len(own)])
        return result
