"""Speed of the material point method."""

from typing import Any

from mpi4py import MPI

from parsolid.commands.bench.timing import Steps, best_time
from parsolid.scene import parse_scene

_COPPER = "OFHC copper, Johnson-Cook"
_PERFECT = {"kind": "linear-hardening", "yield_stress": 90e6, "hardening": 100e6}


def cube_scene(particles: int, flow: str, **method: Any) -> Any:
    """A cube of copper of about so many particles, 8 a cell, that flows from the first step on; flow "J2" or
    "Johnson-Cook".
    """
    cells = max(2, round((particles / 8.0) ** (1.0 / 3.0)))
    material: dict[str, Any] = {"kind": "elastic-plastic", "library": _COPPER}
    if flow == "J2":
        material["flow_stress"] = _PERFECT
    body = {
        "shape": {"box": {"lower": [0.0, 0.0, 0.0], "upper": [1.0, 1.0, 1.0]}},
        "particles": [2 * cells] * 3,
        "placement": "cells",
        "velocity": ["2000*sin(pi*Y)", "1000*sin(pi*Z)", "500*sin(pi*X)"],
        "material": material,
    }
    settings = {"kind": "mpm", "cell": 1.0 / cells, "conduction": False} | method
    return parse_scene({"title": "bench", "dimension": 3, "end_time": 1.0, "method": settings, "bodies": [body]})


def scaling_scene(particles: int) -> Any:
    """The usual basis and transfer with linear hardening."""
    return cube_scene(particles, "J2")


def kernel_tables(particles: int) -> list[tuple[Any, ...]]:
    """Whole steps on one core, and what they spend on the grid and on the material."""
    cases: list[tuple[str, dict[str, Any]]] = [
        ("J2", {"basis": basis}) for basis in ("linear", "ugimp", "quadratic-spline", "cubic-spline")
    ]
    cases += [("J2", {"transfer": "apic"}), ("J2", {"order": "musl"})]
    cases += [("Johnson-Cook", {}), ("J2", {"conduction": True})]
    names = ["basis", "flow stress", "option", "particles", "steps/s", "ns a step", "of them material"]
    title = "One core, three dimensions, float64, 8 particles a cell"
    return [(title, names, [_kernel_row(particles, flow, method) for flow, method in cases])]


def _kernel_row(particles: int, flow: str, method: dict[str, Any]) -> list[Any]:
    run = Steps(MPI.COMM_SELF, cube_scene(particles, flow, **method), 2)
    method_system: Any = run.simulation.systems[0]
    points = method_system.points
    step, material = best_time(run.advance) / run.steps, best_time(lambda: method_system.advance_stress(run.step))
    option = " ".join(key if value is True else str(value) for key, value in method.items() if key != "basis")
    nanoseconds = [f"{1e9 * seconds / points.owned:.0f}" for seconds in (step, material)]
    return [
        method.get("basis", "quadratic-spline"),
        flow,
        option,
        points.owned,
        f"{points.owned / step:.3g}",
        *nanoseconds,
    ]
