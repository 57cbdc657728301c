"""Search for the options of a scene with the least error of a column for their run time, and its report.

Options are run from coarse to fine within a budget; the worse half is dropped at each level.
"""

import csv
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from parsolid.campaign.coarsening import Level, NotCoarsened, lattice_words, parsed
from parsolid.campaign.in_process import InProcess, Interrupted, VariantRun
from parsolid.campaign.options import METHOD, Option, options_of
from parsolid.campaign.reference import Reference, observed_reference, stated_reference
from parsolid.campaign.report import ResultTable
from parsolid.campaign.variants import SPACING, Variant, history_only, level_of
from parsolid.collective import SolverError
from parsolid.exit_status import DONE, TO_BE_CONTINUED
from parsolid.machine import cores_in_words
from parsolid.output.errors import together
from parsolid.particles.fillings import filling_of
from parsolid.particles.generation import generate
from parsolid.scene import Scene, SceneError

# ratios of the spacing of the levels, coarsest first, and the fewest levels of a search
RATIOS = (3.4, 2.25, 1.5, 1.0)
FEWEST = 2
# smallest ratio of the spacings of two levels
_NEXT_RATIO = 1.2
# largest number of changes in one option
MOST_TOGETHER = 4
# an option is on the envelope if its error is below this share of that of all faster ones
_LEAST_GAIN = 0.99


@dataclass
class Configuration:
    """An option, its runs so far, coarsest first, and their errors; dropped: why it is not run at finer levels."""

    option: Option
    runs: list[VariantRun] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    dropped: str | None = None

    @property
    def times(self) -> list[float]:
        """Processor seconds of the runs."""
        return [run.seconds for run in self.runs]


@dataclass
class Plan:
    """Levels of a scene, coarsest first, their ratios, its options, and the reasons why it cannot have others."""

    scene: Scene
    column: str
    trust_code: bool
    levels: list[Scene]
    ratios: list[float]
    configurations: list[Configuration] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)

    def variant(self, option: Option, level: int) -> Variant:
        """An option at a level; of its output and probes only the column that is compared is kept."""
        base = self.levels[level]
        tables = history_only(base, option.applied(base), 1.0)
        probe = self.column.partition(".")[0] if "." in self.column else None
        tables["probes"] = [table for table in tables.get("probes", ()) if table["name"] == probe]
        tables["boundaries"] = [dict(table) for table in tables.get("boundaries", ())]
        for table in tables["boundaries"]:
            if table.get("reports") != probe:
                table.pop("reports", None)
        ratio = self.ratios[level]
        return Variant(parsed(tables, self.trust_code, ratio), SPACING, ratio)

    def work(self, level: int) -> float:
        """Particles times steps of a level over those of the coarsest."""
        return (self.ratios[0] / self.ratios[level]) ** (self.scene.dimension + 1)

    def add(self, option: Option) -> Configuration | None:
        """Add an option; None, with the reason in `refused`, if the scene cannot have it or it changes nothing."""
        try:
            coarsest = self.variant(option, 0).scene
            self.variant(option, len(self.levels) - 1)
            if option.changes and _effective_tables(coarsest) == _effective_tables(self.variant(Option(), 0).scene):
                raise SceneError(["it changes nothing here"])
        except SceneError as error:
            self.refused.append(f"{option.name}: {next(iter(error.faults))}")
            return None
        except NotCoarsened as reason:
            self.refused.append(f"{option.name}: {reason}")
            return None
        self.configurations.append(Configuration(option))
        return self.configurations[-1]

    def in_words(self, budget: float) -> list[str]:
        """The options, levels and the budget, as printed before the search."""
        lines = [f"{len(self.configurations)} choices for {self.column}, each one change from the scene:"]
        lines += [f"    {one.option.name}" for one in self.configurations]
        lines += [f"not for this scene: {reason}" for reason in self.refused]
        counts = []
        for level in self.levels:
            particles = sum(filling_of(body, level.dimension).count for body in level.bodies)
            counts.append(f"{lattice_words(level)} ({particles:,})")
        lines.append(f"resolutions: {', '.join(counts)}")
        lines.append(f"all at the first two, then the better half; at most {budget:g} core-seconds (--core-seconds)")
        return lines


def _effective_tables(scene: Scene) -> dict[str, Any]:
    """The tables of a scene of one method without keys that have no effect."""
    (system,), tables = scene.systems, scene.resolved()
    ignored_keys = system.settings.ignored_keys(scene, system.bodies)
    return tables | {"method": {key: value for key, value in tables["method"].items() if key not in ignored_keys}}


def plan_of(scene: Scene, column: str, axes: list[str], trust_code: bool) -> Plan:
    """Levels and options of a scene. Raises SolverError for several methods or if no coarser scene can be made."""
    if len(scene.systems) > 1 or "methods" in scene.resolved():
        raise SolverError("pareto: expected a scene of one method, found several")
    made: list[Level] = []
    reason = ""
    for ratio in sorted(RATIOS):
        try:
            made.insert(0, level_of(scene, ratio, _NEXT_RATIO * made[0].ratio if made else 1.0))
        except NotCoarsened as error:
            reason = str(error)
    if len(made) < FEWEST:
        raise SolverError(f"pareto: expected a scene of which coarser ones can be made, found: {reason}")
    levels = [parsed(level.tables, trust_code, level.ratio) for level in made]
    plan = Plan(scene, column, trust_code, levels, [level.ratio for level in made])
    for option in [Option(), *options_of(scene, axes)]:
        plan.add(option)
    return plan


@dataclass
class SuccessiveHalving:
    """The search: runs of a plan, within a budget [processor seconds]; spent: by all runs. Methods are collective."""

    plan: Plan
    runner: InProcess
    budget: float
    say: Callable[[str], None]
    spent: float = 0.0
    reference: Reference | None = None

    def follow(self) -> None:
        """Make all runs. Raises Interrupted."""
        plan = self.plan
        for level in range(len(plan.levels)):
            if level == 2:
                self.combine()
            alive = [one for one in plan.configurations if one.dropped is None]
            for number, one in enumerate(alive, 1):
                self.advance(one, level, f"level {level + 1} of {len(plan.levels)}, {number} of {len(alive)}")
            self.compare()
            if level >= 1 and level + 1 < len(plan.levels):
                self.halve(level)

    def advance(self, one: Configuration, level: int, where: str) -> None:
        """Run an option at the levels that it lacks up to `level`, as far as the budget allows."""
        for number in range(len(one.runs), level + 1):
            expected = self.expected(one, number)
            if self.runner.comm.bcast(self.spent + expected > self.budget):
                one.dropped = f"the budget: about {expected:.3g} s more were needed"
                return
            run = self.runner.run(self.plan.variant(one.option, number))
            if run.record.message:
                one.dropped = f"failed: {run.record.message}"
                self.say(f"pareto: {where}: {one.option.name}: {one.dropped}")
                return
            one.runs.append(run)
            self.spent += run.seconds
            took = f"{run.variant.lattices}, {run.seconds:.3g} s"
            self.say(f"pareto: {where}: {one.option.name}: {took}, {self.spent:.3g} s in all")

    def expected(self, one: Configuration, level: int) -> float:
        """Predicted processor seconds of an option at a level, from its last run or that of the unchanged scene."""
        measured = one if one.runs else self.plan.configurations[0]
        if not measured.runs:
            return 0.0
        last = min(level, len(measured.runs) - 1)
        return measured.times[last] * self.plan.work(level) / self.plan.work(last)

    def compare(self) -> None:
        """Compute the errors of all runs with the present reference; on rank 0, which has the histories."""
        plan = self.plan
        if self.runner.comm.rank > 0:
            return
        families = [(one.option.name, one.runs) for one in plan.configurations]
        self.reference = stated_reference(plan.scene, plan.column) or observed_reference(
            plan.scene, plan.column, families
        )
        if self.reference is not None:
            for one in plan.configurations:
                one.errors = [self.reference.error(run, plan.column) for run in one.runs if run.history]

    def costs(self) -> dict[int, float]:
        """Seconds that each option still in the search needs for one error, by its index; the error is the geometric
        mean of the errors of the scene and of the best option.
        """
        costs = {}
        if self.runner.comm.rank == 0:
            plan = self.plan
            newest = [one.errors[-1] for one in plan.configurations if one.errors]
            of_scene = plan.configurations[0].errors
            error = (min(newest) * (of_scene[-1] if of_scene else min(newest))) ** 0.5
            costs = {
                number: time_to(one, max(error, 1e-300), plan.scene.dimension)
                for number, one in enumerate(plan.configurations)
                if one.dropped is None and one.errors
            }
        result: dict[int, float] = self.runner.comm.bcast(costs)
        return result

    def halve(self, level: int) -> None:
        """Drop the worse half of the options; the unchanged scene stays."""
        costs = self.costs()
        order = sorted(costs, key=lambda number: costs[number])
        for number in order[max(2, (len(order) + 1) // 2) :]:
            if number:
                share = costs[number] / max(costs[order[0]], 1e-300)
                times = f"{share:.2g} times" if share < 1000.0 else "more than 1000 times"
                words = f"{times} the time of the best for the same error at level {level + 1}"
                self.plan.configurations[number].dropped = words

    def combine(self) -> None:
        """Add options that combine the best changes of several axes."""
        costs = self.costs()
        of_scene = costs.get(0, math.inf)
        gains: list[Option] = []
        for number in sorted(costs, key=lambda number: costs[number]):
            option = self.plan.configurations[number].option
            taken = {axis for other in gains for axis in other.axes}
            if number and costs[number] < of_scene and not taken & set(option.axes) and METHOD not in option.axes:
                gains.append(option)
        if not gains:
            return
        combined = gains[0]
        for option in gains[1:MOST_TOGETHER]:
            wider = Option(combined.changes + option.changes)
            # a change that the scene cannot have with the others is left out
            if self.plan.add(wider) is not None:
                combined = wider


def time_to(one: Configuration, error: float, dimension: int) -> float:
    """Processor seconds that an option needs for an error, by the power law of its last two runs; inf without runs."""
    if not one.errors:
        return math.inf
    least, most = (dimension + 1) / 4.0, (dimension + 1) / 0.4
    slope = least * 2.0
    if len(one.errors) > 1 and one.errors[-1] > 0.0:
        gain, cost = math.log(one.errors[-2] / one.errors[-1]), math.log(one.times[-1] / one.times[-2])
        slope = min(most, max(least, cost / gain)) if gain > 0.0 else most
    # towards coarser runs the slope is bounded, so that a steep one does not predict too little time
    ratio = max(one.errors[-1], 1e-300) / error
    return float(one.times[-1] * ratio ** (slope if ratio > 1.0 else min(slope, most / 2.0)))


def seconds_for(one: Configuration, error: float) -> float:
    """Processor seconds for an error, interpolated between the runs of an option; inf if no run is as accurate."""
    for number, (seconds, reached) in enumerate(zip(one.times, one.errors)):
        if reached <= error:
            if number == 0 or reached <= 0.0:
                return float(seconds)
            before, cost = one.errors[number - 1], one.times[number - 1]
            share = math.log(before / error) / math.log(before / reached)
            return float(cost * (seconds / cost) ** share)
    return math.inf


def envelope(plan: Plan) -> list[tuple[float, float, Configuration, int]]:
    """Runs with less error than all faster ones: (seconds, error, configuration, level), fastest first."""
    points = [(t, e, one, i) for one in plan.configurations for i, (t, e) in enumerate(zip(one.times, one.errors))]
    result: list[tuple[float, float, Configuration, int]] = []
    for point in sorted(points, key=lambda p: p[:2]):
        if not result or point[1] < _LEAST_GAIN * result[-1][1]:
            result.append(point)
    return result


def in_words(plan: Plan, reference: Reference) -> list[str]:
    """The definition of the error, the envelope, and the time that the best option saves."""
    what = "at the end" if len(reference.times) == 1 else "root mean square over all times"
    lines = [f"errors of {plan.column}: {what}, relative to the true values; true values: {reference.words}"]
    if reference.uncertain:
        lines[0] += f", uncertain by {100.0 * reference.uncertain:.2g} %: smaller errors are not significant"
    for seconds, error, one, level in envelope(plan):
        lattice = one.runs[level].variant.lattices
        lines.append(f"least error in {seconds:.3g} s: {100.0 * error:.2g} %, {one.option.name}, {lattice}")
    unchanged = plan.configurations[0]
    if unchanged.errors:
        error = max(unchanged.errors[-1], reference.uncertain)
        costs = [(seconds_for(one, error), one) for one in plan.configurations if one.errors]
        least, best = min(costs, key=lambda pair: pair[0])
        seconds = seconds_for(unchanged, error)
        if best is unchanged:
            gain = f"no choice needs less time than the scene's {seconds:.3g} s"
        else:
            gain = f"{seconds:.3g} s as the scene is, about {least:.3g} s with '{best.option.name}'"
        lines.append(f"for an error of {100.0 * error:.2g} %: {gain}")
    return lines


def run_pareto(
    runner: InProcess, plan: Plan, budget: float, command: str, say: Callable[[str], None], dry_run: bool = False
) -> int:
    """Compare the options of a plan and write the report into the folder of the runner. Collective.

    Returns the exit status, 75 after a signal. Raises SceneError, or SolverError for a scene that does not run.
    """
    search = SuccessiveHalving(plan, InProcess(runner.comm, runner.folder / "runs"), budget, say)
    for line in plan.in_words(budget):
        say(f"pareto: {line}")
    if dry_run:
        return DONE
    # refuses touching bodies that no table names; coarser runs do not see them (`CoarserScene`)
    generate(plan.scene, runner.comm)
    unchanged = plan.configurations[0]
    try:
        search.advance(unchanged, 0, "first")
        if not unchanged.runs:
            raise SolverError(f"pareto: expected a scene that runs, found: {unchanged.dropped}")
        # estimate with the costs of the unchanged scene for all options
        count, total = len(plan.configurations), 0.0
        for level in range(len(plan.levels)):
            count = max(2, (count + 1) // 2) + (level == 2) if level >= 2 else count
            total += count * search.expected(unchanged, level)
        say(f"pareto: expected: {total:.3g} core-seconds, at most {budget:g}")
        search.follow()
    except Interrupted:
        say(f"stopped; finished runs are kept in {runner.folder}: the same command continues")
        return TO_BE_CONTINUED
    with together(runner.comm, f"cannot write into {runner.folder}"):
        if runner.comm.rank == 0:
            report(search, runner.folder, command)
    return DONE


def report(search: SuccessiveHalving, folder: Path, command: str) -> None:
    """Print and write pareto.md, pareto.csv and pareto.png into the folder; for one rank."""
    plan, reference = search.plan, search.reference
    if reference is None or not any(one.errors for one in plan.configurations):
        search.say("pareto: no two resolutions of any choice were run: nothing can be compared within the budget")
        return
    table, words = table_of(plan).markdown(), in_words(plan, reference)
    load = f"Load average of the machine at the end: {os.getloadavg()[0]:.1f} on {cores_in_words()}."
    lines = [f"## {plan.scene.title}: {plan.column}", f"Made by `{command}`. {load}"]
    refused = "\n".join(f"- not for this scene: {reason}" for reason in plan.refused)
    text = "\n\n".join([*lines, "\n".join(f"- {line}" for line in words), table, refused])
    (folder / "pareto.md").write_text(text.rstrip() + "\n", encoding="utf-8")
    on_envelope = {(id(one), level) for _, _, one, level in envelope(plan)}
    with open((folder / "pareto.csv"), "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["choice", "lattice", "ratio", "particles", "steps", "processor_seconds", "error", "envelope"])
        for one in plan.configurations:
            for level, (run, error) in enumerate(zip(one.runs, one.errors)):
                row = [one.option.name, run.variant.lattices, run.ratio, run.record.particles, run.record.steps]
                writer.writerow([*row, run.seconds, error, int((id(one), level) in on_envelope)])
    print("\n" + table, flush=True)
    for line in words:
        search.say(f"pareto: {line}")
    written = [folder / name for name in ("pareto.md", "pareto.csv")]
    try:
        from parsolid.campaign.pictures import draw_pareto

        written.append(draw_pareto(plan, reference, envelope(plan), folder / "pareto.png"))
    except ModuleNotFoundError as error:
        search.say(f"no picture: {error.name} is not installed (parsolid[plot])")
    search.say(f"written: {', '.join(map(str, written))}")


def table_of(plan: Plan) -> ResultTable:
    """One row per option: its finest run, its observed order, and its levels on the envelope."""
    table = ResultTable(plan.column, ["choice", "runs", "finest", "CPU s", "error", "order", "envelope", "dropped"], 1)
    edge = envelope(plan)
    for one in sorted(plan.configurations, key=lambda one: (-len(one.errors), one.errors[-1:] or [math.inf])):
        levels = [str(level + 1) for _, _, other, level in edge if other is one]
        finest, order = ["", "", ""], ""
        if len(one.errors) > 1 and min(one.errors[-2:]) > 0.0:
            gain, finer = one.errors[-2] / one.errors[-1], one.runs[-2].ratio / one.runs[-1].ratio
            order = f"{math.log(gain) / math.log(finer):.1f}"
        if one.errors:
            last = one.runs[-1]
            finest = [last.variant.lattices, f"{last.seconds:.3g}", f"{100.0 * one.errors[-1]:.2g} %"]
        at = f"level {', '.join(levels)}" if levels else ""
        table.rows.append([one.option.name, str(len(one.runs)), *finest, order, at, one.dropped or ""])
    return table
