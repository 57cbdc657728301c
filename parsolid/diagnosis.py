"""What went wrong, where, and what to try: the message of a failed run."""

import numpy as np

from parsolid.together import minimum


def describe_failure(simulation, otherwise: str) -> str:
    """One message, the same on every rank; `otherwise` says what is wrong if no particle is at fault. Collective."""
    comm = simulation.comm
    local = _worst_particle(simulation)
    first = minimum(comm, comm.rank if local is not None else comm.size)
    found = comm.bcast(local, root=first) if first < comm.size else None
    what, where = otherwise, ""
    if found is not None:
        what = found["what"]
        where = (
            f"\n  particle   {found['identifier']} on rank {first}, at X = ({found['reference']}), now x = ({found['position']})"
        )
    return (
        f"the run failed: {what}\n"
        f"  time       {simulation.clock.time:.9g} s, step {simulation.clock.step}{where}\n"
        f"  checkpoint {simulation.last_checkpoint or 'none was written'}\n"
        f"  try        {advice(simulation)}"
    )


def advice(simulation) -> str:
    """What most likely helps."""
    settings = simulation.scene.method
    hints = []
    if settings.cfl > 0.9:
        hints.append(f"a smaller method.cfl (it is {settings.cfl:g}; 0.7 is stable for smoothing of 0.85 and more)")
    if settings.dissipation == 0.0:
        hints.append("method.dissipation = 1 (there is none)")
    hints.append("more particles where the body is crushed" if settings.cfl <= 0.9 else "more particles")
    hints.append("a milder load")
    return ", or ".join(hints)


def _worst_particle(simulation) -> dict | None:
    """The rank's first particle with a Jacobian or a velocity that is not sound."""
    table = simulation.method.table
    jacobian, velocity = table.owned_rows("jacobian"), table.owned_rows("velocity")
    bad = ~(jacobian > 0.0) | ~np.isfinite(velocity).all(axis=1)
    if not bad.any():
        return None
    index = int(np.argmax(bad))
    what = f"the Jacobian is {jacobian[index]:.4g}, not positive: matter is turned inside out"
    if not np.isfinite(jacobian[index]) or not np.isfinite(velocity[index]).all():
        what = "a number is no longer finite"
    return {
        "what": what,
        "identifier": int(table.owned_rows("identifier")[index]),
        "reference": _place(table.owned_rows("reference_position")[index]),
        "position": _place(table.owned_rows("position")[index]),
    }


def _place(values) -> str:
    return ", ".join(f"{value:.6g}" for value in values)
