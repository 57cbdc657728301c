"""Fibres and Mullins softening in plain Python: numbers of 60 digits, derivatives of the energy, exact waves, no jump
where fibres switch, work around a cycle; the stress of a uniform strain in every method; what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from materials.deformations import arguments, energy, stress
from scipy.optimize import brentq

from parsolid.api.materials import material
from parsolid.materials.hyperelastic import functions as of
from parsolid.materials.hyperelastic import tissues
from parsolid.materials.hyperelastic.at_particles import after_step, at_particle, members, state_count
from parsolid.materials.hyperelastic.rubbers import Yeoh
from parsolid.materials.hyperelastic.softening import Softened
from parsolid.materials.hyperelastic.transversely_isotropic import Guccione
from parsolid.materials.hyperelastic.volume import Quadratic
from parsolid.methods.small_scene import small_scene
from parsolid.scene import SceneError, parse_scene
from parsolid.scene.materials import ValueFault

HERE, NONE = Path(__file__).parent, (None, None)
STATES = json.loads((HERE / "hyperelastic_states.json").read_text())
MULLINS = json.loads((HERE / "mullins_uniaxial.json").read_text())
YEOH = Yeoh(1.0, 0.17e6, -1.5e3, 50.0, 20e6, Quadratic(), *NONE)


def neo_hookean(c1, bulk):
    return Yeoh(1.0, c1, 0.0, 0.0, bulk, Quadratic(), *NONE)


ANGLE = np.radians(49.98)
ALONG, ACROSS = (float(np.cos(ANGLE)), float(np.sin(ANGLE)), 0.0), (float(np.cos(ANGLE)), -float(np.sin(ANGLE)), 0.0)
ARTERY = tissues.TwoFamilies(1.0, neo_hookean(3.82e3, 2e6), 996.6e3, 524.6, 0.226, ALONG, ACROSS, *NONE)
TRANSVERSE = tissues.OneFamily(1.0, neo_hookean(0.2e6, 5e6), 0.5e6, 0.8, 0.0, (0.6, 0.8, 0.0), *NONE)
LAWS = {"holzapfel-gasser-ogden": ARTERY, "transverse": TRANSVERSE}
SOFTENED = {
    "rubber": Softened(1.0, YEOH, 1.6, 1e5, 0.1, 2e5, *NONE),
    "fibres": Softened(1.0, TRANSVERSE._replace(dispersion=0.1), 2.0, 2e5, 0.0, 1.5e5, *NONE),
}


@pytest.mark.parametrize("name", LAWS)
def test_energy_and_stress_are_those_of_sixty_digits(name):
    for state, expected in STATES["laws"][name]["states"].items():
        F = np.array(STATES["states"][state])
        assert energy(LAWS[name], F) == pytest.approx(expected["W"], rel=5e-9)
        P = np.array(expected["P"])
        np.testing.assert_allclose(stress(LAWS[name], F), P, rtol=0.0, atol=5e-9 * np.abs(P).max())


def test_softening_is_that_of_ogden_and_roxburgh_in_every_row():
    law = Softened(1.0, YEOH, MULLINS["r"], MULLINS["m"], MULLINS["beta"], 0.0, *NONE)
    for stretch, lateral, P, eta, largest in MULLINS["rows"]:

        def pulled(across):
            F = np.diag([stretch, across, across])
            return after_step(law, *arguments(F)), F

        across = brentq(lambda one: stress(*pulled(one))[1, 1], 0.5, 1.2, xtol=1e-14)
        assert across == pytest.approx(lateral, rel=2e-9)
        law, F = pulled(across)
        assert stress(law, F)[0, 0] == pytest.approx(P, rel=5e-9, abs=1e-3)
        assert law.largest_energy == pytest.approx(largest, rel=5e-9, abs=1e-3)
        U = of.volume_part(YEOH, float(np.linalg.det(F)))[1]
        H = np.array(arguments(F)[1]).reshape(3, 3)
        if stretch > 1.0:
            virgin = stress(YEOH, F)
            assert (stress(law, F)[0, 0] - U * H[0, 0]) / (virgin[0, 0] - U * H[0, 0]) == pytest.approx(eta, rel=1e-8)


def test_the_energy_of_heart_muscle_keeps_its_digits_at_small_strains():
    """C/2 (exp(Q) - 1) of stretches along the fibres that keep the volume."""
    law = Guccione(1.0, 2e3, 8.0, 2.0, 4.0, 1e5, Quadratic(), (1.0, 0.0, 0.0), *NONE)
    for stretch in 1.0 + np.array([1e-6, 1e-4, 1e-3, 5e-3, 9e-3, 0.02, 0.3]):
        along, across = 0.5 * (stretch**2 - 1.0), 0.5 * (stretch**-2 - 1.0)
        exact = 1e3 * np.expm1(8.0 * along**2 + 2.0 * across**2)
        assert energy(law, np.diag([stretch, 1.0 / stretch, 1.0])) == pytest.approx(exact, rel=1e-9)


def test_fibres_in_compression_bear_nothing_and_switch_without_a_jump():
    for kappa in (0.0, 0.2):
        law = TRANSVERSE._replace(fibre=(1.0, 0.0, 0.0), dispersion=kappa)
        squeezed = np.diag([0.8, 1.0, 1.0]) if kappa == 0.0 else np.diag([0.8, 0.95, 0.97])
        assert energy(law, squeezed) == energy(law.matrix, squeezed)
        np.testing.assert_array_equal(stress(law, squeezed), stress(law.matrix, squeezed))
        # where E = 0 the stress has a kink and the energy none; the bound of waves is without a jump
        sides = [np.diag([1.0 + e, 1.0, 1.0]) for e in (-1e-9, 1e-9)]
        jump = stress(law, sides[1]) - stress(law, sides[0])
        assert np.abs(jump).max() < 1e-8 * (law.fibre_modulus + law.matrix.bulk_modulus)
        bounds = [np.array(of.pressure_waves(law, *arguments(F))) for F in sides]
        np.testing.assert_allclose(*bounds, rtol=1e-7)


def around_a_cycle(law, steps):
    """The law after a cycle of loading, unloading, loading again and beyond, the work [J/m^3] and the last F."""
    times = np.linspace(0.0, 1.0, steps + 1)
    size = 0.3 * np.interp(times, [0.0, 0.3, 0.5, 0.7, 0.85, 1.0], [0.0, 1.0, 0.0, 0.8, 1.3, 0.0])
    way = np.array([[1.0, 0.4, 0.0], [0.1, -0.3, 0.0], [0.0, 0.2, -0.2]])
    work, before, P_before = 0.0, np.eye(3), np.zeros((3, 3))
    for s in size[1:]:
        F = np.eye(3) + s * way
        law = after_step(law, *arguments(F))
        P = stress(law, F)
        work += 0.5 * float(np.sum((P + P_before) * (F - before)))
        before, P_before = F, P
    return law, work, before


@pytest.mark.parametrize("name", SOFTENED)
def test_work_around_a_cycle_is_what_is_dissipated(name):
    """To second order in the step; nothing is stored after it."""
    errors = []
    for steps in (400, 800):
        law, work, F = around_a_cycle(SOFTENED[name]._replace(largest_energy=0.0), steps)
        errors.append(abs(float(of.dissipated_energy(law)) / work - 1.0))
        assert energy(law, F) == pytest.approx(0.0, abs=1e-9 * work)
    assert errors[1] < errors[0] / 3.0 and errors[1] < 1e-3
    # asked again nothing changes
    assert after_step(law, *arguments(F)) == law


# --- in scenes ------------------------------------------------------------------------------------------------------

TISSUE = {
    "kind": "gasser-ogden-holzapfel",
    "density": 1000.0,
    "shear_modulus": 1e5,
    "bulk_modulus": 1e6,
    "fibre_modulus": 3e5,
    "fibre_exponent": 2.0,
    "dispersion": 0.1,
    "fibre": {"angle": "atan2(Y, X)"},
}
SOFTENING = {"softening": {"r": 2.0, "m": 1e3, "beta": 0.05}}


def scene(method="tlsph", dimension=2, particles=None, body=None, **change):
    kind = {"kind": method} | ({"cell": 0.5} if method == "mpm" else {})
    table = {
        "shape": {"box": {"lower": [0.0] * dimension, "upper": [1.0] * dimension}},
        "particles": particles or [4] * dimension,
        "placement": "cells" if method == "mpm" else "vertices",
        "material": {key: value for key, value in (TISSUE | change).items() if value is not None},
    }
    return {"dimension": dimension, "end_time": 1.0, "method": kind, "bodies": [table | (body or {})]}


def test_the_law_of_a_material_has_the_directions_of_the_origin():
    law = material(**TISSUE | {"kind": "gasser-ogden-holzapfel", "fibre": {"vector": ["0", "3", "4*exp(X)"]}}).law
    assert law.fibre == pytest.approx((0.0, 0.6, 0.8))
    with pytest.raises(SceneError, match=r"material\.fibre"):
        material(**TISSUE | {"fibre": {"vector": ["X", "Y", "Z"]}})


def test_values_of_particles_become_the_law_there():
    stated = parse_scene(scene(**SOFTENING | {"second_fibre": {"vector": ["0", "-2"]}})).bodies[0].material
    law = stated.build("plane-strain")
    assert [one.name for one in members(law)] == ["fibre", "second_fibre", "largest_energy"] and state_count(law) == 1
    values = stated.values_at(np.array([[0.0, 2.0], [1.0, 1.0]]), {})
    assert values.shape == (7, 2)
    here = at_particle(law, values.ravel(), 2, 1)
    assert here.solid.fibre == pytest.approx((0.5**0.5, 0.5**0.5, 0.0)) and here.solid.second_fibre == (0.0, -1.0, 0.0)
    assert type(here) is type(law) and here.largest_energy == 0.0
    hoop = parse_scene(scene(fibre={"vector": ["0", "0", "2"]})).bodies[0].material
    np.testing.assert_array_equal(hoop.values_at(np.zeros((1, 2)), {})[:, 0], [0.0, 0.0, 1.0])


GRADED = """
from typing import Annotated, NamedTuple
from parsolid.elementary import log
from parsolid.materials.declaration import Density, Direction, OfPlace, StateVariable, law
from parsolid.materials.hyperelastic.functions import energy, next_state
from parsolid.tensors import contract

@law("hyperelastic", "graded")
class Graded(NamedTuple):
    density: Density
    modulus: Annotated[float, OfPlace("Pa", "mu by place")]
    grain: Annotated[tuple, Direction("of the grain", needed=False)]
    largest: Annotated[float, StateVariable("1", "volume so far", initial=1.0)]
    branch_moduli: tuple | None
    relaxation_times: tuple | None

@energy.of(Graded)
def _energy(law, F, H, J):
    return 0.5 * law.modulus * (contract(F, F) - 3.0 - 2.0 * log(J) + (J - 1.0) * (J - 1.0))

@next_state.of(Graded)
def _next_state(law, F, H, J):
    return (max(law.largest, J),)
"""


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (("", ""), None),
        (("@next_state.of(Graded)", "def unused(law, F, H, J): pass\n"), "next_state"),
        (("(max(law.largest, J),)", "(law.largest, J)"), "TypeError"),
        (("    largest: Annotated", "    other: float\n    largest: Annotated"), "follow one another"),
    ],
)
def test_a_law_of_ones_own_has_numbers_by_place_and_states(tmp_path, change, fault):
    (tmp_path / "graded.py").write_text(GRADED.replace(*change) if change[0] else GRADED)
    table = {"law": f"{tmp_path / 'graded.py'}:Graded", "modulus": "1e5*(1 + X)", "density": 1000.0}
    data = scene()
    data["bodies"][0]["material"] = table
    if fault is not None:
        with pytest.raises(SceneError, match=rf"bodies\.0\.material\.law: .*{fault}"):
            parse_scene(data, trust_code=True)
        return
    stated = parse_scene(data, trust_code=True).bodies[0].material
    values = stated.values_at(np.array([[0.0, 0.0], [0.5, 0.0]]), {})
    np.testing.assert_allclose(values, [[1e5, 1.5e5], [1.0, 1.0], [0.0, 0.0], [0.0, 0.0], [1.0, 1.0]])
    none = parse_scene(
        data | {"bodies": [data["bodies"][0] | {"material": table | {"modulus": "log(X)"}}]}, trust_code=True
    )
    with pytest.raises(ValueFault, match="^modulus: "):
        none.bodies[0].material.values_at(np.array([[0.5, 0.0], [0.0, 0.0]]), {})
    here = after_step(
        at_particle(stated.build("plane-strain"), values.ravel(), 2, 1), *arguments(np.diag([1.2, 1.0, 1.0]))
    )
    assert here.modulus == 1.5e5 and here.largest == pytest.approx(1.2)


@pytest.mark.parametrize("fibre", [{"cell_data": "grain"}, {"vector": ["-Y", "X"]}, {"angle": "log(X)"}])
def test_the_scene_that_kernels_are_compiled_for_has_directions(fibre):
    """It has no mesh, and a particle at the origin."""
    stated = parse_scene(scene(fibre=fibre, second_fibre=fibre))
    small = parse_scene(small_scene(stated, stated.method), again=True).bodies[0].material
    assert np.isfinite(small.values_at(np.zeros((1, 2)), {})).all()
    assert type(small.build("plane-strain")) is type(stated.bodies[0].material.build("plane-strain"))
