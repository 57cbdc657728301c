"""G(t) from E(t) for an elastic bulk: numbers of others, and the relation of the transforms."""

import numpy as np
import pytest

from parsolid.exact.linear_viscoelastic import PronySeries
from parsolid.materials.viscoelastic.interconversion import shear_relaxation


def test_the_plate_of_the_paper():
    # Galadima et al., section 8, converted exactly: G_1 = 20.9255 MPa, tau_G = 0.989989 s
    equilibrium, moduli, times = shear_relaxation(689e6, 6.89e6, [62.01e6], [1.0])
    assert equilibrium == pytest.approx(2.29922e6, rel=1e-6)
    assert moduli == pytest.approx([20.9255e6], rel=1e-6)
    assert times == pytest.approx([0.989989], rel=1e-6)


SERIES = {
    "ten terms over twelve decades": (5.0, np.geomspace(0.01, 8.0, 10), np.geomspace(1e-6, 1e6, 10)),
    "terms of hardly any stiffness": (5.0, [1e-12, 20.0, 1e-9], [1.0, 2.0, 2.1]),
    "terms of nearly the same time": (5.0, [3.0, 4.0, 5.0], [1.0, 1.0 + 1e-9, 1.0 + 2e-9]),
    "of the same time, and one of none": (5.0, [3.0, 4.0, 0.0], [1.0, 1.0, 7.0]),
    "stiff": (1e-3, [8.9e3], [1e-3]),
}


@pytest.mark.parametrize("name", SERIES)
def test_transforms_agree(name):
    E0, moduli, times = SERIES[name]
    K = 1.001 * (E0 + np.sum(moduli)) / 9.0
    E, G = PronySeries(E0, moduli, times), PronySeries(*shear_relaxation(K, E0, moduli, times))
    for s in np.geomspace(1e-8, 1e8, 50):
        young = E.operational(s)
        assert G.operational(s) == pytest.approx(3.0 * K * young / (9.0 * K - young), rel=1e-7)


def test_a_bulk_softer_than_a_ninth_of_youngs_modulus_is_refused():
    with pytest.raises(ValueError, match="nine times"):
        shear_relaxation(1.0, 5.0, [4.0], [1.0])
