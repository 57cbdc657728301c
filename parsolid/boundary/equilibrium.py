"""Forces and works of the conditions of a scene in a step from one equilibrium to the next."""

from typing import Any

import numpy as np

from parsolid.boundary.reactions import Reaction


def report_equilibrium(
    conditions: Any,
    places: np.ndarray,
    change: np.ndarray,
    reaction: np.ndarray,
    work: np.ndarray,
    time: float,
    step: float,
) -> None:
    """Let the reactions of `Conditions` take their forces at the end of a step [s] from a time [s], and their works.

    places (d, n) [m]: of the particles at its end; change (n, d) [m]: of their displacement; reaction (n, d) [N]: what
    holds components that do not follow forces, at the end; work (n, d) [J]: what that has done.
    """
    for holder in conditions.holders:
        rows, components = holder.find()
        needed = np.where(components, reaction[rows], 0.0)
        holder.reaction.set(places[:, rows], needed.T, float(np.sum(components * work[rows])))
    of_loads: dict[Reaction, np.ndarray] = {}
    for load, reported_by in conditions.loads_of:
        if reported_by is not None:
            ends = of_loads.setdefault(reported_by, np.zeros((2, *places.shape)))
            for end, (moment, before_jump) in zip(ends, ((time, step == 0.0), (time + step, step > 0.0))):
                rows, values = load.forces(moment, before_jump)
                end[: len(values), rows] += values
    for reported_by, (first, last) in of_loads.items():
        if time == step == 0.0:
            # what held the bodies' start lets go as the first loads come
            first[:] = 0.0
        reported_by.set(places, last, float(np.sum(0.5 * (first + last) * change.T)))
