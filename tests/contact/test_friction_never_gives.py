"""Friction takes energy or nothing, also where a spring turns round or ends while bodies part."""

import math

import numpy as np
import pytest

from parsolid.contact.friction import linear_return, return_mapping, tangential, turned


def test_a_spring_that_is_turned_round_or_cut_gives_nothing():
    """And has at most its old force where the limit has fallen below it, else at most that of Coulomb's law."""
    chance, rigidity, reversed_springs = np.random.default_rng(3), 2.0, 0
    for d in (2, 3) * 2000:
        n, spring, slip = np.zeros((3, 3))
        for vector in (n, spring, slip):
            vector[:d] = chance.normal(size=d)
        n /= math.sqrt(n @ n)
        # between Coulomb's limit and in the plane, as a step before has left it
        old, moved = (np.array(tangential(vector, n)) for vector in (spring, slip))
        assert np.allclose(turned(old, n), old, atol=1e-14)
        most = rigidity * chance.uniform(0.0, 1.5)
        stick, lost = return_mapping(old, old + moved, rigidity, most)
        stick = np.array(stick)
        length, before = math.sqrt(stick @ stick), math.sqrt(old @ old)
        assert lost >= 0.0 and length <= max(most / rigidity, before) * (1.0 + 1e-12)
        # what both half impulses do along the slip is what is stored and what is lost
        work = 0.5 * rigidity * (old + stick) @ moved
        stored = 0.5 * rigidity * (stick @ stick - old @ old)
        assert abs(work - stored - lost) < 1e-12 * rigidity * (1.0 + moved @ moved + old @ old)
        reversed_springs += length > most / rigidity * (1.0 + 1e-12)
    assert reversed_springs > 100


@pytest.mark.parametrize("limit", [0.2, 0.9, 5.0])
def test_the_linearised_stretch_is_the_derivative_of_the_return(limit):
    """Springs that slip, that keep some of their stretch, and that stick."""
    rng, stiffness, small = np.random.default_rng(7), 3.0, 1e-6
    seen = set()
    for _ in range(40):
        before, at, change = (tuple(one) for one in rng.standard_normal((3, 3)))
        more = float(rng.standard_normal())
        trial = tuple(a + c for a, c in zip(at, change))
        found = np.subtract(
            linear_return(before, at, limit, trial, stiffness, limit + more),
            linear_return(before, at, limit, at, stiffness, limit),
        )
        ends = []
        for sign in (1.0, -1.0):
            moved = tuple(a + sign * small * c for a, c in zip(at, change))
            ends.append(return_mapping(before, moved, stiffness, limit + sign * small * more)[0])
        wanted = np.subtract(*ends) / (2.0 * small)
        np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-7)
        seen.add(bool(np.dot(at, at) ** 0.5 * stiffness > limit))
    assert True in seen
