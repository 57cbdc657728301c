"""Failure of a solid: its criteria (`failure.functions`), deletion of failed matter, and scatter of strength."""

from typing import Any, NamedTuple


class Scatter(NamedTuple):
    """Weibull's distribution of the strengths of particles, of mean 1: its modulus, and the seed of the draw."""

    modulus: float
    seed: int


class Criteria(NamedTuple):
    """Criteria as a chain, so that each keeps its type: the first, and the others (None behind the last)."""

    first: Any
    others: Any


class Failure(NamedTuple):
    """Matter fails by the first of its criteria whose damage is 1.

    deletes: whether failed matter is deleted; else it bears pressure alone. scatter: None for equal strengths.
    """

    criteria: Criteria
    deletes: bool
    scatter: Scatter | None


class Loading(NamedTuple):
    """The state of a particle at the end of a step, as criteria take it.

    deviator (symmetric tensor) and pressure [Pa], without artificial viscosity; plastic_strain (equivalent), its
    increment in the step and rate [1/s]; temperature and melting_temperature [K].
    """

    deviator: Any
    pressure: Any
    plastic_strain: Any
    increment: Any
    rate: Any
    temperature: Any
    melting_temperature: Any


def chained(criteria: list[Any]) -> Criteria:
    """Criteria in a chain, in their order."""
    result: Any = None
    for criterion in reversed(criteria):
        result = Criteria(criterion, result)
    return result


def count_of(failure: Failure | None) -> int:
    number, chain = 0, None if failure is None else failure.criteria
    while chain is not None:
        number, chain = number + 1, chain.others
    return number
