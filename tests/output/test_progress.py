"""Progress: plain lines in a log, a bar on a terminal, silence on request; never an error."""

import io
import os
import pty
import re
import threading

import pytest

from parsolid.output import progress
from parsolid.output.progress import NORMAL, QUIET, VERBOSE, Compilations, Progress, terminal_columns

pytestmark = pytest.mark.serial

ROW = {"kinetic": 1.5, "strain_energy": 2.0, "material_dissipation": 0.25, "numerical_dissipation": 0.5}
ROW |= {"energy_error": 1e-6}
SUMMARY = {"status": "finished", "steps": 99, "end_time": 0.5, "wall_seconds": 12.0}
SUMMARY |= {"energy_error_share": 1e-5, "errors": {"u": 0.1}}


@pytest.fixture
def passing_time(monkeypatch):
    """A clock that the test sets: seconds."""
    seconds = [0.0]
    monkeypatch.setattr(progress.clock, "perf_counter", lambda: seconds[0])
    return seconds


def follow(level, stream, seconds, step_seconds):
    """100 steps of 10 particles to 0.5 s."""
    shown = Progress("Punch", 0.5, 10, level, stream)
    for step in range(101):
        shown.update(step, 0.005 * step, 0.005, ROW)
        seconds[0] += step_seconds
    shown.close(SUMMARY)


def said(*arguments) -> list[str]:
    log = io.StringIO()
    follow(arguments[0], log, *arguments[1:])
    return log.getvalue().splitlines()


def test_a_slow_run_tells_every_five_seconds_with_the_time_left(passing_time):
    lines = said(NORMAL, passing_time, 1.0)
    assert len(lines) == 1 + 20 + 2 and "10 particles" in lines[0]
    assert lines[5].split()[:4] == ["step", "25", "t", "1.2500e-01"] and "ETA 0:01:15" in lines[5]
    assert "kinetic 1.500e+00 J  strain energy 2.000e+00 J  material dissipation 2.500e-01 J" in lines[5]
    assert lines[5].endswith("1.00e+01 particle-steps/s")
    assert "99 steps to t = 0.5 s in 12.0 s, energy error 1.0e-05" in lines[-2] and lines[-1] == "error u: 0.1"
    # one of some seconds every tenth
    assert [line.split()[1] for line in said(NORMAL, passing_time, 0.1)[1:-2]] == [str(10 * k) for k in range(1, 11)]
    verbose = said(VERBOSE, passing_time, 1.0)
    assert len(verbose) == 1 + 100 + 2 and "energy error 1.000e-06 J" in verbose[1]
    assert said(QUIET, passing_time, 1.0) == []


def test_the_end_tells_steps_since_a_restart_how_to_go_on_and_all_that_speaks_against_the_run():
    def end(**more):
        log = io.StringIO()
        Progress("Glass", 0.5, 10, NORMAL, log).close(SUMMARY | more)
        return log.getvalue()

    found = [{"word": "unbalanced", "code": "energy-given", "reason": "it grew"}]
    found.append({"word": "inapplicable", "code": "beyond-the-method", "reason": "it has turned"})
    told = end(energy_check="unbalanced", energy_check_reason="it grew", energy_check_findings=found)
    assert told.count("it grew") == 1 and told.count("(beyond-the-method): it has turned") == 1
    again = end(steps_this_run=40)
    assert "40 of them since the restart" in again and "--restart" not in again
    assert "--restart" in end(status="interrupted")


def test_terms_of_a_method_are_told_once_there_is_something_in_them(passing_time):
    log, row = io.StringIO(), dict.fromkeys(list(ROW)[:-1], 0.0) | {"kinetic": 2.0, "strain_energy": 1.0}
    shown = Progress("Glass", 0.5, 10, NORMAL, log)
    terms = {"external_work": 3.0, "fracture_dissipation": 0.5, "residual_work": 1e-15}
    terms |= {"energy_error": 0.0, "end.u": 7.0, "plate.failed_mass": 0.25, "plate.deleted_mass": 0.0}
    for step in range(2):
        passing_time[0] += 10.0
        shown.update(step, 0.1 * step, 0.1, row | terms)
    line = log.getvalue().splitlines()[1]
    assert "strain energy 1.000e+00 J  fracture dissipation 5.000e-01 J" in line and "failed mass 2.500e-01 kg" in line
    assert not [word for word in ("residual", "end", "material", "deleted") if word in line]


def test_a_terminal_gets_a_bar(passing_time):
    leader, follower = pty.openpty()
    chunks = []

    def listen():
        try:
            while chunk := os.read(leader, 4096):
                chunks.append(chunk)
        except OSError:
            return  # the terminal was closed

    listener = threading.Thread(target=listen)
    listener.start()
    with os.fdopen(follower, "w") as terminal:
        assert terminal_columns(terminal) == 80
        follow(NORMAL, terminal, passing_time, 1.0)
    listener.join()
    os.close(leader)
    shown = b"".join(chunks).decode()
    assert "━" in shown and "particle-steps/s" in shown and "finished: 99 steps" in shown
    # the cursor is visible whenever the run may be killed
    assert shown.rindex("\x1b[?25h") > shown.rindex("\x1b[?25l")


def test_a_closed_stream_does_not_stop_the_run(passing_time):
    reader, writer = os.pipe()
    os.close(reader)
    stream = os.fdopen(writer, "w", buffering=1)
    follow(NORMAL, stream, passing_time, 1.0)
    closed = io.StringIO()
    closed.close()
    follow(NORMAL, closed, passing_time, 1.0)
    assert passing_time[0] == 202.0
    with pytest.raises(BrokenPipeError):
        stream.close()


def test_compilation_is_told_at_once_and_then_every_five_seconds(passing_time):
    log = io.StringIO()
    tell = Compilations("/kernels", "/kernels", log)
    assert log.getvalue() == ""
    for number in range(13):
        tell(f"kernel_{number}")
        passing_time[0] += 1.0
    first, *later = log.getvalue().splitlines()
    assert "/kernels" in first and [re.findall(r"\d+", line) for line in later] == [["6", "5", "5"], ["11", "10", "10"]]
    Compilations("/tmp/kernels", "/home/kernels", log)("kernel")
    assert "/tmp/kernels" in log.getvalue() and "/home/kernels" in log.getvalue()
