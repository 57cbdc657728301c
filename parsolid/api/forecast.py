"""What a scene costs on another number of ranks: memory, time and disk, from what it costs on the present ones.

Particles are cut up as the method does; ghosts are counted on a sample of them. The constants of messages are
those of a shared-memory node and are the least certain part; docs/cluster.md compares forecasts with runs.
"""

from dataclasses import dataclass
from math import ceil, log2, pi
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.methods.protocol import ParticleSystem
from parsolid.observables.declared import Observables, OfRegion, field_of
from parsolid.output.fields import bytes_of_rows, exact_names
from parsolid.scene import Scene
from parsolid.scene.previous_results import STATE

# particles of all ranks that stand for the others
SAMPLE = 40_000
# a message with its bookkeeping [s], bytes a second of one, the agreement of two ranks [s]
_MESSAGE, _BANDWIDTH, _AGREEMENT = 3.0e-5, 3.0e9, 1.0e-5
# what a run on several ranks takes beside: its files and probes, the messages' buffers and code; 13 to 31 MiB found
BESIDES = 20 * 2**20
# content of a ball of radius 1; mean share of a ghost's ball beyond the cut, where pairs are evaluated on both sides
_BALL = {1: 2.0, 2: pi, 3: 4.0 * pi / 3.0}
_BEYOND = {1: 0.25, 2: 0.212, 3: 0.1875}


@dataclass(frozen=True)
class Load:
    """Of the busiest rank: particles, ghosts, particles as heavy in work as these with their pairs across cuts, ranks
    that it talks to.
    """

    particles: float
    ghosts: float
    weight: float
    neighbours: float


def load_on(comm: Any, systems: list[ParticleSystem], ranks: int) -> Load:
    """The load of the busiest of so many ranks; collective, the same on all."""
    found = [_load_of(comm, system, ranks) for system in systems]
    counts = np.sum([(one.particles, one.ghosts, one.weight) for one in found], axis=0)
    particles, ghosts, weight = map(float, counts)
    return Load(particles, ghosts, weight, max(one.neighbours for one in found))


def _load_of(comm: Any, system: ParticleSystem, ranks: int) -> Load:
    total, pairs = comm.allreduce(system.owned), comm.allreduce(system.directed_pairs)
    particles = float(system.busiest(total, ranks))
    if ranks == 1 or pairs == 0:
        return Load(particles, 0.0, particles, 0.0 if ranks == 1 else 2.0)
    d, rows = system.dimension, system.particles.owned_rows
    volume = comm.allreduce(float(rows("volume").sum())) / total
    # how far neighbours are, from how many there are, unless they are known to be farther
    reach = max((pairs / total * volume / _BALL[d]) ** (1.0 / d), comm.allreduce(system.farthest, MPI.MAX))
    here = np.random.default_rng(1).permutation(system.owned)[: ceil(SAMPLE * system.owned / total)]
    pieces = comm.gather(rows("reference_position")[here][:, :d])
    counts = _counted(np.concatenate(pieces), total, ranks, reach) if comm.rank == 0 else None
    ghosts, neighbours = comm.bcast(counts)
    return Load(particles, ghosts, particles + _BEYOND[d] * ghosts, neighbours)


def _counted(sample: np.ndarray, total: int, ranks: int, reach: float) -> tuple[float, float]:
    """Most ghosts of a part, and most parts that it touches, by a sample (k, d) of all particles [m]."""
    parts = _bisected(sample, ranks)
    corners = [(part.min(axis=0), part.max(axis=0)) for part in parts if len(part)]
    ghosts, neighbours = [], []
    for lower, upper in corners:
        near = np.maximum(np.maximum(lower - sample, sample - upper), 0.0)
        square = (near * near).sum(axis=1)
        ghosts.append(np.count_nonzero((square > 0.0) & (square < reach * reach * (1.0 + 1e-9))) * total / len(sample))
        gaps = [np.maximum(np.maximum(lower - one[1], one[0] - upper), 0.0) for one in corners]
        neighbours.append(sum(float(gap @ gap) < reach * reach for gap in gaps) - 1)
    return float(max(ghosts)), float(max(neighbours))


def _bisected(points: np.ndarray, parts: int) -> list[np.ndarray]:
    """Points (k, d) cut across their longest side until there are so many parts."""
    if parts == 1 or len(points) < 2:
        return [points]
    half = parts // 2
    axis = int(np.argmax(np.ptp(points, axis=0)))
    order = np.argsort(points[:, axis], kind="stable")
    cut = len(points) * half // parts
    return _bisected(points[order[:cut]], half) + _bisected(points[order[cut:]], parts - half)


def seconds_a_step(
    systems: list[ParticleSystem], work: float, idle: float, now: Load, then: Load, ranks: int
) -> tuple[float, float]:
    """Work and messages [s] of a step of the busiest rank, from the work [s] on the present ranks and that of a step
    without particles.
    """
    messages, sent, idle = 0.0, 0.0, min(idle, work)
    of_particles = (work - idle) * then.weight / now.weight
    for system in systems:
        widths = {name: field.components for name, field in system.particles.fields.items() if field.ghosts is not None}
        kinds = {field.message for field in system.particles.fields.values() if field.message and field.ghosts}
        messages += system.evaluations * max(1, len(kinds))
        sent += 8.0 * system.evaluations * sum(widths.values())
    if ranks == 1:
        return idle + of_particles, 0.0
    talk = messages * (1.0 + then.neighbours) * _MESSAGE + sent * then.ghosts / _BANDWIDTH
    return idle + of_particles, talk + _AGREEMENT * log2(ranks)


def memory_on(base: float, peak: float, now: Load, then: Load) -> float:
    """Bytes of a rank, from those of the program without particles and from the most that a rank takes now."""
    return base + max(0.0, peak - base) * (then.particles + then.ghosts) / (now.particles + now.ghosts)


def bytes_on_disk(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> tuple[int, int, int]:
    """Bytes of the fields of one time, of what their file holds once, and of a checkpoint; collective."""
    fields = checkpoint = 0
    particles = 0
    for system in systems:
        shown, total = Observables([system]), comm.allreduce(system.owned)
        names = shown.written(scene.output.fields)
        # no rows have the same width as all
        kinds = {name: shown.field(name) if name.startswith(STATE) else field_of(system, name, 0, 0) for name in names}
        written = total
        if scene.output.where is not None:
            chosen = OfRegion(shown, list(scene.named_regions).index(scene.output.where))
            written = int(comm.allreduce(len(chosen.rows("identifier"))))
        exact = exact_names(names)
        fields += written * (24 + sum(bytes_of_rows(np.asarray(one), name in exact) for name, one in kinds.items()))
        particles += written
        kept = system.particles.checkpointed().values()
        checkpoint += total * sum(rows.dtype.itemsize * int(np.prod(rows.shape[1:])) for rows in kept)
    # of a particle: its body, its volume, and the cell that shows it
    return fields, particles * (8 + 4 + 16), checkpoint
