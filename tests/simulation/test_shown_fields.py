"""A field that is declared as shown is written and told by `check`; a scene names what the settings of methods list."""

import h5py
import numpy as np
import pytest
from grouped_meshes import block
from solids import simulation, tables

from parsolid.api.report import report_of
from parsolid.methods.tlsph import system
from parsolid.methods.tlsph.settings import TotalLagrangianSPH
from parsolid.observables.declared import Observables, field_of
from parsolid.output.run_folder import RunFolder
from parsolid.particles.declaration import Field
from parsolid.scene import SceneError, parse_scene
from parsolid.simulation.field_output import FieldOutput
from parsolid.simulation.history import Probes

USUAL = ["displacement", "velocity", "pressure", "von_mises_stress", "jacobian"]


def written(comm, sim, folder) -> dict[str, np.ndarray]:
    """Names and values of the fields that a run writes at its start, on all ranks."""
    FieldOutput(sim, RunFolder(comm, folder)).write(sim)
    found = None
    if comm.rank == 0:
        with h5py.File(folder / "fields.vtkhdf") as file:
            found = {name: values[()] for name, values in file["VTKHDF/PointData"].items()}
    return comm.bcast(found)


@pytest.fixture
def marked(monkeypatch):
    """The method with one more declared field."""
    declare = system.declare_fields

    def more(particles, *rest):
        declare(particles, *rest)
        particles.declare(Field("mark", 1, "kg", shown=True), 2.0 * np.arange(particles.owned) + 1.0)

    monkeypatch.setattr(system, "declare_fields", more)


def test_a_shown_field_takes_no_more_than_its_declaration(comm, shared_path, marked):
    sim = simulation(tables((5, 4)), comm)
    found = written(comm, sim, shared_path)
    assert set(found) == {*USUAL, "mark", "body", "volume"}
    # rows are by identifier
    marks = {}
    for names in comm.allgather(sim.systems[0].particles.owned_rows("identifier").tolist()):
        marks |= {name: 2.0 * row + 1.0 for row, name in enumerate(names)}
    assert found["mark"][:20].tolist() == [marks[name] for name in range(20)]
    told = str(report_of(comm, sim))
    if comm.rank == 0:
        assert any(line.split() == ["mark", "1", "kg", "8", "shown"] for line in told.splitlines())


@pytest.fixture
def named(monkeypatch):
    """The method's settings, which let scenes name that field."""
    monkeypatch.setattr(TotalLagrangianSPH, "extra_fields", TotalLagrangianSPH.extra_fields | {"mark": "scalar"})


def test_a_field_is_declared_and_named_once(comm, shared_path, marked, named):
    data = tables((5, 4)) | {"output": {"fields": ["mark", "reference_position", "deformation_gradient"]}}
    data["probes"] = [
        {"name": "corner", "at": [0.0, 0.0], "fields": ["mark", "reference_position"]},
        {"name": "mode", "weight": "1", "fields": ["mark"]},
    ]
    sim = simulation(data, comm)
    found = written(comm, sim, shared_path)
    assert set(found) == {*data["output"]["fields"], "body", "volume"}
    assert np.all(found["mark"][:20] % 2 == 1.0) and found["reference_position"].shape == (len(found["mark"]), 3)
    probes = Probes(comm, sim.scene, Observables(sim.systems))
    assert probes.columns == ["corner.mark", *(f"corner.reference_position_{axis}" for axis in "xy"), "mode.mark"]
    mark, *_, mean = probes.sample()
    assert mark % 2 == 1.0 and mean > 1.0
    # a column of the history like any other
    data["reference"] = {"final": {"corner.reference_position_x": 1.0, "corner.mark": 1.0}}
    assert parse_scene(data).reference.final["corner.mark"] == 1.0


@pytest.mark.parametrize("name", ["markk", "kinematics", "marks_0", "volume"])
def test_a_field_that_the_method_does_not_name_is_none(named, name):
    data = tables((5, 4)) | {"output": {"fields": [name]}}
    data["probes"] = [{"name": "p", "at": [0.0, 0.0], "fields": [name]}]
    with pytest.raises(SceneError) as caught:
        parse_scene(data)
    assert sorted(told.key for told in caught.value.faults) == ["output.fields.0", "probes.0.fields.0"]


def test_a_field_that_the_options_do_not_bring_is_refused_before_the_run(comm):
    data = tables((5, 4)) | {"output": {"fields": ["updated_reference_volume"]}}
    with pytest.raises(SceneError) as caught:
        simulation(data, comm)
    assert [told.key for told in caught.value.faults] == ["output.fields.0"]


MORE = {"peridynamics": {"damage": {"critical_stretch": 0.1}}, "mpm": {"cell": 0.5}}


@pytest.mark.parametrize(
    "method, first", [("tlsph", []), ("peridynamics", []), ("peridynamics", ["damage"]), ("mpm", [])]
)
def test_what_is_written_unless_the_scene_chooses(comm, method, first):
    settings = {"kind": method} | (MORE[method] if first or method == "mpm" else {})
    data = tables((6, 6), method=settings, body={"placement": "cells"})
    data["bodies"][0]["material"] = {
        "kind": "neo-hookean",
        "density": 1.0,
        "youngs_modulus": 3.0,
        "poissons_ratio": 0.3,
    }
    assert Observables(simulation(data, comm).systems).usual_fields() == [*first, *USUAL]


def test_meshes_have_the_stress_at_their_nodes(comm, shared_path):
    file = shared_path / "block.msh"
    if comm.rank == 0:
        block(file, 0.0, 3)
    comm.Barrier()
    data = tables((4, 3))
    data["bodies"] = [{"shape": {"file": str(file)}, "material": data["bodies"][0]["material"]}]
    sim = simulation(data | {"method": {"kind": "tlsph"}}, comm)
    assert set(written(comm, sim, shared_path)) == {*USUAL, "nodal_von_mises_stress", "body", "volume"}


def test_what_a_plastic_body_carries_is_written_where_the_scene_names_it(comm, shared_path):
    copper = {
        "kind": "elastic-plastic",
        "density": 8930.0,
        "specific_heat": 383.0,
        "equation_of_state": {"kind": "linear", "bulk_modulus": 130e9},
        "shear_modulus": {"kind": "constant", "modulus": 43e9},
        "flow_stress": {"kind": "linear-hardening", "yield_stress": 400e6, "hardening": 100e6},
    }
    data = tables((6, 6), material=copper, method={"kind": "mpm", "cell": 0.5}, body={"placement": "cells"})
    assert Observables(simulation(data, comm).systems).usual_fields() == USUAL
    data["output"] = {"fields": ["temperature", "velocity_gradient"]}
    found = written(comm, simulation(data, comm), shared_path)
    assert set(found) == {"temperature", "velocity_gradient", "body", "volume"}


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_declared_tensor_has_three_rows_and_columns(dimension):
    sim = simulation(tables([3] * dimension))
    system = sim.systems[0]
    F = np.arange(float(system.owned * dimension**2)).reshape(-1, dimension, dimension)
    system.particles.owned_rows("deformation_gradient")[:] = F.reshape(-1, dimension**2)
    system.shown = lambda name, first, last: None
    found = field_of(system, "deformation_gradient", 1, 4)
    wanted = np.zeros((3, 3, 3))
    wanted[:, :dimension, :dimension] = F[1:4]
    np.testing.assert_array_equal(found, wanted)
    np.testing.assert_array_equal(field_of(system, "deformation_gradient_xy", 1, 4), F[1:4, 0, 1])
    assert field_of(system, "deformation_gradient_q") is None and field_of(system, "mass_x") is None
