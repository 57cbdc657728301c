"""Both passes over the lists of a rank: what they take, and what ghosts are told before."""

from collections.abc import Callable
from typing import Any

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
        storage, d = self.particles.storage, self.space.dimension
        self.of_bodies.follow(self.pairs, self.particles)
        flux = storage("flux") if self.carried is not None else None
        self._arrays = Arrays(storage("kinematics"), storage("mass"), storage("record"), flux)
        lengths: Any = None
        if self.one_length is not None:
            inverse = 1.0 / self.one_length
            lengths = OneLength(self.one_length, inverse, inverse ** (d + 2))
        else:
            lengths = ManyLengths(storage("smoothing_length"))
        self._first = self.space, self.kernel, lengths

    def _pieces(self, pairs: Any) -> list[tuple[Any, Any, Any, Arrays]]:
        """Pairs, contact, what flows, arrays: nothing flows from body to body."""
        own, alone = (self.carried, self._arrays), (None, self._arrays._replace(flux=None))
        return [(piece, contact, *(own if contact is None else alone)) for piece, contact in self.of_bodies.of(pairs)]

    def rates(self, received: Callable[[], None]) -> None:
        """Velocity gradients, moments and divergences; `received` is called when ghosts have their velocities."""
        sums = self.particles.storage("rate_sums")
        sums[: self.particles.owned] = 0.0

        def add(pairs: Any) -> None:
            if pairs is self.pairs.rim:
                received()
            for piece, contact, carried, arrays in self._pieces(pairs):
                passes.add_rates(*self._first, carried, contact, piece, arrays, sums)

        self.pairs.sweep(add, "motion")

    def forces(self) -> None:
        """Forces, viscous heat and gradients of numbers."""
        sums = self.particles.storage("force_sums")
        sums[: self.particles.owned] = 0.0

        def add(pairs: Any) -> None:
            for piece, contact, carried, arrays in self._pieces(pairs):
                passes.add_forces(*self._first, carried, contact, self.viscosity, self.heating, piece, arrays, sums)

        self.pairs.sweep(add, "record")
