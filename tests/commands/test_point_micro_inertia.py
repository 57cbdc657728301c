"""The micro-inertia law driven by the command point: rates, load-hold-reverse, heat, what a scene may state."""

from pathlib import Path

import numpy as np
import pytest
from points import followed

from parsolid.materials.registry import law_of
from parsolid.point.laws import PathLost
from parsolid.point.schema import load_point
from parsolid.scene.probes import component_names
from parsolid.scene.validation_errors import SceneError

pytestmark = pytest.mark.serial
EXAMPLES = Path(__file__).parents[2] / "runs" / "point"
STEEL = '[material]\nkind = "micro-inertia"\nlibrary = "4340 steel, Rahaman"\n'
SHEAR = '[path]\nkind = "simple-shear"\nshear = "1e4*t"\n'
HEAD = "end_time = 2e-5\nsteps = 200\n"


def test_compression_as_tabled():
    """Plane-strain compression at 1e4/s as the formulation tables it, from the deformation gradient exp(D t)."""
    run = followed(load_point(EXAMPLES / "micro_inertia.toml", ["end_time=2e-5", "time_step=2e-8"]))
    # event-driven reference at 10 and 20 us
    at = [500, 1000]
    assert run.time[at] == pytest.approx([1e-5, 2e-5])
    assert run.von_mises_stress[at] == pytest.approx(np.sqrt(1.5) * np.array([463822042.0, 818376272.0]), rel=2e-3)
    assert run.micro_stress[at[0]] == pytest.approx(603477370.0, rel=1e-4)
    # 4e-6 of the work until 40 us
    assert np.abs(run.energy_error).max() <= 1.2e-5 * run.work[-1]
    stress = np.array([getattr(run, name) for name in component_names("stress", 3)])
    deviator = stress.T + run.pressure[:, None] * np.eye(3).ravel()
    assert run.von_mises_stress == pytest.approx((1.5 * (deviator**2).sum(axis=1)) ** 0.5, rel=1e-10, abs=1.0)


@pytest.mark.slow
def test_load_hold_reverse():
    """While held |S| rings about pi, which relaxes; sheared back gamma goes on growing and S12 changes its sign."""
    run = followed(load_point(EXAMPLES / "micro_inertia_reversed.toml", ["time_step=5e-8"]))
    held, back = (run.time > 3.1e-5) & (run.time < 4.9e-5), run.time > 7e-5
    assert run.von_mises_stress[held].max() < run.von_mises_stress[run.time <= 3e-5].max()
    assert (np.diff(run.plastic_strain) >= 0.0).all() and run.plastic_strain[-1] > 0.4
    assert run.stress_xy[run.time < 3e-5].max() > 1e9 and run.stress_xy[back].max() < -5e8
    assert np.abs(run.energy_error).max() <= 1e-5 * run.work[-1]
    # the micro-inertia stores and gives back
    assert run.micro_kinetic_energy.max() > 0.01 * run.work[-1] / 5.0


def test_heat(point_of):
    warm = followed(point_of(HEAD + "temperature = 400.0\n" + STEEL + SHEAR))
    cold = followed(point_of(HEAD + 'temperature = 400.0\nheat = "isothermal"\n' + STEEL + SHEAR))
    capacity = 7830.0 * 477.0
    assert warm.temperature - 400.0 == pytest.approx(warm.dissipation / capacity, rel=1e-9)
    assert (cold.temperature == 400.0).all() and cold.heat_given_away == pytest.approx(cold.dissipation, rel=1e-12)
    assert cold.micro_stress[-1] > warm.micro_stress[-1]


def test_the_classical_limit_is_stated_by_zeros(point_of):
    """|S| = pi, and the energy is closed but for the backward step's first order."""
    lengths = ("energetic_length", "dissipative_length", "inertia_length")
    times = ("stress_relaxation_time", "flux_relaxation_time")
    classical = STEEL + "".join(f"{key} = 0.0\n" for key in (*lengths, *times)) + SHEAR
    runs = [followed(point_of(f"end_time = 2e-5\nsteps = {n}\n{classical}")) for n in (100, 200)]
    assert runs[1].von_mises_stress / np.sqrt(1.5) == pytest.approx(runs[1].micro_stress, rel=1e-14)
    coarse, fine = (np.abs(run.energy_error).max() for run in runs)
    assert fine < 0.6 * coarse and fine < 2e-2 * runs[1].work[-1]


def test_pressure_in_a_volumetric_path(point_of):
    """p = K (rho/rho_0 - 1), its work stored."""
    run = followed(point_of(HEAD + STEEL + '[path]\nkind = "volumetric"\njacobian = "1 - 5e3*t"\n'))
    assert run.pressure == pytest.approx(200e9 / (3.0 * 0.42) * (1.0 / run.jacobian - 1.0), rel=1e-12, abs=1.0)
    assert run.strain_energy == pytest.approx(run.work, rel=1e-9) and run.plastic_strain.max() < 1e-18


BARE = STEEL.replace('library = "4340 steel, Rahaman"\n', "")


@pytest.mark.parametrize(
    "material, key",
    [
        (STEEL.replace("Rahaman", "Rahamann"), "library"),
        (BARE, "density"),
        (STEEL + "shear_modulus = 80e9\n", ""),
        (STEEL + "shear_modulus = 80e9\npoissons_ratio = 0.3\n", ""),
        (STEEL + "dissipative_length = 0.0\n", "flux_relaxation_time"),
        (STEEL + "conductivity = 0.0\n", "heat_relaxation_time"),
        (STEEL + "inertia_length = 0.0\n", "energetic_length"),
        (STEEL + "stress_relaxation_time = 0.0\ninitial_micro_stress = 1e8\n", "initial_micro_stress"),
        (STEEL + "melting_temperature = 200.0\n", "melting_temperature"),
        (STEEL + "rate_exponent = 1.5\n", "rate_exponent"),
        (STEEL + "energetic_length = -1.0\n", "energetic_length"),
        (STEEL + "regularisation = 0.0\n", "regularisation"),
        (STEEL + "inertia_lenght = 1.0\n", "inertia_lenght"),
    ],
)
def test_faults(point_of, material, key):
    with pytest.raises(SceneError) as caught:
        point_of(HEAD + material + SHEAR)
    assert any(fault.key == f"material.{key}".rstrip(".") for fault in caught.value.faults), caught.value.faults


def test_shear_and_bulk_modulus_take_the_place_of_the_librarys(point_of):
    law = law_of(point_of(HEAD + STEEL + "shear_modulus = 80e9\nbulk_modulus = 160e9\n" + SHEAR).material)
    assert (law.shear_modulus, law.bulk_modulus) == (80e9, 160e9)
    with pytest.raises(PathLost, match="jump"):
        followed(point_of(HEAD + STEEL + '[path]\nkind = "simple-shear"\nshear = 0.1\n'))


OWN = """from parsolid.materials.declaration import law
from parsolid.materials.plastic.micro_inertia import MicroInertia, flow_strength
from parsolid.materials.plastic.micro_inertia import StatedMicroInertia


class Constant(MicroInertia):
    pass


@law("micro-inertia", "constant-strength")
class Stated(StatedMicroInertia):
    def micro_inertia_law(self):
        return Constant(*StatedMicroInertia.micro_inertia_law(self))


@flow_strength.of(Constant)
def _constant(law, gamma, curl, temperature):
    return law.yield_stress + 0.0 * gamma
"""


def test_a_law_of_ones_own(tmp_path):
    """Another strength in a file, on the same solve; with heat, which it takes as its role does."""
    (tmp_path / "own.py").write_text(OWN)
    path = tmp_path / "point.toml"
    head, stated = HEAD + "temperature = 300.0\n", STEEL.replace('kind = "micro-inertia"', 'law = "own.py:Stated"')
    path.write_text(head + stated + SHEAR)
    own = followed(load_point(path, trust_code=True))
    path.write_text(head + STEEL + SHEAR)
    usual = followed(load_point(path))
    assert 0.0 < own.micro_stress[-1] < 0.99 * usual.micro_stress[-1]
    (tmp_path / "own.py").write_text(OWN.replace("class Stated(StatedMicroInertia)", "class Stated"))
    path.write_text(head + BARE.replace('kind = "micro-inertia"', 'law = "own.py:Stated"') + SHEAR)
    with pytest.raises(SceneError, match="a class derived from StatedMicroInertia"):
        load_point(path, trust_code=True)
