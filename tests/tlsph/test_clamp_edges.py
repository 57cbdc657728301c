"""`method.clamp_edges`: what nodes on the edges of a clamp do without, and what it is good for."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from solids import gathered, run_steps, run_to_end, simulation, supports, tables

from parsolid.collective import SolverError

PART = 0.6
SCENES = Path(__file__).parents[2] / "runs" / "tlsph"


def block(particles, *, part=PART, weights="fourth-order", boundaries=None, **body) -> dict:
    method = {"weights": weights, "integrator": "leapfrog", "clamp_edges": part}
    held = supports(Y=(0.0, "fixed")) if boundaries is None else boundaries
    velocity = {"velocity": ["Y*Y", "0", "X*Y"][: len(particles)]}
    return tables(list(particles), method=method, boundaries=held, body=velocity | body)


# blocks, and where X, Z meet the clamp at a free face
BLOCKS = {
    "2-D": (block((9, 12)), ((0.0, 1.0),)),
    "3-D": (block((9, 8, 5)), ((0.0, 1.0), (0.0, 1.0))),
    "cells": (block((5, 6, 4), weights="cells"), ((0.0, 1.0), (0.0, 1.0))),
    "graded": (block((9, 10, 8), grading=[[1, 1.5, 1], [1, 2], [1]]), ((0.0, 1.0), (0.0, 1.0))),
    "mirror": (block((9, 8, 8), boundaries=supports(Y=(0.0, "fixed"), Z=(0.0, "roller"))), ((0.0, 1.0), (1.0,))),
}


@pytest.mark.parametrize("name", BLOCKS)
def test_only_nodes_on_edges_have_less_and_linear_fields_are_exact(name, comm):
    data, free = BLOCKS[name]
    sim = simulation(data, comm)
    plain = simulation(data | {"method": data["method"] | {"clamp_edges": 0.0}}, comm)
    place, volume = gathered(sim, "reference_position", "volume")
    there = np.zeros(len(place), bool)
    for axis, places in zip((0, 2), free):
        there |= np.isin(place[:, axis], places)
    there &= place[:, 1] == 0.0
    wanted = np.where(there, 1.0 - PART, 1.0)
    assert 0 < there.sum() < len(place)
    assert comm.allreduce(sim.systems[0].mass.sum()) == pytest.approx(
        comm.allreduce(plain.systems[0].mass.sum()), rel=1e-14
    )
    assert volume.ravel() == pytest.approx(wanted * gathered(plain, "volume")[0].ravel(), rel=1e-14)
    d = place.shape[1]
    particles, matrix = sim.systems[0].particles, np.arange(1.0, 1.0 + d * d).reshape(d, d)
    if name == "mirror":
        matrix[2, :2] = matrix[:2, 2] = 0.0
    particles.owned_rows("position")[:] += particles.owned_rows("reference_position") @ matrix.T
    assert np.abs(sim.systems[0].displacement_gradient() - matrix).max(initial=0.0) < 1e-12


@pytest.mark.parametrize("poissons_ratio", [0.3, 0.45])
def test_by_default_the_stiffness_of_a_clamped_bar_hardly_depends_on_the_spacing(poissons_ratio, comm):
    """The singular stress at the clamp's edges leaves an error of order 1.2 to 1.4 otherwise."""

    def length(across: int, part: float | None) -> float:
        """Of a bar in plane strain that is pulled, in equilibrium."""
        pull = {"kind": "traction", "plane": "Y = 2", "traction": ["0", "1"]}
        data = tables([across, 2 * across - 1], upper=[1.0, 2.0], boundaries=[*supports(Y=(0.0, "fixed")), pull])
        data["method"] = {"kind": "tlsph", "integrator": "static", "weights": "fourth-order"}
        data["method"] |= {} if part is None else {"clamp_edges": part}
        data["bodies"][0]["material"] = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1e6}
        data["bodies"][0]["material"]["poissons_ratio"] = poissons_ratio
        sim, _ = run_to_end(data, comm)
        place, motion = gathered(sim, "reference_position", "displacement")
        return float(motion[(place[:, 1] == 2.0), 1].mean())

    plain, default = (length(10, part) / length(20, part) - 1.0 for part in (0.0, None))
    assert abs(plain) > 2e-4 and abs(default) < 0.2 * abs(plain)


@pytest.mark.serial
def test_energy_closes(comm):
    _, rows = run_steps(block((9, 9, 8)), 80, comm)
    assert rows["strain_energy"].max() > 0.1 * rows["kinetic"][0]
    assert np.abs(rows["energy_error"]).max() < 1e-3 * rows["kinetic"][0]


def error_of_bending(part: float) -> float:
    """Largest error of the kinetic energy in runs/tlsph/bending.toml over that at the start."""
    data = tomllib.loads((SCENES / "bending.toml").read_text())
    data["method"] |= {"weights": "fourth-order", "integrator": "leapfrog", "dissipation": 0.1, "clamp_edges": part}
    data["bodies"][0]["particles"] = [8, 22, 8]
    _, rows = run_to_end({key: value for key, value in data.items() if key not in ("reference", "probes", "output")})
    true = json.loads((SCENES / "reference" / "bending.json").read_text())
    kinetic = np.interp(true["t"], rows["time"], rows["kinetic"])
    return float(np.abs(kinetic - true["series"]["K"]).max() / true["E0"])


@pytest.mark.serial
def test_the_error_of_bending_falls_to_a_third():
    assert error_of_bending(PART) < 0.02
    assert error_of_bending(0.0) > 0.05


FREE = {
    "none": {},
    "roller": {"Y": (0.0, "roller")},
    "no free face": {"Y": (0.0, "fixed"), "X0": (0.0, "roller"), "X1": (1.0, "roller")},
}


@pytest.mark.parametrize("name", FREE)
def test_it_is_refused_where_no_fixed_plane_meets_a_free_face(name, comm):
    with pytest.raises(SolverError, match="method.clamp_edges: expected 0 unless a fixed plane meets a free face"):
        simulation(block((9, 9), boundaries=supports(**FREE[name])), comm)
