"""Energy that the stages of SSP-RK3 take by themselves, from their rates alone.

For any rates k_i of stages and any quadratic form S, with the table's a_ij and b_i (Hairer, Lubich, Wanner, IV.2)

    S(y', y') - S(y, y) = 2 step sum b_i S(Y_i, k_i) - step^2 sum m_ij S(k_i, k_j)
    m_ij = b_i a_ij + b_j a_ji - b_i b_j

The ledger has the first sum: powers of stages with their weights. So kinetic energy lacks step^2/2 sum m_ij f_i . f_j/m
exactly, whatever forces do, and stored energy step^2/2 sum m_ij dF_i : C : dF_j, in which C : dF are differences of the
stages' P. That has the cofactor's part of a stress that the law balances in the undeformed state, which the evolved J
does not have: 1 to 4 % of what stages take stays in the balance. With d = k_2 - k_1 and
e = k_3 - (k_1 + k_2)/2 that is -step^2/2 (2/3 k_1 . e + d . d/12 + d . e/3 + 4/9 e . e), and of a wave of the frequency
w the part (w step)^4/12 - (w step)^6/36 of its energy. Neither energies nor works are in it, so that the balance goes
on telling where forces and energies do not agree.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.numerics.layout import GRADIENT_ROWS
from parsolid.particles.declaration import Columns, Field, Rows

STRESSES = ("first_stage_rate", "first_stage_stress", "second_stage_stress")


class StageStresses(NamedTuple):
    """The velocity gradient of the first stage, and P of the first two, (5 or 10, capacity), the last row of no use."""

    rate: np.ndarray
    first: np.ndarray
    second: np.ndarray


def tell_stage_losses(system: Any, scene: Any) -> None:
    """Have what stages take told, where bodies meet, beside what contact's impulses bring.

    system: `system.TotalLagrangianSPH`, to whose particles fields of stages are added then.
    """
    system.losses_told = system.staged and system.settings.tells_of_steps(scene)
    if not system.losses_told:
        return
    system.boundaries.declare_free()
    system.particles.declare(Field("first_stage_acceleration", 4, "m/s^2", layout=Rows(), carried=False))
    for name in STRESSES:
        rows = GRADIENT_ROWS[system.dimension]
        system.particles.declare(Field(name, rows, "", layout=Columns(), carried=False))


def stage_accelerations(system: Any) -> tuple[np.ndarray | None, np.ndarray]:
    """Multipliers (n, 4), 0 for components that are not free, or None; where accelerations (n, 4) are kept."""
    return system.boundaries.free, system.particles.storage("first_stage_acceleration")
