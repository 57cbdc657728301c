"""The elements that the reference series of the twist is made by, and the series itself."""

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest

REFERENCE = Path(__file__).parents[2] / "runs" / "tlsph" / "reference"


@pytest.fixture
def elements(monkeypatch):
    monkeypatch.syspath_prepend(str(REFERENCE))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    return importlib.import_module("twist_by_elements")


def symmetric(mesh, random) -> np.ndarray:
    """A field (3, nodes) that a quarter turn keeps."""
    u = random.standard_normal(mesh.places.shape)
    u[::2, mesh.axis] = 0.0
    u[:, mesh.on_x] = np.stack((-u[2, mesh.on_z], u[1, mesh.on_z], u[0, mesh.on_z]))
    return u


@pytest.mark.serial
@pytest.mark.parametrize(("order", "cells"), [(2, 1), (3, 2)])
def test_forces_are_the_slope_of_the_energy_and_the_quarter_has_the_mass_of_a_quarter(elements, order, cells):
    mesh, random = elements.Quarter(order, cells), np.random.default_rng(2)
    u, way = 1e-3 * symmetric(mesh, random), symmetric(mesh, random)
    force, _ = mesh.forces(u)
    step = 1e-6
    slope = (mesh.forces(u + step * way)[1] - mesh.forces(u - step * way)[1]) / (2.0 * step)
    own = np.setdiff1d(np.arange(mesh.places.shape[1]), np.setdiff1d(mesh.on_x, mesh.axis))
    assert slope == pytest.approx(-4.0 * (force * way)[:, own].sum(), rel=1e-6)
    assert mesh.own_mass.sum() == pytest.approx(1100.0 * 6.0 / 4.0, rel=1e-12)
    # all quarters together, at nodes of which each stands for itself alone
    assert (4.0 * mesh.mass[own]).sum() == pytest.approx(1100.0 * 6.0, rel=1e-12)


@pytest.mark.serial
def test_the_kept_series_closes_its_energy_and_is_that_of_another_code():
    kept, other = (json.loads((REFERENCE / f"{name}.json").read_text()) for name in ("twist", "column_b0"))
    K, W, twist = (np.array(kept["series"][name]) for name in ("K", "W", "twist_C"))
    assert np.abs(K + W - kept["E0"]).max() < 2e-6 * kept["E0"]
    theirs = [np.interp(kept["t"], other["t"], other["series"][name]) for name in ("K", "twist_C")]
    assert np.abs(K - theirs[0]).max() < 1.5e-3 * kept["E0"]
    assert np.abs(twist - theirs[1]).max() < 5e-3 * np.abs(twist).max()
