"""Faults between the boundary conditions of a scene, and the columns of those that tell their force."""

from typing import Any

import numpy as np

from parsolid.scene.base_model import Detail


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
