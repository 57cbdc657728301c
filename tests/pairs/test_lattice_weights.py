"""Weights of lattices in closed form: what they promise of forces, gradients, steps, loads and bodies side by side."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import (
    RUBBER,
    Record,
    StepsToEnd,
    follow,
    gathered,
    simulation,
    supports,
    tables,
)

from parsolid.collective import SolverError
from parsolid.pairs.box_planes import divergence_pass
from parsolid.scene import SceneError, parse_scene

HOLES = {
    2: ([14, 10], {"centre": [0.6, 0.31], "radius": 0.33}),
    3: ([10, 8, 7], {"centre": [0.0, 0.9, 0.35], "radius": 0.34}),
}
ROLLERS = supports(X=(0.0, "roller"), Y=(0.0, "roller"))


def holed(dimension, boundaries=(), **method) -> dict:
    """Steps around a hole, which a plane cuts in space; unequal spacings."""
    particles, hole = HOLES[dimension]
    box = {"lower": [0.0] * dimension, "upper": [1.2, 0.9, 0.7][:dimension]}
    data = tables(particles, method={"weights": "cells"} | method, boundaries=list(boundaries))
    data["bodies"][0] |= {"shape": {"perforated_box": box | hole}, "placement": "vertices"}
    return data


def box(dimension, weights, boundaries=(), **rest) -> dict:
    """Unequal spacings; in space two axes have room for fourth order, one has not."""
    upper = [1.2, 0.9, 0.7][:dimension]
    particles = [10, 9, 5][:dimension]
    return tables(particles, upper, method={"weights": weights}, boundaries=list(boundaries), **rest)


def graded(dimension, weights, boundaries=(), grading=((1, 1.6, 1), (3, 1), (1,))) -> dict:
    """Spacings that change along two axes."""
    data = box(dimension, weights, boundaries, body={"grading": [list(one) for one in grading[:dimension]]})
    return data | {"method": data["method"] | {"integrator": "leapfrog"}}


BODIES = {
    "cells with a hole 2-D": holed(2),
    "cells with a hole 3-D": holed(3),
    "cells with a hole 3-D, mirrors": holed(3, ROLLERS),
    "cells 2-D, mirrors": box(2, "cells", ROLLERS),
    "fourth order 2-D": box(2, "fourth-order"),
    "fourth order 3-D": box(3, "fourth-order"),
    "cells 2-D, mirrors, graded": graded(2, "cells", ROLLERS),
    "fourth order 2-D, graded": graded(2, "fourth-order"),
    "fourth order 3-D, mirrors, graded": graded(3, "fourth-order", supports(X=(0.0, "roller"), Z=(0.7, "fixed"))),
    "fourth order 3-D, mirrors": box(3, "fourth-order", [*ROLLERS, *supports(X=(1.2, "roller"), Z=(0.7, "fixed"))]),
}


def whole_areas(sim) -> np.ndarray:
    """A_a (n, d) with halves beyond mirror planes."""
    area = np.array(sim.systems[0].particles.owned_rows("area"))
    for plane in sim.systems[0].conditions.planes:
        on = plane.contains(sim.particle_sets[0])
        area[on] *= 2.0
        area[on, plane.axis] = 0.0
    return area


def evaluated(sim) -> tuple[np.ndarray, np.ndarray]:
    """Forces (n, d) [N] of the stresses and of the dissipation in the present state; collective."""
    sim.systems[0].leapfrog.evaluate()
    rows = sim.systems[0].particles.owned_rows
    return rows("stress_force").copy(), rows("dissipative_force").copy()


def forces_of(sim, stress) -> np.ndarray:
    """Pair force (n, d) [N] of a stress that is the same at all particles."""
    method, d = sim.systems[0], sim.systems[0].dimension
    if method.boxes is not None:
        sweeps, stored = method.boxes.sweeps, method.particles.storage
        sweeps.exchange_motion(stored("velocity"), stored("position"))
        # of all planes, whether they have places of their own or take turns
        sweeps.P[:] = stress.reshape(-1, 1)
        forces = stored("stress_force"), stored("dissipative_force"), None
        for box in sweeps.here:
            planes, arrays = (box.first_plane, box.last_plane), (sweeps.P, sweeps.v, sweeps.x, sweeps.G, sweeps.Z)
            divergence_pass(box, sweeps.scratch(box), *planes, *arrays, *forces)
        return np.array(method.particles.owned_rows("stress_force"))
    owned, width, record = method.owned, {2: 2, 3: 4}[d], method.lists.record
    L = method.lists.corrections
    record[:] = 0.0
    P = record[:owned, method.lists.columns.stress :][:, : d * width].reshape(owned, d, width)
    P[:, :, :d] = (stress @ L).swapaxes(1, 2)
    method.lists.find_forces()
    return np.array(method.particles.owned_rows("stress_force"))


@pytest.mark.parametrize("data", BODIES.values(), ids=BODIES)
def test_a_constant_stress_has_the_force_of_its_tractions_and_linear_fields_are_exact(data, comm):
    sim = simulation(data, comm)
    method, d = sim.systems[0], sim.systems[0].dimension
    mirrored = bool(method.conditions.planes)
    matrix = np.diag([0.3, -0.2, 0.7][:d]) if mirrored else np.arange(1.0, 1.0 + d * d).reshape(d, d)
    wanted = -whole_areas(sim) @ matrix.T
    assert np.abs(forces_of(sim, matrix) - wanted).max(initial=0.0) < 1e-13
    particles, axes = method.particles, [plane.axis for plane in method.conditions.planes]
    # nothing is linear between two mirrors
    matrix[[axis for axis in axes if axes.count(axis) == 2]] = 0.0
    particles.owned_rows("position")[:] += particles.owned_rows("reference_position") @ matrix.T
    assert np.abs(method.displacement_gradient() - matrix).max(initial=0.0) < 1e-12
    # all of the body, once
    volume = comm.allreduce(particles.owned_rows("volume").sum())
    cells = np.prod([1.2, 0.9, 0.7][:d])
    if "perforated_box" in data["bodies"][0]["shape"]:
        from parsolid.particles.fillings import filling_of

        filling = filling_of(sim.scene.bodies[0], d)
        cells = filling.cells.count * filling.cells.volume
    assert volume == pytest.approx(cells, rel=1e-13)


@pytest.mark.parametrize("weights", ["cells", "fourth-order"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_static_pull_is_in_balance_at_every_particle(dimension, weights, comm):
    planes = supports(**dict.fromkeys("XYZ"[:dimension], (0.0, "roller")))
    data = box(dimension, weights, planes, material=RUBBER)
    stretch, normals = [1.01, 0.995, 1.02][:dimension], np.eye(dimension)
    probe = simulation(data)
    probe.systems[0].particles.owned_rows("deformation_gradient")[:] = np.diag(stretch).ravel()
    probe.systems[0].complete_strain(np.zeros(probe.systems[0].owned, bool))
    P = probe.systems[0].shown("first_piola_kirchhoff_stress", 0, 1)[0, :dimension, :dimension]
    for axis, upper in enumerate([1.2, 0.9, 0.7][:dimension]):
        traction = [repr(float(value)) for value in P @ normals[axis]]
        data["boundaries"].append({"kind": "traction", "plane": f"{'XYZ'[axis]} = {upper}", "traction": traction})
    data["bodies"][0]["displacement"] = [f"{s - 1.0}*{axis}" for s, axis in zip(stretch, "XYZ")]
    sim = simulation(data, comm)
    method = sim.systems[0]
    stress = method.shown("first_piola_kirchhoff_stress", 0, method.owned)[:, :dimension, :dimension]
    assert np.abs(stress - P).max(initial=0.0) < 1e-10 * np.abs(P).max()
    loads = method.conditions.find_loads(0.0).T / method.share[:, None]
    left = ~method.conditions.held * (evaluated(sim)[0] + loads)
    # a rank may have no particle that is loaded
    largest = comm.allreduce(np.abs(loads).max(initial=0.0), MPI.MAX)
    assert np.abs(left).max(initial=0.0) < 1e-10 * largest


def pulled_bar(cells: int, weights: str) -> float:
    """Largest error of the end's displacement over its largest value, of a confined bar under a smooth traction."""
    speed = np.sqrt((RUBBER["youngs_modulus"] * 0.55 / (1.45 * 0.1)) / RUBBER["density"])
    modulus, period = RUBBER["density"] * speed**2, 2.0 / speed
    planes = supports(X=(0.0, "roller"), Y0=(0.0, "roller"), Y1=(0.5, "roller"))
    pull = {"kind": "traction", "plane": "X = 1", "traction": [f"10*sin(2*pi*t/{period})**3", "0"]}
    data = tables(
        [cells + 1, cells // 2 + 1],
        [1.0, 0.5],
        material=RUBBER,
        method={"weights": weights},
        boundaries=[*planes, pull],
        end_time=1.4 / speed,
    )

    def end(sim):
        rows = sim.systems[0].particles.owned_rows
        there = rows("reference_position")[:, 0] == 1.0
        return {"u": np.mean(rows("position")[there, 0]) - 1.0}

    sim = simulation(data)
    found = follow(sim, Record(end), policy=StepsToEnd)
    # before the wave is back from the other end: u = (c/E') times the integral of the traction
    phase = 2.0 * np.pi * found["time"] / period
    wanted = speed / modulus * 10.0 * period / (2.0 * np.pi) * (2.0 / 3.0 - np.cos(phase) + np.cos(phase) ** 3 / 3.0)
    return np.abs(found["u"] - wanted).max() / np.abs(wanted).max()


@pytest.mark.serial
@pytest.mark.parametrize("weights", ["cells", "fourth-order"])
def test_displacement_under_a_traction_in_time_is_of_second_order(weights):
    coarse, fine = pulled_bar(16, weights), pulled_bar(32, weights)
    assert fine < 6e-3
    assert np.log2(coarse / fine) > 1.9


@pytest.mark.serial
@pytest.mark.parametrize(("weights", "least"), [("cells", -1e-12), ("fourth-order", -5e-3)])
def test_the_dissipation_makes_no_motion_grow(weights, least):
    sim = simulation(box(2, weights))
    velocity = sim.systems[0].particles.owned_rows("velocity")
    columns = []
    for unit in np.eye(velocity.size):
        velocity[:] = unit.reshape(velocity.shape)
        columns.append(-evaluated(sim)[1].ravel())
    root = np.sqrt(sim.systems[0].mass.repeat(2))
    rates = np.array(columns).T / np.outer(root, root)
    # v . D v: of cells positive, of fourth order at ends not quite
    powers = np.linalg.eigvalsh(0.5 * (rates + rates.T))
    assert powers.min() > least * powers.max()
    assert np.linalg.eigvals(rates).real.min() > -1e-12 * powers.max()


@pytest.mark.serial
@pytest.mark.parametrize("weights", ["cells", "fourth-order"])
@pytest.mark.parametrize("particles", [(9, 8, 8), (2, 4, 9)], ids=["box", "thin"])
@pytest.mark.parametrize("ratio", [0.0, 0.3, 0.499])
def test_waves_of_every_length_are_stable(weights, particles, ratio):
    data = tables(particles, material=RUBBER | {"poissons_ratio": ratio, "branches": [{"beta": 2.0, "tau": 1e3}]})
    data["method"] |= {"weights": weights, "integrator": "leapfrog"}
    if weights == "fourth-order" and max(particles) < 8:
        pytest.skip("no room")
    sim = simulation(data)
    velocity = sim.systems[0].particles.owned_rows("velocity")
    velocity[:] = np.random.default_rng(0).normal(size=velocity.shape)
    rows = follow(sim, Record(), 400)
    total = rows["kinetic"] + rows["strain_energy"]
    # leapfrog's energy swings with its highest frequency
    assert total.max() < 1.3 * total[0]
    assert total[-1] < 0.5 * total[0]


@pytest.mark.serial
@pytest.mark.parametrize("boundaries", [(), supports(Y=(0.0, "fixed"))], ids=["free", "held"])
def test_waves_on_nodes_that_are_dense_at_their_ends_decay(boundaries):
    """With the outermost pairs in the dissipation a free plate of these is lost within 42 steps."""
    data = tables([9, 9], material=RUBBER, boundaries=list(boundaries), body={"grading": [[1, 4, 1], [1, 3, 1]]})
    data["method"] |= {"weights": "fourth-order", "integrator": "leapfrog", "safety": 1.0}
    sim = simulation(data)
    rows = sim.systems[0].particles.owned_rows
    rows("velocity")[:] = np.random.default_rng(0).normal(size=rows("velocity").shape)
    sim.systems[0].conditions.hold(0.0)
    found = follow(sim, Record(), 400)
    total = found["kinetic"] + found["strain_energy"]
    assert total.max() < 1.3 * total[0] and total[-1] < 0.5 * total[0]


def test_the_best_weights_of_bodies_side_by_side_are_those_that_each_has_alone(comm):
    def scene(*which):
        # images at the first plane for some of them, at the second for all
        planes = supports(Y0=(0.0, "fixed"), Y1=(1.0, "roller"))
        data = tables([9, 5], method={"weights": "best"}, boundaries=planes)
        whole = data["bodies"][0]
        shapes = [
            {"shape": {"box": {"lower": [0.0, 0.0], "upper": [2.0, 1.0]}}},
            {"shape": {"box": {"lower": [3.0, 0.0], "upper": [5.0, 1.0]}}, "jitter": 0.2},
            {"shape": {"box": {"lower": [6.0, 0.0], "upper": [8.0, 1.0]}}, "placement": "cells", "jitter": 0.1},
        ]
        data["bodies"] = [whole | shapes[i] | {"velocity": ["0.1*sin(X)*Y", "0.1*cos(X)"]} for i in which]
        return data

    alone, together = [simulation(scene(i), comm) for i in range(3)], simulation(scene(0, 1, 2), comm)
    assert together.systems[0].summary() == {"pair_weights": ["fourth-order", "closure", "kernel"]}
    volumes = [gathered(sim, "volume")[0] for sim in alone]
    assert len({tuple(np.sort(one)[[0, -1]]) for one in volumes}) == 3
    assert np.allclose(gathered(together, "volume")[0], np.concatenate(volumes), rtol=1e-14)
    forces = np.concatenate([_forces(sim) for sim in alone])
    assert np.abs(_forces(together) - forces).max() < 1e-12 * np.abs(forces).max()


def _forces(sim) -> np.ndarray:
    """Dissipative and elastic pair forces of a strained state, in the order of the particles."""
    method = sim.systems[0]
    method.particles.owned_rows("deformation_gradient")[:, 0] = 1.1
    found = sum(evaluated(sim))
    order = np.argsort(np.concatenate(sim.comm.allgather(method.particles.owned_rows("identifier").copy())))
    return np.concatenate(sim.comm.allgather(found))[order]


@pytest.mark.serial
def test_nodes_whose_spacing_changes_too_fast_are_refused():
    method = {"weights": "fourth-order", "integrator": "leapfrog"}
    with pytest.raises(SolverError):
        simulation(tables([9, 9], method=method, body={"grading": [[1, 1e3], [1]]}))


def test_bodies_that_touch_are_refused_or_bonded_by_the_kernel(comm):
    def scene(weights):
        data = tables([9, 9], method={"weights": weights, "integrator": "leapfrog"})
        second = dict(data["bodies"][0], shape={"box": {"lower": [1.1, 0.0], "upper": [2.1, 1.0]}})
        data["bodies"].append(second)
        return data | {"bond": [{"bodies": "all"}]}

    with pytest.raises(SceneError, match="^method.weights: expected .* found bodies.0 and bodies.1$"):
        parse_scene(scene("cells"))
    best, kernel = (simulation(scene(weights), comm).systems[0].lists.near for weights in ("best", "kernel"))
    assert np.array_equal(best.inner.weight, kernel.inner.weight)


def test_what_only_the_particles_tell_is_refused(comm):
    with pytest.raises(SolverError, match="^method.weights: expected .* bodies.0$"):
        simulation(tables([3, 3], method={"weights": "fourth-order"}), comm)
    data = tables([9, 9], method={"weights": "cells"}, boundaries=supports(X=(-0.05, "roller")))
    other = dict(data["bodies"][0], shape={"box": {"lower": [-0.05, 3.0], "upper": [0.95, 4.0]}})
    data["bodies"].append(other)
    with pytest.raises(SolverError, match="^boundaries: expected mirror planes through nodes .* X = -0.05"):
        simulation(data, comm)
