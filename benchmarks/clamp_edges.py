"""python benchmarks/clamp_edges.py: the default of `method.clamp_edges` by Poisson's ratio.

A bar in plane strain, three widths long and clamped at one end, is pulled in equilibrium. The part of their stress
energy that nodes on the edges of the clamp do without is sought for which lattices of 16 and 32 nodes across have the
same end displacement, so that the singular stress at the edges leaves no error of the leading order.
"""

import tempfile

import numpy as np

import parsolid

RATIOS = (0.0, 0.15, 0.25, 0.3, 0.35, 0.4, 0.45, 0.48, 0.49)
PARTS = np.array([0.0, 0.2, 0.4, 0.6, 0.75, 0.88])


def displacement(across: int, poissons_ratio: float, part: float, weights: str) -> float:
    """Of a corner of the free end along the bar [m]."""
    material = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e7, "poissons_ratio": poissons_ratio}
    scene = {
        "dimension": 2,
        "end_time": 1.0,
        "method": {"kind": "tlsph", "integrator": "static", "weights": weights, "clamp_edges": part},
        "bodies": [
            {
                "shape": {"box": {"lower": [-0.5, 0.0], "upper": [0.5, 3.0]}},
                "particles": [across, 3 * across - 2],
                "material": material,
            }
        ],
        "boundaries": [
            {"kind": "fixed", "plane": "Y = 0"},
            {"kind": "traction", "plane": "Y = 3", "traction": ["0", "1"]},
        ],
        "probes": [{"name": "tip", "at": [0.5, 3.0], "fields": ["displacement"]}],
        "output": {"fields_times": [], "pictures": False},
    }
    with tempfile.TemporaryDirectory() as folder:
        return float(parsolid.run(scene, output=f"{folder}/results").history["tip.displacement_y"].iloc[-1])


if __name__ == "__main__":
    for kind in ("fourth-order", "cells"):
        for ratio in RATIOS:
            coarse, fine = (np.array([displacement(m, ratio, part, kind) for part in PARTS]) for m in (16, 32))
            roots = np.roots(np.polyfit(PARTS, coarse / fine - 1.0, 3))
            found = [root.real for root in roots if abs(root.imag) < 1e-9 and -0.2 < root.real < 1.0]
            print(f"{kind:12}  nu {ratio:<5g}  {' '.join(f'{value:.3f}' for value in found)}", flush=True)
