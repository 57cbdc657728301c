"""A start inside out, or with a deformation gradient that its displacement has not, is refused; what failures say."""

import pytest
from solids import Record, follow, simulation, tables

from parsolid.collective import SolverError
from parsolid.simulation.loop import RunFailed

METHODS = {
    "tlsph": {},
    "peridynamics": {"kind": "peridynamics"},
    "mpm": {"kind": "mpm", "cell": 0.25},
}
FOLDED = {"displacement": ["-1.5*X", "0"]}
SHEARED = {"displacement": ["0.2*Y", "where(X < 0.5, 0, 0.1*(X - 0.5))"]}
GRADIENT = [["1", "0.2"], ["where(X < 0.5, 0, 0.1)", "1"]]


def scene(kind: str, body: dict) -> dict:
    placed = body | ({"placement": "cells"} if kind == "mpm" else {})
    return tables((9, 9), method={**METHODS[kind]}, body=placed)


def test_a_negative_deformation_gradient_is_refused(comm):
    body = FOLDED | {"deformation_gradient": [["-0.5", "0"], ["0", "1"]]}
    with pytest.raises(SolverError, match=r"bodies\.0\.deformation_gradient: expected a start that is not folded"):
        simulation(scene("tlsph", body), comm)


@pytest.mark.serial
@pytest.mark.parametrize(
    "body",
    [
        SHEARED | {"deformation_gradient": [["1", "0.21"], *GRADIENT[1:]]},
        {"deformation_gradient": GRADIENT},
        SHEARED | {"deformation_gradient": [["1", "0.2"], ["where(X < 0.3, 0, 0.1)", "1"]]},
    ],
    ids=["other shear", "no displacement", "a kink elsewhere"],
)
@pytest.mark.parametrize("kind", ["tlsph", "mpm"])
def test_a_deformation_gradient_of_another_displacement_is_refused(kind, body, comm):
    with pytest.raises(SolverError, match=r"bodies\.0\.deformation_gradient: expected 1 \+ the gradient of bodies\.0"):
        simulation(scene(kind, body), comm)


@pytest.mark.serial
@pytest.mark.parametrize("kind", ["tlsph", "mpm"])
def test_one_that_fits_is_taken_on_either_side_of_a_kink(kind, comm):
    simulation(scene(kind, SHEARED | {"deformation_gradient": GRADIENT}), comm)


@pytest.mark.serial
def test_advice_is_of_what_the_scene_has_not(comm):
    for order, transfer, offered, not_offered in [
        ("usl", "flip", "order = 'musl' or transfer = 'apic'", "'usl'"),
        ("musl", "flip", "transfer = 'apic'", "order"),
        ("musl", "apic", "more particles", "order"),
    ]:
        data = tables(
            (4, 4), method={**METHODS["mpm"], "order": order, "transfer": transfer}, body={"placement": "cells"}
        )
        advice = simulation(data, comm).systems[0].advice()
        assert offered in advice and not_offered not in advice


@pytest.mark.serial
def test_no_negative_step_is_told(comm):
    sim = simulation(scene("peridynamics", {}), comm)

    def lost(time, step, ledger, announce):
        announce(False, 1.0)
        return True

    sim.systems[0].complete_step = lost
    with pytest.raises(RunFailed, match="the state was lost within the step") as error:
        follow(sim, Record(), 5)
    assert "time step" not in str(error.value)
