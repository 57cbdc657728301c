"""The elastic-plastic step on tiles: return to the flow stress, heat, rotation, neighbours."""

import numpy as np
import pytest

from parsolid.materials.hyperelastic.evaluation import symmetric_tensors
from parsolid.materials.plastic import plastic_evaluation as evaluation
from parsolid.materials.plastic import tile_update as update
from parsolid.materials.registry import law_of
from parsolid.methods.mpm.elastic_plastic import advance_deformation
from parsolid.scene.plasticity import library

LAWS = {name: law_of(material) for name, material in library().items() if name.startswith("OFHC copper")}
STEP = 1e-7


@pytest.fixture(params=LAWS.values(), ids=LAWS)
def law(request):
    """Every flow stress of the library in turn."""
    return request.param


def tile_of(law, gradients):
    """A tile of particles at rest with velocity gradients (n, 3, 3), and its rows."""
    tile = update.new_tile()
    update.fill_idle(law, tile, 0)
    rows = tile.reshape(-1, update.TILE)
    rows[update.VELOCITY_GRADIENT : update.VELOCITY_GRADIENT + 9, : len(gradients)] = gradients.reshape(-1, 9).T
    return tile, rows


def advance(law, tile, steps=1, plane=None):
    for _ in range(steps):
        advance_deformation(STEP, plane, tile)
        update.start_step(law, None, tile)
        update.flow(law, None, STEP, tile)
        update.finish_step(law, None, STEP, tile)


def gradients(random, count=update.TILE):
    """Velocity gradients [1/s] of strains to 1 % in a step, without a change of volume beyond what metals take."""
    values = random.uniform(-1e5, 1e5, (count, 3, 3))
    return values - np.trace(values, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)


def test_the_stress_is_on_the_flow_stress_and_its_work_is_heat(law, random):
    tile, rows = tile_of(law, gradients(random))
    advance(law, tile, 3)
    before, J, start = rows[update.TEMPERATURE].copy(), rows[update.NEW_JACOBIAN].copy(), rows[update.ENERGY].copy()
    advance(law, tile)
    s = symmetric_tensors(rows[update.DEVIATOR : update.DEVIATOR + 6].T)
    mises = np.sqrt(1.5 * np.einsum("nij,nij->n", s, s))
    work = rows[update.PLASTIC_WORK]
    assert (rows[update.INCREMENT] > 0.0).all()
    # the return knows the heat of its own flow, but neither that of compression nor a change of the moduli
    warm = before + law.taylor_quinney * work / rows[update.CAPACITY]
    mu, melting = rows[update.SHEAR_MODULUS], rows[update.MELTING]
    wanted = [
        flow(law, *state)
        for state in zip(rows[update.PLASTIC_STRAIN], rows[update.INCREMENT] / STEP, warm, mu, melting)
    ]
    assert mises == pytest.approx(np.array(wanted), rel=1e-8)
    assert work == pytest.approx(rows[update.NEW_JACOBIAN] * mises * rows[update.INCREMENT], rel=1e-12)
    # E is what the pressure and the deviator have done
    pressure = evaluation.pressure(law, J, start)
    assert rows[update.PRESSURE] == pytest.approx(
        evaluation.pressure(law, rows[update.NEW_JACOBIAN], rows[update.ENERGY]), rel=1e-10, abs=1.0
    )
    assert np.isfinite(pressure).all() and (rows[update.ROOM] > 0.0).all()


def flow(law, *state):
    """The flow stress of one state."""
    from parsolid.materials.plastic.functions import flow_stress

    return flow_stress(law.flow_stress, *state)


def test_a_particle_does_not_feel_those_beside_it(law, random):
    L, order = gradients(random), random.permutation(update.TILE)
    (one, rows), (other, mixed) = tile_of(law, L), tile_of(law, L[order])
    advance(law, one, 5)
    advance(law, other, 5)
    results = slice(0, update.ROTATION)
    assert np.array_equal(rows[results][:, order], mixed[results])


def test_a_rotation_makes_no_stress_and_plane_strain_is_that_of_space(random):
    law = LAWS["OFHC copper, Johnson-Cook"]
    turn = np.linalg.qr(random.standard_normal((update.TILE, 3, 3)))[0]
    turn *= np.linalg.det(turn)[:, None, None]
    # by less than half a turn, whatever the step
    turn = turn[np.trace(turn, axis1=1, axis2=2) > 0.0]
    tile, rows = tile_of(law, (turn - np.eye(3)) / STEP)
    advance_deformation(STEP, None, tile)
    assert np.abs(rows[update.STRAIN : update.STRAIN + 6]).max() < 1e-12
    L = gradients(random)
    L[:, 2, :2], L[:, :2, 2] = 0.0, 0.0
    (one, rows), (other, plane) = tile_of(law, L), tile_of(law, L)
    advance(law, one, 5)
    advance(law, other, 5, plane=1.0)
    assert rows[: update.ROTATION] == pytest.approx(plane[: update.ROTATION], rel=1e-5, abs=1e-5)
