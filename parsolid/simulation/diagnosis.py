"""What went wrong, where, and what to try: the message of a failed run."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from parsolid.collective import maximum, minimum
from parsolid.methods.interaction import Meeting
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.formulas import NOT_FINITE
from parsolid.scene.systems import qualify_keys

if TYPE_CHECKING:
    from parsolid.simulation.loop import Simulation

Found = dict[str, Any]


# numbers that are not finite are what is looked for
@np.errstate(all="ignore")
def describe_failure(simulation: "Simulation", otherwise: str, there: Found | None = None) -> str:
    """One message, the same on every rank; `otherwise` says what is wrong if no particle is at fault, and `there` names
    the particle that shows it, on its rank alone; without it the fastest is named. Collective."""
    unsound = ((system, system.first_invalid()) for system in simulation.systems)
    said = next(({"what": one[1]} | _named(simulation.scene, system, one[0]) for system, one in unsound if one), None)
    found = _first_of(simulation.comm, said)
    if found is None and simulation.failed_somewhere:
        found = _first_of(simulation.comm, _most_crushed_particle(simulation))
    if found is None:
        shown = _first_of(simulation.comm, there)
        if shown is None:
            shown = _first_of(simulation.comm, _fastest_particle(simulation))
        found = {"what": otherwise} if shown is None else shown | {"what": otherwise}
    lines = [
        f"the run failed: {found['what']}",
        f"  time       {simulation.clock.time:.9g} s, step {simulation.clock.step}",
    ]
    if "identifier" in found:
        lines.append(
            f"  particle   {found['identifier']} on rank {found['rank']}{found.get('why', '')}, "
            f"at X = ({found['reference']}), now x = ({found['position']})"
        )
    formula = _first_of(simulation.comm, {"formula": str(NOT_FINITE[0])} if NOT_FINITE else None)
    advice = found.get("advice") or _advice(simulation.scene, *simulation.systems)
    if formula is not None:
        lines.append(f"  formula    {formula['formula']}")
        advice = "a formula that has a value there"
    lines.append(f"  checkpoint {simulation.last_checkpoint or 'none was written'}")
    lines.append(f"  try        {advice}")
    return "\n".join(lines)


def describe_meetings(simulation: "Simulation", met: Sequence[Meeting]) -> str:
    """The message of a run that ends because bodies have met that no table names, the same on every rank."""
    now = simulation.clock
    return "\n".join(
        [
            f"the run ends: without [[contact]] {meetings_in_words(simulation.scene, met)}",
            f"  time       {now.time:.9g} s, step {now.step}",
            f"  checkpoint {simulation.last_checkpoint or 'none was written'}",
            "  try        [[contact]] of these bodies, or undeclared_contact = 'warn' to go on without",
        ]
    )


def meetings_in_words(scene: Scene, met: Sequence[Meeting]) -> str:
    """Bodies that have met, and where."""
    names = [repr(body.name) if body.name else f"bodies.{number}" for number, body in enumerate(scene.bodies)]
    return "; ".join(f"{names[i]} and {names[j]} have met near x = ({_place(place)})" for i, j, place in met)


def _first_of(comm: Any, local: Found | None) -> Found | None:
    """What the lowest rank that has found something has found; collective."""
    first = minimum(comm, comm.rank if local is not None else comm.size)
    return comm.bcast(local, root=first) | {"rank": first} if first < comm.size else None


def _advice(scene: Scene, *systems: ParticleSystem) -> str:
    """What systems advise, in the keys of the scene."""
    plans = {plan.bodies: plan for plan in scene.systems}
    advice = [qualify_keys(scene, plans[system.bodies], system.advice()) for system in systems]
    return "; ".join(dict.fromkeys(advice))


def _fastest_particle(simulation: "Simulation") -> Found | None:
    """The fastest particle of all, on its rank alone; where a run becomes unstable, it is near; collective."""
    speeds = [np.linalg.norm(system.particles.owned_rows("velocity"), axis=1) for system in simulation.systems]
    largest = [float(speed.max(initial=-1.0)) for speed in speeds]
    fastest = int(np.argmax(largest))
    if largest[fastest] < maximum(simulation.comm, largest[fastest]):
        return None
    index = int(np.argmax(speeds[fastest]))
    return {"why": f" (the fastest, {largest[fastest]:.4g} m/s)"} | _named(
        simulation.scene, simulation.systems[fastest], index
    )


def coldest_particle(simulation: "Simulation", system: ParticleSystem) -> Found:
    """The coldest particle of a system on this rank, at present."""
    temperature = system.particles.owned_rows("temperature")
    index, time = int(np.argmin(temperature)), simulation.clock.time
    why = f" (the coldest, {float(temperature[index]):.4g} K in the step from t = {time:.6g} s)"
    return {"why": why} | _named(simulation.scene, system, index)


def _most_crushed_particle(simulation: "Simulation") -> Found | None:
    """The particle with the least evolved Jacobian, on its rank alone: sound now, but not within the step.

    Collective.
    """
    systems = [system for system in simulation.systems if "jacobian" in system.particles.fields]
    if not systems:
        return None
    jacobians = [system.particles.owned_rows("jacobian") for system in systems]
    least = [float(jacobian.min(initial=np.inf)) for jacobian in jacobians]
    worst = int(np.argmin(least))
    if least[worst] > minimum(simulation.comm, least[worst]):
        return None
    now = f"the least is now {least[worst]:.4g}"
    what = f"a Jacobian was not positive within the step ({now}): matter is turned inside out"
    return {"what": what} | _named(simulation.scene, systems[worst], int(np.argmin(jacobians[worst])))


def _named(scene: Scene, system: ParticleSystem, index: int) -> Found:
    rows = system.particles.owned_rows
    return {
        "identifier": int(rows("identifier")[index]),
        "reference": _place(rows("reference_position")[index]),
        "position": _place(rows("position")[index]),
        "advice": _advice(scene, system),
    }


def _place(values: np.ndarray) -> str:
    return ", ".join(f"{value:.6g}" for value in values)
