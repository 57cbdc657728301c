"""The same run on all ranks and on one: every value of every history equal to 1e-9 of its maximum.

On one rank this compares two runs on one rank; mpirun -n 2 and -n 3 make it the real thing.
"""

import re

import numpy as np
import pytest
from solids import ONE_BRANCH, RUBBER, assert_same_fields, column, evolved, punch, run_steps, supports, tables

from parsolid.observables.declared import Observables
from parsolid.scene.observation import ENERGIES, INTERNAL_ENERGY
from parsolid.simulation.history import Probes

AGREEMENT = 1e-9
STEPS = 60


def ring() -> dict:
    """A quarter ring with two mirror planes: particles with their own axes and unequal spacings."""
    shape = {"cylindrical_shell": {"centre": [0.0, 0.0], "radius": 1.0, "thickness": 0.4, "angles": [0.0, 90.0]}}
    data = tables(
        [17, 5],
        material={**RUBBER, "branches": [{"beta": 3.0, "tau": 0.02}]},
        boundaries=supports(X=(0.0, "roller"), Y=(0.0, "roller")),
    )
    data["bodies"][0] |= {"shape": shape, "velocity": ["20*X*Y", "-15*Y"]}
    return data


def pulled() -> dict:
    """A bar with gravity, a traction, and an end that moves as prescribed."""
    return tables(
        (13, 7),
        [2.0, 1.0],
        material={**RUBBER, "branches": ONE_BRANCH},
        loads={"acceleration": ["0", "-200"]},
        boundaries=[
            {"plane": "X = 0", "kind": "fixed"},
            {"plane": "X = 2", "kind": "velocity", "velocity": ["10*sin(500*t)", "free"]},
            {"plane": "Y = 1", "kind": "traction", "traction": ["0", "-1e5*X"]},
        ],
    )


def with_probes(data: dict) -> dict:
    upper = data["bodies"][0]["shape"].get("box", {}).get("upper", [0.0, 1.0])
    fields = ["displacement", "velocity", "stress", "jacobian"]
    data["probes"] = [{"name": "corner", "at": upper, "fields": fields}]
    for quantity in ("linear_momentum", "angular_momentum", "maximum_speed", "minimum_jacobian"):
        data["probes"].append({"name": quantity, "quantity": quantity})
    return data


def history(data: dict, comm) -> tuple[dict, object]:
    probes = {}

    def sample(sim) -> dict:
        if not probes:
            probes["all"] = Probes(sim.comm, sim.scene, Observables(sim.systems))
        return dict(zip(probes["all"].columns, probes["all"].sample()))

    sim, columns = run_steps(with_probes(data), STEPS, comm, sample)
    return columns, sim


def stem(column: str) -> str:
    """A column's name without its component."""
    return re.sub("_[xyz]+$", "", column)


def leapfrog(scene):
    """The same with one force evaluation a step."""
    data = scene()
    data["method"]["integrator"] = "leapfrog"
    return data


LEAPS = [lambda: leapfrog(column), lambda: leapfrog(pulled)]


@pytest.mark.parametrize("scene", [punch, column, ring, pulled, *LEAPS])
def test_histories_and_fields_do_not_depend_on_the_ranks(scene, comm):
    alone = comm.Split(comm.rank)
    (many, spread), (one, single) = history(scene(), comm), history(scene(), alone)
    assert {*ENERGIES, "energy_error"} - {INTERNAL_ENERGY} < set(one) and len(one["time"]) == STEPS + 1
    assert len(spread.systems[0].particles.owned_rows("identifier")) < single.particles or comm.size == 1
    # a component of a vector or tensor is compared with the greatest of all: some vanish but for round-off
    scales = {}
    for name, values in one.items():
        scales[stem(name)] = max(scales.get(stem(name), 0.0), np.abs(values).max())
    scales["energy_error"] = scales["kinetic"]
    for name, values in one.items():
        atol = AGREEMENT * scales[stem(name)] + 1e-300
        np.testing.assert_allclose(many[name], values, rtol=0.0, atol=atol, err_msg=name)
    assert_same_fields(spread, single, evolved(single.systems[0].particles), AGREEMENT)
    stress = Observables(spread.systems).field("stress")
    assert np.isfinite(stress).all() and stress.shape == (spread.systems[0].owned, 3, 3)
