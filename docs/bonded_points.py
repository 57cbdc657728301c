"""Why bonded blocks of material points are out of balance when they hit: python docs/bonded_points.py.

Two blocks of copper close at 3 km/s on one grid. Told are the largest imbalance over the largest energy as it is; with
kinetic energies of the time of places (velocities are half a step behind); with heat of the artificial viscosity that
is the work of its forces; with what particles gain beyond the work of the stresses along the ways of matter, which the
scheme gives; and that at the end.
"""

from typing import Any

import numpy as np
from contact_extremes import copper
from contact_tables import Tables, run, scene

from parsolid.methods.mpm.external_forces import power, power_at_end
from parsolid.methods.mpm.system import MaterialPoint

_ADVANCE = MaterialPoint.advance_stress


class Works:
    """Work [J] of the stresses in all steps along the ways before and after them, and what of it velocities lack."""

    def __init__(self) -> None:
        self.done = self.behind = 0.0

    def advance(self, update: MaterialPoint, step: float) -> Any:
        """In place of that of the update, around it."""
        storage, owned = update.points.storage, update.points.owned
        arrays = storage("stress_and_volume"), storage("velocity_gradient")
        if step > 0.0:
            self.done -= 0.5 * step * power(owned, *arrays)
        result = _ADVANCE(update, step)
        if step > 0.0:
            self.behind = -0.5 * step * power_at_end(owned, *arrays, step)
            self.done += self.behind
        return result


def _centred(advance: Any) -> Any:
    """That of a solid, with heat of the viscosity as in scenes with contact."""
    return lambda block, step, _: advance(block, step, True)


def bonded(cfl: float, centred: bool) -> tuple[Any, Tables]:
    """The run, with its works; centred: heat of the viscosity as in scenes with contact."""
    works = Works()

    def advance(update: MaterialPoint, step: float) -> Any:
        if centred and works.done == 0.0:
            for solid in update.solids.values():
                solid.advance = _centred(solid.advance)
        return works.advance(update, step)

    MaterialPoint.advance_stress = advance  # type: ignore[method-assign]
    method = {"kind": "mpm", "cell": 2e-3, "order": "musl", "cfl": cfl}
    tables = scene(copper(3000.0), 4e-6, method=method) | {"contact": []}
    result = run(tables, lambda _: {"done": works.done, "behind": works.behind})
    MaterialPoint.advance_stress = _ADVANCE  # type: ignore[method-assign]
    return result


def main() -> None:
    """A line for each step length."""
    for cfl in (0.3, 0.1, 0.05):
        told = []
        for centred in (False, True):
            simulation, columns = bonded(cfl, centred)
            lost = columns["done"] - columns["behind"] - (columns["kinetic"] - columns["kinetic"][0])
            off = [columns["energy_error"], columns["energy_error"] + columns["behind"]]
            off.append(off[1] + lost)
            told += [np.abs(one).max() / simulation.energy_check.largest for one in off]
        given = -lost[-1] / simulation.energy_check.largest
        print(
            f"cfl {cfl}: {told[0]:.1e}; at the time of places {told[1]:.1e}; heat of forces, too, {told[4]:.1e}; and "
            f"what the scheme gives {told[5]:.1e}, which is {given:.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
