"""Loads and prescribed motion of peridynamics: a uniform stress is exact under consistent tractions, on any number of
ranks.
"""

import numpy as np
import pytest
from solids import SOFT, simulation, tables

from parsolid.boundary.conditions import Conditions
from parsolid.materials.registry import laws_of
from parsolid.methods.peridynamics.forces import build_forces, particles_of
from parsolid.methods.peridynamics.tangent import Operator
from parsolid.methods.peridynamics.tractions import Tractions
from parsolid.particles.generation import generate
from parsolid.scene import parse_scene
from parsolid.scene.boundaries import Pressure, Traction
from parsolid.solvers import conjugate_gradients

SIZE = (1.0, 0.8, 0.7)
PARTICLES = (10, 8, 7)
STRESS = 1e4
TERMS = [{"ratio": 9.0, "tau": 1.0}]
MATERIAL = {"kind": "prony", "density": 1000.0, "youngs_modulus": 7e6, "poissons_ratio": 0.3, "terms": TERMS}


class Body:
    """A bar, plate or block pulled along X, on rollers, or pulled at both ends, with everything a static solution
    needs.
    """

    def __init__(self, comm, dimension, both=False, boundaries=(), loads=(), end_time=1.0, filling=(), **method):
        pull = [STRESS, 0.0, 0.0][:dimension]
        supports = [{"kind": "roller", "plane": f"{axis} = 0"} for axis in "XYZ"[both:dimension]]
        tractions = [{"kind": "traction", "plane": "X = 1", "traction": pull}]
        if both:
            tractions.append({"kind": "traction", "plane": "X = 0", "traction": [-t for t in pull]})
        shape = {"box": {"lower": [0.0] * dimension, "upper": list(SIZE[:dimension])}}
        filling = {"particles": list(PARTICLES[:dimension]), "placement": "cells", **dict(filling)}
        body = {"shape": shape, "material": MATERIAL, **filling}
        self.scene = parse_scene(
            {
                "dimension": dimension,
                "end_time": end_time,
                "method": {"kind": "peridynamics", **method},
                "bodies": [body],
                "boundaries": list(boundaries) or supports + tractions,
                "loads": dict(loads),
            }
        )
        particle_set = self.particle_set = generate(self.scene, comm)
        laws = laws_of(self.scene)
        self.comm, self.law = comm, laws[0]
        particles = particles_of(self.scene, particle_set)
        self.conditions = Conditions(comm, self.scene, particle_set, particles, others=(Traction, Pressure))
        forces = build_forces(comm, self.scene, particle_set, self.conditions)
        Tractions(self.conditions, forces)
        self.operator = Operator(forces, self.conditions)

    def stretched(self, pinned=None):
        """The displacement (n, d) under the loads just after time 0; `pinned` (n, d) bool: more components at rest."""
        free = self.operator.free if pinned is None else self.operator.free & ~pinned
        load = self.operator.external(0.0)
        size = np.sqrt(self.comm.allreduce(float(np.vdot(load, load))))
        solution = conjugate_gradients(
            self.comm, lambda u, out: self.operator.linear(u, u, out, 0.0), load.copy(), 1e-12 * size, free
        )
        assert solution.converged
        return solution.value.reshape(free.shape)

    def exact(self):
        """The displacement (n, d) of the uniform stress."""
        material = self.scene.bodies[0].material.instantaneous
        E, nu = material.youngs_modulus, material.poissons_ratio
        if self.scene.method.state(self.scene.dimension) == "plane-strain":
            E, nu = E / (1.0 - nu**2), nu / (1.0 - nu)
        return self.particle_set.position * (STRESS / E * np.array([1.0, -nu, -nu])[: self.scene.dimension])

    def total(self):
        """Resultant of the loads along X [N]."""
        return self.comm.allreduce(float(self.operator.external(0.0)[:, 0].sum()))


def area(dimension):
    """Of the loaded face [m^2]."""
    return float(np.prod(SIZE[1:dimension]))


def error(body, displacement):
    """Largest error over the largest displacement, over all ranks."""
    exact = body.exact()
    largest = max(body.comm.allgather(float(np.abs(exact).max(initial=0.0))))
    return max(body.comm.allgather(float(np.abs(displacement - exact).max(initial=0.0)))) / largest


NODES, IRREGULAR = {"placement": "vertices"}, {"jitter": 0.2}


def test_a_uniform_stress_between_two_loaded_faces_is_exact(comm):
    # the faces are closer to each other than their forces reach
    body = Body(comm, 2, both=True, plane="stress")
    pinned = np.zeros_like(body.operator.free)
    pinned[body.particle_set.identifier == 0, 0] = True
    displacement = body.stretched(pinned)
    away = sum(comm.allgather((body.exact() - displacement)[body.particle_set.identifier == 0, 0].sum()))
    displacement[:, 0] += away
    assert error(body, displacement) <= 1e-10
    assert body.total() == pytest.approx(0.0, abs=1e-9 * STRESS)


def test_forces_at_the_face_or_spread_are_not_exact_but_have_the_same_resultant(comm):
    errors = {}
    for kind in ("single-layer", "horizon", "consistent"):
        body = Body(comm, 2, plane="stress", traction=kind)
        errors[kind] = error(body, body.stretched())
        assert body.total() == pytest.approx(STRESS * area(2), rel=1e-11)
    assert errors["consistent"] < 1e-10 and min(errors["single-layer"], errors["horizon"]) > 0.1


def test_irregular_particles_carry_the_force_of_the_face(comm):
    body = Body(comm, 2, plane="stress", filling=IRREGULAR)
    assert body.total() == pytest.approx(STRESS * area(2), rel=1e-11)


@pytest.mark.serial
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_traction_that_varies_over_its_face_carries_its_moment(comm, dimension):
    """But for 1/N^2, what midpoints of N cells leave out of a square, and on top of a mean that is exact."""
    pull = {"kind": "traction", "plane": "X = 1", "traction": ["1e4 + 1e4*(Y - 0.4)", "0", "0"][:dimension]}
    body = Body(comm, dimension, boundaries=[{"kind": "roller", "plane": "X = 0"}, pull])
    force, y = body.operator.external(0.0)[:, 0], body.particle_set.position[:, 1]
    total, moment = (comm.allreduce(float(np.sum(force * arm))) for arm in (np.ones(len(y)), y - 0.4))
    width = area(dimension) / SIZE[1]
    assert total == pytest.approx(1e4 * area(dimension), rel=1e-11)
    assert moment == pytest.approx(1e4 * width * SIZE[1] ** 3 / 12.0 * (1.0 - 1.0 / PARTICLES[1] ** 2), rel=1e-11)


@pytest.mark.parametrize("dimension, particles", [(2, [20, 10]), (3, [24, 12, 6])])
def test_a_beam_bends_as_it_should(dimension, particles):
    """Half a beam under t = S Y at its end, 10 or 12 particles thick; the curvature by projection on X Y."""
    body = {"placement": "cells"}
    method = {"kind": "peridynamics", "solution": {"kind": "quasi-static", "step": 1.0, "tolerance": 1e-6}}
    sim = simulation(
        tables(
            particles,
            [2.0, 0.5, 0.25][:dimension],
            [0.0, -0.5, -0.25][:dimension],
            material={"kind": "linear-elastic", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3},
            method=method if dimension == 3 else {**method, "plane": "stress"},
            body=body,
            boundaries=[
                {"kind": "roller", "plane": "X = 0"},
                {"kind": "traction", "plane": "X = 2", "traction": ["1e-4*Y", "0", "0"][:dimension]},
            ],
        )
    )
    sim.take_step(0.0)
    one = sim.systems[0]
    mode = np.prod(one.particles.owned_rows("reference_position")[:, :2], axis=1)
    assert np.vdot(mode, one.displacement[:, 0]) / np.vdot(mode, mode) == pytest.approx(1e-4, rel=0.02)


HISTORY = {"rows": [[0.0, 1.0], [2.0, 3.0], [2.0, 0.0]]}
PULL = {"kind": "traction", "plane": "X = 1", "traction": ["1e4*Y", 0.0], "history": HISTORY}


@pytest.mark.serial
def test_loads_in_time(comm):
    loads = {"body_force": [0.0, "-7*(t < 5)"], "acceleration": [2.0, 0.0], "jumps": [5.0]}
    body = Body(comm, 2, boundaries=[{"kind": "roller", "plane": "X = 0"}, PULL], loads=loads, end_time=10.0)
    assert body.conditions.times == (2.0, 5.0)
    weight = 1000.0 * 2.0 * 0.8
    # the traction 1e4 Y over the height 0.8
    sides = {(0.0, False): (1.0, -7.0), (1.0, False): (2.0, -7.0), (2.0, True): (3.0, -7.0), (2.0, False): (0.0, -7.0)}
    sides |= {(5.0, True): (0.0, -7.0), (5.0, False): (0.0, 0.0)}
    for (time, before), (along, across) in sides.items():
        total = np.array(comm.allgather(body.operator.external(time, before).sum(axis=0))).sum(axis=0)
        assert total == pytest.approx([weight + along * 3200.0, across * 0.8], rel=1e-9), time


def test_prescribed_motion(comm):
    layer = {"kind": "layer", "plane": "X = 0.3", "side": "below"}
    end = {
        "kind": "displacement",
        "plane": "X = 1",
        "displacement": ["where(t < 2, 0.1*t, 0.5)", "free"],
        "jumps": [2.0],
    }
    driven = {"kind": "velocity", "box": {"lower": [0.4, 0.0], "upper": [0.6, 0.8]}, "velocity": ["free", "t**3"]}
    body = Body(comm, 2, boundaries=[layer, end, driven], end_time=10.0)
    motion, x = body.conditions.motion, body.particle_set.position[:, 0]
    assert body.conditions.times == (2.0,)
    held = np.stack([(x < 0.3) | (x > 0.9), (x < 0.3) | ((x > 0.4) & (x < 0.6))], axis=1)
    assert np.array_equal(body.operator.free, ~held) and not body.conditions.held.any()
    u = np.full(held.shape, 7.0)
    for time, step, at_end, ahead in (
        (0.0, 0.0, 0.0, 0.0),
        (0.0, 1.0, 0.1, 0.25),
        (1.0, 1.0, 0.2, 4.0),
        (2.0, 0.0, 0.5, 4.0),
    ):
        motion.displace(time, step, u.T)
        assert u[x > 0.9, 0] == pytest.approx(np.full((x > 0.9).sum(), at_end)), time
        inside = (x > 0.4) & (x < 0.6)
        assert u[inside, 1] == pytest.approx(np.full(inside.sum(), 7.0 + ahead))
    assert not u[x < 0.3].any() and (u[~held] == 7.0).all()
    velocity = motion.end_velocities(1.5, np.full(len(motion.rows), 0.4))
    is_driven = (motion.axes == 1) & (x[motion.rows] > 0.3)
    assert velocity[is_driven] == pytest.approx(np.full(is_driven.sum(), 1.5**3))
    assert velocity[~is_driven] == pytest.approx(np.full((~is_driven).sum(), 0.4))


def test_conditions_that_overlap_and_agree_have_one_entry_a_component(comm):
    first = {"kind": "displacement", "plane": "X = 1", "displacement": [1.0, 1.0]}
    end = {"lower": [0.95, -9.0], "upper": [1.05, 9.0]}
    last = {"kind": "displacement", "box": end, "displacement": [1.0, "free"]}
    body = Body(comm, 2, boundaries=[first, last])
    u = np.zeros(body.operator.free.shape)
    body.conditions.motion.displace(0.0, 0.0, u.T)
    at_end = body.particle_set.position[:, 0] > 0.9
    assert (u[at_end] == [1.0, 1.0]).all() and len(body.conditions.motion.rows) == 2 * at_end.sum()


ALL_AROUND = {"kind": "pressure", "pressure": "2e4*(t < 5)", "jumps": [5.0]}
HOLED = {"perforated_box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0], "centre": [1.0, 1.0], "radius": 0.6}}


@pytest.mark.serial
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_body_under_one_pressure_is_compressed_uniformly(comm, dimension):
    """Exactly, though its surface is made of stairs: a plate with a round notch on rollers, and a free ball."""
    ball = {"centre": [0.0] * dimension, "radius": 1.0}
    pressure = {**ALL_AROUND, "ball": {**ball, "radius": 9.0}}
    supports = [{"kind": "roller", "plane": f"{axis} = 0"} for axis in "XY"] if dimension == 2 else []
    shape = HOLED if dimension == 2 else {"sphere": ball}
    filling = {"shape": shape, "material": {**MATERIAL, "terms": []}, "particles": [10] * dimension}
    body = Body(comm, dimension, boundaries=[*supports, pressure], filling=filling, end_time=10.0)
    known = body.scene.bodies[0].material.equilibrium
    G, K = known.shear_modulus, known.bulk_modulus
    strain = -2e4 / (3.0 * K if dimension == 3 else 2.0 * (K + G / 3.0))
    away = np.abs(body.stretched() - strain * body.particle_set.position).max(initial=0.0)
    assert comm.allreduce(float(away), max) < 1e-10 * abs(strain)
    assert body.conditions.times == (5.0,) and not body.operator.external(7.0).any()


@pytest.mark.serial
@pytest.mark.parametrize("depth, told", [(0.01, True), (0.65, False)])
def test_a_pressure_needs_a_region_of_two_horizons(depth, told, comm):
    """A block between rollers: the first layer alone bears 46 % of the pressure on its face."""
    solid = {"kind": "linear-elastic", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
    held = [{"kind": "roller", "plane": plane} for plane in ("X = 0", "X = 1", "Y = 0")]
    pressed = {"kind": "pressure", "where": "face", "pressure": "1e3"}
    data = {
        "dimension": 2,
        "end_time": 1.0,
        "method": {"kind": "peridynamics", "plane": "strain", "solution": {"kind": "quasi-static", "step": 1.0}},
        "bodies": [{"shape": {"box": {"lower": [0, 0], "upper": [1, 1]}}, "particles": [12, 12], "material": solid}],
        "regions": [{"name": "face", "formula": f"Y > {1.0 - depth}"}],
        "boundaries": [*held, pressed],
    }
    codes = [one.code for one in simulation(data, comm).warnings]
    assert codes == (["thin-pressure-region"] if told else [])


def test_a_body_of_which_all_is_driven_has_the_step_of_a_free_one(comm):
    everywhere = {"kind": "velocity", "box": {"lower": [-1.0, -1.0], "upper": [3.0, 3.0]}, "velocity": ["0.5", "X"]}
    data = tables((6, 6), material=SOFT, method={"kind": "peridynamics"})
    free, driven = (simulation(data | {"boundaries": given}, comm) for given in ([], [everywhere]))
    step = driven.stable_step()
    assert step == pytest.approx(free.stable_step(), rel=1e-2)
    driven.take_step(step)
    rows = driven.systems[0].particles.owned_rows
    X = rows("reference_position")[:, :2]
    np.testing.assert_allclose(rows("position"), X + step * np.stack((np.full(len(X), 0.5), X[:, 0]), 1), atol=1e-12)
