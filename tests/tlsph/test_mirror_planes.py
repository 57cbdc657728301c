"""Part of a body with mirror planes against the whole body: the same to round-off, where the extension is exact."""

import numpy as np
import pytest
from solids import ONE_BRANCH, SOFT, simulation, supports, tables

MATERIAL = {**SOFT, "branches": ONE_BRANCH}


def fields(sim) -> dict[str, np.ndarray]:
    table = sim.systems[0].particles
    names = ("velocity", "position", "deformation_gradient", "jacobian")
    return {name: table.owned_rows(name) for name in (*names, *(n for n in table.fields if n.startswith("viscous")))}


def moved(part: dict, whole: dict, steps: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Fields of the particles of the part, and of those at the same places of the whole, after the same steps."""
    part, whole = simulation(part), simulation(whole)
    X, everywhere = (one.systems[0].particles.owned_rows("reference_position") for one in (part, whole))
    distance = np.abs(X[:, None] - everywhere[None]).max(axis=2)
    there = distance.argmin(axis=1)
    assert distance.min(axis=1).max() < 1e-12 and len(everywhere) > len(X)
    start = np.array(part.systems[0].particles.owned_rows("velocity"))
    step = 0.5 * part.systems[0].stable_step()
    for _ in range(steps):
        part.take_step(step)
        whole.take_step(step)
    assert np.abs(part.systems[0].particles.owned_rows("velocity") - start).max() > 1e-2 * np.abs(start).max()
    return {name: (few, fields(whole)[name][there]) for name, few in fields(part).items()}


def same_motion(part: dict, whole: dict, steps: int = 12) -> None:
    for name, (few, many) in moved(part, whole, steps).items():
        np.testing.assert_allclose(few, many, rtol=0.0, atol=1e-12 * np.abs(many).max(), err_msg=name)


def box(lower, upper, spacing, velocity, smoothing=0.85, material=MATERIAL, **planes) -> dict:
    """A box filled at a spacing for each axis."""
    particles = [round((b - a) / dx) + 1 for a, b, dx in zip(lower, upper, spacing)]
    return tables(
        particles,
        upper,
        lower,
        material=material,
        method={"smoothing": smoothing},
        body={"velocity": velocity},
        boundaries=supports(**planes),
    )


# each component odd along its own axis and even along the others
EVEN_2D = ["0.4*sin(2*X)*cos(Y)", "0.3*X*X*sin(Y) - 0.2*Y"]
EVEN_3D = ["0.4*sin(2*X)*cos(Y)", "0.3*X*X*sin(Y) - 0.2*Y*cos(Z)", "0.3*sin(Z)*cos(X)*cos(Y)"]


@pytest.mark.parametrize("smoothing", [0.85, 1.2])
@pytest.mark.parametrize("axes", ["X", "XY"])
def test_rollers_in_the_plane(axes, smoothing):
    planes = dict.fromkeys(axes, (0.0, "roller"))
    lower = [0.0 if axis in axes else -0.8 for axis in "XY"]
    part = box(lower, [1.0, 0.8], [0.2, 0.16], EVEN_2D, smoothing, **planes)
    same_motion(part, box([-1.0, -0.8], [1.0, 0.8], [0.2, 0.16], EVEN_2D, smoothing))


@pytest.mark.parametrize("axes", ["Z", "XY", "XYZ"])
def test_rollers_in_space(axes):
    planes = dict.fromkeys(axes, (0.0, "roller"))
    lower = [0.0 if axis in axes else -end for axis, end in zip("XYZ", (0.6, 0.5, 0.6))]
    part = box(lower, [0.6, 0.5, 0.6], [0.2, 0.25, 0.3], EVEN_3D, 1.05, **planes)
    same_motion(part, box([-0.6, -0.5, -0.6], [0.6, 0.5, 0.6], [0.2, 0.25, 0.3], EVEN_3D, 1.05))


def test_cells_beside_a_roller():
    body, rollers = {"placement": "cells", "velocity": EVEN_2D}, supports(X=(0.0, "roller"), Y=(0.0, "roller"))
    part = tables((5, 4), [1.0, 0.8], material=MATERIAL, body=body, boundaries=rollers)
    same_motion(part, tables((10, 8), [1.0, 0.8], [-1.0, -0.8], material=MATERIAL, body=body))


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_shell_cut_at_a_plane_of_symmetry(dimension):
    def sector(end, hoop, **planes):
        shape = {"radius": 1.0, "thickness": 0.4, "angles": [0.0, end]}
        shape |= {"centre": [0.0, 0.0]} if dimension == 2 else {"base": [0.0, 0.0, 0.0], "axis": "Z", "length": 0.4}
        velocity = ["0.3*X*Y", "0.2*cos(X) - 0.1*Y", *["0.1*Z*Y"][: dimension - 2]]
        particles, rollers = [hoop, 3, 3][:dimension], supports(**planes)
        data = tables(particles, [1.0] * dimension, material=MATERIAL, method={"smoothing": 1.05}, boundaries=rollers)
        data["bodies"][0] |= {"shape": {"cylindrical_shell": shape}, "velocity": velocity}
        return data

    same_motion(sector(90.0, 6, X=(0.0, "roller")), sector(180.0, 11))


@pytest.mark.parametrize("kind", ["fixed", "antisymmetric"])
def test_a_shear_wave_at_a_wall_that_holds_it(kind):
    """v_y(X) odd in X is the motion of a body twice as long, at any amplitude, when nothing depends on Y.

    Without upwinding, which pushes along the line between two particles and so turns a large shear into more than that.
    """
    sides = {"Y0": (0.0, "antisymmetric"), "Y1": (0.6, "antisymmetric")}
    velocity = ["0", "0.8*sin(2*X)"]
    part = box([0.0, 0.0], [1.0, 0.6], [0.1, 0.1], velocity, material=SOFT, X=(0.0, kind), **sides)
    whole = box([-1.0, 0.0], [1.0, 0.6], [0.1, 0.1], velocity, material=SOFT, **sides)
    for scene in (part, whole):
        scene["method"]["dissipation"] = 0.0
    same_motion(part, whole, steps=20)


@pytest.mark.parametrize("amplitude", [1e-4, 1e-7])
def test_small_motion_at_an_antisymmetric_plane(amplitude):
    # stresses are antisymmetric to first order in the strain
    velocity = [f"{amplitude}*cos(2*X)*(1 + Y)", f"{amplitude}*sin(2*X)*Y*Y"]
    part = box([0.0, 0.0], [1.0, 0.6], [0.1, 0.1], velocity, X=(0.0, "antisymmetric"))
    whole = box([-1.0, 0.0], [1.0, 0.6], [0.1, 0.1], velocity)
    few, many = moved(part, whole, 12)["velocity"]
    assert np.abs(few - many).max() < 3.0 * amplitude * amplitude + 1e-13 * amplitude


@pytest.mark.parametrize(("dimension", "integrator"), [(2, "ssp-rk3"), (2, "leapfrog"), (3, "ssp-rk3")])
def test_what_a_fixed_wall_gives_to_cells_is_booked(comm, dimension, integrator):
    # images of a fixed plane are not adjoint: the balance closes to the error in time with their work alone
    planes = supports(Y=(0.0, "fixed"), X=(0.0, "roller"))
    body = {"placement": "cells", "velocity": EVEN_2D if dimension == 2 else EVEN_3D}
    method = {"integrator": integrator}
    material = {**SOFT, "branches": [{"beta": 1.0, "tau": 0.5}]}
    data = tables((7, 6, 5)[:dimension], material=material, body=body, boundaries=planes, method=method)
    rows = []
    for steps in (15, 30):
        sim = simulation(data, comm)
        sim.ledger.row(comm, *sim.systems[0].energies())
        for _ in range(steps):
            sim.take_step(0.3 / steps)
        rows.append(sim.ledger.row(comm, *sim.systems[0].energies()))
    coarse, fine = (abs(row["energy_error"]) for row in rows)
    assert coarse > 3.5 * fine and fine < 0.03 * rows[1]["fixed_wall_work"], rows
