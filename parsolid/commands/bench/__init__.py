"""`parsolid bench`: how fast a method is on this machine, as particle-steps/s a rank and nanoseconds a pair.

Every figure is the best of several repetitions, because other work on the machine only ever makes a repetition slower.
A method's module offers `kernel_tables(particles)`, tables of one core as (title, names, rows), and
`scaling_scene(particles)`, a balanced scene whose whole steps are timed on one rank and on all.
"""

from importlib import import_module
from typing import Any

from mpi4py import MPI

from parsolid.commands.arguments import show_table, whole_number
from parsolid.commands.bench.timing import Steps, best_time
from parsolid.simulation.warmup import wait_quietly

METHODS = ("tlsph", "peridynamics", "mpm", "ulsph")


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    parser.add_argument("--method", default=METHODS[0], choices=METHODS, help=f"the method (default {METHODS[0]})")
    about = "about how many particles (default 28000)"
    parser.add_argument("--particles", type=whole_number, default=28000, metavar="N", help=about)
    scaling = "also measure whole steps on all ranks with N particles"
    parser.add_argument("--scaling", type=whole_number, metavar="N", help=scaling)


def run_bench(comm: MPI.Comm, options: Any) -> int:
    """Print a method's tables on rank 0; exit status 0. Collective."""
    module = import_module(f"parsolid.commands.bench.{options.method}")
    if comm.rank == 0:
        for table in module.kernel_tables(options.particles):
            show_table(*table)
    wait_quietly(comm)
    if options.scaling:
        # whole steps on one rank while the others wait, then on all ranks
        scene = module.scaling_scene(options.scaling)
        alone = None
        if comm.rank == 0:
            run = Steps(MPI.COMM_SELF, scene, 3)
            alone = best_time(run.advance) / run.steps
            del run
        wait_quietly(comm)
        alone = comm.bcast(alone)
        run = Steps(comm, scene, 3)
        together = comm.allreduce(best_time(run.advance) / run.steps, MPI.MAX)
        total = run.simulation.particles
        speeds = [f"{total / alone:.3g}", f"{total / together / comm.size:.3g}"]
        rows = [[1, total, speeds[0], 1.0], [comm.size, total, speeds[1], f"{alone / together:.2f}"]]
        if comm.rank == 0:
            show_table("Whole steps", ["ranks", "particles", "steps/s a rank", "speed-up"], rows)
    return 0
