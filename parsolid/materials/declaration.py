"""Declaration of laws: role, kind, and the parameters that a scene states, with units and bounds.

    @law("flow-stress", "voce")
    class Voce(NamedTuple):
        yield_stress: Annotated[float, Parameter("Pa", "sigma_0", above=0.0)]

A declared NamedTuple is the law itself. Where a scene states other constants than the law keeps, the declared class is
a plain one with the same annotations and a method `equilibrium_law(self)` that makes the NamedTuple. Either may have
`faults(self)`, which lists (key, what was expected, what was found), `exactly_one` and `at_most_one` (keys that exclude
each other), `of_strain = False` (its stress is integrated in time: no strain at the start has one), and properties.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, get_args, get_origin, get_type_hints

# a class with the decorator `law`, which has its role and its kind
Declared = Any
Role = Literal[
    "hyperelastic",
    "prony",
    "bond-based",
    "elastic-plastic",
    "equation-of-state",
    "shear-modulus",
    "flow-stress",
    "kinematic-hardening",
    "melting",
    "failure",
    "micro-inertia",
]
ROLES: tuple[str, ...] = get_args(Role)
NEEDED = object()
# ledger term of the energy that state variables of hyperelastic laws dissipate
SOFTENING = "softening_dissipation"
ATOMIC_MASS_UNIT = 1.66053906660e-27


class Phrase(str):
    """Text that a message shows as it is, without quotation marks."""

    def __repr__(self) -> str:
        return str(self)


@dataclass(frozen=True)
class Parameter:
    """A parameter that a scene states: unit ("1" of a pure number), description, bounds, default (none: it is needed).

    factor: from the stated unit to the SI unit of the law; kept: pairs of a stated word and the law's value for it;
    most: largest number of entries of a list of tables, which are plain classes with parameters.
    """

    unit: str = "1"
    description: str = ""
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    default: Any = NEEDED
    factor: float = 1.0
    kept: tuple[tuple[str, Any], ...] = ()
    most: int | None = None

    @property
    def text(self) -> str | None:
        """The description with the unit, for messages."""
        unit = "" if self.unit == "1" else f"[{self.unit}]"
        return f"{self.description} {unit}".strip() or None


@dataclass(frozen=True)
class OfMaterial:
    """A number that a part takes over from its material."""


@dataclass(frozen=True)
class Direction:
    """A unit vector at each particle, which the law has as three numbers; a scene states it as an angle, formulas of
    the reference place or cell data of a mesh. needed: whether the scene must."""

    components: ClassVar[int] = 3
    description: str = ""
    needed: bool = True
    unit: str = "1"

    @property
    def at_rest(self) -> tuple[float, float, float]:
        """The value in a law that belongs to no particle."""
        return (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class OfPlace:
    """A number at each particle, which a scene states as a formula of the reference place or cell data of a mesh."""

    components: ClassVar[int] = 1
    unit: str = "1"
    description: str = ""

    @property
    def at_rest(self) -> float:
        """The value in a law that belongs to no particle."""
        return 0.0


@dataclass(frozen=True)
class BandWidth:
    """The width [m] of the band of particles in which strain localises, at each particle: that of its spacing and its
    method, which a scene may replace as `OfPlace`; a law with it has a property `largest_band` [m]."""

    components: ClassVar[int] = 1
    unit: ClassVar[str] = "m"
    description: str = ""

    @property
    def at_rest(self) -> float:
        """The value in a law that belongs to no particle."""
        return 1e-9


@dataclass(frozen=True)
class StateVariable:
    """A number at each particle that steps change (`hyperelastic.functions.next_state`); initial: at time 0."""

    components: ClassVar[int] = 1
    unit: str = "1"
    description: str = ""
    initial: float = 0.0

    @property
    def at_rest(self) -> float:
        """The value at time 0."""
        return float(self.initial)


OfParticle = Direction | OfPlace | BandWidth | StateVariable


Density = Annotated[float, Parameter("kg/m^3", "the density", above=0.0)]


def law(role: Role, kind: str) -> Callable[[Declared], Declared]:
    """Decorator: declare a law under the name by which a scene asks for it. ValueError for an unknown role."""
    if role not in ROLES:
        raise ValueError(f"role: expected one of {', '.join(map(repr, ROLES))}, found {role!r}")

    def declare(declared: Declared) -> Declared:
        declared.role, declared.kind = role, kind
        return declared

    return declare


def parameters_of(declared: Declared) -> dict[str, tuple[Any, Any]]:
    """Name -> (plain type, annotation) of the members annotated with Parameter, OfMaterial or one of `OfParticle`."""
    result: dict[str, tuple[Any, Any]] = {}
    for name, hint in get_type_hints(declared, include_extras=True).items():
        if get_origin(hint) is Annotated:
            plain, *notes = get_args(hint)
            result.update(
                (name, (plain, note)) for note in notes if isinstance(note, Parameter | OfMaterial | OfParticle)
            )
    return result


def built(declared: Declared, stated: Any, **of_material: Any) -> Any:
    """The NamedTuple of a declared class, in SI units, from an object with the stated parameters as attributes.

    of_material: values of the remaining fields, which the material gives.
    """
    values, parameters = dict(of_material), parameters_of(declared)
    for name, (_, parameter) in parameters.items():
        if isinstance(parameter, OfMaterial):
            continue
        if isinstance(parameter, OfParticle):
            values[name] = parameter.at_rest
            continue
        value = getattr(stated, name)
        if hasattr(type(value), "declared"):
            value = built(type(value).declared, value)
        elif parameter.kept:
            value = dict(parameter.kept)[value]
        elif isinstance(value, float | int) and not isinstance(value, bool):
            value = float(value) * parameter.factor if parameter.factor != 1.0 else float(value)
        values[name] = value
    return declared(**{name: values[name] for name in declared._fields})
