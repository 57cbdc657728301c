"""A body without Maxwell branches keeps and sends nothing of them; nor of shear waves where all have one speed."""

import numpy as np
import pytest
from solids import ONE_BRANCH, RUBBER, SOFT, column, punch, simulation, tables

PARTICLES = {2: (9, 9), 3: (6, 6, 6)}


def built(dimension, comm, **material):
    body = {"velocity": ["0.2*Y"] + ["0"] * (dimension - 1)}
    return simulation(tables(PARTICLES[dimension], material={**SOFT, **material}, body=body), comm)


def checkpoint_bytes(sim) -> int:
    return sum(array.nbytes for array in sim.systems[0].particles.checkpointed().values())


@pytest.mark.parametrize("dimension", [2, 3])
def test_no_array_and_no_byte_on_the_wire_or_in_the_checkpoint(dimension, comm):
    without, one = built(dimension, comm), built(dimension, comm, branches=ONE_BRANCH)
    assert without.systems[0].lists.slow is None
    mine, theirs = one.systems[0].particles, without.systems[0].particles
    assert not any("viscous" in name for name in theirs.fields)
    assert [name for name in mine.fields if name not in theirs.fields] == ["branches", "viscous_strain_inverse_1"]
    tensor = {2: 3, 3: 6}[dimension]
    assert checkpoint_bytes(one) - checkpoint_bytes(without) == 8 * tensor * one.systems[0].owned
    # the shear wave tensor goes with the branches; the motion is the same
    padded = {2: 4, 3: 8}[dimension]
    assert one.systems[0].lists.slow.shape[1] == padded
    sent = sum(len(rows) for rows in one.systems[0].lists.near.halo.plan.send_rows)
    assert one.systems[0].bytes_a_step() - without.systems[0].bytes_a_step() == 3 * 8 * padded * sent
    assert sent > 0 or comm.size == 1


@pytest.mark.parametrize("scene", [punch, lambda **keys: column((4, 5, 4))], ids=["2", "3"])
def test_branches_without_stiffness_are_none_to_the_bit(scene):
    states = []
    for branches in ([], [{"beta": 0.0, "tau": 0.02}]):
        data = scene()
        data["bodies"][0]["material"] = {**RUBBER, "branches": branches}
        sim = simulation(data)
        for _ in range(5):
            sim.take_step(0.5 * sim.systems[0].stable_step())
        states.append({name: np.array(array) for name, array in sim.systems[0].particles.checkpointed().items()})
    assert states[0].keys() == states[1].keys()
    for name, array in states[0].items():
        np.testing.assert_array_equal(array, states[1][name], err_msg=name)


def test_a_body_beside_one_with_branches_does_not_relax(dimension=2):
    data = tables(
        PARTICLES[dimension],
        material=SOFT,
        body={"velocity": ["0.3*X*Y"] + ["0.1*X"] * (dimension - 1), "name": "elastic"},
    )
    far = {"box": {"lower": [5.0] * dimension, "upper": [6.0] * dimension}}
    data["bodies"].append(
        {**data["bodies"][0], "name": "viscous", "shape": far, "material": {**SOFT, "branches": ONE_BRANCH}}
    )
    sim = simulation(data)
    alone = built(dimension, sim.comm)
    assert {len(block.moduli) for block in sim.systems[0].blocks} == {0, 1} and alone.systems[0].branches == 0
    for _ in range(5):
        sim.take_step(0.01)
    A = sim.systems[0].particles.owned_rows("viscous_strain_inverse_1")
    identity = np.array([1.0] * dimension + [0.0] * (A.shape[1] - dimension))
    elastic = sim.particle_sets[0].body == 0
    np.testing.assert_array_equal(A[elastic], np.tile(identity, (elastic.sum(), 1)))
    assert np.abs(A[~elastic] - identity).max() > 1e-3
