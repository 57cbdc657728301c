"""What a comparison of choices found: a table, and the envelope in words."""

import csv
import os
from pathlib import Path

from parsolid.commands.pareto.measure import Truth, envelope, seconds_for
from parsolid.commands.pareto.picture import draw
from parsolid.commands.pareto.plan import Candidate, Plan
from parsolid.commands.pareto.search import Search
from parsolid.commands.study.tables import Sheet
from parsolid.machine import cores_in_words


def report(search: Search, command: str) -> None:
    """Print and write pareto.md, pareto.csv and pareto.png into the folder; for one rank."""
    plan, truth = search.plan, search.truth
    if truth is None or not any(one.errors for one in plan.candidates):
        search.say("pareto: no two resolutions of any choice were run: nothing can be compared within the budget")
        return
    sheet = table_of(plan)
    words = told(plan, truth)
    load = f"Load average of the machine at the end: {os.getloadavg()[0]:.1f} on {cores_in_words()}."
    lines = [f"## {plan.scene.title}: {plan.column}", f"Made by `{command}`. {load}"]
    refused = "\n".join(f"- not for this scene: {reason}" for reason in plan.refused)
    text = "\n\n".join([*lines, "\n".join(f"- {line}" for line in words), sheet.markdown(), refused])
    (search.folder / "pareto.md").write_text(text.rstrip() + "\n", encoding="utf-8")
    write_csv(search.folder / "pareto.csv", plan)
    print("\n" + sheet.markdown(), flush=True)
    for line in words:
        search.say(f"pareto: {line}")
    written = [search.folder / name for name in ("pareto.md", "pareto.csv")]
    try:
        written.append(draw(plan, truth, search.folder / "pareto.png"))
    except ModuleNotFoundError as error:
        search.say(f"no picture: {error.name} is not installed (parsolid[plot])")
    search.say(f"written: {', '.join(map(str, written))}")


def told(plan: Plan, truth: Truth) -> list[str]:
    """What errors are, what is on the envelope, and what the best saves."""
    what = "at the end" if len(truth.times) == 1 else "root of the mean square over all times"
    lines = [f"errors of {plan.column}: {what}, over the true values'; true values: {truth.words}"]
    if truth.uncertain:
        lines[0] += f", uncertain by {100.0 * truth.uncertain:.2g} %: smaller errors say nothing"
    for seconds, error, one, level in envelope(plan):
        lattice = one.runs[level].companion.lattices
        lines.append(f"least error in {seconds:.3g} s: {100.0 * error:.2g} %, {one.choice.name}, {lattice}")
    own = plan.candidates[0]
    if own.errors:
        wanted = max(own.errors[-1], truth.uncertain)
        costs = [(seconds_for(one, wanted), one) for one in plan.candidates if one.errors]
        seconds, best = min(costs, key=lambda pair: pair[0])
        mine = seconds_for(own, wanted)
        gain = f"{mine:.3g} s as the scene is, about {seconds:.3g} s with '{best.choice.name}'"
        none = f"no choice needs less time than the scene's {mine:.3g} s"
        lines.append(f"for an error of {100.0 * wanted:.2g} %: {none if best is own else gain}")
    return lines


def table_of(plan: Plan) -> Sheet:
    """One row a choice: its finest run, its order, and whether it is on the envelope."""
    sheet = Sheet(plan.column, ["choice", "runs", "finest", "CPU s", "error", "order", "envelope", "dropped"], 1)
    edge = envelope(plan)
    for one in sorted(plan.candidates, key=lambda one: (-len(one.errors), one.errors[-1:] or [float("inf")])):
        levels = [level + 1 for _, _, other, level in edge if other is one]
        if one.errors:
            last = one.runs[-1]
            row = [last.companion.lattices, f"{last.processor_seconds:.3g}", f"{100.0 * one.errors[-1]:.2g} %"]
        else:
            row = ["", "", ""]
        at = f"level {', '.join(map(str, levels))}" if levels else ""
        sheet.rows.append([one.choice.name, str(len(one.runs)), *row, order_of(one), at, one.dropped or ""])
    return sheet


def order_of(one: Candidate) -> str:
    """The observed order between the last two runs."""
    from math import log

    if len(one.errors) < 2 or min(one.errors[-2:]) <= 0.0:
        return ""
    return f"{log(one.errors[-2] / one.errors[-1]) / log(one.runs[-2].ratio / one.runs[-1].ratio):.1f}"


def write_csv(path: Path, plan: Plan) -> None:
    """One row a run."""
    on = {(id(one), level) for _, _, one, level in envelope(plan)}
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["choice", "lattice", "ratio", "particles", "steps", "processor_seconds", "error", "envelope"])
        for one in plan.candidates:
            for level, (run, error) in enumerate(zip(one.runs, one.errors)):
                row = [one.choice.name, run.companion.lattices, run.ratio, run.particles, run.steps]
                writer.writerow([*row, run.processor_seconds, error, int((id(one), level) in on)])
