"""A tube wound with hoop fibres under inner pressure: its radii against the radial equation, solved by collocation."""

import subprocess
import sys

import meshio
import numpy as np
import pytest
import tomli_w
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from parsolid.output.history import read_history

INNER, OUTER, PRESSURE, RISE = 0.01, 0.015, 2e4, 0.07
SHEAR, BULK, K1, K2, KAPPA = 5e4, 1e6, 1e5, 2.0, 0.1
TISSUE = {
    "kind": "gasser-ogden-holzapfel",
    "density": 1000.0,
    "shear_modulus": SHEAR,
    "bulk_modulus": BULK,
    "fibre_modulus": K1,
    "fibre_exponent": K2,
    "dispersion": KAPPA,
    "fibre": {"angle": "atan2(Y, X) + pi/2"},
}


def nominal(a, b):
    """Radial and hoop stress [Pa] of stretches a and b in plane strain: mu/2 (I1bar - 3), K/4 (J^2 - 1 - 2 ln J), k1/(2
    k2) [exp(k2 E^2) - 1] of E = kappa I1 + (1 - 3 kappa) b^2 - 1."""
    J, first = a * b, a * a + b * b + 1.0
    g, U = SHEAR * J ** (-2.0 / 3.0), 0.5 * BULK * (J - 1.0 / J)
    E = max(KAPPA * first + (1.0 - 3.0 * KAPPA) * b * b - 1.0, 0.0)
    W = 2.0 * K1 * E * np.exp(K2 * E * E)
    radial = g * (a - first / (3.0 * a)) + U * b + W * KAPPA * a
    return radial, g * (b - first / (3.0 * b)) + U * a + W * (1.0 - 2.0 * KAPPA) * b


def radii():
    """Inner and outer radius [m] under the pressure: d P_r/dR = (P_t - P_r)/R, P_r = -p r/R inside and 0 outside."""

    def rates(R, y):
        stretches = [
            (brentq(lambda a, b=b, P=P: nominal(a, b)[0] - P, 0.2, 3.0, xtol=1e-13), b) for b, P in zip(y[0] / R, y[1])
        ]
        hoop = np.array([nominal(a, b)[1] for a, b in stretches])
        return np.array([[a for a, _ in stretches], (hoop - y[1]) / R])

    R = np.linspace(INNER, OUTER, 11)
    y = np.array([R, np.zeros_like(R)])
    for load in (0.25, 0.5, 0.75, 1.0):
        found = solve_bvp(
            rates, lambda ya, yb, p=load * PRESSURE: np.array([ya[1] + p * ya[0] / INNER, yb[1]]), R, y, tol=1e-6
        )
        assert found.success
        R, y = found.x, found.y
    return y[0, 0], y[0, -1]


def quarter(path, across):
    """A mesh of a quarter of the tube with so many elements across."""
    around = round(3.9 * across)
    R, angle = np.meshgrid(np.linspace(INNER, OUTER, across + 1), np.linspace(0.0, np.pi / 2.0, around + 1))
    points = np.stack([R * np.cos(angle), R * np.sin(angle), 0.0 * R], axis=-1)
    points[np.abs(points) < 1e-15] = 0.0
    number = np.arange(R.size).reshape(R.shape)
    cells = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    meshio.Mesh(points.reshape(-1, 3), [("quad", cells)]).write(path)


@pytest.mark.slow
def test_radii_of_a_wound_tube_are_those_of_the_radial_equation(tmp_path):
    """Inside it widens by 17.8 %: 0.3 % less with four elements across, as stresses at nodes are softer."""
    quarter(tmp_path / "tube.vtu", 4)
    rise = f"ramp(t, 0, {RISE})"
    scene = {
        "dimension": 2,
        "end_time": 0.09,
        "method": {"kind": "tlsph"},
        "bodies": [{"shape": {"mesh": {"file": "tube.vtu"}}, "material": TISSUE}],
        "regions": [{"name": "inside", "formula": f"X*X + Y*Y < {(1.02 * INNER) ** 2}"}],
        "boundaries": [
            {"plane": "X = 0", "kind": "roller"},
            {"plane": "Y = 0", "kind": "roller"},
            {
                "kind": "pressure",
                "where": "inside",
                "pressure": f"{PRESSURE}*{rise}**3*(10 - 15*{rise} + 6*{rise}**2)",
            },
        ],
        "probes": [
            {"name": "inner", "at": [INNER, 0.0], "fields": ["position"]},
            {"name": "outer", "at": [OUTER, 0.0], "fields": ["position"]},
        ],
        "output": {"history_interval": 1e-3, "pictures": False},
    }
    (tmp_path / "tube.toml").write_text(tomli_w.dumps(scene))
    command = [sys.executable, "-m", "parsolid", "run", tmp_path / "tube.toml", "-q", "-o", tmp_path / "results"]
    subprocess.run(command, check=True)
    found = {name: np.array(values) for name, values in read_history(tmp_path / "results" / "history.csv").items()}
    late = found["time"] > RISE
    for name, radius, at_rest in zip(("inner", "outer"), radii(), (INNER, OUTER)):
        moved = found[f"{name}.position_x"][late].mean() - at_rest
        assert moved == pytest.approx(radius - at_rest, rel=5e-3), name
