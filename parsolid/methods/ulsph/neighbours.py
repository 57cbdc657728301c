"""What neighbours read of particles, and the two sweeps over a rank's pairs.

Fields of particles are kept component by component; sweeps read rows of four, which are filled from them before each
sweep: those of owned particles while a message travels, those of ghosts after it, those of mirror images from the rows
that they mirror.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from parsolid.kernels import aligned_zeros, kernel
from parsolid.methods.ulsph import sweeps
from parsolid.methods.ulsph.near_pairs import NearPairs
from parsolid.pairs.verlet_list import Pairs, VerletList
from parsolid.particles.container import Particles

# which components of a field stand in which columns of a row: name, first component, components, column
Places = list[tuple[str, int, int, int]]
# neighbours on a square lattice are nearer than so many spacings
_DIAGONAL = 1.45
# of the support: where the weight that pairs in tension keep begins to go, see `sweeps.held_weight`
_LETTING_GO = 0.8
# rows that stay in the fastest cache while their columns are filled
_TOGETHER = 64


@kernel
def fill_rows(first, last, fields, columns, rows):
    """Copy components of fields (components, particles) of particles first..last-1 into rows.

    columns (k, 3): number of a field, its component, and the column of the rows that it fills.
    """
    for start in range(first, last, _TOGETHER):
        end = min(start + _TOGETHER, last)
        for k in range(columns.shape[0]):
            field, component, column = fields[columns[k, 0]], columns[k, 1], columns[k, 2]
            for a in range(start, end):
                rows[a, column] = field[component, a]


@kernel
def collect_forces(owned, stride, forces, heating, force, viscous_force, viscous_heat):
    """Rows of forces and heat, as `sweeps` finds them, into fields (components, particles)."""
    for a in range(owned):
        for c in range(force.shape[0]):
            force[c, a], viscous_force[c, a] = forces[a, c], forces[a, stride + c]
        viscous_heat[0, a] = heating[a]


class Neighbours:
    """The sweeps of a rank, with the rows that they read and write as `sweeps` says.

    stride: from a vector to the next one in a row; rates, flows, slopes: what was found last. Forces are fields.
    plane_forces (codes, 2, d): of stresses and of the viscosity, of images by each code on the particles [N], where
    planes move.

    torn: whether neighbours on the lattice, one of them here, which have neither flowed nor failed, have come so far
    apart that the weight which they keep in tension is about to go.
    """

    plane_forces: np.ndarray
    torn = False

    def __init__(
        self,
        particles: Particles,
        pairs: VerletList,
        dimension: int,
        smoothing: Any,
        viscosity: sweeps.ArtificialViscosity | None,
        welded: bool,
        corrected: bool,
    ) -> None:
        """particles: with all their fields; welded: whether bodies stick together, rather than press on one another;
        corrected: whether gradients are, so that pairs in tension may have weights of another distance."""
        self.particles, self.pairs, self.dimension, self.smoothing = particles, pairs, dimension, smoothing
        self.viscosity, self._pressing, self._corrected = viscosity, None if welded else True, corrected
        if dimension == 2:
            self.stride, mass, length = 2, 4, 5
            self._add_rates, self._add_forces = sweeps.add_rates_in_plane, sweeps.add_forces_in_plane
            self._tension_of_rows = sweeps.find_tension_in_plane
        else:
            self.stride, mass, length = 4, 3, 7
            self._add_rates, self._add_forces = sweeps.add_rates_in_space, sweeps.add_forces_in_space
            self._tension_of_rows = sweeps.find_tension_in_space
        d, stride = dimension, self.stride
        motion: Places = [("velocity", 0, d, 0), ("position", 0, d, stride)]
        self._motion = self._there([*motion, ("mass", 0, 1, mass), ("smoothing_length", 0, 1, length)])
        numbers = ("density", "sound_speed", "micro_rate", "temperature")
        stress: Places = [("pair_stress", d * j, d, stride * j) for j in range(d)]
        self._record = self._there([*stress, *((name, 0, 1, stride * d + k) for k, name in enumerate(numbers))])
        fluxes = ("pair_micro_flux", 0), ("pair_heat_flux", 1)
        self._flux = self._there([(name, c, 1, 2 * c + first) for name, first in fluxes for c in range(d)])

    def _there(self, places: Places) -> tuple[list[str], np.ndarray]:
        """Fields that ghosts know, and the columns of rows that they fill, as `fill_rows` takes them."""
        fields = self.particles.fields
        there = [one for one in places if one[0] in fields and fields[one[0]].ghosts is not None]
        names = sorted({name for name, *_ in there})
        columns = [
            (names.index(name), component + c, column + c)
            for name, component, components, column in there
            for c in range(components)
        ]
        return names, np.array(columns, np.int64).reshape(-1, 3)

    def follow(self) -> None:
        """Make room for the particles and pairs of a list that was just made."""
        particles, pairs, stride, n = self.particles, self.pairs, self.stride, self.particles.owned
        known = n + particles.ghosts
        rows = known if pairs.images is None else known + len(pairs.images.source)
        self._rows_of_motion, self._rows_of_record = aligned_zeros((rows, 8)), aligned_zeros((rows, 4 * stride))
        self._rows_of_flux = aligned_zeros((rows, 2 * stride)) if self._flux[0] else None
        self.rates, self.flows = aligned_zeros((n, 4 * stride)), aligned_zeros((n, 4))
        self.slopes, self._forces = aligned_zeros((n, 2 * stride)), aligned_zeros((n, 2 * stride))
        self._heating = np.zeros(n)
        self._tension: np.ndarray | None = None
        if self._corrected:
            self._tension = aligned_zeros((rows, 8 if self.dimension == 3 else 4))
        if pairs.images is not None:
            # factors and shifts that make rows of images of the rows that they mirror: v' = Q v + 2 w, x' as in
            # `MirrorCodes`, P' = Q P R, so that the power of forces is that of stresses on the rates; fluxes, and P in
            # weights, are reflected
            d, stride, m = self.dimension, self.stride, len(pairs.images.source)
            codes, code = pairs.codes, pairs.images.code
            Q, R, D = (array[code, :d] for array in (codes.signs, codes.reflections, codes.drifts))
            self._motion_factor, self._shift = np.ones((m, 8)), np.zeros((m, 8))
            self._motion_factor[:, :d], self._motion_factor[:, stride : stride + d] = Q, D
            # planes whose images do not move as mirror images of their particles do
            self._unlike = (codes.signs != codes.reflections).any(axis=1)
            self._carried = (R - D) * self._reference_place()[pairs.images.source] if codes.carried else 0.0
            self._code = code
            self._shift_images()
            self._record_factor, self._flux_factor = np.ones((m, 4 * stride)), np.ones((m, 2 * stride))
            for j in range(d):
                self._record_factor[:, stride * j : stride * j + d] = Q * R[:, j : j + 1]
            self._tension_factor = np.ones((m, 8 if d == 3 else 4))
            for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)) if d == 3 else ((0, 1),)):
                self._tension_factor[:, d + column] = R[:, i] * R[:, j]
            self._flux_factor[:, : 2 * d] = np.repeat(R, 2, axis=1)
        lists = ((pairs.inner, n), (pairs.outer, known), (pairs.mirror, rows))
        reference = self._reference(pairs.images, pairs.codes) if self._corrected else None
        self._parts = {id(one): self._by_bodies(one, read, reference) for one, read in lists if one is not None}
        if reference is not None:
            self.torn = self._has_torn(reference[0]) or self.torn
        if pairs.images is not None and pairs.mirror is not None and (pairs.codes.moving or self._unlike.any()):
            code = pairs.images.code[pairs.mirror.neighbour - known]
            every = [(pairs.mirror.where(code == one), one) for one in range(len(pairs.codes.planes))]
            split = [(self._by_bodies(chosen, rows, reference), one) for chosen, one in every]
            self._parts[id(pairs.mirror)] = [(part, between, one) for parts, one in split for part, between, _ in parts]
        particles.update("record")
        self._fill(0, known, self._record, self._rows_of_record)
        self._mirror_record()

    def _shift_images(self) -> None:
        """What images have besides their factors, at the present planes."""
        d, code = self.dimension, self._code
        self._shift[:, :d] = self.pairs.codes.velocities[code, :d]
        self._shift[:, self.stride : self.stride + d] = self.pairs.codes.shifts[code, :d] + self._carried

    def _reference_place(self) -> np.ndarray:
        """Positions at the start (rows, d) [m] of owned particles and ghosts."""
        return self.particles["reference_position"][: self.particles.owned + self.particles.ghosts]

    def _reference(self, images: Any, codes: Any) -> tuple[np.ndarray, np.ndarray]:
        """Reference positions (rows, d) [m] and smoothing lengths (rows,) [m] of all rows."""
        d, place = self.dimension, self._reference_place()
        length = self.particles["smoothing_length"][: len(place)]
        if images is not None:
            R, T = codes.reflections[images.code, :d], codes.shifts_at_start[images.code, :d]
            place = np.concatenate((place, R * place[images.source] + T))
            length = np.concatenate((length, length[images.source]))
        return np.ascontiguousarray(place), np.ascontiguousarray(length)

    def _has_torn(self, place: np.ndarray) -> bool:
        """Whether pairs of this rank make `torn` true; reference positions (rows, d) [m]. Collective."""
        of, pairs = self.particles, self.pairs
        sound = of.owned_rows("plastic_strain") == 0.0
        if "damage" in of:
            sound &= of.owned_rows("damage") == 0.0
        spacing = np.prod(of.owned_rows("spacing"), axis=1) ** (1.0 / self.dimension)
        known = pairs.halo.with_ghosts(np.column_stack((sound, spacing, of.owned_rows("body"))))
        x, h = of["position"], of["smoothing_length"]
        for one in (pairs.inner, pairs.outer) if pairs.outer is not None else (pairs.inner,):
            a, b = one.particle, one.neighbour
            near = np.linalg.norm(place[b] - place[a], axis=1) < _DIAGONAL * np.minimum(known[a, 1], known[b, 1])
            near &= (known[a, 0] * known[b, 0] == 1.0) & (known[a, 2] == known[b, 2])
            a, b = a[near], b[near]
            apart = np.linalg.norm(x[b] - x[a], axis=1)
            if (apart > _LETTING_GO * self.smoothing.support * 0.5 * (h[a] + h[b])).any():
                return True
        return False

    def _by_bodies(self, pairs: Pairs, rows: int, reference: Any) -> list[tuple[NearPairs, bool, int | None]]:
        """A list, which reads the first rows, as that of pairs within bodies and that of pairs between two, with
        whether it is the latter, and None for the code of images that `follow` tells apart. reference: positions
        and lengths whose weights pairs in tension keep, or None."""

        def near(chosen: Pairs, between: bool) -> tuple[NearPairs, bool, int | None]:
            weights = None
            if reference is not None and not between:
                weights = np.empty(len(chosen.neighbour))
                sweeps.reference_weights(self.smoothing, chosen, *reference, weights)
            return NearPairs(chosen, weights, rows, self.dimension, self.smoothing.support), between, None

        if "contact_body" not in self.particles:
            return [near(pairs, False)]
        body = self.particles["contact_body"]
        if self.pairs.images is not None:
            known = self.particles.owned + self.particles.ghosts
            body = np.concatenate((body[:known], body[self.pairs.images.source]))
        between = body[pairs.particle] != body[pairs.neighbour]
        if not between.any():
            return [near(pairs, False)]
        return [near(pairs.where(~between), False), near(pairs.where(between), True)]

    def find_rates(self, drift_ghosts: Callable[[], None]) -> None:
        """Sums of velocity gradients, moments and flows; drift_ghosts() is called when ghosts have their velocities."""
        owned, known = self.particles.owned, self.particles.owned + self.particles.ghosts
        motion, record, flux = self._rows_of_motion, self._rows_of_record, self._rows_of_flux
        self._fill(0, owned, self._motion, motion)
        self._fill(0, owned, self._flux, flux)
        self._find_tension(0, known, False)
        self.rates[:], self.flows[:] = 0.0, 0.0

        def received() -> None:
            drift_ghosts()
            self._fill(owned, known, self._motion, motion)
            self._fill(owned, known, self._flux, flux)
            self._mirror_motion()

        def add(pairs: Pairs, both: bool) -> None:
            for part, between, _ in self._parts[id(pairs)]:
                near, weights = part.find(motion)
                options = (self._pressing, None, None, None) if between else (None, weights, self._tension, flux)
                self._add_rates(self.smoothing, near, both, *options, motion, record, self.rates, self.flows)

        self._sweep(add, "motion", received)

    def find_forces(self) -> None:
        """Forces, viscous heat, and sums of gradients of v^p and T; ghosts have drifted."""
        owned, known = self.particles.owned, self.particles.owned + self.particles.ghosts
        motion, record, flux = self._rows_of_motion, self._rows_of_record, self._rows_of_flux
        self._fill(0, known, self._motion, motion)
        self._mirror_motion()
        self._fill(0, owned, self._record, record)
        self._find_tension(0, owned, True)
        self._forces[:], self._heating[:], self.slopes[:] = 0.0, 0.0, 0.0
        if self.pairs.images is not None:
            self.plane_forces = np.zeros((len(self.pairs.codes.planes), 2, self.dimension))

        def received() -> None:
            self._fill(owned, known, self._record, record)
            self._mirror_record()
            self._find_tension(owned, known, True)

        def add(pairs: Pairs, both: bool) -> None:
            sums = self._forces, self._heating, self.slopes
            for part, between, code in self._parts[id(pairs)]:
                near, weights = part.find(motion)
                options = (self._pressing, None, None, None) if between else (None, weights, self._tension, flux)
                before = None if code is None else (self._forces.copy(), self._heating.copy())
                self._add_forces(self.smoothing, near, both, *options, self.viscosity, motion, record, *sums)
                if before is None:
                    continue
                of_images = (self._forces - before[0]).reshape(owned, 2, self.stride)[:, :, : self.dimension]
                self.plane_forces[code] += of_images.sum(axis=0)
                if self._unlike[code]:
                    # not half of what a pair takes: the image of the pair approaches otherwise than the pair
                    approach = (
                        motion[:owned, : self.dimension] - 0.5 * self.pairs.codes.velocities[code, : self.dimension]
                    )
                    self._heating[:] = before[1] - np.sum(of_images[:, 1] * approach, axis=1)

        self._sweep(add, "record", received)
        of = self.particles.storage
        fields = of("force"), of("viscous_force"), of("viscous_heat")
        collect_forces(owned, self.stride, self._forces, self._heating, *fields)

    def _sweep(self, add: Callable[[Pairs, bool], None], message: str, received: Callable[[], None]) -> None:
        """add(pairs, both): to pairs of owned particles, which both receive, while a message travels; then received(),
        and to pairs with ghosts and mirror images, of which the owned particle alone receives."""
        self.particles.send(message)
        add(self.pairs.inner, True)
        self.particles.receive(message)
        received()
        for pairs in (self.pairs.outer, self.pairs.mirror):
            if pairs is not None:
                add(pairs, False)

    def _fill(self, first: int, last: int, places: tuple[list[str], np.ndarray], rows: Any) -> None:
        """Rows first..last-1 from the particles' fields."""
        names, columns = places
        if names and last > first:
            fill_rows(first, last, tuple(map(self.particles.storage, names)), columns, rows)

    def _find_tension(self, first: int, last: int, mean: bool) -> None:
        """What `sweeps.held_weight` reads of rows first..last-1, and of images after the last ghost; mean: of the
        record before and the present one."""
        if self._tension is None:
            return
        self._tension_of_rows(first, last, mean, self._rows_of_record, self._tension)
        known, images = self.particles.owned + self.particles.ghosts, self.pairs.images
        if images is not None and last == known:
            # a pair and its image have the same weight
            self._tension[known:] = self._tension_factor * self._tension[images.source]

    def _mirror_motion(self) -> None:
        """Rows of motion and fluxes of mirror images."""
        if self.pairs.images is not None:
            first, source = self.particles.owned + self.particles.ghosts, self.pairs.images.source
            if self.pairs.codes.moving:
                self._shift_images()
            self._rows_of_motion[first:] = self._motion_factor * self._rows_of_motion[source] + self._shift
            if self._rows_of_flux is not None:
                self._rows_of_flux[first:] = self._flux_factor * self._rows_of_flux[source]

    def _mirror_record(self) -> None:
        """Rows of stresses of mirror images."""
        if self.pairs.images is not None:
            first, source = self.particles.owned + self.particles.ghosts, self.pairs.images.source
            self._rows_of_record[first:] = self._record_factor * self._rows_of_record[source]

    def arrays(self) -> list[np.ndarray]:
        """All rows and short lists, for what counts memory."""
        rows: list[Any] = [self._rows_of_motion, self._rows_of_record, self.rates, self.flows, self.slopes]
        rows += [self._forces, self._heating, self._tension, self._rows_of_flux]
        short = [array for parts in self._parts.values() for part, *_ in parts for array in part.arrays()]
        return [one for one in rows if one is not None] + short
