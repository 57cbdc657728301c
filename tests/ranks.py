"""Which of a test's parameters run on several ranks."""

from collections.abc import Iterable

import pytest


def first_on_ranks(values: Iterable) -> list:
    """Values, or tuples of them, of which the first alone runs on several ranks: the others say the same of them."""
    first, *others = values
    return [
        first,
        *(pytest.param(*(one if isinstance(one, tuple) else (one,)), marks=pytest.mark.serial) for one in others),
    ]
