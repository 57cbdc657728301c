"""Bond-based constants and breaking criteria: the published formulas, and sums over all bonds of a fine lattice."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from parsolid.materials.damage.bond_based import influence_moment, micromodulus
from parsolid.materials.damage.fracture import breaking_limit, critical_bond_energy, critical_stretch
from parsolid.materials.viscoelastic.prony_stated import StatedProny
from parsolid.methods.peridynamics.bonds import INFLUENCES
from parsolid.methods.peridynamics.settings import Damage
from parsolid.scene.declared import model_of

E, GC, DELTA = 72e9, 135.0, 2e-3
K3 = E / (3.0 * (1.0 - 2.0 * 0.25))


@pytest.mark.parametrize("name", INFLUENCES)
@pytest.mark.parametrize("power", range(1, 5))
def test_moments_are_those_of_the_influence_function(name, power):
    exact = quad(lambda q: float(INFLUENCES[name](np.float64(q))) * q**power, 0.0, 1.0, points=[0.5])[0]
    assert influence_moment(name, power) == pytest.approx(exact, rel=1e-12)


PUBLISHED = {
    "space": (
        18.0 * K3 / (math.pi * DELTA**4),
        math.sqrt(5.0 * GC / (9.0 * K3 * DELTA)),
        4.0 * GC / (math.pi * DELTA**4),
    ),
    "plane-stress": (
        9.0 * E / (math.pi * DELTA**3),
        math.sqrt(4.0 * math.pi * GC / (9.0 * E * DELTA)),
        1.5 * GC / DELTA**3,
    ),
    "plane-strain": (
        9.6 * E / (math.pi * DELTA**3),
        math.sqrt(5.0 * math.pi * GC / (12.0 * E * DELTA)),
        1.5 * GC / DELTA**3,
    ),
    "bar": (2.0 * E / DELTA**2, math.sqrt(3.0 * GC / (E * DELTA)), 2.0 * GC / DELTA**2),
}


@pytest.mark.parametrize("state", PUBLISHED)
def test_published_formulas_for_the_constant_influence_function(state):
    c, stretch, energy = PUBLISHED[state]
    assert micromodulus(E, state, "constant", DELTA) == pytest.approx(c, rel=1e-12)
    assert critical_stretch(GC, E, state, "constant", DELTA) == pytest.approx(stretch, rel=1e-12)
    assert critical_bond_energy(GC, state, DELTA) == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("name", INFLUENCES)
@pytest.mark.parametrize("state, dimension", [("bar", 1), ("plane-stress", 2), ("plane-strain", 2), ("space", 3)])
def test_bonds_across_a_plane_hold_the_fracture_energy(state, dimension, name):
    # all bonds of one particle of a fine lattice; a bond that reaches z along the normal crosses z/dx planes of
    # particles
    cells = {1: 4000, 2: 200, 3: 40}[dimension]
    dx = DELTA / (cells + 0.5)
    line = np.arange(-cells, cells + 1) * dx
    bonds = np.stack(np.meshgrid(*[line] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    length = np.linalg.norm(bonds, axis=1)
    within = (length > 0.0) & (length < DELTA)
    bonds, length, volume = bonds[within], length[within], dx**dimension
    weight = np.array([float(INFLUENCES[name](np.float64(q))) for q in np.unique(length) / DELTA])[
        np.unique(length, return_inverse=True)[1]
    ]
    c = micromodulus(E, state, name, DELTA)
    # energy of a uniform stretch, half of each bond to either end
    nu = {"bar": 0.0, "plane-stress": 1.0 / 3.0}.get(state, 0.25)
    lame, G = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
    lame = 2.0 * lame * G / (lame + 2.0 * G) if state == "plane-stress" else lame
    exact = 0.5 * lame * dimension**2 + G * dimension
    assert 0.25 * np.sum(c * weight * length) * volume == pytest.approx(
        exact, rel={1: 1e-3, 2: 5e-3, 3: 2e-2}[dimension]
    )
    reach = np.maximum(bonds[:, 0], 0.0)
    broken = 0.5 * c * critical_stretch(GC, E, state, name, DELTA) ** 2 * weight * length
    assert np.sum(broken * reach) * volume == pytest.approx(GC, rel={1: 1e-3, 2: 5e-3, 3: 3e-2}[dimension])
    alike = critical_bond_energy(GC, state, DELTA) * np.sum(reach) * volume
    assert alike == pytest.approx(GC, rel={1: 1e-3, 2: 5e-3, 3: 3e-2}[dimension])


def test_which_modulus_counts():
    material = model_of(StatedProny)(
        kind="prony", density=1.0, youngs_modulus=1e6, poissons_ratio=0.3, terms=[{"ratio": 3.0, "tau": 1.0}]
    )
    for modulus, factor in (("equilibrium", 1.0), ("instantaneous", 4.0), (9e6, 9.0)):
        damage = Damage(fracture_energy=10.0, modulus=modulus)
        expected = critical_stretch(10.0, factor * 1e6, "space", "constant", 0.1)
        assert breaking_limit(damage, material, "space", "constant", 0.1) == pytest.approx(expected)
    assert breaking_limit(Damage(critical_stretch=0.02), material, "space", "constant", 0.1) == 0.02
    assert breaking_limit(Damage(criterion="energy", critical_bond_energy=3.0), material, "bar", "constant", 0.1) == 3.0
    by_energy = breaking_limit(Damage(criterion="energy", fracture_energy=3.0), material, "bar", "linear", 0.1)
    assert by_energy == pytest.approx(2.0 * 3.0 / 0.01)
