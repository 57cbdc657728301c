"""Progress on rank 0: a live bar on a terminal, plain flushed lines anywhere else."""

import os
import sys
import time as clock
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from parsolid.scene.observation import DISSIPATIONS, stored_energy

if TYPE_CHECKING:
    from rich.live import Live

QUIET, NORMAL, VERBOSE = 0, 1, 2

_LAUNCHERS = ("mpirun", "mpiexec", "orterun", "prterun", "hydra")
_BAR_SECONDS = 0.2
# a line is due after so many seconds, or after this share of the simulated time if half a second has passed
_LINES = {NORMAL: (5.0, 0.1), VERBOSE: (1.0, 0.02)}
_LEAST_SECONDS = 0.5
_COMPILING_SECONDS = 5.0

# quantities of probes that are shown once they are positive, with their units
_OF_FAILURE = {"failed_mass": "kg", "deleted_mass": "kg"}

Moment = tuple[float, int, float]


class Progress:
    """Shows the progress of a run: step, time, step size, time left, energies, particle-steps per second.

    Parameters: title; end_time [s]; particles of all ranks; level QUIET, NORMAL or VERBOSE; stream, standard output by
    default. For one rank alone; a closed stream raises nothing.
    """

    def __init__(self, title: str, end_time: float, particles: int, level: int = NORMAL, stream: TextIO | None = None):
        self._end_time, self._particles, self._level = end_time, particles, level
        self._stream = stream or sys.stdout
        # (reading of the clock [s], step, time [s]) of the first step, and of the last that was shown
        self._first: Moment | None = None
        self._last: Moment = (0.0, 0, 0.0)
        # the step that the run started from
        self._before = 0
        self._bar: Live | None = None
        if level == QUIET:
            return
        self._say(f"{title or 'scene'}: {particles} particles, to t = {end_time:.6g} s")
        columns = terminal_columns(self._stream)
        if columns:
            # imported for a terminal alone: they take time
            from rich import live
            from rich.console import Console
            from rich.text import Text

            console = Console(file=self._stream, force_terminal=True, width=columns)
            # without a thread, which would disturb the ranks' timing
            self._bar = live.Live(Text("setting up"), console=console, auto_refresh=False)
            self._bar.start()
            # a killed run must not leave the terminal without a cursor
            console.show_cursor(True)

    def update(
        self, step: int, time: float, step_size: float, row: dict[str, float] | None, notes: Sequence[str] = ()
    ) -> None:
        """Show a step (with its time [s] and size [s]), if a line is due; row: the last history row, by column; notes:
        texts of the methods."""
        if self._level == QUIET:
            return
        now = clock.perf_counter()
        if self._first is None:
            self._first, self._before = (now, step, time), step
            self._last = self._first
            return
        if step == self._before + 1:
            # the first step includes the loading or compiling of kernels
            self._first = (now, step, time)
        since = now - self._last[0]
        if self._bar is not None:
            due = since >= _BAR_SECONDS
        else:
            seconds, share = _LINES[self._level]
            tenths, before = (int(moment / (share * self._end_time) + 1e-9) for moment in (time, self._last[2]))
            due = since >= seconds or (since >= _LEAST_SECONDS and tenths > before)
        if not due and time < self._end_time:
            return
        words = [*self._words(self._first, (now, step, time), step_size, row or {}), *notes]
        self._last = (now, step, time)
        head = f"step {step:7d}  t {time:.4e} s {100.0 * time / self._end_time:5.1f} %"
        if self._bar is None:
            self._say("  ".join([head, *words]))
        else:
            from rich.columns import Columns
            from rich.console import Group
            from rich.progress_bar import ProgressBar
            from rich.text import Text

            bar = ProgressBar(total=self._end_time, completed=time)
            try:
                self._bar.update(
                    Group(bar, Columns([Text(word, no_wrap=True) for word in [head, *words]], padding=(0, 2))),
                    refresh=True,
                )
            except (OSError, ValueError):
                self._level, self._bar = QUIET, None

    def say(self, text: str) -> None:
        """Print a line."""
        if self._level != QUIET:
            self._say(text)

    def close(self, summary: dict[str, Any]) -> None:
        """End the bar and print the result of the run; summary: as in summary.json."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
        if self._level == QUIET:
            return
        text = f"{summary.get('status', 'ended')}: {summary.get('steps')} steps to t = {summary.get('end_time'):.6g} s"
        here = summary.get("steps_this_run", summary.get("steps"))
        # steps are counted over restarts, seconds are not
        text += "" if here == summary.get("steps") else f", {here} of them since the restart"
        text += f" in {_seconds_in_words(summary['wall_seconds'])}"
        if (loop := summary.get("loop_seconds")) is not None:
            text += f", {_seconds_in_words(loop)} of it in the steps"
        if (rate := summary.get("particle_steps_per_second_per_rank")) is not None:
            text += f", {rate:.3g} particle-steps/s a rank"
        if (error := summary.get("energy_error_share")) is not None:
            text += f", energy error {error:.1e}"
        self._say(text)
        if summary.get("status") == "interrupted":
            self._say("to go on from here: the same command with --restart, on any number of ranks")
        if "phases" in summary:
            self._say(_shares(summary))
        if "energy_check" in summary:
            self._say(f"energy check {summary['energy_check']}: {summary['energy_check_reason']}")
            for one in summary.get("energy_check_findings", []):
                if one["reason"] != summary["energy_check_reason"]:
                    self._say(f"also {one['word']} ({one['code']}): {one['reason']}")
        if "added_mass" in summary:
            mass, added = summary["mass"], summary["added_mass"]
            text = f"mass scaling: {added:.4g} kg added to {mass:.4g} kg"
            self._say(f"{text}, kinetic energy at most {summary['kinetic_share']:.2g} of the internal one")
        for name, value in (summary.get("errors") or {}).items():
            self._say(f"error {name}: {value:.3g}" if isinstance(value, float) else f"error {name}: {value}")

    def _words(self, first: Moment, last: Moment, step_size: float, row: dict[str, float]) -> list[str]:
        (began, _, first_time), (now, step, time) = first, last
        rate = self._particles * (step - self._last[1]) / max(now - self._last[0], 1e-9)
        parts = [f"dt {step_size:.2e} s"]
        # unknown after the first step
        if (gone := time - first_time) > 0.0:
            minutes, seconds = divmod(int((now - began) * max(self._end_time - time, 0.0) / gone), 60)
            hours, minutes = divmod(minutes, 60)
            parts.append(f"ETA {hours}:{minutes:02d}:{seconds:02d}")
        if row:
            # energies are those of the last row of the history
            parts += [f"at t {row['time']:.4e} s:"] if row.get("time", time) != time else []
            parts += [f"{name} {value:.3e} J" for name, value in self._energies(row).items()]
            # probes of failed matter
            for column, value in row.items():
                name = column.rpartition(".")[2]
                if name in _OF_FAILURE and value > 0.0:
                    parts.append(f"{name.replace('_', ' ')} {value:.3e} {_OF_FAILURE[name]}")
        return [*parts, f"{rate:.2e} particle-steps/s"]

    def _energies(self, row: dict[str, float]) -> dict[str, float]:
        """Names and values [J] of the energies in a history row; terms of methods where they are not negligible."""
        stored = stored_energy(row)
        energies = {"kinetic": row["kinetic"], stored.replace("_", " "): row[stored]}
        columns = list(row)
        # the terms of the methods are between the work and the error
        bounded = "external_work" in row and "energy_error" in row
        own = columns[columns.index("external_work") + 1 : columns.index("energy_error")] if bounded else []
        terms = {name.replace("_", " "): row[name] for name in DISSIPATIONS}
        terms |= {name.replace("_", " "): row[name] for name in own}
        least = 1e-12 * max(map(abs, [*energies.values(), *terms.values()]))
        energies |= {name: value for name, value in terms.items() if abs(value) > least}
        if self._level == VERBOSE:
            energies["energy error"] = row["energy_error"]
        return energies

    def _say(self, text: str) -> None:
        try:
            print(text, file=self._stream, flush=True)
        except (OSError, ValueError):  # the stream is closed
            self._level = QUIET


class Compilations:
    """Prints that kernels are compiled, which takes a minute before the first step; called with the name of each.

    Parameters: folder, where they are kept; wanted, where they were to be kept; stream, standard output by default.
    """

    def __init__(self, folder: Path, wanted: Path | None = None, stream: TextIO | None = None):
        self._stream = stream or sys.stdout
        self._kept = f"kept in {folder}"
        if wanted not in (None, folder):
            self._kept += f", as {wanted} cannot be written, or not by you alone"
        self._count, self._began, self._last = 0, 0.0, 0.0

    def __call__(self, name: str) -> None:
        now = clock.perf_counter()
        if self._count == 0:
            self._began = self._last = now
            self._say(f"compiling kernels, once for such scenes; they are {self._kept}")
        self._count += 1
        if now - self._last >= _COMPILING_SECONDS:
            self._last = now
            self._say(f"compiling kernel {self._count}, {name}, after {now - self._began:.0f} s")

    def _say(self, text: str) -> None:
        # the stream may be closed
        with suppress(OSError, ValueError):
            print(text, file=self._stream, flush=True)


def terminal_columns(stream: Any) -> int | None:
    """Width of the terminal of a stream, None if it is none.

    Under mpirun a rank's output is a pipe to the launcher; then the terminal of the launcher counts.
    """
    try:
        if stream.isatty():
            return _columns(stream.fileno())
        if stream.fileno() != 1:
            return None
    except (OSError, ValueError, AttributeError):
        return None
    return _launcher_columns()


def _columns(descriptor: int) -> int:
    # terminals that do not know their width say 0
    return os.get_terminal_size(descriptor).columns or 80


def _launcher_columns() -> int | None:
    process, columns = os.getppid(), None
    try:
        while process > 1 and Path(f"/proc/{process}/comm").read_text().startswith(_LAUNCHERS):
            output = os.readlink(f"/proc/{process}/fd/1")
            columns = None
            if output.startswith(("/dev/pts/", "/dev/tty")):
                with open(output, "rb", buffering=0) as terminal:
                    columns = _columns(terminal.fileno())
            # "pid (name) state parent ...": the name may hold anything but its closing bracket is the last one
            process = int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
    except (OSError, ValueError):
        return None
    return columns


def _shares(summary: dict[str, Any]) -> str:
    """A text of the shares of the phases in the time, without negligible ones."""
    seconds = {name.replace("_", " "): value for name, value in summary["phases"].items()}
    whole = max(sum(seconds.values()), 1e-9)
    shares = [f"{name} {100.0 * value / whole:.0f} %" for name, value in seconds.items() if value > 0.005 * whole]
    imbalance = summary.get("load_imbalance")
    balance = f"; load imbalance {imbalance:.2f}" if imbalance and summary["ranks"] > 1 else ""
    return f"time: {', '.join(shares)}{balance}"


def _seconds_in_words(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 1.0 else f"{seconds:.2g} s"
