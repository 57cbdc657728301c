"""Bodies of different methods that are tied: nothing at rest, forces of an energy, on any ranks and after a restart."""

import numpy as np
import pytest
from mixed.tied_blocks import STIFFNESS, blocks
from mpi4py import MPI
from mpm.points import SOFT
from solids import run_to_end

from parsolid.collective import SolverError
from parsolid.contact.report import describe_contacts
from parsolid.scene import SceneError, parse_scene
from parsolid.simulation.loop import Simulation


def turned(sim, gradient: np.ndarray) -> list[np.ndarray]:
    """Forces of the tie where all particles are at `gradient` times their reference."""
    for system in sim.systems:
        rows = system.particles.owned_rows
        rows("position")[:] = rows("reference_position")[:, :2] @ gradient.T
    (face,) = sim.interactions[0].faces
    face.evaluate()
    return [face.force[here] for here in face.parts]


def test_forces_are_minus_the_gradient_of_an_energy_that_no_affine_motion_has():
    sim = Simulation(MPI.COMM_SELF, parse_scene(blocks("sph", "points")))
    tie, (face,) = sim.interactions[0], sim.interactions[0].faces
    modulus = min(side.modulus / side.spacing for side in face.sides)
    scale = STIFFNESS * modulus * 0.125
    angle = 0.7
    spin = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for gradient in (np.eye(2), spin, spin @ np.array([[1.2, 0.3], [0.0, 0.8]])):
        assert max(np.abs(force).max() for force in turned(sim, gradient)) < 1e-13 * scale
    # each body strained along the face's normal in its own way: a kink at the face is free
    for number, system in enumerate(sim.systems):
        rows = system.particles.owned_rows
        rows("position")[:, 0] += (0.1, -0.2)[number] * (rows("reference_position")[:, 0] - 1.0)
    face.evaluate()
    # but at the edge of the lower block, where its colour alone falls off
    height = face.reference[:, 1]
    inner = np.abs(face.force[(height > 0.4) & (height < 0.65)]).max() / scale
    assert inner < 1e-3
    rng = np.random.default_rng(1)
    for system in sim.systems:
        place = system.particles.owned_rows("position")
        place += 0.02 * rng.standard_normal(place.shape)
    face.evaluate()
    places, total, moment = [], np.zeros(2), 0.0
    for side, rows, here in zip(face.sides, face.rows, face.parts):
        force = face.force[here]
        x = side.system.particles.owned_rows("position")[rows]
        total, moment = total + force.sum(axis=0), moment + np.sum(x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0])
        places.append((side.system.particles.owned_rows("position"), rows, force.copy()))
    largest = max(np.abs(force).max() for *_, force in places)
    assert np.abs(total).max() < 1e-12 * largest and abs(moment) < 1e-12 * largest
    for position, rows, force in places:
        for k in (0, len(rows) // 2):
            found = []
            for shift in (1e-5, -1e-5):
                position[rows[k], 1] += shift
                face.evaluate()
                found.append(tie.energies()[1])
                position[rows[k], 1] -= shift
            assert (found[1] - found[0]) / 2e-5 == pytest.approx(force[k, 1], abs=1e-7 * largest)


def test_springs_do_not_depend_on_where_bodies_stand():
    found = []
    for shift in (np.zeros(2), np.array([-7.0, -5.0]), np.array([4.0, 9.0])):
        data = blocks("sph", "bonds")
        for body in data["bodies"]:
            box = body["shape"]["box"]
            body["shape"] = {"box": {key: (np.array(box[key]) + shift).tolist() for key in box}}
            body["velocity"] = [0.0, 0.0]
        (face,) = Simulation(MPI.COMM_SELF, parse_scene(data)).interactions[0].faces
        identifier = face._gathered("identifier")
        points = np.argsort(identifier[face.source])
        found.append((face.weights.toarray()[points][:, np.argsort(identifier)], face.springs[points]))
    for weight, springs in found[1:]:
        assert len(springs) == len(found[0][1]) > 5
        np.testing.assert_allclose(weight, found[0][0], atol=1e-9)
        np.testing.assert_allclose(springs, found[0][1], rtol=1e-9)


def test_check_names_tied_bodies_and_refuses_what_cannot_be_tied():
    scene = parse_scene(blocks("sph", "bonds"))
    sim = Simulation(MPI.COMM_SELF, scene)
    assert ("bodies", "bodies tied: a and b") in describe_contacts(MPI.COMM_SELF, scene, sim.systems)
    far = blocks("sph", "bonds")
    far["bodies"][1]["shape"]["box"] = {"lower": [1.5, 0.0], "upper": [2.75, 1.25]}
    with pytest.raises(SolverError, match=r"tie\.0: expected bodies that touch, found 'a' and 'b' apart"):
        Simulation(MPI.COMM_SELF, parse_scene(far))


def test_bodies_of_one_method_need_no_tie_and_equilibrium_knows_none():
    with pytest.raises(SceneError, match="tie.0.bodies: expected bodies of two methods"):
        parse_scene(blocks("bonds", "bonds"))
    data = blocks("sph", "bonds")
    data["methods"][1]["solution"] = {"kind": "quasi-static", "step": 1e-4}
    with pytest.raises(SceneError, match="tie: expected no such table with equilibrium"):
        parse_scene(data)


@pytest.mark.parametrize(("across", "told"), [(10, []), (11, ["unlike-axes-in-tie"])])
def test_spacings_that_differ_along_the_axes_of_a_tied_body_are_told(across, told):
    data = blocks("points", "bonds")
    data["bodies"][0]["particles"] = [8, across]
    found = [one.code for one in Simulation(MPI.COMM_SELF, parse_scene(data)).warnings]
    assert [code for code in found if "axes" in code] == told


def hanging_rods(geometry: str, inner: float) -> dict:
    """Two rods of 20 mm in line, each on a grid of its own and tied; a force on the last 10 mm grows to 1e4 Pa."""
    end, length = 0.02, 0.02
    data = {"dimension": 2, "end_time": end, "methods": [], "bodies": [], "tie": [{"bodies": ["low", "high"]}]}
    for name, y in (("low", 0.0), ("high", length)):
        box = {"lower": [inner, y], "upper": [inner + length, y + length]}
        body = {"name": name, "method": name, "shape": {"box": box}, "spacing": [2.5e-3], "placement": "cells"}
        data["bodies"].append(body | {"material": SOFT})
        method = {"name": name, "kind": "mpm", "geometry": geometry, "cell": 5e-3, "transfer": "apic"}
        data["methods"].append(method)
    planes = ["Y = 0", "X = 0"] if inner == 0.0 else ["Y = 0"]
    data["boundaries"] = [{"kind": "roller", "plane": plane} for plane in planes]
    return data | {"loads": {"body_force": ["0", f"1e6*where(Y > 0.03, 1, 0)*t/{end}"]}}


@pytest.mark.serial
@pytest.mark.parametrize(("geometry", "inner"), [("plane-strain", 0.0), ("axisymmetric", 0.0), ("axisymmetric", 0.02)])
def test_a_tie_is_as_stiff_as_stated_in_every_geometry(geometry, inner):
    """A traction p on an area A: the springs store p^2 A/(2 k), the rods p^2 A (30 + 10/3) mm/(2 E)."""
    _, columns = run_to_end(hanging_rods(geometry, inner))
    about = geometry == "axisymmetric"
    area = 0.5 * ((inner + 0.02) ** 2 - inner**2) if about else 0.02
    youngs, modulus = (1e7 if about else 1e7 / 0.91), 1e7 * 0.7 / (1.3 * 0.4)
    springs, rods = 0.5e8 * area * 2.5e-3 / (STIFFNESS * modulus), 0.5e8 * area * (0.03 + 0.01 / 3.0) / youngs
    assert columns["tie_energy"][-1] == pytest.approx(springs, rel=0.05)
    assert columns["strain_energy"][-1] == pytest.approx(rods, rel=0.15)
