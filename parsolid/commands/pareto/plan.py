"""The runs of a comparison: choices at several resolutions, and which of them a scene cannot have."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from parsolid.collective import SolverError
from parsolid.commands.pareto.choices import Choice, choices_of
from parsolid.errors.coarsening import Coarser, NotCoarsened, coarser, lattice_words, parsed, unasked
from parsolid.errors.running import Done
from parsolid.errors.variants import SPACING, Companion, quieter
from parsolid.particles.fillings import filling_of
from parsolid.scene import Scene, SceneError

# spacings over that of the scene, coarsest first; the fewest levels that say anything of a choice
RATIOS = (3.4, 2.25, 1.5, 1.0)
FEWEST = 2


@dataclass
class Candidate:
    """A choice and its runs so far, coarsest first; errors beside them; dropped: why it is not run any finer."""

    choice: Choice
    runs: list[Done] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    dropped: str | None = None

    @property
    def times(self) -> list[float]:
        """Processor seconds of the runs."""
        return [one.processor_seconds for one in self.runs]


@dataclass
class Plan:
    """Levels of a scene, coarsest first, choices that it can have, and words about those that it cannot."""

    scene: Scene
    column: str
    trust_code: bool
    levels: list[Scene]
    ratios: list[float]
    candidates: list[Candidate]
    refused: list[str]

    def run(self, choice: Choice, level: int) -> Companion:
        """The scene of a choice at a level. Raises SceneError, NotCoarsened."""
        scene = made(self, choice, level)
        return Companion(scene, SPACING, self.ratios[level], lattice_words(scene))

    def work(self, level: int) -> float:
        """Particles times steps of a level over those of the coarsest."""
        return (self.ratios[0] / self.ratios[level]) ** (self.scene.dimension + 1)


def made(plan: Plan, choice: Choice, level: int) -> Scene:
    """A choice at a level, with a history and nothing else in its output, and the one probe that is looked at."""
    base = plan.levels[level]
    tables = quieter(base, choice.applied(base), 1.0)
    wanted = plan.column.partition(".")[0] if "." in plan.column else None
    tables["probes"] = [probe for probe in tables.get("probes", ()) if probe["name"] == wanted]
    tables["boundaries"] = [_quiet(one, wanted) for one in tables.get("boundaries", ())]
    return parsed(tables, plan.trust_code)


def _quiet(boundary: dict[str, Any], wanted: str | None) -> dict[str, Any]:
    """A boundary that tells its force only if that is asked for."""
    return boundary if boundary.get("reports") == wanted else {k: v for k, v in boundary.items() if k != "reports"}


def plan_of(scene: Scene, column: str, axes: list[str], trust_code: bool) -> Plan:
    """Levels and choices of a scene. Raises SolverError where no coarser scene can be made, or of several methods."""
    if len(scene.systems) > 1 or "methods" in scene.resolved():
        raise SolverError("--pareto: expected a scene of one method, found several")
    found: list[tuple[float, Scene]] = []
    reasons: list[str] = []
    last = 1.0
    for asked in sorted(RATIOS):
        try:
            one = Coarser(unasked(scene), 1.0, "") if asked == 1.0 else coarser(scene, asked, 1.2 * last)
        except NotCoarsened as reason:
            reasons.append(str(reason))
            continue
        last = one.ratio
        found.insert(0, (one.ratio, parsed(one.tables, trust_code)))
    if len(found) < FEWEST:
        raise SolverError(f"--pareto: expected a scene of which coarser ones can be made, found: {reasons[-1]}")
    plan = Plan(scene, column, trust_code, [one for _, one in found], [ratio for ratio, _ in found], [], [])
    for choice in [Choice(), *choices_of(scene, axes)]:
        add(plan, choice)
    return plan


def add(plan: Plan, choice: Choice) -> Candidate | None:
    """Take a choice into the plan; None, and words about it, where the scene cannot have it or it changes nothing."""
    try:
        scenes = [made(plan, choice, level) for level in (0, len(plan.levels) - 1)]
        if choice.changes and _said(scenes[0]) == _said(made(plan, Choice(), 0)):
            raise SceneError(["it changes nothing here"])
    except SceneError as error:
        plan.refused.append(f"{choice.name}: {next(iter(error.faults))}")
        return None
    except NotCoarsened as reason:
        plan.refused.append(f"{choice.name}: {reason}")
        return None
    plan.candidates.append(Candidate(choice))
    return plan.candidates[-1]


def _said(scene: Scene) -> dict[str, Any]:
    """What a scene of one method says to its bodies."""
    (system,), tables = scene.systems, scene.resolved()
    unheard = system.settings.unheard(scene, system.bodies)
    return tables | {"method": {key: value for key, value in tables["method"].items() if key not in unheard}}


def particles_of(scene: Scene) -> int:
    """Particles of all bodies."""
    return sum(filling_of(body, scene.dimension).count for body in scene.bodies)


def grid_of(scene: Scene) -> np.ndarray:
    """Times (n,) [s] at which histories are compared, after the start."""
    return np.linspace(0.0, scene.end_time, 201)[1:]
