"""Order in time of the integrator, the internal variables and the energy ledger."""

import itertools

import numpy as np
import pytest
from solids import ONE_BRANCH, SOFT, evaluate, evolved, punch, run_to_end, simulation, supports, tables

NUMBERS = (12, 24, 48, 96)


def smooth(branches, **method) -> dict:
    return tables(
        (7, 7),
        material={**SOFT, "branches": branches},
        method=method,
        body={"velocity": ["0.3*sin(pi*X)*cos(Y)", "-0.4*Y*(1 + X)"]},
        boundaries=supports(X=(0.0, "roller"), Y=(0.0, "roller")),
    )


def after(branches, end: float, number: int) -> np.ndarray:
    """The whole state at a time after a number of equal steps."""
    sim = simulation(smooth(branches))
    for _ in range(number):
        sim.take_step(end / number)
    table = sim.systems[0].particles
    return {name: np.array(table.owned_rows(name)) for name in evolved(table)}


def orders(branches, end: float) -> dict[str, float]:
    """Observed order of every field, from the last three of four step sizes."""
    states = [after(branches, end, number) for number in NUMBERS]
    result = {}
    for name in states[0]:
        change = [np.abs(fine[name] - coarse[name]).max() for coarse, fine in itertools.pairwise(states)]
        assert change[-1] > 1e-14 * np.abs(states[-1][name]).max()
        result[name] = np.log2(change[-2] / change[-1])
    return result


def test_the_elastic_body_is_third_order_in_time():
    found = orders([], 0.6)
    assert set(found) == {"velocity", "position", "deformation_gradient", "jacobian"}
    assert all(order > 2.8 for order in found.values()), found


def test_internal_variables_are_second_order_in_time():
    found = orders([{"beta": 1.0, "tau": 0.2}], 0.6)
    assert "viscous_strain_inverse_1" in found
    assert all(order > 1.9 for order in found.values()), found


@pytest.mark.parametrize(
    "scene", [punch, lambda **keys: smooth(ONE_BRANCH, **keys["method"]) | {"end_time": 0.4}], ids=["punch", "smooth"]
)
def test_the_energy_balance_closes_with_the_time_step(scene):
    closure = []
    for cfl in (0.7, 0.35, 0.175):
        _, columns = run_to_end(scene(end_time=0.006, method={"cfl": cfl}))
        energy = columns["kinetic"][0] + columns["strain_energy"][0]
        closure.append(np.abs(columns["energy_error"]).max() / energy)
    assert closure[0] < 1e-2
    assert closure[0] > 5.0 * closure[1] and closure[1] > 5.0 * closure[2], closure


def test_a_step_of_nothing_changes_nothing():
    sim = simulation(smooth(ONE_BRANCH))
    table = sim.systems[0].particles
    sim.take_step(0.05)
    before = {name: np.array(array) for name, array in table.checkpointed().items()}
    found = evaluate(sim)
    sim.take_step(0.0)
    for name, array in table.checkpointed().items():
        np.testing.assert_allclose(array, before[name], rtol=1e-15, atol=1e-18, err_msg=name)
    np.testing.assert_allclose(evaluate(sim)["T"], found["T"], atol=1e-14 * np.abs(found["T"]).max())
