"""Fields of particles of updated-Lagrangian SPH, arrays (components, particles)."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field

_kept_field = partial(Field, checkpointed=True, layout=Columns())
# of all laws; a scene may name them
STATE = (
    _kept_field("density", components=1, unit="kg/m^3", shown=True, padding=(1.0,)),
    _kept_field("temperature", components=1, unit="K", shown=True, padding=(1.0,)),
    _kept_field("plastic_strain", components=1, unit="1"),
)
# of the law with micro-inertia; a scene may name them
MICRO_STATE = (
    _kept_field("micro_rate", components=1, unit="1/s"),
    _kept_field("micro_stress", components=1, unit="Pa"),
)
_NO_CORRECTION = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)


def declare_motion(particles: Particles, position: np.ndarray) -> None:
    """Positions and velocities (d, n). Ghosts take positions when lists are made, and velocities in every step."""
    d = position.shape[1]
    vector = partial(_kept_field, components=d, ghosts="forward", shown=True, mirror="vector")
    particles.declare(vector("position", unit="m", message="reference"), position)
    particles.declare(vector("velocity", unit="m/s", message="motion"))


def declare_particles(particles: Particles, mass: np.ndarray, length: np.ndarray) -> None:
    """Masses [kg] and smoothing lengths [m] (n,), which ghosts take when lists are made."""
    number = partial(Field, components=1, ghosts="forward", message="reference", layout=Columns(), padding=(1.0,))
    particles.declare(number("mass", unit="kg"), mass)
    particles.declare(number("smoothing_length", unit="m"), length)


def declare_state(
    particles: Particles, dimension: int, solids: list[Any], several_bodies: bool, free: np.ndarray | None
) -> None:
    """The state at rest, and what neighbours read of it.

    solids: of each law, with the fields that it needs, the flows ("micro", "heat") between its particles, and whether
    its speed of sound changes; free (n,): False where the micro-velocity is clamped, None where it is nowhere.

    correction: B of the gradients (6: 11 22 33 12 13 23, 33 = 1 in the plane); deviator S [Pa] (6); pair_stress:
    P = sigma B/rho^2, column after column (d d); pair_micro_flux: xi B/rho^2; pair_heat_flux: q B/rho^2; force and
    viscous_force [N]: of stresses and of the artificial viscosity; viscous_heat [W], shared equally by both particles
    of a pair; energy E [J/m^3] per reference volume; micro_curl eta, micro_gradient grad v^p, energetic_flux and
    dissipative_flux xi, heat_flux q: see `micro_inertia`; back_stress [Pa] (6), volume_flow (2): see `plastic_fields`;
    elastic_pressure [Pa] of hyperelastic laws; impulse_power [W]: the viscous force times the change of the velocity by
    impulses of contact since the force was found.
    """
    d, number = dimension, particles.law_of_body[particles.owned_rows("body")]
    of_laws = frozenset().union(*(solid.fields for solid in solids))
    flows = frozenset().union(*(solid.flows for solid in solids))
    speeds_change = any(solid.speeds_change for solid in solids)
    record = partial(_kept_field, ghosts="forward", message="record")
    for field in STATE:
        known = field.name == "density" or (field.name == "temperature" and flows)
        particles.declare(replace(field, ghosts="forward", message="record") if known else field)
    speed = partial(_kept_field, "sound_speed", 1, "m/s", ghosts="forward")
    particles.declare(speed(message="record" if speeds_change else "reference"))
    particles.declare(record("pair_stress", d * d, ""))
    particles.declare(_kept_field("correction", 6, "1", padding=_NO_CORRECTION), _NO_CORRECTION)
    particles.declare(_kept_field("deviator", 6, "Pa"))
    for name in ("force", "viscous_force"):
        particles.declare(_kept_field(name, d, "N", mirror="vector"))
    for name in ("viscous_heat", "impulse_power"):
        particles.declare(_kept_field(name, 1, "W"))
    for flow in sorted(flows):
        particles.declare(_kept_field(f"pair_{flow}_flux", d, "", ghosts="forward", message="motion", mirror="vector"))
    for field in MICRO_STATE:
        if field.name in of_laws:
            known = field.name == "micro_rate" and "micro" in flows
            particles.declare(replace(field, ghosts="forward", message="record") if known else field)
    others = (
        _kept_field("energy", 1, "J/m^3"),
        _kept_field("micro_curl", 1, "1/m"),
        _kept_field("micro_gradient", d, "1/(m s)"),
        _kept_field("energetic_flux", d, "N/m"),
        _kept_field("dissipative_flux", d, "N/m"),
        _kept_field("heat_flux", d, "W/m^2"),
        _kept_field("back_stress", 6, "Pa"),
        _kept_field("volume_flow", 2, "1"),
        _kept_field("elastic_pressure", 1, "Pa"),
    )
    for field in others:
        if field.name in of_laws:
            particles.declare(field)
    particles.owned_rows("density")[:] = np.array([solid.law.density for solid in solids])[number]
    particles.owned_rows("sound_speed")[:] = np.array([solid.sound_speed for solid in solids])[number]
    if several_bodies:
        body = Field("contact_body", 1, "1", ghosts="forward", message="reference", layout=Columns())
        particles.declare(body, particles.owned_rows("body").astype(float))
    if free is not None:
        particles.declare(Field("micro_free", 1, "1", checkpointed=True, layout=Columns()), free.astype(float))
