"""What particles of updated-Lagrangian SPH carry: all fields are arrays (components, particles)."""

from dataclasses import replace
from functools import partial

import numpy as np

from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field

_kept = partial(Field, checkpointed=True, layout=Columns())
# of all laws; a scene may name them
STATE = (
    _kept("density", components=1, unit="kg/m^3", shown=True, padding=(1.0,)),
    _kept("temperature", components=1, unit="K", shown=True, padding=(1.0,)),
    _kept("plastic_strain", components=1, unit="1"),
)
# of the law with micro-inertia; a scene may name them
MICRO_STATE = (_kept("micro_rate", components=1, unit="1/s"), _kept("micro_stress", components=1, unit="Pa"))
_NO_CORRECTION = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)


def declare_motion(particles: Particles, position: np.ndarray) -> None:
    """Places and velocities (d, n). Ghosts take places when lists are made, and velocities in every step."""
    d = position.shape[1]
    told = partial(_kept, components=d, ghosts="forward", shown=True, mirror="vector")
    particles.declare(told("position", unit="m", message="reference"), position)
    particles.declare(told("velocity", unit="m/s", message="motion"))


def declare_particles(particles: Particles, mass: np.ndarray, length: np.ndarray) -> None:
    """Masses [kg] and smoothing lengths [m] (n,), which ghosts take when lists are made."""
    told = partial(Field, components=1, ghosts="forward", message="reference", layout=Columns(), padding=(1.0,))
    particles.declare(told("mass", unit="kg"), mass)
    particles.declare(told("smoothing_length", unit="m"), length)


def declare_state(
    particles: Particles, dimension: int, of_laws: frozenset[str], flows: frozenset[str], speeds_change: bool
) -> None:
    """The state, and what neighbours read of it.

    of_laws: fields that not all laws have, but at least one; flows: "micro", "heat" or both where they flow
    between particles; speeds_change: whether speeds of sound change, so that they are told in every step.

    correction: B of the gradients (6: 11 22 33 12 13 23, 33 = 1 in the plane); deviator S [Pa] (6);
    pair_stress: P = sigma B/rho^2, column after column (d d); pair_micro_flux: xi B/rho^2, pair_heat_flux: q B/rho^2;
    force and viscous_force [N]: of stresses and of the artificial viscosity; viscous_heat [W], alike for both particles
    of a pair; energy E [J/m^3] per reference volume; micro_curl eta, micro_gradient grad v^p, energetic_flux and
    dissipative_flux xi, heat_flux q: see `micro_inertia`; back_stress [Pa] (6), volume_flow (2), see
    `plastic_fields`; elastic_pressure [Pa] of hyperelastic laws; impulse_power [W]: the viscous force times what
    contact has changed of the velocity since the force was found.
    """
    d = dimension
    record = partial(_kept, ghosts="forward", message="record")
    for field in STATE:
        known = field.name == "density" or (field.name == "temperature" and flows)
        particles.declare(replace(field, ghosts="forward", message="record") if known else field)
    speed = partial(_kept, "sound_speed", 1, "m/s", ghosts="forward")
    particles.declare(speed(message="record" if speeds_change else "reference"))
    particles.declare(record("pair_stress", d * d, ""))
    particles.declare(_kept("correction", 6, "1", padding=_NO_CORRECTION), _NO_CORRECTION)
    particles.declare(_kept("deviator", 6, "Pa"))
    for name in ("force", "viscous_force"):
        particles.declare(_kept(name, d, "N", mirror="vector"))
    for name in ("viscous_heat", "impulse_power"):
        particles.declare(_kept(name, 1, "W"))
    for flow in sorted(flows):
        told = _kept(f"pair_{flow}_flux", d, "", ghosts="forward", message="motion", mirror="vector")
        particles.declare(told)
    for field in MICRO_STATE:
        if field.name in of_laws:
            known = field.name == "micro_rate" and "micro" in flows
            particles.declare(replace(field, ghosts="forward", message="record") if known else field)
    others = (
        _kept("energy", 1, "J/m^3"),
        _kept("micro_curl", 1, "1/m"),
        _kept("micro_gradient", d, "1/(m s)"),
        _kept("energetic_flux", d, "N/m"),
        _kept("dissipative_flux", d, "N/m"),
        _kept("heat_flux", d, "W/m^2"),
        _kept("back_stress", 6, "Pa"),
        _kept("volume_flow", 2, "1"),
        _kept("elastic_pressure", 1, "Pa"),
    )
    for field in others:
        if field.name in of_laws:
            particles.declare(field)
