"""Elastic-plastic laws with more state than a yield surface that grows: each in every method of flow, on all ranks,
through a restart, with its energies."""

import numpy as np
import pytest
from solids import LINEAR_COPPER, gathered, run_steps, supports, tables

from parsolid.observables.declared import Observables
from parsolid.scene import SceneError, parse_scene

TURNING = LINEAR_COPPER | {
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 200e6},
    "kinematic_hardening": {"kind": "armstrong-frederick", "modulus": 20e9, "recovery": 60.0},
}
POWDER = {
    "kind": "elastic-plastic", "density": 8930.0, "specific_heat": 383.0,
    "youngs_modulus": 20e9, "poissons_ratio": 0.25,
    "flow_stress": {
        "kind": "drucker-prager", "friction_angle": 30, "dilation_angle": 10, "cohesion": 80e6, "tension": 40e6,
        "cap_pressure": 200e6, "compaction": 0.05,
    },
}  # fmt: skip
# of a law: its material, the field that it has besides, and the least of its largest value in 80 steps
LAWS = {"back-stress": (TURNING, "back_stress", 5e7), "soil": (POWDER, "volume_flow", 0.01)}
METHODS = {
    "tlsph": {"kind": "tlsph", "integrator": "leapfrog", "weights": "cells"},
    "peridynamics": {"kind": "peridynamics"},
    "mpm": {"kind": "mpm", "cell": 2e-4},
    "ulsph": {"kind": "ulsph"},
}


def swinging(kind, material=TURNING, **tables_besides):
    """A block of 1 x .5 mm on a fixed plane that swings far into flow, and back."""
    placement = {} if kind in ("tlsph", "peridynamics") else {"placement": "cells"}
    return tables(
        (10, 5), [1e-3, 5e-4], material=material, method=METHODS[kind],
        body={"velocity": ["2.5e5*Y", "-5e4*Y"]} | placement,
        boundaries=supports(Y=(0.0, "fixed")), end_time=1.0, **tables_besides,
    )  # fmt: skip


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", METHODS)
def test_flow_only_dissipates(kind, law):
    material, field, least = LAWS[law]
    data = swinging(kind, material)
    single, one = run_steps(data, 80)
    energy = one["kinetic"][0]
    assert np.abs(gathered(single, field)[0]).max() > least
    # a back stress stores a part of the work, and gives it back as the flow turns
    work, stored = one["plastic_work"], one.get("back_stress_energy", np.zeros(1))
    assert 0.0 <= stored[-1] < 0.5 * work[-1] and work[-1] > 0.1 * energy
    assert np.diff(work - stored).min() >= -1e-12 * energy and (stored[-1] > 0.0) == (law == "back-stress")
    # of first order in the step but in tlsph, as of the law that hardens alone (.8 and 2.4 % here)
    bound = {"tlsph": 1e-13, "peridynamics": 1e-9, "mpm": 3.5e-2, "ulsph": 5e-2}[kind]
    assert np.abs(one["energy_error"]).max() < bound * energy
    shown = Observables(single.systems).field
    if law == "soil":
        np.testing.assert_array_equal(shown(field), single.systems[0].particles.owned_rows(field)[:, 0])
    else:
        # stress flows at the yield stress about the back stress in the axes of the stress
        back, stress = shown(field), shown("stress")
        relative = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3) - back
        equivalent = np.sqrt(1.5 * np.sum(relative**2, axis=(1, 2))).max() / 200e6
        # at the end the block of peridynamics has turned and flows nowhere
        assert 0.5 < equivalent < 1.0 + 1e-9
        assert kind == "peridynamics" or equivalent == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("kind", METHODS)
def test_probes_of_flow_are_for_bodies_that_have_it(kind):
    for law, (material, field, _) in LAWS.items():
        for other in LAWS:
            probes = [{"name": "corner", "at": [1e-3, 5e-4], "fields": [LAWS[other][1]]}]
            if other == law:
                assert parse_scene(swinging(kind, material, probes=probes)).probes[0].fields == [field]
            else:
                with pytest.raises(SceneError, match=r"probes\.0\.fields\.0"):
                    parse_scene(swinging(kind, material, probes=probes))


@pytest.mark.parametrize("law", LAWS)
def test_bonds_that_break_heat_nothing_again(law):
    """Forces are evaluated anew where bonds have broken, in no time: the step before has heated."""
    sim, ledger = run_steps(swinging("peridynamics", LAWS[law][0]), 40)
    assert min(ledger[name][-1] for name in ("control_heat", "plastic_work")) > 1e-4 * ledger["kinetic"][0]
    names = ("internal_energy", "temperature", "acting_stress")
    before = [sim.systems[0].particles.owned_rows(name).copy() for name in names]
    sim.systems[0].forces.evaluate_anew()
    for name, values in zip(names, before):
        found = sim.systems[0].particles.owned_rows(name)
        np.testing.assert_allclose(found, values, rtol=0.0, atol=1e-10 * np.abs(values).max(), err_msg=name)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"kind": "armstrong-frederick", "modulus": 0.0}, "modulus"),
        ({"kind": "armstrong-frederick", "modulus": 1e9, "recovery": -1.0}, "recovery"),
        ({"kind": "armstrong-frederick"}, "modulus"),
        ({"kind": "chaboche", "modulus": 1e9}, "kind"),
    ],
)
def test_hardening_without_sense_is_refused(change, key):
    with pytest.raises(SceneError) as refused:
        parse_scene(swinging("mpm", TURNING | {"kinematic_hardening": change}))
    assert f"kinematic_hardening.{key}" in str(refused.value)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"friction_angle": 90}, "friction_angle"),
        ({"dilation_angle": 31}, "dilation_angle"),
        ({"friction_angle": 0, "dilation_angle": 0, "cohesion": 0, "tension": 0}, "cohesion"),
        ({"tension": 200e6}, "tension"),
        ({"cap_pressure": -1.0}, "cap_pressure"),
        ({"compaction": 0.0}, "compaction"),
    ],
)
def test_soils_without_sense_are_refused(change, key):
    with pytest.raises(SceneError) as refused:
        parse_scene(swinging("ulsph", POWDER | {"flow_stress": POWDER["flow_stress"] | change}))
    assert f"flow_stress.{key}" in str(refused.value)


def test_a_cap_needs_both_its_numbers_and_the_cone_its_elasticity():
    flow = {name: value for name, value in POWDER["flow_stress"].items() if name != "compaction"}
    moduli = {name: POWDER[name] for name in ("kind", "density", "specific_heat", "flow_stress")}
    gas = {"kind": "mie-grueneisen", "sound_speed": 3000.0, "slope": 1.5, "gamma": 2.0}
    shear = {"kind": "varshni", "modulus": 1e9, "drop": 1e8, "temperature": 300.0}
    constant = {"kind": "constant", "modulus": 1e9}
    for material, key in (
        (POWDER | {"flow_stress": flow}, "flow_stress.compaction"),
        (moduli | {"equation_of_state": gas, "shear_modulus": constant}, "equation_of_state.kind"),
        (
            moduli | {"equation_of_state": {"kind": "linear", "bulk_modulus": 1e9}, "shear_modulus": shear},
            "shear_modulus",
        ),
        (POWDER | {"kinematic_hardening": TURNING["kinematic_hardening"]}, "kinematic_hardening"),
    ):
        with pytest.raises(SceneError) as refused:
            parse_scene(swinging("tlsph", material))
        assert f"material.{key}" in str(refused.value), key
