"""Error bars of a run's history: the coarse runs, the bar of every column over time, and their output."""

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
from parsolid.campaign.in_process import InProcess, Interrupted, VariantRun
from parsolid.campaign.orders import (
    has_meshes,
    kind_of,
    order_in_spacing,
    order_in_time,
    reduced_regularity,
    without_order,
)
from parsolid.campaign.records import History, read_files, step_seconds
from parsolid.campaign.recovery import COLUMN, recovery_bars, with_recovery_probe
from parsolid.campaign.variants import LOOSER, SOLVER, SPACING, STEP, Variant, coarse_variants
from parsolid.exit_status import TO_BE_CONTINUED
from parsolid.output.errors import together
from parsolid.output.history import History as HistoryFile
from parsolid.output.summary import write_summary
from parsolid.scene import Scene
from parsolid.scene.observation import STORED_ENERGY
from parsolid.simulation.loop import Limits
from parsolid.splines import cubic_spline

# folder of the coarse runs and file of the bars, in the folder of the run
FOLDER, NAME = "coarse_runs", "history_error.csv"
# a component below this share of the largest one of its vector or tensor is rounding
ROUNDING = 1e-12
# columns of the history that have no bar
NO_RESULTS = ("step", "time", "dt", "energy_error")


@dataclass
class ErrorTable:
    """Bars of the columns of a history.

    times (rows,) [s]; values: column -> (rows,); bars: by column; without: the reason if there are no bars; steps:
    (rows,) numbers of the steps
    """

    times: np.ndarray
    values: History
    bars: dict[str, Bar]
    without: str | None = None
    steps: np.ndarray | None = None

    def share(self, column: str) -> float:
        """The bar at the end over the largest absolute value of the column; infinite if there is no bar."""
        largest = float(np.abs(self.values[column]).max(initial=0.0))
        error = float(self.bars[column].error[-1])
        return error / largest if largest > 0.0 and math.isfinite(error) else math.inf


@dataclass(frozen=True)
class Campaign:
    """Settings shared by the runs of one command.

    folder: of the run, or of all levels; limits: of each run; say: prints a line on rank 0; run_scene: runs a scene
    into a folder with all its outputs and returns the exit status, collective.
    """

    comm: MPI.Intracomm
    folder: Path
    trust_code: bool
    limits: Limits
    say: Callable[[str], None]
    run_scene: Callable[[Scene, Path], int]

    def run_variants(self, variants: list[Variant], folder: Path) -> list[VariantRun] | None:
        """Run variants below a folder, or read their runs; None if a signal or the wall time ended one."""
        runner, runs = InProcess(self.comm, folder / FOLDER, self.limits), list[VariantRun]()
        for number, variant in enumerate(variants, 1):

            def announce(number: int = number, title: str = variant.title) -> None:
                self.say(f"error bars: coarse run {number} of {len(variants)}, {title}")

            try:
                runs.append(runner.run(variant, announce))
            except Interrupted:
                self.say(f"stopped in a coarse run, which is kept in {folder / FOLDER}: the same command continues it")
                return None
            if runs[-1].record.message:
                self.say(f"error bars: coarse run {variant.title} failed: {runs[-1].record.message}")
        return runs


def run_with_error_bars(campaign: Campaign, scene: Scene) -> int:
    """Run coarse variants and a scene, and print the bars; the exit status. Collective."""
    comm, folder, say = campaign.comm, campaign.folder, campaign.say
    ratios = (scene.errors.ratios if scene.errors else None) or ()
    variants, refused = coarse_variants(scene, campaign.trust_code, ratios)
    for reason in refused:
        say(f"error bars: {reason}")
    runs = campaign.run_variants(variants, folder)
    if runs is None:
        return TO_BE_CONTINUED
    if not variants and (scene_with_probe := with_recovery_probe(scene, campaign.trust_code)) is not None:
        say("error bars: estimated from the recovery of gradients in this run, without coarser ones")
        scene = scene_with_probe
    status = campaign.run_scene(scene, folder)
    if status:
        say("error bars: written at the end of the run; the same command with --restart continues the run")
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
    """Write the bars of a run into history_error.csv and its summary. For one rank.

    Returns the bars, and the processor time of the coarse runs over that of the run.
    """
    summary, history = read_files(folder)
    table = error_table(scene, history, runs)
    seconds = step_seconds(summary)[1]
    extra = sum(run.seconds for run in runs) / seconds if seconds > 0.0 else None
    bars = summary_of_bars(table, scene, runs, refused) | {"extra_time": extra}
    write_summary(folder / "summary.json", summary | {"error_bars": bars})
    if table.bars:
        file = HistoryFile(folder / NAME, ["step", "time", *(f"{name}_error" for name in table.bars)])
        steps = table.steps if table.steps is not None else np.arange(len(table.times))
        for row, (step, time) in enumerate(zip(steps, table.times)):
            errors = [float(bar.error[row]) for bar in table.bars.values()]
            file.append([int(step), float(time), *(None if np.isnan(error) else error for error in errors)])
        file.close()
    return table, extra


def error_table(scene: Scene, history: History, runs: list[VariantRun]) -> ErrorTable:
    """The bars of a run's history, from the runs of its variants. For one rank."""
    coarse = sorted((run for run in runs if run.variant.purpose == SPACING and run.history), key=lambda run: run.ratio)
    times = history["time"]
    columns = {name: values for name, values in history.items() if name not in NO_RESULTS}
    if not runs and COLUMN in history:
        return ErrorTable(times, columns, recovery_bars(scene, times, columns), steps=history["step"])
    if not coarse or len(times) < 2:
        faults = [f"{run.variant.title}: {run.record.message}" for run in runs if run.record.message]
        return ErrorTable(times, columns, {}, "; ".join(faults) or "no coarser run could be made")
    bars: dict[str, Bar] = {}
    trust = OF_MESHES if has_meshes(scene) else OF_LATTICES
    ratios = np.array([1.0, *(run.ratio for run in coarse)])
    for name, values in columns.items():
        if not all(name in run.history for run in coarse) or not np.isfinite(values).all():
            continue
        series = Series(times, np.array([values, *(on_times(run.history, name, times) for run in coarse)]), ratios)
        bars[name] = spacing_bar(series, order_in_spacing(name, scene), scene.end_time, trust)
        _add_parts(scene, name, bars[name], times, runs)
        if name in ("kinetic", *STORED_ENERGY) and "numerical_dissipation" in columns:
            bars[name].parts["dissipation"] = np.abs(columns["numerical_dissipation"])
        bars[name].phase, bars[name].amplitude = phase_and_amplitude(series, bars[name].used)
    return ErrorTable(times, columns, bars, steps=history["step"])


def on_times(history: History, name: str, times: np.ndarray) -> np.ndarray:
    """A column of a history interpolated to times (n,) [s].

    A jump is two rows with one time: the first of two equal `times` gets the value before it, the second the value
    after it.
    """
    rows, values = history["time"], history[name]
    last_of_time = np.append(np.diff(rows) > 0.0, True)
    result = _interpolate(rows[last_of_time], values[last_of_time], times)
    before_jump = np.append(np.diff(times) == 0.0, False)
    if before_jump.any():
        first_of_time = np.insert(np.diff(rows) > 0.0, 0, True)
        result[before_jump] = _interpolate(rows[first_of_time], values[first_of_time], times[before_jump])
    return result


def _interpolate(rows: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Values (n,) at times (n,) [s] by a cubic spline through the values at `rows` (m,) [s], a line for m < 4."""
    if len(rows) < 4:
        line: np.ndarray = np.interp(times, rows, values)
        return line
    smooth = cubic_spline(rows, values, np.clip(times, rows[0], rows[-1]))
    # limits the overshoot of the spline beside a kink
    right = np.clip(np.searchsorted(rows, times), 1, len(rows) - 1)
    room = np.abs(values[right] - values[right - 1])
    low, high = np.minimum(values[right], values[right - 1]), np.maximum(values[right], values[right - 1])
    return np.clip(smooth, low - room, high + room)


def _add_parts(scene: Scene, name: str, bar: Bar, times: np.ndarray, runs: list[VariantRun]) -> None:
    """Widen a bar by the errors of a stated time step and of a solver, which do not fall with the spacing."""
    base = max((run for run in runs if run.variant.purpose == SPACING and run.history), key=lambda run: run.ratio)
    for run in runs:
        if run.variant.purpose == SPACING or name not in run.history or run.ratio != base.ratio:
            continue
        difference = on_times(base.history, name, times) - on_times(run.history, name, times)
        largest = largest_nearby(difference, times, TIME_WINDOW * scene.end_time)
        if run.variant.purpose == STEP:
            part = bar.parts["step"] = largest / (1.0 - 0.5 ** order_in_time(scene))
            bar.error = bar.error + SAFETY * part
        elif run.variant.purpose == SOLVER:
            part = bar.parts["solver"] = largest / (LOOSER - 1.0)
            bar.error = bar.error + SAFETY_NO_ORDER * part


def shown_columns(table: ErrorTable) -> list[str]:
    """Columns to print: of probes and reactions but for components that are rounding, else the energies."""
    known = [name for name in table.bars if "." in name]
    if not known:
        return [name for name in ("kinetic", *STORED_ENERGY) if name in table.bars]
    largest = {name: float(np.abs(table.values[name]).max(initial=0.0)) for name in known}
    largest_component: dict[str, float] = {}
    for name, value in largest.items():
        largest_component[_without_axes(name)] = max(value, largest_component.get(_without_axes(name), 0.0))
    return [name for name in known if largest[name] > ROUNDING * largest_component[_without_axes(name)]]


def _without_axes(name: str) -> str:
    """The name that all components of a vector or tensor share."""
    stem, _, axes = name.rpartition("_")
    return stem if stem and set(axes) <= set("xyz") else name


def lines(table: ErrorTable, scene: Scene, extra: float | None) -> Iterator[str]:
    """The lines about error bars that a run prints at its end."""
    if table.without:
        yield f"error bars: none: {table.without}"
        return
    for name in shown_columns(table):
        yield in_words(table, name)
    if not any("." in name for name in table.bars):
        yield "error bars: of the energies, because the scene has no probe"
    if reason := reduced_regularity(scene):
        yield f"error bars: {reason} makes the motion less smooth: the known order is 1"
    if reason := without_order(scene):
        yield f"error bars: {reason}: factor of safety {SAFETY_DIVERGED:g}"
    if extra is not None:
        yield f"error bars: extra time {100.0 * extra:.0f} %"


def in_words(table: ErrorTable, name: str) -> str:
    """A column at the end with its bar: "tip.twist 0.240 +- 0.012 (5 % of its largest), order 1.9"."""
    bar, value = table.bars[name], float(table.values[name][-1])
    error, share = float(bar.error[-1]), table.share(name)
    if not math.isfinite(error):
        mean = f", mean over time {bar.mean:.4g} +- {bar.mean_error:.2g}" if bar.mean_error is not None else ""
        return f"{name} {value:.4g}: no bar, {bar.verdict}{mean}"
    # two digits, without an exponent
    digits = f"{100.0 * share:.0f}" if share >= 1.0 else f"{100.0 * share:.2g}"
    percent = f" ({digits} % of its largest)" if math.isfinite(share) else ""
    return f"{name} {in_digits_of(value, error)} +- {error:.2g}{percent}, {bar.verdict}"


def in_digits_of(value: float, error: float) -> str:
    """A value rounded to the second digit of its error."""
    if error <= 0.0 or value == 0.0:
        return f"{value:.6g}"
    digits = math.ceil(math.log10(abs(value))) - math.floor(math.log10(error)) + 1
    return f"{value:.{min(10, max(2, digits))}g}"


def summary_of_bars(table: ErrorTable, scene: Scene, runs: list[VariantRun], refused: list[str]) -> dict[str, Any]:
    """The table error_bars of summary.json."""
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
            "for": run.variant.purpose,
            "particles": run.variant.lattices,
            "ratio": run.ratio,
            "core_seconds": run.record.core_seconds,
            "processor_seconds": run.seconds,
            "fault": run.record.message,
            "digest": run.variant.digest,
        }
        for run in runs
    ]
    return {"columns": columns, "coarse_runs": coarse, "refused": refused, "without": table.without}
