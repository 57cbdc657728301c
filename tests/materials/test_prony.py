"""Prony series.

stress, energy and dissipation against each other and against closed forms, in every state of strain.
"""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad

from parsolid.exact.linear_viscoelastic import PronySeries
from parsolid.materials.viscoelastic import prony
from parsolid.materials.viscoelastic.prony_stated import StatedProny
from parsolid.scene.declared import model_of

STATES = ["space", "plane-strain", "plane-stress", "bar"]
RATIOS, TIMES = (2.0, 0.7), (0.3, 5.0)
# components that may be prescribed, and how often each counts in a power
GIVEN = {"space": range(6), "plane-strain": (0, 1, 3), "plane-stress": (0, 1, 3), "bar": (0,)}
TWICE = np.array([1, 1, 1, 2, 2, 2])


def solid(bulk="relaxing", dimension=3, **changes):
    """A material as a scene would give it."""
    tables = dict(kind="prony", density=1000.0, youngs_modulus=7.0, poissons_ratio=0.4, bulk=bulk)
    tables["terms"] = [{"ratio": ratio, "tau": time} for ratio, time in zip(RATIOS, TIMES)]
    return model_of(StatedProny).model_validate({**tables, **changes}, context={"dimension": dimension})


@pytest.fixture(params=STATES)
def state(request):
    """Every state of strain in turn."""
    return request.param


@pytest.fixture(params=["relaxing", "elastic"])
def law(request, state):
    """The two formulations."""
    return prony.of_material(solid(request.param), state)


def test_the_relaxed_modulus_is_the_one_of_the_state_of_strain(state):
    """lambda + 2 G, the stress over a strain along one axis, in Young's modulus and Poisson's ratio."""
    law, E, nu = prony.of_material(solid(), state), 7.0, 0.4
    constrained = E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
    expected = {"space": constrained, "plane-strain": constrained, "plane-stress": E / (1.0 - nu**2), "bar": E}[state]
    assert law.first_lame + 2.0 * law.shear_modulus == pytest.approx(expected, rel=1e-14)


def branch(law, a, b):
    return prony.branch_form(prony.linear_solid(law), a, b)


def has_lateral_history(law) -> bool:
    """Whether the strain along free directions is a history variable."""
    return prony.linear_solid(law).lateral > 0.0


class Point:
    """A law along strains (6,), step by step; lateral components are found."""

    def __init__(self, law, state):
        self.law = law
        self.strain, self.branches = np.zeros(6), np.zeros((law.terms, 6))
        self.stress, self.dissipation = np.zeros(6), 0.0

    def advance(self, strain, step):
        law, ratios = self.law, np.array(self.law.ratios)
        weights = np.array([prony.branch_weights(step, time) for time in law.relaxation_times])
        new = np.array(strain, float)
        solid = prony.linear_solid(law)
        relaxing = new + ratios @ (weights[:, :1] * self.branches + weights[:, 1:] * (new - self.strain))
        if has_lateral_history(law):
            new, relaxing = prony.with_lateral(solid, tuple(new), tuple(relaxing), float(ratios @ weights[:, 1]))
        stress = prony.linear_stress(solid, tuple(new), tuple(relaxing))
        new = np.array(new)
        change = new - self.strain
        for j, time in enumerate(law.relaxation_times):
            c, d, e = prony.dissipation_weights(step, time)
            start, moved = tuple(self.branches[j]), tuple(change)
            lost = c * branch(law, start, start) + d * branch(law, start, moved) + e * branch(law, moved, moved)
            self.dissipation += 2.0 * ratios[j] * lost
        self.branches = weights[:, :1] * self.branches + weights[:, 1:] * change
        self.strain, self.stress = new, np.array(stress)
        return self

    @property
    def stored(self):
        each = [branch(self.law, tuple(e), tuple(e)) for e in self.branches]
        strain = tuple(self.strain)
        return prony.equilibrium_form(prony.linear_solid(self.law), strain, strain) + np.array(self.law.ratios) @ each


def direction_of(state):
    """Strain of the prescribed components."""
    values = np.array([1.0, -0.4, 0.3, 0.5, -0.2, 0.7])
    return np.where(np.isin(np.arange(6), list(GIVEN[state])), values, 0.0)


@pytest.mark.parametrize("x", 10.0 ** np.arange(-10.0, 9.0))
def test_weights_of_a_step(x):
    tau = 3.0
    a, A = prony.branch_weights(x * tau, tau)
    assert a == pytest.approx(np.exp(-x), rel=1e-14)
    assert A == pytest.approx(-np.expm1(-x) / x, rel=1e-14)
    # integral over the step of 2/tau (e0 exp(-s/tau) + r tau (1 - exp(-s/tau)))^2 for e0, r: by quadrature in s/tau
    parts = prony.dissipation_weights(x * tau, tau)
    decay, rise = (lambda s: np.exp(-s)), (lambda s: -np.expm1(-s) / x)
    integrands = (lambda s: decay(s) ** 2, lambda s: 2.0 * decay(s) * rise(s), lambda s: rise(s) ** 2)
    for part, integrand in zip(parts, integrands):
        breaks = [0.0, *(b for b in (1.0, 10.0, 40.0, 1e3) if b < x), x]
        exact = sum(quad(integrand, low, high, epsabs=0.0, epsrel=1e-13)[0] for low, high in itertools.pairwise(breaks))
        assert part == pytest.approx(exact, rel=3e-12)


def test_the_stress_is_the_derivative_of_the_energy_in_a_jump(law, state):
    start = Point(law, state).advance(0.1 * direction_of(state), 0.4)
    history = start.strain, start.branches

    def after(strain):
        point = Point(law, state)
        point.strain, point.branches = history
        return point.advance(strain, 0.0)

    at = 0.1 * direction_of(state) + np.where(direction_of(state) != 0.0, 0.03, 0.0)
    stress, h = after(at).stress, 1e-4
    for c in GIVEN[state]:
        aside = h * (np.arange(6) == c)
        slope = (after(at + aside).stored - after(at - aside).stored) / (2.0 * h)
        assert slope == pytest.approx(TWICE[c] * stress[c], rel=1e-9)
    assert after(at).dissipation == 0.0


def test_nothing_pulls_along_free_directions(law, state):
    point = Point(law, state)
    for step in (0.0, 0.1, 2.0, 50.0):
        point.advance((1.0 + step) * direction_of(state), step)
        free = {"plane-stress": [2], "bar": [1, 2]}.get(state, [])
        assert np.abs(point.stress[free]).max(initial=0.0) <= 1e-15 * np.abs(point.stress).max()
        if has_lateral_history(law):
            # before what is set to zero for rounding: K tr(e) + 2 G dev(e~) along the free direction
            relaxing = point.strain + np.array(law.ratios) @ point.branches
            pull = law.bulk_modulus * point.strain[:3].sum() + 2.0 * law.shear_modulus * (
                relaxing[2] - relaxing[:3].sum() / 3.0
            )
            assert abs(pull) <= 1e-13 * law.bulk_modulus * np.abs(point.strain).max()


def test_work_is_stored_or_dissipated(law, state):
    # strain is linear over the whole step, or where a lateral strain follows, nearly so over short ones
    points, gauss = np.polynomial.legendre.leggauss(16)
    times = [*(0.35 * (points + 1.0)), 0.7]
    counts = (1,) if not has_lateral_history(law) else (4, 8, 16)
    errors = []
    for pieces in counts:
        end, work = Point(law, state), 0.0
        for piece in range(pieces):
            start = (end.strain, end.branches, end.dissipation)
            for k, part in enumerate(times):
                end = Point(law, state)
                end.strain, end.branches, end.dissipation = start
                end.advance(direction_of(state) * (piece * 0.7 + part) / pieces, part / pieces)
                if k < len(points):
                    work += 0.5 * gauss[k] * end.stress @ (TWICE * direction_of(state)) * 0.7 / pieces
        errors.append(abs(end.stored + end.dissipation - work) / work)
    if not has_lateral_history(law):
        assert errors[0] <= 1e-12
    else:
        # the lateral strain is linear over a step only in the limit, which is approached with the square of the step
        assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.2), errors
    assert end.dissipation > 0.0


def test_a_bar_follows_the_relaxation_function_exactly():
    law = prony.of_material(solid(dimension=1, poissons_ratio=None), "bar")
    series, point, time, strain = PronySeries(7.0, 7.0 * np.array(RATIOS), TIMES), Point(law, "bar"), 0.0, 0.0
    knots = [(0.0, 0.0), (0.0, 0.02)]
    point.advance([0.02, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0)
    for step, strain in ((0.1, 0.05), (3.0, -0.01), (1e-6, -0.01), (0.0, 0.03), (20.0, 0.03)):
        time += step
        point.advance([strain, 0.0, 0.0, 0.0, 0.0, 0.0], step)
        knots.append((time, strain))
        # superposition of jumps and ramps of the strain, each with E(t) or its integral
        exact = sum(
            (after - before)
            * (series.relaxation(time - begin) if end == begin else average(series, time - end, time - begin))
            for (begin, before), (end, after) in itertools.pairwise(knots)
        )
        assert point.stress[0] == pytest.approx(exact, rel=1e-12)


def average(series, low, high):
    """Mean of E(t) between two times [s]."""
    integral = sum(E * tau * (np.exp(-low / tau) - np.exp(-high / tau)) for E, tau in zip(series.moduli, series.times))
    return series.equilibrium + integral / (high - low)


def test_creep_of_a_bar():
    # Galadima et al., section 8.1: strain 0.1 (1 - 0.9 exp(-t/10)), a jump and then equal steps of constant stress
    terms = [{"modulus": 62.01e6, "tau": 1.0}]
    law = prony.of_material(solid(dimension=1, youngs_modulus=6.89e6, poissons_ratio=None, terms=terms), "bar")
    point, errors = Point(law, "bar"), {}
    for steps in (100, 200):
        point = Point(law, "bar").advance([0.01, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0)
        assert point.stress[0] == pytest.approx(0.689e6, rel=1e-13)
        step = 10.0 / steps
        for _ in range(steps):
            # the stress is linear in the strain at the end of the step
            held = Point(law, "bar")
            held.strain, held.branches = point.strain, point.branches
            slope = prony.algorithmic_factor(law, step) * 6.89e6
            there = held.advance(point.strain, step).stress[0]
            point.advance([point.strain[0] + (0.689e6 - there) / slope, 0.0, 0.0, 0.0, 0.0, 0.0], step)
        errors[steps] = abs(point.strain[0] - 0.0668909)
    assert errors[200] <= 1e-4 * 0.0668909
    assert np.log2(errors[100] / errors[200]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("conversion, equilibrium, instantaneous", [("exact", 6.89e6, 68.9e6), ("paper", 6.89e6, None)])
def test_an_elastic_bulk_gives_back_the_relaxation_of_youngs_modulus(conversion, equilibrium, instantaneous):
    # a bar at constant strain: the stress is E(t) times the strain, though only the shear modulus relaxes
    terms = [{"modulus": 62.01e6, "tau": 1.0}]
    constants = {"youngs_modulus": 6.89e6, "poissons_ratio": None, "bulk_modulus": 689e6}
    material = solid("elastic", terms=terms, conversion=conversion, **constants)
    law = prony.of_material(material, "bar")
    point, step = Point(law, "bar").advance([0.01, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0), 0.02
    if instantaneous:
        assert point.stress[0] == pytest.approx(instantaneous * 0.01, rel=1e-12)
    else:
        # the ratios of E(t) are not quite those of G(t): G(0+) is 22.99 MPa instead of 23.22 MPa
        assert prony.algorithmic_factor(law, 0.0) * law.shear_modulus == pytest.approx(22.9922e6, rel=1e-5)
    for _k in range(150):
        point.advance([0.01, 0.0, 0.0, 0.0, 0.0, 0.0], step)
    series = PronySeries(equilibrium, [62.01e6], [1.0])
    expected = 0.01 * series.relaxation(3.0)
    assert point.stress[0] == pytest.approx(expected, rel=1e-5 if instantaneous else 2e-2)


def test_wave_moduli_are_the_stiffness_of_a_jump(law, state):
    sigma = Point(law, state).advance(np.eye(6)[0], 0.0).stress
    assert prony.pressure_wave_modulus(law) == pytest.approx(sigma[0], rel=1e-13)
    settled = Point(law, state).advance(np.eye(6)[0], 0.25).stress
    assert prony.pressure_wave_modulus(law, 0.25) == pytest.approx(settled[0], rel=1e-13)


def test_strains_of_a_displacement_gradient(random):
    G = 0.3 * random.standard_normal((3, 3))
    names = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    small = prony.strain_of(prony.linear_solid(prony.of_material(solid(), "space")), tuple(G.ravel()))
    large = prony.strain_of(prony.linear_solid(prony.of_material(solid(strain="finite"), "space")), tuple(G.ravel()))
    assert small == pytest.approx([0.5 * (G + G.T)[name] for name in names])
    assert large == pytest.approx([0.5 * (G + G.T + G.T @ G)[name] for name in names])
