"""`parsolid study SCENE --pareto COLUMN`: says what it will run, runs it, reports."""

from argparse import Namespace
from pathlib import Path
from typing import Any

from parsolid.collective import SolverError
from parsolid.commands.error_bars import speaker
from parsolid.commands.pareto.choices import Choice, axes_of
from parsolid.commands.pareto.plan import Plan, particles_of, plan_of
from parsolid.commands.pareto.report import report
from parsolid.commands.pareto.search import Search
from parsolid.commands.run import bcast_scene
from parsolid.commands.target import columns_of
from parsolid.errors.running import Interrupted
from parsolid.output.errors import together
from parsolid.scene import Scene, SceneError, load_scene
from parsolid.scene.validation_errors import suggestion
from parsolid.simulation.signals import REQUEST

# processor seconds, unless given
BUDGET, TO_BE_CONTINUED = 600.0, 75


def run_pareto(comm: Any, options: Any) -> int:
    """Compare the choices that a scene has; the exit status: 0, or 75 when a signal ended it. Collective.

    Raises SceneError for a bad scene, a column or an axis that is not there; SolverError for a scene of which no
    coarser one can be made.
    """
    REQUEST.install()
    scene = bcast_scene(comm, lambda: load_scene(options.study, options.set, options.trust_code))
    refuse_unknown(scene, options)
    plan = plan_of(scene, options.pareto, options.axis, options.trust_code)
    folder = Path(options.output or Path("results") / f"{Path(options.study).stem}-pareto")
    say = speaker(comm, Namespace(quiet=False))
    search = Search(comm, plan, folder, options.budget or BUDGET, say)
    for line in told_plan(plan, search.budget):
        say(f"pareto: {line}")
    if options.dry_run:
        return 0
    try:
        search.advance(plan.candidates[0], 0, "first")
        if not plan.candidates[0].runs:
            raise SolverError(f"--pareto: expected a scene that runs, found: {plan.candidates[0].dropped}")
        say(f"pareto: expected: {expected_seconds(search):.3g} processor seconds, at most {search.budget:g}")
        search.follow()
    except Interrupted:
        say(f"stopped; what is finished is kept in {folder}: the same command goes on")
        return TO_BE_CONTINUED
    with together(comm, f"cannot write into {folder}"):
        if comm.rank == 0:
            report(search, f"parsolid study {options.study} --pareto {options.pareto}")
    return 0


def refuse_unknown(scene: Scene, options: Any) -> None:
    """Raise SceneError for a column or an axis that the scene has not."""
    for word, found, known in (
        ("--pareto", [options.pareto], columns_of(scene)),
        ("--axis", options.axis, axes_of(scene)),
    ):
        for name in found:
            if name not in known:
                told = f"expected one of {', '.join(known)}{suggestion(name, known)}, found {name!r}"
                raise SceneError([f"{word}: {told}"])


def told_plan(plan: Plan, budget: float) -> list[str]:
    """What will be run."""
    lattices = [plan.run(Choice(), level).lattices for level in range(len(plan.levels))]
    lines = [f"{len(plan.candidates)} choices for {plan.column}, each one change from the scene:"]
    lines += [f"    {one.choice.name}" for one in plan.candidates]
    lines += [f"not for this scene: {reason}" for reason in plan.refused]
    counts = ", ".join(f"{words} ({particles_of(scene):,})" for words, scene in zip(lattices, plan.levels))
    lines.append(f"resolutions: {counts}")
    lines.append(f"all at the first two, then the better half; at most {budget:g} processor seconds (--budget)")
    return lines


def expected_seconds(search: Search) -> float:
    """Processor seconds of all levels if every choice cost what the scene's own does."""
    plan, count, total = search.plan, len(search.plan.candidates), 0.0
    for level in range(len(plan.levels)):
        count = max(2, (count + 1) // 2) + (level == 2) if level >= 2 else count
        total += count * search.expected(plan.candidates[0], level)
    return total
