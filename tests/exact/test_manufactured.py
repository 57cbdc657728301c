"""Manufactured solutions against values of another code (Uintah's), and their body forces against numerical
derivatives.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from parsolid.exact.manufactured import AxisAligned, GeneralisedVortex, Solid

DATA = json.loads((Path(__file__).parent / "manufactured_values.json").read_text())


class LogarithmicSolid(Solid):
    """With U'(J) J = lambda ln J."""

    def volumetric(self, J):
        return self.first_lame * np.log(J), self.first_lame / J


def solid_of(parameters: dict, logarithmic: bool = True) -> Solid:
    E, nu = parameters["E"], parameters["nu"]
    kind = LogarithmicSolid if logarithmic else Solid
    return kind(parameters["rho"], E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)))


def rows_of(name: str):
    block = DATA[name]
    for row in block["rows"]:
        yield dict(zip(block["cols"], row))


def test_axis_aligned_values():
    solution = AxisAligned(0.05, solid_of(DATA["AA"]["params"]))
    assert 2.0 * np.pi / solution.frequency == pytest.approx(DATA["AA"]["period"], rel=1e-14)
    for row in rows_of("AA"):
        X = np.array([[row["X"], row["Y"]]])
        found, force = solution.fields(X, row["t"]), solution.body_force(X, row["t"])
        np.testing.assert_allclose(found["displacement"][0], [row["ux"], row["uy"]], rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(found["velocity"][0], [row["vx"], row["vy"]], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(
            np.diag(found["stress"][0]), [row["sx"], row["sy"], row["sz"]], rtol=1e-10, atol=1e-6
        )
        np.testing.assert_allclose(force[0], [row["bx"], row["by"]], rtol=1e-10, atol=1e-8)


def test_vortex_values():
    solution = GeneralisedVortex(1.0, solid_of(DATA["GV"]["params"]))
    for row in rows_of("GV"):
        X = np.array([[row["X"], row["Y"]]])
        found, force = solution.fields(X, row["t"]), solution.body_force(X, row["t"])
        place = X[0] + found["displacement"][0]
        np.testing.assert_allclose(place, [row["x"], row["y"]], rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(found["velocity"][0], [row["vx"], row["vy"]], rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(force[0], [row["bx"], row["by"]], rtol=1e-9, atol=1e-11)
        radial = place / np.hypot(*place)
        hoop = np.array([-radial[1], radial[0]])
        stress = found["stress"][0, :2, :2]
        np.testing.assert_allclose(hoop @ stress @ radial, row["sig_rt"], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(hoop @ stress @ hoop, row["sig_tt"], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("logarithmic", [True, False])
@pytest.mark.parametrize("kind", [AxisAligned, GeneralisedVortex])
def test_body_force_balances_momentum(kind, logarithmic):
    """b = a - Div P / rho0 by differences, with P of the law from F of the motion."""
    solid = solid_of(DATA["AA"]["params"] | {"E": 1e4}, logarithmic)
    solution = kind(0.05, solid)
    X, t = np.array([[0.83, 0.31], [0.6, 0.72]]), 0.31
    step = 1e-4

    def deformation(X):
        F = np.tile(np.eye(2), (len(X), 1, 1))
        for i, e in enumerate(np.eye(2) * step):
            F[:, :, i] += (solution.fields(X + e, t)["displacement"] - solution.fields(X - e, t)["displacement"]) / (
                2 * step
            )
        return F

    def piola(X):
        F = deformation(X)
        inverse = np.linalg.inv(F).swapaxes(1, 2)
        volumetric, _ = solid.volumetric(np.linalg.det(F))
        return solid.mu * (F - inverse) + volumetric[:, None, None] * inverse

    divergence = sum(
        (piola(X + e)[:, :, i] - piola(X - e)[:, :, i]) / (2 * step) for i, e in enumerate(np.eye(2) * step)
    )
    velocity = [solution.fields(X, t + sign * step)["velocity"] for sign in (1, -1)]
    acceleration = (velocity[0] - velocity[1]) / (2 * step)
    wanted = acceleration - divergence / solid.density
    np.testing.assert_allclose(solution.body_force(X, t), wanted, rtol=1e-5, atol=1e-5 * np.abs(wanted).max())
    F = deformation(X)
    stress = piola(X) @ F.swapaxes(1, 2) / np.linalg.det(F)[:, None, None]
    scale = np.abs(stress).max()
    np.testing.assert_allclose(solution.fields(X, t)["stress"][:, :2, :2], stress, atol=1e-6 * scale)
