"""Probes of a scene, and the names of the fields and quantities that it may ask for."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field, PrivateAttr, ValidationInfo, create_model, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.observables.declared import Key, field_kinds, quantity_kinds, samplers_with_keys, shown_kinds
from parsolid.scene.base_model import ByKind, Point, SceneModel, dimension_of, method_of, mismatch, reject
from parsolid.scene.bodies import Name
from parsolid.scene.formulas import InitialScalar
from parsolid.scene.named_regions import RegionName
from parsolid.scene.validation_errors import NOTHING, suggestion

Kinds = Mapping[str, str]


def _kinds(info: ValidationInfo, common: Kinds) -> Kinds | None:
    """Name -> kind of the fields that may be asked for; None where the method is not known."""
    method: Any = method_of(info)
    return None if method is None else {**common, **method.field_kinds(dimension_of(info))}


def _known(value: str, known: Kinds | None) -> str:
    if known is not None and value not in known:
        raise mismatch(f"one of {', '.join(map(repr, known))}{suggestion(value, known)}", value)
    return value


def _known_field(common: Callable[[], Kinds]) -> AfterValidator:
    """Validator of the name of a field that all methods know, or the systems of the scene."""

    def check(value: str, info: ValidationInfo) -> str:
        return _known(value, _kinds(info, common()))

    return AfterValidator(check)


def _known_quantity(value: str, info: ValidationInfo) -> str:
    method: Any = method_of(info)
    return _known(value, None if method is None else quantity_kinds() | method.extra_quantities)


ProbeField = Annotated[str, _known_field(field_kinds)]
# with the word for all that a method carries on
ShownField = Annotated[str, _known_field(lambda: shown_kinds() | {"state": "state"})]
ProbeQuantity = Annotated[str, AfterValidator(_known_quantity)]


def component_names(field: str, dimension: int, kind: str | None = None) -> list[str]:
    """The history's names of a field's components: itself, with _x..., or with _xx, _xy... row by row.

    kind: of a field or quantity that not all methods know.
    """
    axes, kind = "xyz"[:dimension], kind or (field_kinds() | quantity_kinds())[field]
    if kind == "scalar" or (kind == "rotation" and dimension == 2):
        return [field]
    if kind == "tensor":
        return [f"{field}_{row}{column}" for row in axes for column in axes]
    return [f"{field}_{axis}" for axis in axes]


class Probe(SceneModel):
    """Values written to the history: fields of the particle nearest to `at`, or one quantity of all particles.

    With a region `where` in place of `at` fields are those of its particles: their mean by volume, the least or the
    greatest of each component, or their integral over the volume; a quantity is then that of the region.
    With a `weight` w(X, Y, Z) in place of `at` fields are projected on it, sum V w f / sum V w^2 over all particles:
    the amplitude of a mode w.
    twist is the angle [rad], accumulated over turns, by which the particle has turned about `axis` through `centre`.
    """

    exactly_one: ClassVar = (("fields", "quantity"),)
    at_most_one: ClassVar = (("at", "weight", "where"), ("at", "quantity"), ("weight", "quantity"))
    name: Name
    at: Point | None = Field(None, description="the point [m] whose nearest particle is followed")
    weight: InitialScalar | None = Field(None, description="a formula w in X, Y, Z on which fields are projected")
    where: RegionName | None = Field(None, description="a region or a group of a mesh: of the particles there")
    statistic: Literal["mean", "minimum", "maximum", "integral"] | None = Field(
        None, description="of fields in a region: 'mean' (unless given), 'minimum', 'maximum' or 'integral'"
    )
    fields: Annotated[list[ProbeField], Field(min_length=1)] | None = Field(None, description="what is watched there")
    quantity: ProbeQuantity | None = Field(None, description="one number or vector of all particles")
    # of the fields or the quantity, as the scene's method and declarations have it
    _kinds: dict[str, str] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _somewhere(self, info: ValidationInfo) -> "Probe":
        """Fields are of a place, a mode or a region; only a region has a statistic."""
        if self.fields is not None and self.at is None and self.weight is None and self.where is None:
            reject(((), "exactly one of at, quantity, weight, where", Phrase("none")))
        if self.statistic is not None and (self.where is None or self.fields is None):
            reject((("statistic",), "no such key but of fields in a region (where)", self.statistic))
        own: Any = getattr(method_of(info), "extra_quantities", {})
        if self.where is not None and self.quantity in own and self.quantity not in quantity_kinds():
            known = ", ".join(map(repr, quantity_kinds()))
            reject((("quantity",), f"one of {known} in a region", self.quantity))
        return self

    @model_validator(mode="after")
    def _keys_wanted(self, info: ValidationInfo) -> "Probe":
        """Keys of samplers, which a probe has only with what they are for."""
        samplers, wanted = samplers_with_keys(), self._watched()
        details: list[Any] = []
        for name in wanted:
            if name in samplers and name in field_kinds() and self.at is None:
                reject((("fields",), f"no {name} without at", self.fields))
        stated = {key: getattr(self, key, None) for sampler in samplers.values() for key in sampler.keys}
        for name in wanted:
            dimension = dimension_of(info) or len(self.at or ())
            for key, expected, found in samplers[name].faults(stated, dimension) if name in samplers else ():
                details.append(((key,), expected, NOTHING if found is None else found))
        for key, value in stated.items():
            owners = [name for name, sampler in samplers.items() if key in sampler.keys]
            if value is not None and not set(owners) & set(wanted):
                what = "field" if owners[0] in field_kinds() else "quantity"
                details.append(((key,), f"no such key without the {what} {' or '.join(owners)}", value))
        reject(*details)
        return self

    @model_validator(mode="after")
    def _find_kinds(self, info: ValidationInfo) -> "Probe":
        method: Any = method_of(info)
        for name in self._watched() if method else ():
            known: Kinds = method.extra_quantities
            if self.quantity is None:
                known = _kinds(info, field_kinds()) or {}
            if name in known:
                self._kinds[name] = known[name]
        return self

    def _watched(self) -> list[str]:
        return (self.fields or []) if self.quantity is None else [self.quantity]

    def columns_of_fields(self, dimension: int) -> dict[str, list[str]]:
        """The columns of the history that each field, or the quantity, fills."""
        names = {name: component_names(name, dimension, self._kinds.get(name)) for name in self._watched()}
        return {name: [f"{self.name}.{component}" for component in components] for name, components in names.items()}

    def columns(self, dimension: int) -> list[str]:
        """The columns of the history that the probe fills."""
        filled = self.columns_of_fields(dimension)
        return [column for name in self._watched() for column in filled[name]]

    def __reduce__(self) -> tuple[Any, ...]:
        # classes made at run time have no place to be found at
        return _restored, (self.__getstate__(),)


def _restored(state: dict[Any, Any]) -> Probe:
    result = probe_model().__new__(probe_model())
    result.__setstate__(state)
    return result


def probe_model() -> type[Probe]:
    """The table of a probe with the keys that all samplers add."""
    keys = {key: stated for sampler in samplers_with_keys().values() for key, stated in sampler.keys.items()}
    return _with_keys(tuple(keys.items()))


@cache
def _with_keys(keys: tuple[tuple[str, Key], ...]) -> type[Probe]:
    fields: dict[str, Any] = {}
    for name, key in keys:
        kind: Any = Point if key.words is None else Literal[key.words]
        fields[name] = (kind | None, Field(None, description=key.description))
    return create_model("Probe", __base__=Probe, __module__=__name__, **fields)


class _ProbeTable(ByKind):
    """Annotation of a probe, whose table has the keys that are known when it is read."""

    def __init__(self) -> None:
        self.known, self.models = "", {}

    @property
    def instances(self) -> tuple[type, ...]:
        """What needs no validation any more."""
        return (Probe,)

    def tables(self) -> dict[str, type[SceneModel]]:
        """The one model, which needs no kind."""
        return {"": probe_model()}

    def chosen(self, value: dict[str, Any], info: ValidationInfo) -> type[SceneModel]:
        """The one model."""
        return probe_model()

    def choose(self, table: object) -> type[SceneModel] | None:
        """The one model."""
        return probe_model()


ProbeTable = Annotated[Any, _ProbeTable()]
