"""What a scene asks of the errors of its results: bars from coarse runs, and targets to be reached."""

from typing import Annotated

from pydantic import Field, field_validator

from parsolid.scene.base_model import Positive, SceneModel, reject


class ErrorBars(SceneModel):
    """Error bars for every column of the history, from coarse runs of the scene before the run itself."""

    ratios: Annotated[list[Positive], Field(min_length=1, max_length=4)] | None = Field(
        None,
        description="spacings of the coarse runs over the scene's, rising from above 1; by dimension if not given",
    )

    @field_validator("ratios")
    @classmethod
    def _rising(cls, ratios: list[float] | None) -> list[float] | None:
        before = [1.15, *(ratios or ())]
        reject(*(((i,), f"at least {1.0 * a:g}", b) for i, (a, b) in enumerate(zip(before, ratios or ())) if b < a))
        return ratios


class RunTargets(SceneModel):
    """Errors to be reached: the scene is run from coarse to fine until its bars are as small."""

    target: Annotated[list[str], Field(min_length=1)] = Field(
        description='column of the history and bar, "tip.twist=2%" of its largest value, or "tip.twist=0.01"'
    )
    core_seconds: Positive | None = Field(None, description="core-seconds that all runs together may take")
