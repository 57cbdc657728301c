"""What a run leaves in its folder says the same thing everywhere."""

import h5py
import numpy as np
import pytest
from cases import cases
from run_results import history, states

from parsolid.output import vtkhdf
from parsolid.scene.observation import stored_energy
from parsolid.simulation.ledger import terms_of


@pytest.mark.ranks(1)
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


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", cases())
def test_the_ledger_adds_up(runs, name):
    """Energy that is there, has left or was supplied: what is missing of it is the column of the error."""
    run = runs.whole(name)
    columns, signs = run.columns, terms_of(runs.scene(name))
    total = columns["kinetic"] + columns[stored_energy(columns)] - columns["external_work"]
    total = total + columns["material_dissipation"] + columns["numerical_dissipation"]
    total = total + sum(sign * columns[term] for term, sign in signs.items())
    np.testing.assert_allclose(total - total[0], columns["energy_error"], rtol=0.0, atol=1e-9 * run.largest_energy)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", cases("fields"))
def test_the_last_fields_are_those_of_the_checkpoint(runs, name):
    run = runs.whole(name)
    (fields,), (layout, times) = states(run.folder)[1], vtkhdf.published(run.folder / "fields.vtkhdf")
    assert len(times) > 2 and times[-1] == history(run.folder)["time"][-1]

    with h5py.File(run.folder / "fields.vtkhdf") as file:
        points = file["VTKHDF/Points"][-layout.particles :]
    order = np.argsort(fields["identifier"])
    np.testing.assert_array_equal(points[:, : fields["position"].shape[1]], fields["position"][order])


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", cases())
def test_what_has_failed_is_counted(runs, name):
    run = runs.whole(name)
    damage = [fields["damage"] for fields in states(run.folder)[1] if "damage" in fields]
    if "failed_particles" in run.summary:
        assert run.summary["failed_particles"] == sum(int((one >= 1.0).sum()) for one in damage)
