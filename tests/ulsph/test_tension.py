"""Elastic matter holds in tension: neighbours keep the weights of their reference distance while both pull."""

import numpy as np
import pytest
from solids import simulation, supports
from ulsph.plates import block, scene

YOUNG, POISSON, DENSITY = 1e6, 0.3, 1e3
LAME = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
SHEAR = YOUNG / (2 * (1 + POISSON))
ELASTIC = {
    "kind": "elastic-plastic",
    "density": DENSITY,
    "specific_heat": 1e3,
    "youngs_modulus": YOUNG,
    "poissons_ratio": POISSON,
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 1e12},
}


def pulled(particles, upper, rate, strain, method=None, **keys) -> dict:
    """A block between rollers, pulled along X at the end where it is not held, and moving as pulled from the start."""
    body = block(particles, list(upper), ELASTIC, velocity=[f"{rate}*X", *["0"] * (len(particles) - 1)], **keys)
    held = [f"{rate * upper[0]}", *["free"] * (len(particles) - 1)]
    end = {"kind": "velocity", "plane": f"X = {upper[0]}", "velocity": held}
    sides = {f"{axis}{k}": (place, "roller") for axis, u in zip("YZ", upper[1:]) for k, place in enumerate((0.0, u))}
    planes = [*supports(X=(0.0, "roller"), **sides), end]
    return scene(body, end_time=strain / rate, method=method, boundaries=planes)


def mean_stress(comm, system) -> float:
    """Mean axial Cauchy stress by mass [Pa]."""
    rows = system.particles.owned_rows
    stress = rows("deviator")[:, 0].copy()
    for solid, here in system.parts():
        stress[here] -= solid.pressures(system.particles, here)
    mass = rows("mass")
    return comm.allreduce(float(mass @ stress)) / comm.allreduce(float(mass.sum()))


@pytest.mark.serial
@pytest.mark.parametrize(
    "particles, upper, method",
    [
        ((20, 10), (1.0, 0.5), {}),
        ((17, 6), (1.0, 0.35), {"viscosity": False}),
        ((20, 10), (1.0, 0.5), {"kernel": "wendland-c2", "smoothing": 2.0}),
        ((10, 5, 5), (1.0, 0.5, 0.5), {}),
    ],
)
def test_a_pulled_block_holds(particles, upper, method, comm):
    """At 30 % its stress is (lambda + 2 mu) ln 1.3, the integral of the rate of stress, but for waves; the artificial
    viscosity has next to nothing of the energy. It tore at 5 to 10 %."""
    data = pulled(particles, upper, 0.5, 0.3, method)
    sim = simulation(data, comm)
    sim.run()
    assert mean_stress(comm, sim.systems[0]) == pytest.approx((LAME + 2 * SHEAR) * np.log(1.3), rel=0.03)
    row = sim.energy_row()
    assert row["viscous_heat"] < 1e-3 * row["internal_energy"]


@pytest.mark.serial
def test_a_free_bar_swings_as_long_as_it_should(comm):
    """A bar, free all around, whose halves move apart: after half a period of its lowest wave along it they do so again
    the other way round, with their energy."""
    speed = np.sqrt(YOUNG / (1 - POISSON**2) / DENSITY)
    body = block([24, 6], [1.2, 0.3], ELASTIC, velocity=[f"{-0.12 * speed}*cos(pi*X/1.2)", "0"])
    sim = simulation(scene(body, end_time=1.2 / speed, method={"viscosity": False}), comm)
    began = sim.energy_row()["kinetic"]
    rows = sim.systems[0].particles.owned_rows
    sim.run()
    assert sim.energy_row()["kinetic"] > 0.9 * began
    place, velocity = rows("position")[:, 0], rows("velocity")[:, 0]
    assert comm.allreduce(float((np.sign(place - 0.6) * velocity).sum())) < 0.0


@pytest.mark.serial
@pytest.mark.parametrize("smoothing, told", [(1.3, True), (1.6, False)])
def test_elastic_matter_that_tears_is_told(smoothing, told, comm):
    """All of it is driven to a stretch of 1.9, at which neighbours across a diagonal of wider kernels still reach one
    another."""
    data = pulled((8, 4), (1.0, 0.5), 200.0, 0.9, {"smoothing": smoothing})
    everywhere = {"lower": [-1.0, -1.0], "upper": [2.0, 2.0]}
    data["boundaries"] = [{"kind": "velocity", "box": everywhere, "velocity": ["200*X", "0"]}]
    sim = simulation(data, comm)
    assert sim.systems[0].validity_warning() is None
    sim.run()
    assert (sim.systems[0].validity_warning() is not None) == told


@pytest.mark.parametrize("flowed", [False, True])
def test_a_tear_between_ranks_is_told(flowed, comm):
    """The half of a block moves away from the other one, which on two ranks no rank has a pair across; matter of one
    half that has flowed parts freely."""
    data = pulled((8, 4), (1.0, 0.5), 200.0, 0.18)
    everywhere = {"lower": [-1.0, -1.0], "upper": [2.0, 2.0]}
    data["boundaries"] = [{"kind": "velocity", "box": everywhere, "velocity": ["where(X > 0.5, 200, 0)", "0"]}]
    data["bodies"][0]["velocity"] = ["where(X > 0.5, 200, 0)", "0"]
    sim = simulation(data, comm)
    rows = sim.systems[0].particles.owned_rows
    rows("plastic_strain")[:] = 0.1 * flowed * (rows("reference_position")[:, 0] > 0.5)
    sim.run()
    assert (sim.systems[0].validity_warning() is None) == flowed
