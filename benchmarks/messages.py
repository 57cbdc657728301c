"""python benchmarks/messages.py [CASE ...]: how many messages and bytes does a rank send in a step?

Runs small scenes on more ranks than the machine has processors and counts what their communicator is asked to send:
messages to neighbours, and collectives, by the arrays of one rank. Prints a row of the table of docs/decomposition.md a
case and number of ranks: means over the steps of what the mean rank and the busiest rank send.

    --ranks    one or several
    --steps    that are counted; as many before them are not, nor are begin and end of a run
"""

import argparse
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mesh_setup import write_cube
from mpi4py import MPI

from decomposition.plan import Messages
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Limits, Simulation

RUBBER = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
METAL = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
CASES = ("tlsph", "mesh", "mpm", "contact")

# of this rank so far: messages, their bytes, collectives, their bytes
COUNT = np.zeros(4)


def cube(low: float, side: int, material: dict[str, Any], velocity: list[Any]) -> dict[str, Any]:
    """A body of particles one apart from X = low on, that stand in a cube of cells."""
    box = {"lower": [low, 0.0, 0.0], "upper": [low + side, side, side]}
    body = {"name": f"from {low:g}", "shape": {"box": box}, "particles": [side] * 3, "placement": "cells"}
    return body | {"material": material, "velocity": velocity}


def scene_of(case: str, mesh: str) -> dict[str, Any]:
    """Tables of a case; mesh: path of the file of the case "mesh"."""
    more: dict[str, Any] = {}
    if case == "mesh":
        bodies: Any = [{"shape": {"mesh": {"file": mesh}}, "material": RUBBER, "velocity": ["-Y", "X", "0"]}]
    elif case == "contact":
        bodies = [cube(0.0, 12, RUBBER, [1.0, 0.0, 0.0]), cube(12.0, 12, RUBBER, [-1.0, 0.0, 0.0])]
        more = {"contact": [{"bodies": [body["name"] for body in bodies], "friction": 0.2}]}
    else:
        bodies = [cube(0.0, 16, METAL if case == "mpm" else RUBBER, ["-.1*Y", ".1*X", "-.2*Z"])]
    method = {"kind": "mpm", "cell": 2.0} if case == "mpm" else {"kind": "tlsph", "integrator": "leapfrog"}
    return {"dimension": 3, "end_time": 1e3, "method": method, "bodies": bodies} | more


# --- counting


def sent(arguments: tuple[Any, ...]) -> int:
    """Bytes of what a call of a communicator is given: of its last array, or of an object as it travels."""
    first = [one[0] if isinstance(one, list | tuple) else one for one in arguments]
    arrays = [one for one in first if isinstance(one, np.ndarray)]
    return arrays[-1].nbytes if arrays else sum(len(pickle.dumps(one)) for one in arguments[:1])


def counted(name: str, place: int) -> Callable[..., Any]:
    """A method of a communicator that is counted from a place of COUNT on."""
    plain = getattr(MPI.Intracomm, name)

    def call(self: Any, *arguments: Any, **more: Any) -> Any:
        COUNT[place : place + 2] += 1, sent(arguments)
        return plain(self, *arguments, **more)

    return call


class Counted(MPI.Intracomm):
    """A communicator that counts what it is asked to send; persistent messages are counted where they are started."""

    for _name in ("Send", "Isend", "Issend"):
        locals()[_name] = counted(_name, 0)
    for _name in ("Allreduce", "Iallreduce", "Allgather", "Exscan", "allreduce", "allgather", "bcast", "gather"):
        locals()[_name] = counted(_name, 2)
    for _name in ("scan", "exscan", "Barrier", "Ibarrier"):
        locals()[_name] = counted(_name, 2)


def count_steps(case: str, mesh: str, steps: int) -> None:
    """On all ranks: print the row of a case."""
    plain = Messages.send

    def send(self: Messages) -> None:
        COUNT[:2] += len(self._sends), self.outgoing.nbytes
        plain(self)

    Messages.send = send  # type: ignore[method-assign]
    comm = Counted(MPI.COMM_WORLD)
    sim = Simulation(comm, parse_scene(scene_of(case, mesh)))
    found = []
    for some in (steps, 1, steps + 1):
        COUNT[:] = 0.0
        sim.run(limits=Limits(steps=some))
        found.append(COUNT.copy())
    # the last two begin and end alike
    mine = (found[2] - found[1]) / steps
    most, total = MPI.COMM_WORLD.allreduce(mine, np.maximum), MPI.COMM_WORLD.allreduce(mine)
    if comm.rank == 0:
        mean = total / comm.size
        pairs = [f"{mean[k] / by:.3g} | {most[k] / by:.3g}" for k, by in enumerate((1.0, 1e3))]
        print(f"| {case} | {sim.particles} | {comm.size} | {' | '.join(pairs)} | {mean[2]:.3g} | {mean[3]:.3g} |")


def main() -> None:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {', '.join(CASES)}")
    parser.add_argument("--ranks", type=int, nargs="+", default=[64])
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--read", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.read:
        count_steps(options.cases[0], options.read, options.steps)
        return
    print("| case | particles | ranks | messages: mean | most | kB: mean | most | collectives | their bytes |")
    print("|---|---|---|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "cube.msh"
        write_cube(mesh, 16)
        for case in options.cases or CASES:
            for ranks in options.ranks:
                words = [sys.executable, __file__, case, "--read", str(mesh), "--steps", str(options.steps)]
                ranked = ["mpirun", "-n", str(ranks), *words]
                subprocess.run(ranked, check=True, env=os.environ | {"OMP_NUM_THREADS": "1"})


if __name__ == "__main__":
    main()
