"""Validation that goes on after an error, so that one message has every fault of a scene.

A table that is at fault is repaired just as far as the others need it to be checked: an unknown key is taken away, an
entry of a list is left out, a number out of its bounds and a formula are replaced by one that is valid.
"""

from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from parsolid.materials.registry import declared
from parsolid.scene.base_model import FaultDetail, fault_of_error
from parsolid.scene.declared import model_of
from parsolid.scene.methods import SETTINGS, settings_class
from parsolid.scene.raw_tables import numbers_out_of_range
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import Fault, fault

# passes over the tables, each of which repairs what is at fault, until the tables are given up
MOST_PASSES = 8
# lists of which an entry at fault is left out
_ENTRIES = ("boundaries", "initial", "contact", "bond", "tie", "tools", "probes")
Place = tuple[str | int, ...]
_FORMULAS = ("velocity", "displacement", "deformation_gradient", "temperature", "micro_rate")
# keys of a body that say where its particles are
_PLACES = ("shape", "particles", "spacing")


@dataclass
class Repairs:
    """How the repaired tables of a scene differ from those of its file.

    numbers: of the entries of each list, those in the file; body_names: of all bodies, None where one is at fault;
    regions: those that entries name which are left out; incomplete: entries are missing; misplaced: bodies that are not
    where the file has them; shape_unknown: the shape of one is not known; models_known: all methods and materials are
    known; systems_known: so are all keys of methods, and where bodies are; end_known: the end time is known; stand_ins:
    places where another value stands for one at fault, so that faults there are not the file's; reduced_methods: tables
    of methods from which a key at fault was taken, so that faults found as they are read are not the file's.
    """

    numbers: dict[str, list[int]] = field(default_factory=dict)
    body_names: list[str] | None = None
    regions: set[str] = field(default_factory=set)
    incomplete: bool = False
    misplaced: set[int] = field(default_factory=set)
    shape_unknown: bool = False
    models_known: bool = True
    systems_known: bool = True
    end_known: bool = True
    stand_ins: set[Place] = field(default_factory=set)
    reduced_methods: set[Place] = field(default_factory=set)

    @classmethod
    def none(cls, tables: dict[str, Any]) -> "Repairs":
        """Before any table is repaired."""
        numbers = {key: list(range(len(tables[key]))) for key in _ENTRIES if isinstance(tables.get(key), list)}
        bodies = tables["bodies"] if isinstance(tables.get("bodies"), list) else []
        sound = all(isinstance(body, dict) and isinstance(body.get("name", ""), str) for body in bodies)
        return cls(numbers, [body["name"] for body in bodies if "name" in body] if sound else None)

    def number(self, key: str, entry: int) -> int:
        """The number in the file of an entry of a list."""
        return self.numbers[key][entry] if key in self.numbers else entry

    def stated(self, place: Place) -> Place:
        """The place in the file of one in the repaired tables."""
        if len(place) > 1 and isinstance(place[1], int):
            return place[0], self.number(str(place[0]), place[1]), *place[2:]
        return place

    def faults(self, details: list[FaultDetail]) -> list[Fault]:
        """Details of checks between tables as faults of the file."""
        found = []
        for place, expected, value, *code in details:
            stated = self.stated(place)
            if not is_within(stated, self.stand_ins):
                found.append(fault(stated, expected, value, *code))
        return found


def unknown_method() -> Any:
    """What stands for a method of which nothing is known, so that other tables can be judged."""
    kind, settings = next(iter(SETTINGS.items()))
    return settings.model_construct(kind=kind)


def unknown_material() -> Any:
    """The same of a material."""
    table: Any = model_of(declared("hyperelastic", "neo-hookean"))
    return table.model_construct(kind="neo-hookean", density=1.0)


def is_within(place: Place, tables: set[Place]) -> bool:
    """Whether a place is in one of some tables, or is one of them."""
    return any(place[: len(one)] == one for one in tables)


def validate_with_recovery(data: dict[str, Any], context: dict[str, Any]) -> tuple[Any, Repairs, list[Fault]]:
    """The scene of the repaired tables, the repairs, and the faults of single tables.

    The scene is None where no repair lets the other tables be checked: without a dimension, or a body.
    """
    tables, repairs = _copied(data), Repairs.none(data)
    faults: dict[Fault, None] = {}
    for number in range(MOST_PASSES):
        found: list[Any] = []
        scene = None
        try:
            scene = Scene.model_validate(tables, context=context)
        except ValidationError as error:
            found = error.errors(include_url=False)
        skipped = repairs.stand_ins | repairs.reduced_methods
        for item in found:
            place = repairs.stated(item["loc"])
            if not is_within(place, skipped):
                faults[fault_of_error(item, place)] = None
        if number == 0:
            known = {item["loc"] for item in found}
            out_of_range = [one for one in numbers_out_of_range(data) if not is_within(one[0], known)]
            faults.update((fault(*one, code="bound"), None) for one in out_of_range)
            found += [{"loc": place, "ctx": {"code": "bound"}, "input": value} for place, _, value in out_of_range]
        if not found:
            return scene, repairs, list(faults)
        if context["dimension"] is None or not _repair(tables, found, repairs, context):
            break
    return None, repairs, list(faults)


def _copied(tables: Any) -> Any:
    """Tables that have no other in common, whoever made them."""
    if isinstance(tables, dict):
        return {key: _copied(value) for key, value in tables.items()}
    return [_copied(value) for value in tables] if isinstance(tables, list) else tables


def _repair(tables: dict[str, Any], found: list[ErrorDetails], repairs: Repairs, context: dict[str, Any]) -> bool:
    """Repair tables where errors were found; whether that could be done."""
    dropped: set[tuple[str, int]] = set()
    for item in found:
        place = item["loc"]
        top: Any = place[0] if place else None
        table = _table_at(tables, place[:-1])
        if place and not isinstance(table, dict | list):
            # it has been repaired as a whole
            continue
        if item["ctx"]["code"] == "unknown-key":
            table.pop(place[-1], None)
        elif top in _ENTRIES and len(place) > 1:
            dropped.add((top, int(place[1])))
        elif top == "bodies" and len(place) > 1:
            _repair_body(tables["bodies"], item, repairs, context)
        elif top == "regions" and len(place) > 1:
            # a region of the same name stands for one at fault
            number, regions = int(place[1]), tables["regions"]
            stated = regions[number].get("name") if isinstance(regions[number], dict) else None
            name = stated if isinstance(stated, str) else f"region {number}"
            plain = name.replace(".", " ").replace(",", " ").strip()
            regions[number] = {"name": plain or "region", "plane": "X = 0"}
        elif top in (None, "method", "methods"):
            _repair_method(tables, item, repairs)
        elif top == "end_time":
            tables[top], repairs.end_known = 1.0, False
        elif top in ("output", "loads") and len(place) > 1:
            tables[top].pop(place[1], None)
        elif top in ("dimension", "bodies") or top not in tables:
            return False
        else:
            tables.pop(top)
            repairs.incomplete = True
    for key, number in sorted(dropped, reverse=True):
        # leave an entry of a list out; regions that it names are in use all the same
        entry = tables[key].pop(number)
        repairs.numbers[key].pop(number)
        repairs.incomplete = True
        if isinstance(entry, dict) and isinstance(entry.get("where"), str):
            repairs.regions.add(entry["where"])
    return True


def _table_at(tables: Any, place: tuple[Any, ...]) -> Any:
    """The table or list at a place; None where something else stands."""
    for key in place:
        if not isinstance(tables, dict | list) or (isinstance(tables, dict) and key not in tables):
            return None
        tables = tables[key]
    return tables


def _repair_method(tables: dict[str, Any], item: ErrorDetails, repairs: Repairs) -> None:
    """A method without the keys that are at fault, if it can do without them; else nothing is known of it."""
    place: tuple[Any, ...] = item["loc"]
    depth = 1 if place[:1] == ("method",) else 2
    table = _table_at(tables, place[:depth]) if len(place) > depth else None
    if not isinstance(table, dict | None):
        return
    model = settings_class(table)
    own = model.model_fields.get(place[depth]) if table and model else None
    if table and own is not None and not own.is_required():
        table.pop(place[depth], None)
        repairs.stand_ins.add(place[: depth + 1])
        repairs.reduced_methods.add(place[:depth])
        # the usual number will do for what others ask of the method
        repairs.systems_known = repairs.systems_known and item["ctx"]["code"] == "bound" and len(place) == depth + 1
        return
    repairs.models_known = repairs.systems_known = False
    if place[:1] == ("methods",) and len(place) > 1:
        methods = tables["methods"]
        name = methods[place[1]].get("name") if isinstance(methods[place[1]], dict) else None
        methods[place[1]] = unknown_method().model_copy(update={"name": str(name)})
    else:
        tables.pop("methods", None)
        tables["method"] = unknown_method()


def _repair_body(bodies: list[Any], item: ErrorDetails, repairs: Repairs, context: dict[str, Any]) -> None:
    dimension, methods = context["dimension"], context["methods"]
    place: tuple[Any, ...] = item["loc"]
    number, key = place[1], place[2] if len(place) > 2 else None
    if not isinstance(bodies[number], dict):
        bodies[number] = {"material": unknown_material()}
        repairs.models_known = repairs.systems_known = False
        repairs.stand_ins.add(place[:2])
    body = bodies[number]
    if key == "material":
        _repair_material(body, item, repairs)
    elif key == "method":
        repairs.models_known = repairs.systems_known = False
        repairs.stand_ins.add(place[:2])
        body.pop(key, None)
        if methods:
            body[key] = next(iter(methods))
    elif key in _FORMULAS:
        repairs.stand_ins.add(place[:3])
        if len(place) > 3 and not isinstance(item["input"], list | dict):
            _table_at(bodies, place[1:-1])[place[-1]] = 0.0
        elif key == "deformation_gradient":
            body[key] = [[float(i == j) for j in range(dimension)] for i in range(dimension)]
        else:
            body[key] = [0.0] * dimension if key in ("velocity", "displacement") else 300.0
    elif key in (None, *_PLACES) or key not in body:
        # somewhere else, if it has been tried where the file has it
        if key == "shape" or number in repairs.misplaced or not isinstance(body.get("shape"), dict):
            body["shape"] = {"box": {"lower": [0.0] * dimension, "upper": [1.0] * dimension}}
            repairs.shape_unknown = True
        body.pop("spacing", None)
        body["particles"] = [3] * dimension
        if "mesh" in body["shape"]:
            body.pop("particles")
        repairs.misplaced.add(number)
        repairs.systems_known = False
        repairs.stand_ins.update(("bodies", number, word) for word in (*_PLACES, "placement", "grading"))
    else:
        repairs.stand_ins.add(place[:3])
        body.pop(key)
        if key == "name":
            repairs.body_names = None


def _repair_material(body: dict[str, Any], item: ErrorDetails, repairs: Repairs) -> None:
    """A number within its bounds stands for one that is not; of another fault nothing is known of the material."""
    place: tuple[Any, ...] = item["loc"]
    table = place[:3]
    if item["ctx"]["code"] == "bound" and len(place) > 3 and table not in repairs.stand_ins:
        bounds = item["ctx"]
        within = (
            bounds.get("gt", 0.0) + 1.0 if "gt" in bounds else bounds.get("ge", bounds.get("le", bounds.get("lt", 1.0)))
        )
        _table_at(body, place[2:-1])[place[-1]] = float(within)
        repairs.stand_ins.add(place if place[3:] == ("density",) else table)
        return
    body["material"] = unknown_material()
    repairs.models_known = repairs.systems_known = False
    repairs.stand_ins.update([table, (*table[:2], "thermal_reference"), (*table[:2], "micro_rate")])
