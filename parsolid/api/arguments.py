"""Checks of what functions of Python are called with, with the messages of the command line."""

from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any

from parsolid.collective import SolverError


def require_whole_number(name: str, value: Any) -> None:
    """Raise SolverError for what is no whole number of at least 1."""
    if isinstance(value, bool) or not (isinstance(value, Integral) and int(value) >= 1):
        raise SolverError(f"{name}: expected a whole number of at least 1, found {value!r}")


def require_seconds(name: str, value: Any) -> None:
    """Raise SolverError for what is no positive number of seconds."""
    if isinstance(value, bool) or not (isinstance(value, Real) and 0.0 < float(value) < float("inf")):
        raise SolverError(f"{name}: expected a positive number of seconds, found {value!r}")


def require_part(name: str, value: Any) -> None:
    """Raise SolverError for what is no number between 0 and 1."""
    if isinstance(value, bool) or not (isinstance(value, Real) and 0.0 < float(value) < 1.0):
        raise SolverError(f"{name}: expected a number between 0 and 1, found {value!r}")


def require_texts(name: str, value: Any) -> None:
    """Raise SolverError for what is no list of texts."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise SolverError(f"{name}: expected a list of texts, found {value!r}")
