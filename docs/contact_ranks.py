"""Contact on several ranks: mpirun -n 5 python docs/contact_ranks.py ranks [names of scenes]; restarts: of runs stopped
in the middle of stick, on as many ranks, to the bit; killed: of runs that are killed and restarted."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import meshio
import numpy as np
from contact_tables import BONDS, LEAPFROG, SPEED, Rows, Tables, block, discs_scene, material, one_of, run, scene
from mpi4py import MPI

from parsolid.output.checkpoint import write_checkpoint
from parsolid.output.history import read_history
from parsolid.scene import dump_scene, parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.checkpoints import header_of
from parsolid.simulation.loop import Limits, Simulation
from parsolid.simulation.restart import Restart
from parsolid.simulation.scene_changes import contents

COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
STUCK = "stick_energy"


def far_apart() -> Tables:
    """Five blocks in a row, of which the first is moved above the last: their ranks are no neighbours in the
    reference."""
    h = 0.125
    bodies = [block(name, [1.5 * i, 0.0], [1.5 * i + 1.0, 1.0], h) for i, name in enumerate("abcde")]
    bodies[0] |= {"displacement": ["6.1", "1.01"], "velocity": [0.02 * SPEED, -0.1 * SPEED]}
    bodies[1] |= {"velocity": [0.3 * SPEED, 0.0]}
    contact = {"friction": 0.3}
    return scene(bodies, 3.0 / SPEED, contact, method=LEAPFROG)


def metals(kind: str) -> Tables:
    """Two blocks of copper that rub and part, in material points or updated-Lagrangian SPH, whose particles migrate."""
    method = {"kind": "mpm", "cell": 2e-3, "order": "musl"} if kind == "mpm" else {"kind": "ulsph"}
    boxes = {"top": ([0.2e-3, 0.0], [12.2e-3, 6e-3], [60.0, -30.0]), "base": ([-2e-3, -6e-3], [18e-3, 0.0], [0, 30.0])}
    bodies = [
        block(name, low, high, 1e-3, "cells", velocity=list(v), material=COPPER)
        for name, (low, high, v) in boxes.items()
    ]
    return scene(bodies, 8e-6, {"friction": 0.3}, method=method)


def three_in_space() -> Tables:
    """Three cubes meet in space off their centres, with friction."""
    h, v = 0.25, 0.1 * SPEED
    corners = {"a": ([-1.02, 0.0, 0.0], [v, 0, 0]), "b": ([0.0, 0.1, 0.05], [-v, 0, 0])}
    corners["c"] = ([-0.5, 1.11, 0.1], [0.0, -v, 0.0])
    bodies = [block(name, low, [x + 1.0 for x in low], h, velocity=one) for name, (low, one) in corners.items()]
    return scene(bodies, 1.5 / SPEED, {"friction": 0.2})


def mixed() -> Tables:
    """Blocks of three methods on one another that rub, below a slanting tool of a mesh that presses and rubs."""
    v, comm = 0.02 * SPEED, MPI.COMM_WORLD
    folder = comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None)
    file = os.path.join(folder, "tool.vtk")
    if comm.rank == 0:
        points = [[-3.0, 9.4, 0.0], [8.0, 8.8, 0.0], [8.0, 12.0, 0.0], [-3.0, 12.0, 0.0]]
        meshio.Mesh(points, [("line", [[0, 1], [1, 2], [2, 3], [3, 0]])]).write(file)
    comm.Barrier()
    boxes = {
        "soft": ([0.0, 0.0], "vertices", v),
        "bonds": ([0.3, 3.0], "cells", 0.0),
        "points": ([0.1, 6.0], "cells", -v),
    }
    bodies = [
        block(name, low, [low[0] + 4.0, low[1] + 3.0], 1.0, placement, velocity=[push, -v * i])
        | {"method": name, "material": material(kind="linear-elastic" if name == "bonds" else "neo-hookean")}
        for i, (name, (low, placement, push)) in enumerate(boxes.items())
    ]
    methods = [LEAPFROG, BONDS, {"kind": "mpm", "cell": 2.0}]
    tables = scene(bodies, 20.0 / SPEED, {"friction": 0.3})
    del tables["method"]
    tables["methods"] = [one | {"name": name} for one, name in zip(methods, boxes)]
    motion = {"velocity": [f"{v}", f"-{2.0 * v}"]}
    tool = {"name": "tool", "shape": {"mesh": {"file": file}}, "friction": 0.3, "motion": motion}
    return tables | {"tools": [tool]}


SCENES = {
    "discs with friction": lambda: discs_scene(0.8, 0.3, 12),
    "blocks whose ranks are no neighbours": far_apart,
    "ulsph": lambda: metals("ulsph"),
    "mpm": lambda: metals("mpm"),
    "grid": lambda: metals("mpm") | {"contact": [{"bodies": ["top", "base"], "friction": 0.3, "model": "grid"}]},
    "three in space": three_in_space,
    "mixed, with a mesh as tool": mixed,
}


def ranks() -> None:
    """Histories on as many ranks as there are against those on one: the largest difference, of the energy."""
    comm = MPI.COMM_WORLD
    for name, make in SCENES.items():
        if sys.argv[2:] and name not in sys.argv[2:]:
            continue
        tables = make()
        _, columns = run(tables, comm=comm)
        if comm.rank == 0:
            _, alone = run(tables)
            print(f"{name}, {comm.size} ranks: {difference(columns, alone)}", flush=True)


def restarts() -> None:
    """Scenes that are stopped while particles stick and restarted on as many ranks: fields and columns that differ."""
    comm = MPI.COMM_WORLD
    for name, make in SCENES.items():
        if sys.argv[2:] and name not in sys.argv[2:]:
            continue
        stated = parse_scene(make())
        whole, rows = Simulation(comm, stated), Rows()
        met = "contact_energy" if "contact_energy" in whole.energy_row() else whole.ledger.stored
        while (
            not rows.rows or rows.rows[-1][met] < 1e-3 * rows.rows[0]["kinetic"] or rows.rows[-1].get(STUCK, 1.0) <= 0
        ):
            whole.run(None, [rows], Limits(4))
        with tempfile.TemporaryDirectory() as folder:
            file = Path(comm.bcast(folder)) / "checkpoint.h5"
            fields = [system.particles.checkpointed() for system in whole.systems]
            write_checkpoint(comm, file, header_of(whole, {}, {}, contents(stated)), fields, whole.ledger.values)
            start, stuck = whole.clock.step, rows.rows[-1].get(STUCK, 0.0)
            whole.run(None, [rows], Limits(20))
            again, others = Simulation(comm, stated, Restart(comm, file)), Rows()
            again.run(None, [others], Limits(20))
            comm.Barrier()
        length = len(others.rows)
        columns = [
            one for one in others.rows[0] if any(a[one] != b[one] for a, b in zip(others.rows, rows.rows[-length:]))
        ]
        pairs = [(a.particles.checkpointed(), b.particles.checkpointed()) for a, b in zip(whole.systems, again.systems)]
        unlike = {one for a, b in pairs for one in a if np.array(a[one]).tobytes() != np.array(b[one]).tobytes()}
        found = sorted(set().union(*comm.allgather(unlike)))
        if comm.rank == 0:
            print(
                f"{name}, {comm.size} ranks, restarted at step {start} with a stick energy of {stuck:.1e} J, "
                f"{whole.clock.step - start} steps on: fields that differ {found}, columns that differ {columns}",
                flush=True,
            )


def difference(columns: Tables, alone: Tables) -> str:
    """The largest one of any column, of the largest kinetic energy, and when there was contact."""
    scale, worst = alone["kinetic"].max(), 0.0
    for name, values in alone.items():
        length = min(len(values), len(columns[name]))
        over = np.abs(values).max() if name == "time" else scale
        worst = max(worst, float(np.abs(values[:length] - columns[name][:length]).max() / over))
    met = np.count_nonzero(
        alone["contact_energy"] if "contact_energy" in alone else np.gradient(alone[stored_energy(alone)])
    )
    return f"{worst:.1e} in {len(alone['time'])} steps, {met} of them in contact"


def killed() -> None:
    """Runs that are killed on all ranks in the middle of contact and restarted on another number, to the end; of the
    scenes that are named, or of metals."""
    for kind in sys.argv[2:] or ("ulsph", "mpm"):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            output = {"history_steps": 1, "checkpoint_steps": 5, "fields_times": []}
            file = folder / "scene.toml"
            dump_scene(parse_scene(SCENES[kind]() | {"output": output}), file)
            start(1, file, folder / "whole").wait()
            last, told = len(read_history(folder / "whole" / "history.csv")["step"]) - 1, []
            for count, (processes, until) in enumerate(((3, last // 3), (2, 2 * last // 3), (4, None))):
                job = start(processes, file, folder / "pieces", restart=count > 0)
                told.append(f"{processes} ranks to {kill_at(job, folder / 'pieces', until)}")
            whole, pieces = (read_history(folder / one / "history.csv") for one in ("whole", "pieces"))
            columns = [{name: np.array(one[name]) for name in one if name != "step"} for one in (whole, pieces)]
            migrated = json.loads((folder / "pieces" / "summary.json").read_text()).get("migrated_particles")
            found = difference(columns[1], columns[0])
            print(f"{kind}: {', '.join(told)}; {migrated} particles changed their rank at last; {found}", flush=True)


def start(processes: int, file: Path, output: Path, restart: bool = False) -> "subprocess.Popen[bytes]":
    """A run in a session of its own."""
    command = ["mpirun", "-n", str(processes), sys.executable, "-m", "parsolid", "run", str(file), "-q"]
    return subprocess.Popen([*command, "-o", str(output), *["--restart"] * restart], start_new_session=True)


def kill_at(job: "subprocess.Popen[bytes]", output: Path, step: int | None) -> str:
    """SIGKILL to all processes of a run when its history has come to a step; the step it had come to, or its end."""
    file, last = output / "history.csv", 0
    while job.poll() is None:
        rows = file.read_text().splitlines() if file.exists() else []
        last = int(rows[-1].split(",")[0]) if len(rows) > 1 and rows[-1].split(",")[0].isdigit() else last
        if step is not None and last >= step:
            os.killpg(job.pid, signal.SIGKILL)
            job.wait()
            return f"step {last}, killed"
        time.sleep(0.002)
    if job.returncode:
        raise SystemExit(f"ended with status {job.returncode}")
    return "the end"


if __name__ == "__main__":
    one_of((ranks, restarts, killed))
