"""A new method is one folder, a new smoothing kernel one file: run by the command line like any other."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

SETTINGS = '''
from typing import ClassVar, Literal
from parsolid.scene.method_settings import MethodSettings

class Flight(MethodSettings):
    """Particles that fly without forces."""

    system: ClassVar = "parsolid.methods.flight.system:FreeFlight"
    materials: ClassVar = ("hyperelastic",)
    extra_fields: ClassVar = {"flown": "scalar"}
    kind: Literal["flight"]
    step: float = 0.125
'''
SYSTEM = """
import numpy as np
from parsolid.materials.blocks import material_blocks
from parsolid.materials.registry import laws_of
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field
from parsolid.particles.initial_fields import initial_velocity

class FreeFlight(ParticleSystem):
    def __init__(self, comm, scene, particle_set):
        self.comm, self.settings = comm, scene.method
        self.owned, self.dimension = particle_set.position.shape
        _, density = material_blocks(laws_of(scene), particle_set.body)
        self.particles = particles = Particles(particle_set.body)
        kept, d = {"checkpointed": True}, self.dimension
        particles.declare(Field("mass", 1, "kg", **kept), density * particle_set.volume)
        particles.declare(Field("identifier", 1, "1", whole=True, **kept), particle_set.identifier)
        particles.declare(Field("reference_position", d, "m", **kept), particle_set.position)
        particles.declare(Field("volume", 1, "m^3", **kept), particle_set.volume)
        particles.declare(Field("spacing", d, "m", **kept), particle_set.spacing)
        particles.declare(Field("area", d, "m^2", **kept), particle_set.area)
        particles.declare(Field("position", d, "m", **kept), particle_set.position)
        particles.declare(Field("velocity", d, "m/s", shown=True, **kept))
        particles.declare(Field("jacobian", 1, "1", **kept), 1.0)
        particles.declare(Field("flown", 1, "m", shown=True, **kept))

    def begin(self, scene, particle_set):
        self.particles.owned_rows("velocity")[:] = initial_velocity(scene, particle_set.body, particle_set.position)

    def stable_step(self):
        return self.settings.step

    def advance_positions(self, time, step, ledger):
        rows = self.particles.owned_rows
        rows("position")[:] += step * rows("velocity")
        rows("flown")[:] += step * np.linalg.norm(rows("velocity"), axis=1)

    def complete_step(self, time, step, ledger, announce):
        announce(True, self.stable_step())
        return True

    def energies(self):
        return 0.5 * float(self.mass @ (self.particles.owned_rows("velocity") ** 2).sum(axis=1)), 0.0

    def shown(self, name, first, last):
        if name == "deformation_gradient":
            return np.tile(np.eye(3), (last - first, 1, 1))
        return np.zeros((last - first, 3, 3)) if name == "stress" else None
"""
SCENE = """
title = "Flight"
dimension = 2
end_time = 1.0
[method]
kind = "flight"
[[bodies]]
shape = { box = { lower = [0, 0], upper = [1, 1] } }
particles = [4, 4]
velocity = ["3", "4*X"]
material = { kind = "neo-hookean", density = 1000, youngs_modulus = 1e6, poissons_ratio = 0.3 }
# at rest and apart
[[bodies]]
shape = { box = { lower = [0, 9], upper = [1, 10] } }
particles = [4, 4]
material = { kind = "neo-hookean", density = 1000, youngs_modulus = 1e6, poissons_ratio = 0.3 }
[[probes]]
name = "corner"
at = [1, 1]
fields = ["position", "flown"]
"""
KERNEL = '''
import math
from typing import NamedTuple
from parsolid.pairs.smoothing.gradient import gradient_factor

class Poly6(NamedTuple):
    """(1 - q^2/4)^3, support 2 h."""

    support: float = 2.0

KERNEL = Poly6()

@gradient_factor.of(Poly6)
def _gradient(kernel, q, dimension):
    c = 1.0 / math.pi if dimension == 2 else 315.0 / (512.0 * math.pi)
    return -1.5 * c * max(0.0, 1.0 - 0.25 * q * q) ** 2
'''
# the folders join those of the package before the commands start
START = """
import contextlib, io, json, sys, parsolid.methods, parsolid.pairs.smoothing
parsolid.methods.__path__.append("methods")
parsolid.pairs.smoothing.__path__.append("smoothing")
from parsolid.commands.cli import main
ended = []
for words in json.loads(sys.argv[1]):
    with contextlib.redirect_stderr(io.StringIO()) as said:
        ended.append([main(words), said.getvalue()])
print(json.dumps(ended))
"""


def parsolid(folder: Path, *commands: list[str]) -> list[tuple[int, str]]:
    """Exit status and what was said to stderr of commands, one after the other in one process."""
    command = [sys.executable, "-c", START, json.dumps(commands)]
    # kernels of types that only this process knows
    kernels = {"NUMBA_CACHE_DIR": str(folder / "kernels")}
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MPI4PY_RC_INITIALIZE": "true"} | kernels
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_method_is_one_folder(tmp_path):
    room = tmp_path / "methods" / "flight"
    room.mkdir(parents=True)
    (room / "__init__.py").write_text('"""Free flight."""\n')
    (room / "settings.py").write_text(SETTINGS)
    (room / "system.py").write_text(SYSTEM)
    (tmp_path / "flight.toml").write_text(SCENE)
    run = ["run", "flight.toml", "-o", "out", "-q"]
    other = ["run", "flight.toml", "-o", "out2", "--set", "method.step=true"]
    done, again, refused = parsolid(tmp_path, [*run, "--max-steps", "4"], [*run, "--restart"], other)
    assert (done[0], again[0]) == (0, 0), done[1] + again[1]
    rows = list(csv.DictReader((tmp_path / "out" / "history.csv").open()))
    assert float(rows[-1]["time"]) == 1.0 and int(rows[-1]["step"]) >= 8
    place = [float(rows[-1][f"corner.position_{axis}"]) for axis in "xy"]
    assert place == pytest.approx([4.0, 5.0], rel=1e-12)
    # a field that the folder alone declares
    assert float(rows[-1]["corner.flown"]) == pytest.approx(5.0, rel=1e-12)
    assert refused[0] == 2 and "method.step" in refused[1]


@pytest.mark.long
def test_a_smoothing_kernel_is_one_file(tmp_path):
    (tmp_path / "smoothing").mkdir()
    (tmp_path / "smoothing" / "poly6.py").write_text(KERNEL)
    punch, kernels = str(ROOT / "runs" / "tlsph" / "punch.toml"), ("poly6", "wendland-c2", "poly7")
    options = ["--set", "bodies.0.particles=[9,9]", "--max-steps", "20", "-q", "--set", "output.pictures=false"]
    *runs, refused = parsolid(
        tmp_path, *(["run", punch, "-o", name, *options, "--set", f"method.kernel={name!r}"] for name in kernels)
    )
    assert [status for status, _ in runs] == [0, 0], runs
    ends = [list(csv.DictReader((tmp_path / name / "history.csv").open()))[-1] for name in kernels[:2]]
    # another kernel, the same punch
    assert ends[0]["time"] == ends[1]["time"] or float(ends[0]["time"]) > 0.0
    kinetic = [float(end["kinetic"]) for end in ends]
    assert kinetic[0] != kinetic[1] and kinetic[0] == pytest.approx(kinetic[1], rel=0.02)
    assert refused[0] == 2 and "'poly6'" in refused[1]
