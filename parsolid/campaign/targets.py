"""Errors that are requested: levels of a scene from coarse to fine until its bars are as small."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from parsolid.campaign.coarsening import NotCoarsened, lattice_words, parsed
from parsolid.campaign.error_bars import NO_RESULTS, Campaign, ErrorTable, in_words, write_error_bars
from parsolid.campaign.orders import has_meshes
from parsolid.campaign.runner import InProcess, VariantRun
from parsolid.campaign.variants import RATIOS, RATIOS_OF_MESHES, SPACING, Variant, coarse_variants, level_of
from parsolid.collective import SolverError
from parsolid.exit_status import DONE, NOT_REACHED, TO_BE_CONTINUED
from parsolid.scene import Scene, SceneError
from parsolid.scene.validation_errors import suggestion
from parsolid.simulation.history import history_columns

# spacings over that of the scene at which levels may begin, the coarsest of which coarser ones can be made
_STARTS = (2.25, 1.5, 1.0)
MOST_LEVELS = 10
# levels are at most so much finer than the one before, and at least
MOST_FINER, LEAST_FINER = 2.5, 1.2
# a bar is to be a little below what is requested, so that a guess that is a little off still does
AIM = 0.9


@dataclass(frozen=True)
class Target:
    """A column of the history and the bar it is to have at the end: as a share of its largest value, or as such."""

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
            raise SceneError(
                [f"target: expected one of {', '.join(columns)}, found {column!r}{suggestion(column, columns)}"]
            )
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
        """How many times too large the bar is; None where there is none."""
        bar = table.bars.get(self.column)
        if bar is None:
            return None
        size = table.share(self.column) if self.relative else float(bar.error[-1])
        return size / self.bar if math.isfinite(size) else None


@dataclass
class Search:
    """Levels that have been run, with the coarse runs of the first; ratios are of the spacing over the scene's."""

    campaign: Campaign
    scene: Scene
    runs: list[VariantRun] = field(default_factory=list)
    spent: float = 0.0

    @property
    def ratios(self) -> tuple[float, ...]:
        """Of the coarse runs of the first level, which has few particles itself."""
        return RATIOS_OF_MESHES if has_meshes(self.scene) else RATIOS[self.scene.dimension][:2][-1]

    def level(self, ratio: float) -> Variant:
        """The scene nearest to a ratio, below 1 for a finer one. Raises NotCoarsened."""
        made = level_of(self.scene, ratio)
        scene = parsed(made.tables, self.campaign.trust_code, made.ratio)
        return Variant(scene, SPACING, made.ratio, lattice_words(scene))

    def coarse_variants(self, level: Variant) -> tuple[list[Variant], list[str]]:
        """Those of a level, and why others cannot be."""
        return coarse_variants(level.scene, self.campaign.trust_code, self.ratios)

    def folder_of(self, level: Variant) -> Path:
        """Where a level is."""
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
            found, refused = self.coarse_variants(level)
            if sum(one.purpose == SPACING for one in found) >= len(self.ratios):
                return level
            reasons += refused
        raise SolverError(f"target: expected a scene of which coarser ones can be made, found: {reasons[-1]}")

    def run_level(self, level: Variant) -> tuple[int, ErrorTable | None]:
        """Run a level, unless it is there, and what it is compared with; exit status, bars on rank 0. Collective."""
        campaign, folder = self.campaign, self.folder_of(level)
        if not self.runs:
            found = campaign.run_variants(self.coarse_variants(level)[0], campaign.folder)
            if found is None:
                return TO_BE_CONTINUED, None
            self.runs = [one.over(1.0 / level.ratio) for one in found]
            self.spent = sum(one.seconds for one in found)
        reader = InProcess(campaign.comm, campaign.folder)
        if (record := reader.read(folder)) is None:
            status = campaign.alone(level.scene, folder)
            record = reader.read(folder)
            if status or record is None:
                return status or TO_BE_CONTINUED, None
        table = ErrorTable.nothing()
        if campaign.comm.rank == 0:
            table, _ = write_error_bars(level.scene, folder, [one.over(level.ratio) for one in self.runs], [])
        self.runs.append(VariantRun(level, record))
        self.spent += record.seconds
        return DONE, table

    def next_level(self, level: Variant, excess: float, order: float) -> tuple[Variant, float]:
        """The level that should do, and the core-seconds it should take. Raises NotCoarsened."""
        finer = self.level(level.ratio / min(MOST_FINER, max(LEAST_FINER, (excess / AIM) ** (1.0 / order))))
        return finer, predicted_seconds(self.runs, finer.ratio, self.scene.dimension)


def run_to_targets(campaign: Campaign, scene: Scene, requested: list[str], limit: float | None) -> int:
    """Run a scene from coarse to fine until all targets are reached or a limit [core-s] is; exit status. Collective.

    Raises SceneError for a target that names no column, SolverError for a scene of which no coarser one can be made.
    """
    targets = [Target.parse(text, columns_of(scene)) for text in requested]
    search, say, comm = Search(campaign, scene), campaign.say, campaign.comm
    level, predicted = search.first_level(), None
    for _ in range(MOST_LEVELS):
        status, table = search.run_level(level)
        if table is None:
            say("target: stopped before it was reached, by a signal or the wall time: the same command goes on")
            return status
        foretold = "" if predicted is None else f", {predicted:.3g} were predicted"
        say(f"target: {level.lattices}: {search.runs[-1].seconds:.3g} core-s{foretold}")
        for one in targets:
            if one.column in table.bars:
                say(f"target: {in_words(table, one.column)}; requested {one}")
        excess = comm.bcast(worst(table, targets) if comm.rank == 0 else None)
        if excess is None:
            say(comm.bcast(f"target: {no_bar(table, targets)}" if comm.rank == 0 else None))
            return NOT_REACHED
        if excess[0] <= 1.0:
            say(f"target: reached with {level.lattices} after {search.spent:.3g} core-s in {search.folder_of(level)}")
            return DONE
        finer, predicted = search.next_level(level, *excess)
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
    """How many times too large the worst bar is, and the order of that column; None where one has no bar."""
    result = (0.0, 1.0)
    for one in targets:
        excess = one.excess(table)
        if excess is None:
            return None
        result = max(result, (excess, table.bars[one.column].used))
    return result


def no_bar(table: ErrorTable, targets: list[Target]) -> str:
    """Which target has no bar, and why."""
    for one in targets:
        bar = table.bars.get(one.column)
        if bar is None:
            return f"{one} has no bar: {table.without or 'not all of its values are numbers'}"
        if not np.isfinite(bar.error[-1]):
            return f"{one} has no bar: {bar.verdict}"
    return f"{targets[0]} has no bar: it is 0 throughout"


def predicted_seconds(runs: list[VariantRun], ratio: float, dimension: int) -> float:
    """Core-seconds of a level at a ratio: from the particles and steps of the last run, and from a time a step and one
    a particle and step, neither negative, that fit all runs, the largest best.
    """
    last, known = runs[-1], [one for one in runs if one.variant.purpose == SPACING and one.record.steps]
    finer = last.ratio / ratio
    particles = round(last.record.particles * finer**dimension)
    steps = last.record.steps * finer ** steps_grow([one.ratio for one in known], [one.record.steps for one in known])
    sizes = np.array([one.record.particles for one in known], float)
    times = np.array([one.seconds / one.record.steps for one in known])
    weights = sizes / sizes.sum()
    mean, size = float(weights @ times), float(weights @ sizes)
    spread = float(weights @ (sizes - size) ** 2)
    slope = float(weights @ ((sizes - size) * (times - mean))) / spread if spread > 0.0 else mean / size
    slope = min(max(slope, 0.0), mean / size)
    return steps * (mean + slope * (particles - size))


def steps_grow(ratios: list[float], steps: list[int]) -> float:
    """The power of the resolution with which the number of steps has grown: 1 of waves, 2 of conduction, 0 of steps
    that are stated; ratios: of the spacings of runs; 1 where there is but one."""
    if len(set(ratios)) < 2:
        return 1.0
    slope = np.polyfit(-np.log(ratios), np.log(np.maximum(steps, 1)), 1)[0]
    return float(min(2.0, max(0.0, slope)))
