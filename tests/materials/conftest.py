"""Laws with branches, with and without area term, and random states of them."""

import numpy as np
import pytest

from parsolid.materials.hyperelastic.mooney_rivlin import MooneyRivlin, NeoHookean

LAWS = {
    "neo-hookean": NeoHookean(1100.0, 3.0, 7.0, (2.0, 5.0), (0.1, 3.0)),
    "mooney-rivlin": MooneyRivlin(1100.0, 3.0, 2.0, 7.0, (2.0, 5.0), (0.1, 3.0)),
}


@pytest.fixture(params=LAWS.values(), ids=LAWS)
def viscous(request):
    """The laws in turn."""
    return request.param


@pytest.fixture
def random():
    """The same random numbers in every run."""
    return np.random.default_rng(20240611)


@pytest.fixture
def random_deformation(random):
    """Deformation gradients (n, 3, 3) with J > 0.2, as far from the identity as `spread` says."""

    def make(count, spread=0.3):
        F = np.eye(3) + spread * random.standard_normal((4 * count, 3, 3))
        F = F[np.linalg.det(F) > 0.2]
        assert len(F) >= count
        return F[:count]

    return make


@pytest.fixture
def random_branches(random_deformation):
    """Internal variables A (n, m, 3, 3), symmetric and positive definite."""

    def make(count, branches, spread=0.3):
        G = random_deformation(count * branches, spread).reshape(count, branches, 3, 3)
        return np.swapaxes(G, -1, -2) @ G

    return make
