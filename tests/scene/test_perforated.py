"""Boxes with a hole: the same particles as a full lattice with those in the hole taken out."""

import numpy as np
import pytest

from parsolid.scene import parse_scene
from parsolid.scene.fillings import filling_of


def body(dimension, placement=None, **shape):
    table = {
        "shape": shape,
        "particles": [12, 9, 7][:dimension],
        "material": {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3},
    }
    if placement:
        table["placement"] = placement
    data = {"dimension": dimension, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [table]}
    return parse_scene(data).bodies[0]


@pytest.mark.parametrize("centre", ([0.0, 0.0, 0.0], [0.6, 0.31, 0.2], [1.2, 0.9, 0.0], [0.5, 0.5, 2.0]))
@pytest.mark.parametrize("dimension", (2, 3))
def test_cells_outside_the_hole_and_no_others(dimension, centre):
    lower, upper, centre, radius = [0.0, 0.0, 0.0], [1.2, 0.9, 0.7], np.array(centre[:dimension]), 0.33
    box = {"lower": lower[:dimension], "upper": upper[:dimension]}
    full = filling_of(body(dimension, "cells", box=box), dimension)
    everything = full.piece(0, full.count)
    perforated = filling_of(
        body(dimension, perforated_box={**box, "centre": list(centre), "radius": radius}), dimension
    )
    kept = np.linalg.norm(everything.position - centre, axis=1) >= radius
    # in any two pieces
    found = [perforated.piece(0, 41), perforated.piece(41, perforated.count)]
    positions = np.concatenate([one.position for one in found])
    assert np.allclose(positions, everything.position[kept], atol=1e-12)
    area, volume = (np.concatenate([getattr(one, name) for one in found]) for name in ("area", "volume"))
    assert np.allclose(volume, everything.volume[kept])
    # the surface is closed, and each outer face keeps its area but where the hole cuts it
    assert np.allclose(area.sum(axis=0), 0.0, atol=1e-12)
    outer = everything.area[kept].any(axis=1) & (np.linalg.norm(positions - centre, axis=1) > radius + 0.2)
    assert np.allclose(area[outer], everything.area[kept][outer])
    assert perforated.coarsest == pytest.approx(0.1)
