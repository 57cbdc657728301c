"""Energy in contact: what a body loses when it meets another or a wall is in the ledger, and MUSL adds none."""

import numpy as np
import pytest
from mpm.points import SOFT, scene
from solids import run_to_end, simulation


def block(lower, speed, **method) -> dict:
    """A block of 10 x 10 cells that flies along X; FLIP, of which MUSL loses nothing."""
    upper, method = [lower + 0.5, 0.5], {"transfer": "flip", **method}
    return scene(
        [lower, 0.0], upper, 0.025, 0.05, material=SOFT, method=method, end_time=0.02, body={"velocity": [speed, 0]}
    )


def two_blocks(**method) -> dict:
    """One runs into its mirror image at 10 m/s, on one grid."""
    data = block(-0.55, 10.0, **method)
    data["bodies"] += block(0.05, -10.0)["bodies"]
    return data | {"bond": [{"bodies": "all"}]}


def wall(**method) -> dict:
    """A block that runs into a wall two cells away."""
    return block(0.1, -10.0, **method) | {"boundaries": [{"kind": "wall", "plane": "X = 0", "side": "above"}]}


def face(**method) -> dict:
    """A block whose face is held at once."""
    return block(0.0, -10.0, **method) | {"boundaries": [{"kind": "roller", "plane": "X = 0"}]}


@pytest.mark.serial
@pytest.mark.parametrize(
    "case, order, balance, least_loss, largest_loss",
    [
        # of the energy; the balance swings by 2 % with the step in every case, and is back after contact
        (two_blocks, "usl", 0.01, 0.02, 0.08),
        (two_blocks, "musl", 0.01, 0.0, 1e-12),
        (face, "usl", 0.02, 0.08, 0.2),
        (face, "musl", 0.02, 0.0, 1e-12),
        (wall, "musl", 0.01, 0.05, 0.15),
    ],
)
def test_what_contact_loses_is_booked(comm, case, order, balance, least_loss, largest_loss):
    _, columns = run_to_end(case(order=order), comm)
    energy = columns["kinetic"][0]
    assert columns["kinetic"].min() < 0.2 * energy
    assert abs(columns["energy_error"][-1]) < balance * energy and np.abs(columns["energy_error"]).max() < 0.03 * energy
    assert least_loss <= columns["numerical_dissipation"][-1] / energy <= largest_loss
    assert columns["kinetic"][-1] + columns["strain_energy"][-1] < (1.0 + balance) * energy


@pytest.mark.serial
@pytest.mark.parametrize(("gap", "told"), [(0.0, []), (0.04, ["wall-bears-early"]), (0.1, [])])
def test_a_wall_that_bears_before_it_is_touched_is_told(gap, told, comm):
    data = block(gap, -10.0) | {"boundaries": [{"kind": "wall", "plane": "X = 0", "side": "above"}]}
    sim = simulation(data, comm)
    sim.take_step(1e-6)
    pushed = sim.systems[0].particles.owned_rows("velocity")[:, 0].max() > -10.0 + 1e-9
    assert [one.code for one in sim.warnings] == told and pushed == (gap < 0.1)


@pytest.mark.serial
def test_bodies_meet_about_the_axis_as_in_the_plane(comm):
    """Between rollers, 20 mm from the axis: what contact stores does not depend on how thick a radian is."""
    stored = []
    for geometry in ("plane-strain", "axisymmetric"):
        method = {"geometry": geometry, "transfer": "aflip"}
        low, high = (
            scene([0.0, y], [0.02, y + 0.02], 5e-3, 0.01, material=SOFT, method=method, end_time=5e-4, body=body)
            for y, body in (
                (-0.02, {"name": "low", "velocity": [0.0, 0.5]}),
                (0.0, {"name": "high", "velocity": [0.0, -0.5]}),
            )
        )
        low["bodies"] += high["bodies"]
        low |= {"contact": [{"bodies": ["low", "high"]}]}
        low |= {"boundaries": [{"kind": "roller", "plane": f"X = {x}"} for x in (0.0, 0.02)]}
        _, columns = run_to_end(low, comm)
        energy = columns["kinetic"][0]
        assert np.abs(columns["energy_error"]).max() < 1e-3 * energy
        stored.append(columns["contact_energy"].max() / energy)
    assert stored[0] > 0.1 and stored[1] == pytest.approx(stored[0], rel=0.05)
