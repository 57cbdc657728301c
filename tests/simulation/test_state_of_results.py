"""A run that starts from another's state goes on as that one did, with every method and all that it carries on."""

from contextlib import nullcontext

import numpy as np
import pytest
from mpi4py import MPI
from ranks import first_on_ranks
from solids import COPPER, ONE_BRANCH, SOFT, THREE_BRANCHES, evolved, gathered, run_into, simulation, tables

from parsolid.api.check_advice import scene_advice
from parsolid.collective import SolverError
from parsolid.observables.declared import field_of
from parsolid.scene import SceneError, dump_scene, parse_scene

# with the kernels of what fails in the tests of both methods
BREAKING = {"criteria": [{"kind": "maximum-tension", "strength": 1e9}], "scatter": {"modulus": 10.0, "seed": 3}}
FAILING = COPPER | {"equation_of_state": {"kind": "linear", "bulk_modulus": 138.6e9}, "failure": BREAKING}
SHEARED = {"velocity": ["0.3*Y", "0.1*X - 0.2*Y"], "displacement": ["0.02*Y", "0.01*X"]}
BAR = {"upper": [6e-3, 2e-3], "end_time": 2e-6, "body": {"velocity": [-250.0, 0.0], "placement": "cells"}}
WALL = [{"kind": "wall", "plane": "X = 0", "side": "above"}, {"kind": "roller", "plane": "Y = 0"}]
STAMPED = [{"kind": "fixed", "plane": "X = 0"}]
# all that evolves: what a step leaves behind for the next, of each method
CASES = {
    "tlsph in stages": tables((6, 5), material=SOFT | {"branches": THREE_BRANCHES}, body=SHEARED, end_time=0.4),
    "tlsph, leapfrog": tables((6, 5), method={"integrator": "leapfrog"}, material=SOFT, body=SHEARED, end_time=0.4),
    # past its largest strain, so that the state variable is not of the present one
    "tlsph, softened": tables(
        (6, 5),
        method={"integrator": "leapfrog"},
        material=SOFT | {"softening": {"r": 1.5, "m": 0.01}},
        body=SHEARED,
        end_time=2.0,
    ),
    # by more spacings than four bytes tell apart
    "tlsph, far away": tables(
        (6, 5),
        method={"integrator": "leapfrog"},
        material=SOFT,
        body=SHEARED | {"displacement": ["3e4 + 0.02*Y", "0.01*X"]},
        end_time=0.4,
    ),
    "peridynamics": tables(
        (6, 5),
        method={"kind": "peridynamics", "horizon_ratio": 2.0},
        material={"kind": "prony", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.25}
        | {"terms": [{"ratio": 2.0, "tau": 0.3}]},
        body=SHEARED,
        boundaries=STAMPED,
        end_time=0.4,
    ),
    "peridynamics, finite strain that breaks": tables(
        (6, 5),
        method={"kind": "peridynamics", "horizon_ratio": 2.0, "damage": {"critical_stretch": 0.03}},
        material=SOFT | {"branches": ONE_BRANCH},
        body=SHEARED,
        end_time=0.4,
    ),
    "mpm": tables(
        (12, 4), method={"kind": "mpm", "cell": 1e-3, "maximum_step": 4e-8}, material=FAILING, boundaries=WALL, **BAR
    ),
    "mpm, apic": tables(
        (12, 4), method={"kind": "mpm", "cell": 1e-3, "transfer": "apic"}, material=COPPER, boundaries=WALL, **BAR
    ),
    "ulsph": tables((12, 4), method={"kind": "ulsph", "maximum_step": 2e-8}, material=FAILING, boundaries=WALL, **BAR),
    "ulsph, micro-inertia": tables(
        (12, 4),
        method={"kind": "ulsph", "maximum_step": 2e-8},
        material={"kind": "micro-inertia", "library": "4340 steel, Rahaman"},
        boundaries=WALL,
        **BAR,
    ),
}
# what is to be there at the end, so that the test is one of it
NOT_ZERO = {
    "mpm": "damage",
    "ulsph": "damage",
    "tlsph, softened": "largest_energy",
    "peridynamics, finite strain that breaks": "broken_bonds",
}


def goes_on(folder, comm, data):
    """The state at the end of a run, and of one that goes on from its results at half of it."""
    end = data["end_time"]
    output = {"fields_times": [0.5 * end, end], "fields": ["state"], "pictures": False}
    whole = run_into(folder, comm, parse_scene(data | {"output": output})).simulation
    taken = {"results": str(folder), "time": 0.5 * end, "fields": ["state"]}
    later = data | {"initial": [taken], "end_time": 0.5 * end, "output": output | {"fields_times": [0.5 * end]}}
    return whole, run_into(folder / "later", comm, parse_scene(later)).simulation


@pytest.mark.parametrize("case", first_on_ranks(CASES))
def test_a_run_goes_on_from_the_state_of_another(case, shared_path, comm):
    whole, later = goes_on(shared_path / "whole", comm, CASES[case])
    names = [name for name in evolved(whole.systems[0].particles) if name not in ("listed_position", "broken_bonds")]
    assert whole.clock.step == 2 * later.clock.step
    for name, old, new in zip(names, gathered(whole, *names), gathered(later, *names)):
        np.testing.assert_allclose(new, old, rtol=0.0, atol=1e-11 * max(np.abs(old).max(), 1e-300), err_msg=name)
    if case in NOT_ZERO:
        ends = [gathered(one, NOT_ZERO[case])[0] for one in (whole, later)]
        assert (ends[0] > 0).any() and np.array_equal(ends[0] > 0, ends[1] > 0)


def test_other_particles_take_the_state_between(tmp_path):
    """Branches and all: the stored energy that they start with is that of the results."""
    data = CASES["tlsph in stages"]
    whole = run_into(tmp_path, MPI.COMM_SELF, parse_scene(data | {"output": {"fields": ["state"]}})).simulation
    later = data | {"initial": [{"results": str(tmp_path), "fields": ["state"]}]}
    later["bodies"] = [data["bodies"][0] | {"particles": [8, 8]}]
    (kinetic, stored), (wanted, there) = (sim.systems[0].energies() for sim in (simulation(later), whole))
    assert kinetic == pytest.approx(wanted, rel=0.1) and stored == pytest.approx(there, rel=0.1)


def test_a_stress_of_results_is_one_that_no_deformation_has_made(tmp_path):
    data = CASES["tlsph, leapfrog"] | {"output": {"fields": ["stress", "displacement"]}}
    first = run_into(tmp_path, MPI.COMM_SELF, parse_scene(data)).simulation.systems[0]
    sim = simulation(CASES["tlsph, leapfrog"] | {"initial": [{"results": str(tmp_path), "fields": ["stress"]}]})
    stress = field_of(first, "stress")[:, :2, :2].reshape(-1, 4)
    np.testing.assert_allclose(gathered(sim, "initial_stress")[0], stress, atol=1e-6 * np.abs(stress).max())


def test_what_would_hold_in_place_of_another_start_is_refused(tmp_path):
    data = CASES["tlsph, leapfrog"]
    run_into(tmp_path, MPI.COMM_SELF, parse_scene(data | {"output": {"fields": ["state"]}}), 1)
    state = {"results": str(tmp_path), "fields": ["state"]}
    at_rest = {"velocity": ["0", "0"]}
    parse_scene(data | {"initial": [at_rest, state]})
    for initial, words in (
        ([state, at_rest], "initial.1.velocity: expected a place before initial.0"),
        ([state | {"deformation_gradient": [["1", "0"], ["0", "1"]]}], "initial.0.deformation_gradient: expected"),
        ([state | {"fields": ["state", "velocity"]}], "initial.0.fields.1: expected 'state' alone"),
    ):
        with pytest.raises(SceneError, match=words):
            parse_scene(data | {"initial": initial})
    bodies = [data["bodies"][0] | {"name": "one"}]
    far = [bodies[0] | {"shape": {"box": {"lower": [9.0, 0.0], "upper": [10.0, 1.0]}}}]
    # of another body it is no matter
    parse_scene(data | {"bodies": [*bodies, bodies[0] | {"name": "two"}]} | apart(state, at_rest))
    with pytest.raises(SceneError, match="initial.0.results: expected velocity of .* near by at every particle, found"):
        simulation(data | {"bodies": far, "initial": [state]})
    wild = [{"stress": [["1/X", "0"], ["0", "0"]]}]
    with pytest.raises(SceneError, match="initial.0.stress.0.0: expected a finite value .* found inf at particle"):
        simulation(data | {"initial": wild})


def apart(state, later):
    """Initial states of two bodies."""
    return {"initial": [state | {"body": "one"}, later | {"body": "two"}]}


def test_what_no_run_can_go_on_from_is_refused(tmp_path):
    breaking, fluid = CASES["peridynamics, finite strain that breaks"], CASES["ulsph"]
    for name, data, fields in (("broken", breaking, ["state"]), ("poor", breaking, ["displacement", "velocity"])):
        run_into(tmp_path / name, MPI.COMM_SELF, parse_scene(data | {"output": {"fields": fields}}))
    linear = CASES["peridynamics"]
    run_into(tmp_path / "one", MPI.COMM_SELF, parse_scene(linear | {"output": {"fields": ["state"]}}), 1)
    terms = [{"ratio": 2.0, "tau": 0.3}, {"ratio": 1.0, "tau": 3.0}]
    two = linear | {"bodies": [linear["bodies"][0] | {"material": linear["bodies"][0]["material"] | {"terms": terms}}]}
    near = breaking | {"method": breaking["method"] | {"horizon_ratio": 1.5}}
    whole = breaking | {"method": {key: part for key, part in breaking["method"].items() if key != "damage"}}
    other = breaking | {"bodies": [breaking["bodies"][0] | {"particles": [7, 5]}]}
    for data, folder, fields, words in (
        (
            other,
            "broken",
            ["state"],
            "initial.0.fields: expected the particles of the results, as each has broken_bonds",
        ),
        (whole, "broken", ["state"], "expected a scene with all of the state .* found none with broken_bonds"),
        (near, "broken", ["state"], "initial: expected the bonds of the results .* found particles with other ones"),
        (two, "one", ["state"], "as many components as the laws of this scene have, .*, found another number"),
        (breaking, "poor", ["state"], r"with the state of this method, .* found none \(output.fields = \["),
        (CASES["mpm"], "broken", ["state"], "initial.0.fields: .* of mpm, found those of peridynamics"),
        (breaking, "broken", ["state", "stress"], "initial.0.fields.1: expected"),
        (fluid, "broken", ["stress"], "initial.0.fields.0: expected"),
    ):
        initial = [{"results": str(tmp_path / folder), "fields": fields}]
        with pytest.raises((SceneError, SolverError), match=words):
            simulation(data | {"initial": initial})


def test_a_state_of_another_method_is_refused_though_its_names_suffice(tmp_path):
    scene = parse_scene(CASES["tlsph, leapfrog"] | {"output": {"fields": ["state"]}})
    run_into(tmp_path, MPI.COMM_SELF, scene, 1)
    dump_scene(scene, tmp_path / "scene.toml")
    bonds = CASES["tlsph, leapfrog"] | {"method": {"kind": "peridynamics", "horizon_ratio": 2.0}}
    for fields, words in ((["state"], "state of results of peridynamics, found those of tlsph"), (["velocity"], None)):
        data = bonds | {"initial": [{"results": str(tmp_path), "fields": fields}]}
        with pytest.raises(SolverError, match=words) if words else nullcontext():
            simulation(data)
    (note,) = scene_advice(parse_scene(data))
    assert note.code == "other-method" and note.text.startswith("initial.0: ")
