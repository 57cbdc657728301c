"""How bodies meet as a scene states it: contact between and within them, bonds and ties."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from itertools import combinations
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import FaultDetail, NotNegative, SceneModel, mismatch, unknown_body
from parsolid.scene.method_settings import KINETIC_OFFSET
from parsolid.scene.observation import holds_heat

# what contact and tools add to the ledger: parts of what is stored, and what friction takes; and the kinetic offset of
# free tools, see `methods.leapfrog`; signs as in `simulation.ledger`
CONTACT_TERMS = {"contact_energy": 0, "stick_energy": 0, "friction_dissipation": 1}
TOOL_TERMS = {KINETIC_OFFSET: -1}
# what of friction's dissipation is in stored energies, for laws that store heat
FRICTION_HEAT = {"friction_heat": -1}
# what contact on a grid takes from velocities of nodes that close, and from those that slide
GRID_TERMS = {"contact_dissipation": 1, "friction_dissipation": 1}
# of the kernel model: factor on the stiffness, radius in spacings
USUAL = {"stiffness": 1.0, "radius": 2.7}


class Contact(SceneModel):
    """Bodies that press on one another and part freely."""

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
        description="factor alpha on the least M/h of the two bodies, M = lambda + 2 mu; 1 unless given",
    )
    radius: float | None = Field(
        None,
        ge=2.2,
        le=8.0,
        description="of the kernel that feels the other body, in the larger of the two spacings; 2.7 unless given",
    )

    @model_validator(mode="before")
    @classmethod
    def _complete_forces(cls, value: Any) -> Any:
        """What is for forces alone has a value there, and none on a grid, where a stated one is refused."""
        forces = isinstance(value, dict) and value.get("model", "kernel") == "kernel"
        return USUAL | value if forces else value


def energy_terms(contacts: Any, tools: Any, materials: list[Any]) -> dict[str, int]:
    """What contacts and tools of a scene with these materials add to the ledger."""
    forces, grid = of_model(contacts, "kernel"), of_model(contacts, "grid")
    terms = (CONTACT_TERMS if forces or tools else {}) | (TOOL_TERMS if tools else {}) | (GRID_TERMS if grid else {})
    rubs = any(one.friction for one in (*forces, *grid, *tools))
    warms = rubs and any(map(holds_heat, materials))
    return terms | (FRICTION_HEAT if warms else {})


def of_model(contacts: Any, model: str) -> list[Contact]:
    """Contacts of one model."""
    return [one for one in contacts if one.model == model]


def bodies_in_contact(scene: Any) -> set[int]:
    """Numbers of those that tools or other bodies may touch."""
    named = [name for one in scene.contact for name in one.bodies]
    named += [name for one in scene.tools for name in one.bodies or [body.name for body in scene.bodies]]
    return {i for i, body in enumerate(scene.bodies) if body.name in named}


def in_contact(scene: Any, bodies: Iterable[int]) -> list[str]:
    """Names of those of some bodies that meet another one, by forces between particles."""
    named = {name for one in of_model(scene.contact, "kernel") if len(one.bodies) > 1 for name in one.bodies}
    return [scene.bodies[i].name for i in bodies if scene.bodies[i].name in named]


def grid_pairs(scene: Any) -> dict[tuple[int, int], float]:
    """Friction between every two systems that meet on their grid, by their numbers."""
    names = {body.name: number for number, body in enumerate(scene.bodies)}
    home = {body: number for number, system in enumerate(scene.systems) for body in system.bodies}
    result: dict[tuple[int, int], float] = {}
    for contact in of_model(scene.contact, "grid"):
        for i, j in combinations(sorted(names[name] for name in contact.bodies), 2):
            result.setdefault((min(home[i], home[j]), max(home[i], home[j])), contact.friction)
    return result


def grid_faults(scene: Any) -> list[FaultDetail]:
    """Grid contacts of bodies that have no grid in common, with keys that are for forces, or without agreement."""
    details = list[FaultDetail]()
    home = {scene.bodies[number].name: one for one in scene.systems for number in one.bodies}
    for i, contact in enumerate(scene.contact):
        # names that no body has are told elsewhere
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
    # contacts on a grid that name a body of each system, by the first of its bodies
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
    """Pairs of numbered bodies: every two that a table names together, but those of other pairs.

    tables (of each body): numbers of the tables that name it.
    """

    def __init__(self, members: Iterable[Iterable[int]], but: "BodyPairs | None" = None) -> None:
        """members: numbers of the bodies of each table, of which one alone makes no pair."""
        self.tables, self._but = defaultdict[int, set[int]](set), but
        for number, bodies in enumerate(members):
            for body in bodies:
                self.tables[body].add(number)

    @classmethod
    def named(cls, tables: Iterable[list[str]], names: list[str | None]) -> "BodyPairs":
        """Of tables with names of bodies; those that no body has count for nothing."""
        number = {name: k for k, name in enumerate(names) if name is not None}
        return cls([number[name] for name in bodies if name in number] for bodies in tables if len(bodies) > 1)

    def has(self, i: int, j: int) -> bool:
        """Whether a table names two bodies."""
        named = i != j and not self.tables.get(i, set()).isdisjoint(self.tables.get(j, set()))
        return named and (self._but is None or not self._but.has(i, j))

    def between(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Whether a table names each two of bodies first and second (n,)."""
        result, unlike = np.zeros(len(first), bool), np.flatnonzero(first != second)
        one, other = (body[unlike].astype(np.int64) for body in (first, second))
        count = int(max(one.max(initial=0), other.max(initial=0))) + 1
        pairs, number = np.unique(one * count + other, return_inverse=True)
        result[unlike] = np.array([self.has(*divmod(pair, count)) for pair in pairs.tolist()], bool)[number]
        return result


def contact_faults(contacts: list[Contact], names: list[str] | None) -> list[FaultDetail]:
    """Bodies that are not there, and pairs that are named twice; names: of all bodies."""
    faults, sizes, named = list[FaultDetail](), dict[int, int](), defaultdict[str, list[int]](list)
    known = set(names or ())
    for i, one in enumerate(contacts):
        for name in dict.fromkeys(one.bodies):
            if names is not None and name not in known:
                faults.append(unknown_body(("contact", i, "bodies"), name, names))
        if len(set(one.bodies)) < len(one.bodies):
            expected = "each body once (one name alone: contact within it)"
            faults.append((("contact", i, "bodies"), expected, one.bodies))
            continue
        # contacts that have named two of its bodies, or the only one
        shared = Counter(earlier for name in one.bodies for earlier in named[name] if sizes[earlier] > 1)
        twice = [earlier for earlier, count in shared.items() if count > 1]
        if len(one.bodies) == 1:
            twice = [earlier for earlier in named[one.bodies[0]] if sizes[earlier] == 1]
        if twice:
            first = min(twice)
            found = " and ".join(map(repr, [name for name in sorted(one.bodies) if first in named[name]][:2]))
            expected = f"pairs that contact.{first} does not name"
            faults.append((("contact", i, "bodies"), expected, found, "repeated"))
        sizes[i] = len(one.bodies)
        for name in one.bodies:
            named[name].append(i)
    return faults


ALL = ["all"]


class Bond(SceneModel):
    """Bodies that their method joins where they touch at the start, as if they were parts of one.

    Those of `ulsph` press on one another or stick, as the key `contact` of the method says.

    bodies   names of bodies of one method, every pair of them; or "all": every pair of bodies of one method that no
             contact names
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


def bonded_pairs(scene: Any) -> BodyPairs:
    """Pairs of the scene's bodies that bonds name."""
    names, contact = [body.name for body in scene.bodies], scene.in_contact
    if all(one.bodies != ALL for one in scene.bond):
        return BodyPairs.named([one.bodies for one in scene.bond], names)
    groups: dict[Any, list[int]] = {}
    for number, body in enumerate(scene.bodies):
        groups.setdefault(body.method if len(scene.methods or ()) > 1 else None, []).append(number)
    return BodyPairs(groups.values(), contact)


def bond_faults(scene: Any, models_known: bool) -> list[FaultDetail]:
    """Bonds of bodies that are not there or, where these are known, of several methods, and pairs that another table
    names."""
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
        faults += [unknown_body(place, name, number) for name in one.bodies if name not in number]
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


def _named_by(tables: Mapping[int, set[int]], known: dict[int, str]) -> list[str]:
    """Names of two of some bodies that one table names together, by the tables that name each; empty without any."""
    first: dict[int, int] = {}
    for body, name in known.items():
        for table in tables.get(body, ()):
            if first.setdefault(table, body) != body:
                return [known[first[table]], name]
    return []


# what a tie adds to the ledger: a part of what is stored; signs as in `simulation.ledger`
TIE_TERMS = {"tie_energy": 0}


class Tie(SceneModel):
    """Two bodies of different methods, or from meshes, whose faces touch at the start and stay together."""

    bodies: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(description="names of two bodies")
    stiffness: float = Field(
        4.0,
        gt=0.0,
        le=1e4,
        description="factor on the least M/h of the two bodies, M = lambda + 2 mu: the faces part by h/stiffness "
        "times the strain of the softer one",
    )


def tied_pairs(scene: Any) -> list[tuple[int, int, Tie]]:
    """Numbers of the bodies of every tie, rising, and the tie."""
    names = [body.name for body in scene.bodies]
    result = []
    for one in scene.tie:
        first, second = sorted(names.index(name) for name in one.bodies)
        result.append((first, second, one))
    return result


def tie_faults(scene: Any, systems_known: bool) -> list[FaultDetail]:
    """Ties of bodies that are not there; where systems are known also of those that are bonded already, that are in
    contact, or whose method has no motion that impulses could change."""
    names, faults = [body.name for body in scene.bodies], list[FaultDetail]()
    for i, one in enumerate(scene.tie):
        unknown = [name for name in one.bodies if name not in names]
        faults += [unknown_body(("tie", i, "bodies"), name, names) for name in unknown]
        if not unknown and len(set(one.bodies)) < 2:
            faults.append((("tie", i, "bodies"), "two bodies", one.bodies))
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
