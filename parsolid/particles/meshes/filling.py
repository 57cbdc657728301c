"""Particles from meshes: on nodes or at the centroids of elements, made by all ranks of their slices of the mesh."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from decomposition.slices import Slices, count_before
from parsolid.collective import maximum, minimum
from parsolid.particles.lattice import jitter_offsets
from parsolid.particles.marks import TOLERANCE
from parsolid.particles.meshes.elements import shares_of_nodes
from parsolid.particles.meshes.inside import Solid
from parsolid.particles.meshes.quality import refuse_double_nodes, refuse_hinges
from parsolid.particles.meshes.slices import MeshSlices, part_of_body, read_slices, restricted
from parsolid.particles.meshes.topology import (
    Facets,
    boundary_facets,
    mean_edge,
    refuse_repeated,
    sound_volumes,
)
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.bodies import FilledShape
from parsolid.scene.named_regions import Region
from parsolid.scene.validation_errors import MeshFault, SceneError, place_in_words


class MeshFilling:
    """Particles of a mesh, of which a rank has those that come of its slice until `scatter` brings others.

    nodes: volumes of the elements and areas of the boundary facets lumped to their nodes, the spacing is the mean
    length of the edges that meet; nodes of no element are dropped. cells: one particle an element, the spacing is its
    volume to the power 1/d. mesh: the slices; groups: names of those that the mesh has; turned: how many elements are
    inside out; unused: how many nodes no element of the file has, 0 with elements of second order. See
    `lattice.Filling`.
    """

    def __init__(
        self,
        comm: Any,
        body: FilledShape,
        dimension: int,
        whole: MeshSlices | None = None,
        groups: Sequence[str] = (),
        by_nodes: bool = False,
    ) -> None:
        """whole: the mesh of the file, where it has been read; groups: those that all bodies have of it; by_nodes:
        whether nothing but shared nodes holds elements together. Raises
        SceneError, on all ranks, for meshes that cannot be read, elements that are partly inside out or there twice,
        and meshes that lie in themselves. Collective."""
        self.comm, self.body = comm, body
        self.whole = read_slices(comm, body.shape.model, dimension) if whole is None else whole
        group = body.shape.model.group
        self.mesh = mesh = part_of_body(self.whole, body.shape.model)
        self.groups = sorted(mesh.groups.names)
        volumes, self.turned = sound_volumes(mesh)
        refuse_repeated(mesh)
        points = mesh.local.points
        self.lower = minimum(comm, points.min(axis=0, initial=np.inf))
        self.upper = maximum(comm, points.max(axis=0, initial=-np.inf))
        self.facets, self.edge = boundary_facets(mesh), mean_edge(mesh)
        # nodes beyond the corners are of no element, either
        self.unused = 0 if mesh.of_second_order else comm.allreduce(_unused(self.whole))
        # of the facets, those that another body of the mesh has, too, are on no surface
        self.outer = self.facets if group is None else self._without_neighbours({group, *groups})
        self.solid = Solid(mesh, self.facets)
        count, place = self.solid.within_itself()
        if place is not None:
            found = f"{count} facets of its surface in other elements, the first at ({place_in_words(place)})"
            raise SceneError([MeshFault("self-overlap", "a mesh that does not lie in itself", found)])
        if body.placed_on == "vertices":
            refuse_double_nodes(mesh, self.edge > 0.0, self.edge)
        if by_nodes:
            shortest = minimum(comm, float(self.edge[self.edge > 0.0].min(initial=np.inf)))
            count, place = self.solid.hanging_nodes(shortest)
            if place is not None:
                found = f"{count} on facets or edges of elements without them, the first at ({place_in_words(place)})"
                raise SceneError([MeshFault("hanging-node", "nodes that all elements around have", found)])
        if group is None:
            # parts of one material may meet at an edge that others hold together
            refuse_hinges(mesh, self.facets)
        # of the particles first .. first + n - 1 in the order of the mesh
        self.rows: dict[str, np.ndarray] = {}
        if body.placed_on == "vertices":
            self._on_nodes(volumes)
        else:
            self._in_elements(volumes)
        self.first, self.count = count_before(comm, len(self.rows["volume"]))
        self.coarsest = float(maximum(comm, self.rows["spacing"].max(initial=0.0)))

    def _on_nodes(self, volumes: list[np.ndarray]) -> None:
        mesh, local = self.mesh, self.mesh.local
        total, d = len(local.nodes), local.points.shape[1]
        volume, area, across, movable = np.zeros(total), *np.zeros((2, total, d)), np.ones(total, bool)
        for (_, cells), shares in zip(local.blocks, volumes):
            volume += np.bincount(cells.ravel(), shares.ravel(), minlength=total)
        for (_, nodes, _), (_, outer, areas), flat in zip(self.facets, self.outer, self._flat()):
            shares = shares_of_nodes(local.points[outer], areas)
            for i in range(d):
                area[:, i] += np.bincount(outer.ravel(), shares[:, :, i].ravel(), minlength=total)
                own = flat[:, i]
                across[:, i] += np.bincount(outer[own].ravel(), shares[own, :, i].ravel(), minlength=total)
            movable[nodes] = False
        come = mesh.nodes.deliver(local.nodes, volume=volume, area=area, across=across, movable=movable)
        self._used = _marked(len(mesh.nodes), come["number"])
        self.rows = {
            "position": mesh.points,
            "volume": _summed(len(mesh.nodes), come["number"], come["volume"]),
            "area": _summed(len(mesh.nodes), come["number"], come["area"]),
            "area_across": _summed(len(mesh.nodes), come["number"], come["across"]),
            "spacing": self.edge,
            "movable": ~_marked(len(mesh.nodes), come["number"][~come["movable"]]),
        }
        self.rows = {name: values[self._used] for name, values in self.rows.items()}

    def _flat(self) -> list[np.ndarray]:
        """Of facets by number of nodes, across which axes (facets, d) they lie, to a rounding error. Collective."""
        local, nodes = self.mesh.local, self.mesh.nodes
        tolerance = nodes.fetch(local.nodes, 2.0 * TOLERANCE * self.edge)
        return [np.ptp(local.points[own], axis=1) <= tolerance[own].max(axis=1)[:, None] for _, own, _ in self.outer]

    def _without_neighbours(self, groups: set[str]) -> Facets:
        """The facets that are on the surface of the elements of all groups, too."""
        of = self.whole.groups.elements
        joined = restricted(self.whole, [one for one in sorted(groups) if self.comm.allreduce(len(of.get(one, ())))])
        of_all = {nodes.shape[1]: joined.local.nodes[nodes] for _, nodes, _ in boundary_facets(joined)}
        result = []
        for owner, nodes, vectors in self.facets:
            own = np.sort(self.mesh.local.nodes[nodes], axis=1)
            all_rows = np.sort(of_all.get(nodes.shape[1], own[:0]), axis=1)
            _, number = np.unique(np.concatenate([all_rows, own]), axis=0, return_inverse=True)
            kept = np.isin(number.ravel()[len(all_rows) :], number.ravel()[: len(all_rows)])
            result.append((owner[kept], nodes[kept], vectors[kept]))
        return result

    def _in_elements(self, volumes: list[np.ndarray]) -> None:
        points = self.mesh.local.points
        volume = np.concatenate([shares.sum(axis=1) for shares in volumes])
        area, across = np.zeros((2, len(volume), points.shape[1]))
        for (owner, _, vectors), flat in zip(self.outer, self._flat()):
            np.add.at(area, owner, vectors)
            np.add.at(across, owner, vectors * flat)
        self.rows = {
            "position": np.concatenate([points[cells].mean(axis=1) for _, cells in self.mesh.local.blocks]),
            "volume": volume,
            "area": area,
            "area_across": across,
            "spacing": volume ** (1.0 / points.shape[1]),
            "movable": np.ones(len(volume), bool),
        }
        self.rows = self._kept_elements(self.rows)

    def _kept_elements(self, rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Rows of own elements, brought to the ranks that keep their numbers and in the order of these."""
        come = self.mesh.elements.deliver(self.mesh.local.numbers, **rows)
        order = np.argsort(come.pop("number"))
        return {name: values[order] for name, values in come.items()}

    def mark(self, known: Mapping[str, Region]) -> None:
        """Find the particles in regions, and what of their surface is; before `scatter`. Collective."""
        member = Membership(self.mesh, known, self.edge, self.whole)
        inside = member.facets(self.outer)
        if self.body.placed_on == "vertices":
            # area vectors (own nodes, regions, d) [m^2] of the facets in regions, lumped to their nodes
            local = self.mesh.local
            met = np.unique(np.concatenate([nodes.ravel() for _, nodes, _ in self.outer]))
            vectors = np.zeros((len(met), len(known), local.points.shape[1]))
            for (_, nodes, area), chosen in zip(self.outer, inside):
                places = np.searchsorted(met, nodes)
                for to, share in zip(places.T, shares_of_nodes(local.points[nodes], area).swapaxes(0, 1)):
                    np.add.at(vectors, to, chosen[:, :, None] * share[:, None, :])
            come = self.mesh.nodes.deliver(local.nodes[met], vectors=vectors)
            vectors = _summed(len(self.mesh.nodes), come["number"], come["vectors"])[self._used]
            held = member.nodes()[self._used]
        else:
            vectors = np.zeros((len(self.mesh.local.numbers), len(known), self.mesh.points.shape[1]))
            for (owner, _, area), chosen in zip(self.outer, inside):
                np.add.at(vectors, owner, chosen[:, :, None] * area[:, None, :])
            vectors = self._kept_elements({"vectors": vectors})["vectors"]
            held = member.elements(self.rows["position"], self.rows["spacing"])
        self.rows["regions"] = (held | vectors.any(axis=2)).astype(np.int64)
        self.rows["surfaces"] = vectors.reshape(len(vectors), len(known) * self.mesh.points.shape[1])

    def scatter(self, start: int, particles: Slices) -> None:
        """Bring this rank those of the mesh's particles, which begin at number `start`, that are in its slice of all.
        Collective."""
        numbers = start + self.first + np.arange(len(self.rows["volume"]))
        self.rows = particles.deliver(numbers, **self.rows)
        self.first = max(particles.first - start, 0)
        del self.rows["number"]

    def inside(self, places: np.ndarray, margin: float) -> int:
        """How many places (n, d) of all ranks, summed over the ranks, are in the mesh, farther from its surface than a
        margin [m]. Collective."""
        near = ((places > self.lower) & (places < self.upper)).all(axis=1)
        return self.solid.inside(np.ascontiguousarray(places[near]), margin)

    def piece(self, first: int, last: int) -> ParticleSet:
        """The particles with ids first .. last-1, which this rank has, their body index left at 0."""
        identifier = np.arange(first, last)
        rows = {name: values[first - self.first : last - self.first].copy() for name, values in self.rows.items()}
        dimension = rows["position"].shape[1]
        spacing = np.repeat(rows["spacing"][:, None], dimension, axis=1)
        offset = jitter_offsets(self.body, identifier, rows["movable"], dimension)
        return ParticleSet(
            identifier=identifier,
            position=rows["position"] + offset * spacing,
            volume=rows["volume"],
            spacing=spacing,
            axes=None,
            body=np.zeros(len(identifier), np.int32),
            area=rows["area"],
            area_across=rows["area_across"],
            regions=rows.get("regions"),
            surfaces=rows.get("surfaces"),
        )


def _unused(mesh: MeshSlices) -> int:
    """How many of the kept nodes no element of any rank has. Collective."""
    come = mesh.nodes.deliver(mesh.local.nodes)
    return int((~_marked(len(mesh.nodes), come["number"])).sum())


def _summed(count: int, number: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Sums (count, ...) of values (n, ...) by number (n,), in their order."""
    result = np.zeros((count, *values.shape[1:]))
    np.add.at(result, number, values)
    return result


def _marked(count: int, number: np.ndarray) -> np.ndarray:
    """Which of `count` numbers (n,) has."""
    result = np.zeros(count, bool)
    result[number] = True
    return result


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
