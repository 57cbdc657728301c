"""Bodies whose moduli relax differently in one scene: forces and histories of each Prony series apart.

The energy is a sum over particles a of psi_a, which knows the relaxing displacement u + sum gamma_j q_j with the
ratios and times of a's own series, at both ends of its bonds. So the force is a sum over the series. That of a series
is linear in its relaxing displacement, which all particles have, and only the particles of the series tell others a
stress and a control: each bond between bodies has a part of either. One displacement for all would pull at such a bond
when nothing but a translation has happened, since q_j is that of the whole displacement.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from parsolid.methods.peridynamics.bond_force import BondForce
from parsolid.methods.peridynamics.viscoelastic_history import ViscoelasticHistory, series_of


class SeriesEngine:
    """What a history asks of an engine, for the particles of one series alone; force (owned, d) [N] is theirs."""

    def __init__(self, engine: BondForce, blocks: list[Any]) -> None:
        """blocks: those of the series. Collective."""
        self.engine, self.particles, self.owned = engine, engine.particles, engine.owned
        self.dimension = engine.dimension
        others = np.ones(engine.owned, bool)
        for block in blocks:
            others[block.first : block.last] = False
        self.others, self.mine = np.flatnonzero(others), np.flatnonzero(~others)
        self.force = np.zeros((engine.owned, engine.dimension))
        columns = engine.record_columns
        self.changing = getattr(columns, "changing", columns.width)
        self.control = self._control(columns)

    def _control(self, columns: Any) -> np.ndarray | None:
        """What particles tell of their control, which is 0 of other series, ghosts' too."""
        if self.engine.stabiliser is None:
            return None
        record = self.engine.record
        whole = record[: self.owned, self.changing : columns.width].copy()
        record[self.others, self.changing : columns.width] = 0.0
        self.particles.update("stiffness")
        found = record[:, self.changing : columns.width].copy()
        record[: self.owned, self.changing : columns.width] = whole
        self.particles.update("stiffness")
        return found

    @property
    def field(self) -> np.ndarray:
        """The relaxing displacement (rows, d) [m] of the series."""
        return self.engine.field

    @property
    def displacement(self) -> np.ndarray:
        """The displacement (rows, d) [m]."""
        return self.engine.displacement

    @property
    def linear_force(self) -> np.ndarray:
        """All of it."""
        return self.force

    def evaluate(self, laws: Any) -> np.ndarray:
        """Force (owned, d) [N] of the field by the laws of the series, as far as it is linear in it."""
        self.force[:] = self._alone(self.engine.evaluate_linear, laws)
        return self.force

    def evaluate_stiffness(self, laws: Any) -> np.ndarray:
        """The same by the laws of a stiffness."""
        return self._alone(self.engine.evaluate_stiffness, laws)

    def _alone(self, evaluate: Callable[[Any], np.ndarray], laws: Any) -> np.ndarray:
        """An evaluation in which only particles of the series tell others anything."""
        if self.control is not None:
            self.engine.record[:, self.changing : self.changing + self.control.shape[1]] = self.control
        self.engine.silent = self.others, slice(self.changing)
        try:
            return evaluate(laws)
        finally:
            self.engine.silent = None


class UnlikeSeries:
    """The histories of several series as one, see `ViscoelasticHistory`, whose methods these are."""

    def __init__(self, engine: BondForce, blocks: list[Any], series: list[Any]) -> None:
        """series: (ratios, times) of all bodies of the scene without repetition, the same on all ranks. Collective."""
        self.engine = engine
        self.laws = [(block.first, block.last, block.law) for block in blocks]
        self.parts: list[ViscoelasticHistory] = []
        for number, one in enumerate(series):
            own = [block for block in blocks if series_of(block.law) == one]
            self.parts.append(ViscoelasticHistory(SeriesEngine(engine, own), own, len(one[0]), one, f"_{number}"))
        self.factor = np.ones(engine.owned)
        self.sums = np.zeros((engine.owned, engine.particles.storage("pair_sums").shape[1]))
        self.step: float | None = None
        self.begin(0.0)

    def begin(self, step: float) -> None:
        """Weights of a step [s], unless they are those of the last call."""
        if step == self.step:
            return
        self.step = step
        for part in self.parts:
            part.begin(step)
            self.factor[part.engine.mine] = part.factor[part.engine.mine]

    def stiffness_force(self, tangents: Any, change: np.ndarray) -> np.ndarray:
        """-K du [N] (owned, d) of a displacement du (owned, d), see `Operator.stiffness`."""
        total = np.zeros((self.engine.owned, self.engine.dimension))
        for part in self.parts:
            # a rank without particles of a series has an empty block, which begins where the next one does
            own = [one for one in tangents if any(one[:2] == (first, last) for first, last, _ in part.laws)]
            total += part.stiffness_force(own, change)
        return total

    def internal_force(self, step: float) -> np.ndarray:
        """Force (owned, d) [N] after a step [s] from the settled state to the engine's displacement."""
        self.begin(step)
        self.engine.prepare(step)
        for part in self.parts:
            part.internal_force(step)
            self._keep_sums(part)
        return self._whole_force()

    def settle(self, step: float) -> float:
        """End a step [s]; the energy dissipated over it [J]."""
        self.begin(step)
        return sum(part.settle(step) for part in self.parts) + self.engine.settle()

    def start(self, instantaneous: bool) -> None:
        """History and forces of the engine's displacement at time 0."""
        self.engine.prepare(0.0)
        for part in self.parts:
            part.start(instantaneous)
        self._settled_force()
        if not instantaneous:
            self.engine.relax_fully()
        self.resume()

    def resume(self) -> None:
        """Forces of a settled state that was put back."""
        self.engine.prepare(0.0)
        for part in self.parts:
            part.resume()
            self._keep_sums(part)
        self._settled_force()

    def evaluate_anew(self) -> None:
        """Forces of the settled state and of each part of its history, after bonds were broken."""
        self.engine.prepare(0.0)
        for part in self.parts:
            part.evaluate_anew()
            self._keep_sums(part)
        self._settled_force()

    def stored_energy(self) -> float:
        """Of all series [J], in the settled state."""
        return sum(part.stored_energy() for part in self.parts) + self.engine.stored

    def _keep_sums(self, part: ViscoelasticHistory) -> None:
        mine = part.engine.mine
        self.sums[mine] = self.engine.particles.storage("pair_sums")[mine]

    def _settled_force(self) -> None:
        self._whole_force()
        self.engine.settle()

    def _whole_force(self) -> np.ndarray:
        # gradients of each particle's own relaxing displacement, for its stress
        self.engine.particles.storage("pair_sums")[: self.engine.owned] = self.sums
        total = np.zeros((self.engine.owned, self.engine.dimension))
        for part in self.parts:
            total += part.engine.force
        return self.engine.combine(self.laws, total)
