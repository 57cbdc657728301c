"""The fields of updated-Lagrangian SPH, and the arrays of them that its kernels take."""

import functools
from typing import Any, NamedTuple

import numpy as np

from parsolid.methods.ulsph.kinematics import second_vector
from parsolid.methods.ulsph.state_fields import MICRO_STATE, STATE
from parsolid.methods.ulsph.terms import (
    COLUMNS,
    KINEMATICS_WIDTH,
    RECORD_WIDTH,
    flux_places,
    flux_width,
)
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Rows, Within

DEVIATOR_ROWS, CORRECTION_ROWS = {2: 4, 3: 6}, {2: 3, 3: 6}
_NO_CORRECTION = {2: (1.0, 1.0, 0.0), 3: (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)}
# of `Body`, what only laws that fail have
OF_FAILURE = ("damage", "criterion_damage", "strength_factor", "deleted_mass")


class Body(NamedTuple):
    """Arrays of a rank's particles, (rows, capacity) but for those of `terms`; None where a law lacks it.

    correction B (3; 6: 11 22 12; 11 22 33 12 13 23); density [kg/m^3]; deviator S [Pa] (4; 6: 11 22 33 12 (13 23));
    temperature [K]; plastic_strain: accumulated equivalent strain, gamma of micro-inertia; micro_rate v^p [1/s];
    micro_stress pi [Pa]; micro_curl eta [1/m]; micro_gradient grad v^p (d) [1/(m s)]; energetic_flux, dissipative_flux
    (d) [N/m]; heat_flux (d) [W/m^2]; energy E [J/m^3] per reference volume, of laws with an equation of state of heat;
    micro_free: 1, or 0 where v^p is held at 0; of laws that fail damage, that of each criterion (a row each), factor of
    the strength, mass that was deleted [kg].
    """

    kinematics: Any
    mass: Any
    smoothing_length: Any
    record: Any
    flux: Any
    rate_sums: Any
    force_sums: Any
    correction: Any
    density: Any
    deviator: Any
    temperature: Any
    plastic_strain: Any
    micro_rate: Any
    micro_stress: Any
    micro_curl: Any
    micro_gradient: Any
    energetic_flux: Any
    dissipative_flux: Any
    heat_flux: Any
    energy: Any
    micro_free: Any
    damage: Any
    criterion_damage: Any
    strength_factor: Any
    deleted_mass: Any


def body_of(particles: Particles, without: frozenset[str] = frozenset()) -> Body:
    """The arrays that kernels take; without: fields that a law does not have though others do."""
    names = (name if name in particles and name not in without else None for name in Body._fields)
    return Body(*(None if name is None else particles.storage(name) for name in names))


def declare_motion(
    particles: Particles, position: np.ndarray, carried: Any, warming: Any, speeds_change: bool = False
) -> None:
    """v and x, the records that neighbours read, and the sums of both passes; ghosts take x when lists are made."""
    d = position.shape[1]
    role: dict[str, Any] = {"ghosts": "forward", "checkpointed": True, "shown": True, "mirror": "vector"}
    particles.declare(Field("kinematics", KINEMATICS_WIDTH[d], ""))
    place = Within("kinematics", second_vector(d))
    particles.declare(Field("position", d, "m", **role, message="reference", layout=place), position)
    particles.declare(Field("velocity", d, "m/s", **role, message="motion", layout=Within("kinematics", 0)))
    speed = Within("kinematics", 3) if d == 3 else Within("record", 7)
    particles.declare(Field("record", RECORD_WIDTH[d], "", checkpointed=True))
    # one that changes goes with what changes in every step
    message = "record" if speeds_change else "sound"
    particles.declare(
        Field("sound_speed", 1, "m/s", ghosts="forward", message=message, layout=speed, checkpointed=speeds_change)
    )
    # in the plane without the speed of sound
    told = Field("told", 7 if d == 2 else 12, "", ghosts="forward", message="record", layout=Within("record", 0))
    particles.declare(told)
    moved: dict[str, Any] = {"layout": Rows(), "carried": False}
    particles.declare(Field("rate_sums", COLUMNS[d].flux + flux_width(d, carried), "", **moved))
    width = COLUMNS[d].gradient + flux_width(d, carried) + (4 if d == 2 and warming is not None else 0)
    particles.declare(Field("force_sums", width, "N", layout=Rows(), checkpointed=True))
    if carried is not None:
        particles.declare(Field("flux", flux_width(d, carried), "", checkpointed=True))
        for name, first in zip(("told_micro_flux", "told_heat_flux"), flux_places(d, carried)):
            if first is not None:
                ghosts: dict[str, Any] = {"ghosts": "forward", "message": "motion"}
                particles.declare(Field(name, d, "", **ghosts, layout=Within("flux", first), mirror="vector"))


def declare_state(particles: Particles, dimension: int, density: np.ndarray, lacks: frozenset[str]) -> None:
    """What all laws have, and what at least one has; lacks: names of `Body` that no law has."""
    d = dimension
    kept = functools.partial(Field, checkpointed=True, layout=Columns())
    particles.declare(kept("correction", CORRECTION_ROWS[d], "1", padding=_NO_CORRECTION[d]), _NO_CORRECTION[d])
    particles.declare(kept("deviator", DEVIATOR_ROWS[d], "Pa"))
    for field in STATE:
        particles.declare(field)
    particles.owned_rows("density")[:] = density
    more = (
        kept("micro_curl", 1, "1/m"),
        kept("micro_gradient", d, "1/(m s)"),
        kept("energetic_flux", d, "N/m"),
        kept("dissipative_flux", d, "N/m"),
        kept("heat_flux", d, "W/m^2"),
        kept("energy", 1, "J/m^3"),
        kept("micro_free", 1, "1"),
    )
    for field in (*MICRO_STATE, *more):
        if field.name not in lacks:
            particles.declare(field)
