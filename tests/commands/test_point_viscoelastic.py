"""Prony solids at a material point against relaxation functions, on any number of ranks."""

from pathlib import Path

import numpy as np
import pytest
from points import followed

from parsolid.exact.linear_viscoelastic import PronySeries
from parsolid.point.schema import MaterialPoint, load_point
from parsolid.scene import SceneError

pytestmark = pytest.mark.serial
EXAMPLES = Path(__file__).resolve().parents[2] / "runs" / "point"
MATERIAL = {"kind": "prony", "density": 1000.0, "youngs_modulus": 7e6, "poissons_ratio": 0.3}
ELASTIC_BULK = {"bulk": "elastic", "poissons_ratio": None, "bulk_modulus": 30e6}
TERMS = [{"ratio": 2.0, "tau": 0.3}, {"ratio": 0.7, "tau": 5.0}]


def driven(path, end_time=2.0, steps=40, **material):
    """Columns of a point."""
    material = {key: value for key, value in {**MATERIAL, "terms": TERMS, **material}.items() if value is not None}
    tables = {"end_time": end_time, "steps": steps, "material": material, "path": path}
    return followed(MaterialPoint.model_validate(tables, context={"dimension": 3, "folder": "."})).columns


def test_relaxation_under_uniaxial_stress_is_that_of_youngs_modulus():
    columns = driven({"kind": "uniaxial", "stretch": 1.01})
    series = PronySeries(7e6, [14e6, 4.9e6], [0.3, 5.0])
    exact = 0.01 * series.relaxation(columns["time"][1:])
    assert columns["first_piola_kirchhoff_stress_xx"][1:] == pytest.approx(exact, rel=1e-7)
    assert columns["deformation_gradient_yy"][1:] == pytest.approx(1.0 - 0.003, rel=1e-9)
    # held and in the jump nothing is approximated
    assert np.abs(columns["energy_error"]).max() <= 1e-8 * columns["work"].max()
    assert np.diff(columns["dissipation"]).min() >= 0.0


@pytest.mark.parametrize("strain", ["small", "finite"])
@pytest.mark.parametrize("bulk", [{}, ELASTIC_BULK], ids=["relaxing", "elastic"])
def test_work_stored_and_dissipated_balance(strain, bulk):
    path = {"kind": "cyclic-shear", "amplitude": 0.4, "period": 1.0}
    errors = []
    for steps in (40, 80):
        columns = driven(path, 1.0, steps, strain=strain, **bulk)
        errors.append(np.abs(columns["energy_error"]).max() / columns["work"].max())
        assert np.diff(columns["dissipation"]).min() >= 0.0
    assert errors[1] <= 2e-3 and np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)


def test_finite_strain_does_not_feel_rotations():
    turn = "cos(3*t)", "sin(3*t)"
    path = {
        "kind": "formulas",
        "deformation_gradient": [
            [f"(1 + 0.2*t)*{turn[0]}", f"-{turn[1]}", "0"],
            [f"(1 + 0.2*t)*{turn[1]}", turn[0], "0"],
            ["0", "0", "1"],
        ],
    }
    straight = {"kind": "uniaxial", "stretch": "1 + 0.2*t", "lateral": "fixed"}
    turned, still = driven(path, strain="finite"), driven(straight, strain="finite")
    for name in ("strain_energy", "dissipation", "von_mises_stress"):
        assert turned[name] == pytest.approx(still[name], rel=1e-9)


def test_wave_speeds_of_small_strain_are_the_instantaneous_ones():
    columns = driven({"kind": "uniaxial", "stretch": 1.01})
    G = 3.7 * 7e6 / 2.6
    assert columns["largest_shear_wave_speed"] == pytest.approx(np.full(len(columns["time"]), np.sqrt(G / 1000.0)))
    assert columns["direction_2.pressure_wave_speed"][-1] == pytest.approx(np.sqrt(G * 2.0 * 0.7 / 0.4 / 1000.0))


def test_large_compression_is_seen_to_lose_hyperbolicity():
    # St. Venant-Kirchhoff: the axial stress of a confined stretch s, (lambda + 2G)/2 s (s^2 - 1), peaks at 1/sqrt(3)
    path = {"kind": "uniaxial", "stretch": "1 - 0.5*t", "lateral": "fixed"}
    columns = driven(path, end_time=0.98, steps=49, strain="finite", terms=[])
    lost = columns["deformation_gradient_xx"][columns["smallest_acoustic_eigenvalue"] <= 0.0]
    moduli = np.gradient(columns["first_piola_kirchhoff_stress_xx"], columns["deformation_gradient_xx"])
    assert moduli[-1] < 0.0 and lost.max() >= columns["deformation_gradient_xx"][moduli <= 0.0].max() - 0.011


def test_bonds_have_no_point(tmp_path):
    material = "[material]\nkind = 'bond-based'\ndensity = 1.0\nyoungs_modulus = 1.0\n"
    bonds = f"end_time = 1\nsteps = 1\n{material}[path]\nkind = 'uniaxial'\nstretch = 1\n"
    (tmp_path / "point.toml").write_text(bonds)
    with pytest.raises(SceneError, match="^material.kind: "):
        load_point(tmp_path / "point.toml")
