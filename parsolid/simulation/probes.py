"""Probes: what a scene watches over time, at a particle or over all of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from parsolid.collective import minimum
from parsolid.observables.declared import PARTICLE_SAMPLERS, QUANTITIES, Observables, Sampler
from parsolid.observables.samplers import (
    InRegion,
    MethodQuantity,
    ParticleField,
    Place,
    Projected,
    ReactionForce,
    Statistic,
)
from parsolid.particles.regions import nearest_particles
from parsolid.scene import Scene
from parsolid.scene.boundaries.condition import reaction_columns

# extremes of all ranks are found as minima
_SIGN = {"minimum": 1.0, "maximum": -1.0}


class Probes:
    """All probes of a scene; columns are "name.field" with a suffix for each component."""

    def __init__(self, comm: Any, scene: Scene, observables: Observables):
        """Collective."""
        self.comm, self.observables = comm, observables
        self.samplers: list[Sampler] = []
        self._fields = [name for probe in scene.probes for name in probe.fields or ()]
        for probe in scene.probes:
            columns = probe.columns_of_fields(scene.dimension)
            samplers = _samplers(comm, probe, columns, observables)
            if probe.where is not None:
                number = list(scene.named_regions).index(probe.where)
                samplers = [InRegion(sampler, number) for sampler in samplers]
            self.samplers += samplers
        for name in (one.reports for one in scene.boundaries if one.reports is not None):
            self.samplers.append(ReactionForce(name, reaction_columns(name, scene.dimension)))
        self.columns = [column for sampler in self.samplers for column in sampler.columns]

    def prepare(self, time: float) -> None:
        """Exchange what fields need that no rank finds alone, in the state at a time [s]; collective."""
        self.observables.prepare(self._fields, time)

    def sample(self) -> list[float]:
        """Values of all columns, after `prepare`; collective."""
        parts = [np.asarray(sampler.part(self.observables), float) for sampler in self.samplers]
        signs = [_SIGN.get(sampler.reduction, 0.0) for sampler in self.samplers]
        total = self.comm.allreduce(_one_array([part for part, sign in zip(parts, signs) if not sign]))
        lowest = minimum(self.comm, _one_array([sign * part for part, sign in zip(parts, signs) if sign]))
        result: list[float] = []
        for sampler, part, sign in zip(self.samplers, parts, signs):
            count = len(part)
            if sign:
                joined, lowest = sign * lowest[:count], lowest[count:]
            else:
                joined, total = total[:count], total[count:]
            result += [float(value) for value in sampler.values(joined)]
        return result

    def state(self) -> dict[str, Any]:
        """What a restart needs, by the names of the probes; the same on all ranks."""
        states = [(sampler.name, sampler.state()) for sampler in self.samplers]
        return {name: state for name, state in states if state is not None}

    def restore(self, states: dict[str, Any]) -> None:
        """Continue what a checkpoint has kept."""
        for sampler in self.samplers:
            if sampler.name in states and sampler.state() is not None:
                sampler.restore(states[sampler.name])


def _samplers(comm: Any, probe: Any, columns: dict[str, list[str]], observables: Observables) -> list[Sampler]:
    """What finds the columns of a probe of the scene, (name of field -> its columns); collective."""
    if probe.quantity is not None:
        known, names = QUANTITIES.get(probe.quantity), columns[probe.quantity]
        if known is None:
            return [MethodQuantity(probe.name, names, probe.quantity)]
        return [known(probe.name, names)]
    if probe.weight is not None:
        names = [column for field in probe.fields for column in columns[field]]
        return [Projected(probe.name, names, probe.weight, probe.fields)]
    if probe.where is not None:
        return [Statistic(probe.name, columns[name], name, probe.statistic or "mean") for name in probe.fields]
    rows, where = observables.rows, np.array([probe.at], float)
    winner, _ = nearest_particles(comm, rows("identifier"), rows("reference_position"), where)
    place, result = Place(int(winner[0])), []
    for name in probe.fields:
        if name in PARTICLE_SAMPLERS:
            result.append(PARTICLE_SAMPLERS[name](probe.name, columns[name], place, probe))
        else:
            result.append(ParticleField(probe.name, columns[name], place, name))
    return result


def _one_array(parts: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.zeros(0), *parts])
