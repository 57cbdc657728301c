"""Runs to a requested error: levels of a scene from coarse to fine until the error bars are small enough."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from parsolid.campaign.coarsening import NotCoarsened, parsed
from parsolid.campaign.error_bars import NO_RESULTS, Campaign, ErrorTable, in_words, write_error_bars
from parsolid.campaign.in_process import InProcess, VariantRun
from parsolid.campaign.orders import has_meshes
from parsolid.campaign.variants import RATIOS, RATIOS_OF_MESHES, SPACING, Variant, coarse_variants, level_of
from parsolid.collective import SolverError
from parsolid.exit_status import DONE, NOT_REACHED, TO_BE_CONTINUED
from parsolid.scene import Scene, SceneError
from parsolid.scene.validation_errors import suggestion
from parsolid.simulation.history import history_columns

# ratios of the spacing of the first level: the coarsest one with coarse runs is taken
_STARTS = (2.25, 1.5, 1.0)
MOST_LEVELS = 10
# largest and smallest ratio of the spacings of two levels
MOST_FINER, LEAST_FINER = 2.5, 1.2
# the next level aims at this share of the requested bar
AIM = 0.9


@dataclass(frozen=True)
class Target:
    """A column of the history and its requested bar at the end; relative: the bar is a share of the largest value."""

    column: str
    bar: float
    relative: bool

    @classmethod
    def parse(cls, text: str, columns: list[str]) -> "Target":
        """From "tip.twist=2%" or "tip.twist=0.01". Raises SceneError."""
        column, equals, size = (part.strip() for part in text.partition("="))
        if not equals:
            words = text.replace("%", " %").split()
            meant = f" (did you mean {words[0]}={''.join(words[1:])}?)" if len(words) > 1 else ""
            raise SceneError([f"target: expected a column and its bar, as in tip.twist=2%{meant}, found {text!r}"])
        if column not in columns:
            expected = f"one of {', '.join(columns)}{suggestion(column, columns)}"
            raise SceneError([f"target: expected {expected}, found {column!r}"])
        try:
            bar = float(size.removesuffix("%"))
        except ValueError:
            bar = math.nan
        if not 0.0 < bar < math.inf:
            raise SceneError([f"target: expected a positive number after {column}=, found {size!r}"])
        relative = size.endswith("%")
        return cls(column, bar / 100.0 if relative else bar, relative)

    def __str__(self) -> str:
        return f"{self.column}={100.0 * self.bar:g}%" if self.relative else f"{self.column}={self.bar:g}"

    def excess(self, table: ErrorTable) -> float | None:
        """The bar over the requested one; None if there is no bar."""
        bar = table.bars.get(self.column)
        if bar is None:
            return None
        size = table.share(self.column) if self.relative else float(bar.error[-1])
        return size / self.bar if math.isfinite(size) else None


@dataclass
class Search:
    """Levels that have been run and the coarse runs of the first; ratios are spacings over that of the scene."""

    campaign: Campaign
    scene: Scene
    runs: list[VariantRun] = field(default_factory=list)
    spent: float = 0.0

    @property
    def ratios(self) -> tuple[float, ...]:
        """Ratios of the coarse runs of the first level; the narrow ones, because that level has few particles."""
        return RATIOS_OF_MESHES if has_meshes(self.scene) else RATIOS[self.scene.dimension][:2][-1]

    def level(self, ratio: float) -> Variant:
        """The scene with a spacing ratio near the given one, below 1 for a finer one. Raises NotCoarsened."""
        level = level_of(self.scene, ratio)
        return Variant(parsed(level.tables, self.campaign.trust_code, level.ratio), SPACING, level.ratio)

    def folder_of(self, level: Variant) -> Path:
        """The folder of a level's run."""
        words = level.lattices.replace(" ", "").replace(",", "_")
        return self.campaign.folder / "levels" / f"{words}-{level.digest}"

    def first_level(self) -> Variant:
        """The coarsest level that has coarse runs. Raises SolverError."""
        reasons = [""]
        for start in _STARTS:
            try:
                level = self.level(start)
            except NotCoarsened as reason:
                reasons.append(str(reason))
                continue
            variants, refused = coarse_variants(level.scene, self.campaign.trust_code, self.ratios)
            if sum(variant.purpose == SPACING for variant in variants) >= len(self.ratios):
                return level
            reasons += refused
        raise SolverError(f"target: expected a scene of which coarser ones can be made, found: {reasons[-1]}")

    def run_level(self, level: Variant) -> tuple[int, ErrorTable | None]:
        """Run a level and, before the first one, its coarse runs; runs that are in their folders are read.

        Returns the exit status and the bars, None if a run was interrupted; bars are on rank 0 only. Collective.
        """
        campaign, folder = self.campaign, self.folder_of(level)
        if not self.runs:
            variants, _ = coarse_variants(level.scene, campaign.trust_code, self.ratios)
            coarse_runs = campaign.run_variants(variants, campaign.folder)
            if coarse_runs is None:
                return TO_BE_CONTINUED, None
            self.runs = [run.with_ratio(run.ratio * level.ratio) for run in coarse_runs]
            self.spent = sum(run.seconds for run in coarse_runs)
        reader = InProcess(campaign.comm, campaign.folder)
        record = reader.read(folder)
        if record is None:
            status = campaign.run_scene(level.scene, folder)
            record = reader.read(folder)
            if status or record is None:
                return status or TO_BE_CONTINUED, None
        table = ErrorTable(np.zeros(0), {}, {})
        if campaign.comm.rank == 0:
            runs = [run.with_ratio(run.ratio / level.ratio) for run in self.runs]
            table, _ = write_error_bars(level.scene, folder, runs, [])
        self.runs.append(VariantRun(level, record))
        self.spent += record.seconds
        return DONE, table


def run_to_targets(campaign: Campaign, scene: Scene, requested: list[str], limit: float | None) -> int:
    """Run a scene from coarse to fine until all targets or a limit [core-s] are reached; the exit status. Collective.

    Raises SceneError for a target with an unknown column, SolverError if no coarser scene can be made.
    """
    targets = [Target.parse(text, columns_of(scene)) for text in requested]
    search, say, comm = Search(campaign, scene), campaign.say, campaign.comm
    level, predicted = search.first_level(), None
    for _ in range(MOST_LEVELS):
        status, table = search.run_level(level)
        if table is None:
            say("target: stopped by a signal or the wall time before it was reached: the same command continues")
            return status
        prediction = "" if predicted is None else f", {predicted:.3g} were predicted"
        say(f"target: {level.lattices}: {search.runs[-1].seconds:.3g} core-s{prediction}")
        for target in targets:
            if target.column in table.bars:
                say(f"target: {in_words(table, target.column)}; requested {target}")
        excess = comm.bcast(worst(table, targets) if comm.rank == 0 else None)
        if excess is None:
            say(comm.bcast(f"target: {no_bar(table, targets)}" if comm.rank == 0 else None))
            return NOT_REACHED
        if excess[0] <= 1.0:
            say(f"target: reached with {level.lattices} after {search.spent:.3g} core-s in {search.folder_of(level)}")
            return DONE
        # the level that is expected to reach the targets
        ratio, order = excess
        refinement = min(MOST_FINER, max(LEAST_FINER, (ratio / AIM) ** (1.0 / order)))
        finer = search.level(level.ratio / refinement)
        predicted = predicted_seconds(search.runs, finer.ratio, scene.dimension)
        say(f"target: {level.lattices} -> {finer.lattices}, about {predicted:.3g} core-s")
        level = finer
        if limit is not None and search.spent + predicted > limit:
            say(f"target: not reached: the limit of {limit:g} core-s, of which {search.spent:.3g} are spent")
            return NOT_REACHED
    say(f"target: not reached after {MOST_LEVELS} levels")
    return NOT_REACHED


def columns_of(scene: Scene) -> list[str]:
    """Columns of the history that can have a bar."""
    return [name for name in history_columns(scene) if name not in NO_RESULTS]


def worst(table: ErrorTable, targets: list[Target]) -> tuple[float, float] | None:
    """The largest ratio of a bar to the requested one, and the order of that column; None if a target has no bar."""
    result = (0.0, 1.0)
    for target in targets:
        excess = target.excess(table)
        if excess is None:
            return None
        result = max(result, (excess, table.bars[target.column].used))
    return result


def no_bar(table: ErrorTable, targets: list[Target]) -> str:
    """A message that names the first target without a bar, and the reason."""
    for target in targets:
        bar = table.bars.get(target.column)
        if bar is None:
            return f"{target} has no bar: {table.without or 'not all of its values are numbers'}"
        if not np.isfinite(bar.error[-1]):
            return f"{target} has no bar: {bar.verdict}"
    return f"{targets[0]} has no bar: it is 0 throughout"


def predicted_seconds(runs: list[VariantRun], ratio: float, dimension: int) -> float:
    """Processor seconds of a level at a ratio of the spacing.

    Particles and steps are extrapolated from the last run. The time of a step is a + b n for n particles, with a and b
    not negative, fitted to all runs by least squares with weights n.
    """
    last, timed = runs[-1], [run for run in runs if run.variant.purpose == SPACING and run.record.steps]
    refinement = last.ratio / ratio
    particles = round(last.record.particles * refinement**dimension)
    power = steps_power([run.ratio for run in timed], [run.record.steps for run in timed])
    steps = last.record.steps * refinement**power
    sizes = np.array([run.record.particles for run in timed], float)
    times = np.array([run.seconds / run.record.steps for run in timed])
    weights = sizes / sizes.sum()
    mean, size = float(weights @ times), float(weights @ sizes)
    spread = float(weights @ (sizes - size) ** 2)
    slope = float(weights @ ((sizes - size) * (times - mean))) / spread if spread > 0.0 else mean / size
    slope = min(max(slope, 0.0), mean / size)
    return steps * (mean + slope * (particles - size))


def steps_power(ratios: list[float], steps: list[int]) -> float:
    """The power p, between 0 and 2, of number of steps ~ spacing^-p in runs with ratios of the spacing; 1 for one run.

    Waves give 1, conduction 2, a stated step 0.
    """
    if len(set(ratios)) < 2:
        return 1.0
    slope = np.polyfit(-np.log(ratios), np.log(np.maximum(steps, 1)), 1)[0]
    return float(min(2.0, max(0.0, slope)))
