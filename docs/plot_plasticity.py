"""Flow stresses of copper, and what a step costs in accuracy: `python docs/plot_plasticity.py -o PICTURE`.

Makes the picture of docs/plasticity.md. Left and middle: five flow stresses over plastic strain at 1e4 /s and over its
rate at a strain of 0.3, both at 300 K. Right: the shear stress of runs/point/plastic_shear.toml against 217.1357 MPa.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from parsolid import material
from parsolid.materials.plastic.plastic_evaluation import flow_stress
from parsolid.observables.words import labelled

MODELS = (
    "Johnson-Cook",
    "Zerilli-Armstrong",
    "Steinberg-Cochran-Guinan",
    "Preston-Tonks-Wallace",
    "mechanical threshold",
)
MARKERS = "osD^v"
TEMPERATURE, RATE, STRAIN = 300.0, 1e4, 0.3
# of the shear to 1 at 1000 /s from 294 K, by an independent solution [Pa]
EXACT = 217.1357e6
STEPS = (10, 30, 100, 300, 1000, 3000, 10_000)
MEGA = 1e6


def error(steps: int) -> float:
    """Relative error of the shear stress after so many steps."""
    copper = material("elastic-plastic", library="OFHC copper, Johnson-Cook")
    found = copper.integrate({"kind": "simple-shear", "shear": "1000*t"}, 1e-3, steps, temperature=294.0)
    return abs(float(found["stress_xy"][-1]) / EXACT - 1.0)


def draw() -> Figure:
    """The three panels."""
    figure = Figure(figsize=(13.0, 4.0), dpi=100, layout="constrained")
    over_strain, over_rate, over_steps = figure.subplots(1, 3)
    strains, rates = np.linspace(0.0, 1.0, 201), np.logspace(-4.0, 9.0, 261)
    for number, (name, marker) in enumerate(zip(MODELS, MARKERS)):
        law = material("elastic-plastic", library=f"OFHC copper, {name}").law
        look = {"marker": marker, "markersize": 4, "markevery": (0.02 * number, 0.14), "label": name}
        over_strain.plot(strains, flow_stress(law, strains, RATE, TEMPERATURE) / MEGA, **look)
        over_rate.semilogx(rates, flow_stress(law, STRAIN, rates, TEMPERATURE) / MEGA, **look)
    over_strain.set(xlabel=f"plastic strain (at {RATE:g} /s and {TEMPERATURE:g} K)")
    over_rate.set(xlabel=labelled(f"strain rate (at a strain of {STRAIN:g} and {TEMPERATURE:g} K)", "1/s"))
    for axes in (over_strain, over_rate):
        axes.set_ylabel(labelled("flow stress", "MPa"))
        axes.legend(fontsize=9, frameon=False)
    over_steps.loglog(STEPS, [error(steps) for steps in STEPS], "o-", label="radial return")
    over_steps.set(xlabel="steps of an adiabatic shear to 1", ylabel="relative error of the shear stress")
    over_steps.legend(fontsize=9, frameon=False)
    for axes in (over_strain, over_rate, over_steps):
        axes.grid(alpha=0.25, linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    FigureCanvasAgg(draw()).print_png(parser.parse_args().output, metadata={"Software": None})


if __name__ == "__main__":
    main()
