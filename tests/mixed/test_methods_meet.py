"""Bodies of several methods that meet: bars exchange their velocities, on any number of ranks and after a restart."""

import numpy as np
import pytest
from mixed.bodies_apart import RUBBER
from mpi4py import MPI
from solids import Record, follow, late_impulse

from parsolid.scene import SceneError, parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.loop import Simulation

SOLID = RUBBER | {"density": 1000.0, "poissons_ratio": 0.3}
# 2 L/c of a bar of 1 m
SPEED = np.sqrt(17e6 * 0.7 / (1.3 * 0.4) / 1000.0)
CLOSING = 0.0172 * SPEED
METHODS = {
    "sph": {"kind": "tlsph"},
    "bonds": {"kind": "peridynamics", "horizon_ratio": 2.0},
    "points": {"kind": "mpm", "cell": 2.0 / 25},
    "flow": {"kind": "ulsph", "skin": 0.01},
}
FLOW = {"kind": "linear-hardening", "yield_stress": 1e12, "hardening": 0.0}
METAL = SOLID | {"kind": "elastic-plastic", "specific_heat": 400.0, "taylor_quinney": 0.9, "flow_stress": FLOW}


def bars(first: str, second: str, **rest) -> dict:
    """Raw tables of two bars that close with a gap of half a spacing, guided at their sides; 25 spacings long."""
    h, bodies = 1.0 / 25, []
    for number, name in enumerate((first, second)):
        nodes, sign = name == "sph", 1.0 - 2.0 * number
        lower = [-1.0 - 0.5 * h, 0.0] if number == 0 else [0.0, 0.0]
        box = {"lower": lower, "upper": [lower[0] + 1.0, 5 * h]}
        kind = {"placement": "vertices" if nodes else "cells", "particles": [25 + nodes, 5 + nodes]}
        speed = [sign * 0.5 * CLOSING, 0.0]
        body = {"name": "ab"[number], "shape": {"box": box}, "velocity": speed, "method": name}
        body |= {"material": METAL if name == "flow" else SOLID}
        bodies.append(body | kind)
    methods = [{"name": name} | METHODS[name] for name in dict.fromkeys((first, second))]
    guided = [{"plane": f"Y = {place}", "kind": "roller"} for place in (0.0, 5 * h)]
    data = {"dimension": 2, "end_time": 3.7 / SPEED, "methods": methods, "bodies": bodies, "boundaries": guided}
    return data | {"contact": [{"bodies": ["a", "b"]}]} | rest


def momenta(sim) -> dict[str, np.ndarray]:
    """Of both bodies along the bars [N s], impulses that are on their way included."""
    found = np.zeros(2)
    for system in sim.systems:
        rows, owned = system.particles.owned_rows, system.owned
        along = system.mass[:owned] * system.share[:owned] * rows("velocity")[:, 0]
        along = along + late_impulse(system)[:, 0]
        np.add.at(found, np.asarray(system.bodies)[rows("body")], along)
    return {"momenta": sim.comm.allreduce(found)}


def test_points_that_are_pressed_from_the_start_take_no_energy_in_their_first_step():
    """Its impulse is that of the half after the start: nothing has moved before."""
    data = bars("points", "points")
    box = data["bodies"][0]["shape"]["box"]
    for end in ("lower", "upper"):
        # from half a spacing apart to a fiftieth of one in the other
        box[end][0] += 0.52 / 25
    columns = follow(Simulation(MPI.COMM_SELF, parse_scene(data)), Record(), 3)
    assert np.ptp(columns["contact_energy"]) > 0.02 * columns["kinetic"][0]
    assert np.abs(columns["energy_error"]).max() < 1e-3 * columns["kinetic"][0]


# restitution and the largest residual of the energy over what there was, at 25 spacings, as measured
@pytest.mark.parametrize(
    ("first", "second", "restitution", "residual"),
    [("sph", "points", 0.935, 2e-3), ("points", "points", 0.917, 5e-4), ("bonds", "points", 0.911, 1e-3)],
)
def test_bars_of_two_methods_exchange_their_velocities(first, second, restitution, residual):
    sim = Simulation(MPI.COMM_SELF, parse_scene(bars(first, second)))
    assert len(sim.systems) == 2
    found = follow(sim, Record(momenta))
    start, end, energy = found["momenta"][0], found["momenta"][-1], found["kinetic"][0]
    assert end[0] == pytest.approx(-restitution * start[0], rel=0.01) and end[1] == pytest.approx(-end[0], rel=1e-9)
    assert np.abs(found["momenta"].sum(axis=1)).max() < 1e-12 * np.abs(start).max()
    assert np.abs(found["energy_error"]).max() < residual * energy
    # they touch for 2 L/c, and not before the gap is closed
    touching = found["time"][found["contact_energy"] > 1e-9 * energy]
    assert touching[0] * CLOSING * 25 == pytest.approx(0.5, abs=0.05)
    assert (touching[-1] - touching[0]) * SPEED / 2.0 == pytest.approx(0.98, abs=0.08)
    assert found["contact_energy"][-1] < 1e-12 * energy


def test_within_one_body_a_grid_knows_no_contact():
    with pytest.raises(SceneError, match="contact: expected no such table within one body of this method"):
        parse_scene(bars("sph", "points", contact=[{"bodies": ["b"]}]))


def test_points_that_stay_pressed_do_not_give_way_for_ever():
    """APIC forgets what nodes do not see; places that followed such velocities sank, by 6 % of the force meanwhile."""
    ramp, end, h = 12.0 / SPEED, 36.0 / SPEED, 1.0 / 6.0
    data = bars("points", "points", end_time=end)
    for body, low in zip(data["bodies"], (-1.0, 0.0)):
        box = {"lower": [low, 0.0], "upper": [low + 1.0, 2.0 * h]}
        body |= {"shape": {"box": box}, "particles": [6, 2], "velocity": [0.0, 0.0]}
    data["methods"] = [METHODS["points"] | {"name": "points", "cell": 2.0 * h, "transfer": "apic"}]
    rate = f"-{0.02 / ramp}*(1 - cos(2*pi*t/{ramp}))*where(t < {ramp}, 1, 0)"
    last = {"lower": [1.0 - 2.0 * h, -1.0], "upper": [2.0, 1.0]}
    data["boundaries"] = [{"plane": f"Y = {place}", "kind": "roller"} for place in (0.0, 2.0 * h)]
    data["boundaries"] += [{"plane": "X = -1", "kind": "roller", "body": "a"}]
    data["boundaries"] += [{"kind": "velocity", "box": last, "body": "b", "velocity": [rate, "free"]}]

    def pressing(sim) -> dict[str, float]:
        rows = sim.systems[0].particles.owned_rows
        return {"force": -float(rows("contact_force")[:, 0].sum())}

    found = follow(Simulation(MPI.COMM_SELF, parse_scene(data)), Record(pressing))
    early, late = ((found["time"] * SPEED > begin) & (found["time"] * SPEED < begin + 6.0) for begin in (14.0, 30.0))
    assert found["force"][late].mean() > 0.97 * found["force"][early].mean() > 0.0
    lost = found["numerical_dissipation"]
    assert lost[late].mean() - lost[early].mean() < 0.05 * found[stored_energy(found)].max()
