"""Measures of runs: costs, energy drift and dissipation, momentum drift, and values that are not finite."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from parsolid.campaign.records import History, Record, read_files
from parsolid.scene.observation import stored_energy

# name -> (heading in a table, format, description)
MEASURES = {
    "particles": ("particles", ",d", "particles"),
    "steps": ("steps", ",d", "time steps"),
    "particle_steps": ("particle-steps", ".3g", "particles times steps"),
    "iterations_per_step": ("iterations a step", ".1f", "force evaluations of a quasi-static step, on average"),
    "core_seconds": ("core-s", ".3g", "wall seconds of the time loop times ranks, fastest repetition, kernels loaded"),
    "processor_seconds": ("CPU s", ".3g", "processor seconds of the time loop, all ranks, fastest repetition"),
    "wall_seconds": ("wall s", ".3g", "wall time of the run with set-up and output [s]"),
    "particle_steps_per_core_second": ("particle-steps / core-s", ".3g", "speed"),
    "mean_step": ("mean dt [s]", ".3g", "simulated time over steps [s]"),
    "smallest_step": ("least dt [s]", ".3g", "smallest step at a row of the history [s]"),
    "peak_memory_bytes_per_rank": ("MiB a rank", ".0f", "largest memory of a rank [B]"),
    "energy_drift": ("energy drift", ".1e", "largest |energy error| over the largest energy"),
    "numerical_dissipation": ("D_num/E0", ".3g", "numerical dissipation at the end over the energy at the start"),
    "material_dissipation": ("D_int/E0", ".3g", "dissipation of the material at the end over the energy at the start"),
    "largest_fall": ("largest fall of D/E0", ".1e", "largest decrease of a dissipation between two rows, over E0"),
    "momentum_drift": ("momentum drift", ".1e", "largest change of a probed linear momentum over its largest size"),
    "smallest_jacobian": ("least J", ".3g", "smallest Jacobian of all probes"),
}
# a momentum below this share of sqrt(2 m K) is rounding
_MOMENTUM_ROUNDING = 1e-9


def measures_of(record: Record) -> dict[str, Any]:
    """Measures of a run by name, with its errors under "errors"; empty without a summary.

    A failed run has the measures that its files give.
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


def energies_of(history: History) -> dict[str, Any]:
    """Energy drift, dissipations over the energy at the start, and smallest step of a history with columns (n,) [J]."""
    if not len(history.get("time", ())):
        return {}
    energy = np.abs([history[name] for name in ("kinetic", stored_energy(history), "external_work")])
    largest, start = energy.max(), energy[:, 0].sum()
    # a body at rest has no energy at the start
    scale = start or largest
    falls = [np.max(-np.diff(history[name]), initial=0.0) for name in ("material_dissipation", "numerical_dissipation")]
    steps = history["dt"][history["step"] > 0]
    measures = {
        "smallest_step": float(steps.min()) if len(steps) else None,
        "energy_drift": _ratio(np.abs(history["energy_error"]).max(), largest),
        "numerical_dissipation": _ratio(history["numerical_dissipation"][-1], scale),
        "material_dissipation": _ratio(history["material_dissipation"][-1], scale),
        "largest_fall": _ratio(max(falls), scale),
    }
    jacobians = [values.min() for name, values in history.items() if name.endswith(".minimum_jacobian")]
    if jacobians:
        measures["smallest_jacobian"] = float(min(jacobians))
    return measures


def momentum_of(history: History, mass: float | None = None) -> dict[str, Any]:
    """Drift of the probed linear momentum over its largest size; empty without such a probe.

    Where the momentum is zero but for rounding, the drift is over sqrt(2 m K) with the largest kinetic energy K and the
    mass m [kg].
    """
    names = [name for name in history if ".linear_momentum_" in name]
    if not names or not len(history.get("time", ())):
        return {}
    momentum = np.stack([history[name] for name in names], axis=1)
    drift = np.abs(momentum - momentum[0]).max()
    largest = float(np.abs(momentum).max())
    possible = float(np.sqrt(2.0 * max(mass or 0.0, 0.0) * history["kinetic"].max())) if "kinetic" in history else 0.0
    return {"momentum_drift": _ratio(drift, largest if largest > _MOMENTUM_ROUNDING * possible else possible)}


def _ratio(value: float, scale: float) -> float | None:
    return float(value / scale) if scale > 0.0 else None


def not_finite(folder: Path) -> list[str]:
    """Columns and data sets of a run's files that hold nan or infinity, as "file: name".

    Columns of a crack tip are left out: they are nan before there is a crack.
    """
    columns = {name: values for name, values in read_files(folder)[1].items() if ".crack_tip_" not in name}
    faults = [f"history.csv: {name}" for name, values in columns.items() if not np.isfinite(values).all()]
    for path in sorted(folder.glob("*.vtkhdf")) + sorted(folder.glob("checkpoint*.h5")):
        with h5py.File(path) as file:

            def look(name: Any, item: Any, path: Path = path) -> None:
                if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" and not np.isfinite(item[()]).all():
                    faults.append(f"{path.name}: {name}")

            file.visititems(look)
    return faults
