"""What a run says of itself: cost, steps, energies, momentum."""

from typing import Any

import numpy as np

from parsolid.campaign.runner import Record
from parsolid.scene.observation import stored_energy

# name -> (heading in a table, format, what it is)
MEASURES = {
    "particles": ("particles", ",d", "particles"),
    "steps": ("steps", ",d", "time steps"),
    "particle_steps": ("particle-steps", ".3g", "particles times steps"),
    "iterations_per_step": ("iterations a step", ".1f", "force evaluations of a quasi-static step, on average"),
    "core_seconds": ("core-s", ".3g", "seconds of the time loop times ranks, kernels being loaded, at the least"),
    "processor_seconds": ("CPU s", ".3g", "seconds of all ranks' processors in the time loop, at the least"),
    "wall_seconds": ("wall s", ".3g", "wall time of the run with set-up and output [s]"),
    "particle_steps_per_core_second": ("particle-steps / core-s", ".3g", "speed"),
    "mean_step": ("mean dt [s]", ".3g", "simulated time over steps [s]"),
    "smallest_step": ("least dt [s]", ".3g", "smallest step at a row of the history [s]"),
    "peak_memory_bytes_per_rank": ("MiB a rank", ".0f", "most memory a rank had [B]"),
    "energy_drift": ("energy drift", ".1e", "largest |energy error| over the largest energy"),
    "numerical_dissipation": ("D_num/E0", ".3g", "numerical dissipation at the end over the energy at the start"),
    "material_dissipation": ("D_int/E0", ".3g", "dissipation of the material at the end over the energy at the start"),
    "largest_fall": (
        "largest fall of D/E0",
        ".1e",
        "most that a dissipation fell between rows of the history, over E0",
    ),
    "momentum_drift": ("momentum drift", ".1e", "largest change of a probed linear momentum over its largest size"),
    "smallest_jacobian": ("least J", ".3g", "smallest Jacobian that a probe saw"),
}


# of the momentum that all mass has with its kinetic energy: what is less is none
_NONE = 1e-9


def measures_of(record: Record) -> dict[str, Any]:
    """Measures and errors (under "errors") of a run; empty where there is no summary. A failed run has those that its
    files give.
    """
    summary = record.summary
    if not summary or not record.loop_seconds:
        return {}
    steps, particles, core_seconds = record.steps, record.particles, record.core_seconds
    measures = {
        "particles": particles,
        "steps": steps,
        "particle_steps": particles * steps,
        "iterations_per_step": summary.get("iterations_per_step"),
        "core_seconds": core_seconds,
        "processor_seconds": record.seconds,
        "wall_seconds": summary["wall_seconds"],
        "particle_steps_per_core_second": particles * steps / core_seconds if core_seconds else None,
        "mean_step": summary["end_time"] / steps if steps else None,
        "peak_memory_bytes_per_rank": summary["peak_memory_bytes_per_rank"],
        "errors": summary["errors"],
    }
    return measures | energies_of(record.history) | momentum_of(record.history, summary.get("mass"))


def energies_of(history: dict[str, np.ndarray]) -> dict[str, Any]:
    """What the ledger's columns (rows,) [J] say: drift, dissipations over the energy at the start, and their falls."""
    if not len(history.get("time", ())):
        return {}
    energy = np.abs([history[name] for name in ("kinetic", stored_energy(history), "external_work")])
    largest, start = energy.max(), energy[:, 0].sum()
    # a body at rest at the start has the largest energy for a scale
    scale = start or largest
    falls = [np.max(-np.diff(history[name]), initial=0.0) for name in ("material_dissipation", "numerical_dissipation")]
    steps = history["dt"][history["step"] > 0]
    result = {
        "smallest_step": float(steps.min()) if len(steps) else None,
        "energy_drift": _over(np.abs(history["energy_error"]).max(), largest),
        "numerical_dissipation": _over(history["numerical_dissipation"][-1], scale),
        "material_dissipation": _over(history["material_dissipation"][-1], scale),
        "largest_fall": _over(max(falls), scale),
    }
    jacobians = [values.min() for name, values in history.items() if name.endswith(".minimum_jacobian")]
    return result | ({"smallest_jacobian": float(min(jacobians))} if jacobians else {})


def momentum_of(history: dict[str, np.ndarray], mass: float | None = None) -> dict[str, Any]:
    """Drift of the probed linear momentum; empty without such a probe.

    Over its largest size or, where momentum is zero but for rounding, over that of the mass [kg] with the largest
    kinetic energy.
    """
    names = [name for name in history if ".linear_momentum_" in name]
    if not names or not len(history.get("time", ())):
        return {}
    momentum = np.stack([history[name] for name in names], axis=1)
    drift = np.abs(momentum - momentum[0]).max()
    largest = float(np.abs(momentum).max())
    possible = float(np.sqrt(2.0 * max(mass or 0.0, 0.0) * history["kinetic"].max())) if "kinetic" in history else 0.0
    return {"momentum_drift": _over(drift, largest if largest > _NONE * possible else possible)}


def _over(value: float, scale: float) -> float | None:
    return float(value / scale) if scale > 0.0 else None
