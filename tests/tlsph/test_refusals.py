"""Refusals that need the pair lists: parallel mirror planes whose images would need images."""

import pytest
from solids import SOFT, simulation, tables

from parsolid.collective import SolverError


def two_rollers(particles, smoothing):
    """A strip between rollers at X = 0 and X = 1."""
    boundaries = [{"plane": f"X = {place}", "kind": "roller"} for place in (0, 1)]
    return tables(particles, material=SOFT, method={"smoothing": smoothing}, boundaries=boundaries)


def test_one_interval_between_rollers_runs_at_the_default_smoothing():
    assert len(simulation(two_rollers((2, 4), 0.85)).systems[0].lists.near.images.source)


def test_planes_within_half_the_reach_are_refused():
    with pytest.raises(SolverError, match="boundaries: expected parallel mirror planes farther apart"):
        simulation(two_rollers((2, 4), 1.2))
