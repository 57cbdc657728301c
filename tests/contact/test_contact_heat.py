"""Heat of friction: each body of a pair gets half of what is lost, where its law has a temperature."""

import numpy as np
import pytest
from contact.meeting import BONDS, SOFT, SPH, block, simulated, tables
from mpi4py import MPI
from solids import COPPER as SHOCKED_COPPER
from solids import recorded

COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
MICRO = {"kind": "micro-inertia", "library": "4340 steel, Rahaman"}
FLOW, POINTS = {"kind": "ulsph"}, {"kind": "mpm", "cell": 2.0, "order": "musl"}


def slider(upper, lower, slide=20.0, material=COPPER, **more) -> dict:
    """A block that rubs along another one as both meet, each by its method; spacing 1 m."""
    top = block("top", (0.2, 0.0), (6.2, 3.0), (6, 3), "cells", velocity=[slide, -20.0], material=material)
    base = block("base", (-1.0, -3.0), (7.0, 0.0), (8, 3), "cells", velocity=[0.0, 20.0], material=COPPER)
    pair = [{"bodies": ["top", "base"], "friction": 0.3}]
    if upper is lower:
        base["material"] = material
        return tables(top, base, method=upper, contact=pair, **({"end_time": 2e-3} | more))
    data = tables(top | {"method": "a"}, base | {"method": "b"}, contact=pair, **({"end_time": 2e-3} | more))
    del data["method"]
    return data | {"methods": [{"name": name} | method for name, method in (("a", upper), ("b", lower))]}


def run(data, comm):
    """The columns of the history, heat [J] that each body got, and what that is by the rise of temperatures."""
    sim, got, shown = simulated(data, comm), np.zeros(2), np.zeros(2)
    for system in sim.systems:
        if system.takes_heat:
            _watch(system, got, shown)
    return recorded(sim), comm.allreduce(got), comm.allreduce(shown)


def _watch(system, got, shown) -> None:
    take, holder = system.take_heat, system if hasattr(system, "laws") else system.points
    laws = getattr(holder, "laws_of_bodies", holder.laws)

    def watched(heat, rows):
        owned = system.particles.owned_rows
        body, before = np.asarray(system.bodies)[owned("body")[rows]], owned("temperature")[rows]
        stored = take(heat, rows)
        capacity = laws[0].specific_heat * system.mass[rows]
        np.add.at(got, body, heat)
        np.add.at(shown, body, capacity * (owned("temperature")[rows] - before))
        return stored

    system.take_heat = watched


@pytest.mark.serial
@pytest.mark.parametrize("method", [FLOW, POINTS, SPH, BONDS], ids=["ulsph", "mpm", "tlsph", "peridynamics"])
def test_each_body_gets_half_of_it_and_the_ledger_counts_it_once(comm, method):
    material = COPPER if method in (FLOW, POINTS) else SHOCKED_COPPER
    columns, got, shown = run(slider(method, method, material=material), comm)
    lost = columns["friction_dissipation"]
    assert lost[-1] > 5e-3 * columns["kinetic"][0] and got.sum() == pytest.approx(lost[-1], rel=1e-12)
    # what a particle still held when it opened is its own
    assert got[0] == pytest.approx(got[1], rel=0.01) and shown == pytest.approx(got, rel=1e-9)
    np.testing.assert_allclose(columns["friction_heat"], lost, rtol=0.0, atol=1e-12 * lost[-1])
    # not more out of balance than the method without friction, see docs/contact.md
    assert abs(columns["energy_error"][-1]) < 4e-3 * columns["kinetic"][0]


def test_a_law_whose_stored_energy_knows_no_heat_is_warmed():
    columns, got, shown = run(slider(FLOW, FLOW, material=MICRO, end_time=1e-3), MPI.COMM_SELF)
    assert "friction_heat" not in columns and shown == pytest.approx(got, rel=1e-9)
    assert got.sum() == pytest.approx(columns["friction_dissipation"][-1], rel=1e-12) and got.min() > 0.0


def test_of_a_body_without_a_temperature_its_half_has_left():
    rubber = SOFT | {"youngs_modulus": 1e9, "density": 1e3}
    columns, got, _ = run(slider(SPH, POINTS, material=rubber), MPI.COMM_SELF)
    assert got[1] == pytest.approx(0.5 * columns["friction_dissipation"][-1], rel=1e-10) and got[0] == 0.0
    assert columns["friction_heat"][-1] == pytest.approx(got[1], rel=1e-12) and got[1] > 0.0


def test_a_rigid_tool_leaves_half_of_it_to_the_body():
    data = slider(POINTS, POINTS)
    del data["contact"], data["bodies"][1]
    floor = {"plane": {"point": [0.0, -0.01], "normal": [0.0, 1.0]}}
    data["tools"] = [{"name": "floor", "shape": floor, "friction": 0.3}]
    columns, got, shown = run(data, MPI.COMM_SELF)
    assert got[0] == pytest.approx(0.5 * columns["friction_dissipation"][-1], rel=1e-9) and got[0] > 0.0
    assert shown == pytest.approx(got, rel=1e-9) and columns["friction_heat"][-1] == pytest.approx(got[0], rel=1e-12)
