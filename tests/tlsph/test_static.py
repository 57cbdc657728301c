"""Equilibria: patch test, a beam, ranks, restarts, a limit point, and what is refused."""

import numpy as np
import pytest
import tomli_w
from grouped_meshes import ring
from scipy.optimize import brentq
from solids import (
    gathered,
    run_alone_and_on_all,
    run_to_end,
    simulation,
    tables,
)
from tlsph.test_mesh_weights import RUBBER, linear, of_mesh, write
from tlsph.test_shared_nodes import scene_of, two_groups

from parsolid.collective import SolverError
from parsolid.commands.cli import main
from parsolid.output.results import load

STRAIN = np.array([[0.3, 0.2, -0.1], [0.1, -0.2, 0.1], [0.0, 0.2, 0.1]])


def static(folder, kind="triangle", dimension=2, method=None, **rest):
    """Tables of a body of elements in equilibrium."""
    data = of_mesh(folder, kind, dimension, **rest)
    data["method"] = {"kind": "tlsph", "integrator": "static", **(method or {})}
    data["end_time"] = 1.0
    data["output"] = {"fields_interval": 1.0}
    return data


def box(size, weights, **rest):
    """Tables of a box of so many nodes in equilibrium."""
    data = tables((9,) * len(size), size, method={"integrator": "static", "weights": weights}, **rest)
    del data["method"]["kernel"]
    return data | {"output": {"fields_interval": 1.0}}


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


@pytest.mark.serial
@pytest.mark.parametrize(
    ("kind", "dimension"), [("mixed", 2), ("mixed", 3), ("cells", 2), ("fourth-order", 2), ("fourth-order", 3)]
)
def test_patch(shared_path, comm, kind, dimension):
    """Faces that are driven linearly strain the body evenly, by work that it stores."""
    size = (1.0, 1.0) if dimension == 2 else (1.25, 0.5, 0.5)
    moved = [f"t*({one})" for one in linear(STRAIN, dimension)]
    driven = [
        {"plane": f"{axis} = {place}", "kind": "displacement", "displacement": moved}
        for axis, length in zip("XYZ", size)
        for place in (0.0, length)
    ]
    data = box(size, kind) if kind in ("cells", "fourth-order") else static(shared_path, kind, dimension)
    data["method"]["tolerance"] = 1e-12
    sim, found = run_to_end(data | {"boundaries": driven}, comm)
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


@pytest.mark.serial
def test_two_materials(shared_path, comm):
    """Groups of one mesh that share nodes bear one stress, each with a stretch of its own."""
    data = scene_of(two_groups(shared_path, "triangle", 2), 2)
    data |= {"end_time": 1.0, "method": {"kind": "tlsph", "integrator": "static"}, "output": {"fields_interval": 1.0}}
    pulled = {"plane": "X = 2", "kind": "displacement", "displacement": ["0.4*t", "free"]}
    data["boundaries"] = [{"plane": "X = 0", "kind": "roller"}, {"plane": "Y = 0", "kind": "roller"}, pulled]
    sim, rows = run_to_end(data, comm)
    # P11 = E/2 (l - 1/l) of these laws, of Poisson's ratio 0
    soft = brentq(lambda one: (one - 1.0 / one) - 8.0 * (2.4 - one - 1.0 / (2.4 - one)), 1.0, 1.4)
    body, F = gathered(sim, "body", "deformation_gradient")
    np.testing.assert_allclose(F[:, 0], np.where(body == 0, soft, 2.4 - soft), atol=1e-7)
    assert rows["strain_energy"][-1] == pytest.approx(rows["external_work"][-1], rel=1e-4)


@pytest.mark.serial
@pytest.mark.slow
def test_small_pressure_is_a_traction(shared_path, comm):
    """On a nearly incompressible beam, of which the tangent is hard to solve."""
    law = {"kind": "guccione", "density": 1.1, "stiffness": 1.0, "along": 8.0, "across": 2.0, "shear": 4.0}
    law |= {"bulk_modulus": 500.0, "fibre": {"vector": [1.0, 0.0, 0.0]}}
    found = []
    for one in ({"kind": "pressure", "pressure": "1e-7*t"}, {"kind": "traction", "traction": ["0", "0", "1e-7*t"]}):
        on = [{"plane": "X = 0", "kind": "fixed"}, {"plane": "Z = 0", **one}]
        data = static(shared_path, "hexahedron", 3, counts=(20, 2, 2), scale=0.5, moving=0.0, boundaries=on)
        data["bodies"][0]["material"] = law
        sim, rows = run_to_end(data, comm)
        found.append(gathered(sim, "displacement")[0])
        assert rows["time"][-1] == 1.0
    np.testing.assert_allclose(found[0], found[1], rtol=0.0, atol=1e-3 * np.abs(found[1]).max())


@pytest.mark.serial
def test_pressure_against_springs(shared_path, comm):
    """A thick ring under a pressure within, on springs around it: Lame's displacements."""
    a, b, p, k, E, nu = 1.0, 2.0, 1e-4, 1.5, 3.0, 0.3
    boundaries = [
        {"where": "bore", "kind": "pressure", "pressure": f"{p}*t"},
        {"where": "outside", "kind": "spring", "stiffness": k},
    ]
    data = static(shared_path, boundaries=boundaries)
    data["bodies"][0]["shape"]["mesh"]["file"] = ring(shared_path / "ring.msh", a, b, 5)
    sim, rows = run_to_end(data, comm)
    # u = A r + B/r, s_r = E/(1 + nu) [A/(1 - 2 nu) - B/r^2]
    G = E / (1.0 + nu)
    within = [G / (1.0 - 2.0 * nu), -G / a**2]
    around = [G / (1.0 - 2.0 * nu) + k * b, -G / b**2 + k / b]
    A, B = np.linalg.solve([within, around], [-p, 0.0])
    X, u = gathered(sim, "reference_position", "displacement")
    radius = np.hypot(*X.T)
    found = np.einsum("ni,ni->n", X, u) / radius
    np.testing.assert_allclose(found, A * radius + B / radius, rtol=0.03)
    assert rows["strain_energy"][-1] == pytest.approx(rows["external_work"][-1], rel=1e-4)


@pytest.mark.serial
def test_a_small_load_on_many_nodes(shared_path, comm):
    """What is asked of the residual is not below the rounding of forces."""
    boundaries = [
        {"plane": "X = 0", "kind": "fixed"},
        {"plane": "X = 10", "kind": "traction", "traction": ["0", "1e-7*t"]},
    ]
    data = static(shared_path, counts=(480, 48), scale=1.0 / 48.0, moving=0.0, boundaries=boundaries)
    sim = simulation(data, comm)
    sim.take_step(1.0)
    assert not sim.systems[0].statics.fault and sim.systems[0].statics.retries == 0


@pytest.mark.serial
def test_buckling(comm):
    """A strut with clamped ends, shortened by twice what makes it buckle, bears Euler's force, 4 pi^2 E' I/L^2, which
    shear lowers by .7 %; by Southwell's line the push across that begins it counts for w0/w."""
    length, push = 40.0, 2.5e-7
    law = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    modulus = 1.0 / (1.0 - 0.3**2)
    strain = 4.0 * np.pi**2 / (12.0 * length**2)
    head = {"plane": "X = 40", "kind": "displacement", "displacement": [f"-{2.0 * strain * length!r}*t", "0"]}
    held = [{"plane": "X = 0", "kind": "fixed"}, head | {"name": "head", "reaction": True}]
    data = box((length, 1.0), "fourth-order", boundaries=held) | {"loads": {"acceleration": ["0", f"{push!r}"]}}
    data["bodies"][0] |= {"particles": [81, 9], "material": law}
    sim, rows = run_to_end(data, comm)
    force = -comm.allreduce(sim.systems[0].reaction("head"))[0]
    (u,) = gathered(sim, "displacement")
    straight = push * length**4 / (384.0 * modulus / 12.0)
    assert u[:, 1].max() > 0.02 * length
    assert force / (1.0 - straight / u[:, 1].max()) == pytest.approx(strain * modulus, rel=0.02)
    assert rows["strain_energy"][-1] == pytest.approx(rows["external_work"][-1], rel=2e-4)


@pytest.mark.ranks(1, 2)
def test_limit_point(shared_path, comm):
    """An arch that snaps through ends the run, with the last equilibrium in its files."""
    data = beam(shared_path, arch=1.6) | {"loads": {"acceleration": ["0", "-0.08*t"]}}
    scene, folder = shared_path / "arch.toml", shared_path / "run"
    if comm.rank == 0:
        scene.write_text(tomli_w.dumps(data))
    comm.barrier()
    assert main(["run", str(scene), "-o", str(folder), "-q"]) == 3
    last = load(folder).history.iloc[-1]
    assert 0.1 < last["time"] < 0.9
    assert last["strain_energy"] == pytest.approx(last["external_work"], rel=1e-3)
    assert (folder / "checkpoint.h5").exists()


@pytest.mark.serial
def test_jump_in_parts(shared_path, comm):
    """The shortest load step says nothing of a load that is there at the start, whose parts take no time."""
    data = beam(shared_path, boundaries=[], method={"minimum_step": 1e-3})
    sim, found = run_to_end(data | {"loads": {"acceleration": ["0", "-3e-3"]}}, comm)
    assert sim.systems[0].statics.retries > 0
    assert found["strain_energy"][-1] == pytest.approx(found["external_work"][-1], rel=1e-3)


def test_loose_body(shared_path, comm):
    """A body that nothing holds is refused, beside one on springs, too."""
    with pytest.raises(SolverError):
        simulation(static(shared_path), comm)
    data = static(shared_path, boundaries=[{"plane": "X = 0", "kind": "spring", "stiffness": 1.0, "body": "sprung"}])
    (body,) = data["bodies"]
    apart = {"box": {"lower": [0.0, 9.0], "upper": [1.0, 10.0]}}
    data["bodies"] = [body | {"name": "sprung"}, {"shape": apart, "particles": [9, 9], "material": RUBBER}]
    with pytest.raises(SolverError):
        simulation(data, comm)
