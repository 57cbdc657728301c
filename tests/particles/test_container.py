"""The particles of a rank: what follows from declared fields."""

import numpy as np
import pytest

from decomposition.halo import Halo
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Rows, Within


def particles(count=16) -> Particles:
    body = np.sort(np.arange(count) % 3)
    result = Particles(body, np.array([0, 0, 1]))
    result.declare(Field("identifier", 1, "1", whole=True), np.arange(count))
    result.declare(Field("motion", 8, "", padding=(7.0,) * 8))
    result.declare(Field("place", 2, "m", layout=Within("motion", 0)), np.arange(2 * count).reshape(count, 2))
    result.declare(Field("strain", 5, "1", layout=Columns()), np.arange(5 * count).reshape(count, 5))
    result.declare(Field("heat", 1, "K", layout=Columns()), np.arange(count))
    result.declare(Field("scratch", 3, "1", carried=False))
    return result


def agree(found: Particles) -> None:
    """Every field still belongs to its particle, and the materials are apart."""
    n, names = found.owned, found["identifier"][: found.owned]
    assert np.array_equal(found["heat"][:n], names)
    assert np.array_equal(found["place"][:n], np.stack((2 * names, 2 * names + 1), axis=1))
    assert np.array_equal(found["strain"][:n, 4], 5 * names + 4)
    law = found.law_of_body[found["body"][:n]]
    assert np.array_equal(np.searchsorted(law, np.arange(3)), found.bounds)
    assert (np.diff(law) >= 0).all()


def test_rows_beyond_the_owned_hold_the_padding():
    found = particles()
    assert found.storage("motion")[16:].tolist() == [[7.0] * 8] * 8


def test_particles_come_go_and_change_places():
    found, random = particles(), np.random.default_rng(1)
    chosen = found.selection(found["identifier"][:16] % 4 == 1)
    away = found.packed(np.array([1, 5, 13]))
    gone = sorted(found["identifier"][[1, 5, 13]])
    found.remove(np.array([1, 5, 13]))
    agree(found)
    assert sorted(found["identifier"][chosen.rows]) == [n for n in (1, 5, 9, 13) if n not in gone]
    found.reorder(random.permutation(found.owned))
    agree(found)
    found.insert(away)
    agree(found)
    assert sorted(found["identifier"][chosen.rows]) == [1, 5, 9, 13]


def test_arrays_grow_and_selections_follow():
    found = particles()
    few = [found.selection(found["identifier"][:16] == k) for k in range(16)] * 5
    more = [found.selection(found["identifier"][:16] == k) for k in range(70)]
    copies = found.packed(np.arange(16))
    for _ in range(3):
        found.insert(copies)
    assert found.owned == 64 and found.growths > 0
    agree(found)
    assert [len(one) for one in few[:16]] == [4] * 16
    assert [len(one) for one in more] == [4] * 16 + [0] * 54
    assert found["identifier"][more[7].rows].tolist() == [7] * 4


def test_a_checkpoint_is_put_back():
    found = particles()
    kept = {name: values.copy() for name, values in found.checkpointed().items()}
    found.owned_rows("body")[:] = 9
    found.restore(kept)
    assert found["body"][:16].tolist() == kept["body"].tolist()


def test_a_second_field_of_a_name_is_refused():
    with pytest.raises(ValueError, match="expected one of the name heat"):
        particles().declare(Field("heat", 1, "K"))


def test_ghosts_take_their_owners_values_and_owners_add_up(comm):
    # a row of points, two a rank; each rank reaches one beyond its own
    place = 2.0 * comm.rank + np.arange(2.0)
    halo = Halo(comm, place[:, None], 1.5)
    found = Particles(np.zeros(2, np.int64))
    found.declare(Field("record", 4, ""))
    found.declare(Field("name", 1, "1", ghosts="forward", message="out", layout=Within("record", 2)), place)
    found.declare(Field("count", 1, "1", ghosts="reverse", message="back", layout=Rows()), 1.0)
    found.attach(halo)
    found.send("out")
    found.receive("out")
    assert found["name"][2 : 2 + halo.ghosts].tolist() == halo.with_ghosts(place)[2:].tolist()
    found["count"][2 : 2 + halo.ghosts] = 10.0
    found.send("back")
    found.receive("back")
    first, last = comm.rank == 0, comm.rank == comm.size - 1
    assert found["count"][:2].tolist() == [1.0 if first else 11.0, 1.0 if last else 11.0]
    assert found.bytes_sent("out") == 8 * (2 - first - last)


def test_what_was_sent_once_can_be_sent_after_arrays_were_replaced(comm):
    place = 2.0 * comm.rank + np.arange(2.0)
    halo = Halo(comm, place[:, None], 1.5)
    found = Particles(np.zeros(2, np.int64))
    found.declare(Field("name", 1, "1", ghosts="forward", message="out"), place)
    for _ in range(2):
        found.attach(halo)
        found.send("out")
        found.receive("out")
        assert found["name"][2 : 2 + halo.ghosts].tolist() == halo.with_ghosts(place)[2:].tolist()
        found.detach()
        found.insert(found.packed(np.zeros(0, np.int64)))
