"""How fast steps of total-Lagrangian SPH are, how many bytes they move, and what part of the memory's speed that is.

    mpirun -n 2 python docs/speed_table.py [--particles 27000 216000 1000000] [--only WEIGHTS ...]

A cube without branches in a gentle motion, on one rank and on all. Bytes are counted from the arrays: a pass counts
what it reads and what it writes of each array once. The memory's speed is that of a triad, a = b + s c, over arrays
larger than the caches, by as many ranks at the same time, in the same run. Every time is of the processor, the least
of some repetitions on the slowest rank. Prints markdown.
"""

import argparse
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numba import njit

from parsolid.commands.bench.timing import Steps, best_time
from parsolid.commands.bench.tlsph import cube_scene
from parsolid.pairs.axis_lists import arrays_of
from parsolid.pairs.terms import KINEMATICS
from parsolid.particles.declaration import Columns
from parsolid.simulation.warmup import wait_quietly

# numbers of an array of the triad on a rank, and bytes that a triad reads and writes for each
_TRIAD, _TRIAD_BYTES = 8_000_000, 24
# steps are repeated until so many particle-steps are done, three times at least
_ENOUGH = 1_000_000
# beyond so many particles, whose lists alone take half a minute, SSP-RK3 has its first row only
_MANY = 500_000
_PASSES = ("gradient", "strain", "forces", "motion")


class Case(NamedTuple):
    """What a row is about."""

    weights: str
    smoothing: float
    integrator: str


CASES = [
    Case(weights, smoothing, integrator)
    for weights, smoothing in (("kernel", 0.85), ("kernel", 1.2), ("cells", 0.85), ("fourth-order", 0.85))
    for integrator in ("ssp-rk3", "leapfrog")
]


# --- bytes -------------------------------------------------------------------------------------------------------


def bytes_of_passes(system: Any) -> dict[str, float]:
    """Bytes a particle that each pass reads and writes in a step; of a system without branches."""
    at, number = KINEMATICS[system.dimension], 8

    def row(name: str) -> float:
        array = system.particles.storage(name)
        rows = array.shape[isinstance(system.particles.fields[name].layout, Columns)]
        return float(array.nbytes) / rows

    pairs = [one for one in (system.pairs.inner, system.pairs.rim, system.pairs.mirror) if one is not None]
    lists = sum(array.nbytes for one in pairs for array in arrays_of(one)) / system.owned
    # of the kinematics: v, then v and x, then all
    field, motion, vectors = (number * width for width in (at.position, at.reference, at.width))
    force, sums, record, strain = map(row, ("pair_force", "pair_sums", "record", "strain"))
    gradient, forces = field + 2 * sums + lists, vectors + record + 2 * force + lists
    fixed = row("correction") + number
    if system.leapfrog is not None:
        strains = 2 * sums + 2 * strain + record + fixed
        return dict(zip(_PASSES, (gradient, strains, forces, 4 * motion + 3 * force + 4 * number)))
    stages = len(system.stages)
    strains, moved = sums + 3 * strain + record + fixed, 3 * motion + 2 * force + sums + 2 * number
    return dict(zip(_PASSES, (stages * one for one in (gradient, strains, forces, moved))))


# --- times -------------------------------------------------------------------------------------------------------


@njit(cache=True)
def _triad(a: np.ndarray, b: np.ndarray, c: np.ndarray, factor: float) -> None:
    for i in range(a.shape[0]):
        a[i] = b[i] + factor * c[i]


def memory_speed(comm: Any) -> float:
    """Bytes a second and rank [1/s], of the slowest one; collective."""
    a, b, c = np.ones((3, _TRIAD))
    comm.Barrier()
    seconds = best_time(lambda: _triad(a, b, c, 0.5), clock=process_time)
    return float(comm.allreduce(_TRIAD * _TRIAD_BYTES / seconds, MPI.MIN))


class _Clock:
    """Seconds of the processor since the last look, by name."""

    def __init__(self) -> None:
        self.spent = dict.fromkeys(_PASSES, 0.0)
        self.began = process_time()

    def look(self, name: str) -> None:
        now = process_time()
        self.spent[name] += now - self.began
        self.began = now


def pass_times(system: Any, step: float) -> dict[str, float]:
    """Seconds of each pass in one step [s], taken as the integrator takes it."""
    clock, pairs = _Clock(), system.pairs
    if system.leapfrog is not None:
        system.leapfrog._half_kick(True, 0.0, step)
        clock.look("motion")
        pairs.gradient("motion")
        clock.look("gradient")
        system.leapfrog._advance_strain_of_all(step)
        clock.look("strain")
        pairs.divergence(pairs.terms)
        clock.look("forces")
        system.leapfrog._half_kick(False, step, step)
        clock.look("motion")
        return clock.spent
    for stage in system.stages:
        pairs.gradient("motion")
        clock.look("gradient")
        system.advance_deformation(stage, step)
        clock.look("strain")
        pairs.divergence(pairs.terms)
        clock.look("forces")
        system.advance_motion(stage, 0.0, step)
        clock.look("motion")
    return clock.spent


def row_of(comm: Any, case: Case, particles: int, speed: float) -> list[Any]:
    """What one case takes on the ranks of comm; speed: of the memory [bytes/s] of a rank; collective."""
    run = Steps(comm, cube_scene(particles, case.smoothing, 0, case.integrator, case.weights), 1)
    system: Any = run.simulation.systems[0]
    total = run.simulation.particles
    turns = max(3, min(12, round(_ENOUGH * comm.size / total)))
    scale = 1e9 * comm.size / total
    whole = comm.allreduce(best_time(run.advance, turns, process_time), MPI.MAX) * scale
    times = [pass_times(system, run.step) for _ in range(turns)]
    passes = [comm.allreduce(min(one[name] for one in times), MPI.MAX) * scale for name in _PASSES]
    streamed = comm.allreduce(sum(bytes_of_passes(system).values()) * system.owned) / total
    values = [f"{value:.0f}" for value in (whole, *passes, streamed)]
    moved, evaluations = streamed / whole, system.evaluations / whole * 1e9
    shares = [f"{moved:.1f}", f"{1e11 * moved / speed:.0f}", f"{evaluations:.2g}"]
    return [case.weights, case.smoothing, case.integrator, total, comm.size, *values, *shares]


def _asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--particles", type=int, nargs="+", default=[27_000, 216_000, 1_000_000])
    parser.add_argument("--only", nargs="+", default=["kernel", "cells", "fourth-order"], help="weights")
    parser.add_argument("--integrators", nargs="+", default=["ssp-rk3", "leapfrog"])
    return parser.parse_args()


def main() -> None:
    """Print the table, row by row."""
    asked, world = _asked(), MPI.COMM_WORLD
    groups = [MPI.COMM_SELF] + ([world] if world.size > 1 else [])
    names = ["weights", "h/dx", "integrator", "particles", "ranks", "ns a particle-step", *_PASSES]
    names += ["bytes", "GB/s a rank", "% of triad", "evaluations/s a rank"]
    speeds = []
    for group in groups:
        takes_part = group is world or world.rank == 0
        speeds.append(memory_speed(group) if takes_part else 0.0)
        wait_quietly(world)
    if world.rank == 0:
        told = ", ".join(f"{speed / 1e9:.1f} GB/s a rank on {group.size}" for speed, group in zip(speeds, groups))
        print(f"Triad: {told}\n\n| {' | '.join(names)} |\n{'|---' * len(names)}|", flush=True)
    for particles in asked.particles:
        for case in CASES:
            if case.weights not in asked.only or case.integrator not in asked.integrators:
                continue
            if particles > _MANY and case.integrator == "ssp-rk3" and case != CASES[0]:
                continue
            for group, speed in zip(groups, speeds):
                if group is world or world.rank == 0:
                    row = row_of(group, case, particles, speed)
                    if world.rank == 0:
                        print("| " + " | ".join(map(str, row)) + " |", flush=True)
                wait_quietly(world)


if __name__ == "__main__":
    main()
