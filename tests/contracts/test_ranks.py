"""Results do not depend on the number of ranks, nor on where a run was begun."""

import pytest
from cases import CASES, cases, one_of_each_tag
from run_results import assert_close

FEW = one_of_each_tag() | set(cases("few"))
# all scenes on two ranks, and on three one of each tag and those of fewer particles than ranks
ON_RANKS = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.ranks(2, *(3,) * (name in FEW))) for name in cases()]
)


@ON_RANKS
def test_histories_and_final_states_are_those_of_one_rank(runs, comm, name):
    spread, alone = runs.whole(name), runs.alone(name)
    if comm.rank == 0:
        assert_close(spread.folder, alone.folder, CASES[name].agreement)


@ON_RANKS
def test_a_checkpoint_of_one_rank_goes_on_with_the_same_numbers(runs, comm, name):
    moved, alone = runs.from_one_rank(name), runs.alone(name)
    if comm.rank == 0:
        assert_close(moved.folder, alone.folder, CASES[name].agreement)


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("name", cases("migrates"))
def test_particles_change_their_rank(runs, name):
    assert runs.whole(name).summary["migrated_particles"] > 0
