"""Boxes with a hole: the same particles as a full lattice with those in the hole taken out."""

import numpy as np
import pytest

from parsolid.particles.fillings import filling_of
from parsolid.scene import parse_scene


def body(dimension, placement=None, particles=(12, 9, 7), **shape):
    table = {
        "shape": shape,
        "particles": list(particles[:dimension]),
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


@pytest.mark.parametrize("centre", ([0.0, 0.0, 0.0], [0.6, 0.31, 0.2], [1.2, 0.9, 0.0], [0.5, 0.5, 0.7]))
@pytest.mark.parametrize("dimension", (2, 3))
def test_nodes_are_the_corners_of_the_kept_cells_and_no_others(dimension, centre):
    shape = {"lower": [0.0] * dimension, "upper": [1.2, 0.9, 0.7][:dimension], "centre": centre[:dimension]}
    particles = np.array([12, 9, 7][:dimension])
    cells = filling_of(body(dimension, perforated_box={**shape, "radius": 0.33}), dimension)
    table = body(dimension, "vertices", perforated_box={**shape, "radius": 0.33})
    nodes = filling_of(table.model_copy(update={"particles": (particles + 1).tolist()}), dimension)
    found = [nodes.piece(0, 37), nodes.piece(37, nodes.count)]
    position, volume, area = (
        np.concatenate([getattr(one, name) for one in found]) for name in ("position", "volume", "area")
    )
    kept = cells.piece(0, cells.count)
    step = np.array(shape["upper"]) / particles
    corners = [kept.position + step * (np.array(side) - 0.5) for side in np.ndindex(*(2,) * dimension)]
    places, count = np.unique(np.rint(np.concatenate(corners) / step).astype(int), axis=0, return_counts=True)
    order = np.lexsort(position.T[::-1])
    # in the order of the lattice, each with its part of the cells around it
    assert np.array_equal(order, np.arange(nodes.count))
    assert np.allclose(position, places * step, atol=1e-12)
    assert np.allclose(volume, count * np.prod(step) / 2**dimension)
    assert np.allclose(area.sum(axis=0), 0.0, atol=1e-12)
    # the divergence theorem of volumes and areas
    assert np.einsum("ni,nj->ij", area, position) == pytest.approx(volume.sum() * np.eye(dimension), abs=1e-12)
