"""Hyperelastic laws: the stress is that of the deformation gradient that particles carry."""

import numpy as np
import pytest
from solids import simulation
from ulsph.plates import block, scene
from ulsph.test_tension import mean_stress, pulled

from parsolid.materials import registry
from parsolid.materials.hyperelastic import evaluation
from parsolid.observables.declared import Observables

RUBBER = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}


@pytest.mark.parametrize(
    "particles, upper, strain, error",
    [((20, 10), (1.0, 0.5), 0.5, 0.02), ((10, 5, 5), (1.0, 0.5, 0.5), 0.3, 0.04)],
)
def test_a_pulled_block_has_the_stress_of_the_law(particles, upper, strain, error, comm):
    """But for waves, and 10 particles along an edge in space (3.1 %); the artificial viscosity has next to nothing of
    the energy."""
    data = pulled(particles, upper, 1.0, strain)
    data["bodies"][0]["material"] = RUBBER
    sim = simulation(data, comm)
    sim.run()
    F = np.diag([1.0 + strain, 1.0, 1.0])
    sigma = evaluation.stresses(registry.law_of(sim.scene.bodies[0].material), F) @ F.T / F[0, 0]
    assert mean_stress(comm, sim.systems[0]) == pytest.approx(sigma[0, 0], rel=error)
    row = sim.energy_row()
    assert row["viscous_dissipation"] < 1e-3 * row["strain_energy"]
    assert abs(row["energy_error"]) < 1e-3 * row["strain_energy"]


@pytest.mark.serial
def test_a_block_that_turns_has_no_stress_of_its_turn(comm):
    """Driven through a right angle, in 32 steps."""
    body = block([4, 4, 4], [1.0, 1.0, 1.0], RUBBER)
    everywhere = {"lower": [-9.0] * 3, "upper": [9.0] * 3}
    turn = {"kind": "rotation", "box": everywhere, "centre": [0.5] * 3, "axis": [1.0, 2.0, 3.0], "angle": "pi/2*t"}
    sim = simulation(scene(body, end_time=1.0, boundaries=[turn]), comm)
    for _ in range(32):
        sim.take_step(1.0 / 32)
    fields = Observables(sim.systems)
    F = np.reshape(fields.field("deformation_gradient"), (-1, 3, 3))
    np.testing.assert_allclose(F.swapaxes(1, 2) @ F, np.tile(np.eye(3), (len(F), 1, 1)), atol=1e-9)
    # at corners the correction of gradients is bounded, and F turns less
    middle = np.abs(sim.systems[0].particles.owned_rows("reference_position") - 0.5).max(axis=1) < 0.2
    np.testing.assert_allclose(np.trace(F[middle], axis1=1, axis2=2), 1.0, atol=1e-2)
    assert np.abs(fields.field("stress")).max() < 1e-2
