"""One force evaluation a step: velocity Verlet whose dissipation lags by half a step, with exact relaxation.

    v' = v + dt/2 [(T + D)/m + load(t)],   x += dt v'
    F += dt grad v',   H = cof F,   J = det F,   A relaxed exactly (`materials.viscoelastic.maxwell_lanes`)
    T from P(F, A),   D from v', x and the waves of the new state
    v = v' + dt/2 [(T + D)/m + load(t + dt)]

T and D are state: D belongs to v', so that a new evaluation from v gives other bits. Prescribed components of v' are
their mean over the step, which kicks do not change. As grad is linear in v, F stays grad x by the same operator. The
dissipation has the impedances of `pairs.mean_impedance`.
"""

from typing import Any

import numpy as np

from decomposition.recalled import Recalled, RecalledEach
from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.hyperelastic.mooney_rivlin import MooneyRivlin
from parsolid.methods.tlsph import momentum as motion
from parsolid.methods.tlsph.body_weights import ON_LATTICES
from parsolid.methods.tlsph.lattice_bodies import speed_ratio
from parsolid.methods.tlsph.leapfrog_kernels import (
    ExactRelaxation,
    WaveForms,
    WaveWeights,
    advance_strain,
    greatest_signal,
)
from parsolid.numerics.lanes import WIDTH
from parsolid.numerics.wide_lanes import WIDE
from parsolid.numerics.wide_space import WIDE_SPACE
from parsolid.pairs.axis_waves import wave_forms
from parsolid.scene.method_settings import KINETIC_OFFSET

# Of c_p and c_s in the speed that takes a particle spacing in the largest stable step. The lagged dissipation bounds
# it: w^2 dt^2 + 2 b dt = 4 where a wave has the frequency w and the damping b. They bound all waves of square and
# cubic lattices with h/dx >= 0.85 for Poisson's ratios of 0 to 0.4999, and small free bodies.
_WEIGHTS = {2: WaveWeights(1.09, 0.60), 3: WaveWeights(1.20, 1.02)}
_LEAST_SMOOTHING = 0.85


def wave_weights(dimension: int, smoothing: float) -> WaveWeights:
    """What c_p and c_s count for h/dx = smoothing; below 0.85 as where only the nearest neighbours of a lattice act, of
    which the wave that alternates along every axis has b = 2 [c_p + (d - 1) c_s]/dx."""
    weights = _WEIGHTS[dimension]
    return weights if smoothing >= _LEAST_SMOOTHING else weights._replace(shear=dimension - 1.0)


class Leapfrog:
    """Moves one rank's particles.

    forces_of: how often the reference had been moved when the forces of the state were found, None before that.
    """

    def __init__(self, system: Any, scene: Any) -> None:
        """system: `system.TotalLagrangianSPH`, whose particles have the fields of a step without stages."""
        self.system = system
        self.swings = True
        system.boundaries.declare_free()
        self.forces_of: int | None = None
        self.weights, self.safety = self._bounds()
        self._advance_strain = RecalledEach(advance_strain, free=(6, 7))
        self._kick = Recalled(motion.kick, free=(2, 3))

    def _bounds(self) -> tuple[WaveWeights | WaveForms, float]:
        """What wave speeds count, and the part of the largest step that is taken."""
        system, settings = self.system, self.system.settings
        kernel, lattices = wave_weights(system.dimension, settings.smoothing), system.on_lattices
        # D grows with the factor on it; without any, waves alone would allow more
        most = max(1.0, settings.dissipation)
        if lattices is None:
            return kernel, settings.safety / most
        signals = list(lattices.signals)
        if any(kind not in ON_LATTICES for kind in system.body_weights):
            signals.append(lambda pressure, shear: most * (kernel.pressure * pressure + kernel.shear * shear))
        # at rest, the mean of all laws: there the bound is sharpest
        middle = float(np.sqrt(np.mean([speed_ratio(law) for law in system.laws])))
        forms = wave_forms(signals, min(max(middle, 0.05), 0.95))
        return WaveForms(*(WaveWeights(*form) for form in forms)), settings.safety

    def stable_step(self, block: MaterialBlock) -> float:
        """Largest step [s] of this rank's particles of a block."""
        body = self.system.body_of(block)
        return self._step_of(block, greatest_signal(*self.system.part(block), self.weights, body))

    def _step_of(self, block: MaterialBlock, signal: float) -> float:
        return self.safety * self.system.spacing * np.sqrt(block.law.density) / signal if signal > 0.0 else 0.0

    def _pull(self, sign: float) -> None:
        """Add external forces to those of the pairs, or take them back."""
        system = self.system
        if "external_force" in system.particles:
            d, force = system.dimension, system.particles.storage("pair_force")
            force[: system.owned, :d] += sign * system.particles.owned_rows("external_force") / system.share[:, None]

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """Opening half kick and drift."""
        system, boundaries = self.system, self.system.boundaries
        if self.forces_of != self._reference_updates:
            self.evaluate()
        boundaries.prescribe_mean(time, step, system.kinematics)
        self._pull(1.0)
        self.opening = self._half_kick(True, time, step)

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """Forces of the new state and closing half kick."""
        system, boundaries = self.system, self.system.boundaries
        taken, work, swing = self.opening
        system.pairs.gradient("motion")
        sound, internal, stable = self._advance_strain_of_all(step)
        announce(sound, stable)
        system.pairs.divergence(system.pairs.terms)
        impulse = system.impulse_at_end(step)
        self._pull(1.0)
        more, done, swings = self._half_kick(False, time + step, step)
        self._pull(-1.0)
        if impulse is not None:
            more -= impulse.act(system.held_components())
        boundaries.prescribe(time + step, system.kinematics)
        ledger.add(1.0, internal, taken + more, work + done + system.prescribed_energy_gain())
        ledger.add_term(KINETIC_OFFSET, swings - swing)
        return sound

    def evaluate(self) -> None:
        """Forces of the current state, with the dissipation of its own velocity; collective."""
        pairs, storage = self.system.pairs, self.system.particles.storage
        storage("pair_force")[:] = 0.0
        pairs.gradient("motion")
        self._advance_strain_of_all(0.0)
        pairs.divergence(pairs.terms)
        if (told := self.system.boundaries.reactions) is not None and told.walls is not None:
            told.walls.find()
        self.forces_of = self._reference_updates

    @property
    def _reference_updates(self) -> int:
        return 0 if self.system.reference is None else self.system.reference.updates

    def _advance_strain_of_all(self, step: float) -> tuple[bool, float, float]:
        """(sound, internal dissipation [J], stable step [s] of the new state)."""
        system, sound, dissipation = self.system, True, 0.0
        stable = system.boundaries.largest_step
        for block in system.blocks:
            relaxation = ExactRelaxation(block.relaxation(step), block.dissipation_weights(step))
            positive, lost, signal = self._advance_strain(
                block.first,
                self._space_of(block.law),
                block.first,
                block.last,
                block.law,
                system.pairs.terms,
                self.weights,
                step,
                relaxation,
                system.body_of(block),
            )
            sound, dissipation = sound and positive, dissipation + lost
            stable = min(stable, self._step_of(block, signal))
        if system.initial_stress.there:
            system.initial_stress.note()
            system.initial_stress.add()
        return sound, dissipation, stable

    def _space_of(self, law: Any) -> Any:
        """How many particles of a law are handled at once."""
        system = self.system
        arithmetic = isinstance(law, MooneyRivlin) and system.reference is None
        return WIDE_SPACE if arithmetic and system.dimension == 3 and WIDE > WIDTH else system.space

    def _kicked(self) -> tuple[np.ndarray, ...]:
        """Arrays that kicks read and change."""
        system = self.system
        return system.kinematics, system.particles.storage("pair_force"), system.mass, system.share

    def _half_kick(self, opening: bool, time: float, step: float) -> tuple[float, float, float]:
        """Half a step [s] of the forces at a time [s]; numerical dissipation, external work and, where the ledger has
        it, leapfrog's oscillation [J]."""
        system, boundaries = self.system, self.system.boundaries
        kinematics, force, mass, share = system.particles.kept(("kicked",), self._kicked)
        boundaries.look()
        loads, supports = boundaries.meet(time, not opening, force, mass, share)
        weights = (mass, share, loads)
        held = boundaries.prescribed_power(kinematics, force, *weights)
        arrays = (kinematics, force, *weights, boundaries.free, self.swings)
        if boundaries.reactions is not None and not opening:
            boundaries.reactions.book(0.5, 0.5 * step)
        dissipation, work, swing = self._kick(system.space, system.owned, opening, step, *arrays)
        if boundaries.reactions is not None and opening:
            boundaries.reactions.book(0.5, 0.5 * step)
        if boundaries.surfaces is not None and not opening:
            # the forces that stay are those of the pairs
            boundaries.surfaces.release(force, supports)
        return dissipation, work + 0.5 * step * held, swing
