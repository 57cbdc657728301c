"""How long the decomposition takes: `mpirun -n 2 python benchmarks/decomposition_speed.py [--points-per-rank N]`.

A cubic lattice, reach 2.4 spacings (about 56 neighbours a point), is bisected, sorted, paired and exchanged.
Times are the slowest rank's, best of several. "Beyond the messages" is packing, unpacking and Python.
"""

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.bisection import bisect
from decomposition.halo import Halo
from decomposition.migration import migrate
from decomposition.pair_search import ClosePairs, checked_bounds, half_pairs, strips_of
from decomposition.plan import Exchange

_REACH = 2.4


def _slice(comm: MPI.Comm, points_per_rank: int) -> np.ndarray:
    """This rank's share of a cubic lattice of about points_per_rank * ranks points: (n, 3)."""
    edge = round((points_per_rank * comm.size) ** (1 / 3))
    first, last = edge**3 * comm.rank // comm.size, edge**3 * (comm.rank + 1) // comm.size
    return np.stack(np.unravel_index(np.arange(first, last), (edge,) * 3), axis=1).astype(float)


def _timed(comm: MPI.Comm, work: Callable[[], Any], repeats: int = 3) -> tuple[float, Any]:
    """Seconds of the slowest rank, best of several, and the last result."""
    work()
    best = np.inf
    for _ in range(repeats):
        comm.Barrier()
        begun = MPI.Wtime()
        result = work()
        best = min(best, comm.allreduce(MPI.Wtime() - begun, MPI.MAX))
    return best, result


def _exchange_seconds(comm: MPI.Comm, exchange: Exchange, repeats: int) -> tuple[float, float]:
    """Seconds of one start and finish, and of its bare messages, best of five series."""

    def bare() -> None:
        exchange.messages.receive()
        # fresh data must travel between the processors' caches, as in earnest
        exchange.messages.outgoing.fill(1.0)
        exchange.messages.send()
        exchange.messages.wait()

    def series(work: Callable[[], None]) -> None:
        for _ in range(repeats):
            work()

    return _timed(comm, lambda: series(exchange.now), 5)[0] / repeats, _timed(comm, lambda: series(bare), 5)[
        0
    ] / repeats


def main() -> None:
    """Measure and print one line a part, on rank 0."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points-per-rank", type=int, default=100_000)
    arguments = parser.parse_args()
    comm = MPI.COMM_WORLD

    def say(text: str) -> None:
        if comm.rank == 0:
            print(text, flush=True)

    points = _slice(comm, arguments.points_per_rank)
    n = len(points)
    say(f"{comm.size} ranks, {n} points on rank 0")

    def report(name: str, work: Callable[[], Any]) -> Any:
        seconds, result = _timed(comm, work)
        say(f"{name:20s} {seconds * 1e3:9.2f} ms {seconds / n * 1e9:7.0f} ns a point")
        return result

    owner = report("bisect", lambda: bisect(comm, points))
    points = report("migrate", lambda: migrate(comm, owner, {"points": points})["points"])
    points = points[report("sort", lambda: strips_of(*checked_bounds(points), _REACH).order(points)[0])]
    halo = report("Halo", lambda: Halo(comm, points, _REACH))
    everywhere = halo.with_ghosts(points)
    start, neighbour = report("half_pairs", lambda: half_pairs(everywhere, halo.owned, _REACH))
    search, radius = ClosePairs(), np.full(len(everywhere), 0.5 * _REACH)
    report("ClosePairs.find", lambda: search.find(everywhere, radius, halo.owned))
    say(f"{len(neighbour)} pairs ({neighbour.nbytes / 2**20:.0f} MiB), {halo.ghosts} ghosts on rank 0")
    capacity = halo.owned + halo.ghosts
    for columns in (1, 10, 27):
        exchange = halo.forward(np.zeros((columns, capacity)).T)
        whole, bare = _exchange_seconds(comm, exchange, 200)
        say(
            f"exchange {columns:2d} columns  {whole * 1e6:9.1f} us, {exchange.bytes_sent} bytes from rank 0; "
            f"beyond the messages {max(whole - bare, 0.0) * 1e6:.1f} us"
        )


if __name__ == "__main__":
    main()
