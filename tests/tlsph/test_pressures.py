"""Nearly incompressible bodies from meshes, whose pressures are unknowns: accuracy, tangent, ranks, stages."""

import numpy as np
import pytest
from solids import gathered, random_of, run_to_end, simulation
from tlsph.test_mesh_weights import RUBBER, of_mesh, write
from tlsph.test_stages import MOVING, STILL, run, staged
from tlsph.test_static import STRAIN, linear, static

STIFF = RUBBER | {"poissons_ratio": 0.4999}
LONG = {"integrator": "implicit", "accuracy": 1e-2}


def cook(folder, n, ratio):
    """Cook's membrane under 100 N on triangles of n x n squares; converged elements: 6.93 at Poisson's ratio .4999."""
    a, b = np.meshgrid(*[np.linspace(0.0, 1.0, n + 1)] * 2, indexing="ij")
    nodes = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    corners = np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]], axis=-1).reshape(-1, 4)
    odd = np.add.outer(range(n), range(n)).ravel() % 2 == 1
    halves = [(~odd, [0, 1, 2]), (~odd, [0, 2, 3]), (odd, [0, 1, 3]), (odd, [1, 2, 3])]
    cells = np.concatenate([corners[where][:, some] for where, some in halves])
    points = np.stack([48.0 * a.ravel(), (44.0 * a + b * (44.0 - 28.0 * a)).ravel()], axis=1)
    write(folder / f"cook{n}.vtu", points, [("triangle", cells)])
    law = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 240.565, "poissons_ratio": ratio}
    return {
        "dimension": 2,
        "end_time": 1.0,
        "method": {"kind": "tlsph", "integrator": "static", "stabilisation": 0.25},
        "bodies": [{"shape": {"mesh": {"file": str(folder / f"cook{n}.vtu")}}, "material": law}],
        "boundaries": [
            {"plane": "X = 0", "kind": "fixed"},
            {"plane": "X = 48", "kind": "traction", "traction": ["0", "6.25*t"]},
        ],
        "output": {"fields_interval": 1.0},
    }


def stiff_block(folder):
    """A block that is pressed and struck."""
    return of_mesh(folder, "triangle", 2, moving=0.0, body={"material": STIFF})


@pytest.mark.serial
def test_accuracy(shared_path, comm):
    """Cook's membrane within 1 %, in as many products whatever the stiffness of its volumes."""
    products = []
    for ratio in (0.4999, 0.499999):
        sim, rows = run_to_end(cook(shared_path, 8, ratio), comm)
        X, u = gathered(sim, "reference_position", "displacement")
        assert u[np.argmax(X.sum(axis=1)), 1] == pytest.approx(6.93, rel=1e-2)
        assert rows["strain_energy"][-1] == pytest.approx(rows["external_work"][-1], rel=5e-5)
        products.append(sim.systems[0].statics.most_products)
    assert max(products) < 1.2 * min(products)
    assert max(products) < 120


@pytest.mark.serial
@pytest.mark.parametrize("dimension", [2, 3])
def test_patch(shared_path, comm, dimension):
    """An even strain that changes no volume has the law's pressure everywhere, 0."""
    F = np.eye(3) + STRAIN
    F[:dimension, :dimension] /= np.linalg.det(F[:dimension, :dimension]) ** (1.0 / dimension)
    moved = [f"t*({one})" for one in linear(F - np.eye(3), dimension)]
    driven = [
        {"plane": f"{axis} = {place}", "kind": "displacement", "displacement": moved}
        for axis, length in zip("XYZ", (1.0, 1.0) if dimension == 2 else (1.25, 0.5, 0.5))
        for place in (0.0, length)
    ]
    data = static(shared_path, "mixed", dimension, method={"tolerance": 1e-11}, body={"material": STIFF})
    sim, _ = run_to_end(data | {"boundaries": driven}, comm)
    found, p = gathered(sim, "deformation_gradient", "pressure_unknown")
    assert np.abs(found.reshape(-1, dimension, dimension) - F[:dimension, :dimension]).max() < 1e-8
    # an even pressure is held by the compliance of volumes alone
    assert np.abs(p).max() < 1e-5


def test_tangent(shared_path, comm):
    """K is symmetric, and the derivative of the forces and of what pressures lack."""
    statics = simulation(cook(shared_path, 4, 0.4999), comm).systems[0].statics
    names = statics.system.particles.owned_rows("identifier")
    state, one, two = (random_of(names, 3, seed=seed) for seed in range(3))
    state[:, :2] *= 0.3
    statics.sought = (0.0, 1.0, 1.0)
    sides = [statics.evaluate(state + step * one).residual for step in (1e-4, -1e-4)]
    statics.evaluate(state)
    statics.linearise()
    K_one, K_two = statics.stiffness(one), statics.stiffness(two)
    assert comm.allreduce(np.vdot(two, K_one)) == pytest.approx(comm.allreduce(np.vdot(one, K_two)), rel=1e-10)
    difference = (sides[1] - sides[0]) / 2e-4
    np.testing.assert_allclose(np.where(statics.free, K_one, 0.0), difference, atol=1e-5 * np.abs(K_one).max())


@pytest.mark.serial
def test_stages(shared_path, comm):
    """A motion begins with the forces of equilibrium."""
    shape = stiff_block(shared_path)
    _, rows = run(staged(STILL, (1.0, MOVING), load=["0", "-0.1*min(t, 1)"], shape=shape, end_time=1.2), comm)
    assert rows["kinetic"].max() < 1e-14 * rows["strain_energy"].max()


@pytest.mark.ranks(1, 3)
def test_long_steps(shared_path, comm):
    """Motion in long steps keeps the energy, after equilibria and after explicit motion."""
    shape = stiff_block(shared_path)
    for stages in ((STILL, (1.0, LONG)), (MOVING, (0.1, LONG), (0.6, STILL))):
        _, rows = run(staged(*stages, shape=shape, end_time=1.0 + 0.5 * (len(stages) == 2)), comm)
        assert rows["kinetic"].max() > (1e-3 if len(stages) == 3 else -1.0) * rows["strain_energy"].max()
        assert np.abs(rows["energy_error"]).max() < 1e-6 * rows["strain_energy"].max()
