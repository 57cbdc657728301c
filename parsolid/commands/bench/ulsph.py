"""Speed of updated-Lagrangian SPH."""

import functools
import time
from typing import Any

from mpi4py import MPI

from parsolid.commands.bench.timing import best_time
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

_STEEL = {"kind": "micro-inertia", "library": "4340 steel, Rahaman"}
# of the processor, which other work on the machine does not lengthen
_least = functools.partial(best_time, clock=time.process_time)
_LEFT_OUT = {
    "l1": ("energetic_length",),
    "l2": ("hardening_length",),
    "l3": ("dissipative_length", "flux_relaxation_time"),
    "l1 l2 l3": ("energetic_length", "hardening_length", "dissipative_length", "flux_relaxation_time"),
    "t_pi": ("stress_relaxation_time",),
    "heat": ("conductivity", "heat_relaxation_time"),
    "all": (
        *("energetic_length", "hardening_length", "dissipative_length", "flux_relaxation_time", "inertia_length"),
        *("stress_relaxation_time", "conductivity", "heat_relaxation_time"),
    ),
}


def impact_scene(particles: int, dimension: int = 2, left_out: str = "", **method: Any) -> Any:
    """Two steel bodies of about so many particles that meet at 208 m/s each, as the paper's."""
    material = _STEEL | dict.fromkeys(_LEFT_OUT.get(left_out, ()), 0.0)
    long, wide = (71, 21) if dimension == 2 else (48, 24)
    size = (particles / (2.0 * long * wide ** (dimension - 1))) ** (1.0 / dimension)
    count = [max(4, round(size * long))] + [max(4, round(size * wide))] * (dimension - 1)
    edge, bodies = 0.36e-3 / size, []
    length = edge * count[0]
    for k, speed in enumerate(("208", "-208")):
        lower = [k * length] + [0.0] * (dimension - 1)
        box = {"lower": lower, "upper": [(k + 1) * length] + [edge * n for n in count[1:]]}
        body = {"shape": {"box": box}, "particles": count, "placement": "cells", "material": material}
        bodies.append(body | {"velocity": [speed] + [0.0] * (dimension - 1)})
    settings = {"kind": "ulsph"} | method
    tables = {"title": "bench", "dimension": dimension, "end_time": 1.0, "method": settings, "bodies": bodies}
    return parse_scene(tables | {"bond": [{"bodies": "all"}]})


def scaling_scene(particles: int) -> Any:
    """The paper's impact."""
    return impact_scene(particles)


def kernel_tables(particles: int) -> list[tuple[Any, ...]]:
    """Whole steps of one core while the bodies meet, parts of them, and what each optional term costs."""
    cases: list[tuple[int, str, dict[str, Any]]] = [(2, name, {}) for name in ("", *_LEFT_OUT)]
    cases += [(2, "all", {"gradient_correction": False}), (2, "all", {"viscosity": False}), (3, "", {}), (3, "all", {})]
    names = ["d", "left out", "option", "particles", "steps/s", "ns a step", "rates", "state", "forces"]
    names += ["fluxes", "lists"]
    title = "One core, processor time, float64, lists made anew when they are used up"
    return [(title, names, [_kernel_row(particles, *case) for case in cases])]


def _kernel_row(particles: int, dimension: int, left_out: str, method: dict[str, Any]) -> list[Any]:
    simulation = Simulation(MPI.COMM_SELF, impact_scene(particles, dimension, left_out, **method))
    system: Any = simulation.systems[0]
    step, steps = system.stable_step(), 20

    def advance() -> None:
        for _ in range(steps):
            simulation.take_step(step)

    whole, made, spent = _least(advance) / steps, system.pairs.builds, system.pairs.seconds
    lists = spent / max(1, simulation.clock.step) if made else 0.0
    parts = [
        _least(lambda: system.find_rates(0.0)),
        _least(lambda: system.advance_state(simulation.clock.time, 0.0)),
        _least(system.neighbours.find_forces),
        _least(lambda: system.advance_fluxes(0.0)),
        lists,
    ]
    figures = [f"{1e9 * seconds / system.owned:.0f}" for seconds in (whole, *parts)]
    option = " ".join(f"{key} = {str(value).lower()}" for key, value in method.items())
    return [dimension, left_out, option, system.owned, f"{system.owned / whole:.3g}", *figures]
