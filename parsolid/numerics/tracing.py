"""Formulas in plain Python that numba traces: run once on symbols, they emit LLVM instructions without being compiled
themselves.

A traced formula takes and gives small tensors (`numerics.tensors`) and scalars. Plain Python calls it as it stands; in
a compiled function its arguments become symbols of floats or four-lane vectors, and every product and sum one
instruction in the function that calls it. So it costs no type inference, and its instructions are those that the
compiled formula would have.
"""

from decomposition.deferred import with_numba


class Traceable:
    """Base of the NamedTuple classes that formulas take; BY_SIZE has the class of a plain tuple of so many scalars."""

    __slots__ = ()


BY_SIZE: dict[int, type] = {}


class Unknown:
    """Base of what formulas are run on when they are traced: scalars whose value only the compiled code will have."""

    __slots__ = ()


def traced(formula, with_index: bool = False):
    """Decorator of a formula of tensors and scalars; with_index: its last argument is the index of a lane."""

    def declare():
        from parsolid.numerics import tracing_lowering

        tracing_lowering.trace(formula, with_index)

    with_numba(declare)
    return formula
