"""Energy is accounted for, dissipation is never given back, and momenta that nothing acts on are kept."""

import numpy as np
import pytest
from cases import CASES, cases

# what is only ever lost
LOST = (
    "friction_dissipation",
    "contact_dissipation",
    "failure_dissipation",
    "softening_dissipation",
    "deleted_kinetic",
)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", cases())
def test_energy_is_accounted_for(runs, name):
    case, run = CASES[name], runs.whole(name)
    assert np.abs(run.columns["energy_error"]).max() <= case.balance * run.largest_energy
    for column in case.grows:
        assert run.columns[column].max() > 1e-4 * run.largest_energy, column


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", cases())
def test_dissipation_is_never_given_back(runs, name):
    run = runs.whole(name)
    lost = {column: run.columns[column] for column in LOST if column in run.columns}
    if "plastic_work" in run.columns:
        # a back stress stores a part of the work, and gives it back as the flow turns
        lost["plastic_work"] = run.columns["plastic_work"] - run.columns.get("back_stress_energy", 0.0)
    for column, values in lost.items():
        assert np.diff(values).min() >= -1e-12 * run.largest_energy, column


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", cases("free"))
def test_momentum_is_kept(runs, name):
    momentum = runs.whole(name).columns["momentum"]
    assert np.abs(momentum - momentum[0])[:, :3].max() < CASES[name].momentum * momentum[:, 3].max()


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", cases("turns"))
def test_angular_momentum_is_kept(runs, name):
    angular = runs.whole(name).columns["angular"]
    assert np.abs(angular - angular[0])[:, :3].max() < CASES[name].angular * angular[:, 3].max()
