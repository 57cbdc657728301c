"""Equilibria of bodies that flow or relax: exact solutions, tangents, ranks, restarts, and what is refused."""

import numpy as np
import pytest
from solids import Record, follow, gathered, run_to_end, simulation
from tlsph.test_static import box, static

from parsolid.materials.plastic.drucker_prager import cone
from parsolid.observables.declared import Observables
from parsolid.simulation.time_step import TimeSteps

E, NU, YIELD, SLOPE = 200.0, 0.3, 0.4, 2.0
METAL = {
    "kind": "elastic-plastic",
    "density": 1.0,
    "specific_heat": 1.0,
    "taylor_quinney": 0.0,
    "youngs_modulus": E,
    "poissons_ratio": NU,
    "flow_stress": {"kind": "linear-hardening", "yield_stress": YIELD, "hardening": SLOPE},
}
KINEMATIC = METAL | {
    "flow_stress": {"kind": "linear-hardening", "yield_stress": YIELD},
    "kinematic_hardening": {"kind": "armstrong-frederick", "modulus": SLOPE},
}
RATE, SENSITIVITY = 1e-3, 0.05
FAST = METAL | {
    "melting": {"kind": "constant", "temperature": 1300.0},
    "flow_stress": {
        "kind": "johnson-cook",
        "yield_stress": YIELD,
        "hardening": SLOPE,
        "exponent": 0.5,
        "thermal_exponent": 1.0,
        "rate_sensitivity": SENSITIVITY,
        "reference_rate": RATE,
        "reference_temperature": 300.0,
    },
}
SOIL = METAL | {"flow_stress": {"kind": "drucker-prager", "friction_angle": 30, "dilation_angle": 30, "cohesion": 0.3}}
VISCOUS = {"kind": "mooney-rivlin", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
VISCOUS |= {"branches": [{"beta": 1.0, "tau": 0.5}, {"beta": 0.5, "tau": 4.0}]}


def bar(material, stretch):
    """A cube between rollers, pulled along X."""
    sides = [{"plane": f"{axis} = 0", "kind": "roller"} for axis in "XYZ"]
    pulled = {"plane": "X = 1", "kind": "displacement", "displacement": [stretch, "free", "free"]}
    data = box((1.0, 1.0, 1.0), "cells", boundaries=[*sides, pulled | {"name": "end", "reaction": True}])
    data["bodies"][0] |= {"material": material, "particles": [4, 4, 4]}
    return data


def stepped(data, comm):
    """The simulation after 16 steps of its second, and its ledger."""
    sim = simulation(data, comm)
    sim.ledger.row(comm, *sim.energies())
    for _ in range(16):
        sim.take_step(1.0 / 16.0)
    return sim, sim.ledger.row(comm, *sim.energies())


@pytest.mark.serial
@pytest.mark.parametrize("material", [METAL, KINEMATIC], ids=["isotropic", "kinematic"])
def test_bar(comm, material):
    """Pulled beyond yield and pushed beyond it: the stress of small strain, and energy that closes."""
    sim, row = stepped(bar(material, "0.01*where(t < 0.5, 2*t, 2 - 2*t)"), comm)
    P = sim.systems[0].shown("first_piola_kirchhoff_stress", 0, sim.systems[0].owned)
    turned = YIELD + SLOPE * E / (E + SLOPE) * (0.01 - YIELD / E)
    elastic = turned - 2.0 * (YIELD if material is KINEMATIC else turned)
    way = 0.01 - (turned - elastic) / E
    expected = elastic - SLOPE * E / (E + SLOPE) * way
    for one in P:
        np.testing.assert_allclose(one[0, 0], expected, rtol=0.01)
        np.testing.assert_allclose(one[1, 1], 0.0, atol=1e-8)
    assert abs(row["energy_error"]) < 1e-9 * row["external_work"]
    there = 0.5 * (YIELD + turned) * (0.01 - turned / E)
    back = -0.5 * (elastic + expected) * way * E / (E + SLOPE)
    assert row["plastic_work"] == pytest.approx(there + back, rel=0.02)


@pytest.mark.serial
def test_rate(comm):
    """Pulled at a rate: the flow stress of Johnson and Cook at it, and energy that closes."""
    sim, row = stepped(bar(FAST, "0.02*t"), comm)
    P, whole = sim.systems[0].shown("first_piola_kirchhoff_stress", 0, sim.systems[0].owned), np.log(1.02)
    strain = whole
    for _ in range(20):
        stress = (YIELD + SLOPE * np.sqrt(strain)) * (1.0 + SENSITIVITY * np.log(0.02 / RATE))
        strain = whole - stress / E
    np.testing.assert_allclose(P[:, 0, 0], stress * np.exp(-strain - 2.0 * NU * stress / E), rtol=0.005)
    assert abs(row["energy_error"]) < 1e-9 * row["external_work"]


@pytest.mark.serial
def test_soil(comm):
    """Crushed between rollers with an associated flow: Drucker and Prager's strength in uniaxial compression."""
    sim, row = stepped(bar(SOIL, "-0.02*t"), comm)
    eta, k = cone(np.radians(30.0), 0.3)
    expected = np.zeros((3, 3))
    expected[0, 0] = -k / (1.0 / np.sqrt(3.0) - eta / 3.0)
    for stress in np.reshape(Observables(sim.systems).field("stress"), (-1, 3, 3)):
        np.testing.assert_allclose(stress, expected, rtol=0.0, atol=1e-5)
    assert abs(row["energy_error"]) < 1e-9 * row["external_work"]
    assert row["plastic_work"] > 0.5 * row["external_work"]


@pytest.mark.serial
def test_relaxation(comm):
    """A block sheared at once relaxes as the exact solution of its branches, and loses what it does not store."""
    shear = 0.4
    driven = [
        {"plane": plane, "kind": "displacement", "displacement": [f"{shear}*Y", "0"]}
        for plane in ("X = 0", "X = 1", "Y = 0", "Y = 1")
    ]
    data = box((1.0, 1.0), "cells", boundaries=driven)
    data["bodies"][0]["material"] = VISCOUS
    sim, rows = run_to_end(data, comm)
    P = sim.systems[0].shown("first_piola_kirchhoff_stress", 0, sim.systems[0].owned)
    mu, F = 3.0 / 2.6, np.array([[1.0, shear, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    inverse = np.linalg.inv(F)
    elastic = simulation(data | {"bodies": [data["bodies"][0] | {"material": {**VISCOUS, "branches": []}}]}, comm)
    elastic.take_step(0.0)
    expected = elastic.systems[0].shown("first_piola_kirchhoff_stress", 0, elastic.systems[0].owned)
    for beta, tau in ((1.0, 0.5), (0.5, 4.0)):
        C = F.T @ F
        A = np.linalg.inv(C) + (np.eye(3) - np.linalg.inv(C)) * np.exp(-1.0 / tau)
        expected = expected + beta * mu * (F @ A - inverse.T)
    np.testing.assert_allclose(P, expected, rtol=0.0, atol=1e-8)
    assert abs(rows["energy_error"][-1]) < 1e-4 * rows["strain_energy"].max()


def crept(lame, shear, tau, t):
    """Strain over stress of a small strip in plane strain under a load at once, whose shear modulus relaxes from twice
    its value: the inverse of Laplace's transform of (lambda + 2 G)/(4 G (lambda + G)), G = shear (1 + 2 s)/(1 + s)."""
    below = np.polynomial.Polynomial([1.0, tau])
    above = shear * np.polynomial.Polynomial([1.0, 2.0 * tau])
    numerator, denominator = below * (lame * below + 2.0 * above), 4.0 * above * (lame * below + above)
    parts = [numerator(r) / (r * denominator.deriv()(r)) * np.exp(r * t) for r in denominator.roots()]
    return numerator(0.0) / denominator(0.0) + sum(parts)


@pytest.mark.serial
@pytest.mark.parametrize("ratio", [0.3, 0.4999])
def test_creep(shared_path, comm, ratio):
    """A plate under a load at once goes on to strain; of second order in the load step."""
    shear, tau = 3.0 / (2.0 + 2.0 * ratio), 0.3
    lame = 2.0 * shear * ratio / (1.0 - 2.0 * ratio)
    law = {"kind": "mooney-rivlin", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": ratio}
    held = [{"plane": f"{axis} = 0", "kind": "roller"} for axis in "XY"]
    load = {"plane": "X = 1", "kind": "traction", "traction": ["1e-5", "0"]}
    errors = []
    for step in (0.125, 0.0625):
        body = {"material": law | {"branches": [{"beta": 1.0, "tau": tau}]}}
        data = static(shared_path, method={"maximum_step": step}, body=body, boundaries=[*held, load])
        sim = simulation(data, comm)
        follow(sim, Record(), policy=TimeSteps)
        X, u = gathered(sim, "reference_position", "displacement")
        errors.append(u[X[:, 0] == 1.0, 0] / (1e-5 * crept(lame, shear, tau, 1.0)) - 1.0)
    assert np.abs(errors[0]).max() < 1e-3
    assert np.abs(errors[1]).max() < 0.3 * np.abs(errors[0]).max()


def pulled(folder, material):
    """A strip of triangles, clamped at one end and pulled across at the other."""
    load = {"plane": "X = 2", "kind": "traction", "traction": ["0.01*t", "0.05*t" if material is METAL else "0.03*t"]}
    boundaries = [{"plane": "X = 0", "kind": "fixed"}, load]
    return static(folder, counts=(8, 4), scale=0.25, boundaries=boundaries, body={"material": material})


@pytest.mark.serial
@pytest.mark.parametrize("material", [METAL, KINEMATIC, VISCOUS], ids=["flow", "kinematic", "relaxation"])
def test_tangent(shared_path, comm, material):
    """It is the change of forces."""
    statics = (sim := simulation(pulled(shared_path, material), comm)).systems[0].statics
    sim.take_step(0.2)
    u = gathered(sim, "displacement")[0]
    own = sim.systems[0].particles.owned_rows("displacement").copy()
    assert np.abs(u).max() > 1e-4
    # onwards, so that what flows goes on
    statics.history.elapsed = 0.1
    rate, h = 0.1 * own, 1e-6
    change = np.cos(7.0 * own * 100.0 + np.arange(own.size).reshape(own.shape)) * 1e-2 * np.abs(u).max()
    forces = []
    for part in (1.0, -1.0):
        statics._deform(own + rate + part * h * change)
        forces.append(statics.internal_force())
    statics._deform(own + rate)
    statics.linearise()
    expected = (forces[1] - forces[0]) / (2.0 * h)
    found = statics.tangent.product(change)
    # that of flow lacks what is not symmetric, stresses beside moduli
    part = 1e-6 if material is VISCOUS else 5e-3
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=part * np.abs(expected).max())
