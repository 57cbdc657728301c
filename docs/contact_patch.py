"""Two blocks pressed by 1 % between rollers, each of any method: python docs/contact_patch.py mpm mpm, tlsph mpm, and
so on, the methods of the lower and of the upper block, with words such as 1:1.3 for some of the cases, and of a method
(mpm.basis=ugimp); spacings=24: of the lower block's side, 12 unless said.

Told is the mean stress across the face over the contact's pressure in the layers of particles from the face on, of the
lower block and of the upper one, and in brackets its spread along the face; see contact.md.
"""

import sys
from typing import Any

import numpy as np
from contact_tables import MODULUS, SPEED, Tables, block, material, run
from hertz_in_plane import HELD, METHODS, of_method, stated

from parsolid.scene.observation import stored_energy

RAMP, END = 40.0, 48.0
# spacing of the upper block over that of the lower one, and its modulus and density over those
CASES = {"1:1": (1.0, 1.0), "1:1.3": (4 / 3, 1.0), "1:2": (2.0, 1.0), "x100": (1.0, 100.0)}


def tables(kinds: list[str], ratio: float, stiffer: float, words: dict[str, Any]) -> Tables:
    """The scene, with a grid for each block of material points."""
    spacing = 1.0 / words.get("spacings", 12.0)
    x = f"(t/{RAMP / SPEED})"
    rate = f"{0.02 * SPEED / RAMP}*30*{x}**2*(1 - {x})**2*where({x} < 1, 1, 0)"
    bodies, methods = [], []
    places = (("low", -1.0, spacing, 1.0), ("top", 0.0, spacing * ratio, stiffer))
    for kind, (name, lower, h, factor) in zip(kinds, places):
        law = "linear-elastic" if kind == "peridynamics" else "neo-hookean"
        solid = material(factor, factor, law)
        bodies.append(block(name, [0.0, lower], [1.0, lower + 1.0], h, "cells", material=solid, method=name))
        grid = {"cell": 2.0 * h} if kind == "mpm" else {}
        methods.append({"name": name, "balance_limit": 10.0, "balance_warning": 9.0} | METHODS[kind] | grid)
        methods[-1] |= of_method(kind, words)
    depth = HELD[kinds[1]] * spacing * ratio
    driven = {"kind": "velocity", "box": {"lower": [-1, 1 - depth], "upper": [2, 2]}, "body": "top"}
    sides: list[Tables] = [{"plane": plane, "kind": "roller"} for plane in ("X = 0", "X = 1")]
    sides += [{"plane": "Y = -1", "kind": "roller", "body": "low"}, driven | {"velocity": ["free", f"-{rate}"]}]
    output = {"fields_times": []}
    return {
        "dimension": 2,
        "end_time": END / SPEED,
        "methods": methods,
        "bodies": bodies,
        "boundaries": sides,
        "contact": [{"bodies": ["low", "top"]}],
        "output": output,
    }


class Layers:
    """Stress across the face of each particle and the contact's pressure, averaged over the rest at the end."""

    def __init__(self) -> None:
        self.stress: list[Any] = [0.0, 0.0]
        self.pressure, self.count = 0.0, 0

    def __call__(self, simulation: Any) -> Tables:
        """A row."""
        if simulation.clock.time * SPEED > RAMP + 2.0:
            self.count += 1
            for number, system in enumerate(simulation.systems):
                name = "first_piola_kirchhoff_stress" if system.settings.kind == "tlsph" else "stress"
                stress = system.shown(name, 0, system.owned)
                self.stress[number] = self.stress[number] + stress[:, 1, 1]
            low = simulation.systems[0].particles.owned_rows("contact_force")
            self.pressure -= float(low[:, 1].sum())
        return {}


def told(simulation: Any, found: Layers) -> str:
    """Of both blocks' first layers."""
    result, p = [f"pressure {found.pressure / found.count / MODULUS:.4f} M"], found.pressure
    for system, stress in zip(simulation.systems, found.stress):
        y = np.abs(system.particles.owned_rows("reference_position")[:, 1])
        layers = []
        for layer in np.unique(np.round(y, 9))[:4]:
            here = -stress[np.abs(y - layer) < 1e-6] / p
            layers.append(f"{here.mean():.2f}" + (f" ({here.std():.3f})" if here.std() > 5e-4 else ""))
        far = -stress[np.abs(y - 0.5) < 0.2].mean() / p
        result.append(f"{', '.join(layers)}, far {far:.3f}")
    return "; ".join(result)


def main() -> None:
    """A line for each case."""
    words, _ = stated([word for word in sys.argv[3:] if "=" in word])
    for case in [word for word in sys.argv[3:] if word in CASES] or CASES:
        found = Layers()
        simulation, columns = run(tables(sys.argv[1:3], *CASES[case], words), found)
        off = np.abs(columns["energy_error"]).max() / columns[stored_energy(columns)].max()
        print(
            f"{' under '.join(sys.argv[1:3])} {words or ''}, {case}: {told(simulation, found)}; balance {off:.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
