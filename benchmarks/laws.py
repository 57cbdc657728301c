"""python benchmarks/laws.py [--methods NAME ...] [--laws NAME ...]: what does each law of solids cost?

Steps one block with each law and with the Mooney-Rivlin law in alternation, in each method, and prints nanoseconds of
processor time a particle and step and the median and quartiles of the ratios to Mooney-Rivlin of all pairs. Metals and
soils flow in all particles.

    --particles    along an edge of the block
    --steps        of each of both in a pair
    --pairs        of runs
"""

import argparse
import time

import numpy as np
from mpi4py import MPI

from parsolid.materials import registry
from parsolid.scene import parse_scene
from parsolid.scene.plasticity import library
from parsolid.simulation.loop import Simulation

BESIDE = "mooney-rivlin"
BULK = {"bulk_modulus": 2e7}
FIBRES = {"shear_modulus": 1e6, "fibre_modulus": 5e5, "fibre_exponent": 0.8, "fibre": {"angle": "atan2(Y, X)"}, **BULK}
SECOND = {"second_fibre": {"vector": ["0", "0.6", "0.8"]}}
SOFTENING = {"softening": {"r": 2.0, "m": 1e4}}
LAWS = {
    BESIDE: {"kind": BESIDE, "xi": 3e5, "zeta": 2e5, "lambda_hat": 4e6},
    "neo-hookean": {"kind": "neo-hookean", "youngs_modulus": 3e6, "poissons_ratio": 0.45},
    "yeoh": {"kind": "yeoh", "c1": 0.5e6, "c2": -1.5e3, "c3": 50.0, **BULK},
    "gent": {"kind": "gent", "shear_modulus": 1e6, "limit": 90.0, **BULK},
    "arruda-boyce": {"kind": "arruda-boyce", "modulus": 1e6, "locking_stretch": 2.8, **BULK},
    "ogden": {"kind": "ogden", "mu_1": 0.63e6, "alpha_1": 1.3, "mu_2": -0.01e6, "alpha_2": -2.0, **BULK},
    "polynomial": {"kind": "polynomial", "c10": 0.5e6, "c01": 0.02e6, "c11": 2e3, **BULK},
    "hencky": {"kind": "hencky", "shear_modulus": 1e6, **BULK},
    "saint-venant-kirchhoff": {"kind": "saint-venant-kirchhoff", "youngs_modulus": 3e6, "poissons_ratio": 0.45},
    "mazars": {
        "kind": "mazars",
        "youngs_modulus": 3e6,
        "poissons_ratio": 0.2,
        "tensile_strength": 3e4,
        "fracture_energy": 1e3,
    },
    "formula": {
        "kind": "formula",
        "energy": "mu/2*(I1bar - 3) + K/2*(J - 1)**2",
        "constants": {"mu": 1e6, "K": 2e7},
    },
    "holzapfel-gasser-ogden": {"kind": "holzapfel-gasser-ogden", **FIBRES},
    "gasser-ogden-holzapfel": {"kind": "gasser-ogden-holzapfel", "dispersion": 0.2, **FIBRES},
    "gasser-ogden-holzapfel, two families": {"kind": "gasser-ogden-holzapfel", "dispersion": 0.2, **FIBRES, **SECOND},
    "guccione": {
        "kind": "guccione",
        "stiffness": 1e6,
        "along": 4.0,
        "across": 1.0,
        "shear": 2.0,
        "fibre": {"angle": "atan2(Y, X)"},
        **BULK,
    },
    "mooney-rivlin, softening": {"kind": BESIDE, "xi": 3e5, "zeta": 2e5, "lambda_hat": 4e6, **SOFTENING},
    "yeoh, softening": {"kind": "yeoh", "c1": 0.5e6, "c2": -1.5e3, "c3": 50.0, **BULK, **SOFTENING},
}
BRANCHES = {"branches": [{"modulus": 5e5, "tau": 1e-2}, {"modulus": 5e5, "tau": 1.0}]}
LAWS["mooney-rivlin, two branches"] = LAWS[BESIDE] | BRANCHES
LINEAR = "linear-hardening"
COPPER = {
    "kind": "elastic-plastic",
    "density": 8930.0,
    "specific_heat": 383.0,
    "taylor_quinney": 0.9,
    "equation_of_state": {"kind": "mie-grueneisen", "sound_speed": 3940.0, "slope": 1.489, "gamma": 2.02},
    "shear_modulus": {"kind": "constant", "modulus": 47.7e9},
    "flow_stress": {"kind": LINEAR, "yield_stress": 90e6, "hardening": 100e6},
}
SOIL = COPPER | {
    "density": 1600.0,
    "specific_heat": 800.0,
    "equation_of_state": {"kind": "linear", "bulk_modulus": 2e7},
    "shear_modulus": {"kind": "constant", "modulus": 1e7},
    "flow_stress": {"kind": "drucker-prager", "friction_angle": 35, "cohesion": 1e3},
}
FLOWS = {
    LINEAR: COPPER,
    "armstrong-frederick": COPPER
    | {"kinematic_hardening": {"kind": "armstrong-frederick", "modulus": 2e9, "recovery": 20}},
    "voce": COPPER
    | {"flow_stress": {"kind": "voce", "yield_stress": 90e6, "saturation": 100e6, "exponent": 16.9, "hardening": 1e8}},
    "drucker-prager": SOIL,
}
for name, one in library().items():
    FLOWS.setdefault(one.flow_stress.kind, {"kind": "elastic-plastic", "library": name})
METHODS = {
    "tlsph box": ({"kind": "tlsph"}, {}),
    "tlsph list": ({"kind": "tlsph"}, {"jitter": 0.1}),
    "peridynamics": ({"kind": "peridynamics"}, {}),
    "mpm": ({"kind": "mpm"}, {"placement": "cells"}),
    "ulsph": ({"kind": "ulsph"}, {"placement": "cells"}),
}


class Block:
    """A block that swings, with a law and a method."""

    def __init__(self, law: str, method: str, particles: int) -> None:
        settings, body = METHODS[method]
        more = {"cell": 2.0 / particles} if settings["kind"] == "mpm" else {}
        if law == "mazars" and settings["kind"] == "peridynamics":
            more = {"stabilisation": {"kind": "none"}}
        material = FLOWS[law] if law in FLOWS else LAWS[law] | {"density": 1000.0}
        # metals yield at strains of 1e-3 and have waves of 4 km/s
        speed = 1.0 if law in LAWS else 5.0 if law == "drucker-prager" else 500.0
        table = {
            "shape": {"box": {"lower": [0.0] * 3, "upper": [1.0] * 3}},
            "particles": [particles] * 3,
            "velocity": [f"{speed}*Y", f"{speed}*0.5*X*X", f"{speed}*X*Z"],
            "material": material,
            **body,
        }
        scene = parse_scene({"dimension": 3, "end_time": 1.0, "method": settings | more, "bodies": [table]})
        self.simulation = Simulation(MPI.COMM_SELF, scene)
        self.particles = particles**3
        # what begins or compiles is no part of a step
        self.advance(2)

    def advance(self, steps: int) -> float:
        """Nanoseconds of processor time a particle and step."""
        step = 0.3 * self.simulation.systems[0].stable_step()
        start = time.process_time_ns()
        for _ in range(steps):
            assert self.simulation.take_step(step) is not False
        return (time.process_time_ns() - start) / (steps * self.particles)


def compare(method: str, law: str, options: argparse.Namespace) -> None:
    """Print a line of a law in a method."""
    beside, block = (Block(name, method, options.particles) for name in (BESIDE, law))
    pairs = np.array([(beside.advance(options.steps), block.advance(options.steps)) for _ in range(options.pairs)])
    low, middle, high = np.percentile(pairs[:, 1] / pairs[:, 0], [25, 50, 75])
    print(f"{method:13} {law:37} {np.median(pairs[:, 1]):7.0f} ns  {middle:5.2f} ({low:.2f} to {high:.2f})", flush=True)


def main() -> None:
    """Compare what is asked for, every law in every method unless told."""
    assert set(registry.own_kinds("hyperelastic")) <= {table["kind"] for table in LAWS.values()}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--laws", nargs="+", choices=LAWS | FLOWS, default=list(LAWS | FLOWS))
    parser.add_argument("--particles", type=int, default=24)
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--pairs", type=int, default=7)
    options = parser.parse_args()
    for method in options.methods:
        for law in options.laws:
            compare(method, law, options)


if __name__ == "__main__":
    main()
