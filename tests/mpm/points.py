"""Small scenes of the material point method for the tests."""

import copy

from solids import LINEAR_COPPER as COPPER

SOFT = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e7, "poissons_ratio": 0.3}
INVISCID = {"linear": 0.0, "quadratic": 0.0}


def scene(lower, upper, spacing, cell, *, material=COPPER, end_time=1.0, method=None, body=None, **rest) -> dict:
    """Raw tables of one box of particles in the middles of equal cells; `method` and `body` add keys, `rest` are
    further tables.
    """
    box = {"lower": list(lower), "upper": list(upper)}
    data = {
        "dimension": len(lower),
        "end_time": end_time,
        "method": {"kind": "mpm", "cell": cell, "viscosity": INVISCID, **(method or {})},
        "bodies": [
            {"shape": {"box": box}, "spacing": [spacing], "placement": "cells", "material": material, **(body or {})}
        ],
        **rest,
    }
    return copy.deepcopy(data)


def taylor_bar(cell=8e-4, *, dimension=2, speed=227.0, length=32.4e-3, end_time=80e-6, **method) -> dict:
    """A Taylor bar of 3.2 mm radius against a wall without friction; in 3-D a quarter of a square bar."""
    planes = [{"plane": f"{axis} = 0", "kind": "roller"} for axis in "XYZ"[:dimension]]
    upper = [3.2e-3] * (dimension - 1) + [length]
    geometry = {"geometry": "axisymmetric"} if dimension == 2 else {}
    return scene(
        [0.0] * dimension,
        upper,
        0.5 * cell,
        cell,
        method={**geometry, "order": "musl", **method},
        end_time=end_time,
        body={"velocity": [0.0] * (dimension - 1) + [-speed]},
        boundaries=planes,
    )


def crossing(cell=0.1, cells=(4, 3), speed=200.0, **method) -> dict:
    """A block of soft solid that flies, turning and wobbling, through many cells without meeting anything."""
    upper = [cell * count for count in cells]
    rest = [0.0] * (len(cells) - 2)
    velocity = [f"{speed} - 60*Y", f"80*X + {0.3 * speed}", *rest]
    return scene([0.0] * len(cells), upper, 0.5 * cell, cell, material=SOFT, method=method, body={"velocity": velocity})
