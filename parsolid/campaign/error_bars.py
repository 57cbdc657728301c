"""Error bars of a run's history: coarse runs before it, the bars of every column over time, and how they are told."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.campaign.estimate import (
    OF_LATTICES,
    OF_MESHES,
    SAFETY,
    SAFETY_DIVERGED,
    SAFETY_NO_ORDER,
    TIME_WINDOW,
    Bar,
    Series,
    largest_nearby,
    phase_and_amplitude,
    spacing_bar,
)
from parsolid.campaign.orders import (
    has_meshes,
    kind_of,
    order_in_spacing,
    order_in_time,
    reduced_regularity,
    without_order,
)
from parsolid.campaign.recovery import COLUMN, recovery_bars, watched
from parsolid.campaign.runner import History, InProcess, Interrupted, VariantRun, read_files, seconds_of
from parsolid.campaign.variants import LOOSER, SOLVER, SPACING, STEP, Variant, coarse_variants
from parsolid.exit_status import TO_BE_CONTINUED
from parsolid.output.errors import together
from parsolid.output.history import History as HistoryFile
from parsolid.output.summary import write_summary
from parsolid.scene import Scene
from parsolid.scene.observation import STORED_ENERGY
from parsolid.simulation.loop import Limits
from parsolid.splines import cubic_spline

# where coarse runs are below the folder of the run, and what holds the bars there
FOLDER, NAME = "coarse_runs", "history_error.csv"
# of the largest component of a vector or tensor, what is rounding of the others
ROUNDING = 1e-12
# columns of the history that are no results
NO_RESULTS = ("step", "time", "dt", "energy_error")


@dataclass
class ErrorTable:
    """Bars of all columns that have one, and why others have none."""

    times: np.ndarray
    values: History
    bars: dict[str, Bar]
    without: str | None = None
    steps: np.ndarray | None = None

    @classmethod
    def nothing(cls) -> "ErrorTable":
        """That of ranks that keep no history."""
        return cls(np.zeros(0), {}, {})

    def share(self, column: str) -> float:
        """The bar at the end over the largest absolute value of a column over time; infinite where there is none."""
        largest = float(np.abs(self.values[column]).max(initial=0.0))
        error = float(self.bars[column].error[-1])
        return error / largest if largest > 0.0 and math.isfinite(error) else math.inf


@dataclass(frozen=True)
class Campaign:
    """What the runs of one command share.

    folder: of the run, or of all levels; limits: of each run; say: prints a line on rank 0; alone: runs a scene into a
    folder with all its outputs and gives the exit status, collective.
    """

    comm: MPI.Intracomm
    folder: Path
    trust_code: bool
    limits: Limits
    say: Callable[[str], None]
    alone: Callable[[Scene, Path], int]

    def run_variants(self, variants: list[Variant], folder: Path) -> list[VariantRun] | None:
        """Run variants below a folder, or read what is there; None when a signal or the wall time ended one."""
        runner, runs = InProcess(self.comm, folder / FOLDER, self.limits), list[VariantRun]()
        for number, one in enumerate(variants, 1):

            def begins(number: int = number, title: str = one.title) -> None:
                self.say(f"error bars: coarse run {number} of {len(variants)}, {title}")

            try:
                runs.append(runner.run(one, begins=begins))
            except Interrupted:
                self.say(f"stopped in a coarse run, which is kept in {folder / FOLDER}: the same command goes on")
                return None
            if runs[-1].record.message:
                self.say(f"error bars: coarse run {one.title} failed: {runs[-1].record.message}")
        return runs


def run_with_error_bars(campaign: Campaign, scene: Scene) -> int:
    """Run coarse variants and a scene, and tell the bars; the exit status. Collective."""
    comm, folder, say = campaign.comm, campaign.folder, campaign.say
    variants, refused = coarse_variants(
        scene, campaign.trust_code, (scene.errors.ratios if scene.errors else None) or ()
    )
    for reason in refused:
        say(f"error bars: {reason}")
    runs = campaign.run_variants(variants, folder)
    if runs is None:
        return TO_BE_CONTINUED
    if not variants and (scene_of_recovery := watched(scene, campaign.trust_code)) is not None:
        say("error bars: estimated from the recovery of gradients in this run, without coarser ones")
        scene = scene_of_recovery
    status = campaign.alone(scene, folder)
    if status:
        say("error bars: at the end of the run, which the same command goes on with when --restart is added")
        return status
    with together(comm, f"cannot write the error bars of {folder}"):
        if comm.rank == 0:
            table, extra = write_error_bars(scene, folder, runs, refused)
            for line in lines(table, scene, extra):
                say(line)
    return status


def write_error_bars(
    scene: Scene, folder: Path, runs: list[VariantRun], refused: list[str]
) -> tuple[ErrorTable, float | None]:
    """Write the bars of a run beside its history and into its summary; the bars, and the processor time of the coarse
    runs over that of the run. For one rank.
    """
    summary, history = read_files(folder)
    table = error_table(scene, history, runs)
    own = seconds_of(summary)[1]
    extra = sum(one.seconds for one in runs) / own if own > 0.0 else None
    bars = summary_of_bars(table, scene, runs, refused) | {"extra_time": extra}
    write_summary(folder / "summary.json", summary | {"error_bars": bars})
    if table.bars:
        # a row for each row of the history: step, time and the bar of every column that has one
        file = HistoryFile(folder / NAME, ["step", "time", *(f"{name}_error" for name in table.bars)])
        steps = table.steps if table.steps is not None else np.arange(len(table.times))
        for row, (step, time) in enumerate(zip(steps, table.times)):
            errors = [float(bar.error[row]) for bar in table.bars.values()]
            file.append([int(step), float(time), *(None if np.isnan(error) else error for error in errors)])
        file.close()
    return table, extra


def error_table(scene: Scene, history: History, runs: list[VariantRun]) -> ErrorTable:
    """The bars of a run's history from variants that have been run; for one rank alone."""
    coarse = sorted((one for one in runs if one.variant.purpose == SPACING and one.history), key=lambda one: one.ratio)
    times = history["time"]
    columns = {name: values for name, values in history.items() if name not in NO_RESULTS}
    if not runs and COLUMN in history:
        return ErrorTable(times, columns, recovery_bars(scene, times, columns), steps=history["step"])
    if not coarse or len(times) < 2:
        faults = [f"{one.variant.title}: {one.record.message}" for one in runs if one.record.message]
        return ErrorTable(times, columns, {}, "; ".join(faults) or "no coarser run could be made")
    bars: dict[str, Bar] = {}
    trust = OF_MESHES if has_meshes(scene) else OF_LATTICES
    ratios = np.array([1.0, *(one.ratio for one in coarse)])
    for name, values in columns.items():
        if not all(name in one.history for one in coarse) or not np.isfinite(values).all():
            continue
        series = Series(times, np.array([values, *(on_times(one.history, name, times) for one in coarse)]), ratios)
        bars[name] = spacing_bar(series, order_in_spacing(name, scene), scene.end_time, trust)
        _add_parts(scene, name, bars[name], times, runs)
        if name in ("kinetic", *STORED_ENERGY) and "numerical_dissipation" in columns:
            # what the scheme has taken of both
            bars[name].parts["dissipation"] = np.abs(columns["numerical_dissipation"])
        bars[name].phase, bars[name].amplitude = phase_and_amplitude(series, bars[name].used)
    return ErrorTable(times, columns, bars, steps=history["step"])


def on_times(history: History, name: str, times: np.ndarray) -> np.ndarray:
    """A column of another run at the times (n,) of this one [s]: at a jump, of which this one has two rows, what
    is before it for the first row and what follows it for the second."""
    own, values = history["time"], history[name]
    after = _between(own, values, np.append(np.diff(own) > 0.0, True), times)
    first = np.append(np.diff(times) == 0.0, False)
    if first.any():
        after[first] = _between(own, values, np.insert(np.diff(own) > 0.0, 0, True), times[first])
    return after


def _between(own: np.ndarray, values: np.ndarray, kept: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Values (n,) at times from those of the rows that are kept."""
    own, values = own[kept], values[kept]
    result: np.ndarray = np.interp(times, own, values)
    if len(own) > 3:
        smooth = cubic_spline(own, values, np.clip(times, own[0], own[-1]))
        # next to a kink a cubic overshoots, a line does not
        near = np.clip(np.searchsorted(own, times), 1, len(own) - 1)
        room = np.abs(values[near] - values[near - 1])
        low, high = np.minimum(values[near], values[near - 1]) - room, np.maximum(values[near], values[near - 1]) + room
        result = np.clip(smooth, low, high)
    return result


def _add_parts(scene: Scene, name: str, bar: Bar, times: np.ndarray, runs: list[VariantRun]) -> None:
    """Parts of a step that is stated and of a solver, which finer particles do not make smaller: they widen the bar."""
    base = max((one for one in runs if one.variant.purpose == SPACING and one.history), key=lambda one: one.ratio)
    for one in runs:
        if one.variant.purpose == SPACING or name not in one.history or one.ratio != base.ratio:
            continue
        difference = on_times(base.history, name, times) - on_times(one.history, name, times)
        largest = largest_nearby(difference, times, TIME_WINDOW * scene.end_time)
        if one.variant.purpose == STEP:
            part = bar.parts["step"] = largest / (1.0 - 0.5 ** order_in_time(scene))
            bar.error = bar.error + SAFETY * part
        elif one.variant.purpose == SOLVER:
            part = bar.parts["solver"] = largest / (LOOSER - 1.0)
            bar.error = bar.error + SAFETY_NO_ORDER * part


def shown_columns(table: ErrorTable) -> list[str]:
    """The columns of the last lines: of probes and reactions but for rounding, or the energies where there are none."""
    known = [name for name in table.bars if "." in name]
    if not known:
        return [name for name in ("kinetic", *STORED_ENERGY) if name in table.bars]
    largest = {name: float(np.abs(table.values[name]).max(initial=0.0)) for name in known}
    alike: dict[str, float] = {}
    for name, value in largest.items():
        alike[_without_axes(name)] = max(value, alike.get(_without_axes(name), 0.0))
    return [name for name in known if largest[name] > ROUNDING * alike[_without_axes(name)]]


def _without_axes(name: str) -> str:
    """What components of one vector or tensor have in common."""
    stem, _, axes = name.rpartition("_")
    return stem if stem and set(axes) <= set("xyz") else name


def lines(table: ErrorTable, scene: Scene, extra: float | None) -> Iterator[str]:
    """The last lines of a run."""
    if table.without:
        yield f"error bars: none: {table.without}"
        return
    for name in shown_columns(table):
        yield in_words(table, name)
    if not any("." in name for name in table.bars):
        yield "error bars: the scene has no probe: bars are of its energies"
    reason = reduced_regularity(scene)
    if reason:
        yield f"error bars: {reason} makes the motion less smooth: order 1 is what is known of it"
    if lost := without_order(scene):
        yield f"error bars: {lost}: factor of safety {SAFETY_DIVERGED:g}"
    if extra is not None:
        yield f"error bars: extra time {100.0 * extra:.0f} %"


def in_words(table: ErrorTable, name: str) -> str:
    """A column at the end with its bar: "tip.twist 0.240 +- 0.012 (5 %), order 1.9"."""
    bar, value = table.bars[name], float(table.values[name][-1])
    error, share = float(bar.error[-1]), table.share(name)
    if not math.isfinite(error):
        mean = f", mean over time {bar.mean:.4g} +- {bar.mean_error:.2g}" if bar.mean_error is not None else ""
        return f"{name} {value:.4g}: no bar, {bar.verdict}{mean}"
    # two digits, but never a power of ten
    digits = f"{100.0 * share:.0f}" if share >= 1.0 else f"{100.0 * share:.2g}"
    percent = f" ({digits} % of its largest)" if math.isfinite(share) else ""
    return f"{name} {in_digits_of(value, error)} +- {error:.2g}{percent}, {bar.verdict}"


def in_digits_of(value: float, error: float) -> str:
    """A value to the second digit of its error."""
    if error <= 0.0 or value == 0.0:
        return f"{value:.6g}"
    digits = math.ceil(math.log10(abs(value))) - math.floor(math.log10(error)) + 1
    return f"{value:.{min(10, max(2, digits))}g}"


def summary_of_bars(table: ErrorTable, scene: Scene, runs: list[VariantRun], refused: list[str]) -> dict[str, Any]:
    """What summary.json says of them."""
    columns = {
        name: {
            "value": float(table.values[name][-1]),
            "error": float(bar.error[-1]),
            "share": table.share(name),
            "kind": kind_of(name, scene),
            "order": bar.order,
            "order_used": bar.used,
            "safety": bar.factor,
            "verdict": bar.verdict,
            "parts": {part: float(values[-1]) for part, values in bar.parts.items()},
            "phase_error": bar.phase,
            "amplitude_error": bar.amplitude,
            "mean": bar.mean,
            "mean_error": bar.mean_error,
        }
        for name, bar in table.bars.items()
    }
    coarse = [
        {
            "for": one.variant.purpose,
            "particles": one.variant.lattices,
            "ratio": one.ratio,
            "core_seconds": one.record.core_seconds,
            "processor_seconds": one.seconds,
            "fault": one.record.message,
            "digest": one.variant.digest,
        }
        for one in runs
    ]
    return {"columns": columns, "coarse_runs": coarse, "refused": refused, "without": table.without}
