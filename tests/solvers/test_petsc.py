"""Equilibria with PETSc's solvers, where petsc4py is installed, and what is said where it cannot be used."""

import sys

import numpy as np
import pytest
from solids import gathered, run_to_end
from tlsph.test_pressures import cook
from tlsph.test_static import box

import parsolid.solvers.petsc
from parsolid.scene import SceneError, parse_scene
from parsolid.solvers.petsc import missing_petsc

with_petsc = pytest.mark.skipif(missing_petsc() is not None, reason="needs petsc4py on the MPI of mpi4py")


def pressed():
    """A box under a pressure that follows it."""
    held = [{"plane": "X = 0", "kind": "roller"}, {"plane": "Y = 0", "kind": "fixed"}]
    return box((1.0, 1.0), "cells", boundaries=[*held, {"plane": "Y = 1", "kind": "pressure", "pressure": "0.2*t"}])


def refusals(data):
    """Keys that are refused of a scene."""
    with pytest.raises(SceneError) as refused:
        parse_scene(data)
    return {fault.key for fault in refused.value.faults}


@with_petsc
@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize(("body", "integrator"), [("box", "static"), ("mesh", "static"), ("box", "implicit")])
def test_same_equilibrium(shared_path, comm, body, integrator):
    """As by the embedded solver: of a symmetric tangent with pressures, of one that is not symmetric, in long steps."""
    found = []
    for solver in ("embedded", "petsc"):
        data = pressed() if body == "box" else cook(shared_path, 8, 0.4999)
        data["method"] |= {"linear_solver": solver, "integrator": integrator, "maximum_step": 0.125}
        sim, _ = run_to_end(data, comm)
        work = sim.systems[0].statics.most_products or sim.systems[0].implicit.products
        found.append((gathered(sim, "displacement")[0], work))
    (u, products), (other, of_petsc) = found
    np.testing.assert_allclose(other, u, atol=1e-7 * np.abs(u).max())
    assert of_petsc < 1.5 * products


@with_petsc
@pytest.mark.serial
def test_options(comm):
    """They reach PETSc: without a preconditioner there are more products."""
    from petsc4py import PETSc

    products = []
    for options in ("", "-pc_type none"):
        data = pressed()
        data["method"] |= {"linear_solver": "petsc", "petsc_options": options}
        products.append(run_to_end(data, comm)[0].systems[0].statics.products)
        PETSc.Options().clear()
    assert products[1] > 1.5 * products[0]


@pytest.mark.serial
@pytest.mark.parametrize("library", [None, b"libmpi.so.999"])
def test_missing(monkeypatch, tmp_path, library):
    """No petsc4py, or one of another MPI."""
    if library is None:
        monkeypatch.setattr(parsolid.solvers.petsc, "find_spec", lambda name: None)
    else:
        (tmp_path / "petsc4py").mkdir()
        (tmp_path / "petsc4py" / "__init__.py").touch()
        (tmp_path / "petsc4py" / "PETSc.so").write_bytes(library)
        monkeypatch.delitem(sys.modules, "petsc4py", raising=False)
        monkeypatch.syspath_prepend(tmp_path)
    data = pressed()
    data["method"]["linear_solver"] = "petsc"
    assert refusals(data) == {"method.linear_solver"}


@pytest.mark.serial
@pytest.mark.parametrize("integrator", ["static", "leapfrog"])
def test_options_without_petsc(integrator):
    """A setting without effect is refused."""
    data = pressed()
    data["method"] |= {"integrator": integrator, "petsc_options": "-ksp_monitor"}
    assert refusals(data) == {"method.petsc_options"}
