"""Force, moment and work of the conditions of a peridynamic scene that tell them."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.boundary.loads import Load
from parsolid.boundary.reactions import Told, holders, sliding


class Start(NamedTuple):
    """Displacement, velocity, internal force (owned, d) at the start of a step [m, m/s, N], of whole particles."""

    displacement: np.ndarray
    velocity: np.ndarray
    force: np.ndarray


class Reactions:
    """Of supports, guided surfaces and loads."""

    def __init__(self, comm: Any, body: Any, particle_set: Any):
        """body: `system.Peridynamics`, whose tractions are installed; collective."""
        loads = body.loads
        self.body = body
        self.holders = holders(comm, loads.declared, loads.prescribed, particle_set, body.particles)
        self.loads: list[tuple[Told, list[Load]]] = []
        for one in loads.declared.all:
            if one.where.reports is not None and one.key in loads.loads_of:
                self.loads.append((Told(one, body.dimension), loads.loads_of[one.key]))
        self.slides = sliding(loads.slides, body.dimension)
        self.told = [one for one, _ in (*self.holders, *self.slides, *self.loads)]
        self._start: Start | None = None

    def begin(self) -> None:
        """Keep the state at the start of an explicit step."""
        body = self.body
        force = body.forces.force[:, : body.dimension].copy()
        self._start = Start(body.displacement.copy(), body.velocity.copy(), force)

    def finish(self, time: float, step: float) -> None:
        """Impulses of an explicit step [s] from a time [s]: what comes to internal forces and loads."""
        assert self._start is not None
        body, start, d = self.body, self._start, self.body.dimension
        share, now = body.share[:, None], body.velocity
        mass, change = share * body.mass[:, None], body.displacement - start.displacement
        acting = 0.5 * share * (start.force + body.forces.force[:, :d])
        acting = acting + 0.5 * (body.loads.external(time) + body.loads.external(time + step, True))
        places = body.particles.owned_rows("position")
        impulse = mass * (now - start.velocity) - step * acting
        work = 0.5 * mass * (now**2 - start.velocity**2) - acting * change
        for told, held in self.holders:
            rows, components = held()
            told.take(places[rows], components * impulse[rows], float(np.sum(components * work[rows])))
        for told, slide in self.slides:
            told.take(places[slide.rows], slide.held(impulse[slide.rows]), 0.0)
        for told, loads in self.loads:
            first, last = self._values(loads, time, False), self._values(loads, time + step, True)
            middle = change / step
            done = 0.25 * step * (first * (start.velocity + middle) + last * (middle + now))
            done = np.where(body.loads.free, done, 0.5 * (first + last) * change)
            told.take(places, 0.5 * step * (first + last), float(done.sum()))

    def balance(self, start: Any, loads: tuple[np.ndarray, np.ndarray], time: float, step: float) -> None:
        """Forces at the end of a quasi-static step [s] from a time [s] and its work; start: `tangent.Settled`; loads
        (owned, d) [N]: all of them at its start and end."""
        body, (before, after) = self.body, loads
        change, force = body.displacement - start.displacement, body.operator.settled_force()
        places = body.particles.owned_rows("reference_position") + body.displacement
        work = -0.5 * (start.force + force + before + after) * change
        for told, held in self.holders:
            rows, components = held()
            needed = np.where(components, -(force[rows] + after[rows]), 0.0)
            told.set(places[rows], needed, float(np.sum(components * work[rows])))
        for told, parts in self.loads:
            first, last = self._values(parts, time, step == 0.0), self._values(parts, time + step, step > 0.0)
            if time == step == 0.0:
                # what held the bodies' start lets go as the first loads come
                first[:] = 0.0
            told.set(places, last, float(np.sum(0.5 * (first + last) * change)))

    def _values(self, loads: list[Load], time: float, before: bool) -> np.ndarray:
        """Forces (owned, d) [N] of some loads at a time [s], of a jump just after, or just before it."""
        result = np.zeros((self.body.owned, self.body.dimension))
        for load in loads:
            load.put(result, time, before)
        return result


def reactions_of(comm: Any, body: Any, particle_set: Any) -> Reactions | None:
    """Those of the scene, None where no condition asks for any; collective."""
    asked = any(one.where.reports is not None for one in body.loads.declared.all)
    return Reactions(comm, body, particle_set) if asked else None
