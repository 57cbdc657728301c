"""The tangent's product against differences of the forces; its symmetry."""

import numpy as np
import pytest
from solids import simulation, tables
from tlsph.test_mesh_weights import of_mesh

from parsolid.methods.tlsph.tangent import Tangent

YEOH = {"kind": "yeoh", "density": 1.1, "c1": 0.5, "c2": 0.05, "bulk_modulus": 3.0}


def smooth(X, seed):
    """Numbers like X that vary from place to place, the same on any number of ranks."""
    axes = np.arange(X.shape[1])
    return np.sin(3.0 * X @ (0.7 + np.cos(seed + axes[:, None] + 2.0 * axes)) + seed)


def deformed(sim, u):
    """Forces (owned, d) of a displacement."""
    system = sim.systems[0]
    of, d = system.particles.owned_rows, system.dimension
    of("position")[:] = of("reference_position") + u
    of("deformation_gradient")[:] = np.eye(d).ravel() + system.displacement_gradient().reshape(-1, d * d)
    system.leapfrog.evaluate()
    return of("stress_force") * system.share[:, None]


def bodies(folder, case):
    if case == "mesh":
        return of_mesh(folder, "mixed", 3, body={"material": YEOH}, method={"dissipation": 0.0})
    method = {"integrator": "leapfrog", "weights": case, "dissipation": 0.0}
    return tables((9, 8), method=method, boundaries=[{"plane": "X = 0", "kind": "fixed"}])


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("case", ["mesh", "cells", "fourth-order"])
def test_tangent(shared_path, comm, case):
    """It is minus the derivative of the forces, that of the stabiliser of boxes among them, and symmetric for what
    supports leave free."""
    sim = simulation(bodies(shared_path, case), comm)
    system = sim.systems[0]
    tangent, X = Tangent(system), np.array(system.particles.owned_rows("reference_position"))
    u, du, dv = (np.where(tangent.free, smooth(X, seed), 0.0) for seed in (1, 2, 3))
    u, h = 0.05 * u, 1e-4
    near = deformed(sim, u + h * du) - deformed(sim, u - h * du)
    far = deformed(sim, u + 2 * h * du) - deformed(sim, u - 2 * h * du)
    expected = (far - 8.0 * near) / (12.0 * h)
    if tangent.stabiliser is not None:
        tangent.stabiliser.add_product(du, expected)
    deformed(sim, u)
    tangent.linearise()
    found, other = tangent.product(du), tangent.product(dv)
    size = comm.allreduce(float(np.abs(expected).max(initial=0.0)), max)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * size)
    forth, back = comm.allreduce(float(np.vdot(found, dv))), comm.allreduce(float(np.vdot(other, du)))
    assert forth == pytest.approx(back, rel=1e-12)
