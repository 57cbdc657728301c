"""Runs of a scene's options from coarse to fine, of which the worse half is dropped at each level, within a budget."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mpi4py import MPI

from parsolid.campaign.coarsening import Level, NotCoarsened, lattice_words, parsed
from parsolid.campaign.options import Option, options_of
from parsolid.campaign.reference import Reference, observed_reference, stated_reference
from parsolid.campaign.runner import InProcess, VariantRun
from parsolid.campaign.variants import SPACING, Variant, history_alone, level_of
from parsolid.collective import SolverError
from parsolid.particles.fillings import filling_of
from parsolid.scene import Scene, SceneError

# spacings over that of the scene, coarsest first; the fewest levels that say anything of an option
RATIOS = (3.4, 2.25, 1.5, 1.0)
FEWEST = 2
# of the ratio of a level over that of the finer one
_NEXT_RATIO = 1.2
# most changes that are tried together
MOST_TOGETHER = 4


@dataclass
class Configuration:
    """An option and its runs so far, coarsest first; errors beside them; dropped: why it is not run any finer."""

    option: Option
    runs: list[VariantRun] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    dropped: str | None = None

    @property
    def times(self) -> list[float]:
        """Processor seconds of the runs."""
        return [one.seconds for one in self.runs]


@dataclass
class Plan:
    """Levels of a scene, coarsest first, with their ratios, the options that it can have, and why it has not others."""

    scene: Scene
    column: str
    trust_code: bool
    levels: list[Scene]
    ratios: list[float]
    configurations: list[Configuration] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)

    def variant(self, option: Option, level: int) -> Variant:
        """An option at a level, with a history and nothing else in its output, and the one probe that is looked at."""
        base = self.levels[level]
        tables = history_alone(base, option.applied(base), 1.0)
        probe = self.column.partition(".")[0] if "." in self.column else None
        tables["probes"] = [one for one in tables.get("probes", ()) if one["name"] == probe]
        tables["boundaries"] = [
            one if one.get("reports") == probe else {key: part for key, part in one.items() if key != "reports"}
            for one in tables.get("boundaries", ())
        ]
        ratio = self.ratios[level]
        scene = parsed(tables, self.trust_code, ratio)
        return Variant(scene, SPACING, ratio, lattice_words(scene))

    def work(self, level: int) -> float:
        """Particles times steps of a level over those of the coarsest."""
        return (self.ratios[0] / self.ratios[level]) ** (self.scene.dimension + 1)

    def add(self, option: Option) -> Configuration | None:
        """Take an option into the plan; None, and words about it, where the scene cannot have it or nothing changes."""
        try:
            scenes = [self.variant(option, level).scene for level in (0, len(self.levels) - 1)]
            if option.changes and _stated(scenes[0]) == _stated(self.variant(Option(), 0).scene):
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
        """What will be run."""
        lines = [f"{len(self.configurations)} choices for {self.column}, each one change from the scene:"]
        lines += [f"    {one.option.name}" for one in self.configurations]
        lines += [f"not for this scene: {reason}" for reason in self.refused]
        counts = [f"{lattice_words(one)} ({particles_of(one):,})" for one in self.levels]
        lines.append(f"resolutions: {', '.join(counts)}")
        lines.append(f"all at the first two, then the better half; at most {budget:g} core-seconds (--core-seconds)")
        return lines


def _stated(scene: Scene) -> dict[str, Any]:
    """What a scene of one method says to its bodies."""
    (system,), tables = scene.systems, scene.resolved()
    ignored_keys = system.settings.ignored_keys(scene, system.bodies)
    return tables | {"method": {key: value for key, value in tables["method"].items() if key not in ignored_keys}}


def particles_of(scene: Scene) -> int:
    """Particles of all bodies."""
    return sum(filling_of(body, scene.dimension).count for body in scene.bodies)


def plan_of(scene: Scene, column: str, axes: list[str], trust_code: bool) -> Plan:
    """Levels and options of a scene. Raises SolverError where no coarser scene can be made, or of several methods."""
    if len(scene.systems) > 1 or "methods" in scene.resolved():
        raise SolverError("pareto: expected a scene of one method, found several")
    found: list[Level] = []
    reason = ""
    for ratio in sorted(RATIOS):
        try:
            found.insert(0, level_of(scene, ratio, _NEXT_RATIO * found[0].ratio if found else 1.0))
        except NotCoarsened as error:
            reason = str(error)
    if len(found) < FEWEST:
        raise SolverError(f"pareto: expected a scene of which coarser ones can be made, found: {reason}")
    levels = [parsed(one.tables, trust_code, one.ratio) for one in found]
    plan = Plan(scene, column, trust_code, levels, [one.ratio for one in found])
    for option in [Option(), *options_of(scene, axes)]:
        plan.add(option)
    return plan


@dataclass
class SuccessiveHalving:
    """The runs of a plan. budget: of processor seconds; spent: by all runs that are there. Methods are collective."""

    plan: Plan
    runner: InProcess
    budget: float
    say: Callable[[str], None]
    spent: float = 0.0
    reference: Reference | None = None

    @property
    def comm(self) -> MPI.Intracomm:
        """The ranks that run."""
        return self.runner.comm

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
        """Run an option at a level and those below it that it lacks, unless the budget says no."""
        for number in range(len(one.runs), level + 1):
            expected = self.expected(one, number)
            if self.comm.bcast(self.spent + expected > self.budget):
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
        """Processor seconds that an option should take at a level: by its own last run, or the scene's."""
        known = one if one.runs else self.plan.configurations[0]
        if not known.runs:
            return 0.0
        last = min(level, len(known.runs) - 1)
        return known.times[last] * self.plan.work(level) / self.plan.work(last)

    def expected_in_all(self) -> float:
        """Processor seconds of all levels if every option cost what the scene's own does."""
        plan, count, total = self.plan, len(self.plan.configurations), 0.0
        for level in range(len(plan.levels)):
            count = max(2, (count + 1) // 2) + (level == 2) if level >= 2 else count
            total += count * self.expected(plan.configurations[0], level)
        return total

    def compare(self) -> None:
        """Compare all runs with the reference as it is known now; on rank 0, which has the histories."""
        plan = self.plan
        if self.comm.rank > 0:
            return
        families = [(one.option.name, one.runs) for one in plan.configurations]
        self.reference = stated_reference(plan.scene, plan.column) or observed_reference(
            plan.scene, plan.column, families
        )
        if self.reference is not None:
            for one in plan.configurations:
                one.errors = [self.reference.error(run, plan.column) for run in one.runs if run.history]

    def costs(self) -> dict[int, float]:
        """Number of a configuration that is still run -> seconds that it would need for an error between the scene's
        own and the best.
        """
        found = {}
        if self.comm.rank == 0:
            plan = self.plan
            newest = [one.errors[-1] for one in plan.configurations if one.errors]
            own = plan.configurations[0].errors
            # between what the scene has and what can be had
            error = (min(newest) * (own[-1] if own else min(newest))) ** 0.5
            found = {
                number: time_to(one, max(error, 1e-300), plan.scene.dimension)
                for number, one in enumerate(plan.configurations)
                if one.dropped is None and one.errors
            }
        result: dict[int, float] = self.comm.bcast(found)
        return result

    def halve(self, level: int) -> None:
        """Drop the worse half; the scene itself is kept."""
        costs = self.costs()
        order = sorted(costs, key=lambda number: costs[number])
        for number in order[max(2, (len(order) + 1) // 2) :]:
            if number:
                share = costs[number] / max(costs[order[0]], 1e-300)
                times = f"{share:.2g} times" if share < 1000.0 else "more than 1000 times"
                words = f"{times} the time of the best for the same error at level {level + 1}"
                self.plan.configurations[number].dropped = words

    def combine(self) -> None:
        """Take the changes that gain most together, of each axis the best, as further options."""
        costs = self.costs()
        own = costs.get(0, math.inf)
        gains: list[Option] = []
        for number in sorted(costs, key=lambda number: costs[number]):
            option = self.plan.configurations[number].option
            taken = {axis for other in gains for axis in other.axes}
            if number and costs[number] < own and not taken & set(option.axes) and "method" not in option.axes:
                gains.append(option)
        if not gains:
            return
        combined = gains[0]
        for option in gains[1:MOST_TOGETHER]:
            wider = combined.together(option)
            # what cannot be had together is left out, and the rest is tried without it
            combined = wider if self.plan.add(wider) is not None else combined


def time_to(one: Configuration, error: float, dimension: int) -> float:
    """Processor seconds that an option would need for an error, by the power law of its last two runs."""
    if not one.errors:
        return math.inf
    least, most = (dimension + 1) / 4.0, (dimension + 1) / 0.4
    slope = least * 2.0
    if len(one.errors) > 1 and one.errors[-1] > 0.0:
        gain, cost = math.log(one.errors[-2] / one.errors[-1]), math.log(one.times[-1] / one.times[-2])
        slope = min(most, max(least, cost / gain)) if gain > 0.0 else most
    # finer is worth more than is known of it only by the order; coarser no more than the runs show
    ratio = max(one.errors[-1], 1e-300) / error
    return float(one.times[-1] * ratio ** (slope if ratio > 1.0 else min(slope, most / 2.0)))
