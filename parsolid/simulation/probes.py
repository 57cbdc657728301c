"""Probes: what a scene watches over time, at a particle or over the body."""

from dataclasses import dataclass

import numpy as np

from parsolid.collective import minimum
from parsolid.scene import nearest_particles
from parsolid.simulation.observables import Observables


@dataclass
class Twist:
    """Accumulated angle [rad] about an axis; the state survives a restart through `angle` and `direction`."""

    axis: int
    centre: np.ndarray
    angle: float = 0.0
    direction: float | None = None

    def update(self, position: np.ndarray) -> float:
        """Angle since the first call; the particle may turn by less than half a turn between calls."""
        # a right-handed turn about the axis; in the plane the axis points out of it
        second, third = ((1, 2), (2, 0), (0, 1))[self.axis]
        x = position - self.centre[: len(position)]
        direction = float(np.arctan2(x[third], x[second]))
        if self.direction is not None:
            self.angle += (direction - self.direction + np.pi) % (2.0 * np.pi) - np.pi
        self.direction = direction
        return self.angle


class Probes:
    """All probes of a scene; columns are "name.field" with a suffix for each component."""

    def __init__(self, comm, scene, method):
        self.comm, self.scene, self.method = comm, scene, method
        self.observables = Observables(method)
        self.identifiers, self.particles, self.twists, self.columns = {}, {}, {}, []
        self.weights = {}
        table = method.table
        self.extra = scene.method.extra_quantities
        for probe in scene.probes:
            self.columns += probe.columns(method.dimension, scene.method)
            if probe.at is None:
                continue
            place = np.array([probe.at], float)
            identifiers = table.owned_rows("identifier")
            winner, _ = nearest_particles(comm, identifiers, table.owned_rows("reference_position"), place)
            self.identifiers[probe.name] = winner[0]
            for name in probe.fields:
                if name == "twist":
                    centre = np.zeros(3) if probe.centre is None else np.asarray(probe.centre, float)
                    self.twists[probe.name] = Twist("XYZ".index(probe.axis or "Z"), centre)
        self._find()

    def _find(self) -> None:
        """Where on this rank each probe's particle is, if it is here."""
        self.layout = self.method.table.layout
        identifiers = self.method.table.owned_rows("identifier")
        for name, identifier in self.identifiers.items():
            mine = np.flatnonzero(identifiers == identifier)
            self.particles[name] = int(mine[0]) if len(mine) else None
        places = self.method.table.owned_rows("reference_position")
        for probe in self.scene.probes:
            if probe.weight is not None:
                self.weights[probe.name] = probe.weight.evaluate(places)

    def _value(self, name: str, index: int) -> np.ndarray:
        """One particle's value; of a tensor the components in the plane or in space."""
        value = self.observables.field(name, index, index + 1)[0]
        d = self.method.dimension
        return value[:d, :d] if np.ndim(value) == 2 else value

    def sample(self) -> list[float]:
        """Values of all columns; collective."""
        if self.method.table.layout != self.layout:
            self._find()
        sums, extremes = [], []
        for probe in self.scene.probes:
            if probe.weight is not None:
                sums += self._projected(probe)
            elif probe.quantity is None:
                sums += self._at_particle(probe)
            elif probe.quantity in self.extra:
                kind, values = self.method.measure(probe.quantity)
                if kind == "sum":
                    sums += list(np.atleast_1d(values))
                else:
                    extremes += list((1.0 if kind == "minimum" else -1.0) * np.atleast_1d(values))
            elif probe.quantity in ("minimum_jacobian", "maximum_speed"):
                extremes.append(self._extreme(probe.quantity))
            else:
                sums += list(self.observables.totals(probe.quantity))
        total = self.comm.allreduce(np.array(sums, float))
        lowest = minimum(self.comm, np.array(extremes, float))
        return self._in_order(list(total), list(lowest))

    def _at_particle(self, probe) -> list[float]:
        """Values at a probe's particle on its owner's rank, zeros elsewhere."""
        index, values = self.particles[probe.name], []
        if index is None:
            return [0.0] * len(probe.columns(self.method.dimension, self.scene.method))
        for name in probe.fields:
            if name == "twist":
                values.append(self.twists[probe.name].update(self.method.table.owned_rows("position")[index]))
            else:
                values += list(np.ravel(self._value(name, index)).astype(float))
        return values

    def _projected(self, probe) -> list[float]:
        """This rank's sums of V w f for each component, and of V w^2."""
        weight, values, d = self.weights[probe.name], [], self.method.dimension
        measure = weight * self.method.table.owned_rows("volume")
        for name in probe.fields:
            field = self.observables.field(name)
            field = field[:, :d, :d] if field.ndim == 3 else field
            values += list(measure @ field.reshape(len(measure), -1))
        return [*values, float(measure @ weight)]

    def _extreme(self, quantity: str) -> float:
        """The rank's least value (of the negative speed)."""
        if quantity == "minimum_jacobian":
            return float(self.observables.field("jacobian").min(initial=np.inf))
        return -float(np.linalg.norm(self.method.table.owned_rows("velocity"), axis=1).max(initial=0.0))

    def _in_order(self, total: list, lowest: list) -> list[float]:
        result = []
        for probe in self.scene.probes:
            if probe.quantity == "maximum_speed":
                result.append(-lowest.pop(0))
            elif probe.quantity == "minimum_jacobian":
                result.append(lowest.pop(0))
            elif probe.quantity == "centre_of_mass" or probe.weight is not None:
                count = len(probe.columns(self.method.dimension, self.scene.method)) + 1
                moments, total = total[:count], total[count:]
                result += [moment / moments[-1] for moment in moments[:-1]]
            else:
                count = len(probe.columns(self.method.dimension, self.scene.method))
                kind = self.method.measure(probe.quantity)[0] if probe.quantity in self.extra else "sum"
                if kind == "sum":
                    result, total = result + total[:count], total[count:]
                else:
                    sign = 1.0 if kind == "minimum" else -1.0
                    result, lowest = result + [sign * value for value in lowest[:count]], lowest[count:]
        return [float(value) for value in result]

    def state(self) -> dict:
        """What a restart needs: the twists; collective."""
        own = {
            name: (self.twists[name].angle, self.twists[name].direction)
            for name in self.twists
            if self.particles[name] is not None
        }
        return {name: value for piece in self.comm.allgather(own) for name, value in piece.items()}

    def restore(self, state: dict) -> None:
        """Continue the twists of a checkpoint."""
        for name, (angle, direction) in state.items():
            if name in self.twists:
                self.twists[name].angle, self.twists[name].direction = angle, direction
