"""Modes of scenes: exact frequencies, rigid modes, constraints, several bodies, symmetry, ranks, what is refused."""

import numpy as np
import pytest
from element_meshes import element_mesh
from mpi4py import MPI
from solids import SOFT, supports, tables

from benchmarks.free_modes import Solid, box_frequencies, ring_frequencies
from parsolid.api.modes import find_modes, modes
from parsolid.collective import SolverError
from parsolid.scene import SceneError, parse_scene
from parsolid.simulation.vibrations import VibratingBodies

SOLID = Solid(SOFT["youngs_modulus"], SOFT["poissons_ratio"], SOFT["density"])


def scene_of(particles, upper, weights="cells", **rest):
    return parse_scene(tables(particles, upper=upper, method={"weights": weights, "integrator": "leapfrog"}, **rest))


def frequencies(comm, scene, count):
    """(rigid modes, the others' angular frequencies [1/s])."""
    found = find_modes(comm, scene, count, None)
    assert found.converged
    assert found.residuals.max() <= 1e-4
    return found.rigid, 2.0 * np.pi * found.frequencies[found.rigid :]


@pytest.mark.serial
@pytest.mark.parametrize(("weights", "error"), [("cells", 0.04), ("fourth-order", 0.002)])
def test_a_free_plate(comm, weights, error):
    rigid, found = frequencies(comm, scene_of((9, 17), (1.0, 2.0), weights), 6)
    assert rigid == 3
    assert found == pytest.approx(box_frequencies(SOLID, (1.0, 2.0), 6), rel=error)


@pytest.mark.serial
def test_a_clamped_column_in_space(comm):
    scene = scene_of((6, 11, 6), (0.5, 1.0, 0.5), boundaries=supports(Y=(0.0, "fixed")))
    rigid, found = frequencies(comm, scene, 4)
    exact = box_frequencies(SOLID, (0.5, 1.0, 0.5), 4, clamped=1)
    assert rigid == 0
    assert found == pytest.approx(exact, rel=0.06)
    # the two bendings
    assert found[0] == pytest.approx(found[1], rel=1e-7)


def ring_mesh(file, m):
    """Quads of a ring of radii 1/2 and 1, with m along the unit length; written by one rank."""
    import meshio

    across, around = m // 2, 4 * m
    points, blocks = element_mesh("quad", (across, around), 0.0)
    radius, angle = 0.5 + 0.5 * points[:, 0] / across, 2.0 * np.pi * points[:, 1] / around
    number = np.arange((across + 1) * (around + 1)).reshape(across + 1, around + 1)
    last = np.arange(len(points))
    last[number[:, -1]] = number[:, 0]
    kept, back = np.unique(last, return_inverse=True)
    places = np.stack((radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle), axis=1)[kept]
    if MPI.COMM_WORLD.rank == 0:
        meshio.write(file, meshio.Mesh(places, [(kind, back[cells]) for kind, cells in blocks]))
    MPI.COMM_WORLD.Barrier()


def ring(folder, m):
    file = folder / f"ring-{m}.vtu"
    ring_mesh(file, m)
    body = {"shape": {"mesh": {"file": str(file)}}, "material": SOFT}
    return parse_scene({"dimension": 2, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body]})


def test_a_free_ring_of_a_mesh(comm, shared_path):
    exact, errors = ring_frequencies(SOLID, 0.5, 1.0, 5), []
    for m in (16, 32):
        rigid, found = frequencies(comm, ring(shared_path, m), 5)
        assert rigid == 3
        errors.append(np.sqrt(np.mean((found / exact - 1.0) ** 2)))
    assert errors[0] < 0.006
    assert np.log2(errors[0] / errors[1]) > 1.5


def test_the_same_on_all_ranks(comm, shared_path):
    """Other sums, other halves of the grid: the frequencies are the same to the square of the residuals."""
    scene = ring(shared_path, 8)
    there, alone = find_modes(comm, scene, 5, None), find_modes(MPI.COMM_SELF, scene, 5, None)
    assert there.frequencies[3:] == pytest.approx(alone.frequencies[3:], rel=1e-7)
    # of two modes of one frequency any two are found, so that shares are compared of both
    assert there.shares.sum(axis=0) == pytest.approx(alone.shares.sum(axis=0), abs=1e-7)


@pytest.mark.serial
def test_rigid_modes_of_two_bodies_and_their_shares(comm):
    """Two plates that nothing joins move for themselves; all rigid modes together have the whole mass."""
    scene = tables((5, 9), upper=[0.5, 1.0], method={"weights": "cells", "integrator": "leapfrog"})
    other = dict(scene["bodies"][0], shape={"box": {"lower": [2.0, 0.0], "upper": [2.5, 1.0]}}, name="other")
    scene["bodies"] = [dict(scene["bodies"][0], name="one"), other]
    found = find_modes(comm, parse_scene(scene), 4, None)
    assert found.rigid == 6
    assert found.shares[:6].sum(axis=0) == pytest.approx([1.0, 1.0], rel=1e-9)
    assert np.abs(found.shares[6:]).max() < 1e-9
    # both have the same frequencies
    assert found.frequencies[6::2] == pytest.approx(found.frequencies[7::2], rel=1e-6)


@pytest.mark.serial
def test_half_a_plate_beside_a_plane_of_symmetry(comm):
    """It has the modes of the whole plate that are symmetric, and slides along the plane."""
    whole = frequencies(comm, scene_of((17, 13), (1.0, 0.75), "fourth-order"), 8)[1]
    half = scene_of((9, 13), (0.5, 0.75), "fourth-order", boundaries=supports(X=(0.0, "roller")))
    rigid, found = frequencies(comm, half, 3)
    assert rigid == 1
    assert np.abs(found[:, None] / whole - 1.0).min(axis=1).max() < 2e-3


def peridynamic(particles, upper, **rest):
    data = tables(particles, upper=upper, method={"kind": "peridynamics"}, body={"placement": "cells"}, **rest)
    return parse_scene(data)


@pytest.mark.serial
def test_peridynamic_bodies(comm):
    """A free plate in plane strain, and a bar of one dimension, whose waves are n half lengths."""
    rigid, found = frequencies(comm, peridynamic((16, 32), (1.0, 2.0)), 4)
    assert rigid == 3
    assert found == pytest.approx(box_frequencies(SOLID, (1.0, 2.0), 4), rel=0.03)
    rigid, found = frequencies(comm, peridynamic((40,), (2.0,), material={**SOFT, "kind": "linear-elastic"}), 3)
    assert rigid == 1
    speed = (SOLID.youngs_modulus / SOLID.density) ** 0.5
    assert found == pytest.approx(np.pi * speed / 2.0 * np.arange(1, 4), rel=0.04)


PLATE = {"shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}}, "particles": [8, 8], "material": SOFT}
MUSCLE = {
    "kind": "guccione",
    "density": 1000.0,
    "stiffness": 1e4,
    "along": 4.0,
    "across": 1.0,
    "shear": 2.0,
    "bulk_modulus": 1e6,
    "fibre": {"angle": "0"},
}
TENDON = {
    "kind": "holzapfel-gasser-ogden",
    "density": 1000.0,
    "shear_modulus": 1e4,
    "bulk_modulus": 1e6,
    "fibre_modulus": 1e5,
    "fibre_exponent": 1.0,
    "fibre": {"angle": "0"},
}
ABOVE = {**PLATE, "shape": {"box": {"lower": [0.0, 1.5], "upper": [1.0, 2.5]}}}
TLSPH = {"kind": "tlsph", "weights": "cells"}


@pytest.mark.serial
@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"method": {"kind": "mpm", "cell": 0.25}, "bodies": [{**PLATE, "placement": "cells"}]}, "method.kind"),
        ({"bodies": [{**PLATE, "name": "a"}, {**ABOVE, "name": "b"}], "contact": [{"bodies": ["a", "b"]}]}, "contact"),
        ({"boundaries": [{"kind": "spring", "plane": "X = 0", "stiffness": 1.0}]}, "boundaries.0.kind"),
        ({"bodies": [{**PLATE, "material": TENDON}]}, "bodies.0.material.kind"),
        ({"bodies": [{**PLATE, "material": MUSCLE}], "method": {"kind": "peridynamics"}}, "bodies.0.material.kind"),
    ],
)
def test_what_does_not_vibrate_linearly_is_refused(comm, changes, place):
    scene = parse_scene({"dimension": 2, "end_time": 1.0, "method": TLSPH, "bodies": [PLATE]} | changes)
    with pytest.raises(SceneError) as caught:
        find_modes(comm, scene, 2, None)
    assert [fault.key for fault in caught.value.faults] == [place]


@pytest.mark.serial
@pytest.mark.parametrize("loads", [{"acceleration": ["0", "-9.81"]}, {"body_force": ["1", "0"]}, {}])
def test_loads_that_do_not_act_are_told(comm, loads):
    notes = VibratingBodies(comm, scene_of((9, 9), (1.0, 1.0), loads=loads)).notes()
    assert [note.code for note in notes] == ["linear-motion"] * bool(loads)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, float("nan"), "small", True])
def test_a_tolerance_out_of_bounds_is_refused(tolerance):
    with pytest.raises(SolverError):
        modes({"dimension": 2, "end_time": 1.0, "method": TLSPH, "bodies": [PLATE]}, 1, tolerance=tolerance)


@pytest.mark.serial
def test_a_body_that_is_held_all_over_is_refused(comm):
    scene = scene_of((2, 5), (1.0, 4.0), boundaries=supports(X0=(0.0, "fixed"), X1=(1.0, "fixed")))
    with pytest.raises(SolverError):
        find_modes(comm, scene, 2, None)


@pytest.mark.serial
def test_weights_that_do_not_close_are_refused(comm):
    with pytest.raises(SolverError):
        find_modes(comm, scene_of((9, 9), (1.0, 1.0), "kernel"), 2, None)


@pytest.mark.serial
def test_modes_are_those_of_the_true_mass(comm):
    method = {"weights": "cells", "integrator": "leapfrog", "mass_scaling": 4.0}
    scene = parse_scene(tables((5, 5), upper=(1.0, 1.0), method=method))
    with pytest.raises(SolverError, match=r"^method\.mass_scaling: .* found 4$"):
        find_modes(comm, scene, 2, None)
