"""A stress that no deformation has made: it turns with the matter, has an energy, holds ground against its weight."""

import numpy as np
import pytest
from solids import evaluate, gathered, random_of, run_steps, simulation, tables

from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.observables.declared import field_of
from parsolid.scene import SceneError, parse_scene

S0 = np.array([[0.3, 0.1], [0.1, -0.2]])
STRESSED = {"initial": [{"stress": [["0.3", "0.1"], ["0.1", "-0.2"]]}]}
TURN = 0.7
R = np.array([[np.cos(TURN), -np.sin(TURN)], [np.sin(TURN), np.cos(TURN)]])
MOVING = {"velocity": ["0.1*sin(pi*X)*Y", "-0.1*Y*(1 + X)"]}


def test_it_turns_with_the_matter():
    place = [f"{R[i, 0] - (i == 0)}*X + {R[i, 1] - (i == 1)}*Y" for i in range(2)]
    turned = {"displacement": place, "deformation_gradient": R.tolist()}
    system = simulation(tables((5, 5), body=turned, **STRESSED)).systems[0]
    stress = field_of(system, "stress")[:, :2, :2]
    assert np.abs(stress - R @ S0 @ R.T).max() < 1e-14


@pytest.mark.parametrize("integrator", ["ssp-rk3", "leapfrog"])
def test_its_energy_is_the_work_of_its_forces(integrator):
    """Third order in the step with stages, second without, and the forces are those of the energy."""
    off = []
    for steps in (10, 20):
        sim = simulation(tables((6, 5), method={"integrator": integrator}, body=MOVING, **STRESSED))
        kinetic = sum(sim.systems[0].energies())
        sim.ledger.row(sim.comm, *sim.energies())
        for _ in range(steps):
            sim.take_step(0.2 / steps)
        row = sim.ledger.row(sim.comm, *sim.energies())
        off.append(abs(row["energy_error"]) / kinetic)
    assert off[1] < 5e-4 and off[0] / off[1] > (6.0 if integrator == "ssp-rk3" else 3.5)


def test_its_power_is_the_change_of_its_energy():
    sim = simulation(tables((4, 4, 4), initial=[{"stress": [[1, "X", 0], ["X", -1, 0.5], [0, 0.5, "Z"]]}]))
    system = sim.systems[0]
    rows, part = system.particles.owned_rows, system.initial_stress
    rows("velocity")[:] = random_of(rows("identifier"), 3)
    F = rows("deformation_gradient")
    F[:] += 0.1 * random_of(rows("identifier"), 9, seed=1)
    with_it = evaluate(sim)
    kept, energies = F.copy(), []
    for way in (1.0, -1.0):
        F[:] = kept + way * 1e-4 * with_it["gradient"].reshape(F.shape)
        energies.append(part.energy())
    F[:] = kept
    rows("initial_stress")[:] = 0.0
    force = with_it["T"] - evaluate(sim)["T"]
    power = -(force * rows("velocity")).sum()
    assert power == pytest.approx((energies[0] - energies[1]) / 2e-4, rel=1e-9)


def ground(**keys) -> dict:
    """A column of ground 10 high under its weight, a unit of stress at its foot."""
    planes = [{"kind": "roller", "plane": plane} for plane in ("Y = 0", "X = 0", "X = 4")]
    return tables(
        (5, 11), [4.0, 10.0], boundaries=planes, end_time=50.0, loads={"acceleration": [0, "-0.1/1.1"]}, **keys
    )


def test_ground_stays_where_it_is(comm):
    """Over three times in which waves run through it, by a hundredth of what it would settle by without its stress."""
    stress = {"initial": [{"stress": [["-0.05*(10 - Y)", 0], [0, "-0.1*(10 - Y)"]]}]}
    sim, _ = run_steps(ground(**stress), 45, comm)
    X, x = gathered(sim, "reference_position", "position")
    modulus = elastic_moduli(sim.systems[0].laws[0])[1] + 2.0 * elastic_moduli(sim.systems[0].laws[0])[0]
    assert sim.clock.time > 15.0
    assert 0.0 < np.abs(x - X).max() < 0.01 * 0.1 * 10.0**2 / (2.0 * modulus)


@pytest.mark.parametrize(
    "more, stress, words",
    [
        ({}, [[1, 2], [3, 1]], r"initial\.0\.stress\.1\.0: expected a symmetric tensor, as 2 in row 1, column 2"),
        ({"method": {"kind": "peridynamics"}}, [[1, 0], [0, 1]], r"initial\.0\.stress: expected no such key"),
    ],
)
def test_what_no_run_can_start_from_is_refused(more, stress, words):
    with pytest.raises(SceneError, match=words):
        parse_scene(tables((5, 5), initial=[{"stress": stress}], **more))
