"""What went wrong, where, and what to try: the message of a failed run."""

import numpy as np

from parsolid.collective import maximum, minimum


def describe_failure(simulation, otherwise: str) -> str:
    """One message, the same on every rank; `otherwise` says what is wrong if no particle is at fault. Collective."""
    found = _first_of(simulation.comm, _unsound_particle(simulation))
    if found is None and simulation.failed_somewhere and "jacobian" in simulation.method.table.arrays:
        found = _first_of(simulation.comm, _most_crushed_particle(simulation))
    if found is None:
        found = _first_of(simulation.comm, _fastest_particle(simulation)) | {"what": otherwise}
    return (
        f"the run failed: {found['what']}\n"
        f"  time       {simulation.clock.time:.9g} s, step {simulation.clock.step}\n"
        f"  particle   {found['identifier']} on rank {found['rank']}{found.get('why', '')}, "
        f"at X = ({found['reference']}), now x = ({found['position']})\n"
        f"  checkpoint {simulation.last_checkpoint or 'none was written'}\n"
        f"  try        {simulation.method.advice()}"
    )


def _first_of(comm, local: dict | None) -> dict | None:
    """What the lowest rank that has found something has found; collective."""
    first = minimum(comm, comm.rank if local is not None else comm.size)
    return comm.bcast(local, root=first) | {"rank": first} if first < comm.size else None


def _unsound_particle(simulation) -> dict | None:
    """The rank's first particle that is not sound, as its method says."""
    found = simulation.method.unsound()
    return found and {"what": found[1]} | _named(simulation.method.table, found[0])


def _fastest_particle(simulation) -> dict | None:
    """The fastest particle of all, on its rank alone; where a run becomes unstable, it is near; collective."""
    table = simulation.method.table
    speed = np.linalg.norm(table.owned_rows("velocity"), axis=1)
    largest = float(speed.max(initial=-1.0))
    if largest < maximum(simulation.comm, largest):
        return None
    index = int(np.argmax(speed))
    return {"why": f" (the fastest, {largest:.4g} m/s)"} | _named(table, index)


def _most_crushed_particle(simulation) -> dict | None:
    """The particle with the least Jacobian of all, on its rank alone: sound now, but not within the step; collective."""
    table = simulation.method.table
    jacobian = table.owned_rows("jacobian")
    least = float(jacobian.min(initial=np.inf))
    if least > minimum(simulation.comm, least):
        return None
    what = f"a Jacobian was not positive within the step (the least is now {least:.4g}): matter is turned inside out"
    return {"what": what} | _named(table, int(np.argmin(jacobian)))


def _named(table, index: int) -> dict:
    return {
        "identifier": int(table.owned_rows("identifier")[index]),
        "reference": _place(table.owned_rows("reference_position")[index]),
        "position": _place(table.owned_rows("position")[index]),
    }


def _place(values) -> str:
    return ", ".join(f"{value:.6g}" for value in values)
