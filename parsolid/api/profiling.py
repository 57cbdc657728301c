"""`parsolid run --profile`: which functions take the time of each rank."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from parsolid.output.errors import together

# functions of a table
SHOWN = 60


@contextmanager
def profiled(comm: Any, folder: Path | None) -> Iterator[None]:
    """Write DIR/profile-RANK.txt, one file a rank, of what is done meanwhile; None: nothing is watched. Collective.

    Time in a compiled kernel counts as own time of the function that calls it. Raises OutputError on all ranks when a
    file cannot be written.
    """
    if folder is None:
        yield
        return
    import cProfile
    import io
    import pstats

    profile = cProfile.Profile()
    profile.enable()
    try:
        yield
    finally:
        profile.disable()
    path = folder / f"profile-{comm.rank}.txt"
    with together(comm, f"cannot write {path}"):
        text = io.StringIO()
        for order, meaning in (("tottime", "own time"), ("cumulative", "time with what they call")):
            text.write(f"rank {comm.rank} of {comm.size}: functions by {meaning}\n")
            pstats.Stats(profile, stream=text).strip_dirs().sort_stats(order).print_stats(SHOWN)
        path.write_text(text.getvalue(), encoding="utf-8")
