"""The material point of elastic-plastic solids: adiabatic and isothermal, cycles, free sides, faults."""

from pathlib import Path

import numpy as np
import pytest
from points import followed

from parsolid.point.laws import PathLost
from parsolid.point.schema import load_point
from parsolid.scene.validation_errors import SceneError

pytestmark = pytest.mark.serial
EXAMPLES = Path(__file__).parents[2] / "runs" / "point"
HELD = 'thermal_reference = "at-constant-volume"\n'
COPPER = '[material]\nkind = "elastic-plastic"\nlibrary = "OFHC copper, Johnson-Cook"\n'
STEEL = """[material]
kind = "elastic-plastic"
density = 7850
specific_heat = 470
youngs_modulus = 200e9
poissons_ratio = 0.3
flow_stress = { kind = "linear-hardening", yield_stress = 400e6, hardening = 1e9 }
"""
RUBBER = """heat = "adiabatic"
[material]
kind = "neo-hookean"
density = 1000
youngs_modulus = 1e6
poissons_ratio = 0.3
"""


@pytest.fixture
def driven(point_of):
    """The columns of a point stated as TOML."""
    return lambda text: followed(point_of(text))


def test_adiabatic_and_isothermal_shear(driven):
    path = 'end_time = 1e-3\nsteps = 100\ntemperature = 294.0\n%s[path]\nkind = "simple-shear"\nshear = "1000*t"\n'
    warm = driven(path % COPPER)
    assert warm.stress_xy[-1] == pytest.approx(217.1357e6, rel=5e-4) and warm.temperature[-1] == pytest.approx(
        341.72, abs=0.25
    )
    assert (warm.heat_given_away == 0.0).all()
    cold = driven("heat = 'isothermal'\n" + path % COPPER)
    assert (cold.temperature == 294.0).all() and cold.stress_xy[-1] > 1.02 * warm.stress_xy[-1]
    # shear at constant volume: the heat given away is the plastic heat
    assert cold.heat_given_away[-1] == pytest.approx(0.9 * cold.dissipation[-1], rel=1e-3)
    for run in (warm, cold):
        assert np.abs(run.energy_error).max() <= 3e-3 * run.work[-1]


def test_heat_of_isothermal_compression(driven):
    """Elastic: dQ = -T gamma rho C_v dV at constant temperature, so that nothing but the volume counts."""
    hard = COPPER + 'flow_stress = { kind = "linear-hardening", yield_stress = 1e13 }\n'
    head, path = (
        'end_time = 1.0\nsteps = 50\nheat = "isothermal"\n',
        '[path]\nkind = "volumetric"\njacobian = "1 - 0.05*t"\n',
    )
    run = driven(head + hard + path)
    assert (run.temperature == 300.0).all()
    assert run.heat_given_away[-1] == pytest.approx(300.0 * 2.02 * 8960.0 * 383.0 * 0.05, rel=1e-4)


def test_uniaxial_stress_of_a_hardening_bar(driven):
    """Free sides: sigma = (sigma_y0 + H ep) with ln(stretch) = ep + sigma/E."""
    run = driven(f'end_time = 1e-3\nsteps = 50\n{STEEL}[path]\nkind = "uniaxial"\nstretch = "exp(50*t)"\n')
    stress, strain = run.stress_xx, np.log(run.deformation_gradient_xx)
    assert np.abs(run.stress_yy).max() < 1e-3 * stress.max()
    plastic = run.plastic_strain > 0.0
    assert plastic.sum() > 40 and stress[plastic] == pytest.approx(400e6 + 1e9 * run.plastic_strain[plastic], rel=1e-9)
    assert strain == pytest.approx(run.plastic_strain + stress / 200e9, rel=2e-3, abs=1e-9)


@pytest.mark.parametrize("name", ["plastic_cycles", "plastic_uniaxial_strain"])
def test_examples(name):
    run = followed(load_point(EXAMPLES / f"{name}.toml"))
    assert np.isfinite(run.von_mises_stress).all()
    assert (run.von_mises_stress[1:] <= run.flow_stress[1:] * (1.0 + 1e-2) + 1e6).mean() > 0.5
    assert np.abs(run.energy_error).max() <= 1e-3 * run.work.max() and (np.diff(run.plastic_strain) >= 0.0).all()
    if name == "plastic_uniaxial_strain":
        # loaded beyond yield, unloaded to yield in tension
        assert run.stress_xx.min() < -10e9 and run.stress_xx[-1] > 0.0


def test_jumps_and_compression_beyond_the_equation_of_state_are_told(driven):
    with pytest.raises(PathLost, match="jump"):
        driven(f'end_time = 1.0\nsteps = 5\n{STEEL}[path]\nkind = "simple-shear"\nshear = 0.1\n')
    with pytest.raises(PathLost, match="equation of state"):
        driven(f'end_time = 1.0\nsteps = 50\n{COPPER}[path]\nkind = "volumetric"\njacobian = "1 - 0.7*t"\n')


SOFTENING = """equation_of_state = { kind = "linear", bulk_modulus = 1e11 }
shear_modulus = { kind = "linear-softening", modulus = 8e10, softening = 0.2 }
"""


@pytest.mark.parametrize(
    "text, key",
    [
        (RUBBER, "heat"),
        (COPPER.replace("Johnson-Cook", "Johnson-Kook"), "material.library"),
        (STEEL.replace("specific_heat = 470\n", ""), "material.specific_heat"),
        (STEEL.replace("poissons_ratio = 0.3\n", ""), "material"),
        (STEEL + 'shear_modulus = { kind = "constant", modulus = 8e10 }\n', "material.shear_modulus"),
        (STEEL + 'melting = { kind = "lindemann" }\n', "material.melting.kind"),
        (STEEL.replace("linear-hardening", "johnson-cook"), "material.flow_stress.exponent"),
        (STEEL.replace("youngs_modulus = 200e9\npoissons_ratio = 0.3\n", SOFTENING), "material.melting"),
    ],
)
def test_faults(driven, text, key):
    with pytest.raises(SceneError) as caught:
        driven(f'end_time = 1.0\nsteps = 5\n{text}[path]\nkind = "simple-shear"\nshear = "t"\n')
    assert any(fault.key == key for fault in caught.value.faults), caught.value.faults


def test_what_failed_matter_stored_is_dissipated(driven):
    """Sheared at its volume it stores nothing any more, but for what steps lose."""
    failing = '[material.failure]\ncriteria = [{ kind = "plastic-strain", strain = 0.05 }]\n'
    run = driven(f'end_time = 1e-3\nsteps = 200\n{STEEL}{failing}[path]\nkind = "simple-shear"\nshear = "200*t"\n')
    before = np.argmax(run.damage >= 1.0) - 1
    assert 0 < before < 198 and run.strain_energy[before] > 1e5
    assert np.abs(run.strain_energy[before + 1 :]).max() < 0.05 * run.strain_energy[before]
