"""The ledger adds what systems tell it, under names that are apart where signs are, and balances it by the signs."""

from types import SimpleNamespace

import pytest
from small_scenes import METAL

import parsolid
from parsolid.scene.contact import CONTACT_TERMS, TIE_TERMS, TOOL_TERMS
from parsolid.simulation.ledger import Ledger, names_of_terms, terms_of, viscous_terms_of


def test_rates_and_terms_are_summed_over_ranks_and_balanced_by_their_signs(comm):
    ledger = Ledger({"crack": 1, "supplied": -1, "shown": 0})
    n = comm.size
    assert ledger.row(comm, 40.0 / n, 2.0 / n)["energy_error"] == 0.0 and ledger.initial == pytest.approx(42.0)
    ledger.add(2.0, 1.5, 2.5, 3.5)
    ledger.add_term("crack", 11.0)
    ledger.of({"other": "supplied", "same": "same"}).add_term("other", 13.0)
    ledger.of({"same": "same"}).add_term("shown", 17.0)
    ledger.of({"other": "supplied"}).add(1.0, 0.25, 0.5, 0.75)
    row = ledger.row(comm, 20.0, 1.0)
    assert list(row) == ledger.columns
    wanted = {"kinetic": 20.0, "strain_energy": 1.0, "material_dissipation": 3.25, "numerical_dissipation": 5.5}
    wanted |= {"external_work": 7.75, "crack": 11.0, "supplied": 13.0, "shown": 17.0}
    assert row == pytest.approx({name: n * value for name, value in wanted.items()} | {"energy_error": n * 20.0 - 42.0})
    assert ledger.of({"same": "same"}) is ledger


def system(kind, terms, viscous=()):
    settings = SimpleNamespace(kind=kind, energy_terms=lambda scene, bodies: terms[bodies], viscous_terms=viscous)
    return SimpleNamespace(settings=settings, bodies=0)


def scene(systems, **more):
    return SimpleNamespace(
        **{"systems": systems, "boundaries": [], "bodies": [], "contact": [], "tools": [], "tie": []} | more
    )


def test_a_term_of_another_sign_has_the_name_of_its_method():
    one, other = (
        system("one", [{"heat": 1, "loss": 1}], ("heat", "of other scenes")),
        system("other", [{"heat": -1, "loss": 1}], ("heat",)),
    )
    both = scene([one, other, one])
    assert names_of_terms(both) == [
        {"heat": "heat", "loss": "loss"},
        {"heat": "heat_other", "loss": "loss"},
        {"heat": "heat", "loss": "loss"},
    ]
    assert viscous_terms_of(both) == ("heat", "heat_other")
    assert terms_of(both) == {"heat": 1, "loss": 1, "heat_other": -1}


def test_contact_ties_tools_and_reporting_boundaries_have_terms():
    none, told = SimpleNamespace(reports=None), SimpleNamespace(reports="die")
    assert terms_of(scene([], boundaries=[none, told])) == {"die.work": 0}
    pressed = SimpleNamespace(model="kernel", friction=0.0)
    assert terms_of(scene([], contact=[pressed])) == CONTACT_TERMS
    assert terms_of(scene([], tools=[pressed])) == CONTACT_TERMS | TOOL_TERMS
    assert terms_of(scene([], tie=[1])) == TIE_TERMS


@pytest.mark.parametrize("kind", ["tlsph", "peridynamics", "mpm", "ulsph"])
def test_artificial_viscosity_of_solids_that_flow_is_told_in_every_method(tmp_path, kind):
    box = {"box": {"lower": [0, 0], "upper": [0.016, 0.004]}}
    body = {"shape": box, "particles": [16, 4], "placement": "cells", "material": METAL}
    body["velocity"] = ["-500*sign(X - 0.008)", 0]
    method = {"kind": kind} | ({"cell": 2e-3} if kind == "mpm" else {})
    scene = {"dimension": 2, "end_time": 2e-6, "method": method, "bodies": [body], "output": {"fields_times": []}}
    said = parsolid.run(scene, tmp_path).summary
    assert 0.01 < said["artificial_viscosity_share"] < 1.0
