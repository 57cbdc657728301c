"""Faults between the boundary conditions of a scene, and the columns of their reactions."""

from typing import Any

import numpy as np

from parsolid.scene.base_model import Detail


def reaction_columns(name: str, dimension: int) -> list[str]:
    """Columns of the history for force and moment of a condition."""
    axes = "xyz"[:dimension]
    moment = [f"{name}.moment_{axis}" for axis in axes] if dimension == 3 else [f"{name}.moment"]
    return [*(f"{name}.force_{axis}" for axis in axes), *moment]


def reaction_details(conditions: list[Any], probes: list[str], carriers: list[list[Any]]) -> list[Detail]:
    """Faults of moving planes and of reactions: (location, expected, found).

    carriers: for each condition the settings of the methods that it acts on
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
            expected = f"one of the kinds {known}, whose force {silent[0].kind} can report"
            details.append((("boundaries", i, "reaction"), expected, conditions[i].kind))
        elif getattr(conditions[i], "mirror", False):
            expected = "mirror = false, or a region with a name (the force of images is on no particle)"
            details.append((("boundaries", i, "reaction"), expected, True))
        if names.count(name) > 1:
            expected = "a name that no probe and no other boundary with a reaction has"
            details.append((("boundaries", i, "name"), expected, name))
    return details


_SUPPORTS = ("fixed", "roller", "antisymmetric")
# kinds that prescribe all components of a region's motion
_WHOLE_MOTION = ("fixed", "rotation")


def clashes(conditions: list[Any]) -> list[Detail]:
    """Faults of conditions that contradict each other: on one plane, or for the same components of one region."""
    faults: list[Detail] = []
    for i, one in enumerate(conditions):
        for j, other in enumerate(conditions[:i]):
            if one.region_name or other.region_name or getattr(other, "plane", None) is None:
                continue
            apart = None not in (one.body, other.body) and one.body != other.body
            if apart or one.plane != other.plane:
                continue
            held, before = _held(one), _held(other)
            # two supports would give different images
            supports = {one.kind, other.kind} <= set(_SUPPORTS) and one.kind != other.kind
            if supports or _differ(held, before):
                what = "temperature" if "temperature" in before else "motion"
                expected = f"a plane whose {what} boundaries.{j} ({other.kind!r}) does not prescribe differently"
                faults.append((("boundaries", i, "plane"), expected, str(one.plane)))
                break
    seen = dict[tuple[str, str | None], list[int]]()
    for i, one in enumerate(conditions):
        if one.region_name is None or one.kind not in (*_WHOLE_MOTION, "velocity", "displacement"):
            continue
        earlier = seen.setdefault((one.region_name, one.body), [])
        for j in earlier:
            pair = one, conditions[j]
            kinds = {condition.kind for condition in pair}
            # "fixed" holds the components that the other condition leaves free
            has_free = any(formula.free.any() for condition in pair for formula in condition.formulas.values())
            differ = _differ(_prescribed(one), _prescribed(conditions[j]))
            if differ or "rotation" in kinds or ("fixed" in kinds and not has_free):
                expected = f"a region whose motion boundaries.{j} ({conditions[j].kind!r}) does not prescribe"
                faults.append((("boundaries", i, "where"), expected, one.region_name))
                break
        earlier.append(i)
    return faults


def _differ(held: dict[Any, str], before: dict[Any, str]) -> bool:
    return any(held[key] != before[key] for key in held.keys() & before.keys())


def _held(condition: Any) -> dict[Any, str]:
    """Axis or "temperature" -> formula that a condition prescribes on a plane; "0" at rest."""
    if condition.kind == "temperature":
        return {"temperature": condition.temperature.source}
    if condition.kind == "heat-flux":
        # contradicts any temperature
        return {"temperature": ""}
    if condition.kind not in _SUPPORTS:
        return _prescribed(condition)
    velocity, held = list(condition.velocity or ()), {}
    for axis in np.flatnonzero(condition.holds(3)).tolist():
        formula = velocity[axis] if axis < len(velocity) else None
        held[axis] = "0" if formula is None or _is_zero(formula.source) else f"velocity {formula.source}"
    return held


def _prescribed(condition: Any) -> dict[Any, str]:
    """Axis -> formula of a condition that prescribes components of a motion; empty for other conditions."""
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
