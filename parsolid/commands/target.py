"""`parsolid run --target "tip.twist 2 %"`: levels of a scene from coarse to fine until its bars are as small."""

from argparse import Namespace
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from parsolid.collective import SolverError
from parsolid.commands.asked import targets
from parsolid.commands.error_bars import Alone, companions_done, speaker, without_checkpoint, write_bars
from parsolid.errors.bars import ErrorTable, told
from parsolid.errors.coarsening import NotCoarsened, coarser, lattice_words, parsed, unasked
from parsolid.errors.places import with_corners
from parsolid.errors.running import Done, result_of
from parsolid.errors.targets import Cost, Target, finer_by, predicted_seconds, steps_grow
from parsolid.errors.variants import RATIOS, SPACING, Companion, companions_of
from parsolid.scene import Scene
from parsolid.scene.boundaries.condition import reaction_columns
from parsolid.simulation.ledger import Ledger, terms_of

# spacings over that of the scene at which levels may begin, the coarsest that has companions
_STARTS = (2.25, 1.5, 1.0)
MOST_LEVELS, TO_BE_CONTINUED = 10, 75
# exit status of a search that ends without the bars that were asked for
NOT_REACHED = 4


@dataclass
class Search:
    """Levels that have been run, with the companions of the first; ratios are of the spacing over that of the scene."""

    comm: MPI.Intracomm
    scene: Scene
    options: Namespace
    began: float
    folder: Path
    done: list[Done] = field(default_factory=list)
    spent: float = 0.0

    @property
    def ratios(self) -> tuple[float, ...]:
        """Of the companions of the first level, which has few particles itself."""
        return RATIOS[self.scene.dimension][:2][-1]

    def level(self, ratio: float) -> Companion:
        """The scene nearest to a ratio, below 1 for a finer one. Raises NotCoarsened."""
        made = None if ratio == 1.0 else coarser(self.scene, ratio, 0.0)
        tables = unasked(self.scene) if made is None else made.tables
        scene = parsed(tables, self.options.trust_code)
        # values of all levels are those at the places that were asked for
        tables, corners = with_corners(scene, scene, tables)
        watching = parsed(tables, self.options.trust_code) if corners else scene
        return Companion(watching, SPACING, 1.0 if made is None else made.ratio, lattice_words(scene), corners)

    def plain(self, level: Companion) -> Scene:
        """A level's scene without the particles that are watched around its probes."""
        watched = {name for one in level.corners for name in one.names}
        tables = level.scene.resolved()
        tables["probes"] = [probe for probe in tables["probes"] if probe["name"] not in watched]
        return parsed(tables, self.options.trust_code) if watched else level.scene

    def folder_of(self, level: Companion) -> Path:
        """Where a level is."""
        return self.folder / "levels" / f"{level.lattices.replace(' ', '').replace(',', '_')}-{level.digest}"

    def rebased(self, ratio: float) -> list[Done]:
        """What has been run, with ratios over that of a level."""
        return [replace(one, companion=replace(one.companion, ratio=one.ratio / ratio)) for one in self.done]


def run_to_targets(comm: MPI.Intracomm, scene: Scene, options: Namespace, began: float, alone: Alone) -> int:
    """Run a scene from coarse to fine until all targets are reached or a limit is; the exit status. Collective.

    Raises SceneError for a target that names no column, SolverError for a scene of which no coarser one can be made.
    """
    wanted = [Target.parse(text, columns_of(scene)) for text in targets(scene, options)]
    search = Search(comm, scene, options, began, Path(options.output or scene.output.directory))
    limit = options.cost or (scene.run.cost if scene.run else None)
    say = speaker(comm, options)
    level, predicted = first_level(search), None
    for _ in range(MOST_LEVELS):
        status, table = run_level(search, level, alone)
        if table is None or status:
            say("target: stopped before it was reached, by a signal or the wall time: the same command goes on")
            return status
        say(f"target: {level.lattices}: {search.done[-1].processor_seconds:.3g} core-s{foretold(predicted)}")
        for one in wanted:
            if one.column not in table.bars:
                continue
            say(f"target: {told(table, one.column)}; asked for {one}")
        excess = comm.bcast(worst(table, wanted) if comm.rank == 0 else None)
        if excess is None:
            say(comm.bcast(f"target: {no_bar(table, wanted)}" if comm.rank == 0 else None))
            return NOT_REACHED
        if excess[0] <= 1.0:
            say(f"target: reached with {level.lattices} after {search.spent:.3g} core-s in {search.folder_of(level)}")
            return 0
        level, predicted = next_level(search, level, *excess)
        say(f"target: {search.done[-1].companion.lattices} -> {level.lattices}, about {predicted:.3g} core-s")
        if limit is not None and search.spent + predicted > limit:
            say(f"target: not reached: the cost limit of {limit:g} core-s, of which {search.spent:.3g} are spent")
            return NOT_REACHED
    say(f"target: not reached after {MOST_LEVELS} levels")
    return NOT_REACHED


def no_bar(table: ErrorTable, wanted: list[Target]) -> str:
    """Which target has no bar, and why."""
    for one in wanted:
        bar = table.bars.get(one.column)
        if bar is None:
            return f"{one} has no bar: {table.without or 'not all of its values are numbers'}"
        if not np.isfinite(bar.error[-1]):
            return f"{one} has no bar: {bar.verdict}"
    return f"{wanted[0]} has no bar: it is 0 throughout"


def foretold(predicted: float | None) -> str:
    """What a level had been thought to take."""
    return "" if predicted is None else f", {predicted:.3g} were predicted"


def columns_of(scene: Scene) -> list[str]:
    """Columns of the history that can have a bar, as far as the scene tells them."""
    columns = [*Ledger(terms_of(scene)).columns]
    columns += [column for probe in scene.probes for column in probe.columns(scene.dimension)]
    for one in scene.boundaries:
        columns += reaction_columns(one.reports, scene.dimension) if one.reports is not None else []
    return [name for name in columns if name != "balance"]


def first_level(search: Search) -> Companion:
    """The coarsest level that has companions. Raises SolverError."""
    reasons = [""]
    for start in _STARTS:
        try:
            level = search.level(start)
        except NotCoarsened as reason:
            reasons.append(str(reason))
            continue
        found, refused = companions_of(search.plain(level), search.options.trust_code, search.ratios)
        if sum(one.purpose == SPACING for one in found) >= len(search.ratios):
            return level
        reasons += refused
    raise SolverError(f"target: expected a scene of which coarser ones can be made, found: {reasons[-1]}")


def run_level(search: Search, level: Companion, alone: Alone) -> tuple[int, ErrorTable | None]:
    """Run a level, unless it is there, and what it is compared with; the exit status and its bars. Collective."""
    comm, options, folder = search.comm, search.options, search.folder_of(level)
    say = speaker(comm, options)
    if not search.done:
        plans, _ = companions_of(search.plain(level), options.trust_code, search.ratios)
        found = companions_done(comm, plans, search.folder, options, search.began, say)
        if found is None:
            return TO_BE_CONTINUED, None
        search.done = [replace(o, companion=replace(o.companion, ratio=o.ratio * level.ratio)) for o in found]
        search.spent = sum(one.processor_seconds for one in found)
    result = result_of(comm, level, folder)
    if result is None:
        own = Namespace(**{**vars(options), "output": str(folder), "restart": "", "quiet": True})
        without_checkpoint(comm, own, folder)
        status = alone(comm, level.scene, own, search.began)
        result = result_of(comm, level, folder)
        if status or result is None:
            return status or TO_BE_CONTINUED, None
    others = search.rebased(level.ratio)
    table = ErrorTable.nothing()
    if comm.rank == 0:
        table, _ = write_bars(level.scene, folder, others, [], level.corners)
    search.done.append(result)
    search.spent += result.processor_seconds
    return 0, table


def worst(table: ErrorTable, wanted: list[Target]) -> tuple[float, float] | None:
    """How many times too large the worst bar is, and the order of that column; None where one has no bar."""
    excess = (0.0, 1.0)
    for one in wanted:
        bar = table.bars.get(one.column)
        size = None if bar is None else table.share(one.column) if one.relative else float(bar.error[-1])
        if bar is None or size is None or not size < float("inf"):
            return None
        excess = max(excess, (size / one.bar, bar.used))
    return excess


def next_level(search: Search, level: Companion, excess: float, order: float) -> tuple[Companion, float]:
    """The level that should do, and the core-seconds it should take. Raises NotCoarsened."""
    finer = search.level(level.ratio / finer_by(excess, order))
    share = level.ratio / finer.ratio
    last = search.done[-1]
    particles = round(last.particles * share**search.scene.dimension)
    runs = [one for one in search.done if one.companion.purpose == SPACING and one.steps]
    known = [Cost(one.particles, one.steps, one.processor_seconds) for one in runs]
    steps = last.steps * share ** steps_grow([one.ratio for one in runs], [one.steps for one in runs])
    return finer, predicted_seconds(known, particles, steps)
