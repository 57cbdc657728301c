"""What the loop, the output and the reports ask of a method; a new method derives from `ParticleSystem`."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from parsolid.boundary.conditions import COMMON_START, EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.boundary.mirror_planes import MirrorPlane
from parsolid.boundary.reactions import Reaction
from parsolid.collective import Stopped, anywhere
from parsolid.materials.registry import laws_of
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.distribution import sort_for_speed
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene
from parsolid.scene.codes import Note, Warned

# what a file of fields has in any case
ALWAYS_WRITTEN = ("identifier", "body", "volume")
# told (whether the state is sound, the stable step [s] of this rank)
Announce = Callable[[bool, float], None]


class EnergyLedger(Protocol):
    """Where a method writes what energy goes where, see `simulation.ledger.Ledger`."""

    def add(self, weight: float, internal: float, numerical: float, external: float) -> None:
        """Dissipation, internal and numerical, and external work: rates [W] times a weight [s]."""

    def add_term(self, name: str, energy: float) -> None:
        """One of the terms that the settings name [J]."""


class BrokenPairs(NamedTuple):
    """Pairs that were bonded and are no longer, seen from their owned end: its row, the other's identifier, their
    distance in the reference [m] and the other's whole volume [m^3], (k,) each."""

    row: np.ndarray
    identifier: np.ndarray
    distance: np.ndarray
    volume: np.ndarray


class ParticleSystem:
    """A method with its bodies on one rank; sizes are of this rank's owned particles, d = dimension.

    Set by the simulation: interactions, those of the scene; bodies, the scene's numbers of the system's bodies, which
    are numbered from 0 within it;
    name, unlike that of other systems, empty where there is one.
    Set by the method: comm, settings (the scene's), dimension, owned, particles, mass (owned,) [kg] and
    share (owned,), the part of a particle's mass on this side of mirror planes (tributary mass = mass share).
    bounded: whether forces between bodies bound its steps.
    jumps: times [s] at which a step of length 0 is due for all systems, because loads jump.
    stop_times: times [s] at which a step must end; even_steps: whether steps between two of them have one length
    (leapfrog near its limit gains energy where they change).
    takes_heat: whether any of its laws has a temperature, see `take_heat`; undamped: whether nothing takes from waves
    of a few spacings, so that faces in contact rattle on.
    substep, substeps: number of its step in the present one of all systems, and how many those are.
    evaluations: force evaluations a step; directed_pairs: interactions counted once a particle; farthest: distance of
    a ghost from this rank's particles [m], where neighbours stand along lines and fill no ball.
    energy_scale: an energy [J], the same on all ranks, of which the balance has the round-off even where kinetic and
    stored vanish.
    reached: time [s] of the state after a step that ended before its end, as there is no way on, or as the run is to
    stop (stopped); None else. unsettled: whether a stop has left forces out of balance, which a step of length 0 finds.
    stop_requested: whether this rank has been asked to stop, for steps of many solutions; set by the loop.
    rebuild_needed: whether this rank has found what all ranks must act on at the next step, as it is when a step is
    announced; rebuild_anywhere: whether any rank had, told before the next step.
    reactions: of conditions that report their force. given: energy [J] that `fracture_dissipation` gave in steps in
    which it fell, the same on all ranks.
    placements: counts how often particles may have changed their rows or ranks, or bonds have broken, the same on all
    ranks; None where rows may change in every step. indicated (owned,) [J/m^3]: see `simulation.field_output`.
    """

    comm: Any
    interactions: Sequence[Any] = ()
    bounded: bool = True
    reactions: Sequence[Reaction] = ()
    settings: Any
    bodies: tuple[int, ...]
    name: str = ""
    dimension: int
    owned: int
    particles: Particles
    jumps: tuple[float, ...] = ()
    stop_times: tuple[float, ...] = ()
    even_steps: bool = False
    energy_scale: float = 0.0
    given: float = 0.0
    takes_heat: bool = False
    undamped: bool = False
    substep: int = 0
    substeps: int = 1
    evaluations: int = 1
    directed_pairs: int = 0
    farthest: float = 0.0
    reached: float | None = None
    stopped: bool = False
    unsettled: bool = False
    looks: int = 0
    stop_requested: Callable[[], bool] = staticmethod(lambda: False)
    rebuild_needed: bool = False
    rebuild_anywhere: bool = False
    placements: int | None = 0
    indicated: np.ndarray | None = None

    def raise_if_stopped(self, every: int = 1) -> None:
        """Raise `Stopped` on all ranks where any has been asked to stop; every: how many calls go before one that
        looks. Collective."""
        self.looks += 1
        if self.looks % every == 0 and anywhere(self.comm, self.stop_requested()):
            raise Stopped

    @staticmethod
    def sort(comm: Any, scene: Scene, particle_set: ParticleSet) -> np.ndarray:
        """Order (n,) in which the constructor wants this rank's particles; collective."""
        return sort_for_speed(comm, particle_set, laws_of(scene))

    @staticmethod
    def owners(comm: Any, scene: Scene, particle_set: ParticleSet) -> np.ndarray | None:
        """Ranks (n,) int32 of particles that need a certain one, -1 of others; None where none does; collective."""
        return None

    def busiest(self, total: int, ranks: int) -> int:
        """Particles of the busiest of so many ranks, of the system's total."""
        return -(-total // ranks)

    def __init__(self, comm: Any, scene: Scene, particle_set: ParticleSet):
        """Everything but the state; particle_set: this rank's particles, sorted. Collective.

        Raises SolverError on all ranks when the scene cannot be set up.
        """
        raise NotImplementedError

    @property
    def mass(self) -> np.ndarray:
        """Mass (owned,) [kg], of the whole particle where it lies on a mirror plane."""
        return self.particles.owned_rows("mass")

    @property
    def share(self) -> np.ndarray:
        """The part (owned,) of a particle on this side of mirror planes."""
        return self.particles.owned_rows("share") if "share" in self.particles else np.ones(self.owned)

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """Set the state at time 0; collective."""
        raise NotImplementedError

    def resume(self) -> None:
        """Continue from fields that were put back and from `set_state`; collective."""

    def forget(self) -> None:
        """After `resume`, where the scene was allowed to change: forget what was kept that follows from it."""

    def state(self) -> dict[str, Any]:
        """What a restart needs besides the checkpointed fields, as JSON has it, the same on all ranks; collective."""
        return {}

    def bring_state_up_to_date(self) -> None:
        """Fill what of the declared state is filled only for those who ask, before it is written."""

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave, before `resume`."""

    def begin_stage(self, time: float, ledger: EnergyLedger) -> None:
        """Go on with the settings of the next stage of the scene, which begins at a time [s]; what that does to the
        energies goes into the ledger. Collective."""
        raise NotImplementedError

    def stable_step(self) -> float:
        """Largest step [s] of this rank's particles in the current state."""
        raise NotImplementedError

    def steps_to(self, end: float) -> float:
        """How many steps this rank's particles ask for from time 0 to an end [s], as they are now."""
        return end / self.stable_step()

    def advance_positions(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """The first part of a step [s] from a time [s], after which positions are those at its end."""
        raise NotImplementedError

    def complete_step(self, time: float, step: float, ledger: EnergyLedger, announce: Announce) -> bool:
        """The second part of a step [s] from a time [s], with the external forces of the new positions; False when the
        state is not sound (no longer a solid).

        announce(sound, stable step [s] of this rank after the step) is called once, as early as these are known.
        """
        raise NotImplementedError

    def advance(self, time: float, step: float, ledger: EnergyLedger, announce: Announce) -> bool:
        """A whole step [s] from a time [s] under the external forces that there are, see `complete_step`."""
        self.advance_positions(time, step, ledger)
        return self.complete_step(time, step, ledger, announce)

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        """Planes of symmetry, with the system's numbers of their bodies."""
        return []

    def least_mass(self, body: int) -> float:
        """Least mass of a particle of a body over that of its cell."""
        return 1.0

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """lambda + 2 mu [Pa], 0 without stress, and density [kg/m^3] of one of its bodies, undeformed."""
        return 0.0, 1.0

    def broken_pairs(self) -> BrokenPairs | None:
        """Pairs of one body that have broken, without mirror images; None where none ever breaks."""
        return None

    def parted(self, place: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Which of other places (n, d) [m] a crack that bodies have from the start parts from a place (d,)."""
        return np.zeros(len(others), bool)

    def take_external_forces(self, keep_rows: bool) -> None:
        """Declare the fields of forces and impulses of contact, tools and ties, before a restart puts fields back.

        keep_rows: let particles keep their rows for some steps where they would change ranks in any.
        """
        if EXTERNAL_FORCE in self.particles:
            return
        for name, unit in ((EXTERNAL_FORCE, "N"), (EXTERNAL_IMPULSE, "N s")):
            field = Field(name, self.dimension, unit, checkpointed=True, mirror="vector", layout=Columns())
            self.particles.declare(field)
        if self.settings.substeps not in (None, 1):
            self.particles.declare(Field(COMMON_START, self.dimension, "m", mirror="vector", layout=Columns()))

    def take_heat(self, heat: np.ndarray, rows: np.ndarray) -> float:
        """Heat (n,) [J] into owned rows (n,), of whole particles; what of it the stored energy holds [J].

        Between steps only; only where `takes_heat`.
        """
        raise NotImplementedError

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank's particles."""
        raise NotImplementedError

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Values of particles first..last-1 of a field that is not declared, (n,), (n, d) or (n, 3, 3), or None.

        Every method has deformation_gradient and first_piola_kirchhoff_stress or stress (Cauchy) [Pa].
        """
        raise NotImplementedError

    @property
    def usual_fields(self) -> tuple[str, ...]:
        """Fields that are written unless the scene chooses, beside those of all methods."""
        return ()

    def prepare_fields(self, names: Iterable[str], time: float) -> None:
        """Exchange between ranks what `shown` needs for fields of these names in the state at a time [s], before it is
        asked for them; collective."""

    def reaction(self, name: str) -> np.ndarray | None:
        """Force (d,) [N] and moment (1 or 3,) [N m] of a condition that tells them, on this rank's particles.

        Of the last step; None where no condition of this name is the method's.
        """
        return next((one.values for one in self.reactions if one.name == name), None)

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """ "sum", "minimum" or "maximum", and this rank's part, of one of the settings' extra quantities."""
        raise KeyError(name)

    def first_invalid(self) -> tuple[int, str] | None:
        """The rank's first particle that is not sound, and what is wrong with it."""
        jacobian, velocity = self.particles.owned_rows("jacobian"), self.particles.owned_rows("velocity")
        bad = ~(jacobian > 0.0) | ~np.isfinite(velocity).all(axis=1)
        if not bad.any():
            return None
        index = int(np.argmax(bad))
        what = f"the Jacobian is {jacobian[index]:.4g}, not positive: matter is turned inside out"
        if not np.isfinite(jacobian[index]) or not np.isfinite(velocity[index]).all():
            what = "a number is no longer finite"
        return index, what

    def validity_warning(self) -> str | None:
        """Why the state is beyond what the method describes; collective, the same on all ranks."""
        return None

    def warnings(self) -> list[Warned]:
        """What is likely to be wrong for what the scene asks of the method, in the system's keys; collective, the same
        on all ranks."""
        return []

    def advice(self) -> str:
        """What most likely helps when a run goes wrong."""
        return "more particles, or a milder load"

    def progress(self) -> list[str]:
        """What lines of progress say besides times and energies."""
        return []

    def cost_notes(self) -> list[Note]:
        """What makes a run cost more than its particles say; collective, the same on all ranks."""
        return []

    def numbers(self) -> dict[str, int]:
        """Counts of this rank that `check` tells."""
        return {}

    def exchanged_records(self) -> dict[str, int]:
        """Name and width (8-byte numbers) of what travels to other ranks and is no field."""
        return {}

    def arrays(self) -> list[np.ndarray]:
        """Arrays that count as this rank's memory, besides those of the particles."""
        return []

    def bytes_a_step(self) -> int:
        """Bytes this rank sends in one step."""
        return 0

    def summary(self) -> dict[str, Any]:
        """Further entries of summary.json; collective, the same on all ranks."""
        return {}

    @staticmethod
    def small_scene(tables: dict[str, Any]) -> dict[str, Any]:
        """Adapt the tables of a small scene whose kernels are compiled before the run."""
        return tables
