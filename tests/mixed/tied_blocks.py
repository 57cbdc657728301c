"""Two blocks of different methods side by side, tied, and the motion of all their particles."""

from mixed.bodies_apart import COPPER, RUBBER

METHODS = {
    "sph": {"kind": "tlsph"},
    "bonds": {"kind": "peridynamics", "horizon_ratio": 2.0},
    "points": {"kind": "mpm", "cell": 0.25},
    "flow": {"kind": "ulsph"},
}
STIFFNESS = 4.0


def blocks(first: str, second: str, **rest) -> dict:
    """Raw tables of a block beside a taller and coarser one, both in a motion that strains the face."""
    bodies = []
    for number, name in enumerate((first, second)):
        h = (0.125, 0.15625)[number]
        nodes, lower = name == "sph", [float(number), 0.0]
        box = {"lower": lower, "upper": [lower[0] + 8 * h, 8 * h]}
        body = {"name": "ab"[number], "shape": {"box": box}, "particles": [8 + nodes, 8 + nodes], "method": name}
        body |= {"placement": "vertices" if nodes else "cells", "material": COPPER if name == "flow" else RUBBER}
        bodies.append(body | {"velocity": ["20*X*Y", "-5*X + 10*Y*Y"]})
    methods = [{"name": name} | METHODS[name] for name in dict.fromkeys((first, second))]
    data = {"dimension": 2, "end_time": 0.05, "methods": methods, "bodies": bodies}
    return data | {"tie": [{"bodies": ["a", "b"], "stiffness": STIFFNESS}]} | rest
