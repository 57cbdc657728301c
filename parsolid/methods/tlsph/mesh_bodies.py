"""Bodies with the weights of their own mesh (`pairs.mesh_weights`): what they do beyond other bodies with pair lists.

Their pairs are those of nodes that share an element. Beside the sweeps of all pair lists there are two short ones over
pairs on the surface, where the weight is not antisymmetric, and one with the stabilising force. There are no mirror
images: a plane is a face of the body on which components of the velocity are held. Masses are corrected.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import REACH_MARGIN, Halo
from decomposition.reduction import sums
from parsolid.boundary.conditions import HALF
from parsolid.boundary.mirror_planes import symmetry_planes
from parsolid.collective import anywhere, minimum, raise_together
from parsolid.materials.hyperelastic.at_particles import has_band
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.viscoelastic.maxwell import total_modulus
from parsolid.methods.tlsph.list_bodies import ListBodies
from parsolid.methods.tlsph.shared_nodes import SharedNodes
from parsolid.methods.tlsph.tangent import isotropic_moduli, packed
from parsolid.pairs.mesh_weights import (
    MeshPairs,
    centres_of_functions,
    corrected_volumes,
    on_surface,
    pairs_of_elements,
    stretch_energy,
    stretch_forces,
    surface_divergence,
    surface_gradient,
)
from parsolid.pairs.pair_list import MirrorImages, PairList, weights_of_pairs
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.meshes.around import elements_around, shared_nodes

# part of the largest stable step that method.safety = 1 means, and iterations that find the highest frequency
_SAFETY, _ITERATIONS = 0.9, 30
# of the stabiliser where a law flows: with more of the elastic modulus it would bear what the flow does not, and lock
_SHARE_IN_FLOW = 0.01
# figures of the frequency that count, rounded up, so that rounding on other ranks changes no step
_FIGURES = 3


def stabilising_modulus(law: Any) -> float:
    """Shear modulus [Pa] that counts in stabilisers."""
    share = _SHARE_IN_FLOW if isinstance(law, ElasticPlastic) else 1.0
    return float(share * elastic_moduli(law)[0])


class SurfacePairs(NamedTuple):
    """Pairs of a list whose weight has a symmetric part: start, neighbour as in `PairList`; half (k, d): s_ab/2."""

    start: np.ndarray
    neighbour: np.ndarray
    half: np.ndarray


class MeshNeighbours:
    """The pairs of a rank's nodes of meshes, with what `pair_list.Neighbours` offers; there are no images.

    surface, stretch, overlap: for the lists inner and outer, `SurfacePairs`, and w_ab [m] and m_ab [m^3] (m,).
    volume (rows,) [m^3], area (owned, d) [m^2]: of the weights; centres (owned, d) [m]: int N X / V, where F belongs;
    mass_volume (owned,) [m^3]: corrected masses over the density; limited: how many of this rank's nodes have less of
    the correction.
    """

    def __init__(
        self,
        comm: Any,
        elements: Any,
        extent: float,
        positions: np.ndarray,
        identifiers: np.ndarray,
        factor: float,
        shared: np.ndarray,
    ) -> None:
        """elements: blocks by identifiers, all around owned particles; extent: the largest distance [m] of two nodes of
        an element on any rank; positions (owned, d), identifiers (owned,); factor on the dissipation; shared (k,
        bodies): identifiers of particles at nodes that owned ones share. Collective."""
        self.comm, (self.owned, d) = comm, positions.shape
        halo = Halo(comm, np.ascontiguousarray(positions), extent * REACH_MARGIN)
        around = np.unique(np.concatenate([shared.ravel(), *(cells.ravel() for _, cells in elements)]))
        self.halo = halo = halo.subset(np.isin(halo.with_ghosts(identifiers)[self.owned :], around))
        self.local = self.rows = self.owned + halo.ghosts
        self.positions = halo.with_ghosts(positions)
        none = np.zeros((0, d))
        self.images = MirrorImages(np.zeros(0, np.int64), none, none, none, np.zeros(0))
        self._everyone = halo.with_ghosts(identifiers)
        self._order = np.argsort(self._everyone)
        self.elements = [(kind, self.rows_of(cells)) for kind, cells in elements]
        pairs, volume, area = pairs_of_elements(self.elements, self.owned, self.positions)
        # rows of other bodies have no pairs
        volume[volume == 0.0] = 1.0
        self.volume, self.area = halo.with_ghosts(volume[: self.owned]), area[: self.owned]
        self.centres = centres_of_functions(pairs, self.positions, self.volume)[: self.owned]
        self.mass_volume, self.limited = corrected_volumes(
            pairs, self.positions, self.volume, halo, lambda flag: anywhere(comm, flag)
        )
        surface, inside = on_surface(pairs), pairs.neighbour < self.owned
        parts = [(inside, surface[inside[surface]]), (~inside, surface[~inside[surface]])]
        self.inner, self.outer = (_pair_list(pairs, np.flatnonzero(kept), factor) for kept, _ in parts)
        self.stretch = [pairs.stretch[kept] for kept, _ in parts]
        self.overlap = [pairs.overlap[kept] for kept, _ in parts]
        self.surface = [_surface_pairs(pairs, kept) for _, kept in parts]

    def rows_of(self, identifiers: np.ndarray) -> np.ndarray:
        """Rows of owned particles and ghosts by their identifiers, -1 where these are negative."""
        place = np.searchsorted(self._everyone, identifiers, sorter=self._order)
        place[identifiers < 0] = 0
        return np.where(identifiers < 0, -1, self._order[place])

    @property
    def lists(self) -> tuple[PairList, PairList]:
        return self.inner, self.outer

    @property
    def rows_of_pairs(self) -> list[np.ndarray]:
        """The lower row (m,) of each pair of both lists."""
        return [np.repeat(np.arange(self.owned), np.diff(pairs.start)) for pairs in self.lists]


def _starts(pairs: MeshPairs, kept: np.ndarray) -> np.ndarray:
    """First pair of each particle among some of the pairs (k,)."""
    row = np.repeat(np.arange(len(pairs.start) - 1), np.diff(pairs.start))[kept]
    return np.concatenate(([0], np.cumsum(np.bincount(row, minlength=len(pairs.start) - 1)))).astype(np.int64)


def _pair_list(pairs: MeshPairs, kept: np.ndarray, factor: float) -> PairList:
    """Some of the pairs with g_ab and k_ab = S |g_ab|, as impedances have no direction."""
    d = pairs.difference.shape[1]
    weight = weights_of_pairs(len(kept))
    weight[:, :d] = pairs.difference[kept]
    weight[:, d] = factor * np.linalg.norm(pairs.difference[kept], axis=1)
    return PairList(_starts(pairs, kept).astype(np.uint32), pairs.neighbour[kept].astype(np.uint32), weight)


def _surface_pairs(pairs: MeshPairs, kept: np.ndarray) -> SurfacePairs:
    return SurfacePairs(_starts(pairs, kept), pairs.neighbour[kept], 0.5 * pairs.surface[kept])


def _shared(comm: Any, meshes: list[list[Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Of meshes with the `ElementsAround` of several bodies each, what `shared_nodes` gives of all; collective."""
    found = [shared_nodes(comm, bodies) for bodies in meshes]
    width = max((others.shape[1] for _, others in found), default=1)
    rows = [np.pad(others, ((0, 0), (0, width - others.shape[1])), constant_values=-1) for _, others in found]
    own = np.concatenate([np.zeros(0, np.int64), *(one for one, _ in found)])
    return own, np.concatenate([np.zeros((0, width), np.int64), *rows])


class MeshBodies(ListBodies):
    """The nodes of a rank's meshes, with what `ListBodies` offers.

    largest_step [s]: of leapfrog at rest, on all ranks; limited: how many nodes of all ranks have less than the whole
    correction of their masses; least_masses: by number of the body, mass over that of the volume; of_second_order:
    kinds of such elements by number of the body; stiffness: c_ab (m,) [N/m] of the pairs of the inner and of the outer
    list; shared: `SharedNodes`, None where there are none; extent [m]: of the largest element; mirrored (last, d):
    along which axes a plane of symmetry ends the body at a node; nodal: `NodalStress`, None until it is asked for.
    """

    near: Any
    nodal: Any = None
    added_stress = "stabiliser_stress"
    # pressure waves alone: how stiff the laws have become since the body was at rest
    signals = (1.0, 0.0) * 3

    def __init__(self, system: Any, blocks: list[Any], waves: int) -> None:
        """system: `system.TotalLagrangianSPH` with its fields declared; blocks: the `state.LawBlock` of these
        particles."""
        # there are no weights of kernels
        weights: Any = None
        super().__init__(system, blocks, weights, waves, None)
        d, part = self.dimension, float(system.settings.stabilisation)
        # P - beta mu F is the stress of a law with the initial stress -beta mu
        self.particles.declare(Field("stabiliser_stress", d * d, "Pa", layout=Columns(), carried=False))
        self.stabiliser = np.zeros(self.last)
        for block in blocks:
            # cracks would bear it
            modulus = 0.0 if has_band(block.law) else stabilising_modulus(block.law)
            self.stabiliser[block.first : block.last] = part * modulus
        stress = self.particles.owned_rows("stabiliser_stress")
        stress[: self.last] = -self.stabiliser[:, None] * np.eye(d).ravel()

    def find_pairs(self, scene: Any, particle_set: Any, numbers: list[int]) -> None:
        """Pairs, weights, volumes, areas, masses and the largest step; numbers: of the bodies. Collective."""
        comm, of = self.system.comm, self.particles.owned_rows
        found, of_meshes = {}, dict[Any, list[Any]]()
        for number in numbers:
            body, own = scene.bodies[number], particle_set.identifier[particle_set.body == number]
            found[number] = elements_around(comm, body, self.dimension, own, particle_set.meshes)
            of_meshes.setdefault(body.shape.model.mesh_key, []).append(found[number])
        self.of_second_order = {number: one.of_second_order for number, one in found.items() if one.of_second_order}
        elements = [block for one in found.values() for block in one.blocks]
        self.extent = max(one.extent for one in found.values())
        rows = slice(0, self.last)
        place = np.ascontiguousarray(particle_set.position[rows]), particle_set.identifier[rows]
        own, others = _shared(comm, [bodies for bodies in of_meshes.values() if len(bodies) > 1])
        near = MeshNeighbours(comm, elements, self.extent, *place, self.system.settings.dissipation_of("mesh"), others)
        if self.system.settings.linear_solver != "petsc":
            # which alone needs them later
            near.elements = []
        self._make_rows(near)
        self.take_corrections(np.eye(self.dimension), near.volume[: near.owned])
        # of bodies that share nodes the area there is that of facets that are not between them
        alone = ~np.isin(place[1], own)
        for block in self.blocks:
            here = np.arange(block.first, block.last)
            of("volume")[here] = near.volume[here]
            of("mass")[here] = block.law.density * near.mass_volume[here]
            of("area")[here[alone[here]]] = near.area[here[alone[here]]]
        self._take_planes(particle_set)
        self.shared = None
        if anywhere(comm, bool(len(own))):
            self.shared = SharedNodes(near.halo, near.rows_of(own), near.rows_of(others), of("mass")[rows])
        share = near.mass_volume / near.volume[: near.owned]
        least = np.ones(len(scene.bodies))
        np.minimum.at(least, of("body")[rows], share)
        self.least_masses = dict(enumerate(minimum(comm, least).tolist()))
        # both particles of a pair are of one body
        self.stiffness = [self.stabiliser[row] * one for row, one in zip(near.rows_of_pairs, near.stretch)]
        lists = zip(near.lists, near.surface, self.stiffness)
        self.lists_with_pairs = [one for one in lists if len(one[0].neighbour)]
        self.limited = int(sums(comm, np.array([float(near.limited)]))[0])
        self.largest_step = self._largest_step()

    def _take_planes(self, particle_set: Any) -> None:
        """Of nodes on symmetry planes, where the bodies end: which part of a whole node they are, and their area
        without that of the plane, as contact and tools need them."""
        planes = symmetry_planes(self.system.conditions.ends)
        self.mirrored = np.zeros((self.last, self.dimension), bool)
        if not planes:
            return
        part = np.ones(len(particle_set))
        for plane in planes:
            here = plane.contains(particle_set)
            part[here] *= 0.5
            self.mirrored[:, plane.axis] |= here[: self.last]
            self.particles.owned_rows("area")[here, plane.axis] = 0.0
        self.particles.declare(Field(HALF, 1, "1"), part)

    def begin(self) -> None:
        """Places of ghosts, which the energy of the state needs; collective."""
        at, X = self.columns, self.particles.owned_rows
        self.motion[: self.last, : self.dimension] = X("velocity")[: self.last]
        self.motion[: self.last, at.position : at.position + self.dimension] = X("position")[: self.last]
        self._motion.start()
        self._motion.finish()

    def join(self) -> None:
        """Give what shares a node one place and velocity, with which the state begins; collective. Raises SolverError
        on all ranks where a condition holds only some of it."""
        if self.shared is None:
            return
        free, apart = self.system.conditions.free, False
        if free is not None:
            apart = self.shared.differ(free)
        fault = (
            "boundaries: expected conditions that hold all bodies at the nodes that they share, found one for a body"
        )
        raise_together(self.system.comm, fault if apart else None)
        self.shared.move_as_one(self.particles.storage("velocity"), self.particles.storage("position"))

    def find_forces(self) -> None:
        """Also shared where bodies share nodes."""
        super().find_forces()
        if self.shared is not None:
            stored = self.particles.storage
            self.shared.share(stored("stress_force"), stored("dissipative_force"))

    def stabiliser_energy(self) -> float:
        """beta mu/2 [sum over elements of V |F|^2 - sum over particles of V |F|^2] [J] of this rank; a pair of two
        ranks counts half on each."""
        at, d, near = self.columns, self.dimension, self.near
        places = self.motion, at.position, at.reference, d
        total = 0.0
        for pairs, stiffness, part in zip(near.lists, self.stiffness, (1.0, 0.5)):
            total += part * stretch_energy(pairs.start, pairs.neighbour, stiffness, *places)
        # of H = F - 1, in which nothing large cancels
        H = self.particles.owned_rows("deformation_gradient")[: self.last] - np.eye(d).ravel()
        of_particles = np.einsum("n,nc,nc->", self.stabiliser * near.volume[: self.last], H, H)
        return total - 0.5 * float(of_particles)

    def element_variation(self) -> float:
        """mu/2 [sum over elements of V |F|^2 - sum over particles of V |F|^2] [J] of this rank: what linear elements
        store beyond the gradients recovered at their nodes, which estimates their error (Zienkiewicz and Zhu, Int. J.
        Numer. Meth. Eng. 33 (1992) 1331). 0 without the stabiliser."""
        part = float(self.system.settings.stabilisation)
        return self.stabiliser_energy() / part if part > 0.0 else 0.0

    def prepare_nodal_stress(self, time: float) -> None:
        """Find the stresses at nodes in the state at a time [s]; collective."""
        if self.nodal is None:
            # most runs do without scipy
            from parsolid.methods.tlsph.nodal_stress import NodalStress

            self.nodal = NodalStress(self)
        self.nodal.find(time)

    def nodal_stress(self, first: int, last: int, result: np.ndarray) -> None:
        """Fill Cauchy stresses (last - first, 3, 3) [Pa] at the nodes of rows first .. last - 1 that are these
        bodies' into the result, as they were found last."""
        for block in self.blocks:
            low, high = max(first, block.first), min(last, block.last)
            if low < high:
                result[low - first : high - first] = self.nodal.stress[low:high]

    def add_stiffness(self, result: np.ndarray) -> None:
        """See `ListBodies.add_stiffness`: of the elements, with the mean of their directions."""
        near, d = self.near, self.dimension
        stretch = np.zeros(near.rows)
        for pairs, row, weight in zip(near.lists, near.rows_of_pairs, near.stretch):
            stretch += np.bincount(row, weight, near.rows) + np.bincount(pairs.neighbour, weight, near.rows)
        for block in self.blocks:
            own, (shear, lame) = slice(block.first, block.last), elastic_moduli(block.law)
            result[:, own] += (shear + (lame + shear) / d) * stretch[own]

    def displacement_gradient(self, result: np.ndarray) -> None:
        """See `ListBodies.displacement_gradient`; of these particles alone."""
        found = np.zeros_like(result)
        super().displacement_gradient(found)
        for block in self.blocks:
            result[block.first : block.last] = found[block.first : block.last]

    def step_of(self, block: Any, signal: float) -> float:
        """The largest step at rest, less where pressure waves have become faster than they are there."""
        shear, lame = self._moduli(block.law)
        if not signal > 0.0:
            return 0.0
        safety = float(self.system.settings.safety or 1.0)
        return safety * self.largest_step * min(1.0, float(np.sqrt(lame + 2.0 * shear)) / signal)

    @staticmethod
    def _moduli(law: Any) -> tuple[float, float]:
        """Shear modulus and Lame's first [Pa] of fast changes at rest."""
        shear, lame = elastic_moduli(law)
        return shear + total_modulus(law.branch_moduli), lame

    def _add_own_sums(self) -> None:
        for _, surface, _ in self.lists_with_pairs:
            surface_gradient(*surface, self.motion, self.record)

    def _add_own_forces(self, stretched: int) -> None:
        place = self.motion, stretched, self.dimension
        for pairs, surface, stiffness in self.lists_with_pairs:
            surface_divergence(*surface, self.record, self.columns.stress, self.force)
            stretch_forces(pairs.start, pairs.neighbour, stiffness, *place, self.force)

    # --- the largest step at rest -----------------------------------------------------------------------------------

    def _largest_step(self) -> float:
        """Part of 2/omega over 1 + S/2, with the highest frequency of small motions; collective."""
        system = self.system
        frequency = highest_frequency(system.comm, self._linear_forces(), self._start(), self._mass())
        figures = 10.0 ** (np.floor(np.log10(frequency)) + 1 - _FIGURES)
        frequency = figures * np.ceil(frequency / figures)
        return float(_SAFETY * 2.0 / frequency / (1.0 + 0.5 * system.settings.dissipation_of("mesh")))

    def _mass(self) -> np.ndarray:
        """(last, 1) [kg], 1 for particles of other bodies."""
        mass = np.ones((self.last, 1))
        for block in self.blocks:
            own = slice(block.first, block.last)
            mass[own, 0] = block.law.density * self.near.mass_volume[own]
        return mass

    def _start(self) -> np.ndarray:
        """Numbers (last, d) between -1 and 1 that depend on identifiers alone, 0 for particles of other bodies."""
        d, identifier = self.dimension, self.particles.owned_rows("identifier")[: self.last, None]
        phase = np.modf(np.sin((identifier % 100_003 + 1) * 12.9898 + 78.233 * np.arange(d)) * 43758.5453)[0]
        of_meshes = np.zeros((self.last, 1))
        for block in self.blocks:
            of_meshes[block.first : block.last] = 1.0
        return np.asarray(phase * of_meshes)

    def _linear_forces(self) -> Callable[[np.ndarray], np.ndarray]:
        """Gives forces (last, d) [N] of small displacements (last, d) [m] by the sweeps of a step; collective."""
        d = self.dimension
        moduli, fields = np.zeros((d * d * (d * d + 1) // 2, self.last)), np.zeros((2, d, self.last))
        for block in self.blocks:
            moduli[:, block.first : block.last] = isotropic_moduli(*self._moduli(block.law), d)[:, None]
        index = packed(d)
        moduli[np.diag(index)] -= self.stabiliser

        def forces(u: np.ndarray) -> np.ndarray:
            self.change_forces(u, index, moduli, (fields[0], fields[1]))
            return np.ascontiguousarray(fields[0].T)

        return forces


def highest_frequency(comm: Any, forces: Any, start: np.ndarray, mass: np.ndarray) -> float:
    """Highest frequency omega [1/s] of M u'' = forces(u) by Lanczos' iteration.

    start (n, d): a vector without symmetries; mass (n, 1) [kg]. forces must be linear and symmetric. The frequency that
    is found is at most the highest one, and after `_ITERATIONS` about 1e-3 of it less. Collective.
    """

    def product(a: np.ndarray, b: np.ndarray) -> float:
        return float(sums(comm, np.array([np.sum(a * b)]))[0])

    root = np.sqrt(mass)
    vector = start / np.sqrt(product(start, start))
    before, off = np.zeros_like(vector), 0.0
    diagonal, beside = [], []
    for _ in range(_ITERATIONS):
        image = -forces(vector / root) / root - off * before
        diagonal.append(product(image, vector))
        image = image - diagonal[-1] * vector
        off = np.sqrt(product(image, image))
        if off <= 1e-12 * max(abs(one) for one in diagonal):
            break
        beside.append(off)
        before, vector = vector, image / off
    matrix = np.diag(diagonal) + np.diag(beside[: len(diagonal) - 1], 1) + np.diag(beside[: len(diagonal) - 1], -1)
    return float(np.sqrt(np.linalg.eigvalsh(matrix)[-1]))
