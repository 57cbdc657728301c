"""Boundary conditions on particles whose internal forces are made up: energies and motion of leapfrog steps
against sums by numpy."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from grouped_meshes import block
from kinds import LOADS, MOVING, by_particle, contained, shuffle, table, tables_of
from mpi4py import MPI
from solids import SOFT

from parsolid.boundary.conditions import Conditions
from parsolid.boundary.forces import body_loads, surface_load
from parsolid.boundary.heat import HeatSupply
from parsolid.boundary.mirror_planes import MirrorPlane
from parsolid.boundary.surface import Surface
from parsolid.exact import SOLUTIONS
from parsolid.methods.leapfrog import Leapfrog, drift, kick, kinetic_energy
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.generated import declare_generated
from parsolid.particles.generation import generate
from parsolid.scene import load_scene, parse_scene
from parsolid.scene.boundaries import Pressure, Spring

STEP = 0.01
RUNS = __file__.rpartition("tests")[0] + "runs"
PUSHED = [
    *MOVING,
    {"kind": "fixed", "plane": "X = 0", "mirror": False, "name": "foot", "reaction": True},
    {"kind": "roller", "plane": "Y = 0"},
    {"kind": "spring", "plane": "X = 1", "stiffness": 3.0, "damping": 0.2, "name": "spring", "reaction": True},
    {"kind": "pressure", "plane": "Y = 1", "pressure": "2 + t", "jumps": [0.5], "name": "lid", "reaction": True},
    {"kind": "velocity", "point": [0.5, 0.5], "velocity": ["t**2", "cos(5*t)"], "name": "grip", "reaction": True},
]


class Ledger:
    """Sums of what a step does."""

    def __init__(self):
        self.terms = {}

    def add(self, weight, internal, numerical, external):
        self.add_term("numerical", weight * numerical)
        self.add_term("external", weight * external)

    def add_term(self, name, energy):
        self.terms[name] = self.terms.get(name, 0.0) + energy


def particles_of(particle_set, seed: int = 0) -> Particles:
    """A state by chance, with fields in columns."""
    result, chance, d = contained(particle_set), np.random.default_rng(seed), particle_set.position.shape[1]
    n = len(particle_set)
    result.declare(Field("deformation_gradient", d * d, "1"), np.eye(d).ravel() + 0.1 * chance.normal(size=(n, d * d)))
    displaced = particle_set.position + 0.1 * chance.normal(size=(n, d))
    for name, values in (("velocity", chance.normal(size=(n, d))), ("position", displaced)):
        result.declare(Field(name, d, "1", mirror="vector", layout=Columns()), values)
    for name in ("force", "damping"):
        result.declare(Field(name, d, "N", mirror="vector", layout=Columns()))
    return result


def set_up(scene, comm=MPI.COMM_SELF, particle_set=None):
    """Particles, their conditions and leapfrog."""
    particle_set = generate(scene, comm) if particle_set is None else particle_set
    particles = particles_of(particle_set)
    conditions = Conditions(comm, scene, particle_set, particles)
    particles.declare(Field("share", 1, "1"), conditions.share)
    particles.declare(Field("mass", 1, "kg"), 1000.0 * particle_set.volume / conditions.share)
    conditions.hold(0.0)
    return particles, conditions, Leapfrog(particles, conditions, "force", "damping")


def new_forces(particles, seed: int) -> np.ndarray:
    """Internal and dissipative forces by chance; their sum (d, n) on parts on this side of mirror planes."""
    chance, rows = np.random.default_rng(seed), particles.owned_rows
    for name in ("force", "damping"):
        rows(name)[:] = 5.0 * chance.normal(size=rows(name).shape)
    return rows("share") * rows("force").T, rows("share") * rows("damping").T


def kinetic(particles) -> float:
    n, of = particles.owned, particles.owned_rows
    return kinetic_energy(n, particles.storage("velocity"), of("mass"), of("share"))


def step_through(particles, conditions, leapfrog, ledger: Ledger, seeds: list[int], time: float = 0.2):
    """Steps under forces by chance; gives for each the work [J] of internal forces."""
    force, _ = new_forces(particles, 0)
    for seed in seeds:
        started = particles.owned_rows("position").T.copy()
        leapfrog.open_step(time, STEP)
        drift(0, particles.owned, STEP, particles.storage("velocity"), particles.storage("position"))
        leapfrog.place(time + STEP, STEP)
        moved, work = particles.owned_rows("position").T - started, force
        force, _ = new_forces(particles, seed)
        work, time = work + force, time + STEP
        leapfrog.close_step(time, STEP)
        leapfrog.book(STEP, ledger, 0.0, "offset")
        yield 0.5 * np.sum(work * moved)


def test_kinetic_energy_changes_by_all_works_and_the_offset():
    scene = parse_scene(tables_of("tlsph", *PUSHED) | {"loads": LOADS})
    particles, conditions, leapfrog = set_up(scene)
    ledger, energy = Ledger(), kinetic(particles)
    internal = sum(step_through(particles, conditions, leapfrog, ledger, [1, 2, 3]))
    gained = internal + ledger.terms["external"] - ledger.terms["numerical"] + ledger.terms["offset"]
    assert gained == pytest.approx(kinetic(particles) - energy, rel=1e-9)
    assert {"foot.work", "spring.work", "lid.work", "grip.work"} < set(ledger.terms)
    assert all(np.abs(one.values).max() > 0.0 for one in conditions.reactions)


def test_centred_dissipation_is_that_of_mean_velocities():
    chance = np.random.default_rng(5)
    v, force, damping = chance.normal(size=(3, 3, 20))
    mass, share = chance.uniform(1.0, 2.0, (2, 20))
    external, interaction, free = (
        *chance.normal(size=(2, 3, 20)),
        np.where(chance.uniform(size=(3, 20)) < 0.2, 0.0, 1.0),
    )
    some = np.arange(0, 20, 3)
    alone = np.zeros_like(external)
    alone[:, some] = external[:, some]
    for opening, few in product((True, False), repeat=2):
        old, half = v.copy(), 0.05
        loads, on_all, on_some = (alone, None, (alone, some)) if few else (external, external, (None, None))
        work, dissipated, offset, centred = kick(
            20, opening, half, v, force, damping, mass, share, on_all, interaction, free, *on_some
        )
        acting = (force + damping) / mass + (loads + interaction) / (mass * share)
        np.testing.assert_allclose(v - old, free * half * acting)
        middle = v if opening else old
        assert work == pytest.approx(half * np.sum(loads * middle))
        assert dissipated == pytest.approx(-half * np.sum(share * damping * middle))
        assert offset == pytest.approx(0.5 * np.sum(mass * share * (v - old) ** 2))
        assert dissipated + centred == pytest.approx(-half * np.sum(share * damping * 0.5 * (v + old)))


def test_loads_and_motion_stay_with_their_particles(comm):
    """After these changed rows, and came back from elsewhere."""
    scene = parse_scene(tables_of("tlsph", *PUSHED) | {"loads": LOADS})
    particle_set = generate(scene, comm)
    (still, fixed, _), (particles, found, _) = (set_up(scene, comm, particle_set) for _ in range(2))
    for _ in range(2):
        shuffle(particles)
        for time in (0.0, 0.7):
            loads = by_particle(particles, found.find_loads(time).T)
            assert np.array_equal(loads, by_particle(still, fixed.find_loads(time).T))
            values = []
            for mine, conditions in ((still, fixed), (particles, found)):
                conditions.impose(time)
                values.append(by_particle(mine, mine.owned_rows("velocity")))
            assert np.array_equal(*values)
        masks = [by_particle(mine, one.free.T) for mine, one in ((still, fixed), (particles, found))]
        assert np.array_equal(*masks)


def test_velocities_are_integrated_by_simpsons_rule_beside_displacements():
    data = tables_of(
        "peridynamics",
        {"kind": "velocity", "box": {"lower": [0.9, 0.2], "upper": [1.0, 1.0]}, "velocity": ["1 + X*t**3", "free"]},
        {"kind": "displacement", "box": {"lower": [0.9, 0.0], "upper": [1.0, 0.3]}, "displacement": ["free", "Y*t"]},
        {"kind": "displacement", "box": {"lower": [0.9, 0.0], "upper": [1.0, 0.2]}, "displacement": ["2", "free"]},
    )
    scene = parse_scene(data)
    particles, conditions, _ = set_up(scene)
    X, Y = particles.owned_rows("reference_position").T
    u = np.full((2, particles.owned), 7.0)
    conditions.motion.displace(0.2, 0.5, u)
    moved = X > 0.9
    wanted = np.where(moved, 7.0 + 0.5 + X * (0.7**4 - 0.2**4) / 4.0, 7.0)
    np.testing.assert_allclose(u[0], np.where(moved & (Y < 0.2), 2.0, wanted), rtol=1e-12)
    np.testing.assert_allclose(u[1], np.where(moved & (Y < 0.3), 0.7 * Y, 7.0), rtol=1e-12)


def test_a_displacement_jumps_in_a_step_of_no_length():
    history = {"rows": [[0.0, 1.0], [0.2, 1.0], [0.2, 3.0]]}
    pulled = {"kind": "displacement", "plane": "X = 1", "displacement": ["2", "free"], "history": history}
    particles, conditions, _ = set_up(parse_scene(tables_of("peridynamics", pulled)))
    u = np.zeros((2, particles.owned))
    for step, value in ((0.1, 2.0), (0.0, 6.0)):
        conditions.motion.displace(0.2 - step, step, u)
        assert set(u[0]) == {0.0, value}
    assert conditions.times == (0.2,)


def test_a_rotation_is_exact_where_only_velocities_are_prescribed():
    turned = {"kind": "rotation", "plane": "X = 1", "centre": [1.0, 0.5], "angle": "0.4*t"}
    particles, conditions, leapfrog = set_up(parse_scene(tables_of("tlsph", turned)))
    new_forces(particles, 1)
    leapfrog.open_step(0.0, 0.5)
    drift(0, particles.owned, 0.5, particles.storage("velocity"), particles.storage("position"))
    leapfrog.place(0.5, 0.5)
    leapfrog.close_step(0.5, 0.5)
    rows = np.unique(conditions.motion.rows)
    arm = particles.owned_rows("reference_position")[rows] - [1.0, 0.5]
    cos, sin = np.cos(0.2), np.sin(0.2)
    now = arm @ np.array([[cos, sin], [-sin, cos]])
    np.testing.assert_allclose(particles.owned_rows("position")[rows] - [1.0, 0.5], now, atol=1e-14)
    np.testing.assert_allclose(particles.owned_rows("velocity")[rows], 0.4 * now @ [[0, 1], [-1, 0]], atol=1e-14)


@pytest.mark.parametrize("kind", ["roller", "antisymmetric"])
def test_an_inclined_roller_holds_a_normal_or_what_is_across_it(kind, tmp_path):
    file = block(tmp_path / "m.msh", 0.4)
    body = {"shape": {"mesh": {"file": str(file)}}, "material": SOFT, "placement": "vertices"}
    rolled = {"kind": kind, "where": "bottom", "name": "bottom", "reaction": True}
    data = {"dimension": 2, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body], "boundaries": [rolled]}
    scene = parse_scene(data)
    particle_set = generate(scene, MPI.COMM_SELF)
    particles = Particles(particle_set.body)
    declare_generated(particles, particle_set)
    for name in ("velocity", "position", "force"):
        values = np.random.default_rng(len(name)).normal(size=particle_set.position.shape)
        particles.declare(Field(name, 2, "1", mirror="vector", layout=Columns()), values)
    particles.declare(Field("mass", 1, "kg"), 1000.0 * particle_set.volume)
    conditions = Conditions(MPI.COMM_SELF, scene, particle_set, particles)
    conditions.hold(0.0)
    leapfrog = Leapfrog(particles, conditions, "force")
    leapfrog.open_step(0.0, STEP)
    leapfrog.place(STEP, STEP)
    (roller,) = conditions.rollers
    assert len(roller.rows) > 5
    v = particles.owned_rows("velocity")[roller.rows]
    normal, tangent = np.array([np.sin(0.4), -np.cos(0.4)]), np.array([np.cos(0.4), np.sin(0.4)])
    held, other = (normal, tangent) if kind == "roller" else (tangent, normal)
    assert np.abs(v @ held).max() < 1e-12 < np.abs(v @ other).max()
    leapfrog.close_step(STEP, STEP)
    conditions.end_step(STEP, Ledger())
    # at corners both directions are held
    (reaction,) = conditions.reactions
    total = -particles.owned_rows("force")[roller.rows].sum(axis=0) @ held
    assert reaction.values[:2] @ held == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize("d", [2, 3])
def test_forces_on_surfaces_are_those_of_present_areas_and_motions(d):
    chance, rows = np.random.default_rng(d), np.array([1, 3])
    F, A = np.eye(d) + 0.2 * chance.normal(size=(4, d, d)), chance.normal(size=(2, d))
    place, start, velocity = chance.normal(size=(3, 4, d))
    fields = {"position": place, "reference_position": start, "velocity": velocity, "deformation_gradient": F}
    fields |= {"mass": np.array([9.0, 2.0, 9.0, 5.0])}
    normals, areas, mass = A / np.linalg.norm(A, axis=1)[:, None], np.linalg.norm(A, axis=1), np.array([2.0, 5.0])

    class Fields(dict):
        layout, owned = 0, 4

        def owned_rows(self, name):
            return self[name] if self[name].ndim == 1 else self[name].reshape(4, -1)

    surface = Surface.__new__(Surface)
    surface.particles, surface.selection, surface.axis = Fields(fields), SimpleNamespace(rows=rows), None
    surface.vectors = lambda rows: A
    pressure = Pressure(kind="pressure", plane="X = 0", pressure="7 + t")
    found, forces = surface_load(pressure)(pressure, surface).forces(2.0, True)
    cofactor = np.linalg.det(F)[:, None, None] * np.linalg.inv(F).swapaxes(1, 2)
    assert found is rows
    np.testing.assert_allclose(forces, -9.0 * np.einsum("kij,kj->ik", cofactor[rows], A), rtol=1e-12)
    for along in ("all", "normal"):
        spring = Spring(kind="spring", plane="X = 0", stiffness=3.0, damping=0.5, along=along)
        load = surface_load(spring)(spring, surface)
        traction = -3.0 * (place - start)[rows] - 0.5 * velocity[rows]
        if along == "normal":
            traction = np.einsum("ki,kj,kj->ki", normals, normals, traction)
        np.testing.assert_allclose(load.forces(2.0, False)[1].T, traction * areas[:, None], rtol=1e-12)
        fastest = max(np.sqrt(3.0 * a / m) + 0.5 * a / m for a, m in zip(areas, mass))
        assert 0.0 < load.largest_step < 1.7 / fastest < 2.0 * load.largest_step


def test_heat_through_planes_stays_with_the_particles_at_them(comm):
    data = tables_of("mpm", table("heat-flux") | {"heat_flux": "1 + Y*t"}) | {"loads": {"heat_source": "X"}}
    scene = parse_scene(data)
    particle_set, spacing = generate(scene, comm), 0.125
    # another surface that looks the same way, one spacing farther, is not meant
    behind = np.isclose(particle_set.position[:, 0], 1.5 * spacing)
    particle_set.area[behind, 0] = -spacing
    particles, still = contained(particle_set), contained(particle_set)
    fixed, found = (HeatSupply(scene, one, False) for one in (still, particles))
    for _ in range(2):
        shuffle(particles)
        power, expected = np.zeros((2, particles.owned))
        for result, supply in ((power, found), (expected, fixed)):
            rows, values = supply.powers(0, 0.5)
            result[rows] = values
        assert np.array_equal(by_particle(particles, power), by_particle(still, expected))
        assert np.array_equal(by_particle(particles, found.sources(0.5)), by_particle(still, fixed.sources(0.5)))
        at_plane = particles.owned_rows("reference_position")[:, 0] < spacing
        assert np.array_equal(power != 0.0, at_plane)
    # eight particles of side 1/8 at X = 0, at Y = 1/16, 3/16 ...
    assert comm.allreduce(float(power.sum())) == pytest.approx(1.0 + 0.5 * 0.5, rel=1e-12)


def test_a_plane_is_meant_for_all_bodies_or_for_one():
    body = np.array([0, 1, 1, 2])
    assert MirrorPlane(0, 0.5, "roller").concerns(body).tolist() == [True] * 4
    assert MirrorPlane(0, 0.5, "roller", 1).concerns(body).tolist() == [False, True, True, False]


def test_a_manufactured_load_is_the_body_force_of_its_solution():
    scene = load_scene(f"{RUNS}/mpm/vortex.toml")
    solution = SOLUTIONS[scene.reference.exact].of_scene(scene)
    place = np.random.default_rng(3).uniform(0.8, 1.2, (5, 2)) * [1.0, 0.2]
    particles = Particles(np.zeros(5, np.int64))
    particles.declare(Field("reference_position", 2, "m"), place)
    particles.declare(Field("mass", 1, "kg"), 3.0)
    (load,) = body_loads(scene, particles)
    for time in (0.1, 0.4):
        wanted = 3.0 * solution.body_force(place, time)
        np.testing.assert_allclose(load.forces(time, False)[1].T, wanted, rtol=1e-14)
        assert np.abs(wanted).max() > 0.0
