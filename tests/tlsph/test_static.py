"""Equilibria: patch test, a beam, ranks, restarts, a limit point, and what is refused."""

import numpy as np
import pytest
from solids import (
    evolved,
    gathered,
    run_alone_and_on_all,
    run_into,
    run_through_and_in_two,
    run_to_end,
    simulation,
    tables,
)
from test_mesh_weights import RUBBER, linear, of_mesh, write

from parsolid.collective import SolverError
from parsolid.output.results import load
from parsolid.scene import SceneError, parse_scene
from parsolid.simulation.loop import RunFailed

STRAIN = np.array([[0.3, 0.2, -0.1], [0.1, -0.2, 0.1], [0.0, 0.2, 0.1]])


def static(folder, kind="triangle", dimension=2, method=None, **rest):
    """Tables of a body of elements in equilibrium."""
    data = of_mesh(folder, kind, dimension, **rest)
    data["method"] = {"kind": "tlsph", "integrator": "static", **(method or {})}
    data["end_time"] = 1.0
    data["output"] = {"fields_interval": 1.0}
    return data


def beam(folder, arch=0.0, **rest):
    """A beam 8 x 1 of triangles, clamped at one end, or an arch with both ends clamped."""
    data = static(folder, counts=(16, 2), scale=0.5, moving=0.0, **rest)
    if arch:
        x, y = np.meshgrid(np.linspace(0.0, 8.0, 17), np.linspace(0.0, 0.6, 3), indexing="ij")
        points = np.stack([x.ravel(), (y + arch * np.sin(np.pi * x / 8.0)).ravel()], axis=1)
        cells = [[a, a + 3, a + 4, a + 1] for i in range(16) for a in (3 * i, 3 * i + 1)]
        write(folder / "triangle2.vtu", points, [("quad", np.array(cells))])
    clamps = [{"plane": f"X = {x}", "kind": "fixed"} for x in ((0.0, 8.0) if arch else (0.0,))]
    data["boundaries"] = [*clamps, *rest.get("boundaries", [])]
    return data


def sagging(folder):
    """A beam under its own weight, which grows."""
    return beam(folder, boundaries=[]) | {"loads": {"acceleration": ["0", "-3e-3*t"]}}


@pytest.mark.parametrize("dimension", [2, 3])
def test_patch(shared_path, comm, dimension):
    """Faces that are driven linearly strain the body evenly, by work that it stores."""
    sides = [
        (axis, place) for axis, count in zip("XYZ", (4, 4) if dimension == 2 else (5, 2, 2)) for place in (0, count)
    ]
    moved = [f"t*({one})" for one in linear(STRAIN, dimension)]
    driven = [
        {"plane": f"{axis} = {0.25 * place}", "kind": "displacement", "displacement": moved} for axis, place in sides
    ]
    sim, found = run_to_end(static(shared_path, "mixed", dimension, boundaries=driven), comm)
    (F,) = gathered(sim, "deformation_gradient")
    assert np.abs(F.reshape(-1, dimension, dimension) - np.eye(dimension) - STRAIN[:dimension, :dimension]).max() < 1e-9
    assert found["strain_energy"][-1] == pytest.approx(found["external_work"][-1], rel=1e-4)
    assert sim.systems[0].statics.norm <= sim.systems[0].statics.target


@pytest.mark.ranks(1, 2)
def test_beam(shared_path, comm):
    """The same on all ranks; work is stored, and reactions bear the load."""
    data = sagging(shared_path)
    held = {"plane": "X = 0", "kind": "displacement", "displacement": ["0", "0"], "name": "clamp", "reaction": True}
    data["boundaries"] = [held]
    rows = run_alone_and_on_all(data, comm, names=("time", "external_work", "strain_energy"))
    assert rows["strain_energy"][-1] == pytest.approx(rows["external_work"][-1], rel=2e-4)
    sim, _ = run_to_end(data, comm)
    force = comm.allreduce(sim.systems[0].reaction("clamp"))
    np.testing.assert_allclose(force[:2], [0.0, 1.1 * 8.0 * 3e-3], atol=1e-8)


@pytest.mark.ranks(1, 2)
def test_restart(shared_path, comm):
    """A restart after three load steps goes on with the same bits."""
    through, pieces = run_through_and_in_two(shared_path, comm, parse_scene(sagging(shared_path)), 3)
    names = evolved(through.simulation.systems[0].particles)
    both = [gathered(job.simulation, *names) for job in (through, pieces)]
    for name, whole, resumed in zip(names, *both):
        assert np.array_equal(whole, resumed), name


@pytest.mark.ranks(1, 2)
def test_limit_point(shared_path, comm):
    """An arch that snaps through ends the run, with the last equilibrium in its files."""
    data = beam(shared_path, arch=1.6) | {"loads": {"acceleration": ["0", "-0.08*t"]}}
    folder = shared_path / "run"
    with pytest.raises(RunFailed):
        run_into(folder, comm, parse_scene(data))
    last = load(folder).history.iloc[-1]
    assert 0.1 < last["time"] < 0.9
    assert last["strain_energy"] == pytest.approx(last["external_work"], rel=1e-3)
    assert (folder / "checkpoint.h5").exists()


def test_loose_body(shared_path, comm):
    """A body that nothing holds is refused."""
    with pytest.raises(SolverError):
        simulation(static(shared_path), comm)


REFUSED = {
    "method.safety": {"method": {"safety": 0.5}},
    "method.dissipation": {"method": {"dissipation": 0.5}},
    "method.weights": {"method": {"weights": "kernel"}},
    "bodies.0.velocity": {"body": {"velocity": ["1", "0"]}},
    "bodies.0.material.branches": {"body": {"material": RUBBER | {"branches": [{"beta": 1.0, "tau": 1.0}]}}},
}


@pytest.mark.parametrize("key", REFUSED)
def test_refused(tmp_path, key):
    with pytest.raises(SceneError) as refused:
        parse_scene(static(tmp_path, **REFUSED[key]))
    assert any(str(fault).startswith(key) for fault in refused.value.faults)


def test_displacement_is_for_equilibria():
    driven = {"plane": "X = 0", "kind": "displacement", "displacement": ["t", "0"]}
    with pytest.raises(SceneError) as refused:
        parse_scene(tables((4, 4), boundaries=[driven]))
    assert any(str(fault).startswith("boundaries.0.kind") for fault in refused.value.faults)
