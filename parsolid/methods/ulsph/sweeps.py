"""Both passes over the lists of a rank: what they take, and what ghosts are told before."""

from collections.abc import Callable
from typing import Any

from decomposition.recalled import RecalledEach
from parsolid.methods.ulsph import passes
from parsolid.methods.ulsph.contact import PairsOfBodies
from parsolid.methods.ulsph.terms import Arrays, ManyLengths, OneLength
from parsolid.pairs.moving_pairs import MovingPairs
from parsolid.particles.container import Particles


class Sweeps:
    """The passes; what they take is gathered when lists are made anew, with which arrays may change.

    carried: what flows between particles of a body, by type; viscosity, heating: `terms.ArtificialViscosity` and
    `terms.Warming`, or None; one_length: the smoothing length [m] of all particles, None where they differ.
    """

    def __init__(
        self,
        space: Any,
        kernel: Any,
        pairs: MovingPairs,
        particles: Particles,
        carried: Any,
        viscosity: Any,
        heating: Any,
        contact: Any,
        one_length: float | None,
    ) -> None:
        self.space, self.kernel, self.pairs, self.particles = space, kernel, pairs, particles
        self.carried, self.viscosity, self.heating, self.one_length = carried, viscosity, heating, one_length
        self.of_bodies = PairsOfBodies(contact)

    def follow(self) -> None:
        """Gather what the passes take anew, after lists were made."""
        storage, pairs = self.particles.storage, self.pairs
        self.of_bodies.follow(pairs, self.particles)
        flux = storage("flux") if self.carried is not None else None
        arrays = Arrays(storage("kinematics"), storage("mass"), storage("record"), flux)
        # nothing flows from body to body
        self._flows = {False: (self.carried, arrays), True: (None, arrays._replace(flux=None))}
        lengths: Any = None
        if self.one_length is not None:
            inverse = 1.0 / self.one_length
            lengths = OneLength(self.one_length, inverse, inverse ** (self.space.dimension + 2))
        else:
            lengths = ManyLengths(storage("smoothing_length"))
        self._first = self.space, self.kernel, lengths
        self._rates, self._forces = RecalledEach(passes.add_rates), RecalledEach(passes.add_forces)

    def _each(self, pairs: Any) -> list[tuple[Any, tuple[Any, ...], Arrays]]:
        """The pieces of a list: (pairs, what flows and how they meet, arrays)."""
        result = []
        for piece, contact in self.of_bodies.of(pairs):
            carried, arrays = self._flows[contact is not None]
            result.append((piece, (carried, contact), arrays))
        return result

    def rates(self, received: Callable[[], None]) -> None:
        """Velocity gradients, moments and divergences; `received` is called when ghosts have their velocities."""
        sums = self.particles.storage("rate_sums")
        sums[: self.particles.owned] = 0.0

        def add(pairs: Any) -> None:
            if pairs is self.pairs.rim:
                received()
            for piece, terms, arrays in self._each(pairs):
                self._rates(id(piece), *self._first, *terms, piece, arrays, sums)

        self.pairs.sweep(add, "motion")

    def forces(self) -> None:
        """Forces, viscous heat and gradients of numbers."""
        sums = self.particles.storage("force_sums")
        sums[: self.particles.owned] = 0.0

        def add(pairs: Any) -> None:
            for piece, terms, arrays in self._each(pairs):
                self._forces(id(piece), *self._first, *terms, self.viscosity, self.heating, piece, arrays, sums)

        self.pairs.sweep(add, "record")
