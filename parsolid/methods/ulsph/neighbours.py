"""The rows that neighbours read of particles, and the two sweeps over a rank's pairs.

Fields of particles are stored component by component. Sweeps read rows of four numbers, which are filled before each
sweep: those of owned particles while a message travels, those of ghosts after it, and last those of mirror images.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from parsolid.kernels import aligned_zeros, kernel
from parsolid.methods.ulsph import pair_weights, sweeps, sweeps_in_plane
from parsolid.methods.ulsph.mirror_rows import MirrorRows
from parsolid.methods.ulsph.near_pairs import Part, has_torn, parts_of_list
from parsolid.pairs.verlet_list import VerletList
from parsolid.particles.container import Particles

# rows that stay in the first-level cache while their columns are filled
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
    """The sweeps of a rank, with the rows that they read and write, see `sweeps`.

    stride: columns from a vector to the next one in a row; rates, flows, slopes: sums of the last sweeps, whose forces
    are fields; plane_forces (codes, 2, d) [N]: of stresses and of the viscosity, by the images of each code of moving
    planes; torn: whether neighbours have come too far apart, see `near_pairs.has_torn`.
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
        fourier: bool,
    ) -> None:
        """particles: with all their fields; welded: bodies stick together rather than press on one another; corrected:
        gradients are corrected, and pairs in tension keep weights of their reference distances; fourier: heat flows by
        Fourier's law alone."""
        self.particles, self.pairs, self.dimension, self.smoothing = particles, pairs, dimension, smoothing
        self.viscosity, self._pressing, self._corrected = viscosity, None if welded else True, corrected
        self._fourier = True if fourier else None
        if dimension == 2:
            self.stride, mass, length = 2, 4, 5
            self._find_tensions = pair_weights.find_tension_in_plane
            self._add_rates = sweeps_in_plane.add_rates_in_plane
            self._add_forces = sweeps_in_plane.add_forces_in_plane
        else:
            self.stride, mass, length = 4, 3, 7
            self._find_tensions = pair_weights.find_tension_in_space
            self._add_rates, self._add_forces = sweeps.add_rates_in_space, sweeps.add_forces_in_space
        d, stride = dimension, self.stride
        # names of fields, first component, number of components, first column
        motion = [("velocity", 0, d, 0), ("position", 0, d, stride), ("mass", 0, 1, mass)]
        self._motion_columns = self._columns([*motion, ("smoothing_length", 0, 1, length)])
        stress = [("pair_stress", d * j, d, stride * j) for j in range(d)]
        numbers = ("density", "sound_speed", "micro_rate", "temperature")
        record = [*stress, *((name, 0, 1, stride * d + k) for k, name in enumerate(numbers))]
        self._record_columns = self._columns(record)
        fluxes = ("pair_micro_flux", 0), ("pair_heat_flux", 1)
        self._flux_columns = self._columns([(name, c, 1, 2 * c + first) for name, first in fluxes for c in range(d)])

    def _columns(self, places: list[tuple[str, int, int, int]]) -> tuple[list[str], np.ndarray]:
        """Names of those fields that ghosts have, and the columns that they fill, as `fill_rows` takes them."""
        fields = self.particles.fields
        names = sorted({name for name, *_ in places if name in fields and fields[name].ghosts is not None})
        columns = [
            (names.index(name), component + c, column + c)
            for name, component, components, column in places
            if name in names
            for c in range(components)
        ]
        return names, np.array(columns, np.int64).reshape(-1, 3)

    def follow(self) -> None:
        """Make room for the particles and pairs of a list that was just made. Collective."""
        particles, pairs, stride, n = self.particles, self.pairs, self.stride, self.particles.owned
        rows = known = n + particles.ghosts
        self._images: MirrorRows | None = None
        if pairs.images is not None:
            self._images, rows = (
                MirrorRows(pairs, particles["reference_position"][:known]),
                known + len(pairs.images.source),
            )
        self._motion, self._record = aligned_zeros((rows, 8)), aligned_zeros((rows, 4 * stride))
        self._flux = aligned_zeros((rows, 2 * stride)) if self._flux_columns[0] else None
        self._tension = aligned_zeros((rows, 8 if self.dimension == 3 else 4)) if self._corrected else None
        self.rates, self.flows = aligned_zeros((n, 4 * stride)), aligned_zeros((n, 4))
        self.slopes, self._forces = aligned_zeros((n, 2 * stride)), aligned_zeros((n, 2 * stride))
        self._heating = np.zeros(n)
        lists = parts_of_list(particles, pairs, self.dimension, self.smoothing, self._corrected)
        self._inner, self._outer, self._mirror = lists
        if self._corrected:
            self.torn = has_torn(particles, pairs, self.dimension, self.smoothing.support) or self.torn
        particles.update("record")
        self._fill(0, known, self._record_columns, self._record)
        if self._images is not None:
            self._images.fill_record(self._record)

    def find_rates(self, drift_ghosts: Callable[[], None]) -> None:
        """Sums of velocity gradients, moments and flows; drift_ghosts() is called when ghosts have their velocities."""
        owned, known = self.particles.owned, self.particles.owned + self.particles.ghosts
        self._fill(0, owned, self._motion_columns, self._motion)
        self._fill(0, owned, self._flux_columns, self._flux)
        self._find_tension(0, known, False)
        self.rates[:], self.flows[:] = 0.0, 0.0

        def receive() -> None:
            drift_ghosts()
            self._fill(owned, known, self._motion_columns, self._motion)
            self._fill(owned, known, self._flux_columns, self._flux)
            if self._images is not None:
                self._images.fill_motion(self._motion, self._flux)

        def add(part: Part, both: bool) -> None:
            arrays = self._fourier, self._motion, self._record, self.rates, self.flows
            self._add_rates(self.smoothing, *self._pairs_of(part, both), *arrays)

        self._sweep(add, "motion", receive)

    def find_forces(self) -> None:
        """Forces, viscous heat, and sums of gradients of v^p and T; ghosts have drifted."""
        d, owned, known = self.dimension, self.particles.owned, self.particles.owned + self.particles.ghosts
        motion, images = self._motion, self._images
        self._fill(0, known, self._motion_columns, motion)
        if images is not None:
            images.fill_motion(motion, self._flux)
            self.plane_forces = np.zeros((len(self.pairs.codes.planes), 2, d))
        self._fill(0, owned, self._record_columns, self._record)
        self._find_tension(0, owned, True)
        self._forces[:], self._heating[:], self.slopes[:] = 0.0, 0.0, 0.0

        def receive() -> None:
            self._fill(owned, known, self._record_columns, self._record)
            if images is not None:
                images.fill_record(self._record)
            self._find_tension(owned, known, True)

        def add(part: Part, both: bool) -> None:
            arrays = motion, self._record, self._forces, self._heating, self.slopes
            before = None if part.code is None else (self._forces.copy(), self._heating.copy())
            self._add_forces(self.smoothing, *self._pairs_of(part, both), self.viscosity, *arrays)
            if before is None or images is None:
                return
            of_images = (self._forces - before[0]).reshape(owned, 2, self.stride)[:, :, :d]
            self.plane_forces[part.code] += of_images.sum(axis=0)
            if images.unlike[part.code]:
                # not half of what a pair takes: the image of the pair approaches otherwise than the pair
                approach = motion[:owned, :d] - 0.5 * self.pairs.codes.velocities[part.code, :d]
                self._heating[:] = before[1] - np.sum(of_images[:, 1] * approach, axis=1)

        self._sweep(add, "record", receive)
        of = self.particles.storage
        fields = of("force"), of("viscous_force"), of("viscous_heat")
        collect_forces(owned, self.stride, self._forces, self._heating, *fields)

    def _sweep(self, add: Callable[[Part, bool], None], message: str, receive: Callable[[], None]) -> None:
        """add(part, True) to pairs of owned particles, both of which receive, while a message travels; then receive(),
        and add(part, False) to pairs with ghosts and images, of which the owned particle alone receives."""
        self.particles.send(message)
        for part in self._inner:
            add(part, True)
        self.particles.receive(message)
        receive()
        for part in self._outer + self._mirror:
            add(part, False)

    def _pairs_of(self, part: Part, both: bool) -> tuple[Any, ...]:
        """Arguments of a sweep from `pairs` to `flux`."""
        near, weights = part.near.find(self._motion)
        options = (self._pressing, None, None, None) if part.between else (None, weights, self._tension, self._flux)
        return near, both, *options

    def _fill(self, first: int, last: int, columns: tuple[list[str], np.ndarray], rows: Any) -> None:
        """Rows first..last-1 from the particles' fields."""
        names, places = columns
        if names and last > first:
            fill_rows(first, last, tuple(map(self.particles.storage, names)), places, rows)

    def _find_tension(self, first: int, last: int, mean: bool) -> None:
        """Rows first..last-1 of tension, and of images after the last ghost; mean: of the record before and the present
        one."""
        if self._tension is None:
            return
        self._find_tensions(first, last, mean, self._record, self._tension)
        if self._images is not None and last == self._images.first:
            self._images.fill_tension(self._tension)

    def arrays(self) -> list[np.ndarray]:
        rows: list[Any] = [self._motion, self._record, self.rates, self.flows, self.slopes]
        rows += [self._forces, self._heating, self._tension, self._flux]
        parts = self._inner + self._outer + self._mirror
        return [array for array in rows if array is not None] + [
            array for part in parts for array in part.near.arrays()
        ]
