"""Tables of probes, and validation of the names of fields and quantities."""

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field, PrivateAttr, ValidationInfo, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import Name, Point, SceneModel, dimension_of, mismatch, reject
from parsolid.scene.formulas import InitialScalar
from parsolid.scene.named_regions import RegionName
from parsolid.scene.observed import FIELDS, FIELDS_OF_CONTACT, QUANTITIES, components_of, probed_fields, with_components
from parsolid.scene.validation_errors import NOTHING, suggestion


def _known(value: str, known: dict[str, str], dimension: int | None = None) -> str:
    """The name if it is known; with a dimension, names of components are accepted, too."""
    if value not in (known if dimension is None else with_components(known, dimension)):
        raise mismatch(f"one of {', '.join(map(repr, known))}{suggestion(value, known)}", value, "unknown-name")
    return value


def _field_of(common: Callable[[], dict[str, str]]) -> AfterValidator:
    """Validator of the name of a field: a common one or one of the scene's methods, if these are known."""

    def check(value: str, info: ValidationInfo) -> str:
        fields = (info.context or {}).get("fields")
        return value if fields is None else _known(value, common() | fields, dimension_of(info) or 3)

    return AfterValidator(check)


def _known_quantity(value: str, info: ValidationInfo) -> str:
    quantities = (info.context or {}).get("quantities")
    return value if quantities is None else _known(value, QUANTITIES | quantities)


ProbeField = Annotated[str, _field_of(probed_fields)]
# "state": the complete state of the method
ShownField = Annotated[str, _field_of(lambda: FIELDS | FIELDS_OF_CONTACT | {"state": "state"})]
ProbeQuantity = Annotated[str, AfterValidator(_known_quantity)]


def component_names(field: str, dimension: int, kind: str | None = None) -> list[str]:
    """Names of the components of a field or quantity, see `components_of`; kind: needed if not all methods have it."""
    return components_of(field, kind or (probed_fields() | QUANTITIES)[field], dimension)


class Probe(SceneModel):
    """Values written to the history: fields of the material point `at`, or one quantity of all particles.

    Fields are interpolated between particles, exactly if they are linear. Displacement, velocity and position are
    extrapolated to the surface; other fields are not.

    With a region `where` instead of `at` fields are those of its particles: the mean over the volume, the minimum or
    maximum of each component, or the integral over the volume; a quantity is that of the region.
    With a `weight` w(X, Y, Z) instead of `at` fields are projected on it, sum V w f / sum V w^2 over all particles: the
    amplitude of a mode w.
    A single component has the name of its column, such as stress_xx.
    twist is the angle [rad], accumulated over turns, by which the point has turned about `axis` through `centre`.
    """

    exactly_one: ClassVar = (("fields", "quantity"),)
    at_most_one: ClassVar = (("at", "weight", "where"), ("at", "quantity"), ("weight", "quantity"))
    only_with: ClassVar = (("statistic", "where"), ("statistic", "fields"))
    name: Name
    at: Point | None = Field(None, description="the material point [m], by its position in the reference configuration")
    weight: InitialScalar | None = Field(None, description="a formula w in X, Y, Z on which fields are projected")
    where: RegionName | None = Field(None, description="a region or a group of a mesh: of the particles there")
    statistic: Literal["mean", "minimum", "maximum", "integral"] | None = Field(
        None, description="of fields in a region: 'mean' (default), 'minimum', 'maximum' or 'integral'"
    )
    fields: Annotated[list[ProbeField], Field(min_length=1)] | None = Field(None, description="names of fields")
    quantity: ProbeQuantity | None = Field(None, description="one number or vector of all particles")
    axis: Literal["X", "Y", "Z"] | None = Field(None, description="the axis of the twist")
    centre: Point | None = Field(None, description="a point of the axis [m] (default: the origin)")
    # kinds of the fields or the quantity in the scene's method
    _kinds: dict[str, str] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _has_a_place(self, info: ValidationInfo) -> "Probe":
        """Refuse fields without a point, weight or region, and quantities that a region does not have."""
        if self.fields is not None and self.at is None and self.weight is None and self.where is None:
            reject(((), "exactly one of at, quantity, weight, where", Phrase("none")))
        own = (info.context or {}).get("quantities") or {}
        if self.where is not None and self.quantity in own and self.quantity not in QUANTITIES:
            known = ", ".join(map(repr, QUANTITIES))
            reject((("quantity",), f"one of {known} in a region", self.quantity))
        return self

    @model_validator(mode="after")
    def _about_an_axis(self, info: ValidationInfo) -> "Probe":
        """Refuse keys of the twist without it, and a twist without a point, in 1-D or without an axis in 3-D."""
        dimension = dimension_of(info) or len(self.at or ())
        details: list[Any] = []
        if "twist" not in (self.fields or ()):
            stated = [(key, getattr(self, key)) for key in ("axis", "centre") if getattr(self, key) is not None]
            details = [((key,), "no such key without the field twist", value) for key, value in stated]
        elif self.at is None:
            details.append((("fields",), "no twist without at", self.fields))
        elif dimension == 1:
            details.append((("fields",), "no twist in 1-D", "twist"))
        elif dimension == 3 and self.axis is None:
            details.append((("axis",), "the axis 'X', 'Y' or 'Z' of the twist", NOTHING))
        elif dimension == 2 and self.axis in ("X", "Y"):
            details.append((("axis",), "'Z' or nothing in 2-D", self.axis))
        reject(*details)
        context = info.context or {}
        known = with_components(probed_fields() | (context.get("fields") or {}), dimension_of(info) or 3)
        known |= context.get("quantities") or {}
        self._kinds.update({name: known[name] for name in self._observed() if name in known})
        return self

    def _observed(self) -> list[str]:
        return (self.fields or []) if self.quantity is None else [self.quantity]

    def columns_of_fields(self, dimension: int) -> dict[str, list[str]]:
        """Field or quantity -> its columns of the history."""
        names = {name: component_names(name, dimension, self._kinds.get(name)) for name in self._observed()}
        return {name: [f"{self.name}.{component}" for component in components] for name, components in names.items()}

    def columns(self, dimension: int) -> list[str]:
        """All columns of the history of the probe."""
        columns = self.columns_of_fields(dimension)
        return [column for name in self._observed() for column in columns[name]]
