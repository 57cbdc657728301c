"""Particles that may change their rank are dealt out by what all steps cost each, here by a clock of our own."""

import numpy as np
import pytest
from mixed.test_methods_meet import CLOSING, SPEED, bars, momenta
from mpi4py import MPI
from solids import Record, follow

from decomposition.measured_load import shares_of
from parsolid.methods.mpm import cells
from parsolid.pairs import verlet_list
from parsolid.scene import SceneError, parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.loop import Simulation

COST = 1e-3


def timed(data: dict) -> dict:
    """The tables of a scene with particles that are dealt out by measured times."""
    for method in data["methods"]:
        if method["kind"] in ("mpm", "ulsph"):
            method["balance"] = "measured"
    return data


def test_shares_even_out_what_ranks_are_busy_with():
    count, others = np.array([50.0, 50.0, 50.0]), np.array([0.06, 0.0, 0.0])
    shares = shares_of(COST * np.ones(3), others, count)
    assert shares.sum() == pytest.approx(1.0) and shares[0] < shares[1] == shares[2]
    for _ in range(8):
        found = shares_of(COST * np.ones(3), others, count)
        if found is None:
            break
        count = found * 150.0
    busy = COST * count + others
    assert found is None and busy.max() < 1.05 * busy.mean()
    # a rank that is busier than all with any particle has none left in the end
    # one on which a particle costs more has fewer
    dear = shares_of(COST * np.array([2.0, 1.0, 1.0]), np.zeros(3), np.full(3, 50.0))
    assert dear[0] == pytest.approx(0.5 * (1 / 3 + 1 / 5))
    busy = shares_of(COST * np.ones(3), np.array([9.0, 0.0, 0.0]), np.array([50.0, 50.0, 50.0]))
    assert busy is None or busy[0] == pytest.approx(1 / 6)
    assert shares_of(COST * np.ones(3), np.zeros(3), np.array([50.0, 50.0, 50.0])) is None


@pytest.mark.parametrize("kind", ["points", "flow"])
def test_a_rank_that_is_busy_with_another_method_gets_fewer_points_and_the_motion_stays(comm, monkeypatch, kind):
    for module in (cells, verlet_list):
        monkeypatch.setattr(module, "_LOOKS", 1)
    data = bars("sph", kind, end_time=10.0 / SPEED)
    for body in data["bodies"]:
        body["velocity"][0] *= 3.0
    scene, timed_scene = parse_scene(data), parse_scene(timed(data))
    whole = follow(Simulation(MPI.COMM_SELF, scene), Record(momenta), 50)
    sim = Simulation(comm, timed_scene)

    class Clock(list):
        """Seconds of the two systems that follow from what rank 0 has to do, whatever the machine does."""

        def __array__(self, *arguments, **keys):
            # of all steps so far: points cost what they do now from here on
            self.append(COST * sim.systems[1].owned)
            return np.array([COST * 40.0 * (comm.rank == 0) * len(self), sum(self)])

    if comm.size > 1:
        sim.systems[1].follow_work(Clock(), 1)
    found = follow(sim, Record(momenta), 50)
    for name in ("kinetic", stored_energy(whole), "contact_energy", "energy_error", "momenta"):
        scale = np.abs(whole["momenta" if name == "momenta" else "kinetic"]).max()
        np.testing.assert_allclose(found[name], whole[name], rtol=0.0, atol=1e-9 * scale, err_msg=name)
    assert whole["contact_energy"].max() > 1e-3 * 25.0 * (3.0 * CLOSING) ** 2
    if comm.size > 1:
        told = sim.systems[1].summary()
        first, last = (told["measured_imbalance"][name] for name in ("first", "last"))
        assert told["migrated_particles"] > 0
        assert last < first - 0.1 and first > 1.2


def test_one_method_alone_has_nothing_to_even_out():
    data = timed(bars("points", "points", contact=[]))
    with pytest.raises(SceneError, match=r"methods.0.balance: expected 'particles' where there is one method"):
        parse_scene(data)
