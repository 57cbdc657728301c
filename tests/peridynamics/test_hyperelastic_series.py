"""A Prony series on a neo-Hookean or Mooney-Rivlin solid: all of its stress relaxes."""

import numpy as np
import pytest
from peridynamics.bonds_of_bodies import random_field, scene
from solids import run_steps, simulation

TERMS = [{"ratio": 2.0, "tau": 0.3}]
BASES = {"neo-hookean": {"base": "neo-hookean"}, "mooney-rivlin": {"base": "mooney-rivlin", "area_share": 0.4}}
every_base = pytest.mark.parametrize("base", BASES)
SLOW = {"solution": {"kind": "quasi-static", "step": 0.1}}


def series(base, terms=None, tau=None) -> dict:
    """The material's tables."""
    terms = terms or ([{"ratio": 2.0, "tau": tau}] if tau else TERMS)
    return {"kind": "prony", "strain": "finite", **BASES[base], "terms": terms}


def elastic(base) -> dict:
    """The same solid without a series, mu = 3/2.6."""
    return {"kind": base} if base == "neo-hookean" else {"kind": base, "zeta": 0.2 * 3.0 / 2.6}


def moving(dimension, material, **more) -> dict:
    velocity = ["0.6*sin(2*X)", "0.4*X*X*Y", "0.2*Z*X*X"][:dimension]
    return scene(dimension, "fixed", material=material, jitter=0.0, body={"velocity": velocity}, **more)


def force_at(one, displacement, instantaneous) -> np.ndarray:
    """Force and stored energy of a displacement, reached in a jump or held for ever."""
    one.displacement[:] = displacement
    one.forces.start(instantaneous)
    return np.array(one.forces.force)


@pytest.mark.parametrize("dimension, base", list(zip((2, 3), BASES)))
def test_a_jump_finds_the_sum_and_time_leaves_the_solid(dimension, base):
    """Three times the elastic solid's force and energy just after a jump; one long after it, at large strain."""
    relaxing, solid = (
        simulation(scene(dimension, material=law, method=SLOW)).systems[0] for law in (series(base), elastic(base))
    )
    u = 0.3 * relaxing.particles.owned_rows("reference_position") ** 2 + 0.01 * random_field(relaxing, 1)
    of_solid = force_at(solid, u, True)
    energy = solid.forces.stored_energy()
    for instantaneous, factor in ((True, 3.0), (False, 1.0)):
        found = force_at(relaxing, u, instantaneous)
        np.testing.assert_allclose(found, factor * of_solid, atol=1e-12 * np.abs(of_solid).max())
        assert relaxing.forces.stored_energy() == pytest.approx(factor * energy, rel=1e-12)


@every_base
def test_forces_are_derivatives_of_the_energy_with_what_has_relaxed_frozen(base):
    """In a jump that follows two steps, so that the branches remember other deformations than that of the state."""
    energies = []
    for shift in (1e-4, -1e-4, 0.0):
        one = simulation(scene(2, material=series(base), method=SLOW)).systems[0]
        fields = [0.2 * one.particles.owned_rows("reference_position") ** k for k in (1, 2)]
        along = 0.01 * random_field(one, 3)
        force_at(one, 0.0 * along, True)
        for u, step in ((fields[0], 0.2), (fields[1], 0.1), (fields[1] + shift * along, 0.0)):
            one.displacement[:] = u
            force = one.forces.internal_force(step)
            one.forces.commit(step)
        energies.append(one.forces.stored_energy())
    power = float(np.vdot(force * one.share[:, None], along))
    assert (energies[1] - energies[0]) / 2e-4 == pytest.approx(power, rel=1e-6)


@pytest.mark.parametrize("dimension, base", list(zip((2, 3), BASES)))
def test_the_balance_closes_with_the_square_of_the_step(dimension, base):
    worst = []
    for safety, steps in ((0.2, 24), (0.1, 48)):
        method = {"solution": {"kind": "explicit", "safety": safety}}
        _, columns = run_steps(moving(dimension, series(base), method=method), steps)
        worst.append(np.abs(columns["energy_error"]).max() / columns["kinetic"].max())
        assert columns["material_dissipation"][-1] > 0.01 * columns["kinetic"].max()
    assert worst[0] < 5e-3 and worst[1] < 0.3 * worst[0]


@every_base
@pytest.mark.parametrize("tau", [1e-9, 1.0, 1e6])
def test_internal_dissipation_never_falls(base, tau):
    _, columns = run_steps(moving(2, series(base, tau=tau)), 40)
    assert np.diff(columns["material_dissipation"]).min() >= -1e-12 * columns["kinetic"].max()
    assert np.abs(columns["energy_error"]).max() < 0.05 * columns["kinetic"].max()


@every_base
def test_a_turned_body_bears_the_turned_force(base):
    """After a step at rest in a deformed state everything turns by 0.7 rad in a jump."""
    one = simulation(scene(2, material=series(base), method={**SLOW, "stabilisation": {"kind": "none"}})).systems[0]
    X = np.array(one.particles.owned_rows("reference_position"))
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s], [s, c]])
    force_at(one, 0.0 * X, True)
    one.displacement[:] = 0.3 * X**2
    force = np.array(one.forces.internal_force(0.1))
    one.forces.commit(0.1)
    one.displacement[:] = (X + 0.3 * X**2) @ turn.T - X
    turned = np.array(one.forces.internal_force(0.0))
    np.testing.assert_allclose(turned, force @ turn.T, atol=1e-12 * np.abs(force).max())


def test_a_small_strain_is_that_of_the_linear_solid(comm):
    """To the square of the strain, over a motion in which branches relax."""
    runs = []
    for law in (series("mooney-rivlin", tau=0.05), {"kind": "prony", "terms": [{"ratio": 2.0, "tau": 0.05}]}):
        data = moving(2, law, method={"stabilisation": {"kind": "none"}, "maximum_step": 0.01})
        data["bodies"][0]["velocity"] = ["1e-5*sin(2*X)", "1e-5*X*X*Y"]
        _, columns = run_steps(data, 30, comm)
        runs.append(columns)
    for name in ("kinetic", "strain_energy", "material_dissipation"):
        largest = runs[1]["kinetic"].max()
        np.testing.assert_allclose(runs[0][name], runs[1][name], atol=1e-3 * largest)


def test_plane_stress_is_refused(comm):
    with pytest.raises(ValueError, match="material.base: "):
        simulation(scene(2, material=series("neo-hookean"), method={"plane": "stress"}), comm)
