"""The picture of a material point: deformation, stress, loop, energies, internal variables and wave speeds."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from parsolid.output.errors import OutputError, words
from parsolid.output.words import labelled, words_of
from parsolid.scene.probes import component_names


def draw(path: Path, title: str, columns: dict[str, np.ndarray]) -> None:
    """Draw columns of point.csv into a PNG file; needs no display. Raises OutputError."""
    figure = Figure(figsize=(13.0, 7.5), layout="constrained")
    panels = figure.subplots(2, 3)
    figure.suptitle(title or "material point")
    _components(panels[0, 0], columns, "deformation_gradient", "deformation gradient")
    _components(panels[0, 1], columns, "stress", "Cauchy stress [Pa]")
    for name, style in (("von_mises_stress", "k--"), ("flow_stress", "k:")):
        if name in columns:
            panels[0, 1].plot(columns["time"], columns[name], style, linewidth=1.0, label=words_of(name))
    panels[0, 1].legend(fontsize=7)
    # stress over deformation, for the component of F that moves most
    panel = panels[0, 2]
    names = component_names("deformation_gradient", 3)
    moved = max(names, key=lambda name: np.ptp(columns[name]))
    stress = moved.replace("deformation_gradient", "first_piola_kirchhoff_stress")
    panel.plot(columns[moved], columns[stress], linewidth=1.2)
    panel.set_xlabel(words_of(moved))
    panel.set_ylabel(labelled(words_of(stress), "Pa"))
    _series(panels[1, 0], columns, "energy density [J/m$^3$]", ("work", "strain_energy", "dissipation", "equilibrium"))
    _branches(panels[1, 1], columns)
    _waves(panels[1, 2], columns)
    try:
        figure.savefig(path)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {words(error)}") from error


def _series(panel: Any, columns: dict[str, Any], label: str, names: Iterable[str], labels: Any = None) -> None:
    for name, text in zip(names, labels or names):
        if name in columns:
            panel.plot(columns["time"], columns[name], label=words_of(text), linewidth=1.2)
    panel.set_xlabel("time [s]")
    panel.set_ylabel(label)
    panel.legend(fontsize=7)


def _components(panel: Any, columns: dict[str, Any], field: str, label: str) -> None:
    """The components that are more than rounding, and not another's by symmetry."""
    names = component_names(field, 3)
    largest = max(np.abs(columns[name]).max() for name in names)
    shown = [name for name in names if np.abs(columns[name]).max() > 1e-9 * largest]
    if field == "stress":
        shown = [name for name in shown if name[-2] <= name[-1]]
    _series(panel, columns, label, shown, [name[-2:] for name in shown])


def _waves(panel: Any, columns: dict[str, Any]) -> None:
    """Wave speeds: greatest over all directions in black, along each direction in a colour of its own."""
    for name, values in columns.items():
        if name.endswith("wave_speed"):
            where, _, kind = name.rpartition(".")
            style = {"color": f"C{int(where.rpartition('_')[2]) - 1}"} if where else {"color": "k", "linestyle": "--"}
            first = "pressure" in kind or not where
            label = (where or kind).replace("_", " ") if first else None
            panel.plot(columns["time"], values, linewidth=1.2, label=label, **style)
    panel.set_xlabel("time [s]")
    panel.set_ylabel("wave speed [m/s]")
    panel.legend(fontsize=7)


def _branches(panel: Any, columns: dict[str, Any]) -> None:
    """Internal variables of the branches, temperature over plastic strain, or von Mises stress and pressure."""
    if "temperature" in columns:
        panel.plot(columns["plastic_strain"], columns["temperature"], linewidth=1.2)
        panel.set_xlabel("equivalent plastic strain")
        panel.set_ylabel("temperature [K]")
        return
    names = [name for name in columns if (".A_" in name or ".strain_" in name) and np.ptp(columns[name]) > 1e-9]
    if not names:
        _series(panel, columns, "stress [Pa]", ("von_mises_stress", "pressure"))
        return
    _series(panel, columns, "internal variables", names[:18], [name.replace(".", ", ") for name in names])
