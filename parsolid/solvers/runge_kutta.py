"""Time integrators as tables of stages."""

from typing import NamedTuple


class Stage(NamedTuple):
    """One stage of a step; times as fractions of the step.

    time: of the state the rate is taken at; next_time: of the state the stage makes;
    quadrature: the stage's weight in the integral of a rate over the step.
    """

    keep: float
    take: float
    time: float
    next_time: float
    quadrature: float
    first: bool = False
    last: bool = False


# (77); its stage values are at 0, 1 and 1/2 of the step with Simpson's weights
SSP_RK3 = (
    Stage(0.0, 1.0, 0.0, 1.0, 1.0 / 6.0, first=True),
    Stage(0.75, 0.25, 1.0, 0.5, 1.0 / 6.0),
    Stage(1.0 / 3.0, 2.0 / 3.0, 0.5, 1.0, 2.0 / 3.0, last=True),
)
