"""Bodies of several methods that never meet: each moves as in a scene of its own, to the bit, on any ranks."""

import h5py
import numpy as np
import pytest
from mixed.bodies_apart import METHODS, alone, mixed
from mpi4py import MPI
from solids import Record, follow, run_into

from parsolid.output.history import read_history
from parsolid.output.results import Results
from parsolid.output.vtkhdf import collected, published
from parsolid.scene import dump_scene
from parsolid.scene.observation import STORED_ENERGY, stored_energy
from parsolid.simulation.loop import Simulation


def state(system) -> dict[str, np.ndarray]:
    return {name: np.array(rows) for name, rows in system.particles.checkpointed().items()}


def test_each_body_is_what_it_is_alone(comm):
    together = Simulation(comm, mixed())
    rows = follow(together, Record(), 20)
    assert [system.name for system in together.systems] == list(METHODS)
    sums = dict.fromkeys(rows, 0.0)
    for number, name in enumerate(METHODS):
        single = Simulation(comm, alone(name))
        for column, values in follow(single, Record(), 20).items():
            # the same term has another sign in another method
            name_together = stored_energy(rows) if column in STORED_ENERGY else column
            sums[name_together] = sums[name_together] + values
        wanted, found = state(single.systems[0]), state(together.systems[number])
        shift = found.pop("identifier") - wanted.pop("identifier")
        assert np.all(shift == 64 * number) and list(found) == list(wanted)
        different = [one for one in wanted if found[one].tobytes() != wanted[one].tobytes()]
        assert not different, f"{name}: {different}"
    for column in ("kinetic", stored_energy(rows), "material_dissipation", "external_work", "energy_error"):
        scale = 1e-12 * rows["kinetic"].max()
        np.testing.assert_allclose(rows[column], sums[column], rtol=0.0, atol=scale, err_msg=column)
    assert abs(rows[stored_energy(rows)][-1]) > 1e-4 * rows["kinetic"][0]


PAIR = ("soft", "metal")
SHOWN = {"fields_times": [0.0, 2e-5], "fields": ["velocity", "temperature", "plastic_strain"]}
OUTPUT = {"output": {"history_steps": 1, "checkpoint_steps": 10} | SHOWN}
PROBES = [
    {"name": "corner", "at": [1.0, 1.0], "fields": ["displacement"]},
    {"name": "flow", "at": [7.0, 1.0], "fields": ["density", "temperature"]},
    {"name": "all", "quantity": "centre_of_mass"},
    {"name": "hottest", "quantity": "maximum_temperature"},
]


def test_each_method_has_a_block_of_fields(comm, shared_path):
    scene = mixed(PAIR, probes=PROBES, **OUTPUT)
    summary = run_into(shared_path / "run", comm, scene).summary("finished")
    assert [row["particles"] for row in summary["systems"]] == [64, 64] and summary["method"] == "tlsph and mpm"
    if comm.rank > 0:
        return
    history = read_history(shared_path / "run" / "history.csv")
    assert len(history["step"]) == 21
    assert history["flow.density"][-1] > 1000.0 and history["hottest.maximum_temperature"][-1] > 290.0
    files = collected(shared_path / "run" / "fields.vtkhdf")
    assert list(files) == list(PAIR)
    for number, (name, path) in enumerate(files.items()):
        layout, times = published(path)
        assert times.tolist() == [0.0, 2e-5, 4e-5] and layout.particles == 64
        assert ("plastic_strain" in layout.varying) == (name == "metal")
        with h5py.File(shared_path / "run" / "fields.vtkhdf") as file:
            block = file[f"VTKHDF/Assembly/{name}/{name}"]
            assert block.attrs["Index"] == number and block["Steps"].attrs["NSteps"] == 3
            ids = block["PointData/identifier"][()]
            assert np.array_equal(ids, np.arange(64 * number, 64 * (number + 1)))
            place = block["Points"][:64]
            assert place[0, 0] == pytest.approx(6.0625 if number else 0.0)


def test_pictures_show_all_blocks(tmp_path):
    scene = mixed(PAIR, **OUTPUT)
    run_into(tmp_path / "run", MPI.COMM_SELF, scene)
    dump_scene(scene, tmp_path / "run" / "scene.toml")
    results = Results(tmp_path / "run")
    assert results.particles == 128 and "plastic_strain" in results.field_names
    (frame,) = results.frames([2], "temperature")
    assert frame.position.shape == (128, 3)
    assert np.isnan(frame.values[:64]).all() and (frame.values[64:] > 290.0).all()
    assert results.rows("body").tolist() == [0] * 64 + [1] * 64
    assert any("plastic_strain" in one.pictured_fields for one in results.methods) and len(results.bodies) == 2
