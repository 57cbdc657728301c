"""A simulation that a script advances itself, with the particles' arrays at hand."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.api.running import read_scene
from parsolid.commands.run import bcast_scene
from parsolid.scene.observed import FIELDS
from parsolid.simulation.loop import Limits, Simulation
from parsolid.simulation.observables import Observables
from parsolid.simulation.outputs import Callback as CallbackOutput
from parsolid.simulation.outputs import EnergyCheck, Output

Callback = Callable[["SteppedSimulation"], object]


def set_up(
    scene: str | Path | dict[str, Any], comm: Any = MPI.COMM_WORLD, trust_code: bool = False
) -> "SteppedSimulation":
    """The simulation of a scene (a TOML file or its tables) in its state at time 0; nothing is written. Collective.

    Raises SceneError or SolverError on all ranks.
    """
    return SteppedSimulation(Simulation(comm, bcast_scene(comm, lambda: read_scene(scene, trust_code))))


class SteppedSimulation:
    """Steps by hand. All methods are collective but `arrays`; times [s].

    simulation: the parsolid.simulation.loop.Simulation itself.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self._outputs: list[Output] = [EnergyCheck()]
        # the energy that later balances are told by
        simulation.energy_row()

    def __repr__(self) -> str:
        clock = self.simulation.clock
        return f"<simulation {self.simulation.scene.title!r} at {clock.time:g} s after {clock.step} steps>"

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return self.simulation.clock.time

    @property
    def steps(self) -> int:
        """Steps taken."""
        return self.simulation.clock.step

    @property
    def finished(self) -> bool:
        """Whether the scene's end_time is reached."""
        return self.time >= self.simulation.scene.end_time

    def step(self, count: int = 1) -> float:
        """Take so many steps of the stable length, not beyond the scene's end_time; the time reached.

        Raises RunFailed when the state or the energy balance is lost, ValueError for less than one step.
        """
        if count < 1:
            raise ValueError(f"step: expected at least one step, found {count}")
        if not self.finished:
            self.simulation.run(None, self._outputs, Limits(steps=count))
        return self.time

    def run_until(self, time: float) -> float:
        """Take steps and end exactly at a time, or at the scene's end_time; the time reached.

        Raises RunFailed, and ValueError for a time that is over.
        """
        if not time >= self.time:
            raise ValueError(f"run_until: expected a time from the present {self.time:g} s on, found {time:g}")
        self.simulation.run(float(time), self._outputs)
        return self.time

    def on_step(self, callback: Callback) -> Callback:
        """Call a function with this object after every step; usable as a decorator."""
        self._outputs.insert(-1, CallbackOutput(callback, argument=self))
        return callback

    def arrays(self, name: str) -> list[np.ndarray]:
        """A declared field of this rank's particles, one array a system, (n,), (n, d) or tensors by rows in SI units.

        They are views: what is written into them is the state from then on. Taken anew after a step, for particles may
        change their rank or their rows. Raises KeyError, naming what there is.
        """
        found = [system.particles for system in self.simulation.systems if name in system.particles]
        if not found:
            known = sorted({field for system in self.simulation.systems for field in system.particles.fields})
            raise KeyError(f"{name}: expected one of {', '.join(known)}")
        return [particles.owned_rows(name) for particles in found]

    def field(self, name: str) -> np.ndarray:
        """A field as files and probes show it, of this rank's particles of all systems: a copy where it is computed.

        Raises KeyError, naming what there is.
        """
        observables = Observables(self.simulation.systems)
        if not observables.has(name):
            known = [one for one in sorted(FIELDS) if observables.has(one)]
            usual = ", ".join(dict.fromkeys([*observables.usual_fields(), *known]))
            raise KeyError(f"{name}: expected one of {usual}, or one that `arrays` knows")
        return observables.field(name)

    def energies(self) -> dict[str, float]:
        """The energy ledger over all ranks [J], with the names of the history's columns."""
        return self.simulation.energy_row()
