"""What steps do to the energy of particles between which contact or tools act, as the ledger has it."""

from typing import Any

import numpy as np

from parsolid.contact.list_kernels import given_by_closing, oscillation
from parsolid.methods.protocol import EnergyLedger, ParticleSystem


def book_swings(
    ledger: EnergyLedger, system: ParticleSystem, rows: np.ndarray, step: float, forces: np.ndarray, *of_rows: Any
) -> None:
    """Leapfrog's swings of rows (k,) of a system, or what impulses give to one of stages or of several own steps.

    of_rows: which components are held (k, d), or None, and place and velocity at the start (k, 2 d); others as in
    `list_kernels.oscillation`.
    """
    owned = system.particles.owned_rows
    arrays = system.mass, system.share, *of_rows, owned("velocity"), owned("position")
    if system.substeps > 1:
        # impulses work by velocities at both ends of all steps, forces along their way: what stays in a system's waves
        ledger.add(1.0, 0.0, -float(oscillation(rows, step, False, forces, *arrays)), 0.0)
    elif system.verlet == "stages":
        ledger.add(1.0, 0.0, -float(given_by_closing(rows, step, forces, *arrays)), 0.0)
    else:
        swing = oscillation(rows, step, system.verlet == "all", forces, *arrays)
        ledger.add_term("contact_oscillation", float(swing))
