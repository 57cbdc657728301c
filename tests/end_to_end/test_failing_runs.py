"""A run made to fail stops on all ranks, says when, where and what to do, and leaves only sound numbers behind."""

import numpy as np
from command_line import all_done, finish, many, start
from run_results import history, state, summary
from small_scenes import PUNCH, changed, write

RANKS = 2
WENT_WRONG = 3
FAILING = changed(PUNCH, {"method.cfl": 3.0, "end_time": 0.1, "output.checkpoint_steps": 2})


def test_a_large_time_step_fails_with_a_message_that_helps(tmp_path):
    folder, scene = tmp_path / "run", write(FAILING, tmp_path / "scene.toml")
    ranks = many([[scene, "-q", "-o", folder]], RANKS, tmp_path / "job")[0]
    assert [rank.status for rank in ranks] == [WENT_WRONG] * RANKS, ranks[0].err
    assert not ranks[1].err and "Traceback" not in ranks[0].err
    lines = {line.split()[0]: line for line in ranks[0].err.splitlines()}
    assert lines["parsolid:"].startswith("parsolid: the run failed: ")
    assert " s, step " in lines["time"] and float(lines["time"].split()[1]) > 0.0
    assert " on rank " in lines["particle"] and "at X = (" in lines["particle"] and "now x = (" in lines["particle"]
    assert str(folder / "checkpoint.h5") in lines["checkpoint"] and "(step " in lines["checkpoint"]
    assert "method.cfl" in lines["try"] and summary(folder)["status"] == "failed"
    _only_sound_numbers(folder)
    # both ranks stop in the same step, and at once
    assert abs(ranks[0].seconds - ranks[1].seconds) < 5.0


def _only_sound_numbers(folder) -> None:
    assert all(np.isfinite(values).all() for values in history(folder).values())
    header, fields, ledgers = state(folder)
    assert all(np.isfinite(values).all() for values in fields.values()) and np.isfinite(ledgers).all()
    assert header["step"] > 0 and (fields["jacobian"] > 0.0).all()


def test_a_failed_job_ends_with_status_3_and_goes_on_with_smaller_steps(tmp_path):
    folder, scene = tmp_path / "run", write(FAILING, tmp_path / "scene.toml")
    result = finish(start([scene, "-q", "-o", folder], RANKS))
    assert result.status == WENT_WRONG and result.err.count("the run failed") == 1 and "Traceback" not in result.err
    previous = state(folder)[0]["step"]
    # the state at the last checkpoint may be past saving; the first one before is not
    remedy = ["--set", "method.cfl=0.2", "--max-steps", "3", "--restart", folder / "checkpoint.previous.h5"]
    all_done(many([[scene, "-q", "-o", tmp_path / "remedied", *remedy]], RANKS, tmp_path / "job"))
    assert state(tmp_path / "remedied")[0]["step"] == previous - 2 + 3
