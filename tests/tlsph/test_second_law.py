"""The internal dissipation never falls and closes the ledger, however short the relaxation time beside the step."""

import numpy as np
import pytest
from solids import SOFT, column, punch, run_steps, simulation, supports, tables

SMALL = {2: lambda: punch((9, 9)), 3: lambda: column((3, 9, 3))}


def held(dimension: int, size: float = 1e-3) -> dict:
    """Strained alike everywhere, by so little that the rate decays as exp(-2 t/tau), and held by rollers all around."""
    strain = [-size, 1.5 * size, 0.5 * size][:dimension]
    gradient = [[str(1.0 + e if i == j else 0.0) for j in range(dimension)] for i, e in enumerate(strain)]
    planes = {f"{axis}{end}": (float(end), "roller") for axis in "XYZ"[:dimension] for end in (0, 1)}
    return tables(
        (5,) * dimension,
        material={**SOFT, "branches": [{"beta": 1.0, "tau": 1.0}]},
        body={
            "displacement": [f"{e}*{axis}" for e, axis in zip(strain, "XYZ")],
            "deformation_gradient": gradient,
        },
        boundaries=supports(**planes),
    )


def with_ratio(data: dict, ratio: float) -> dict:
    """Relaxation time over the first step; the step does not depend on it."""
    data["bodies"][0]["material"]["branches"][0]["tau"] = ratio * simulation(data).systems[0].stable_step()
    return data


@pytest.mark.parametrize("ratio", [1e-6, 0.03, 1.0, 1e3])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("integrator", ["ssp-rk3", "leapfrog"])
def test_internal_dissipation_never_falls(integrator, dimension, ratio):
    data = SMALL[dimension]()
    data["method"]["integrator"] = integrator
    _, columns = run_steps(with_ratio(data, ratio), 60)
    energy = columns["kinetic"][0]
    assert np.diff(columns["material_dissipation"]).min() >= 0.0
    assert np.abs(columns["energy_error"]).max() < 6e-3 * energy


@pytest.mark.parametrize("ratio", [1e-4, 0.2, 10.0])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("integrator", ["ssp-rk3", "leapfrog"])
def test_a_strained_start_relaxes_by_what_it_dissipates(integrator, dimension, ratio):
    data = held(dimension)
    data["method"]["integrator"] = integrator
    _, columns = run_steps(with_ratio(data, ratio), 4)
    assert columns["material_dissipation"][1] > 0.02 * columns["strain_energy"][0] / (1.0 + ratio)
    assert np.abs(columns["energy_error"]).max() < 1e-3 * columns["strain_energy"][0]


def test_leapfrog_closes_the_punch_to_a_ten_thousandth_at_its_usual_step():
    # rates of both ends alone, by the trapezium rule, took 1.5e-4 more than branches lose
    data = punch((17, 17))
    data["method"].update(integrator="leapfrog", weights="fourth-order")
    _, columns = run_steps(data, 240)
    assert np.diff(columns["material_dissipation"]).min() >= 0.0
    assert np.abs(columns["energy_error"]).max() < 1e-4 * columns["kinetic"][0]


@pytest.mark.parametrize("ratio, most", [(1e-4, 0.02), (0.2, 0.016), (1.0, 2e-4)])
def test_a_start_of_large_strain_is_not_exact(ratio, most):
    """Strains of -10 and 15 %: the rate is no longer a multiple of exp(-2 s/tau)."""
    _, columns = run_steps(with_ratio(held(2, 0.1), ratio), 4)
    found = np.abs(columns["energy_error"]).max() / columns["strain_energy"][0]
    assert 0.5 * most < found < most


def test_the_step_of_plane_strain_is_that_of_waves_in_the_plane():
    # stretched alike in both directions
    material = {**SOFT, "branches": []}
    data = tables((5, 5), material=material, body={"displacement": ["X", "Y"]})
    sim = simulation(data)
    law = sim.systems[0].blocks[0].law
    mu, J = 2.0 * law.xi, 4.0
    # cofactor: 2 in the plane, 4 across it, where waves would be fastest
    modulus = mu + (law.lambda_hat + mu / J**2) * 2.0**2
    assert sim.systems[0].stable_step() == pytest.approx(0.7 * 0.25 * np.sqrt(law.density / modulus), rel=1e-12)
