"""Progress: plain lines in a log, a bar on a terminal, silence on request; never an error."""

import io
import os
import pty
import threading

import pytest

from parsolid.output import progress
from parsolid.output.progress import NORMAL, QUIET, VERBOSE, Compilations, Progress, terminal_columns

pytestmark = pytest.mark.serial

ROW = {
    "kinetic": 1.5,
    "strain_energy": 2.0,
    "material_dissipation": 0.25,
    "numerical_dissipation": 0.5,
    "energy_error": 1e-6,
}
SUMMARY = {
    "status": "finished",
    "steps": 99,
    "end_time": 0.5,
    "wall_seconds": 12.0,
    "energy_error_share": 1e-5,
    "errors": {"u": 0.1},
}


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


def test_a_slow_run_tells_every_five_seconds_with_the_time_left(passing_time):
    log = io.StringIO()
    follow(NORMAL, log, passing_time, 1.0)
    lines = log.getvalue().splitlines()
    assert lines[0] == "Punch: 10 particles, to t = 0.5 s"
    assert len(lines) == 1 + 20 + 2
    assert lines[5].startswith("step      25  t 1.2500e-01 s  25.0 %  dt 5.00e-03 s  ETA 0:01:15")
    assert "kinetic 1.500e+00 J  strain energy 2.000e+00 J  material dissipation 2.500e-01 J" in lines[5]
    assert lines[5].endswith("1.00e+01 particle-steps/s")
    assert lines[-2:] == ["finished: 99 steps to t = 0.5 s in 12.0 s, energy error 1.0e-05", "error u: 0.1"]


def test_a_restarted_run_tells_its_own_steps_beside_its_seconds():
    log = io.StringIO()
    Progress("Glass", 0.5, 10, NORMAL, log).close(SUMMARY | {"steps_this_run": 40})
    assert "finished: 99 steps to t = 0.5 s, 40 of them since the restart in 12.0 s, energy" in log.getvalue()
    assert "--restart" not in log.getvalue()
    Progress("Glass", 0.5, 10, NORMAL, log).close(SUMMARY | {"status": "interrupted"})
    assert "to go on from here: the same command with --restart" in log.getvalue()


def test_all_that_speaks_against_a_run_is_said_at_its_end():
    found = [{"word": "unbalanced", "code": "energy-given", "reason": "it grew"}]
    found.append({"word": "inapplicable", "code": "beyond-the-method", "reason": "it has turned"})
    log = io.StringIO()
    check = {"energy_check": "unbalanced", "energy_check_reason": "it grew", "energy_check_findings": found}
    Progress("Glass", 0.5, 10, NORMAL, log).close(SUMMARY | check)
    assert log.getvalue().count("it grew") == 1 and log.getvalue().count("(beyond-the-method): it has turned") == 1


def test_a_run_of_some_seconds_tells_every_tenth(passing_time):
    log = io.StringIO()
    follow(NORMAL, log, passing_time, 0.1)
    assert [line.split()[1] for line in log.getvalue().splitlines()[1:-2]] == [str(step) for step in range(10, 101, 10)]


def test_terms_of_a_method_are_told_once_there_is_something_in_them(passing_time):
    log, row = (
        io.StringIO(),
        {"kinetic": 2.0, "strain_energy": 1.0, "material_dissipation": 0.0, "numerical_dissipation": 0.0},
    )
    shown = Progress("Glass", 0.5, 10, NORMAL, log)
    terms = {
        "external_work": 3.0,
        "fracture_dissipation": 0.5,
        "residual_work": 1e-15,
        "energy_error": 0.0,
        "end.u": 7.0,
    }
    terms |= {"plate.failed_mass": 0.25, "plate.deleted_mass": 0.0}
    for step in range(2):
        passing_time[0] += 10.0
        shown.update(step, 0.1 * step, 0.1, row | terms)
    line = log.getvalue().splitlines()[1]
    assert "strain energy 1.000e+00 J  fracture dissipation 5.000e-01 J" in line
    assert "residual" not in line and "end" not in line and "material" not in line
    assert "failed mass 2.500e-01 kg" in line and "deleted" not in line


def test_verbose_says_more_and_quiet_nothing(passing_time):
    log, silence = io.StringIO(), io.StringIO()
    follow(VERBOSE, log, passing_time, 1.0)
    follow(QUIET, silence, passing_time, 1.0)
    assert len(log.getvalue().splitlines()) == 1 + 100 + 2 and "energy error 1.000e-06 J" in log.getvalue()
    assert silence.getvalue() == ""


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
    assert log.getvalue().splitlines() == [
        "compiling kernels, once for such scenes; they are kept in /kernels",
        "compiling kernel 6, kernel_5, after 5 s",
        "compiling kernel 11, kernel_10, after 10 s",
    ]
    Compilations("/tmp/kernels", "/home/kernels", log)("kernel")
    told = "they are kept in /tmp/kernels, as /home/kernels cannot be written, or not by you alone\n"
    assert log.getvalue().endswith(told)


def test_the_first_step_says_nothing_of_the_time_left(passing_time):
    log = io.StringIO()
    shown = Progress("Punch", 0.5, 10, NORMAL, log)
    # the kernels are compiled in the first step
    for step, seconds in ((7, 0.0), (8, 60.0), (9, 1.0), (10, 1.0)):
        passing_time[0] += seconds
        shown.update(step, 0.05 * step, 0.05, None)
    first, *_, last = [line for line in log.getvalue().splitlines() if line.startswith("step")]
    assert "ETA" not in first and "ETA 0:00:00" in last


def test_shares_of_the_time_leave_out_what_took_none_of_it():
    told = {"phases": {"forces": 3.0, "set_up": 1.0, "idle": 0.0}, "ranks": 2, "load_imbalance": 1.25}
    assert progress._shares(told) == "time: forces 75 %, set up 25 %; load imbalance 1.25"
    assert progress._shares(told | {"ranks": 1}) == "time: forces 75 %, set up 25 %"


@pytest.mark.parametrize(("time", "told"), [(0.125, True), (0.25, False)])
def test_energies_of_an_earlier_row_are_told_with_its_time(passing_time, time, told):
    log = io.StringIO()
    shown = Progress("Punch", 0.5, 10, NORMAL, log)
    shown.update(0, 0.0, 0.005, ROW)
    passing_time[0] = 10.0
    shown.update(50, 0.25, 0.005, ROW | {"time": time})
    assert ("1.2500e-01" in log.getvalue().splitlines()[-1]) == told
