"""Small bodies, random states and short runs for the tests; no particle number in here is more than a few hundred."""

import copy

import numpy as np
from mpi4py import MPI

from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.materials.plastic.tile_update import new_tile
from parsolid.methods.hyperelastic_particles import TENSOR_ROWS
from parsolid.methods.mpm.elastic_plastic import BulkViscosity, State, advance_state
from parsolid.methods.mpm.points import SYMMETRIC_ROWS
from parsolid.output.run_folder import RunFolder
from parsolid.scene import parse_scene
from parsolid.simulation.job import Job
from parsolid.simulation.loop import Limits, Simulation
from parsolid.simulation.outputs import Cadence, Output
from parsolid.simulation.time_step import TimeSteps
from parsolid.solvers.runge_kutta import Stage

# a stage as long as the step, not its last one
EULER = Stage(0.0, 1.0, 0.0, 0.0, 1.0, first=True)
# numbers of order one, so that tolerances are absolute
SOFT = {"kind": "mooney-rivlin", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
RUBBER = {"kind": "mooney-rivlin", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.45}
COPPER = {
    "kind": "elastic-plastic",
    "density": 8930.0,
    "specific_heat": 383.0,
    "reference_temperature": 300.0,
    "equation_of_state": {"kind": "mie-grueneisen", "sound_speed": 3940.0, "slope": 1.489, "gamma": 2.02},
    "shear_modulus": {"kind": "constant", "modulus": 47.7e9},
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 400e6, "hardening": 100e6},
}
# with a linear equation of state
LINEAR_COPPER = {
    "kind": "elastic-plastic",
    "density": 8930.0,
    "specific_heat": 383.0,
    "taylor_quinney": 0.9,
    "equation_of_state": {"kind": "linear", "bulk_modulus": 130e9},
    "shear_modulus": {"kind": "constant", "modulus": 43.333e9},
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 400e6, "hardening": 100e6},
}
ONE_BRANCH = [{"beta": 1.0, "tau": 0.02}]
THREE_BRANCHES = [{"beta": 1.0, "tau": 0.02}, {"beta": 0.5, "tau": 0.3}, {"beta": 2.0, "tau": 4.0}]


def tables(particles, upper=None, lower=None, *, material=SOFT, method=None, end_time=1.0, body=None, **rest) -> dict:
    """Raw tables of a scene with one box; `method` and `body` add keys, `rest` are further tables."""
    dimension = len(particles)
    box = {"lower": list(lower or [0.0] * dimension), "upper": list(upper or [1.0] * dimension)}
    data = {
        "dimension": dimension,
        "end_time": end_time,
        "method": _stated(method or {}, not {"contact", "tools", "tie"} & set(rest)),
        "bodies": [{"shape": {"box": box}, "particles": list(particles), "material": material, **(body or {})}],
        **rest,
    }
    return copy.deepcopy(data)


def _stated(method: dict, free: bool) -> dict:
    """A method's table with the kernel and, for bodies that touch nothing and have its weights, the integrator of the
    paper, if it has none of its own."""
    table = {"kind": "tlsph", **method}
    if table["kind"] != "tlsph":
        return table
    kernel = table.get("weights", "kernel") in ("kernel", "closure")
    paper = {"kernel": "wendland-c2"} | ({"integrator": "ssp-rk3"} if free and "safety" not in table and kernel else {})
    return paper | table


def simulation(data: dict, comm=MPI.COMM_SELF) -> Simulation:
    """A simulation of raw tables, by default of this rank alone."""
    return Simulation(comm, parse_scene(data))


def supports(**planes) -> list[dict]:
    """Boundary tables from X=(0.0, "roller") and the like; several on an axis as X0, X1."""
    return [{"plane": f"{key[0]} = {place}", "kind": kind} for key, (place, kind) in planes.items()]


def punch(particles=(17, 17), **keys) -> dict:
    """The punch test of Lee et al., section 7.2.1."""
    return tables(
        particles,
        material={**RUBBER, "branches": [{"beta": 3.0, "tau": 0.02}]},
        body={"velocity": ["0", "-100*Y*where(X < 0.5, 2*X, 1)"]},
        boundaries=supports(X0=(0.0, "roller"), X1=(1.0, "roller"), Y=(0.0, "roller")),
        **keys,
    )


def column(particles=(5, 13, 5), beta=1.0, **keys) -> dict:
    """A short twisting column after Lee et al., section 7.3."""
    return tables(
        particles,
        lower=[-0.5, 0.0, -0.5],
        upper=[0.5, 3.0, 0.5],
        material={**RUBBER, "branches": [{"beta": beta, "tau": 0.02}]},
        body={"velocity": ["50*sin(pi*Y/6)*Z", "0", "-50*sin(pi*Y/6)*X"]},
        boundaries=supports(Y=(0.0, "fixed")),
        **keys,
    )


class StableSteps(TimeSteps):
    """Steps as long as is stable, which land nowhere."""

    def clip(self, time: float, stable: float) -> tuple[float, float]:
        return stable, time + stable


class StepsToEnd(TimeSteps):
    """The same, with a last step that ends at the scene's end."""

    def clip(self, time: float, stable: float) -> tuple[float, float]:
        return (stable, time + stable) if time + stable < self.end else (self.end - time, self.end)


class Record(Output):
    """Keeps the ledger's row, and any further numbers, after every step."""

    every = Cadence(steps=1, times=(0.0,))

    def __init__(self, more=None):
        self.more = more or (lambda simulation: {})
        self.rows = []

    def write(self, simulation) -> None:
        row = simulation.ledger.row(simulation.comm, *simulation.energies())
        self.rows.append({"time": simulation.clock.time, **row, **self.more(simulation)})

    def columns(self) -> dict[str, np.ndarray]:
        """Every column over the steps."""
        return {name: np.array([row[name] for row in self.rows]) for name in self.rows[0]}


def recorded(sim, more=None, steps: int | None = None) -> dict[str, np.ndarray]:
    """The columns of a record of so many steps, or of all to the end."""
    record = Record(more)
    sim.run(None, [record], Limits(steps=steps))
    return record.columns()


def follow(sim, record, steps: int | None = None, policy=StableSteps) -> dict[str, np.ndarray]:
    """So many steps, or to the end, as long as the policy makes them; the columns of the record."""
    sim.time_steps = policy.of(sim.scene, sim.systems)
    sim.run(None, [record], Limits(steps=steps))
    return record.columns()


def run_into(folder, comm, scene, steps: int | None = None, restart=None) -> Job:
    """A run with all its files, so many steps or to its end; it knows its simulation."""
    job = Job(Simulation(comm, scene, restart), RunFolder(comm, folder, restart and restart.path), restart)
    job.simulation.run(None, job.outputs, Limits(steps))
    job.finish()
    job.close()
    job.folder.close()
    return job


def run_steps(data: dict, steps: int, comm=MPI.COMM_SELF, more=None) -> tuple[Simulation, dict]:
    """So many stable steps; the simulation and the columns of its record."""
    sim = simulation(data, comm)
    return sim, follow(sim, Record(more), steps)


def run_to_end(data: dict, comm=MPI.COMM_SELF, more=None) -> tuple[Simulation, dict]:
    """A run to exactly the end; the simulation and the columns of its record."""
    sim = simulation(data, comm)
    return sim, follow(sim, Record(more), policy=StepsToEnd)


def run_alone_and_on_all(data: dict, comm, names=("time", "kinetic", "strain_energy")) -> dict[str, np.ndarray]:
    """The columns of a run to the end on one rank, of which those with names are the same on all ranks, to 1e-9 of
    their maxima."""
    together, alone = (run_to_end(data, some)[1] for some in (comm, MPI.COMM_SELF))
    assert len(together["time"]) == len(alone["time"])
    for name in names:
        atol = 1e-9 * np.abs(alone[name]).max()
        np.testing.assert_allclose(together[name], alone[name], rtol=0.0, atol=atol, err_msg=name)
    return alone


CONSTANT = ("identifier", "body", "reference_position", "volume", "spacing", "axes", "area")


def evolved(particles) -> list[str]:
    """Names of the fields that steps change and a restart needs."""
    return [name for name in particles.checkpointed() if name not in CONSTANT]


def gathered(sim, *names: str) -> list[np.ndarray]:
    """Fields of all particles of all ranks in the order of their identifiers, the same on every rank.

    Small bodies only.
    """
    table = sim.systems[0].particles
    order = np.argsort(np.concatenate(sim.comm.allgather(table.owned_rows("identifier").copy())))
    return [np.concatenate(sim.comm.allgather(np.array(table.owned_rows(name))))[order] for name in names]


def momenta(sim) -> dict[str, np.ndarray]:
    """Momentum "p" and angular momentum "l" of all particles about the origin."""
    v, x, m = (sim.systems[0].particles.owned_rows(name) for name in ("velocity", "position", "mass"))
    p = m[:, None] * v
    turning = np.cross(x, p) if x.shape[1] == 3 else x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]
    return {"p": sim.comm.allreduce(p.sum(axis=0)), "l": sim.comm.allreduce(turning.sum(axis=0))}


def assert_same_fields(sim, other, names, part: float) -> None:
    """Fields of all particles of two simulations are the same, but for a part of the greatest value of the other's."""
    for name, found, wanted in zip(names, gathered(sim, *names), gathered(other, *names)):
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=part * np.abs(wanted).max(), err_msg=name)


# --- random states -----------------------------------------------------------------------------------------------


def random_of(identifier: np.ndarray, *shape: int, seed: int = 0) -> np.ndarray:
    """Normal numbers (n, ...) that depend on the particles' identifiers alone."""
    draws = [np.random.default_rng([seed, int(number)]).normal(size=shape) for number in identifier]
    return np.array(draws).reshape(len(identifier), *shape)


def set_random_state(sim, strain: float = 0.15, consistent: bool = True, seed: int = 0) -> None:
    """Random v, x, F with H = cof F and J = det F (else also random), and A, with the symmetries of the mirror
    planes.
    """
    table, d, owned = sim.systems[0].particles, sim.systems[0].dimension, sim.systems[0].owned
    names = table.owned_rows("identifier")
    free = ~sim.systems[0].conditions.held
    table.owned_rows("velocity")[:] = free * random_of(names, d, seed=seed)
    table.owned_rows("position")[:] = table.owned_rows("reference_position") + 0.03 * free * random_of(
        names, d, seed=seed + 1
    )
    F = np.tile(np.eye(3), (owned, 1, 1))
    F[:, :d, :d] += symmetrised(sim, strain * random_of(names, d, d, seed=seed + 2))
    table.owned_rows("deformation_gradient")[:] = F[:, :d, :d].reshape(owned, d * d)
    J, H = np.linalg.det(F), np.linalg.det(F)[:, None, None] * np.linalg.inv(F).swapaxes(1, 2)
    if not consistent:
        J = J * (1.0 + 0.05 * random_of(names, seed=seed + 3))
        H[:, :d, :d] += symmetrised(sim, 0.05 * random_of(names, d, d, seed=seed + 4))
    table.owned_rows("jacobian")[:] = J
    if d == 3:
        table.owned_rows("cofactor")[:] = H.reshape(owned, 9)
    for alpha in range(sim.systems[0].branches):
        root = strain * random_of(names, d, d, seed=seed + 5 + alpha)
        A = np.eye(d) + symmetrised(sim, root + root.swapaxes(1, 2) + 3.0 * root @ root.swapaxes(1, 2))
        rows = [A[:, i, i] for i in range(d)] + [A[:, i, j] for i in range(d) for j in range(i + 1, d)]
        table.owned_rows(f"viscous_strain_inverse_{alpha + 1}")[:] = np.stack(rows, axis=1)


def symmetrised(sim, tensors: np.ndarray) -> np.ndarray:
    """Tensors (n, d, d), displacement gradients or strains, made X = R X R on rollers, X = -R X R on antisymmetric
    planes.
    """
    d, result = sim.systems[0].dimension, tensors.copy()
    for plane in sim.systems[0].conditions.planes:
        if plane.kind == "fixed":
            continue
        on = plane.contains(sim.particle_sets[0])
        R = np.eye(d)
        R[plane.axis, plane.axis] = -1.0
        sign = -1.0 if plane.kind == "antisymmetric" else 1.0
        result[on] = 0.5 * (result[on] + sign * R @ result[on] @ R)
    return result


def strains(sim) -> dict[str, np.ndarray]:
    """F, H (n, 3, 3), J (n,) and A (branches, n, 3, 3) of the owned particles."""
    table, d, owned = sim.systems[0].particles, sim.systems[0].dimension, sim.systems[0].owned
    F = np.tile(np.eye(3), (owned, 1, 1))
    F[:, :d, :d] = table.owned_rows("deformation_gradient").reshape(owned, d, d)
    J = np.array(table.owned_rows("jacobian"))
    if d == 3:
        H = np.array(table.owned_rows("cofactor")).reshape(owned, 3, 3)
    else:
        # in plane strain H = cof F but for H33, which is the evolved J
        H = np.zeros_like(F)
        H[:, 0, 0], H[:, 0, 1], H[:, 1, 0], H[:, 1, 1] = F[:, 1, 1], -F[:, 1, 0], -F[:, 0, 1], F[:, 0, 0]
        H[:, 2, 2] = J
    A = np.tile(np.eye(3), (sim.systems[0].branches, owned, 1, 1))
    for alpha in range(sim.systems[0].branches):
        rows = np.array(table.owned_rows(f"viscous_strain_inverse_{alpha + 1}"))
        A[alpha][:, range(d), range(d)] = rows[:, :d]
        for column, (i, j) in zip(rows[:, d:].T, [(i, j) for i in range(d) for j in range(i + 1, d)]):
            A[alpha][:, i, j] = A[alpha][:, j, i] = column
    return {"F": F, "H": H, "J": J, "A": A}


def evaluate(sim) -> dict[str, np.ndarray | float]:
    """One semi-discrete evaluation of the current state, which stays as it is; collective.

    gradient (n, d, d) [1/s], P L (n, d, d) [Pa] of bodies with pair lists, T, D (n, d) [N], internal and numerical
    dissipation and the loads' power of this rank [W].
    """
    method, d = sim.systems[0], sim.systems[0].dimension
    names = [name for name in ("deformation_gradient", "cofactor", "jacobian") if name in method.particles]
    of, kept = method.particles.owned_rows, {name: method.particles.owned_rows(name).copy() for name in names}
    # a step of 1 s changes F by grad v
    for bodies in method.sweeps:
        bodies.advance_stage(EULER, 1.0)
        bodies.find_forces()
    gradient = (of("deformation_gradient") - kept["deformation_gradient"]).reshape(-1, d, d)
    for name in names:
        of(name)[:] = kept[name]
    # the dissipation of this moment: in a step it is weighted for how it falls within
    internal = sum(bodies.advance_stage(EULER, 1e-12)[1] for bodies in method.sweeps)
    for name in names:
        of(name)[:] = kept[name]
    for bodies in method.sweeps:
        bodies.find_forces()
    T, D = of("stress_force").reshape(-1, d).copy(), of("dissipative_force").reshape(-1, d).copy()
    record = np.zeros((0, d, d))
    if method.lists is not None:
        at = method.lists.columns
        record = method.lists.record[: method.lists.last, at.stress : at.stress + d * at.vector].reshape(
            -1, d, at.vector
        )
    numerical, power = method.staged_step.advance_motion(EULER, 0.0, 0.0)
    return {
        "gradient": gradient,
        "PL": record[:, :, :d].swapaxes(1, 2).copy(),
        "T": T,
        "D": D,
        "internal": internal,
        "numerical": numerical,
        "power": power,
    }


def late_impulse(system) -> np.ndarray:
    """Impulses (owned, d) [N s] of external forces that velocities do not have yet: those of material points are of the
    middle of the last step."""
    external = getattr(system, "external", None)
    if external is None:
        return np.zeros((system.owned, system.dimension))
    rows = system.particles.owned_rows
    return rows(EXTERNAL_IMPULSE) + 0.5 * external.behind.step * rows(EXTERNAL_FORCE)


class PlasticPoints:
    """Elastic-plastic material points at the temperature 0 that never fail, reference volume 1."""

    def __init__(self, law, dimension: int, capacity: int) -> None:
        self.law, self.dimension = law, dimension
        deformation = np.zeros((len(TENSOR_ROWS[dimension]), capacity))
        deformation[np.isin(TENSOR_ROWS[dimension], (0, 4, 8))] = 1.0
        deviator = np.zeros((SYMMETRIC_ROWS[dimension], capacity))
        self.state = State(deformation, deviator, *(np.zeros((1, capacity)) for _ in range(3)))
        self.motion, self.rate, self.record = (np.zeros((capacity, columns)) for columns in (8, 12, 8))
        self.motion[:, 7] = 1.0

    def advance(self, first: int, last: int, step: float, viscosity: BulkViscosity | None = None) -> tuple:
        """Points first..last-1 by a step [s], see `mpm.elastic_plastic.advance_state`."""
        plane, places = True if self.dimension == 2 else None, TENSOR_ROWS[self.dimension]
        viscosity = BulkViscosity(0.0, 0.0, 0.0) if viscosity is None else viscosity
        return advance_state(
            first, last, self.law, None, plane, places, step, viscosity, self.state, None, None, None,
            self.motion, self.rate, self.record, new_tile(),
        )  # fmt: skip
