"""What two particles exchange beside their stresses, chosen by type, and the columns of the arrays that the passes use.

Columns by dimension, (2, 3):
    kinematics  v x (n, 4);                      v c | x 0 (n, 8), c the speed of sound [m/s]
    record      P B | rho, v^p, T, c (n, 8);     columns of P B, beside each rho, v^p, T (n, 12); P = sigma/rho^2
    flux        X | Y (n, 4);                    X 0 | Y 0, of those that there are (n, 8 or 4)
                with X = xi B/rho^2 of the micro-flux, Y = q B/rho^2 of the heat
    rate_sums   sum m_a m_b of (v_b - v_a) (x) g (4; 12), r (x) g (4: 11 22 12 free; 8: 11 22 33 free | 12 23 13 free),
                (X_a + X_b) g and (Y_a + Y_b) g, component by component, as flux
    force_sums  sum m_a m_b of [(P B)_a + (P B)_b - Pi_ab] g and of -Pi_ab g alone (4: F V; 8: F Q | V free) with Q
                the heat of the viscosity, of (v^p_b - v^p_a) g and (T_b - T_a) g, as flux; in the plane Q has columns
                of its own at the end where it warms (4: Q and free)
"""

from typing import Any, NamedTuple

import numpy as np


class OneLength(NamedTuple):
    """The same smoothing length h [m] for all particles: h, 1/h, h^-(d+2)."""

    length: float
    inverse: float
    scale: float


class ManyLengths(NamedTuple):
    """Smoothing lengths (1, rows) [m]; a pair has the mean of both."""

    lengths: np.ndarray


class MicroFlux(NamedTuple):
    """The gradient of the micro-velocity and its flux."""

    kind: int = 0


class HeatFlux(NamedTuple):
    """The gradient of the temperature and the flux of heat."""

    kind: int = 1


class MicroAndHeatFlux(NamedTuple):
    """Both."""

    kind: int = 2


class ArtificialViscosity(NamedTuple):
    """Pi_ab = (-linear c mu + quadratic mu^2)/rho in approach, mu = h v.r/(r^2 + softening h^2) (Monaghan)."""

    linear: float
    quadratic: float
    softening: float


class Welded(NamedTuple):
    """Bodies that stick to one another; neither micro-velocity nor heat crosses."""

    kind: int = 0


class CompressionOnly(NamedTuple):
    """Bodies that press on one another and part freely; neither micro-velocity nor heat crosses."""

    kind: int = 1


class Arrays(NamedTuple):
    """What the passes read of a rank's particles, ghosts behind; flux is None where nothing flows."""

    kinematics: np.ndarray
    mass: np.ndarray
    record: np.ndarray
    flux: Any


class Warming(NamedTuple):
    """The heat of the artificial viscosity raises the temperature."""

    kind: int = 0


class GradientCorrection(NamedTuple):
    """Gradients exact for linear fields where the norm of the inverse of the moment is at most `most`."""

    most: float


class CentredCorrection(NamedTuple):
    """As `GradientCorrection`, for forces carried on from the middle of a step to its end: their work over a step is
    then that of the stresses to second order.
    """

    most: float


class Columns(NamedTuple):
    """First columns of what the sums hold: moment and flux of `rate_sums`; gradients of `force_sums`."""

    moment: int
    flux: int
    gradient: int


COLUMNS = {2: Columns(4, 8, 4), 3: Columns(12, 20, 8)}
KINEMATICS_WIDTH, RECORD_WIDTH = {2: 4, 3: 8}, {2: 8, 3: 12}


def flux_width(dimension: int, carried: Any) -> int:
    """Columns of fluxes and of what is summed of them."""
    if carried is None:
        return 0
    return 8 if dimension == 3 and isinstance(carried, MicroAndHeatFlux) else 4


def flux_places(dimension: int, carried: Any) -> tuple[int | None, int | None]:
    """First columns of the micro-flux and of the heat flux, None where there is none."""
    if carried is None:
        return None, None
    second = 2 if dimension == 2 else (4 if isinstance(carried, MicroAndHeatFlux) else 0)
    return (None if isinstance(carried, HeatFlux) else 0), (None if isinstance(carried, MicroFlux) else second)


def viscosity_of(settings: Any) -> ArtificialViscosity | None:
    """As the scene states it."""
    given = settings.viscosity
    return ArtificialViscosity(float(given.linear), float(given.quadratic), float(given.softening)) if given else None
