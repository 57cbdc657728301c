"""Stages of a run: times from which on the bodies have other settings of their method, as `integrator`."""

from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field, ValidationError

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import FaultDetail, OnRestart, Positive, SceneModel, faults_of_errors
from parsolid.scene.method_settings import MethodSettings
from parsolid.scene.validation_errors import NOTHING

if TYPE_CHECKING:
    from parsolid.scene.schema import Scene


class Stage(SceneModel):
    """A part of a run that goes on from the state of the part before it with other settings of the method."""

    on_restart: ClassVar = {"start": OnRestart.FIXED}
    start: Positive = Field(description="the time [s] at which the stage begins, later than those before it")
    method: dict[str, float | int | str | bool] = Field(
        description="settings of the method in this stage: integrator, and the keys that go with it; others are those "
        "of [method]"
    )


def settings_of_stages(scene: "Scene") -> list[Any]:
    """Those of the scene's method from time 0 on, and those of every stage."""
    return [scene.method, *(scene.method.in_stage(one.method) for one in scene.stages)]


def stage_faults(scene: "Scene") -> list[FaultDetail]:
    """Stages that do not follow one another, and settings that no stage may have."""
    if not scene.stages:
        return []
    settings, faults, before = scene.method, list[FaultDetail](), 0.0
    if settings is None or not settings.stage_keys:
        found = Phrase("several methods" if settings is None else f"the method {settings.kind!r}")
        return [(("stages",), "no such table but with the method 'tlsph' alone", found)]
    for i, one in enumerate(scene.stages):
        if not before < one.start < scene.end_time:
            expected = f"a time between {before:g} s and the end, {scene.end_time:g} s"
            faults.append((("stages", i, "start"), expected, one.start))
        before = one.start
        faults += _faults_of_settings(settings, one.method, ("stages", i, "method"))
    return faults


def _faults_of_settings(settings: MethodSettings, stated: dict[str, Any], place: tuple[Any, ...]) -> list[FaultDetail]:
    unknown = stated.keys() - set(settings.stage_keys)
    if unknown:
        known = ", ".join(settings.stage_keys)
        return [
            ((*place, key), f"one of {known}", Phrase(f"the key {key!r}"), "unknown-key") for key in sorted(unknown)
        ]
    if "integrator" not in stated:
        return [((*place, "integrator"), "what the stage is, as 'static' or 'leapfrog'", NOTHING, "missing")]
    try:
        settings.in_stage(stated)
    except ValidationError as error:
        return [((*place, one.key), one.expected, Phrase(one.found), one.code) for one in faults_of_errors(error)]
    return []
