"""Results do not depend on the number of ranks, nor on where a run was begun."""

import pytest
from cases import CASES, cases
from run_results import assert_close


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("name", cases())
def test_histories_and_final_states_are_those_of_one_rank(runs, comm, name):
    spread, alone = runs.whole(name), runs.alone(name)
    if comm.rank == 0:
        assert_close(spread.folder, alone.folder, CASES[name].agreement)


@pytest.mark.ranks(3)
@pytest.mark.parametrize("name", cases())
def test_a_checkpoint_of_one_rank_goes_on_with_the_same_numbers(runs, comm, name):
    moved, alone = runs.from_one_rank(name), runs.alone(name)
    if comm.rank == 0:
        assert_close(moved.folder, alone.folder, CASES[name].agreement)


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("name", cases("migrates"))
def test_particles_change_their_rank(runs, name):
    assert runs.whole(name).summary["migrated_particles"] > 0
