"""Frequencies of free bodies against published roots, beams, and shear waves that fit a square exactly."""

import numpy as np
import pytest
from scipy.special import jn_zeros

from benchmarks.free_modes import Solid, box_frequencies, ring_frequencies, sphere_frequencies

STEEL = Solid(210e9, 0.3, 7800.0)


def test_sphere():
    """Roots of the torsional modes, times the shear wave's speed over the radius, do not depend on the material; those
    of the spheroidal mode of degree 2 are 2.640 for Poisson's ratio 1/4 (Lamb, 1882)."""
    speed = STEEL.speeds[1] / 0.2
    found = sphere_frequencies(STEEL, 0.2, 60) / speed
    assert found[:5] == pytest.approx(2.50113, abs=1e-5)
    for root, degree in ((3.86470, 3), (5.09462, 4), (5.76346, 1)):
        assert np.sum(np.abs(found - root) < 1e-5) == 2 * degree + 1
    of_lamb = Solid(1.0, 0.25, 1.0)
    assert sphere_frequencies(of_lamb, 1.0, 10)[5:] / of_lamb.speeds[1] == pytest.approx(2.640, abs=5e-4)


def test_disc_and_thin_ring():
    found = ring_frequencies(STEEL, 0.0, 0.3, 25) * 0.3 / STEEL.speeds[1]
    assert np.abs(found - jn_zeros(2, 1)[0]).min() < 1e-10
    # a ring that bends without being stretched, of thickness h and mean radius R, in plane strain
    h, R, n = 0.004, 0.4, np.repeat([2.0, 3.0], 2)
    modulus = STEEL.youngs_modulus / (1.0 - STEEL.poissons_ratio**2)
    bending = np.sqrt(modulus * h**2 / (12.0 * STEEL.density * R**4) * n**2 * (n**2 - 1.0) ** 2 / (n**2 + 1.0))
    assert ring_frequencies(STEEL, R - 0.5 * h, R + 0.5 * h, 4) == pytest.approx(bending, rel=1e-3)


def test_square_and_slender_boxes():
    """A wave of shear that is reflected at the sides of a square, and the bending of a slender bar."""
    speed = STEEL.speeds[1]
    square = box_frequencies(STEEL, (0.1, 0.1), 8)
    assert np.abs(square / (2**0.5 * np.pi * speed / 0.1) - 1.0).min() < 1e-6
    length, h = 1.0, 0.02
    modulus = STEEL.youngs_modulus / (1.0 - STEEL.poissons_ratio**2)
    # at the corners of a clamped end stress is singular, and the series converges slowly
    for clamped, root, error in ((None, 4.73004, 2e-3), (0, 1.87510, 4e-3)):
        beam = root**2 * h / length**2 * np.sqrt(modulus / (12.0 * STEEL.density))
        assert box_frequencies(STEEL, (length, h), 1, clamped) == pytest.approx(beam, rel=error)
