"""Functions with one implementation a type: in plain Python, in compiled functions, and what is said where there is
none.
"""

from typing import NamedTuple

import numpy as np
import pytest
from numba.core.errors import TypingError

from decomposition.compiled import compiled
from parsolid.numerics.dispatch import constant, generic
from parsolid.numerics.tensors import GeneralSpace, Tensor, trace


class Spring(NamedTuple):
    stiffness: float


class Dashpot(NamedTuple):
    viscosity: float


class Neither(NamedTuple):
    nothing: float


@generic
def resistance(element, length, speed):
    """Force of an element."""


@resistance.of(Spring)
def _spring(element, length, speed):
    return element.stiffness * length


@resistance.of(Dashpot)
def _dashpot(element, length, speed):
    return element.viscosity * speed


@resistance.of(None)
def _no_element(element, length, speed):
    return 0.0


@generic(on="values")
def total(start, values):
    """Sum of an array."""


@total.of(1)
def _line(start, values):
    return start + values[0]


@total.otherwise
def _else(start, values):
    return start


@generic
def last(values):
    """The last of a tuple."""


@last.of(1)
def _only(values):
    return values[0]


@last.otherwise
def _behind(values):
    return last(values[1:])


class Rig(NamedTuple):
    element: Spring | Dashpot | None


@constant
def stores_energy(rig):
    """Whether a rig's element is a spring."""
    return isinstance(rig.element, Spring)


@generic
def pressure(F: Tensor):
    """Trace of a tensor."""


@pressure.of(GeneralSpace)
def _pressure(F):
    return trace(F)


@compiled
def compiled_resistance(element, length, speed):
    return resistance(element, length, speed)


@compiled
def compiled_total(start, values):
    return total(start, values)


@compiled
def compiled_last(values):
    return last(values)


@compiled
def compiled_stores_energy(rig):
    return stores_energy(rig)


@compiled
def compiled_pressure(components):
    return pressure(components)


@pytest.mark.parametrize("element, force", [(Spring(2.0), 6.0), (Dashpot(5.0), 20.0), (None, 0.0)])
def test_the_type_of_the_first_argument_chooses(element, force):
    assert resistance(element, 3.0, 4.0) == force
    assert compiled_resistance(element, 3.0, 4.0) == force


def test_dimensions_of_an_array_choose_and_all_others_take_the_rest():
    for function in (total, compiled_total):
        assert function(1.0, np.array([2.0])) == 3.0
        assert function(1.0, np.ones((2, 2))) == 1.0


def test_lengths_of_a_tuple_choose():
    assert last((1.0, 2, 3.0)) == compiled_last((1.0, 2, 3.0)) == 3.0


@pytest.mark.parametrize("element, stores", [(Spring(2.0), True), (Dashpot(5.0), False), (None, False)])
def test_what_types_tell_is_a_constant(element, stores):
    assert stores_energy(Rig(element)) is compiled_stores_energy(Rig(element)) is stores


def test_plain_tuples_become_tensors_where_tensors_are_asked_for():
    components = tuple(map(float, range(9)))
    assert pressure(components) == compiled_pressure(components) == 12.0


def test_what_has_no_implementation_is_named():
    with pytest.raises(
        TypeError, match="resistance has no implementation for Neither .it has those for Dashpot, None, Spring"
    ):
        resistance(Neither(1.0), 1.0, 1.0)
    with pytest.raises(TypingError, match="resistance has no implementation for Neither"):
        compiled_resistance(Neither(1.0), 1.0, 1.0)
