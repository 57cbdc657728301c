"""Boxes with a hole: the same particles as a full lattice with those in the hole taken out."""

import numpy as np
import pytest

from parsolid.particles.fillings import filling_of

UPPER, COUNTS, RADIUS = [1.2, 0.9, 0.7], np.array([12, 9, 7]), 0.33
CENTRES = [[0.0, 0.0, 0.0], [0.6, 0.31, 0.2], [1.2, 0.9, 0.0], [0.5, 0.5, 0.7]]


def filled(scene_of, d, counts, **more):
    """The filling of a box (with a hole if there is a radius), and position, volume and area of it in two pieces."""
    shape = {"perforated_box" if "radius" in more else "box": {"lower": [0.0] * d, "upper": UPPER[:d], **more}}
    placement = "cells" if counts is COUNTS else "vertices"
    one = filling_of(scene_of(d, shape, particles=counts[:d].tolist(), placement=placement).bodies[0], d)
    pieces = [one.piece(0, 37), one.piece(37, one.count)]
    return one, *(np.concatenate([getattr(it, name) for it in pieces]) for name in ("position", "volume", "area"))


@pytest.mark.parametrize("centre", CENTRES)
@pytest.mark.parametrize("d", (2, 3))
def test_cells_outside_the_hole_and_their_corners_and_no_others(scene_of, d, centre):
    hole = {"centre": centre[:d], "radius": RADIUS}
    _, full, whole_volume, whole_area = filled(scene_of, d, COUNTS)
    cells, position, volume, area = filled(scene_of, d, COUNTS, **hole)
    kept = np.linalg.norm(full - centre[:d], axis=1) >= RADIUS
    assert np.allclose(position, full[kept], atol=1e-12) and np.allclose(volume, whole_volume[kept])
    # the surface is closed, and each outer face keeps its area but where the hole cuts it
    assert np.allclose(area.sum(axis=0), 0.0, atol=1e-12) and cells.coarsest == pytest.approx(0.1)
    outer = whole_area[kept].any(axis=1) & (np.linalg.norm(position - centre[:d], axis=1) > RADIUS + 0.2)
    assert np.allclose(area[outer], whole_area[kept][outer])

    nodes, at_nodes, volume, area = filled(scene_of, d, COUNTS + 1, **hole)
    step = np.array(UPPER[:d]) / COUNTS[:d]
    corners = [position + step * (np.array(side) - 0.5) for side in np.ndindex(*(2,) * d)]
    places, count = np.unique(np.rint(np.concatenate(corners) / step).astype(int), axis=0, return_counts=True)
    # in the order of the lattice, each with its part of the cells around it
    assert np.array_equal(np.lexsort(at_nodes.T[::-1]), np.arange(nodes.count))
    assert np.allclose(at_nodes, places * step, atol=1e-12)
    assert np.allclose(volume, count * np.prod(step) / 2**d)
    # the divergence theorem of volumes and areas
    assert np.allclose(area.sum(axis=0), 0.0, atol=1e-12)
    assert np.einsum("ni,nj->ij", area, at_nodes) == pytest.approx(volume.sum() * np.eye(d), abs=1e-12)
