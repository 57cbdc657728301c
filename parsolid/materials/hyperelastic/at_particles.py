"""Values of a hyperelastic law at each particle: fields of the reference place, such as directions of fibres, and state
variables.

They are annotated members of its NamedTuple that follow one another, state variables last:

    fibre: Annotated[tuple, Direction("of the fibres")]
    damage: Annotated[float, StateVariable("1", "the largest so far")]

The law of a body has values at rest there. Kernels keep those of particles in flat arrays, value c of particle p at
c * stride + p, and ask for the law at a particle, which is of the same type. Where the stride is known to the compiler,
as that of a tile, it sees that values do not overlap and vectorises loops that store them.
"""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from parsolid.kernels import inlined
from parsolid.materials.declaration import BandWidth, OfParticle, StateVariable
from parsolid.materials.hyperelastic.functions import next_state
from parsolid.materials.law_functions import law_function


class Member(NamedTuple):
    """A member of a law that particles have values of."""

    name: str
    note: OfParticle


@law_function
def members(law):
    """The `Member`s of a law, in order; in Python alone."""


@law_function
def value_count(law):
    """Number of values that the law has at each particle."""


@law_function
def at_particle(law, values, stride, p):
    """The law at particle p of a flat array of values."""


@law_function
def after_step(law, F, H, J):
    """The law at a particle with the state variables after a step that ends at F."""


@law_function
def keep_state(law, values, stride, p):
    """Put the state variables of the law at particle p into a flat array of values."""


def members_of_kind(kind: type) -> tuple[Member, ...]:
    """The `Member`s that a NamedTuple declares. Raises TypeError where they do not follow one another."""
    found, places = list[Member](), list[int]()
    for name, hint in get_type_hints(kind, include_extras=True).items():
        notes = get_args(hint)[1:] if get_origin(hint) is Annotated else ()
        for note in notes:
            if isinstance(note, OfParticle):
                found.append(Member(name, note))
                places.append(kind._fields.index(name))  # type: ignore[attr-defined]
    states = [isinstance(one.note, StateVariable) for one in found]
    if (places and places != list(range(places[0], places[0] + len(places)))) or states != sorted(states):
        names = ", ".join(one.name for one in found)
        raise TypeError(f"{kind.__name__}: {names} are expected to follow one another, state variables last")
    return tuple(found)


def values_at_rest(law: Any) -> list[float]:
    """The values that the law of a body has where those of particles stand."""
    return [number for one in members(law) for number in _numbers(one.note.at_rest)]


def _numbers(value: Any) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)


def state_count(law: Any) -> int:
    """Number of state variables, the last members."""
    return sum(isinstance(one.note, StateVariable) for one in members(law))


def has_band(law: Any) -> bool:
    """Whether strain localises in bands, as the law softens."""
    return hasattr(law, "branch_moduli") and any(isinstance(one.note, BandWidth) for one in members(law))


@members.made_by
def _members_of(kind: type) -> Callable[..., Any]:
    found = members_of_kind(kind)
    return lambda law: found


@value_count.made_by
def _value_count_of(kind: type) -> Callable[..., Any]:
    count = sum(one.note.components for one in members_of_kind(kind))
    return lambda law: count


@at_particle.made_by
def _at_particle_of(kind: type) -> Callable[..., Any]:
    found = members_of_kind(kind)
    if not found:
        return lambda law, values, stride, p: law
    first = kind._fields.index(found[0].name)  # type: ignore[attr-defined]
    last = first + len(found)
    read = inlined(_reading([one.note.components for one in found], 0))

    def at_particle_of(law, values, stride, p):
        return kind(*(law[:first] + read(values, stride, p) + law[last:]))

    return at_particle_of


@inlined
def _vector(values, place, stride):
    return (values[place], values[place + stride], values[place + 2 * stride])


def _reading(components: list[int], row: int) -> Callable[..., Any]:
    """A function that reads members, with these numbers of components, from a row on."""
    if not components:
        return lambda values, stride, p: ()
    rest = inlined(_reading(components[1:], row + components[0]))
    if components[0] == 3:
        return lambda values, stride, p: (_vector(values, row * stride + p, stride),) + rest(values, stride, p)  # noqa: RUF005 (numba knows sums)
    return lambda values, stride, p: (values[row * stride + p],) + rest(values, stride, p)  # noqa: RUF005


@after_step.made_by
def _after_step_of(kind: type) -> Callable[..., Any]:
    states = [one.name for one in members_of_kind(kind) if isinstance(one.note, StateVariable)]
    if not states:
        return lambda law, F, H, J: law
    first = kind._fields.index(states[0])  # type: ignore[attr-defined]
    last = first + len(states)

    def after_step_of(law, F, H, J):
        return kind(*(law[:first] + next_state(law, F, H, J) + law[last:]))

    return after_step_of


@keep_state.made_by
def _keep_state_of(kind: type) -> Callable[..., Any]:
    row, keep = 0, _keeping_nothing
    for one in members_of_kind(kind):
        if isinstance(one.note, StateVariable):
            keep = inlined(_keeping(kind._fields.index(one.name), row, keep))  # type: ignore[attr-defined]
        row += one.note.components
    return keep


@inlined
def _keeping_nothing(law, values, stride, p):
    pass


def _keeping(member: int, row: int, others: Callable[..., Any]) -> Callable[..., Any]:
    """A function that writes a member of the law into a row, after the others."""

    def keep(law, values, stride, p):
        others(law, values, stride, p)
        values[row * stride + p] = law[member]

    return keep
