"""Motion in long steps: order on an exact vibration, energy and angular momentum, ranks, restarts, failures, stages."""

import numpy as np
import pytest
from solids import gathered, supports, tables
from tlsph.test_mesh_weights import of_mesh
from tlsph.test_stages import MOVING, STILL, run, staged

from parsolid.methods.tlsph.implicit import solve_upper, upper_root

LONG = {"integrator": "implicit"}


def implicit(data, method=None, weights="fourth-order"):
    """The tables with steps of implicit dynamics."""
    data["method"] = {"kind": "tlsph", "weights": weights, **LONG, **(method or {})}
    return data | {"output": {"fields_interval": data["end_time"]}}


def spinning(end_time=2.0, method=None, folder=None, **rest):
    """A free bar that turns and bends, as a box or as a mesh."""
    body = {"velocity": ["-(Y - 0.25)", "X - 0.5 + 0.5*sin(2*pi*X)"]}
    if folder is not None:
        data = of_mesh(folder, "triangle", 2, counts=(8, 4), scale=0.125, moving=0.0, body=body) | {
            "end_time": end_time
        }
        return implicit(data | rest, method, "mesh")
    return implicit(tables((17, 9), (1.0, 0.5), end_time=end_time, body=body, **rest), method, "cells")


def test_upper_root():
    F = np.eye(3) + 0.3 * np.random.default_rng(1).normal(size=(5, 3, 3))
    C = F.swapaxes(1, 2) @ F
    root = upper_root(C)
    np.testing.assert_allclose(root.swapaxes(1, 2) @ root, C, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(root @ solve_upper(root, F), F, rtol=0.0, atol=1e-13)


@pytest.mark.serial
def test_order_on_an_exact_vibration(comm):
    """A block between rollers that swings along X and passes rest after a period, at an order of 2 in the step."""
    mu, lame = 3.0 / 2.6, 3.0 * 0.3 / (1.3 * 0.4)
    frequency, errors = np.pi * np.sqrt((lame + 2.0 * mu) / 1.1), []
    body = {"velocity": ["1e-4*cos(pi*X)", "0"]}
    period, planes = 2.0 * np.pi / frequency, supports(Y0=(0.0, "roller"), Y1=(0.5, "roller"))
    for count in (20, 40):
        block = tables((33, 9), (1.0, 0.5), end_time=2.0 * period, body=body, boundaries=planes)
        sim, rows = run(implicit(block, {"maximum_step": period / count}), comm)
        X, x = gathered(sim, "reference_position", "position")
        errors.append(np.abs(x - X).max() * frequency / 1e-4)
        assert np.abs(rows["energy_error"]).max() < 1e-6 * rows["kinetic"].max()
    assert errors[1] < 0.03
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.serial
def test_all_stages(comm):
    """Pressed in equilibrium, struck in short steps, and left to swing in long ones, beside short steps alone."""
    swings = LONG | {"accuracy": 2e-4}
    load = ["0", "-0.1*min(t, 1) - 0.05*where(t > 1, where(t < 1.5, sin(2*pi*(t - 1))**2, 0), 0)"]
    data = staged(STILL, (1.0, MOVING | {"dissipation": 0.0}), (1.6, swings), load=load, end_time=3.0)
    both = [run(data | {"stages": data["stages"][:count]}, comm) for count in (1, 2)]
    (_, short), (_, long) = both
    assert np.abs(long["energy_error"]).max() < 2e-4 * long["strain_energy"].max()
    (X, one), (_, other) = (gathered(sim, "reference_position", "position") for sim, _ in both)
    assert np.abs(one - other).max() < 0.05 * np.abs(one - X).max()


@pytest.mark.serial
def test_from_rest(comm):
    """A body waits at rest in long steps for a load that comes later."""
    load = {"plane": "X = 1", "kind": "traction", "traction": ["0", "1e-3*max(t - 1, 0)"]}
    data = tables((9, 9), (1.0, 1.0), end_time=2.0, boundaries=[{"plane": "X = 0", "kind": "fixed"}, load])
    _, rows = run(implicit(data, {"maximum_step": 0.2, "accuracy": 1e-2}), comm)
    assert rows["kinetic"][rows["time"] < 1.0].max() < 1e-20 < rows["kinetic"][-1]


@pytest.mark.serial
def test_driven(comm):
    """Work of what is prescribed, of a load and of a pressure that follows; places are exact."""
    held = [
        {"plane": "X = 0", "kind": "velocity", "velocity": ["0.2*sin(pi*t)", "0"]},
        {"plane": "X = 1", "kind": "pressure", "pressure": "0.05*t"},
        {"plane": "Y = 0.5", "kind": "spring", "stiffness": 0.2},
    ]
    data = implicit(tables((17, 9), (1.0, 0.5), end_time=2.0, boundaries=held))
    sim, rows = run(data | {"loads": {"acceleration": ["0", "-0.1"]}}, comm)
    assert np.abs(rows["energy_error"]).max() < 1e-3 * np.abs(rows["external_work"]).max()
    X, x = gathered(sim, "reference_position", "position")
    np.testing.assert_allclose(x[X[:, 0] == 0.0], X[X[:, 0] == 0.0], rtol=0.0, atol=1e-6)
