"""Errors of a run against an exact solution, by hand; solutions that scenes state."""

from pathlib import Path
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.exact.linear_viscoelastic import UniaxialCreep
from parsolid.exact.solution import Solution, View
from parsolid.exact.viscoelastic_plate import ViscoelasticPlate
from parsolid.scene import load_scene

pytestmark = pytest.mark.serial
RUNS = Path(__file__).parents[2] / "runs"
VOLUME, RNG = np.array([1.0, 2.0, 0.5]), np.random.default_rng(4)
EXACT = {
    "u": RNG.normal(size=(3, 2)),
    "s": RNG.normal(size=(3, 2, 2)),
    "T": 300.0 + np.arange(3.0),
    "none": np.zeros(3),
}


class Known(Solution):
    offsets = MappingProxyType({"T": 300.0})
    scales = MappingProxyType({"none": 4.0, "u": 2.0})

    def fields(self, positions, time):
        return {name: values + 0.0 * time for name, values in EXACT.items()}


def view_of(found: dict) -> View:
    rows = {"reference_position": np.zeros((3, 2)), "volume": VOLUME}
    return View(MPI.COMM_SELF, SimpleNamespace(rows=rows.__getitem__, field=found.__getitem__))


def test_errors_are_weighted_by_volume_over_the_size_of_the_field():
    off = {name: RNG.normal(size=values.shape) for name, values in EXACT.items()}
    found = {name: EXACT[name] + off[name] for name in EXACT}
    # tensors of a run have three rows and columns
    found["s"] = np.pad(found["s"], ((0, 0), (0, 1), (0, 1)), constant_values=7.0)

    def size(values):
        return np.sqrt(VOLUME @ (values.reshape(3, -1) ** 2).sum(axis=1))

    errors, rms = Known().errors(view_of(found), 0.5), Known().rms_errors(view_of(found), 0.5)
    for name in ("u", "s"):
        assert errors[name] == pytest.approx(size(off[name]) / size(EXACT[name]), rel=1e-12)
    assert errors["T"] == pytest.approx(size(off["T"]) / size(EXACT["T"] - 300.0), rel=1e-12)
    assert errors["none"] == pytest.approx(size(off["none"]) / (4.0 * size(np.ones(3))), rel=1e-12)
    assert rms["u"] == pytest.approx(size(off["u"]) / np.sqrt(VOLUME.sum()) / 2.0, rel=1e-12)
    assert set(Known().error_names(2)) == set(EXACT)


def test_a_plate_and_a_bar_are_those_of_their_scenes():
    scene = load_scene(RUNS / "tlsph" / "manufactured_plate.toml")
    material, plate = scene.bodies[0].material, ViscoelasticPlate.of_scene(scene)
    wanted = (material.density, material.moduli.shear_modulus, material.branch_moduli, material.relaxation_times)
    other = ViscoelasticPlate(scene.reference.parameters["amplitude"], *wanted)
    np.testing.assert_array_equal(plate.rates, other.rates)
    assert plate.amplitude == other.amplitude and plate.shear_modulus == material.moduli.shear_modulus
    scene = load_scene(RUNS / "peridynamics" / "creep_bar.toml")
    fields = [one for one in scene.probes if one.at is not None and {"position", "displacement"} <= set(one.fields)]
    assert fields
    some = [*fields, fields[0].model_copy(update={"name": "lone", "fields": ["displacement"]})]
    some += [fields[0].model_copy(update={"name": "all", "at": None, "where": "bar"})]
    named = UniaxialCreep.of_scene(scene.model_copy(update={"probes": some})).probes
    assert named == [one.name for one in fields]
