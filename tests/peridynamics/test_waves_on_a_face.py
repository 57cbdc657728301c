"""How stiff a face is to a load that varies along it within a horizon or two, beside the exact half plane."""

import face_stiffness
import numpy as np
import pytest
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

LENGTH, DEPTH = 8, 20


def displacement(coefficient: float) -> float:
    """Amplitude of the first two layers under (0, cos k X) on both, k = pi/8 over the spacing."""
    body = {"shape": {"box": {"lower": [0, -DEPTH], "upper": [LENGTH, 0]}}, "particles": [LENGTH, DEPTH]}
    body |= {"placement": "cells"}
    body["material"] = {"kind": "linear-elastic", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    rollers = [{"plane": plane, "kind": "roller"} for plane in ("X = 0", f"X = {LENGTH}", f"Y = {-DEPTH}")]
    load = f"0.5*cos({np.pi / LENGTH}*X)*where(Y > -2, 1, 0)"
    method = {"kind": "peridynamics", "solution": {"kind": "quasi-static", "step": 1.0}}
    method |= {"stabilisation": {"coefficient": coefficient}}
    data = {"dimension": 2, "end_time": 1.0, "method": method, "bodies": [body], "boundaries": rollers}
    data["loads"] = {"body_force": ["0", load]}
    simulation = Simulation(MPI.COMM_SELF, parse_scene(data))
    simulation.run()
    rows = simulation.systems[0].particles.owned_rows
    place, here = rows("reference_position"), rows("reference_position")[:, 1] > -2.0
    moved = (rows("position") - place)[here, 1]
    return float(2.0 * (moved * np.cos(np.pi / LENGTH * place[here, 0])).mean())


@pytest.mark.parametrize("coefficient, least, most", [(0.125, 0.0, 0.03), (0.35, 0.2, 0.3)])
def test_the_face_is_as_stiff_as_the_half_planes_with_the_control_of_bonds(monkeypatch, coefficient, least, most):
    """And too stiff with that of beams."""
    k = np.pi / LENGTH
    stiffness = 1.0 / displacement(coefficient) / (0.5 * face_stiffness.PLANE * k)
    assert stiffness == pytest.approx(face_stiffness.peridynamics(k, 3, coefficient), rel=2e-3)
    error = stiffness / face_stiffness.exact(k) - 1.0
    assert least < error < most, error
