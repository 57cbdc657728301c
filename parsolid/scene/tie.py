"""Bodies that no method bonds and that are tied where they touch at the start, as a scene states it."""

from typing import Annotated, Any

from pydantic import Field

from parsolid.scene.base_model import FaultDetail, SceneModel
from parsolid.scene.validation_errors import suggestion

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


def tie_faults(scene: Any) -> list[FaultDetail]:
    """Ties of bodies that are not there, that are bonded already, that are in contact, or whose method has no motion
    that impulses could change."""
    names, faults = [body.name for body in scene.bodies], list[FaultDetail]()
    for i, one in enumerate(scene.tie):
        unknown = [name for name in one.bodies if name not in names]
        for name in unknown:
            hint = suggestion(name, [each for each in names if each])
            faults.append((("tie", i, "bodies"), f"the name of a body{hint}", name, "unknown-name"))
        if not unknown and len(set(one.bodies)) < 2:
            faults.append((("tie", i, "bodies"), "two bodies", one.bodies))
    if faults or not scene.tie:
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
