"""Error against processor seconds: a line a choice, and the lower envelope."""

from pathlib import Path
from typing import Any

from parsolid.commands.pareto.measure import Truth, envelope
from parsolid.commands.pareto.plan import Candidate, Plan
from parsolid.commands.plot.names import words_of
from parsolid.commands.study.pictures import MARKERS, MOST_CURVES, label_decades

_ENVELOPE: dict[str, Any] = {"color": "0.8", "linewidth": 7.0, "solid_joinstyle": "round", "zorder": 0}


def draw(plan: Plan, truth: Truth, path: Path) -> Path:
    """Write the picture and return its path. Raises ModuleNotFoundError without matplotlib."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(9.0, 5.2), layout="constrained")
    edge = envelope(plan)
    axes.plot([point[0] for point in edge], [point[1] for point in edge], label="lower envelope", **_ENVELOPE)
    shown, others = _told_apart(plan, edge)
    for number, one in enumerate(shown):
        color, width = (f"C{number - 1}", 1.3) if number else ("black", 2.2)
        style: dict[str, Any] = {"marker": MARKERS[number], "markersize": 4.5, "linewidth": width, "color": color}
        axes.plot(one.times, one.errors, label=one.choice.name, zorder=2 if number else 3, **style)
    for number, one in enumerate(others):
        # a choice of one run is a point
        style = {"marker": "." if len(one.errors) == 1 else "", "color": "0.7", "linewidth": 0.8, "zorder": 1}
        axes.plot(one.times, one.errors, label=None if number else "other choices", **style)
    if truth.uncertain:
        axes.axhspan(0.0, truth.uncertain, color="0.93", zorder=-1, label="not known better than this")
    axes.set(xscale="log", yscale="log", xlabel="processor seconds of the time loop, all ranks")
    axes.set(ylabel=f"error of {words_of(plan.column)}", title=plan.scene.title)
    label_decades(axes.xaxis)
    axes.grid(True, which="both", alpha=0.25)
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    figure.savefig(path, dpi=90)
    pyplot.close(figure)
    return path


def _told_apart(plan: Plan, edge: list[Any]) -> tuple[list[Candidate], list[Candidate]]:
    """The scene's own choice, those of the envelope, and then the best of what went farthest; and all others."""
    own = plan.candidates[0]
    best = {id(point[2]) for point in edge}
    made = [one for one in plan.candidates if one.errors and one is not own]
    made.sort(key=lambda one: (id(one) not in best, -len(one.errors), one.errors[-1]))
    return [own, *made[: MOST_CURVES - 1]], made[MOST_CURVES - 1 :]
