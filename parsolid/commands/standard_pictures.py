"""The pictures that a run draws at its end."""

from pathlib import Path

from mpi4py import MPI


def draw(comm: MPI.Intracomm, directory: Path) -> None:
    """The standard set of pictures, on rank 0, where the plotting packages are installed."""
    if comm.rank > 0:
        return
    try:
        from parsolid.commands.plot import plot_run
    except ImportError:
        return
    plot_run(directory)
