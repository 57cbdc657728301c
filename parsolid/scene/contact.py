"""Contact between bodies, and within one, as a scene states it."""

from itertools import combinations
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from parsolid.scene.base_model import NotNegative, SceneModel
from parsolid.scene.validation_errors import fault, suggestion

# what contact and tools add to the ledger: parts of what is stored, and what friction takes; and contact alone: what
# leapfrog adds by the end of a step and takes by the next; signs as in `simulation.ledger`
CONTACT_TERMS = {"contact_energy": 0, "stick_energy": 0, "friction_dissipation": 1}
OSCILLATION = {"contact_oscillation": -1}
# what of friction's dissipation is in stored energies, for laws that store heat
FRICTION_HEAT = {"friction_heat": -1}


class Contact(SceneModel):
    """Bodies that press on one another and part freely; what is not named sticks where it touches, as ever.

    bodies      names: of one body, which may touch itself, or of several, every pair of them
    friction    coefficient of Coulomb's law
    stiffness   factor alpha on the least M/h of the two bodies, M = lambda + 2 mu
    radius      of the kernel that feels the other body, in the larger of the two spacings
    """

    bodies: Annotated[list[str], Field(min_length=1)] = Field(description="names of bodies")
    friction: NotNegative = 0.0
    stiffness: float = Field(1.0, gt=0.0, le=1e4, description="factor on the least M/h of the two bodies")
    radius: float = Field(2.7, ge=2.2, le=8.0, description="of the kernel, in the larger of the two spacings")


class BodyPair(NamedTuple):
    """Numbers of two bodies of a scene, or twice the same, and how they meet."""

    first: int
    second: int
    contact: Contact


def energy_terms(contacts: Any, tools: Any, bodies: Any) -> dict[str, int]:
    """What contacts and tools of a scene with these bodies add to the ledger."""
    terms = CONTACT_TERMS if contacts or tools else {}
    rubs = any(one.friction for one in (*contacts, *tools))
    warms = rubs and any(getattr(body.material, "kind", None) == "elastic-plastic" for body in bodies)
    return terms | (OSCILLATION if contacts else {}) | (FRICTION_HEAT if warms else {})


def contact_pairs(contacts: list[Contact], names: list[str | None]) -> list[BodyPair]:
    """Every pair of bodies in contact, by the names of the scene's bodies."""
    result = []
    for one in contacts:
        numbers = [names.index(name) for name in one.bodies]
        pairs = [(numbers[0], numbers[0])] if len(numbers) == 1 else list(combinations(sorted(numbers), 2))
        result += [BodyPair(i, j, one) for i, j in pairs]
    return result


def unbonded(contacts: list[Contact], names: list[str | None]) -> np.ndarray | None:
    """Which bodies are in contact with which (bodies, bodies), so that no pair of their particles is bonded.

    None where all are bonded where they touch. Names of other bodies than those given count for nothing.
    """
    here = [one.model_copy(update={"bodies": [name for name in one.bodies if name in names]}) for one in contacts]
    pairs = contact_pairs([one for one in here if len(one.bodies) > 1], names)
    if not pairs:
        return None
    result = np.zeros((len(names), len(names)), bool)
    for pair in pairs:
        result[pair.first, pair.second] = result[pair.second, pair.first] = True
    return result


def contact_faults(contacts: dict[int, Contact], bodies: dict[int, Any], complete: bool) -> list[str]:
    """Bodies that are not there, and pairs that are named twice."""
    faults, seen = [], dict[tuple[str, ...], int]()
    names = [body.name for body in bodies.values() if body.name is not None]
    for i, one in contacts.items():
        for name in dict.fromkeys(one.bodies):
            if name not in names and complete:
                expected = f"the name of a body{suggestion(name, names)}"
                faults.append(fault(("contact", i, "bodies"), expected, name))
        if len(set(one.bodies)) < len(one.bodies):
            expected = "each body once (one name alone: contact within it)"
            faults.append(fault(("contact", i, "bodies"), expected, one.bodies))
            continue
        pairs = [tuple(one.bodies)] if len(one.bodies) == 1 else list(combinations(sorted(one.bodies), 2))
        for pair in pairs:
            if pair in seen:
                found = " and ".join(map(repr, pair))
                faults.append(fault(("contact", i, "bodies"), f"pairs that contact.{seen[pair]} does not name", found))
                break
        seen |= {pair: i for pair in pairs if pair not in seen}
    return faults
