"""Material steps on a chain of viscoelastic springs, whose creep is known exactly."""

from types import SimpleNamespace

import numpy as np
import pytest
from solids import simulation, tables
from tlsph.test_static_tools import StopAfter

from parsolid.exact.linear_viscoelastic import PronySeries
from parsolid.methods.peridynamics.equilibrium import Equilibrium
from parsolid.methods.peridynamics.quasi_static import QuasiStatic, lagrange_weights
from parsolid.particles.container import Particles
from parsolid.simulation.loop import FINISHED, INTERRUPTED

ELASTIC = {"kind": "linear-elastic", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
_POINTS = 12
RATIO, TIME = 9.0, 1.0


class Chain:
    """Springs between points in a row, the first held; all relax as 1 + 9 exp(-t/1 s); points spread over the ranks.

    cubic: stiffening with the third power of the elongation of the relaxing displacement.
    """

    def __init__(self, comm, cubic=0.0):
        self.comm, self.cubic, self.is_linear = comm, cubic, cubic == 0.0
        ends = [rank * _POINTS // comm.size for rank in range(comm.size + 1)]
        self.mine = slice(ends[comm.rank], ends[comm.rank + 1])
        self.identifier = np.arange(_POINTS)[self.mine]
        self.free = (self.identifier > 0)[:, None]
        self.mass = np.ones(len(self.identifier))
        self.history, self.committed = np.zeros((_POINTS, 1)), np.zeros((_POINTS, 1))

    def whole(self, part):
        return np.concatenate(self.comm.allgather(part))

    def _weights(self, step):
        x = step / TIME
        return np.exp(-x), (-np.expm1(-x) / x if x else 1.0)

    def relaxed(self, u, step):
        a, A = self._weights(step)
        return a * self.history + A * (u - self.committed)

    def force(self, u, out, step):
        u = self.whole(u)
        stretch = np.diff(u + RATIO * self.relaxed(u, step), axis=0)
        pull = stretch + self.cubic * stretch**3
        out[:] = (np.vstack((pull, [[0.0]])) - np.vstack(([[0.0]], pull)))[self.mine]

    def linear(self, u, du, out, step):
        u = self.whole(u)
        stretch = np.diff(u + RATIO * self.relaxed(u, step), axis=0)
        factor = (1.0 + RATIO * self._weights(step)[1]) * (1.0 + 3.0 * self.cubic * stretch**2)
        pull = factor * np.diff(self.whole(du), axis=0)
        out[:] = (np.vstack(([[0.0]], pull)) - np.vstack((pull, [[0.0]])))[self.mine]

    def commit(self, u, step):
        u = self.whole(u)
        self.history, self.committed = self.relaxed(u, step), u


def settings(**changes):
    values = {"solver": "conjugate-gradients", "tolerance": 1e-8, "extrapolation": 1, "most_iterations": 100_000}
    return SimpleNamespace(**(values | changes))


def solver_of(chain, chosen):
    """The time solver on a chain without prescribed motion."""
    points = Particles(np.zeros(len(chain.identifier), np.int64))
    conditions = SimpleNamespace(times=(), planes=())
    body = SimpleNamespace(
        comm=chain.comm, operator=chain, conditions=conditions, particles=points, preconditioners=None
    )
    body.raise_if_stopped, body.unsettled = lambda every: None, False
    return QuasiStatic(body, chosen)


def run(chain, chosen, steps, pull):
    """Displacements of all points after each of the steps (lengths [s]) under a pull [N] at the last point, by step
    number.
    """
    solver, time, found = solver_of(chain, chosen), 0.0, []
    u = np.zeros(chain.free.shape)
    for number, step in enumerate(steps):
        external = np.zeros(u.shape)
        external[chain.identifier == _POINTS - 1] = pull(number, time + step)
        balance = solver.equilibrium.find(solver.extrapolated(u, time, step), external, step)
        assert solver.equilibrium.reached(balance) and not solver.equilibrium.fault
        u, time = balance.displacement, time + step
        chain.commit(u, step)
        solver.remember(u, time, step)
        found.append(chain.whole(u)[:, 0])
    return solver, np.array(found)


@pytest.mark.serial
@pytest.mark.parametrize("solver", ("conjugate-gradients", "dynamic-relaxation"))
def test_creep_and_recovery_with_jumps_are_exact_but_for_the_steps_in_between(comm, solver):
    steps = [0.0, *[0.1] * 20, 0.0, *[0.1] * 10]
    compliance = PronySeries(1.0, [RATIO], [TIME]).compliance()
    _, found = run(Chain(comm), settings(solver=solver), steps, lambda number, time: 2.0 * (number <= 20))
    times = np.cumsum(steps)
    wanted = np.array(
        [2.0 * (compliance(t) - (compliance(t - times[21]) if i > 20 else 0.0)) for i, t in enumerate(times)]
    )
    profile = found / (np.arange(_POINTS) + (np.arange(_POINTS) == 0))
    assert np.abs(profile[:, 1:] - wanted[:, None]).max() < 5e-5 * wanted.max()
    # jumps themselves are exact: elastic with the instantaneous modulus
    assert found[0, -1] == pytest.approx(2.0 * 11 / 10.0, rel=1e-7)
    assert found[21, -1] - found[20, -1] == pytest.approx(-2.0 * 11 / 10.0, rel=1e-6)


@pytest.mark.serial
def test_error_of_the_recursion_is_that_of_another_program(comm):
    """Largest relative error of the creep strain over 50 s, with a jump step at the start (computed elsewhere)."""
    compliance = PronySeries(1.0, [RATIO], [TIME]).compliance()
    for step, wanted in ((1.0, 0.004457146666413281), (0.1, 4.561462342689282e-05)):
        steps = [0.0, *[step] * round(50 / step)]
        _, found = run(Chain(comm), settings(tolerance=1e-11), steps, lambda number, time: 1.0)
        exact = np.array([compliance(t) for t in np.cumsum(steps)])
        errors = np.abs(found[:, 1] / exact - 1.0)
        assert errors.max() == pytest.approx(wanted, rel=1e-3)


def test_extrapolation_saves_iterations(comm):
    steps, pull = [0.0, *[0.05] * 10], lambda number, time: 1.0 + 0.3 * np.sin(time)
    chosen = [settings(solver="dynamic-relaxation", tolerance=1e-6, extrapolation=k) for k in (0, 1, 2)]
    counts = [run(Chain(comm), settings, steps, pull)[0].equilibrium.iterations for settings in chosen]
    assert counts[0] > 1.2 * counts[1] and counts[1] > counts[2]


@pytest.mark.serial
@pytest.mark.parametrize("solver", ("conjugate-gradients", "dynamic-relaxation"))
def test_stiffening_springs(comm, solver):
    chain = Chain(comm, cubic=0.5)
    _, found = run(chain, settings(solver=solver), [0.0, 0.1], lambda number, time: 40.0 * (number == 0))
    # s + s^3/2 = 40 of the relaxing elongation, which is 10 times the elongation of the jump
    roots = np.roots([0.5, 0.0, 1.0, -40.0])
    s = roots[np.abs(roots.imag) < 1e-9].real[0]
    assert np.allclose(np.diff(found[0]), s / 10.0, rtol=1e-6)
    # without load the relaxing elongation is 0; the tolerance, 4e-7 N, over the least stiffness of the chain, 1/53 N/m
    assert np.abs(chain.history[:, 0] * RATIO + found[1]).max() < 2.1e-5


def test_prescribed_displacements_are_scaled_with_their_reactions(comm):
    chain = Chain(comm)
    chain.free = chain.free & (chain.identifier != _POINTS - 1)[:, None]
    solver = Equilibrium(comm, chain, settings())
    start = np.where(chain.identifier == _POINTS - 1, 0.11, 0.0)[:, None]
    balance = solver.find(start, np.zeros(start.shape), 0.0)
    assert np.allclose(chain.whole(balance.displacement)[:, 0], 0.01 * np.arange(_POINTS), atol=1e-8)
    # the pull at both ends, instantaneously ten times 0.01
    assert solver.largest_load == pytest.approx(np.sqrt(2.0) * 0.1, rel=1e-6)


def test_a_step_without_balance_says_why(comm):
    chain = Chain(comm)
    external = np.ones(chain.free.shape)
    for solver in ("conjugate-gradients", "dynamic-relaxation"):
        stuck = Equilibrium(comm, chain, settings(solver=solver, most_iterations=3))
        balance = stuck.find(np.zeros(external.shape), external, 0.0)
        assert not stuck.reached(balance) and stuck.fault


def test_lagrange_weights():
    times = [3.0, 2.5, 1.0]
    for power in range(3):
        weights = lagrange_weights(times, 4.2)
        assert np.dot(weights, np.array(times) ** power) == pytest.approx(4.2**power)


def test_an_equilibrium_that_was_not_reached_is_told():
    """The energy balance itself cannot: the residual of conjugate gradients is orthogonal to what they found."""
    supports = [{"kind": "roller", "plane": "X = 0"}, {"kind": "roller", "plane": "Y = 0"}]
    load = {"kind": "traction", "plane": "X = 1", "traction": ["0.01", "0.01*Y"]}
    pulled = []
    for tolerance in (0.5, 1e-10):
        solution = {"kind": "quasi-static", "step": 0.5, "tolerance": tolerance, "extrapolation": 0}
        sim = simulation(
            tables(
                (10, 10),
                material=ELASTIC,
                method={"kind": "peridynamics", "solution": solution},
                boundaries=[*supports, load],
                body={"placement": "cells"},
            )
        )
        sim.energy_row()
        for step in (0.0, 0.5):
            sim.take_step(step)
        row = sim.energy_row()
        verdict, field = sim.energy_check.verdict(sim.energy_scale), sim.systems[0].displacement.copy()
        pulled.append((field, row["residual_work"] / row["external_work"], verdict))
    error = np.abs(pulled[0][0] - pulled[1][0]).max() / np.abs(pulled[1][0]).max()
    assert error > 0.02
    assert pulled[0][1] > 0.02 and pulled[0][2]["energy_check"] == "unbalanced"
    assert pulled[1][1] < 1e-9 and pulled[1][2]["energy_check"] == "ok"


@pytest.mark.parametrize("held", [False, True], ids=["rollers", "held"])
def test_iterations_do_not_grow_with_the_particles(comm, held):
    """A bent plate of irregular particles; what is found does not depend on the preconditioner."""
    supports = [{"kind": "roller", "plane": "X = 0"}, {"kind": "roller", "plane": "Y = 0"}]
    if held:
        supports = [{"kind": "displacement", "plane": "X = 0", "displacement": ["0", "0"]}]
    load = {"kind": "traction", "plane": "X = 1", "traction": ["0.01*Y", "0.003"]}
    iterations, work = {}, {}
    for case in ((16, "none"), (16, "grids"), (48, "none"), (48, "grids")):
        solution = {"kind": "quasi-static", "step": 1.0}
        sim = simulation(
            tables(
                (case[0], case[0]),
                material=ELASTIC,
                method={"kind": "peridynamics", "solution": solution},
                boundaries=[*supports, load],
                body={"placement": "cells", "jitter": 0.2},
            ),
            comm,
        )
        if case[1] == "none":
            sim.systems[0].solver.equilibrium.preconditioners = None
        sim.take_step(0.0)
        iterations[case] = sim.systems[0].solver.equilibrium.iterations
        work[case] = sim.energy_row()["external_work"]
    assert work[16, "grids"] == pytest.approx(work[16, "none"], rel=1e-6)
    assert work[48, "grids"] == pytest.approx(work[48, "none"], rel=1e-6)
    assert iterations[48, "none"] > 2 * iterations[16, "none"]
    assert iterations[48, "grids"] < 1.2 * iterations[16, "grids"]
    assert iterations[48, "grids"] < 30


@pytest.mark.parametrize(
    "body", [{"placement": "cells", "jitter": 0.2}, {"placement": "vertices"}], ids=["cells", "vertices"]
)
def test_volumes_that_hardly_change_take_no_more_iterations(comm, body):
    """Poisson's ratio 0.4999, where grids alone take hundreds."""
    load = {"kind": "traction", "plane": "X = 1", "traction": ["0.01*Y", "0.003"]}
    found = {}
    for kind in ("none", "pressures"):
        sim = simulation(
            tables(
                (18, 14),
                material=ELASTIC | {"poissons_ratio": 0.4999},
                method={"kind": "peridynamics", "solution": {"kind": "quasi-static", "step": 1.0}},
                boundaries=[{"kind": "roller", "plane": "X = 0"}, {"kind": "fixed", "plane": "Y = 0"}, load],
                body=body,
            ),
            comm,
        )
        if kind == "none":
            sim.systems[0].solver.equilibrium.preconditioners = None
        sim.take_step(0.0)
        found[kind] = sim.systems[0].solver.equilibrium.iterations, sim.energy_row()["external_work"]
    assert found["pressures"][1] == pytest.approx(found["none"][1], rel=1e-6)
    assert found["none"][0] > 500 and found["pressures"][0] < 30


PAIR = [{"kind": "traction", "plane": f"X = {x}", "traction": [f"{0.01 * (2 * x - 1)}", "0"]} for x in (0, 1)]
HELD = {
    "nothing": ([], 3),
    "a roller": ([{"kind": "roller", "plane": "X = 0"}], 1),
    "a corner": ([{"kind": "roller", "plane": f"{axis} = 0"} for axis in "XY"], 0),
    "a wall": ([{"kind": "fixed", "plane": "X = 0"}], 0),
    "a point": ([{"kind": "displacement", "point": [0.0, 0.0], "displacement": ["0", "0"]}], 1),
}


@pytest.mark.parametrize("supports, loose", HELD.values(), ids=HELD)
def test_what_nothing_holds_is_left_out_without_evaluating_forces(comm, supports, loose):
    """Rigid motions of a body whose supports leave some; besides one force an iteration there is next to none."""
    sim = simulation(
        tables(
            (24, 24),
            material=ELASTIC,
            method={"kind": "peridynamics", "solution": {"kind": "quasi-static", "step": 1.0}},
            boundaries=[*supports, *(PAIR if loose == 3 or "point" in str(supports) else PAIR[1:])],
            body={"placement": "cells"},
        ),
        comm,
    )
    one = sim.systems[0]
    before = one.forces.evaluations
    sim.take_step(0.0)
    equilibrium = one.solver.equilibrium
    assert len(equilibrium.preconditioners.loose) == loose
    assert one.forces.evaluations - before - 1 <= equilibrium.iterations + 2
    assert equilibrium.iterations < 40


@pytest.mark.ranks(1, 2)
def test_a_stop_within_a_solution_changes_no_result(comm):
    """A bar that tears: stopped before a balance and between bonds that break, the run goes on to the same bits."""
    data = tables(
        (10, 4),
        material={"kind": "linear-elastic", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3},
        method={
            "kind": "peridynamics",
            "damage": {"critical_stretch": 0.004},
            "solution": {"kind": "quasi-static", "step": 0.1},
        },
        boundaries=[
            {"plane": "X = 0", "kind": "fixed"},
            {"plane": "X = 1", "kind": "displacement", "displacement": ["0.04*t", "free"]},
        ],
        body={"placement": "cells"},
    ) | {"end_time": 0.2}
    whole, unsettled = simulation(data, comm), []
    whole.run()
    for looks in (2, 9):
        sim = simulation(data, comm)
        assert sim.run(stop=StopAfter(looks)) == INTERRUPTED
        unsettled.append(sim.systems[0].unsettled)
        assert sim.run() == FINISHED
        assert sim.energy_row() == whole.energy_row()
    assert unsettled[-1] and not unsettled[0]
