"""`parsolid bench`: speed of a method on this machine, in steps/s and nanoseconds per particle and step.

Every figure is the best of several repetitions, because other programs only slow a repetition down.
"""

import time
from collections.abc import Callable
from typing import Any

from mpi4py import MPI

from parsolid.commands.arguments import show_table, whole_number
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation
from parsolid.simulation.warmup import wait_quietly

REPETITIONS, STEPS = 7, 3
_MICRO_INERTIA = {
    "l1 l2 l3": ("energetic_length", "hardening_length", "dissipative_length", "flux_relaxation_time"),
    "t_pi": ("stress_relaxation_time",),
    "heat": ("conductivity", "heat_relaxation_time"),
}
# method -> timed settings and changes of the material; the first case is also timed on all ranks
CASES: dict[str, list[tuple[dict[str, Any], dict[str, Any]]]] = {
    "tlsph": [
        ({"smoothing": smoothing, "integrator": integrator, "weights": "kernel"}, {"branches": branches})
        for integrator in ("ssp-rk3", "leapfrog")
        for smoothing in (0.85, 1.2)
        for branches in (1, 0)
    ],
    "peridynamics": [
        ({"horizon_ratio": ratio, "stabilisation": {"kind": stabilisation}}, {"terms": terms})
        for ratio, stabilisation, terms in (
            (3.0, "shear-scaled", 1),
            (2.0, "shear-scaled", 1),
            (3.0, "none", 0),
            (3.0, "shear-scaled", 0),
        )
    ],
    "mpm": [
        *(({"basis": basis}, {}) for basis in ("quadratic-spline", "linear", "ugimp", "cubic-spline")),
        *(({key: value}, {}) for key, value in (("transfer", "apic"), ("order", "musl"), ("conduction", True))),
        ({}, {"flow_stress": None}),
    ],
    "ulsph": [
        ({}, {}),
        *(({}, dict.fromkeys(left_out, 0.0)) for left_out in _MICRO_INERTIA.values()),
        ({}, dict.fromkeys((key for keys in _MICRO_INERTIA.values() for key in keys), 0.0)),
        ({"gradient_correction": False}, {}),
        ({"viscosity": False}, {}),
    ],
}
METHODS = tuple(CASES)


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    parser.add_argument("--method", default=METHODS[0], choices=METHODS, help=f"the method (default {METHODS[0]})")
    about = "about how many particles (default 28000)"
    parser.add_argument("--particles", type=whole_number, default=28000, metavar="N", help=about)
    scaling = "also measure whole steps on all ranks with N particles"
    parser.add_argument("--scaling", type=whole_number, metavar="N", help=scaling)


def run_bench(comm: MPI.Comm, options: Any) -> int:
    """Print a method's tables on rank 0; exit status 0. Collective."""
    if comm.rank == 0:
        names = ["settings", "material", "particles", "steps/s", "ns a particle-step"]
        title = "Whole steps on one core, processor time, float64"
        show_table(title, names, [_row(options.method, options.particles, *case) for case in CASES[options.method]])
    wait_quietly(comm)
    if options.scaling:
        # on one rank while the others wait, then on all
        scene, alone = bench_scene(options.method, options.scaling, *CASES[options.method][0]), None
        if comm.rank == 0:
            alone, _ = step_time(MPI.COMM_SELF, scene, time.perf_counter)
        wait_quietly(comm)
        alone = comm.bcast(alone)
        together, total = step_time(comm, scene, time.perf_counter)
        speeds = [f"{total / alone:.3g}", f"{total / together / comm.size:.3g}"]
        rows = [[1, total, speeds[0], 1.0], [comm.size, total, speeds[1], f"{alone / together:.2f}"]]
        if comm.rank == 0:
            show_table("Whole steps", ["ranks", "particles", "steps/s a rank", "speed-up"], rows)
    return 0


def _row(method: str, particles: int, settings: dict[str, Any], material: dict[str, Any]) -> list[Any]:
    seconds, count = step_time(MPI.COMM_SELF, bench_scene(method, particles, settings, material), time.process_time)
    words = [", ".join(f"{key} {value}" for key, value in stated.items()) for stated in (settings, material)]
    return [*words, count, f"{1.0 / seconds:.3g}", f"{1e9 * seconds / count:.0f}"]


def step_time(comm: MPI.Comm, scene: Any, clock: Callable[[], float]) -> tuple[float, int]:
    """Time of a step [s] in the best repetition on the slowest rank, and particles of all ranks; collective."""
    simulation = Simulation(comm, scene)
    step, least = 0.1 * comm.allreduce(simulation.systems[0].stable_step(), MPI.MIN), float("inf")
    # one more, because the first loads the kernels
    for _ in range(1 + REPETITIONS):
        began = clock()
        for _ in range(STEPS):
            simulation.take_step(step)
        least = min(least, (clock() - began) / STEPS)
    return comm.allreduce(least, MPI.MAX), simulation.particles


def bench_scene(method: str, particles: int, settings: dict[str, Any], material: dict[str, Any]) -> Any:
    """A free cube of about so many particles with a slow motion; for `ulsph` two steel plates that collide at 208 m/s
    each; for `mpm` copper with 8 particles a cell that flows from the first step on."""
    side = max(3, round(particles ** (1.0 / 3.0)))
    body: dict[str, Any] = {
        "shape": {"box": {"lower": [0.0, 0.0, 0.0], "upper": [1.0, 1.0, 1.0]}},
        "particles": [side, side, side],
        "velocity": ["sin(pi*Y)", "0.5*sin(pi*Z)", "0.25*sin(pi*X)"],
    }
    if method == "ulsph":
        return _plates(particles, settings, material)
    if method == "tlsph":
        rubber = {"kind": "mooney-rivlin", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.45}
        body["material"] = rubber | {"branches": [{"beta": 1.0, "tau": 0.02}] * material["branches"]}
    elif method == "peridynamics":
        series: dict[str, Any] = {"kind": "prony", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.25}
        body |= {
            "placement": "cells",
            "material": series | {"terms": [{"ratio": 1.0, "tau": 0.02}] * material["terms"]},
        }
    else:
        cells = max(2, side // 2)
        perfect = {"kind": "linear-hardening", "yield_stress": 90e6, "hardening": 100e6}
        copper = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook", "flow_stress": perfect} | material
        body |= {"particles": [2 * cells] * 3, "placement": "cells", "material": copper}
        body["velocity"] = ["2000*sin(pi*Y)", "1000*sin(pi*Z)", "500*sin(pi*X)"]
        settings = {"cell": 1.0 / cells, "conduction": False} | settings
    tables = {"title": "bench", "dimension": 3, "end_time": 1.0, "bodies": [body]}
    return parse_scene(tables | {"method": {"kind": method} | settings})


def _plates(particles: int, settings: dict[str, Any], material: dict[str, Any]) -> Any:
    """The impact of Rahaman's paper in plane strain."""
    size = (particles / (2.0 * 71 * 21)) ** 0.5
    count, steel = [max(4, round(size * 71)), max(4, round(size * 21))], "4340 steel, Rahaman"
    edge, bodies = 0.36e-3 / size, []
    for k, speed in enumerate(("208", "-208")):
        length, width = edge * count[0], edge * count[1]
        box = {"lower": [k * length, 0.0], "upper": [(k + 1) * length, width]}
        body = {"shape": {"box": box}, "particles": count, "placement": "cells", "velocity": [speed, 0.0]}
        bodies.append(body | {"material": {"kind": "micro-inertia", "library": steel} | material})
    tables = {"title": "bench", "dimension": 2, "end_time": 1.0, "bodies": bodies, "bond": [{"bodies": "all"}]}
    return parse_scene(tables | {"method": {"kind": "ulsph"} | settings})
