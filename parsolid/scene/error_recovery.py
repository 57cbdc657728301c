"""Validation with error recovery, so that one message has all faults of a scene.

A faulty table is repaired so that the other tables can be checked: an unknown key or a faulty entry of a list is
removed, a number out of bounds or a faulty formula is replaced by a valid one.
"""

from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from parsolid.materials.registry import declared
from parsolid.scene.base_model import FaultDetail, fault_of_error, is_within, kinds_of, value_at
from parsolid.scene.declared import model_of
from parsolid.scene.method_settings import MethodSettings
from parsolid.scene.methods import SETTINGS, refused_kinds, settings_class
from parsolid.scene.raw_tables import numbers_out_of_range
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import Fault, fault

# largest number of passes, each of which repairs the faults found
MOST_PASSES = 8
# lists from which a faulty entry is removed
_ENTRIES = ("boundaries", "initial", "contact", "bond", "tie", "tools", "probes")
Place = tuple[str | int, ...]
# keys of a body that determine the positions of its particles
_PLACES = ("shape", "particles", "spacing")


@dataclass
class Repairs:
    """Differences between the repaired tables of a scene and those of its file.

    numbers         for each list, the indices in the file of its remaining entries
    body_names      of all bodies, None if one is faulty
    regions         names of regions in removed entries
    incomplete      entries were removed
    misplaced       indices of bodies whose positions differ from the file
    shape_unknown   the shape of a body was replaced
    methods_known   the kinds of all methods are valid
    models_known    all methods and materials are valid
    systems_known   so are all keys of methods and the positions of bodies
    end_known       the end time is valid
    stand_ins       locations of replaced values; faults there are not faults of the file
    reduced_methods locations of methods without a faulty key; faults of their validation are not faults of the file
    """

    numbers: dict[str, list[int]] = field(default_factory=dict)
    body_names: list[str] | None = None
    regions: set[str] = field(default_factory=set)
    incomplete: bool = False
    misplaced: set[int] = field(default_factory=set)
    shape_unknown: bool = False
    methods_known: bool = True
    models_known: bool = True
    systems_known: bool = True
    end_known: bool = True
    stand_ins: set[Place] = field(default_factory=set)
    reduced_methods: set[Place] = field(default_factory=set)

    @classmethod
    def none(cls, tables: dict[str, Any]) -> "Repairs":
        """For tables without repairs."""
        numbers = {key: list(range(len(tables[key]))) for key in _ENTRIES if isinstance(tables.get(key), list)}
        bodies = tables["bodies"] if isinstance(tables.get("bodies"), list) else []
        sound = all(isinstance(body, dict) and isinstance(body.get("name", ""), str) for body in bodies)
        return cls(numbers, [body["name"] for body in bodies if "name" in body] if sound else None)

    def number(self, key: str, entry: int) -> int:
        """The index in the file of an entry of a list."""
        return self.numbers[key][entry] if key in self.numbers else entry

    def in_file(self, place: Place) -> Place:
        """The location in the file of a location in the repaired tables."""
        if len(place) > 1 and isinstance(place[1], int):
            return place[0], self.number(str(place[0]), place[1]), *place[2:]
        return place

    def faults(self, details: list[FaultDetail]) -> list[Fault]:
        """Details of checks between tables as faults of the file."""
        faults = []
        for place, expected, value, *code in details:
            location = self.in_file(place)
            if not is_within(location, self.stand_ins):
                faults.append(fault(location, expected, value, *code))
        return faults


def placeholder_method(settings: type[MethodSettings] | None = None, name: str | None = None) -> Any:
    """A method that replaces a faulty one with these settings, so that other tables can be checked."""
    settings = settings or next(iter(SETTINGS.values()))
    return settings.model_construct(kind=kinds_of(settings)[0], name=name)


def placeholder_material() -> Any:
    """A material that replaces a faulty one, so that other tables can be checked."""
    table: Any = model_of(declared("hyperelastic", "neo-hookean"))
    return table.model_construct(kind="neo-hookean", density=1.0)


def validate_with_recovery(data: dict[str, Any], context: dict[str, Any]) -> tuple[Any, Repairs, list[Fault]]:
    """The scene of the repaired tables, the repairs, and the faults of single tables.

    The scene is None if the tables cannot be repaired, as without a dimension or a body.
    """
    tables, repairs = _copied(data), Repairs.none(data)
    context = context | {"repairs": repairs}
    refused = refused_kinds(data)
    faults: dict[Fault, None] = dict.fromkeys(fault(*one) for one in refused)
    _repair(tables, [_item(*one) for one in refused], repairs, context)
    for number in range(MOST_PASSES):
        found: list[Any] = []
        scene = None
        try:
            scene = Scene.model_validate(tables, context=context)
        except ValidationError as error:
            found = error.errors(include_url=False)
        skipped = repairs.stand_ins | repairs.reduced_methods
        for item in found:
            place = repairs.in_file(item["loc"])
            if not is_within(place, skipped):
                faults[fault_of_error(item, place)] = None
        if number == 0:
            known = {item["loc"] for item in found}
            out_of_range = [one for one in numbers_out_of_range(data) if not is_within(one[0], known)]
            faults.update((fault(*one, code="bound"), None) for one in out_of_range)
            found += [_item(*one, "bound") for one in out_of_range]
        if not found:
            return scene, repairs, list(faults)
        if context["dimension"] is None or not _repair(tables, found, repairs, context):
            break
    return None, repairs, list(faults)


def _item(place: Place, expected: str, found: object, code: str = "refused") -> Any:
    """A detail of a fault like an error of pydantic."""
    return {"loc": place, "ctx": {"code": code}, "input": found}


def _copied(tables: Any) -> Any:
    """A deep copy of tables and lists; other values are shared."""
    if isinstance(tables, dict):
        return {key: _copied(value) for key, value in tables.items()}
    return [_copied(value) for value in tables] if isinstance(tables, list) else tables


def _repair(tables: dict[str, Any], found: list[ErrorDetails], repairs: Repairs, context: dict[str, Any]) -> bool:
    """Repair tables at the errors found; whether that is possible."""
    dropped: set[tuple[str, int]] = set()
    for item in found:
        place = item["loc"]
        top: Any = place[0] if place else None
        table = value_at(tables, place[:-1])
        if place and not isinstance(table, dict | list):
            # the table has been replaced
            continue
        if item["ctx"]["code"] == "unknown-key":
            table.pop(place[-1], None)
        elif top in _ENTRIES and len(place) > 1:
            dropped.add((top, int(place[1])))
        elif top == "bodies" and len(place) > 1:
            _repair_body(tables["bodies"], item, repairs, context)
        elif top == "regions" and len(place) > 1:
            # replaced by a region of the same name
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
        # regions that a removed entry names count as used
        entry = tables[key].pop(number)
        repairs.numbers[key].pop(number)
        repairs.incomplete = True
        if isinstance(entry, dict) and isinstance(entry.get("where"), str):
            repairs.regions.add(entry["where"])
    return True


def _repair_method(tables: dict[str, Any], item: ErrorDetails, repairs: Repairs) -> None:
    """Remove a faulty key of a method if it has a default; otherwise replace the method."""
    place: tuple[Any, ...] = item["loc"]
    depth = 1 if place[:1] == ("method",) else 2
    table = value_at(tables, place[:depth]) if len(place) > depth else None
    if not isinstance(table, dict | None):
        return
    model = settings_class(table)
    own = model.model_fields.get(place[depth]) if table and model else None
    if table and own is not None and not own.is_required():
        table.pop(place[depth], None)
        repairs.stand_ins.add(place[: depth + 1])
        repairs.reduced_methods.add(place[:depth])
        # the default of a number is good enough for checks of other tables
        repairs.systems_known = repairs.systems_known and item["ctx"]["code"] == "bound" and len(place) == depth + 1
        return
    repairs.models_known = repairs.systems_known = False
    if place[:1] == ("methods",) and len(place) > 1:
        methods = tables["methods"]
        name = methods[place[1]].get("name") if isinstance(methods[place[1]], dict) else None
        methods[place[1]] = placeholder_method(model, str(name))
    else:
        tables.pop("methods", None)
        tables["method"] = placeholder_method(model)
    repairs.methods_known = repairs.methods_known and model is not None


def _repair_body(bodies: list[Any], item: ErrorDetails, repairs: Repairs, context: dict[str, Any]) -> None:
    dimension, methods = context["dimension"], context["methods"]
    place: tuple[Any, ...] = item["loc"]
    number, key = place[1], place[2] if len(place) > 2 else None
    if not isinstance(bodies[number], dict):
        bodies[number] = {"material": placeholder_material()}
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
            body[key] = methods[0]
    elif key in (None, *_PLACES) or (key not in body and place[:3] not in repairs.stand_ins):
        # first the number of particles is replaced, then the shape
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
        body.pop(key, None)
        repairs.stand_ins.add(place[:3])
        if key == "temperature":
            repairs.stand_ins.add((*place[:2], "thermal_reference"))
        if key == "name":
            repairs.body_names = None


def _repair_material(body: dict[str, Any], item: ErrorDetails, repairs: Repairs) -> None:
    """Replace a number out of bounds by one within them; for other faults replace the material."""
    place: tuple[Any, ...] = item["loc"]
    table = place[:3]
    if item["ctx"]["code"] == "bound" and len(place) > 3 and table not in repairs.stand_ins:
        bounds = item["ctx"]
        within = (
            bounds["gt"] + 1.0
            if "gt" in bounds
            else next((bounds[key] for key in ("ge", "le", "lt") if key in bounds), 1.0)
        )
        value_at(body, place[2:-1])[place[-1]] = float(within)
        repairs.stand_ins.add(place if place[3:] == ("density",) else table)
        return
    body["material"] = placeholder_material()
    repairs.models_known = repairs.systems_known = False
    repairs.stand_ins.update([table, (*table[:2], "thermal_reference"), (*table[:2], "micro_rate")])
