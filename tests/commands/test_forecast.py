"""What a scene would cost on other ranks, against what it costs on them."""

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.api.forecast import bytes_on_disk, load_on, memory_on, seconds_a_step
from parsolid.api.report import median_of_means
from parsolid.output.checkpoint import write_checkpoint
from parsolid.output.run_folder import RunFolder
from parsolid.output.vtkhdf import published
from parsolid.scene import parse_scene
from parsolid.simulation.field_output import FieldOutput
from parsolid.simulation.loop import Simulation

TABLES = {
    "dimension": 2,
    "end_time": 1e-3,
    "method": {"kind": "tlsph"},
    "bodies": [
        {
            "shape": {"box": {"lower": [0.0, 0.0], "upper": [2.0, 1.0]}},
            "particles": [33, 17],
            "velocity": ["0", "-20*Y"],
            "material": {"kind": "neo-hookean", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.4},
        }
    ],
}


# parts of lattice planes, and parts that are even to the particle
@pytest.fixture(params=["fourth-order", "kernel"])
def simulation(comm, request):
    tables = TABLES | {"method": TABLES["method"] | {"weights": request.param}}
    return Simulation(comm, parse_scene(tables))


@pytest.mark.mpi
def test_particles_and_ghosts_of_the_busiest_rank(comm, simulation):
    (system,) = simulation.systems
    busiest = comm.allreduce(system.owned, MPI.MAX), comm.allreduce(system.numbers()["ghosts"], MPI.MAX)
    found = load_on(comm, simulation.systems, comm.size)
    assert found.particles == busiest[0]
    assert found.ghosts == pytest.approx(busiest[1], rel=0.2)
    # one rank has no ghosts and half as many have twice the particles, from wherever it is asked
    alone, two = (load_on(comm, simulation.systems, ranks) for ranks in (1, 2))
    assert (alone.particles, alone.ghosts, alone.weight) == (561.0, 0.0, 561.0)
    assert two.particles == (289.0 if system.boxes is not None else 281.0)
    assert two.neighbours == 1.0 and 17.0 <= two.ghosts <= 4 * 17.0
    work, talk = seconds_a_step(simulation.systems, 1.0, 0.0, alone, two, 2)
    assert 0.5 < work < 0.6 and 0.0 < talk < 1e-3
    # what a step takes without particles stays
    assert seconds_a_step(simulation.systems, 1.5, 0.5, alone, two, 2)[0] == pytest.approx(0.5 + work)
    assert memory_on(100.0, 661.0, alone, two) == pytest.approx(100.0 + two.particles + two.ghosts)


def test_bytes_on_disk(comm, simulation, tmp_path):
    fields, once, checkpoint = bytes_on_disk(comm, simulation.scene, simulation.systems)
    folder = comm.bcast(str(tmp_path))
    files = RunFolder(comm, folder)
    FieldOutput(simulation, files).write(simulation)
    kept = [system.particles.checkpointed() for system in simulation.systems]
    write_checkpoint(comm, files.checkpoint, {}, kept, simulation.ledger.values)
    if comm.rank == 0:
        layout, _ = published(files.fields)
        assert fields == layout.bytes_per_step
        whole = once + layout.capacity * fields
        assert files.fields.stat().st_size == pytest.approx(whole, rel=0.1)
        assert files.checkpoint.stat().st_size == pytest.approx(checkpoint, abs=2e4)
    files.close()


def test_a_disturbance_does_not_count_and_what_recurs_does():
    steps = np.tile([1.0, 1.0, 1.0, 1.0, 3.0], 20)
    disturbed = steps.copy()
    disturbed[:25] *= 2.0
    assert median_of_means(list(disturbed)) == median_of_means(list(steps)) == pytest.approx(1.4)
