"""python docs/make_notebook.py: write docs/from_python.ipynb, executed, without paths of this machine in its outputs.

Needs nbformat, nbclient, ipykernel and the extras plot and notebook.
"""

import os
import re
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).resolve().parent
CELLS = (
    (
        "# parsolid in a notebook\n\nA rubber block is pushed down on its base; what the run leaves is looked at, then "
        "the same scene is advanced by hand. [python.md](python.md) explains the names."
    ),
    """
import matplotlib.pyplot as plt
import numpy as np
import parsolid

scene = {
    "title": "A block that is pushed",
    "dimension": 2,
    "end_time": 8e-3,
    "method": {"kind": "tlsph"},
    "bodies": [
        {
            "shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}},
            "particles": [17, 17],
            "velocity": ["0", "-20*Y"],
            "material": {"kind": "neo-hookean", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.4},
        }
    ],
    "boundaries": [{"kind": "fixed", "plane": "Y = 0"}],
    "probes": [{"name": "corner", "at": [1.0, 1.0], "fields": ["displacement"]}],
    "output": {"fields": ["displacement", "stress", "pressure"], "fields_interval": 1e-3, "pictures": False},
}
results = parsolid.run(scene, output="results/pushed")
{name: results.summary[name] for name in ("status", "steps", "energy_error_share", "energy_check")}
""",
    "The history is a table over time; energies and a probe:",
    'results.history[["kinetic", "strain_energy", "energy_error", "corner.displacement_y"]].iloc[::8].round(4)',
    """
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3))
results.plot("kinetic", "strain_energy", "external_work", axes=left)
results.plot("corner.displacement_y", axes=right);
""",
    "Fields are numpy arrays, read when they are asked for:",
    """
now = results.fields[4e-3]
position, pressure = now["position"], now["pressure"]
picture = plt.scatter(position[:, 0], position[:, 1], c=pressure / 1e6, cmap="RdBu_r", vmin=-3, vmax=3)
plt.colorbar(picture, label="pressure [MPa]")
plt.gca().set(aspect="equal", title=f"t = {1e3 * now.time:g} ms");
""",
    "Step by step, with the arrays of the state at hand. Here a brake takes 1 % of the velocity in each step:",
    """
simulation = parsolid.Simulation(scene)
heights = []

@simulation.on_step
def brake(simulation):
    for velocity in simulation.arrays("velocity"):
        velocity *= 0.99
    heights.append((simulation.time, simulation.field("position")[:, 1].max()))

simulation.run(2e-3)
braked, free = np.array(heights), results.columns
plt.plot(1e3 * braked[:, 0], braked[:, 1] - 1, label="braked")
shown = free["time"] <= 2e-3
plt.plot(1e3 * free["time"][shown], free["corner.displacement_y"][shown], label="free, corner")
plt.legend(); plt.xlabel("time [ms]"); plt.ylabel("highest particle, change [m]");
""",
    "A material alone, on arrays of deformation gradients:",
    """
rubber = parsolid.material("neo-hookean", density=1100.0, youngs_modulus=17e6, poissons_ratio=0.4)
stretch = np.linspace(0.6, 2.0, 50)
F = np.eye(3) + (stretch - 1)[:, None, None] * np.diag([1.0, 0.0, 0.0])
plt.plot(stretch, rubber.stress(F)[:, 0, 0] / 1e6)
plt.xlabel("stretch"); plt.ylabel("nominal stress [MPa]"); plt.grid(alpha=0.3);
""",
)


def main() -> None:
    """Make, execute, clean and write the notebook."""
    made = nbformat.v4.new_notebook()
    texts = (0, 2, 5, 7, 9)
    for number, cell in enumerate(CELLS):
        new = nbformat.v4.new_markdown_cell if number in texts else nbformat.v4.new_code_cell
        made.cells.append(new(cell.strip(), id=f"cell-{number}"))
    made.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(made, timeout=300, resources={"metadata": {"path": folder}})
        client.execute()
    for cell in made.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            output.get("metadata", {}).clear()
    made.metadata.pop("language_info", None)
    text = nbformat.writes(made)
    for path in (tempfile.gettempdir(), str(HERE.parent), str(Path.home()), sys.prefix, os.getcwd()):
        if re.search(rf'"[^"]*{re.escape(path)}/', text):
            raise SystemExit(f"a path of this machine is in the notebook: {path}")
    (HERE / "from_python.ipynb").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
