"""A cylinder and a ball pressed on a block, both of particles, against Hertz (`hertz`)."""

import hertz
import pytest


@pytest.mark.parametrize("method", ["mpm", "peridynamics"])
def test_a_cylinder_of_points_or_bonds(method):
    """At a/h = 4: within 5 % without a word on transfers or control; FLIP has +6.8 and -9.7 %,
    peridynamics with the control of beams -9.1 and +12 %."""
    found = hertz.pressed(2, method, 4.0, 8.0, 4.0, stiffness=4.0)
    assert abs(found.width) < 0.025 and abs(found.peak) < 0.05, found
    assert abs(found.force) < 0.02


@pytest.mark.parametrize(
    "method, wanted, least, most, balance",
    [
        # spheres and faces of lattices meet late, by some hundredths of a spacing
        ("tlsph", 2.25, -0.14, 0.0, 1e-3),
        # 11 % too much with the control of beams; undamped, it swings about the mean
        pytest.param("peridynamics", 4.0, -0.04, 0.04, 1e-4, marks=pytest.mark.long),
    ],
)
def test_a_ball(method, wanted, least, most, balance):
    """At this a/h; at 4.5 and 6 `tlsph` has the force within 2 % (docs/contact.md)."""
    found = hertz.pressed(3, method, wanted, 6.0, 4.0, stiffness=4.0)
    assert least < found.force < most
    assert abs(found.columns["energy_error"]).max() < balance * found.columns["strain_energy"].max()
