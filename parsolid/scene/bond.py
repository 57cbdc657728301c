"""Bodies of one method that act on one another where they touch at the start, as a scene states it."""

from collections import defaultdict
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, field_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import FaultDetail, SceneModel, mismatch
from parsolid.scene.contact import BodyPairs
from parsolid.scene.validation_errors import suggestion

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


def bond_faults(scene: Any) -> list[FaultDetail]:
    """Bonds of bodies that are not there or of several methods, and pairs that another table names."""
    names, faults = [body.name for body in scene.bodies], list[FaultDetail]()
    number = {name: k for k, name in enumerate(names) if name is not None}
    several, contact = len(scene.methods or ()) > 1, {} if scene.in_contact is None else scene.in_contact.tables
    earlier = defaultdict[int, set[int]](set)
    for i, one in enumerate(scene.bond):
        place = ("bond", i, "bodies")
        if one.bodies == ALL:
            if len(scene.bond) > 1:
                faults.append((place, "'all' in the only bond", Phrase(f"{len(scene.bond)} bonds"), "repeated"))
            continue
        for name in one.bodies:
            if name not in number:
                faults.append((place, f"the name of a body{suggestion(name, number)}", name, "unknown-name"))
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
