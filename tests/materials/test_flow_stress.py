"""Flow stresses, shear moduli, melting and equation of state against spot values of flow_table.json."""

import json
from pathlib import Path

import numpy as np
import pytest

from parsolid.materials.plastic import plastic_evaluation as evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.equation_of_state import LinearElastic, MieGrueneisen
from parsolid.materials.plastic.linear_hardening import LinearHardening
from parsolid.materials.plastic.shear_modulus import ConstantShearModulus, NadalLePoac
from parsolid.materials.plastic.steinberg_cochran_guinan import SteinbergCochranGuinan, ThermalActivation
from parsolid.materials.registry import law_of
from parsolid.scene.plasticity import library

TABLE = json.loads(Path(__file__).with_name("flow_table.json").read_text())
# column of the table -> material of the library, and the relative tolerance
MODELS = {
    "JC": ("OFHC copper, Johnson-Cook", 1e-4),
    "JC4340": ("4340 steel, Johnson-Cook", 1e-4),
    "ZA": ("OFHC copper, Zerilli-Armstrong", 1e-4),
    "SCG_P0": ("OFHC copper, Steinberg-Cochran-Guinan", 1e-4),
    "MTS": ("OFHC copper, mechanical threshold", 1e-3),
    "PTW": ("OFHC copper, Preston-Tonks-Wallace", 1e-3),
}
COPPER = MieGrueneisen(8930.0, 3940.0, 1.489, 2.02)
U = 1.66053906660e-27


def material(name):
    return law_of(library()[name])


def table_column(name):
    return np.array([row[name] for row in TABLE["flow_stress_Pa"]])


@pytest.mark.parametrize("model", MODELS)
def test_flow_stress_table(model):
    name, tolerance = MODELS[model]
    ep, rate, T = (table_column(key) for key in ("ep", "edot", "T"))
    law = material(name)
    found = evaluation.flow_stress(law, ep, rate, T)
    assert found == pytest.approx(table_column(model), rel=tolerance)


@pytest.mark.parametrize("model", MODELS)
def test_nothing_is_left_of_a_melted_metal(model):
    law = material(MODELS[model][0])
    melting = evaluation.melting_temperature(law, 1.0)
    below, at, above = evaluation.flow_stress(law, 0.3, 1e3, melting * np.array([0.95, 1.0, 3.0]))
    assert below > 0.0 and at == 0.0 and above == 0.0


@pytest.mark.parametrize("model", MODELS)
def test_flow_stress_at_any_rate(model):
    """Between rest and overdriven shocks it is finite and does not fall with the rate."""
    law = material(MODELS[model][0])
    rates = np.concatenate([[0.0], np.geomspace(1e-12, 1e12, 97)])
    stress = evaluation.flow_stress(law, 0.1, rates, 500.0)
    assert np.isfinite(stress).all() and (stress > 0.0).all()
    assert (np.diff(stress) >= -1e-9 * stress[:-1]).all()


def test_johnson_cook_below_its_reference_rate_and_temperature():
    law = material(MODELS["JC"][0])
    slow, reference = evaluation.flow_stress(law, 0.2, np.array([1e-4, 1.0]), 200.0)
    assert slow == reference == pytest.approx(90e6 + 292e6 * 0.2**0.31, rel=1e-14)


def test_thermal_activation_solves_its_rate_equation(plain_python):
    activation = ThermalActivation(0.71e6, 0.31 * 1.602176634e-19, 20e6, 0.012e6)
    flow = SteinbergCochranGuinan(120e6, 640e6, 47.7e9, 36.0, 0.45, 0.0, activation)
    law = ElasticPlastic(8930.0, 383.0, 300.0, 0.9, 0.0, COPPER, ConstantShearModulus(47.7e9), flow, None)
    for rate, T in ((1e-3, 300.0), (10.0, 400.0), (100.0, 300.0)):
        athermal = 120e6 * (1.0 + 36.0 * 0.1) ** 0.45
        Y = evaluation.flow_stress(law, 0.1, rate, T) - athermal
        kinks = np.exp(2.0 * activation.kink_energy / (1.380649e-23 * T) * (1.0 - Y / 20e6) ** 2) / activation.frequency
        assert 0.0 < Y < 20e6 and 1.0 / (kinks + activation.drag / Y) == pytest.approx(rate, rel=1e-6)
    # nothing without it
    cold = law._replace(flow_stress=flow._replace(activation=None))
    assert evaluation.flow_stress(cold, 0.1, 1.0, 300.0) == pytest.approx(athermal, rel=1e-14)
    # no more than the Peierls stress
    assert evaluation.flow_stress(law, 0.1, 1e7, 300.0) - athermal == pytest.approx(20e6, rel=1e-9)


def test_shear_moduli(plain_python):
    rows = TABLE["shear_modulus_Pa"]
    P, T, J = np.array([(row["P"], row["T"], 1.0 / row["eta"]) for row in rows]).T
    nadal = NadalLePoac(50.7e9, 2.8e-11, 0.04, 0.057, 63.55 * U, 8930.0)
    laws = {
        "SCG": material(MODELS["SCG_P0"][0]),
        "Varshni": material(MODELS["MTS"][0]),
        "NP": material(MODELS["JC"][0])._replace(shear_modulus=nadal),
    }
    for name, law in laws.items():
        assert evaluation.shear_modulus(law, J, P, T) == pytest.approx([row[name] for row in rows], rel=1e-9), name


def test_melting_temperature():
    eta, exact = np.array([(row["eta"], row["Tm_SCG"]) for row in TABLE["melt_K"]]).T
    assert evaluation.melting_temperature(material(MODELS["SCG_P0"][0]), 1.0 / eta) == pytest.approx(exact, rel=1e-12)


def solid(eos):
    return ElasticPlastic(
        8930.0, 383.0, 300.0, 0.9, 0.0, eos, ConstantShearModulus(47.7e9), LinearHardening(1e8, 0.0), None
    )


@pytest.mark.parametrize(
    "speed, shock, J, P", [(500.0, 4684.5, 0.893265, 20.9163e9), (1000.0, 5429.0, 0.815804, 48.481e9)]
)
def test_hugoniot(speed, shock, J, P):
    """P is that of the Hugoniot where E is, E = P (1 - J)/2; jump conditions with U_s = C0 + S u_p."""
    assert shock == pytest.approx(3940.0 + 1.489 * speed, rel=1e-12)
    compressed = 1.0 - speed / shock
    pressure = evaluation.pressure(solid(COPPER), compressed, 0.5 * 8930.0 * speed**2)
    assert pressure == pytest.approx(8930.0 * shock * speed, rel=1e-12)
    assert (compressed, pressure) == (pytest.approx(J, rel=1e-6), pytest.approx(P, rel=1e-5))


@pytest.mark.parametrize("eos", [COPPER, LinearElastic(130e9)], ids=["mie-grueneisen", "linear"])
@pytest.mark.parametrize("J", [0.75, 0.95, 1.0, 1.05])
def test_isentropic_bulk_modulus(eos, J):
    """-J dP/dJ with dE = -P dJ, by differences."""
    law, E, dJ = solid(eos), 3e8, 1e-5
    P = evaluation.pressure(law, J, E)
    moved = [evaluation.pressure(law, J + s * dJ, E - s * P * dJ) for s in (1.0, -1.0)]
    assert evaluation.isentropic_bulk_modulus(law, J, P) == pytest.approx(
        -J * (moved[0] - moved[1]) / (2.0 * dJ), rel=1e-7
    )


HEATED = {"JC": 391.34, "ZA": 396.06, "MTS": 390.45, "PTW": 407.61, "SCG_P0": 404.56, "JC4340": 588.50}


@pytest.mark.parametrize("model, temperature", HEATED.items())
def test_adiabatic_heating(model, temperature):
    """Rigid-plastic flow at 1e4/s from 294 K to a plastic strain of 1, nine tenths of the work turned into heat."""
    law = material(MODELS[model][0])
    capacity = 7830.0 * 477.0 if model == "JC4340" else 8960.0 * 383.0
    T, count = 294.0, 2000
    for ep in (np.arange(count) + 0.5) / count:
        half = T + 0.45 / count / capacity * evaluation.flow_stress(law, ep, 1e4, T)
        T += 0.9 / count / capacity * evaluation.flow_stress(law, ep, 1e4, half)
    assert T == pytest.approx(temperature, abs=0.02)
