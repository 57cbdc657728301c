"""Which options of a scene have the least error of a column for their time: the envelope and its report."""

import csv
import math
import os
from collections.abc import Callable
from pathlib import Path

from parsolid.campaign.halving import Configuration, Plan, SuccessiveHalving
from parsolid.campaign.reference import Reference
from parsolid.campaign.report import ResultTable
from parsolid.campaign.runner import InProcess, Interrupted
from parsolid.collective import SolverError
from parsolid.exit_status import DONE, TO_BE_CONTINUED
from parsolid.machine import cores_in_words
from parsolid.output.errors import together
from parsolid.particles.generation import generate

# a smaller gain in error is none
_LEAST_GAIN = 0.99


def seconds_for(one: Configuration, error: float) -> float:
    """Processor seconds for an error between those of an option's runs; infinite where none is as good."""
    for number, (seconds, found) in enumerate(zip(one.times, one.errors)):
        if found <= error:
            if number == 0 or found <= 0.0:
                return float(seconds)
            before, cost = one.errors[number - 1], one.times[number - 1]
            share = math.log(before / error) / math.log(before / found)
            return float(cost * (seconds / cost) ** share)
    return math.inf


def envelope(plan: Plan) -> list[tuple[float, float, Configuration, int]]:
    """Runs that no other has less error than in less time: (seconds, error, configuration, level), cheapest first."""
    points = [(t, e, one, i) for one in plan.configurations for i, (t, e) in enumerate(zip(one.times, one.errors))]
    result: list[tuple[float, float, Configuration, int]] = []
    for point in sorted(points, key=lambda p: p[:2]):
        if not result or point[1] < _LEAST_GAIN * result[-1][1]:
            result.append(point)
    return result


def in_words(plan: Plan, reference: Reference) -> list[str]:
    """What errors are, what is on the envelope, and what the best saves."""
    what = "at the end" if len(reference.times) == 1 else "root of the mean square over all times"
    lines = [f"errors of {plan.column}: {what}, over the true values'; true values: {reference.words}"]
    if reference.uncertain:
        lines[0] += f", uncertain by {100.0 * reference.uncertain:.2g} %: smaller errors say nothing"
    for seconds, error, one, level in envelope(plan):
        lattice = one.runs[level].variant.lattices
        lines.append(f"least error in {seconds:.3g} s: {100.0 * error:.2g} %, {one.option.name}, {lattice}")
    own = plan.configurations[0]
    if own.errors:
        error = max(own.errors[-1], reference.uncertain)
        costs = [(seconds_for(one, error), one) for one in plan.configurations if one.errors]
        seconds, best = min(costs, key=lambda pair: pair[0])
        mine = seconds_for(own, error)
        gain = f"{mine:.3g} s as the scene is, about {seconds:.3g} s with '{best.option.name}'"
        none = f"no choice needs less time than the scene's {mine:.3g} s"
        lines.append(f"for an error of {100.0 * error:.2g} %: {none if best is own else gain}")
    return lines


def run_pareto(
    runner: InProcess, plan: Plan, budget: float, command: str, say: Callable[[str], None], dry_run: bool = False
) -> int:
    """Compare the options of a plan and report into the runner's folder; the exit status: 0, or 75 when a signal ended
    it. Raises SceneError, or SolverError for a scene that does not run. Collective.
    """
    search = SuccessiveHalving(plan, InProcess(runner.comm, runner.folder / "runs"), budget, say)
    for line in plan.in_words(budget):
        say(f"pareto: {line}")
    if dry_run:
        return DONE
    # refuses bodies that touch and that no table names, which coarser runs keep apart (`CoarserScene`)
    generate(plan.scene, runner.comm)
    own = plan.configurations[0]
    try:
        search.advance(own, 0, "first")
        if not own.runs:
            raise SolverError(f"pareto: expected a scene that runs, found: {own.dropped}")
        say(f"pareto: expected: {search.expected_in_all():.3g} core-seconds, at most {budget:g}")
        search.follow()
    except Interrupted:
        say(f"stopped; what is finished is kept in {runner.folder}: the same command goes on")
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
    write_csv(folder / "pareto.csv", plan)
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
    """One row an option: its finest run, its order, and whether it is on the envelope."""
    table = ResultTable(plan.column, ["choice", "runs", "finest", "CPU s", "error", "order", "envelope", "dropped"], 1)
    edge = envelope(plan)
    for one in sorted(plan.configurations, key=lambda one: (-len(one.errors), one.errors[-1:] or [math.inf])):
        levels = [str(level + 1) for _, _, other, level in edge if other is one]
        finest = ["", "", ""]
        if one.errors:
            last = one.runs[-1]
            finest = [last.variant.lattices, f"{last.seconds:.3g}", f"{100.0 * one.errors[-1]:.2g} %"]
        at = f"level {', '.join(levels)}" if levels else ""
        table.rows.append([one.option.name, str(len(one.runs)), *finest, _order_of(one), at, one.dropped or ""])
    return table


def _order_of(one: Configuration) -> str:
    """The observed order between the last two runs."""
    if len(one.errors) < 2 or min(one.errors[-2:]) <= 0.0:
        return ""
    return f"{math.log(one.errors[-2] / one.errors[-1]) / math.log(one.runs[-2].ratio / one.runs[-1].ratio):.1f}"


def write_csv(path: Path, plan: Plan) -> None:
    """One row a run."""
    on = {(id(one), level) for _, _, one, level in envelope(plan)}
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["choice", "lattice", "ratio", "particles", "steps", "processor_seconds", "error", "envelope"])
        for one in plan.configurations:
            for level, (run, error) in enumerate(zip(one.runs, one.errors)):
                row = [one.option.name, run.variant.lattices, run.ratio, run.record.particles, run.record.steps]
                writer.writerow([*row, run.seconds, error, int((id(one), level) in on)])
