"""What all boundary conditions have in common, and the table of their kinds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeVar

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from parsolid.scene.base_model import Detail, Name, Plane, Point, SceneModel, check_kind, kinds_of, method_of, reject
from parsolid.scene.formulas import Formula, FormulaVector
from parsolid.scene.load_histories import LoadHistory, Timed
from parsolid.scene.regions import Named, OnPlane
from parsolid.scene.validation_errors import NOTHING

if TYPE_CHECKING:
    from parsolid.scene.regions import Region

# kind -> the model of its table
BOUNDARY_KINDS: dict[str, type[Condition]] = {}


class Condition(SceneModel):
    """A boundary condition with a literal field `kind`; its keys are those of its table in the scene.

    on_particles: it is about particles of a region, else about nodes of a grid, wherever particles are;
    needs_bounding_plane: its plane must bound a body.
    """

    on_particles: ClassVar[bool] = True
    needs_bounding_plane: ClassVar[bool] = False
    if TYPE_CHECKING:
        # fields of the kinds, in the order of their tables
        kind: str
        plane: Plane | None
        body: str | None

    @property
    def region_name(self) -> str | None:
        """The key `where` of kinds that hold in regions with a name."""
        return getattr(self, "where", None)

    @property
    def reports(self) -> str | None:
        """The name under which its force, moment and work are told, None unless that is asked for."""
        return getattr(self, "name", None) if getattr(self, "reaction", None) else None

    @property
    def region(self) -> Region:
        """Where it holds; the particles on its plane, or in a region with a name, unless a kind says otherwise."""
        if self.region_name is not None:
            return Named(self.region_name)
        assert self.plane is not None
        return OnPlane(self.plane)

    @property
    def formulas(self) -> dict[str, FormulaVector]:
        """All formulas, by their key."""
        stated = {key: getattr(self, key) for key in type(self).model_fields}
        vectors = {key: FormulaVector((one,)) if isinstance(one, Formula) else one for key, one in stated.items()}
        return {key: one for key, one in vectors.items() if isinstance(one, FormulaVector)}

    @property
    def prescribed(self) -> Any:
        """The values in time of the only formulas, a `LoadHistory`; a `RigidMotion` of a rotation."""
        (formulas,) = self.formulas.values()
        return LoadHistory(formulas, self if isinstance(self, Timed) else None)


class Reporting(SceneModel):
    """Keys of conditions that can tell what force they take.

    reaction: columns name.force, name.moment (about `moment_about`, the origin unless given) and name.work in the
    history
    """

    name: Name | None = Field(None, description="what its forces are called in history.csv")
    reaction: Literal[True] | None = Field(None, description="force, moment and work in the history, by the name")
    moment_about: Point | None = Field(None, description="the point of the moments [m], the origin unless given")

    @model_validator(mode="after")
    def _named(self) -> Reporting:
        if self.reaction and self.name is None:
            reject((("reaction",), "a name, for the columns of the history", NOTHING))
        if self.moment_about is not None and not self.reaction:
            reject((("moment_about",), "no such key without reaction = true", self.moment_about))
        return self


def reaction_columns(name: str, dimension: int) -> list[str]:
    """Columns of the history of a condition that tells its force."""
    axes = "xyz"[:dimension]
    moment = [f"{name}.moment_{axis}" for axis in axes] if dimension == 3 else [f"{name}.moment"]
    return [*(f"{name}.force_{axis}" for axis in axes), *moment]


def reaction_details(conditions: list[Any], probes: list[str], carriers: list[list[Any]]) -> list[Detail]:
    """Faults of conditions that tell their force: (place, expected, found).

    carriers: settings of the methods that carry each condition.
    """
    moving = [i for i, one in enumerate(conditions) if one.kind in _SUPPORTS and one.velocity is not None]
    details: list[Detail] = [
        (("boundaries", i, "velocity"), f"no such key with {settings.kind}", conditions[i].velocity.sources)
        for i in moving
        for settings in carriers[i]
        if not settings.planes_move
    ]
    reported = [(i, one.reports) for i, one in enumerate(conditions) if one.reports is not None]
    names = [name for _, name in reported] + probes
    for i, name in reported:
        silent = [settings for settings in carriers[i] if conditions[i].kind not in settings.reactions]
        if silent:
            known = ", ".join(map(repr, silent[0].reactions)) or "none"
            expected = f"one of the kinds {known}, whose force {silent[0].kind} can tell"
            details.append((("boundaries", i, "reaction"), expected, conditions[i].kind))
        elif getattr(conditions[i], "mirror", False):
            expected = "mirror = false, or a region with a name (the force of images is on no particle)"
            details.append((("boundaries", i, "reaction"), expected, True))
        if names.count(name) > 1:
            expected = "a name that no probe and no other boundary with a reaction has"
            details.append((("boundaries", i, "name"), expected, name))
    return details


_SUPPORTS = ("fixed", "roller", "antisymmetric")
# kinds that say all of a region's motion
_WHOLE_MOTION = ("fixed", "rotation")


def clashes(conditions: list[Any]) -> list[Detail]:
    """Faults of conditions that contradict one another: on one plane, or on one region of whose motion two say the
    same part."""
    faults: list[Detail] = []
    for i, one in enumerate(conditions):
        for j, other in enumerate(conditions[:i]):
            if one.region_name or other.region_name or getattr(other, "plane", None) is None:
                continue
            apart = None not in (one.body, other.body) and one.body != other.body
            if apart or one.plane != other.plane:
                continue
            held, before = _held(one), _held(other)
            # images go with one support
            supports = {one.kind, other.kind} <= set(_SUPPORTS) and one.kind != other.kind
            if supports or _differ(held, before):
                what = "temperature" if "temperature" in before else "motion"
                expected = f"a plane whose {what} boundaries.{j} ({other.kind!r}) does not hold otherwise"
                faults.append((("boundaries", i, "plane"), expected, str(one.plane)))
                break
    seen = dict[tuple[str, str | None], list[int]]()
    for i, one in enumerate(conditions):
        if one.region_name is None or one.kind not in (*_WHOLE_MOTION, "velocity", "displacement"):
            continue
        there = seen.setdefault((one.region_name, one.body), [])
        for j in there:
            pair = one, conditions[j]
            kinds = {which.kind for which in pair}
            # a motion holds before "fixed", which has the components that are free in it
            left = any(formula.free.any() for which in pair for formula in which.formulas.values())
            twice = _differ(_prescribed(one), _prescribed(conditions[j]))
            if twice or "rotation" in kinds or ("fixed" in kinds and not left):
                expected = f"a region whose motion boundaries.{j} ({conditions[j].kind!r}) does not say"
                faults.append((("boundaries", i, "where"), expected, one.region_name))
                break
        there.append(i)
    return faults


def _differ(held: dict[Any, str], before: dict[Any, str]) -> bool:
    return any(held[key] != before[key] for key in held.keys() & before.keys())


def _held(condition: Any) -> dict[Any, str]:
    """What a condition holds of a plane: axis, or "temperature" -> its formula; "0" where it is at rest."""
    if condition.kind in ("temperature", "heat-flux"):
        # heat flows into a plane whose temperature nothing holds
        return {"temperature": condition.temperature.source if condition.kind == "temperature" else ""}
    if condition.kind in _SUPPORTS:
        moving = dict(enumerate(condition.velocity or ()))
        of_plane = ((axis, moving.get(axis)) for axis in np.flatnonzero(condition.holds(3)).tolist())
        return {
            axis: "0" if one is None or _is_zero(one.source) else f"velocity {one.source}" for axis, one in of_plane
        }
    return _prescribed(condition)


def _prescribed(condition: Any) -> dict[Any, str]:
    """Axis -> formula of a condition that prescribes a motion by components; empty for others."""
    if condition.kind not in ("velocity", "displacement"):
        return {}
    (formulas,) = condition.formulas.values()
    sources = {axis: one.source for axis, one in enumerate(formulas) if one is not None}
    return {axis: "0" if _is_zero(source) else f"{condition.kind} {source}" for axis, source in sources.items()}


def _is_zero(source: Any) -> bool:
    try:
        return float(source) == 0.0
    except ValueError:
        return False


Kind = TypeVar("Kind", bound=Condition)


def boundary_kind(model: type[Kind]) -> type[Kind]:
    """Enter a kind in the table; raises ValueError for one that is there."""
    for kind in kinds_of(model):
        if kind in BOUNDARY_KINDS:
            raise ValueError(f"boundary kinds: expected one of the name {kind!r}, found two")
        BOUNDARY_KINDS[kind] = model
    return model


def of_method(value: Any, handler: Any, info: ValidationInfo) -> Any:
    """Refuse kinds that the scene's method does not know, or that of the body which a table names."""
    if isinstance(value, dict):
        method, kind = method_of(info, value), value.get("kind")
        known = [one for one in getattr(method, "boundaries", BOUNDARY_KINDS) if one in BOUNDARY_KINDS]
        why = getattr(method, "refused", {}).get(kind, "") if isinstance(kind, str) else ""
        check_kind(value, info, BOUNDARY_KINDS, known, why)
    return handler(value)
