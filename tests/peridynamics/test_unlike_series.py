"""Bodies with Prony series of their own in one scene, elastic ones beside viscoelastic ones, bonded to each other."""

import copy

import numpy as np
import pytest
from peridynamics.bonds_of_bodies import gathered, random_field, scene, stiffness
from solids import run_steps, simulation

ONE, TWO = [{"ratio": 2.0, "tau": 0.3}], [{"ratio": 1.5, "tau": 0.3}, {"ratio": 0.5, "tau": 0.3}]
LAWS = {
    "relaxing": {"kind": "prony"},
    "elastic bulk": {"kind": "prony", "bulk": "elastic"},
    "finite strain": {"kind": "prony", "strain": "finite"},
    "hyperelastic": {"kind": "mooney-rivlin", "zeta": 0.1},
}
every_law = pytest.mark.parametrize("law", LAWS)


def material(law, terms) -> dict:
    """A law with the terms of a series, as branches where it is hyperelastic."""
    if LAWS[law]["kind"] == "prony":
        return {**LAWS[law], "terms": terms}
    return {**LAWS[law], "branches": [{"beta": term["ratio"], "tau": term["tau"]} for term in terms]}


def beside(dimension, first, second, **more) -> dict:
    """A body, and beside it another of the same size, in which a smooth motion starts."""
    velocity = ["0.3*sin(2*X)", "0.2*X*X*Y", "0.1*Z*X*X"][:dimension]
    data = scene(dimension, more.pop("planes", "fixed"), material=first, body={"velocity": velocity}, **more)
    other = copy.deepcopy(data["bodies"][0])
    box = other["shape"]["box"]
    box["lower"][0], box["upper"][0] = 1.0, 2.0
    other["material"] = {**other["material"], **second}
    for key in ("terms", "branches"):
        if key in other["material"] and key not in second:
            del other["material"][key]
    data["bodies"].append(other)
    return data | {"bond": [{"bodies": "all"}]}


@every_law
def test_a_series_is_the_same_with_its_terms_in_two(comm, law):
    """One law written in two ways: the bonds between the bodies are those of one body."""
    runs = []
    for second in (ONE, TWO):
        sim, columns = run_steps(beside(2, material(law, ONE), material(law, second), jitter=0.0), 15, comm)
        one = sim.systems[0]
        runs.append((gathered(one, np.array(one.displacement)), columns))
    largest = np.abs(runs[0][0]).max()
    np.testing.assert_allclose(runs[1][0], runs[0][0], atol=1e-11 * largest)
    for name in ("strain_energy", "material_dissipation"):
        np.testing.assert_allclose(runs[1][1][name], runs[0][1][name], atol=1e-11 * runs[0][1]["kinetic"].max())


@pytest.mark.parametrize("dimension, law", [*((2, law) for law in LAWS), (3, "finite strain")])
def test_elastic_beside_viscoelastic_closes_its_balance_with_the_square_of_the_step(dimension, law):
    worst = []
    for safety, steps in ((0.2, 20), (0.1, 40)):
        method = {"solution": {"kind": "explicit", "safety": safety}}
        data = beside(dimension, material(law, []), material(law, ONE), jitter=0.0, method=method)
        _, columns = run_steps(data, steps)
        worst.append(np.abs(columns["energy_error"]).max() / columns["kinetic"].max())
        assert columns["material_dissipation"][-1] > 0.005 * columns["kinetic"].max()
        assert np.diff(columns["material_dissipation"]).min() > 0.0
    assert worst[0] < 5e-3 and worst[1] < 0.3 * worst[0]


@pytest.mark.parametrize("control", ["shear-scaled", "none"])
def test_what_has_only_been_moved_bears_no_force(comm, control):
    """On irregular particles, while branches relax: with one relaxing displacement for all, bonds between the bodies
    would pull.
    """
    method = {"stabilisation": {"kind": control}, "solution": {"kind": "quasi-static", "step": 0.1}}
    one = simulation(
        beside(2, material("relaxing", []), material("relaxing", ONE), planes="free", method=method), comm
    ).systems[0]
    forces, place = one.forces, one.particles.owned_rows("reference_position")
    for step, turn in ((0.1, [0.3, -0.2, 0.4]), (0.2, [0.1, 0.5, -0.7])):
        one.displacement[:] = np.array(turn[:2]) + turn[2] * np.stack((-place[:, 1], place[:, 0]), axis=1)
        force = forces.internal_force(step)
        assert comm.allreduce(float(np.abs(force).max(initial=0.0)), max) < 1e-12
        forces.commit(step)
    assert comm.allreduce(float(np.abs(forces.stored_energy()))) < 1e-12


@every_law
def test_forces_are_derivatives_of_the_energy(law):
    """In a jump from rest, nothing having relaxed: by central differences along a random direction."""
    method = {"solution": {"kind": "quasi-static", "step": 0.1}}
    one = simulation(beside(2, material(law, ONE), material(law, []), planes="free", method=method)).systems[0]
    base, along = (0.01 * random_field(one, seed) for seed in (1, 2))
    energies = []
    for shift in (1e-5, -1e-5):
        one.displacement[:] = base + shift * along
        one.forces.start(True)
        energies.append(one.forces.stored_energy())
    one.displacement[:] = base
    one.forces.start(True)
    power = float(np.vdot(one.forces.force * one.share[:, None], along))
    assert (energies[1] - energies[0]) / 2e-5 == pytest.approx(power, rel=1e-7)


def test_the_stiffness_of_a_step_is_that_of_its_forces():
    method = {"solution": {"kind": "quasi-static", "step": 0.1}}
    one = simulation(
        beside(2, material("relaxing", ONE), material("elastic bulk", [{"ratio": 1.0, "tau": 0.05}]), method=method)
    ).systems[0]
    u, v = random_field(one, 1), random_field(one, 2)
    Ku, Kv = stiffness(one, u, 0.1), stiffness(one, v, 0.1)
    assert abs(np.vdot(u, Kv) - np.vdot(v, Ku)) < 1e-12 * np.linalg.norm(u) * np.linalg.norm(Kv)
    force = np.empty_like(u)
    one.operator.force(u, force, 0.1)
    np.testing.assert_allclose(force * one.operator.free, -Ku, atol=1e-12 * np.abs(Ku).max())


def creeping(count, seconds=2.0) -> dict:
    """Two bars in a row under a load, of which the second does not relax."""
    pull = [{"kind": "roller", "plane": "X = 0"}, {"kind": "traction", "plane": "X = 2", "traction": ["1e-3"]}]
    data = beside(1, material("relaxing", ONE), material("relaxing", []), planes="free", jitter=0.0)
    for body in data["bodies"]:
        body.update(particles=[count], velocity=["0"])
    data["boundaries"], data["end_time"] = pull, seconds
    data["method"] = {"kind": "peridynamics", "solution": {"kind": "quasi-static", "step": 0.05}}
    return data


@pytest.mark.serial
def test_two_bars_in_a_row_creep_each_by_its_own_series(comm):
    """J(t) = (1 - 2/3 exp(-t/(3 tau)))/E of the first, 1/E of the second; the joint blurs over the horizon."""
    errors = []
    # no multiples of four: records of particles are made four at a time
    for count in (17, 33, 65):
        sim, columns = run_steps(creeping(count), 0, comm)
        one = sim.systems[0]
        for step in (0.0, *[0.05] * 40):
            sim.take_step(step)
        u, x = (gathered(one, np.array(values)) for values in (one.displacement, one.particles.owned_rows("position")))
        place = gathered(one, np.array(one.particles.owned_rows("reference_position")))[:, 0]
        creep = (1.0 - 2.0 / 3.0 * np.exp(-2.0 / 0.9)) / 3.0
        exact = 1e-3 * np.where(place < 1.0, creep * place, creep + (place - 1.0) / 3.0)
        errors.append(np.abs(u[:, 0] - exact).max() / exact.max())
        assert abs(sim.energy_row()["energy_error"]) < 1e-9 * sim.energy_row()["strain_energy"]
    assert errors[2] < 5e-3 and errors[1] < 0.6 * errors[0] and errors[2] < 0.6 * errors[1]


def test_an_energy_of_bonds_is_refused(comm):
    damage = {"criterion": "energy", "critical_bond_energy": 1.0}
    data = beside(2, material("relaxing", ONE), material("relaxing", []), method={"damage": damage})
    with pytest.raises(ValueError, match="damage.criterion: "):
        simulation(data, comm)
