"""Elastic-plastic laws with more state than a yield surface that grows: each in every method of flow, on all ranks,
through a restart, with its energies."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import LINEAR_COPPER, assert_same_fields, run_into, run_steps, supports, tables

from parsolid.scene import SceneError, parse_scene
from parsolid.simulation.restart import Restart

TURNING = LINEAR_COPPER | {
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 200e6},
    "kinematic_hardening": {"kind": "armstrong-frederick", "modulus": 20e9, "recovery": 60.0},
}
METHODS = {
    "tlsph": {"kind": "tlsph", "integrator": "leapfrog", "weights": "cells"},
    "mpm": {"kind": "mpm", "cell": 2e-4},
    "ulsph": {"kind": "ulsph"},
}


def swinging(kind, material=TURNING, **tables_besides):
    """A block of 1 x .5 mm on a fixed plane that swings far into flow, and back."""
    return tables(
        (10, 5), [1e-3, 5e-4], material=material, method=METHODS[kind],
        body={"velocity": ["2.5e5*Y", "0"]} | ({} if kind == "tlsph" else {"placement": "cells"}),
        boundaries=supports(Y=(0.0, "fixed")), end_time=1.0, **tables_besides,
    )  # fmt: skip


@pytest.mark.parametrize("kind", METHODS)
def test_back_stresses_are_the_same_on_all_ranks_and_their_energy_is_part_of_the_work(kind, comm):
    (spread, many), (single, one) = run_steps(swinging(kind), 80, comm), run_steps(swinging(kind), 80, MPI.COMM_SELF)
    energy = one["kinetic"][0]
    for name, values in one.items():
        np.testing.assert_allclose(many[name], values, rtol=0.0, atol=1e-10 * energy, err_msg=name)
    assert_same_fields(spread, single, ("plastic_strain", "back_stress"), 1e-9)
    work, stored = one["plastic_work"], one["back_stress_energy"]
    # it is stored, given back as the flow turns, and never more than flow has taken
    assert 0.01 * work[-1] < stored[-1] < 0.5 * work[-1] and work[-1] > 0.1 * energy
    assert np.diff(work - stored).min() >= -1e-14 * energy
    assert np.abs(one["energy_error"]).max() < (1e-11 if kind == "tlsph" else 4e-3) * energy
    back = single.systems[0].particles.owned_rows("back_stress")
    assert np.abs(back).max() < 20e9 / 60.0


@pytest.mark.parametrize("kind", METHODS)
def test_a_restart_has_the_same_back_stresses_to_the_bit(kind, shared_path, comm):
    scene = parse_scene(swinging(kind, output={"checkpoint_steps": 20}))
    through = run_into(shared_path / "through", comm, scene, 40)
    run_into(shared_path / "first", comm, scene, 20)
    resumed = run_into(shared_path / "first", comm, scene, 20, Restart(comm, shared_path / "first" / "checkpoint.h5"))
    for name, values in through.simulation.systems[0].particles.checkpointed().items():
        assert np.array_equal(resumed.simulation.systems[0].particles.owned_rows(name), values), name
    assert np.abs(through.simulation.systems[0].particles.owned_rows("back_stress")).max(initial=0.0) > 1e7


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"kind": "armstrong-frederick", "modulus": 0.0}, "modulus"),
        ({"kind": "armstrong-frederick", "modulus": 1e9, "recovery": -1.0}, "recovery"),
        ({"kind": "armstrong-frederick"}, "modulus"),
        ({"kind": "chaboche", "modulus": 1e9}, "kind"),
    ],
)
def test_hardening_without_sense_is_refused(change, key):
    with pytest.raises(SceneError) as refused:
        parse_scene(swinging("mpm", TURNING | {"kinematic_hardening": change}))
    assert f"kinematic_hardening.{key}" in str(refused.value)
