"""A start inside out, or with a deformation gradient that its displacement has not, is refused; what failures say."""

import pytest
from solids import simulation, tables

from parsolid.collective import SolverError

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
