"""Weights of a mesh: patch tests, rigid motion, conservation for every kind of elements; ranks, restarts, accuracy."""

import meshio
import numpy as np
import pytest
from element_meshes import KINDS, element_mesh
from mpi4py import MPI
from ranks import first_on_ranks
from solids import gathered, random_of, run_to_end, simulation, tables

from parsolid.scene import SceneError, parse_scene

COUNTS = {2: (4, 4), 3: (5, 2, 2)}
ALL = [(d, kind) for d in KINDS for kind in KINDS[d]]
RUBBER = {"kind": "mooney-rivlin", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
F = np.array([[1.2, 0.1, -0.2], [0.3, 0.9, 0.1], [-0.1, 0.2, 1.1]])
TURN = np.linalg.qr(F)[0] * np.sign(np.diag(np.linalg.qr(F)[1]))


def write(file, points, blocks):
    """A mesh file, by one rank."""
    if MPI.COMM_WORLD.rank == 0:
        full = np.zeros((len(points), 3))
        full[:, : points.shape[1]] = points
        meshio.write(file, meshio.Mesh(full, blocks))
    MPI.COMM_WORLD.Barrier()


def of_mesh(folder, kind, dimension, scale=0.25, counts=None, moving=0.3, body=None, method=None, **rest):
    """Raw tables of a body of elements of a kind."""
    file = folder / f"{kind}{dimension}.vtu"
    write(file, *element_mesh(kind, counts or COUNTS[dimension], moving, scale))
    return {
        "dimension": dimension,
        "end_time": 0.5,
        "method": {"kind": "tlsph", "weights": "mesh", "integrator": "leapfrog", "dissipation": 0.1, **(method or {})},
        "bodies": [{"shape": {"mesh": {"file": str(file)}}, "material": RUBBER, **(body or {})}],
        **rest,
    }


def linear(matrix, dimension, shift=0.0):
    """Formulas of (matrix) X + shift."""
    names = "XYZ"[:dimension]
    rows = matrix[:dimension, :dimension]
    return [" + ".join(f"({a:.17g})*{X}" for a, X in zip(row, names)) + f" + {shift}" for row in rows]


def forces(sim):
    """T and D [N] of the present state, of all particles."""
    sim.systems[0].leapfrog.evaluate()
    return gathered(sim, "stress_force", "dissipative_force")


@pytest.mark.parametrize(("dimension", "kind"), first_on_ranks(ALL))
def test_patch(shared_path, comm, dimension, kind):
    """A linear displacement has its gradient everywhere, and the forces are those of its tractions."""
    data = of_mesh(shared_path, kind, dimension, body={"displacement": linear(F - np.eye(3), dimension)})
    sim = simulation(data, comm)
    gradient, area = gathered(sim, "deformation_gradient", "area")
    np.testing.assert_allclose(gradient.reshape(-1, dimension, dimension) - F[:dimension, :dimension], 0.0, atol=3e-14)
    T, D = forces(sim)
    stress = sim.systems[0].shown("first_piola_kirchhoff_stress", 0, sim.systems[0].owned)
    P = comm.bcast(stress[0] if len(stress) else None, 0)[:dimension, :dimension]
    np.testing.assert_allclose(T + area @ P.T, 0.0, atol=1e-13)
    np.testing.assert_allclose(D, 0.0, atol=1e-14)
    # of a uniform state the scheme stores nothing
    assert comm.allreduce(sim.systems[0].meshes.stabiliser_energy()) == pytest.approx(0.0, abs=1e-14)


@pytest.mark.serial
@pytest.mark.parametrize(("dimension", "kind"), ALL)
def test_volumes_areas_and_masses(shared_path, comm, dimension, kind):
    sim = simulation(of_mesh(shared_path, kind, dimension), comm)
    volume, area, mass, X = gathered(sim, "volume", "area", "mass", "reference_position")
    size = np.prod(COUNTS[dimension]) * 0.25**dimension
    assert volume.sum() == pytest.approx(size, rel=1e-13)
    np.testing.assert_allclose(area.sum(axis=0), 0.0, atol=1e-14)
    assert np.sum(area * X) == pytest.approx(dimension * size, rel=1e-13)
    assert mass.sum() == pytest.approx(1.1 * size, rel=1e-13)
    # corrected masses have the volume's centre, and less error of the second moments than its lumped ones
    middle = np.array(COUNTS[dimension]) * 0.125
    np.testing.assert_allclose(mass @ (X - middle), 1.1 * volume @ (X - middle), atol=1e-13)
    exact = size * (2.0 * middle) ** 2 / 12.0
    error = np.abs(mass @ (X - middle) ** 2 / 1.1 - exact)
    assert (error < 0.7 * np.abs(volume @ (X - middle) ** 2 - exact)).all()
    assert (mass > 0.4 * 1.1 * volume).all()


@pytest.mark.serial
@pytest.mark.parametrize(("dimension", "kind"), ALL)
def test_rigid_motion(shared_path, comm, dimension, kind):
    """A body that is turned and moves has no stress, no dissipation, and no energy of the scheme."""
    turn = np.eye(3)
    turn[:dimension, :dimension] = TURN[:dimension, :dimension] if dimension == 3 else [[0.6, -0.8], [0.8, 0.6]]
    spin = np.array([[0.0, -1.0, 0.3], [1.0, 0.0, -0.2], [-0.3, 0.2, 0.0]])
    motion = {"displacement": linear(turn - np.eye(3), dimension), "velocity": linear(spin @ turn, dimension, 2.0)}
    sim = simulation(of_mesh(shared_path, kind, dimension, body=motion), comm)
    T, D = forces(sim)
    np.testing.assert_allclose(T, 0.0, atol=1e-13)
    np.testing.assert_allclose(D, 0.0, atol=1e-13)
    assert comm.allreduce(sim.systems[0].energies()[1]) == pytest.approx(0.0, abs=1e-13)


@pytest.mark.parametrize(("dimension", "kind"), [(2, "mixed"), (3, "mixed")])
def test_forces_are_the_derivative_of_the_energy(shared_path, comm, dimension, kind):
    """T is the negative derivative of the stored energy, along any motion of the particles from any state."""
    sim = simulation(of_mesh(shared_path, kind, dimension), comm)
    system = sim.systems[0]
    of = system.particles.owned_rows
    one, two = (0.02 * random_of(of("identifier"), dimension, seed=seed) for seed in (1, 2))

    def energy(along):
        of("position")[:] = of("reference_position") + one + along * two
        of("deformation_gradient")[:] = np.eye(dimension).ravel()
        system.complete_strain(np.ones(system.owned, bool))
        system.meshes.begin()
        return comm.allreduce(system.energies()[1])

    step = 1e-4
    slope = (energy(step) - energy(-step)) / (2.0 * step)
    energy(0.0)
    T, _ = forces(sim)
    (direction,) = (comm.allreduce(float(np.sum(of("stress_force") * two))),)
    assert direction == pytest.approx(-slope, rel=1e-6)
    np.testing.assert_allclose(T.sum(axis=0), 0.0, atol=1e-13)


@pytest.mark.serial
@pytest.mark.parametrize("dissipation", [0.0, 0.3])
def test_large_strains_keep_energy_to_the_third_order_of_the_step(shared_path, comm, dissipation):
    """Velocity Verlet alone leaves 2.9e-3, and a quarter of it at half the step."""
    body = {"velocity": ["0", "1.5*(X-1)*(Z-.375)", "-1.5*(X-1)*(Y-.375)"]}
    errors = []
    for safety in (0.9, 0.45):
        method = {"safety": safety, "dissipation": dissipation}
        data = of_mesh(shared_path, "tetra", 3, counts=(8, 3, 3), body=body, end_time=3.0, method=method)
        _, rows = run_to_end(data, comm)
        errors.append(np.abs(rows["energy_error"]).max() / rows["kinetic"][0])
    assert errors[0] < 1e-3 and errors[1] < errors[0] / 6.0


# --- accuracy ----------------------------------------------------------------------------------------------------


def swung_bar(folder, kind, cells):
    """Relative error of the period of a clamped bar's first longitudinal wave, of Poisson's ratio 0."""
    length, waves = 4.0, 1.0
    body = {"velocity": [f"1e-3*sin(pi*X/{2 * length})", "0"]}
    data = of_mesh(
        folder, kind, 2, scale=length / cells, counts=(cells, cells // 4), moving=0.25, body=body,
        boundaries=[{"plane": "X = 0", "kind": "fixed"}], end_time=1.25 * length / waves * 4.0,
    )  # fmt: skip
    material = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.0}
    data["bodies"][0]["material"] = material
    _, rows = run_to_end(data)
    kinetic, time = rows["kinetic"], rows["time"]
    # the kinetic energy is largest again after a half period, 2 L/c
    half = time > 1.0 * length
    top = np.argmax(np.where(half & (time < 3.0 * length), kinetic, 0.0))
    a, b, c = kinetic[top - 1 : top + 2]
    step = time[top + 1] - time[top]
    found = time[top] + 0.5 * step * (a - c) / (a - 2.0 * b + c)
    return abs(found / (2.0 * length) - 1.0)


@pytest.mark.parametrize("kind", ["triangle", "quad", "mixed"])
def test_period_of_a_bar(tmp_path, kind):
    coarse, fine = (swung_bar(tmp_path, kind, cells) for cells in (8, 16))
    assert fine < 0.005 and fine < 0.5 * coarse


# --- what is refused ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"method": {"integrator": "ssp-rk3"}}, "method.integrator"),
        ({"method": {"reference": "updated", "update_when": 0.1}}, "method.weights"),
        ({"body": {"placement": "cells"}}, "bodies.0.placement"),
        ({"body": {"jitter": 0.1}}, "bodies.0.jitter"),
        ({"body": {"deformation_gradient": [["1.1", "0"], ["0", "1"]]}}, "bodies.0.deformation_gradient"),
    ],
)
def test_refused(tmp_path, change, key):
    with pytest.raises(SceneError) as error:
        parse_scene(of_mesh(tmp_path, "triangle", 2, **change))
    assert any(key in fault for fault in error.value.faults)


def test_elements_of_second_order_are_taken_by_their_corners(tmp_path):
    points, blocks = element_mesh("triangle", (3, 2), 0.2)
    cells = blocks[0][1]
    middles = 0.5 * (points[cells] + points[cells[:, [1, 2, 0]]])
    full = np.concatenate([points, middles.reshape(-1, 2)])
    six = np.concatenate([cells, len(points) + np.arange(3 * len(cells)).reshape(-1, 3)], axis=1)
    data = of_mesh(tmp_path, "triangle", 2, counts=(3, 2), moving=0.2, scale=1.0)
    plain = simulation(data).systems[0]
    write(tmp_path / "six.vtu", full, [("triangle6", six)])
    data["bodies"][0]["shape"]["mesh"]["file"] = str(tmp_path / "six.vtu")
    system = simulation(data).systems[0]
    for name in ("volume", "mass", "area"):
        np.testing.assert_allclose(system.particles.owned_rows(name), plain.particles.owned_rows(name), atol=1e-15)
    assert system.cost_notes() and not plain.cost_notes()


@pytest.mark.serial
@pytest.mark.parametrize(
    ("kind", "ratio", "integrator", "told"),
    [
        ("mesh", 0.45, "leapfrog", 0),
        ("mesh", 0.49, "leapfrog", 1),
        ("mesh", 0.49, "static", 0),
        ("box", 0.49, "leapfrog", 0),
        ("box", 0.45, "static", 0),
        ("box", 0.46, "static", 1),
    ],
)
def test_nearly_incompressible_bodies_without_pressures_as_unknowns_are_warned_of(
    tmp_path, kind, ratio, integrator, told
):
    """Meshes have such in equilibrium."""
    body = {"material": RUBBER | {"poissons_ratio": ratio}}
    data = of_mesh(tmp_path, "triangle", 2, body=body) if kind == "mesh" else tables((9, 9), (1.0, 1.0), body=body)
    data["method"] = {"kind": "tlsph", "integrator": integrator}
    data["boundaries"] = [{"kind": "fixed", "plane": "X = 0"}]
    warned = [one for one in simulation(data).warnings if one.code == "too-stiff"]
    assert len(warned) == told and all("bodies.0" in one.text for one in warned)
