"""Prediction of memory, time and disk space on another number of ranks, from the cost on the present ones.

Particles are decomposed as the method does; ghosts are counted on a sample of them. The constants of messages are those
of a shared-memory node and are the least certain part; docs/cluster.md compares predictions with runs.
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

# size of the sample of particles of all ranks
SAMPLE = 40_000
# time of a message [s], bandwidth [B/s], time of an allreduce of two ranks [s]
_MESSAGE, _BANDWIDTH, _AGREEMENT = 3.0e-5, 3.0e9, 1.0e-5
# memory [B] of a run on several ranks for files, probes, buffers and code; 13 to 31 MiB measured
BESIDES = 20 * 2**20
# by dimension: volume of a ball of radius 1; mean share of a ghost's pairs that are evaluated on both sides of a cut
_BALL = {1: 2.0, 2: pi, 3: 4.0 * pi / 3.0}
_BEYOND = {1: 0.25, 2: 0.212, 3: 0.1875}


@dataclass(frozen=True)
class Load:
    """Load of the busiest rank: particles, ghosts, particles with the same work (weight), neighbouring ranks."""

    particles: float
    ghosts: float
    weight: float
    neighbours: float


def load_on(comm: Any, systems: list[ParticleSystem], ranks: int) -> Load:
    """The load of the busiest rank of so many; collective, the same on all ranks."""
    loads = [_load_of(comm, system, ranks) for system in systems]
    particles, ghosts, weight = (
        sum(getattr(load, name) for load in loads) for name in ("particles", "ghosts", "weight")
    )
    return Load(particles, ghosts, weight, max(load.neighbours for load in loads))


def _load_of(comm: Any, system: ParticleSystem, ranks: int) -> Load:
    total, pairs = comm.allreduce(system.owned), comm.allreduce(system.directed_pairs)
    particles = float(system.busiest(total, ranks))
    if ranks == 1 or pairs == 0:
        return Load(particles, 0.0, particles, 0.0 if ranks == 1 else 2.0)
    d, rows = system.dimension, system.particles.owned_rows
    volume = comm.allreduce(float(rows("volume").sum())) / total
    # radius of a ball with the mean number of neighbours, or the largest distance of a pair
    reach = max((pairs / total * volume / _BALL[d]) ** (1.0 / d), comm.allreduce(system.farthest, MPI.MAX))
    here = np.random.default_rng(1).permutation(system.owned)[: ceil(SAMPLE * system.owned / total)]
    pieces = comm.gather(rows("reference_position")[here][:, :d])
    counts = _counted(np.concatenate(pieces), total, ranks, reach) if comm.rank == 0 else None
    ghosts, neighbours = comm.bcast(counts)
    return Load(particles, ghosts, particles + _BEYOND[d] * ghosts, neighbours)


def _counted(sample: np.ndarray, total: int, ranks: int, reach: float) -> tuple[float, float]:
    """Largest numbers of ghosts and of neighbours of a part, from a sample (k, d) of all particles [m]."""
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
    """Parts of points (k, d) by recursive bisection across the longest side."""
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
    """Time of work and of messages [s] in a step of the busiest rank; work, idle: time of a step [s] on the present
    ranks and without particles."""
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
    """Memory of a rank [B]; base: of the program without particles, peak: largest on the present ranks."""
    return base + max(0.0, peak - base) * (then.particles + then.ghosts) / (now.particles + now.ghosts)


def bytes_on_disk(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> tuple[int, int, int]:
    """Bytes of the fields of one time, of constant fields, and of a checkpoint; collective."""
    fields = checkpoint = 0
    particles = 0
    for system in systems:
        shown, total = Observables([system]), comm.allreduce(system.owned)
        names = shown.written(scene.output.fields)
        # fields of no particles have the same type and shape
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
    # constant for each particle: body, volume and cell
    return fields, particles * (8 + 4 + 16), checkpoint
