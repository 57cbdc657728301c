"""A ball pressed on a block, both of particles, against Hertz (Johnson, Contact Mechanics, section 4.2)."""

import hertz_in_space
import pytest


def test_force_for_the_approach_in_space(monkeypatch):
    """At a/h = 2.25; at 4.5 and 6 the force is within 2 % (docs/contact.md)."""
    monkeypatch.setattr(hertz_in_space, "SLOW", 6.0)
    share, force, columns = hertz_in_space.pressed("tlsph", 2.25, {"stiffness": 4.0})
    # spheres and faces of lattices meet late, by some hundredths of a spacing
    assert -0.14 < force[share == 1.0].mean() - 1.0 < 0.0
    assert abs(columns["energy_error"]).max() < 1e-3 * columns["strain_energy"].max()


@pytest.mark.slow
def test_the_control_of_contact_has_the_force_in_space(monkeypatch):
    """At a/h = 4, within 4 %; 11 % too much with the control of beams. Undamped, it swings about the mean."""
    monkeypatch.setattr(hertz_in_space, "SLOW", 6.0)
    share, force, columns = hertz_in_space.pressed("peridynamics", 4.0, {"stiffness": 4.0})
    assert abs(force[share == 1.0].mean() - 1.0) < 0.04
    assert abs(columns["energy_error"]).max() < 1e-4 * columns["strain_energy"].max()
