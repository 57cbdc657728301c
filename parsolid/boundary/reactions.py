"""Force, moment and work of the conditions of a scene that tell them, in whatever way a method finds the impulses."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import Declarations, Declared, HeldRegion, PrescribedMotion, Support
from parsolid.boundary.prescribed import PrescribedRows
from parsolid.boundary.slides import Slide
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.regions import selected

# rows (k,) of this rank's particles and which of their components (k, d) a condition holds
Held = Callable[[], tuple[np.ndarray, np.ndarray]]


def moments(places: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Their sum, (3,) in space, (1,) about the axis out of the plane."""
    if places.shape[1] == 2:
        return np.array([places[:, 0] @ forces[:, 1] - places[:, 1] @ forces[:, 0]])
    return np.asarray(np.cross(places, forces).sum(axis=0))


class Told:
    """One condition that tells what it takes: its impulse and moment on the bodies in a step, and its work [J]."""

    def __init__(self, one: Declared, dimension: int):
        assert one.where.reports is not None
        self.one, self.name, self.dimension = one, one.where.reports, dimension
        self.about = np.array(one.where.moment_about or [0.0] * dimension)  # type: ignore[attr-defined]
        self.values = np.zeros(dimension + (1 if dimension == 2 else 3))
        self._impulse, self._work = np.zeros_like(self.values), 0.0

    def add(self, places: np.ndarray, impulses: np.ndarray, velocities: np.ndarray) -> None:
        """Impulses (k, d) [N s] at places (k, d) [m] that move with velocities (k, d) [m/s]."""
        self.take(places, impulses, float(np.sum(impulses * velocities)))

    def take(self, places: np.ndarray, impulses: np.ndarray, work: float) -> None:
        """Impulses (k, d) [N s] at places (k, d) [m] and their work [J]."""
        self._impulse += np.concatenate([impulses.sum(axis=0), moments(places - self.about, impulses)])
        self._work += work

    def set(self, places: np.ndarray, forces: np.ndarray, work: float) -> None:
        """Forces (k, d) [N] in place of those of impulses, and work [J] that comes to what there is."""
        self.values = np.concatenate([forces.sum(axis=0), moments(places - self.about, forces)])
        self._impulse, self._work = np.zeros_like(self.values), self._work + work

    def finish(self, step: float, ledger: Any) -> None:
        """Impulses of a step [s] are its mean force; the ledger takes the work."""
        if step > 0.0 and self._impulse.any():
            self.values = self._impulse / step
        ledger.add_term(f"{self.name}.work", self._work)
        self._impulse, self._work = np.zeros_like(self.values), 0.0


def told_by(conditions: Iterable[Told], name: str) -> np.ndarray | None:
    """Force (d,) and moment (1 or 3,) of this rank's part of a condition, None where it is not among these."""
    return next((one.values for one in conditions if one.name == name), None)


def holders(
    comm: MPI.Comm, declared: Declarations, prescribed: PrescribedRows, particle_set: ParticleSet, particles: Particles
) -> list[tuple[Told, Held]]:
    """Conditions that tell their force and hold components of particles, each with what it holds; collective.

    What a prescribed motion holds is no other condition's. Slides are not among them, see `sliding`.
    """
    result: list[tuple[Told, Held]] = []
    for one in declared.all:
        if one.where.reports is None or (isinstance(one, HeldRegion) and one.kind != "fixed"):
            continue
        if isinstance(one, PrescribedMotion):
            result.append((Told(one, declared.dimension), lambda one=one: prescribed.of(one)))  # type: ignore[misc]
        elif isinstance(one, Support | HeldRegion):
            components = np.ones(declared.dimension, bool)
            if isinstance(one, Support):
                components = one.plane.held(declared.dimension)
            chosen = selected(declared.scene, one.where, particle_set, comm)
            result.append((Told(one, declared.dimension), _clamped(particles, chosen, components, prescribed)))
    return result


def sliding(slides: list[Slide], dimension: int) -> list[tuple[Told, Slide]]:
    """Those of slides that tell their force."""
    return [(Told(slide.one, dimension), slide) for slide in slides if slide.one.where.reports is not None]


def _clamped(particles: Particles, chosen: np.ndarray, components: np.ndarray, prescribed: PrescribedRows) -> Held:
    selection = particles.selection(chosen)

    def held() -> tuple[np.ndarray, np.ndarray]:
        mask = np.zeros((particles.owned, len(components)), bool)
        mask[selection.rows] = components
        mask[prescribed.entries] = False
        return selection.rows, mask[selection.rows]

    return held
