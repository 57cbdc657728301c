"""Laws of I1bar, of stretches and of formulas, in plain Python: against numbers of 60 digits
(`hyperelastic_states.json`); what is refused. What holds for every law is in `contracts.test_laws`."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from materials.deformations import arguments, assert_derived_from_energy, deformations, energy, stress
from scipy.optimize import brentq

from parsolid.api.check_advice import scene_advice
from parsolid.materials.hyperelastic import functions as of
from parsolid.materials.hyperelastic import rubbers, scene_formula, stretches
from parsolid.materials.hyperelastic.ellipticity import least_wave
from parsolid.materials.hyperelastic.mooney_rivlin import MooneyRivlin
from parsolid.materials.hyperelastic.saint_venant_kirchhoff import SaintVenantKirchhoff
from parsolid.materials.hyperelastic.volume import Logarithmic, Quadratic, SimoTaylor
from parsolid.scene import parse_scene

REFERENCE = json.loads((Path(__file__).parent / "hyperelastic_states.json").read_text())
SQUARE, NONE = (20e6, Quadratic()), (None, None)
OGDEN = 0.63e6, 1.3, 0.0012e6, 5.0, -0.01e6, -2.0
LAWS = {
    "ogden": stretches.Ogden(1.0, *OGDEN, *SQUARE, *NONE),
    "ogden-simo-taylor": stretches.Ogden(1.0, *OGDEN, 20e6, SimoTaylor(), *NONE),
    "yeoh": rubbers.Yeoh(1.0, 0.17e6, -1.5e3, 50.0, *SQUARE, *NONE),
    "gent": rubbers.Gent(1.0, 0.3e6, 90.0, *SQUARE, *NONE),
    "arruda-boyce": rubbers.ArrudaBoyce(1.0, 0.3e6, 2.8, *SQUARE, *NONE),
    "polynomial": stretches.Polynomial(1.0, 0.15e6, 0.02e6, 1e3, 2e3, 0.0, 0.0, *SQUARE, *NONE),
    "hencky": stretches.Hencky(1.0, 0.4e6, 20e6, Logarithmic(), *NONE),
}


def of_formula(text, **constants):
    return scene_formula._law_with(text, tuple(sorted(constants.items())))


FORMULAS = {
    "mu/2*(I1bar - 3) + K/2*(J - 1)**2": (
        {"mu": 0.34e6, "K": 20e6},
        rubbers.Yeoh(1.0, 0.17e6, 0.0, 0.0, *SQUARE, *NONE),
    ),
    "c1*(I1bar - 3) + c2*(I1bar - 3)**2 + c3*(I1bar - 3)**3 + K/2*(J - 1)**2": (
        {"c1": 0.17e6, "c2": -1.5e3, "c3": 50.0, "K": 20e6},
        LAWS["yeoh"],
    ),
    "xi*(I1 - 3) + zeta*(I2 - 3) - 2*(xi + 2*zeta)*log(J) + lam/2*(J - 1)**2": (
        {"xi": 3e5, "zeta": 2e5, "lam": 4e6},
        MooneyRivlin(1.0, 3e5, 2e5, 4e6, *NONE),
    ),
    "m/a*(lambda1bar**a + lambda2bar**a + lambda3bar**a - 3) + K/2*(J - 1)**2": (
        {"m": 0.63e6, "a": 1.3, "K": 20e6},
        stretches.Ogden(1.0, 0.63e6, 1.3, 0.0, 2.0, 0.0, 2.0, *SQUARE, *NONE),
    ),
    "mu*(log(lambda1bar)**2 + log(lambda2bar)**2 + log(lambda3bar)**2) + K/2*log(J)**2": (
        {"mu": 0.4e6, "K": 20e6},
        LAWS["hencky"],
    ),
}
# the root of a square is the amount
FORMULAS["sqrt(mu**2)*(I1bar - 3)/2 + K/2*sqrt((J - 1)**4)"] = next(iter(FORMULAS.values()))
EVERY = LAWS | {"saint-venant-kirchhoff": SaintVenantKirchhoff(1.0, 0.4e6, 1e6, *NONE)}
EVERY |= {text: of_formula(text, **constants) for text, (constants, _) in FORMULAS.items()}


@pytest.mark.parametrize("name", LAWS)
def test_energy_and_stress_are_those_of_sixty_digits(name):
    for state, expected in REFERENCE["laws"][name]["states"].items():
        F = np.array(REFERENCE["states"][state])
        assert energy(LAWS[name], F) == pytest.approx(expected["W"], rel=1e-8)
        P = np.array(expected["P"])
        np.testing.assert_allclose(stress(LAWS[name], F), P, rtol=0.0, atol=1e-8 * np.abs(P).max())


@pytest.mark.parametrize("name", REFERENCE["uniaxial_stress"])
def test_a_bar_with_free_sides_is_that_of_sixty_digits(name):
    for stretch, lateral, P in REFERENCE["uniaxial_stress"][name]:

        def pulled(across, stretch=stretch):
            return np.diagonal(stress(LAWS[name], np.diag([stretch, across, across])))

        across = brentq(lambda one: pulled(one)[1], 0.5, 1.2, xtol=1e-14)
        assert across == pytest.approx(lateral, rel=1e-8) and pulled(across)[0] == pytest.approx(P, rel=5e-9)


@pytest.mark.parametrize("text", FORMULAS)
def test_a_formula_is_the_law_that_it_says(text):
    """And its waves, by the stretches, are bounded."""
    constants, law = FORMULAS[text]
    ratios = assert_derived_from_energy(EVERY[text], [np.eye(3), *deformations(60, 0.05 if "sqrt" in text else 0.25)])
    assert ratios[:6] == pytest.approx([1.0] * 6, abs=1e-6) and np.mean(ratios) < 1.06
    for F in deformations(10, 0.2, seed=8):
        P = stress(law, F)
        np.testing.assert_allclose(stress(EVERY[text], F), P, rtol=0.0, atol=1e-13 * np.abs(P).max())
        assert energy(EVERY[text], F) == pytest.approx(energy(law, F), rel=1e-12)


def test_stretches_that_are_equal_or_nearly_so_have_waves():
    for gap in (0.0, 1e-12, 1e-6, 1e-5, 1e-3):
        for name in ("ogden", "polynomial"):
            Q = of.pressure_waves(LAWS[name], *arguments(np.diag([1.3 + gap, 1.3, 0.6])))
            close = of.pressure_waves(LAWS[name], *arguments(np.diag([1.3, 1.3, 0.6])))
            assert np.isfinite(Q).all() and Q == pytest.approx(close, rel=2e-2, abs=1.0)


def scene(material):
    body = {
        "shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}},
        "particles": [4, 4],
        "material": {"density": 1000.0} | material,
    }
    return {"dimension": 2, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body]}


BULK = {"bulk_modulus": 2e7}
STATED = {
    "yeoh": {"kind": "yeoh", "c1": 0.17e6, **BULK},
    "saint-venant-kirchhoff": {"kind": "saint-venant-kirchhoff", "youngs_modulus": 1e6, "poissons_ratio": 0.4},
    "formula": {
        "kind": "formula",
        "energy": "mu/2*(I1bar - 3) + K/2*(J - 1)**2",
        "constants": {"mu": 1e6, "K": 2e7},
    },
}


def test_a_law_whose_waves_grow_is_told_of():
    """Of Saint-Venant and Kirchhoff's in compression; the others keep theirs at strains of 0.3."""
    assert {name for name, law in EVERY.items() if least_wave(law) < 0.0} == {"saint-venant-kirchhoff"}
    told = [note.code for note in scene_advice(parse_scene(scene(STATED["saint-venant-kirchhoff"])))]
    assert "lost-waves" in told
    assert "lost-waves" not in [note.code for note in scene_advice(parse_scene(scene(STATED["yeoh"])))]


def test_the_source_of_a_formula_is_the_same_in_every_process():
    """Ranks compile the same law."""
    text, names = list(FORMULAS)[1], ("K", "c1", "c2", "c3")
    code = f"from parsolid.materials.hyperelastic.scene_formula import source_of; print(source_of({text!r}, {names!r}))"
    for seed in ("1", "2"):
        env = os.environ | {"PYTHONHASHSEED": seed}
        found = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True).stdout
        assert found.rstrip() == scene_formula.source_of(text, names).rstrip()
