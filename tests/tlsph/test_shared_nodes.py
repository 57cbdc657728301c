"""Bodies that are groups of one mesh: materials that meet at shared nodes, ties and contact beside them."""

import meshio
import numpy as np
import pytest
from element_meshes import element_mesh
from mpi4py import MPI
from scipy.optimize import brentq
from solids import gathered, momenta, run_to_end, simulation

from parsolid.collective import SolverError
from parsolid.scene import SceneError, parse_scene

SOFT = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.0}
HARD = {"kind": "neo-hookean", "density": 3.0, "youngs_modulus": 8.0, "poissons_ratio": 0.0}
COUNTS = {2: (8, 3), 3: (4, 2, 2)}


def two_groups(folder, kind, dimension, scale=0.25, moving=0.2):
    """A mesh file whose halves along X are the groups "soft" and "hard", with uneven nodes on both sides."""
    file, counts = folder / f"{kind}{dimension}.msh", COUNTS[dimension]
    points, blocks = element_mesh(kind, counts, 0.0, scale)
    middle = 0.5 * counts[0] * scale
    free = (np.abs(points[:, :1] - middle) > 1e-9) & (points > 1e-9) & (points < scale * np.array(counts) - 1e-9)
    points = points + moving * scale * free * (np.random.default_rng(3).random(points.shape) - 0.5)
    if MPI.COMM_WORLD.rank == 0:
        full = np.zeros((len(points), 3))
        full[:, :dimension] = points
        mesh = meshio.Mesh(full, blocks)
        tags = [np.where(points[cells].mean(axis=1)[:, 0] < middle, 1, 2) for _, cells in blocks]
        mesh.cell_data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        mesh.field_data = {"soft": np.array([1, dimension]), "hard": np.array([2, dimension])}
        meshio.write(file, mesh, file_format="gmsh22", binary=False)
    MPI.COMM_WORLD.Barrier()
    return str(file)


def scene_of(file, dimension, soft=None, hard=None, **rest):
    bodies = [
        {"name": "soft", "shape": {"file": file, "group": "soft"}, "material": SOFT, **(soft or {})},
        {"name": "hard", "shape": {"file": file, "group": "hard"}, "material": HARD, **(hard or {})},
    ]
    return {"dimension": dimension, "end_time": 0.5, "method": {"kind": "tlsph"}, "bodies": bodies, **rest}


def stress_of_stretch(modulus, stretch):
    """Of the laws here, of Poisson's ratio 0, without lateral strain: found with the code's own law at one point."""
    from parsolid.materials.hyperelastic.functions import stress
    from parsolid.materials.registry import laws_of

    scene = parse_scene(
        {
            "dimension": 3,
            "end_time": 1.0,
            "method": {"kind": "tlsph"},
            "bodies": [
                {
                    "shape": {"box": {"lower": [0, 0, 0], "upper": [1, 1, 1]}},
                    "particles": [2, 2, 2],
                    "material": SOFT | {"youngs_modulus": modulus},
                }
            ],
        }
    )
    (law,) = laws_of(scene)
    F = (stretch, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    H = (1.0, 0.0, 0.0, 0.0, stretch, 0.0, 0.0, 0.0, stretch)
    return stress(law, F, H, stretch)


@pytest.mark.parametrize(("dimension", "kind"), [(2, "triangle"), (2, "mixed"), (3, "tetra"), (3, "hexahedron")])
def test_a_kink_at_the_interface_is_exact(shared_path, comm, dimension, kind):
    """Two laws under one stress, each stretched in its own way: nothing moves but where the surface is pulled."""
    file = two_groups(shared_path, kind, dimension)
    middle, stretch = 0.125 * COUNTS[dimension][0], 1.2
    pull = stress_of_stretch(1.0, stretch)[0]
    other = brentq(lambda s: stress_of_stretch(8.0, s)[0] - pull, 1.0, stretch)
    still = ["0"] * (dimension - 1)
    soft = {"displacement": [f"{stretch - 1.0}*X", *still]}
    hard = {"displacement": [f"{stretch - 1.0}*{middle} + {other - 1.0!r}*(X - {middle})", *still]}
    sim = simulation(scene_of(file, dimension, soft, hard), comm)
    sim.systems[0].leapfrog.evaluate()
    X, T, body = gathered(sim, "reference_position", "stress_force", "body")
    # of Poisson's ratio 0 with Hencky's or another volume term sides may be pulled, too: inside and at the interface
    size = 0.25 * np.array(COUNTS[dimension])
    inside = ((X > 1e-9) & (X < size - 1e-9)).all(axis=1)
    at_interface = inside & (np.abs(X[:, 0] - middle) < 1e-9)
    assert at_interface.sum() >= 2 * (COUNTS[dimension][1] - 1)
    np.testing.assert_allclose(T[inside], 0.0, atol=1e-13 * abs(pull))
    # ends bear the pull
    left, right = (T[np.abs(X[:, 0] - end) < 1e-9, 0].sum() for end in (0.0, size[0]))
    assert left == pytest.approx(pull * np.prod(size[1:]), rel=1e-12) and right == pytest.approx(-left, rel=1e-12)


def test_motion_is_one_and_conserved(shared_path, comm):
    """A free body of two materials: copies of a node stay together; momentum, angular momentum, energy are kept."""
    velocity = {"velocity": ["0.1*X - 0.3*Y", "0.2*X + 0.1*Y"]}
    data = scene_of(two_groups(shared_path, "mixed", 2), 2, velocity, velocity, end_time=3.0)
    data["method"] |= {"dissipation": 0.0, "safety": 0.45}
    sim, rows = run_to_end(data, comm, momenta)
    p, turning = np.stack(rows["p"]), np.array(rows["l"])
    np.testing.assert_allclose(p - p[0], 0.0, atol=1e-13)
    np.testing.assert_allclose(turning - turning[0], 0.0, atol=1e-13)
    assert np.abs(rows["energy_error"]).max() < 1e-4 * rows["kinetic"].max()
    X, x = gathered(sim, "reference_position", "position")
    _, first, number = np.unique(X.round(9), axis=0, return_index=True, return_inverse=True)
    np.testing.assert_allclose(x - x[first[number.ravel()]], 0.0, atol=1e-12)
    assert len(first) < len(X)


def frequency(data):
    """Of the first longitudinal wave of a clamped bar of two materials."""
    _, rows = run_to_end(data)
    kinetic, time = rows["kinetic"], rows["time"]
    top = next(i for i in range(3, len(kinetic) - 1) if kinetic[i] > kinetic[i - 1] and kinetic[i] >= kinetic[i + 1])
    a, b, c = kinetic[top - 1 : top + 2]
    return np.pi / (time[top] + 0.5 * (time[top + 1] - time[top]) * (a - c) / (a - 2.0 * b + c))


@pytest.mark.serial
def test_first_frequency_of_a_bar_of_two_materials(tmp_path):
    """tan(k1 L1) tan(k2 L2) = rho1 c1/(rho2 c2) for a bar clamped at the soft end, free at the other."""
    file, length = two_groups(tmp_path, "triangle", 2), 1.0
    c1, c2, z1, z2 = 1.0, np.sqrt(8.0 / 3.0), 1.0, np.sqrt(24.0)
    exact = brentq(lambda w: np.tan(w / c1 * length) * np.tan(w / c2 * length) - z1 / z2, 1e-3, 1.0)
    exact, c2 = float(exact), float(c2)
    shape = f"1e-3*sin({exact / c1!r}*X)"
    top, slope = float(np.sin(exact / c1)), float(np.cos(exact * length / c2))
    other = f"1e-3*{top!r}*cos({exact / c2!r}*(2 - X))/{slope!r}"
    soft, hard = {"velocity": [shape, "0"]}, {"velocity": [other, "0"]}
    boundaries = [{"plane": "X = 0", "kind": "fixed"}]
    data = scene_of(file, 2, soft, hard, boundaries=boundaries, end_time=1.3 * np.pi / exact)
    assert frequency(data) == pytest.approx(exact, rel=0.01)


@pytest.mark.serial
def test_refused(tmp_path):
    file = two_groups(tmp_path, "triangle", 2)
    data = scene_of(file, 2)
    data["bodies"][1]["shape"] = {"file": file, "group": "hrad"}
    with pytest.raises(SceneError) as error:
        simulation(data)
    assert (
        len(error.value.faults) == 1
        and "bodies.1.shape.mesh.group" in error.value.faults[0]
        and "'hard'" in error.value.faults[0]
    )
    held = [{"plane": "Y = 0", "kind": "fixed", "body": "soft"}]
    with pytest.raises(SolverError):
        simulation(scene_of(file, 2, boundaries=held)).begin()


@pytest.mark.serial
def test_bars_of_two_meshes_that_are_tied_swing_as_one(tmp_path):
    """Meshes that do not match, triangles and quads: the first frequency as above, and the balance of energy."""
    from tlsph.test_mesh_weights import write

    for name, kind, scale, counts, shift in (
        ("left", "triangle", 0.125, (8, 4), 0.0),
        ("right", "quad", 0.1, (10, 5), 1.0),
    ):
        points, blocks = element_mesh(kind, counts, 0.2, scale)
        write(tmp_path / f"{name}.vtu", points + np.array((shift, 0.0)), blocks)
    c1, c2, z1, z2 = 1.0, float(np.sqrt(8.0 / 3.0)), 1.0, np.sqrt(24.0)
    exact = float(brentq(lambda w: np.tan(w / c1) * np.tan(w / c2) - z1 / z2, 1e-3, 1.0))
    top, slope = float(np.sin(exact / c1)), float(np.cos(exact / c2))
    shapes = [f"1e-3*sin({exact / c1!r}*X)", f"1e-3*{top!r}*cos({exact / c2!r}*(2 - X))/{slope!r}"]
    bodies = [
        {"name": name, "shape": {"file": str(tmp_path / f"{name}.vtu")}, "material": material, "velocity": [shape, "0"]}
        for name, material, shape in zip(("left", "right"), (SOFT, HARD), shapes)
    ]
    data = {"dimension": 2, "method": {"kind": "tlsph"}, "bodies": bodies, "tie": [{"bodies": ["left", "right"]}]}
    data |= {"boundaries": [{"plane": "X = 0", "kind": "fixed"}], "end_time": 1.3 * np.pi / exact}
    sim = simulation(data)
    assert sim.systems[0].body_weights == ["mesh", "mesh"]
    assert frequency(data) == pytest.approx(exact, rel=0.02)


@pytest.mark.serial
def test_the_short_form_of_a_mesh_takes_keys_of_the_long_one(tmp_path):
    file = two_groups(tmp_path, "triangle", 2)
    data = scene_of(file, 2)
    data["bodies"][0]["shape"]["mesh"] = {"scale": 2.0}
    model = parse_scene(data).bodies[0].shape.model
    assert (model.file, model.scale, model.group) == (file, 2.0, "soft")
