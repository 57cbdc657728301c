"""Tables of contact, bonds and ties between bodies, their faults, and their terms in the energy ledger."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from itertools import combinations
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import FaultDetail, NotNegative, SceneModel, mismatch
from parsolid.scene.method_settings import KINETIC_OFFSET
from parsolid.scene.observation import holds_heat

# energy terms, with signs as in `simulation.ledger`: of contact between particles and with tools
CONTACT_TERMS = {"contact_energy": 0, "stick_energy": 0, "friction_dissipation": 1}
# kinetic offset of free tools, see `methods.leapfrog`
TOOL_TERMS = {KINETIC_OFFSET: -1}
# part of the friction dissipation that laws with heat store
FRICTION_HEAT = {"friction_heat": -1}
# contact on a grid: dissipation of closing and of sliding nodes
GRID_TERMS = {"contact_dissipation": 1, "friction_dissipation": 1}
# defaults of the kernel model: factor on the stiffness, radius in spacings
USUAL = {"stiffness": 1.0, "radius": 2.7}


class Contact(SceneModel):
    """Bodies that press on one another and separate freely."""

    bodies: Annotated[list[str], Field(min_length=1)] = Field(description="names of bodies")
    model: Literal["kernel", "grid"] = Field(
        "kernel",
        description='"kernel": forces between particles; "grid": between bodies of one material point method, on its '
        "nodes",
    )
    friction: NotNegative = Field(0.0, description="coefficient of Coulomb's law")
    stiffness: float | None = Field(
        None,
        gt=0.0,
        le=1e4,
        description="factor alpha on the smaller M/h of the two bodies, M = lambda + 2 mu (default: 1)",
    )
    radius: float | None = Field(
        None,
        ge=2.2,
        le=8.0,
        description="radius of the contact kernel in the larger of the two spacings (default: 2.7)",
    )

    @model_validator(mode="before")
    @classmethod
    def _complete_forces(cls, value: Any) -> Any:
        """Defaults of stiffness and radius for the kernel model; they stay None on a grid, where they are refused."""
        if isinstance(value, dict) and value.get("model", "kernel") == "kernel":
            return USUAL | value
        return value


def energy_terms(contacts: Any, tools: Any, materials: list[Any]) -> dict[str, int]:
    """Terms that contacts and tools of a scene with these materials add to the energy ledger."""
    forces, grid = of_model(contacts, "kernel"), of_model(contacts, "grid")
    terms: dict[str, int] = {}
    if forces or tools:
        terms |= CONTACT_TERMS
    if tools:
        terms |= TOOL_TERMS
    if grid:
        terms |= GRID_TERMS
    if any(one.friction for one in (*forces, *grid, *tools)) and any(map(holds_heat, materials)):
        terms |= FRICTION_HEAT
    return terms


def of_model(contacts: Any, model: str) -> list[Contact]:
    """Contacts of one model."""
    return [contact for contact in contacts if contact.model == model]


def bodies_in_contact(scene: Any) -> set[int]:
    """Indices of the bodies in contact with tools, other bodies or themselves."""
    named = [name for one in scene.contact for name in one.bodies]
    named += [name for one in scene.tools for name in one.bodies or [body.name for body in scene.bodies]]
    return {i for i, body in enumerate(scene.bodies) if body.name in named}


def in_contact(scene: Any, bodies: Iterable[int]) -> list[str]:
    """Names of the given bodies that are in contact with another body by forces between particles."""
    named = {name for one in of_model(scene.contact, "kernel") if len(one.bodies) > 1 for name in one.bodies}
    return [scene.bodies[i].name for i in bodies if scene.bodies[i].name in named]


def grid_pairs(scene: Any) -> dict[tuple[int, int], float]:
    """Indices of two systems in contact on their grid -> coefficient of friction."""
    names = {body.name: number for number, body in enumerate(scene.bodies)}
    home = {body: number for number, system in enumerate(scene.systems) for body in system.bodies}
    result: dict[tuple[int, int], float] = {}
    for contact in of_model(scene.contact, "grid"):
        for i, j in combinations(sorted(names[name] for name in contact.bodies), 2):
            result.setdefault((min(home[i], home[j]), max(home[i], home[j])), contact.friction)
    return result


def grid_faults(scene: Any) -> list[FaultDetail]:
    """Faults of grid contacts: no common grid, keys of the kernel model, or different friction between two grids."""
    details = list[FaultDetail]()
    home = {scene.bodies[number].name: one for one in scene.systems for number in one.bodies}
    for i, contact in enumerate(scene.contact):
        # unknown names are faults of their own
        systems = [home[name] for name in contact.bodies if name in home]
        if contact.model == "kernel" or not systems:
            continue
        place, settings = systems[0].place, systems[0].settings
        of_one = settings.kind == "mpm" and all(one.settings is settings for one in systems)
        if len(contact.bodies) < 2 or not of_one:
            expected = "bodies of one method of kind 'mpm' (model = 'grid')"
            details.append((("contact", i, "bodies"), expected, contact.bodies))
            continue
        stated = [(key, value) for key in USUAL if (value := getattr(contact, key)) is not None]
        details += [(("contact", i, key), "no such key with model = 'grid'", value) for key, value in stated]
        for key, allowed in (("order", ("musl",)), ("substeps", (1, None))):
            if (found := getattr(settings, key)) not in allowed:
                details.append(((*place, key), f"{allowed[0]!r} with a contact on the grid", found))
    if details:
        return details
    # first body of a system -> indices of earlier grid contacts with a body of the system
    earlier = defaultdict[int, set[int]](set)
    for i, contact in sorted(enumerate(scene.contact), key=lambda one: one[1].model != "grid"):
        first = {home[name].bodies[0] for name in contact.bodies if name in home}
        shared = Counter(other for body in first for other in earlier[body])
        others = [scene.contact[other] for other, count in shared.items() if count > 1]
        if any((one.model, one.friction) != (contact.model, contact.friction) for one in others):
            expected = "the same model and friction for all bodies that share two grids"
            details.append((("contact", i), expected, contact.bodies))
        for body in first if contact.model == "grid" else ():
            earlier[body].add(i)
    return details


class BodyPairs:
    """Pairs of bodies that a table names together, without the pairs of `excluded`.

    tables: index of a body -> indices of the tables that name it
    """

    def __init__(self, members: Iterable[Iterable[int]], excluded: "BodyPairs | None" = None) -> None:
        """members: for each table the indices of its bodies."""
        self.tables, self._excluded = defaultdict[int, set[int]](set), excluded
        for number, bodies in enumerate(members):
            for body in bodies:
                self.tables[body].add(number)

    @classmethod
    def named(cls, tables: Iterable[list[str]], names: list[str | None]) -> "BodyPairs":
        """From tables with names of bodies; names: of all bodies. Unknown names are ignored."""
        number = {name: k for k, name in enumerate(names) if name is not None}
        return cls([number[name] for name in bodies if name in number] for bodies in tables if len(bodies) > 1)

    def has(self, i: int, j: int) -> bool:
        """Whether two bodies are a pair."""
        named = i != j and not self.tables.get(i, set()).isdisjoint(self.tables.get(j, set()))
        return named and (self._excluded is None or not self._excluded.has(i, j))

    def between(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Whether bodies first[k] and second[k] are a pair, (n,) bool; first, second: indices (n,)."""
        result, different = np.zeros(len(first), bool), np.flatnonzero(first != second)
        i, j = first[different].astype(np.int64), second[different].astype(np.int64)
        count = int(max(i.max(initial=0), j.max(initial=0))) + 1
        pairs, number = np.unique(i * count + j, return_inverse=True)
        result[different] = np.array([self.has(*divmod(pair, count)) for pair in pairs.tolist()], bool)[number]
        return result


def contact_faults(contacts: list[Contact]) -> list[FaultDetail]:
    """Faults of bodies that one contact names twice, and of pairs that two contacts name."""
    faults, earlier, alone = list[FaultDetail](), defaultdict[str, set[int]](set), set[str]()
    for i, one in enumerate(contacts):
        place, bodies = ("contact", i, "bodies"), dict.fromkeys(one.bodies)
        if len(bodies) < len(one.bodies):
            faults.append((place, "each body once (one name alone: contact within it)", one.bodies))
        elif len(bodies) == 1:
            if one.bodies[0] in alone:
                faults.append((place, "a body that no other contact names alone", one.bodies, "repeated"))
            alone.update(bodies)
        else:
            if again := _named_by(earlier, dict(zip(bodies, bodies))):
                faults.append((place, "pairs that no other contact names", again, "repeated"))
            for name in bodies:
                earlier[name].add(i)
    return faults


ALL = ["all"]


class Bond(SceneModel):
    """Bodies of one method that are joined where they touch at the start, like parts of one body.

    Bodies of `ulsph` press on one another or stick, by the key `contact` of the method.

    bodies   names of bodies: all pairs of them; or "all": all pairs of bodies of one method without a contact
    """

    bodies: Annotated[list[str], Field(min_length=1)] = Field(
        description="names of bodies of one method, or 'all'", json_schema_extra={"or": "string"}
    )

    @field_validator("bodies", mode="before")
    @classmethod
    def _as_list(cls, value: Any) -> Any:
        return list(ALL) if value == "all" else value

    @field_validator("bodies")
    @classmethod
    def _several(cls, value: list[str]) -> list[str]:
        if len(value) == 1 and value != ALL:
            raise mismatch("two names or more, or 'all'", value, "length")
        return value


def bond_faults(scene: Any, models_known: bool) -> list[FaultDetail]:
    """Faults of bonds: bodies of several methods (if `models_known`), pairs that another table names."""
    names, faults = [body.name for body in scene.bodies], list[FaultDetail]()
    number = {name: k for k, name in enumerate(names) if name is not None}
    several = models_known and len(scene.methods or ()) > 1
    contact = {} if scene.in_contact is None else scene.in_contact.tables
    earlier = defaultdict[int, set[int]](set)
    for i, one in enumerate(scene.bond):
        place = ("bond", i, "bodies")
        if one.bodies == ALL:
            if len(scene.bond) > 1:
                faults.append((place, "'all' in the only bond", Phrase(f"{len(scene.bond)} bonds"), "repeated"))
            continue
        if len(set(one.bodies)) < len(one.bodies):
            faults.append((place, "each body once", one.bodies, "repeated"))
        known = {number[name]: name for name in one.bodies if name in number}
        if several and len({scene.bodies[body].method for body in known}) > 1:
            faults.append((place, "bodies of one method (a [[tie]] joins those of two)", list(known.values())))
        if both := _named_by(contact, known):
            faults.append((place, "pairs that no contact names", both))
        if again := _named_by(earlier, known):
            faults.append((place, "pairs that no other bond names", again, "repeated"))
        for body in known:
            earlier[body].add(i)
    return faults


def _named_by(tables: Mapping[Any, set[int]], known: dict[Any, str]) -> list[str]:
    """Names of two bodies that one table names together, or nothing.

    tables: body -> tables that name it; known: body -> its name
    """
    first: dict[int, Any] = {}
    for body, name in known.items():
        for table in tables.get(body, ()):
            if first.setdefault(table, body) != body:
                return [known[first[table]], name]
    return []


# energy terms of ties: stored energy; signs as in `simulation.ledger`
TIE_TERMS = {"tie_energy": 0}


class Tie(SceneModel):
    """Two bodies of different methods, or from meshes, that are joined where their faces touch at the start."""

    bodies: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(description="names of two bodies")
    stiffness: float = Field(
        4.0,
        gt=0.0,
        le=1e4,
        description="factor on the smaller M/h of the two bodies, M = lambda + 2 mu: faces separate by h/stiffness "
        "times the strain of the softer body",
    )


def tied_pairs(scene: Any) -> list[tuple[int, int, Tie]]:
    """Indices of the two bodies of every tie, in rising order, and the tie."""
    names = [body.name for body in scene.bodies]
    result = []
    for one in scene.tie:
        first, second = sorted(names.index(name) for name in one.bodies)
        result.append((first, second, one))
    return result


def tie_faults(scene: Any, systems_known: bool) -> list[FaultDetail]:
    """Faults of ties: of one body and, if systems are known, of bodies that are bonded or in contact, or whose method
    refuses ties."""
    faults: list[FaultDetail] = [
        (("tie", i, "bodies"), "two bodies", one.bodies) for i, one in enumerate(scene.tie) if len(set(one.bodies)) < 2
    ]
    if faults or not scene.tie or not systems_known:
        return faults
    contact, seen = scene.in_contact, set()
    for i, (first, second, one) in enumerate(tied_pairs(scene)):
        place = ("tie", i, "bodies")
        if (first, second) in seen:
            faults.append((place, "a pair that no other tie names", one.bodies))
        seen.add((first, second))
        if contact is not None and contact.has(first, second):
            faults.append((place, "a pair without contact", one.bodies))
        for system in scene.systems:
            bonding = dict(zip(system.bodies, system.settings.bonding(scene, system.bodies)))
            if {first, second} <= set(system.bodies) and bonding[first] and bonding[second]:
                expected = "bodies of two methods (a [[bond]] joins those of one)"
                faults.append((place, expected, one.bodies))
            refused = system.settings.tie_refused(scene.part(system))
            if refused is not None and {first, second} & set(system.bodies):
                faults.append((("tie",), f"no such table {refused}", one.bodies))
    return faults
