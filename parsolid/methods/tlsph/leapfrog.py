"""One force evaluation a step: velocity Verlet whose dissipation lags by half a step, with exact relaxation.

    v' = v + dt/2 (T + D + L(t))/m,   x += dt v'
    F += dt grad v',   H = cof F,   J = det F,   A relaxed exactly (`materials.viscoelastic.maxwell`)
    T from P(F, A),   D from v', x and the waves of the new state
    v = v' + dt/2 (T + D + L(t + dt))/m

T and D are state: D belongs to v', so that a new evaluation from v gives other bits. Prescribed components of v' are
their mean over the step, which kicks do not change. As grad is linear in v, F stays grad x by the same operator.
"""

from math import sqrt
from typing import Any

import numpy as np

from parsolid.methods import leapfrog
from parsolid.methods.leapfrog import drift
from parsolid.methods.tlsph.body_weights import ON_LATTICES, bonded_bodies, meshes_of
from parsolid.methods.tlsph.lattice_bodies import speed_ratio
from parsolid.pairs.box_stable_step import chords
from parsolid.per_rank import PerRank, own_share
from parsolid.scene.method_settings import KINETIC_OFFSET

# Of c_p and c_s in the speed that takes a particle spacing in the largest stable step. The lagged dissipation bounds
# it: w^2 dt^2 + 2 b dt = 4 where a wave has the frequency w and the damping b. They bound all waves of square and
# cubic lattices with h/dx >= 0.85 for Poisson's ratios of 0 to 0.4999, and small free bodies.
_WEIGHTS = {2: (1.09, 0.60), 3: (1.20, 1.02)}
_LEAST_SMOOTHING = 0.85


def wave_weights(dimension: int, smoothing: float) -> tuple[float, float]:
    """What c_p and c_s count for h/dx = smoothing; below 0.85 as where only the nearest neighbours of a lattice act, of
    which the wave that alternates along every axis has b = 2 [c_p + (d - 1) c_s]/dx."""
    pressure, shear = _WEIGHTS[dimension]
    return (pressure, shear) if smoothing >= _LEAST_SMOOTHING else (pressure, dimension - 1.0)


def slowing_of(system: Any, scene: Any) -> dict[Any, float]:
    """For each law by how much the step of its bodies is shorter where heavier or stiffer ones are bonded to them.

    Pairs of unlike particles have the mean modulus and the mean impedance of both, and a light one moves under them:
    w^2 grows by the mean modulus over its own, the damping by the mean impedance over its own.
    """
    result = dict.fromkeys(system.laws, 1.0)
    for body, others in enumerate(bonded_bodies(scene, meshes_of(system.body_weights))):
        modulus, density = system.wave_modulus(body)
        for stiffness, mass in map(system.wave_modulus, others):
            stiffer, heavier = stiffness / modulus, sqrt(stiffness * mass / (modulus * density))
            ratio = max(1.0, sqrt(0.5 * (1.0 + stiffer)), 0.5 * (1.0 + heavier))
            result[system.laws[body]] = max(result[system.laws[body]], ratio)
    return result


class StepBound:
    """How the speeds of waves in bodies of a `system` bound the step of leapfrog; bodies from meshes have another."""

    system: Any

    @property
    def signals(self) -> tuple[float, ...]:
        """What the speeds of waves count in the bound, see `Leapfrog`."""
        found: tuple[float, ...] = self.system.leapfrog.signals
        return found

    @property
    def last_step(self) -> float:
        """Length [s] of the step before the present one."""
        return float(self.system.leapfrog.kicks.last_step)

    def step_of(self, block: Any, signal: float) -> float:
        """Largest step [s] for a signal [sqrt(Pa)] of the particles of a block."""
        return float(self.system.leapfrog.step_of(block.law, signal))


class Leapfrog:
    """Steps of one rank's particles.

    signals: three pairs of what c_p and c_s count in the speed that bounds the step, of which the greatest sum holds,
    as `point_update.update_tile` takes them. safety: part of the largest step that is taken. forces_of: how often the
    reference had been moved when the forces of the state were found, None before that.
    """

    def __init__(self, system: Any, scene: Any) -> None:
        """system: `system.TotalLagrangianSPH`, with its fields declared."""
        self.system = system
        self.kicks = leapfrog.Leapfrog(system.particles, system.conditions, "stress_force", "dissipative_force")
        if "mesh" in system.body_weights and all(one.material.kind != "elastic-plastic" for one in scene.bodies):
            # their steps are long for the strains that they bear; bodies that flow store the work of the mean of both
            # ends of a step, as leapfrog books it
            self.kicks.work_offset = leapfrog.WorkOffset()
        self.forces_of: int | None = None
        self.signals, self.safety = self.bounds()

    def bounds(self) -> tuple[tuple[float, ...], float]:
        """`signals` and `safety` by the present settings."""
        system, settings = self.system, self.system.settings
        pressure, shear = wave_weights(system.dimension, settings.smoothing)
        # D grows with the factor on it; without any, waves alone would allow more
        most = max(1.0, settings.dissipation_of("kernel"))
        # equilibria have none, and no steps
        safety = settings.safety or 1.0
        if not system.lattice_bodies:
            return (pressure, shear) * 3, safety / most
        signals = [one.signal_speed(settings) for one in system.lattice_bodies]
        if any(kind not in (*ON_LATTICES, "mesh") for kind in system.body_weights):
            signals.append(lambda fast, slow: most * (pressure * fast + shear * slow))
        # at rest, the mean of all laws: there the bound is sharpest
        middle = float(np.sqrt(np.mean([speed_ratio(law) for law in system.laws])))
        forms = chords(signals, min(max(middle, 0.05), 0.95))
        return tuple(float(number) for form in forms for number in form), safety

    def step_of(self, law: Any, signal: float) -> float:
        """Largest step [s] for a signal [sqrt(Pa)] of particles of a law."""
        if not signal > 0.0:
            return 0.0
        return float(self.safety * self.system.spacing * sqrt(law.density) / (signal * self.system.slowing[law]))

    def stable_step(self) -> float:
        found = [
            bodies.step_of(block, block.wave_speeds(bodies.signals)[1])
            for bodies in self.system.sweeps
            for block in bodies.blocks
        ]
        return min(self.system.conditions.largest_step, *found, np.inf)

    def begin(self) -> None:
        """Begin with the present places and velocities, of which no forces are known."""
        self.forces_of, self.kicks.last_step = None, 0.0

    def state(self) -> dict[str, Any]:
        """Whether the particles have the forces that a step begins with, and the length of the last step [s]."""
        found: dict[str, Any] = {"forces_of": self.forces_of, "last_step": self.kicks.last_step}
        offset = self.kicks.work_offset
        if offset is not None and offset.energy is not None:
            found["work_offset"] = PerRank(offset.energy)
        return found

    def set_state(self, state: dict[str, Any]) -> None:
        self.forces_of, self.kicks.last_step = state["forces_of"], state["last_step"]
        if self.kicks.work_offset is not None:
            kept = state.get("work_offset")
            self.kicks.work_offset.energy = None if kept is None else float(own_share(self.system.comm, kept)[0])

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """Opening half kick, drift, and prescribed motion."""
        system = self.system
        if self.forces_of != system.reference_updates:
            self.evaluate()
        self.kicks.open_step(time, step)
        drift(0, system.owned, step, system.particles.storage("velocity"), system.particles.storage("position"))
        self.kicks.place(time + step, step)
        if system.fixed_walls is not None:
            system.fixed_walls.observe(0.5 * step)

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """Forces of the new state, closing half kick, energies."""
        sound, dissipated = self.find_forces(step, announce)
        self.kicks.close_step(time + step, step, self.system.substeps)
        self.kicks.book(step, ledger, dissipated, KINETIC_OFFSET)
        for block in self.system.blocks:
            block.book(ledger)
        if self.system.fixed_walls is not None:
            self.system.fixed_walls.book(ledger)
        return sound

    def find_forces(self, step: float, announce: Any) -> tuple[bool, float]:
        """State and forces at the end of a step [s]; (sound, energy [J] that branches have dissipated)."""
        system = self.system
        sound, dissipated, stable = True, 0.0, system.conditions.largest_step
        for bodies in system.sweeps:
            positive, lost, allowed = bodies.advance_step(step)
            sound, dissipated, stable = sound and positive, dissipated + lost, min(stable, allowed)
        announce(sound, stable)
        for bodies in system.sweeps:
            bodies.find_forces()
        if system.statics is not None:
            system.statics.stabilise_motion()
        if system.fixed_walls is not None:
            system.fixed_walls.find()
            system.fixed_walls.observe(0.5 * step)
        return sound, dissipated

    def evaluate(self) -> None:
        """Forces of the present state, with the dissipation of its own velocity; collective."""
        self.find_forces(0.0, lambda sound, stable: None)
        self.forces_of = self.system.reference_updates
