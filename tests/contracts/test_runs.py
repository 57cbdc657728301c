"""Of a run of every scene: its energy is accounted for, momenta that nothing acts on are kept, and what it leaves in
its folder says the same thing everywhere."""

import h5py
import numpy as np
import pytest
from cases import CASES, cases
from run_results import history, states

from parsolid.output import vtkhdf
from parsolid.scene.observation import stored_energy
from parsolid.simulation.ledger import terms_of

pytestmark = pytest.mark.ranks(1)
# what is only ever lost
LOST = (
    "friction_dissipation",
    "contact_dissipation",
    "failure_dissipation",
    "softening_dissipation",
    "deleted_kinetic",
)


@pytest.mark.parametrize("name", cases())
def test_energy_is_accounted_for(runs, name):
    case, run = CASES[name], runs.whole(name)
    assert np.abs(run.columns["energy_error"]).max() <= case.balance * run.largest_energy
    for column in case.grows:
        assert run.columns[column].max() > 1e-4 * run.largest_energy, column


@pytest.mark.parametrize("name", cases())
def test_dissipation_is_never_given_back(runs, name):
    run = runs.whole(name)
    lost = {column: run.columns[column] for column in LOST if column in run.columns}
    if "plastic_work" in run.columns:
        # a back stress stores a part of the work, and gives it back as the flow turns
        lost["plastic_work"] = run.columns["plastic_work"] - run.columns.get("back_stress_energy", 0.0)
    for column, values in lost.items():
        assert np.diff(values).min() >= -1e-12 * run.largest_energy, column


@pytest.mark.parametrize("name", cases("free"))
def test_momentum_is_kept(runs, name):
    momentum = runs.whole(name).columns["momentum"]
    assert np.abs(momentum - momentum[0])[:, :3].max() < CASES[name].momentum * momentum[:, 3].max()


@pytest.mark.parametrize("name", cases("turns"))
def test_angular_momentum_is_kept(runs, name):
    angular = runs.whole(name).columns["angular"]
    assert np.abs(angular - angular[0])[:, :3].max() < CASES[name].angular * angular[:, 3].max()


@pytest.mark.parametrize("name", cases())
def test_history_summary_and_checkpoint_are_of_one_run(runs, name):
    run = runs.whole(name)
    columns, (header, systems, _) = history(run.folder), states(run.folder)
    assert all(np.isfinite(values).all() for values in columns.values())
    assert columns["step"].tolist() == list(range(len(columns["step"]))) and np.diff(columns["time"]).min() >= 0.0
    for column in set(columns) & set(run.columns):
        np.testing.assert_array_equal(columns[column], run.columns[column], err_msg=column)
    assert (header["step"], header["time"]) == (columns["step"][-1], columns["time"][-1])
    assert run.summary["steps"] == header["step"]
    assert sum(len(fields["identifier"]) for fields in systems) == run.summary["particles"] == header["particles"]
    assert all(np.isfinite(values).all() for fields in systems for values in fields.values())


@pytest.mark.parametrize("name", cases())
def test_the_ledger_adds_up(runs, name):
    """Energy that is there, has left or was supplied: what is missing of it is the column of the error."""
    run = runs.whole(name)
    columns, signs = run.columns, terms_of(runs.scene(name))
    total = columns["kinetic"] + columns[stored_energy(columns)] - columns["external_work"]
    total = total + columns["material_dissipation"] + columns["numerical_dissipation"]
    total = total + sum(sign * columns[term] for term, sign in signs.items())
    np.testing.assert_allclose(total - total[0], columns["energy_error"], rtol=0.0, atol=1e-9 * run.largest_energy)


@pytest.mark.parametrize("name", cases("fields"))
def test_the_last_fields_are_those_of_the_checkpoint(runs, name):
    run = runs.whole(name)
    (fields,), (layout, times) = states(run.folder)[1], vtkhdf.published(run.folder / "fields.vtkhdf")
    assert len(times) > 2 and times[-1] == history(run.folder)["time"][-1]

    with h5py.File(run.folder / "fields.vtkhdf") as file:
        points = file["VTKHDF/Points"][-layout.particles :]
    order = np.argsort(fields["identifier"])
    np.testing.assert_array_equal(points[:, : fields["position"].shape[1]], fields["position"][order])


@pytest.mark.parametrize("name", cases())
def test_what_has_failed_is_counted(runs, name):
    run = runs.whole(name)
    damage = [fields["damage"] for fields in states(run.folder)[1] if "damage" in fields]
    if "failed_particles" in run.summary:
        assert run.summary["failed_particles"] == sum(int((one >= 1.0).sum()) for one in damage)
