"""A sequence of equilibria along the load, in place of motion: `integrator = "static"`; the time is the load parameter.

    T(u) + L(t) = 0 on free components,   u prescribed elsewhere

F is 1 + grad u by the scheme's own operator, so that no history of steps adds rounding. From an equilibrium a load step
goes along the tangent, K du = dL with what is prescribed, and Newton's method (`solvers.newton`) ends it. The rates
u' of the tangents at both ends give the work of the step to fourth order,

    W = (f0 + f1)/2 . du + [(f1 - f0) . (u1' - u0') - du . (f1' - f0')]/12

in which f are loads, and reactions where components are prescribed, and f' = K u', so that what the solution for u'
leaves counts only by the change of K along the step. It is compared with what the stored energy has gained: a step
along which the body jumps, or that is too long for its path, does not close, and is taken again with half the load. A
limit point closes with no step.

Bodies that flow or relax have a state (`load_history`), their F follows from that of the last equilibrium, and what is
left of the work is dissipated. As what they store is found from both ends of a step, so is the work, without the last
term; where bodies flow this term says how much is missing.

Vectors of unknowns are displacements (owned, d), with a further column where `pressures` are unknowns, which no load
acts on; the energy is then stationary, not least, and Newton's method goes by what is not balanced.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.reduction import sums
from parsolid.boundary.conditions import EXTERNAL_FORCE
from parsolid.boundary.forces import DistributedLoad, SpringLoad
from parsolid.boundary.reactions import report_equilibrium
from parsolid.collective import Stopped, maximum, minimum
from parsolid.methods.tlsph.closing import close_gaps
from parsolid.methods.tlsph.load_history import LoadHistory
from parsolid.methods.tlsph.plastic import RIEMANN_HEAT
from parsolid.methods.tlsph.static_preconditioner import StaticPreconditioner
from parsolid.methods.tlsph.tangent import Tangent
from parsolid.particles.declaration import Columns, Field
from parsolid.scene.codes import Note
from parsolid.scene.method_settings import STAGE_CHANGE
from parsolid.solvers.conjugate_gradients import Solution, conjugate_gradients
from parsolid.solvers.gmres import gmres
from parsolid.solvers.minres import minres
from parsolid.solvers.newton import State, Unsolvable, newton_to_share
from parsolid.solvers.petsc import Krylov

# of a change of loads, the residual to which the tangent of a path is solved
_TANGENT = 1e-4
# of that, with pressures as unknowns: errors of minimal residuals do work along the step, those of conjugate gradients
# do not
_SADDLE = 0.1
# of the work of a load step, what the stored energy may lack: at most, and what the next length aims at, also where
# particles begin to slip within steps
_MISSING, _AIM, _ROUGH_AIM = 2e-3, 1e-4, 5e-4
# the next load step is longer or shorter by so many powers of 2 at most
_POWERS = 2.0
# of a load step, where the tangent at its start is taken from bodies that flow: as they begin to, it changes at once
_AHEAD = 0.1
# of the scene's end, the first load step; of one that was asked for, the shortest that is tried
FIRST, _LEAST = 0.1, 2.0**-10
# attempts at most that do not get on by the shortest part of a load step; with as many of the longest solutions
_TRIES = 30
# of a load step, how near its start or end a contact that closes within it does not end it
_TOUCHING = 1e-3
# of a load step, what is left of it by rounding of its parts
_ROUNDED = 1e-9
# of a residual, what a solution without the change of loads leaves
_ROUGH = 0.1
# products with the tangent in one solution at most, and solutions of an attempt that may take them all in vain
_PRODUCTS, _UNSOLVED = 3000, 2
# products between two looks for a stop request
_LOOK = 10
_STATE = (
    "load_step",
    "loaded",
    "largest_load",
    "most_stored",
    "power_rate",
    "load_steps",
    "retries",
    "corrections",
    "products",
    "most_products",
    "norm",
    "target",
    "closed_gap",
)


class Stretch(NamedTuple):
    """From one part of a load step to another; time, step [s]: where the load step begins, and its length."""

    time: float
    step: float
    part: float
    end: float

    @property
    def ahead(self) -> float:
        """How long it takes [s]."""
        return (self.end - self.part) * self.step

    @property
    def over(self) -> float:
        """Its length, also where it takes no time."""
        return self.ahead if self.step > 0.0 else self.end - self.part


class Equilibrium(NamedTuple):
    """unknowns [m]; held [N]: loads on free components, loads and reactions on others; stored energy [J] of all
    ranks; power [W]: of tools, on this rank."""

    unknowns: np.ndarray
    held: np.ndarray
    stored: float
    power: float = 0.0


class Taken(NamedTuple):
    """A load step that was taken: the equilibrium at its end; work [J] of what is held, that of tools on this rank,
    that of all ranks, what of it the stored energy has not gained, and what this rank's branches have dissipated [J];
    slope, curvature [m]: of the path at the end, over the load step; power_rate: growth of the power of the loads with
    the forces, over the length of the step, squared."""

    end: Equilibrium
    work: np.ndarray
    of_tools: float
    total: float
    missing: float
    lost: float
    slope: np.ndarray
    curvature: np.ndarray
    power_rate: float


class Tangential(NamedTuple):
    """Along the tangent of a path, over a load step: unknowns [m], and the changes of what is held [N] and of the power
    of tools [W], on this rank."""

    change: np.ndarray
    force: np.ndarray
    power: float


class Failed(NamedTuple):
    """Why a load step does not count; critical: whether it may be for a limit point; part: of the step, what is tried
    next."""

    fault: str
    critical: bool = False
    part: float = 0.5


class Static:
    """Takes one rank's particles from equilibrium to equilibrium; all methods are collective.

    Also the `solvers.newton.Problem` of a load. reached: the time [s] of the last equilibrium, where the last step
    ended before its end, else None; fault: why it did; load_step [s]: the next one; norm, target [N]: what is not
    balanced in the last state, and what may be.
    """

    def __init__(self, system: Any, equilibria: bool, tied: list[tuple[int, int]], touched: set[int]) -> None:
        """system: `system.TotalLagrangianSPH` with its sweeps; equilibria: whether any stage has them, else these are
        for `implicit.Implicit`; tied: numbers of bodies that ties join; touched: those in contact. Raises SolverError
        on all ranks where nothing holds a body. Collective."""
        self.system, self.comm, self.conditions = system, system.comm, system.conditions
        self.pressures, self.tangent = system.pressures, Tangent(system, True, system.pressures)
        self.free = self.tangent.free
        if self.pressures is not None:
            self.free = np.column_stack((self.free, self.pressures.free))
        kept: dict[str, Any] = {"checkpointed": True, "mirror": "vector", "layout": Columns()}
        system.particles.declare(Field("displacement", system.dimension, "m", **kept))
        system.particles.declare(Field("displacement_rate", self.free.shape[1], "m/s", **kept))
        system.particles.declare(Field("displacement_curvature", self.free.shape[1], "m/s^2", **kept))
        # forces of the stabiliser of boxes, which are not among those of the sweeps
        self._stabilising = np.zeros(self.tangent.free.shape)
        # of contact and ties, on these parts of the particles; what they store, friction loses [J], and the power [W]
        self._meeting, self._met = np.zeros(self.tangent.free.shape), (0.0, 0.0, 0.0)
        # of trials: when the state was kept [s], and how long ago that is [s]
        self._kept_at, self._over = 0.0, 0.0
        self.preconditioner = StaticPreconditioner(self.tangent)
        if equilibria:
            self.preconditioner.refuse_loose_bodies(tied, touched)
        loads = [load for load, _ in self.conditions.loads_of]
        # whether all loads have a potential, which is their product with the displacement
        self.dead = all(isinstance(load, DistributedLoad) for load in loads)
        self.history = LoadHistory.of(system)
        # bodies that springs alone hold have a singular stiffness without them
        self.sprung = any(isinstance(load, SpringLoad) for load in loads)
        # see `set_span`
        self.settings, self.began, self.end, self.load_step = system.settings, 0.0, 0.0, 0.0
        self.reached: float | None = None
        self.fault, self.loaded, self.largest_load, self.norm, self.target = "", False, 0.0, 0.0, 0.0
        # whether the next attempt places tools as the last one did not, see `_attempt`
        self.other_way = False
        # whether a stop request is heeded within a solution: parts of a jump of the loads are no states of the scene
        self.heeds_stops = True
        # linear solutions of an attempt that took all products
        self.unsolved = 0
        # load, or reaction [N], of the state evaluated last
        self._load = 0.0
        # longest rigid motion [m] that has brought a body into contact
        self.closed_gap = 0.0
        # of all load steps: what a tool leaves behind that moves away is as good as nothing beside it
        self.most_stored = 0.0
        # of the last load step, see `Taken`; not known after a jump
        self.power_rate = np.nan
        self.load_steps = self.retries = self.corrections = self.products = self.most_products = 0
        # of the equilibrium that is sought: time [s], length [s] and part of the load step
        self.sought = (0.0, 0.0, 0.0)
        self._residual = np.zeros(self.free.shape)

    def set_span(self, began: float, start: float, end: float, settings: Any) -> None:
        """Equilibria of a stage from a start [s] to an end [s] with settings of its own; began: when they took over
        from a motion, or from the initial state [s]."""
        self.began, self.end, self.settings = began, end, settings
        self.load_step = min(FIRST * (end - start), settings.maximum_step or np.inf)

    # --- the problem of a load -----------------------------------------------------------------------------------

    def evaluate(self, displacement: np.ndarray) -> State:
        """See `Problem`: under the loads of the equilibrium that is sought; displacement: all unknowns."""
        self.look_for_stop()
        # nothing resists particles of one node that rounding has moved apart
        displacement = displacement.copy()
        self.tangent.share_moves(displacement[:, : self.system.dimension])
        sound = self._deform(displacement)
        external = self._loads(*self.sought)
        residual = np.where(self.free, self.internal_force() + external, 0.0)
        stored, work = self._stored(), float(np.vdot(external, displacement))
        square: float = float(np.vdot(residual, residual))
        square, stored, work, size, lost = sums(self.comm, [square, stored, work, abs(stored) + abs(work), 1.0 - sound])
        least = self.conservative and self.history is None and self.pressures is None
        energy = float(stored - work) if least else np.nan
        whole = bool(lost == 0.0 and np.isfinite(square) and np.isfinite(stored))
        self.norm, self._residual = float(np.sqrt(square)), residual
        saddle = self.pressures is not None
        return State(displacement, residual, self.norm, energy, 1e-13 * float(size), whole, saddle)

    def look_for_stop(self, in_product: bool = False) -> None:
        """Raise `Stopped` on all ranks where the run is to stop, but not through PETSc."""
        if self.heeds_stops and not (in_product and self.preconditioner.elements):
            self.system.raise_if_stopped(_LOOK if in_product else 1)

    def _deform(self, unknowns: np.ndarray, still: bool = False) -> bool:
        """Places, deformation and internal forces of some unknowns; whether this rank's Jacobians are positive. still:
        they are those of the last equilibrium, whose flow stress belongs to the rate with which it was reached."""
        system, of = self.system, self.system.particles.owned_rows
        displacement = unknowns[:, : system.dimension]
        if self.pressures is not None:
            self.pressures.set(unknowns[:, -1])
        of("displacement")[:] = displacement
        np.add(of("reference_position"), displacement, out=of("position"))
        if self.history is None:
            # a step of length 1 from the undeformed body with the displacement as velocity gives F = 1 + grad u
            of("velocity")[:] = displacement
            of("deformation_gradient")[:] = np.eye(system.dimension).ravel()
            sound = [bodies.advance_step(1.0)[0] for bodies in system.sweeps]
        else:
            self.history.recall()
            of("displacement")[:] = displacement
            of("velocity")[:] = self.history.rate(displacement)
            times = (0.0, 0.0) if still else (self.history.step, self.history.relaxing)
            found = [bodies.advance_step(*times) for bodies in system.sweeps]
            sound, self.history.lost = [one[0] for one in found], sum(one[1] for one in found)
        for bodies in system.sweeps:
            bodies.find_forces()
        self._rest("velocity", "dissipative_force", RIEMANN_HEAT)
        if self.pressures is not None:
            self.pressures.settle()
        self.stabilise()
        self._meet(still)
        return all(sound)

    def _meet(self, still: bool) -> None:
        """Find the forces of contact and ties in the present places."""
        particles, interactions = self.system.particles, self.system.interactions
        if EXTERNAL_FORCE not in particles:
            return
        force = particles.owned_rows(EXTERNAL_FORCE)
        force[:] = 0.0
        for one in interactions:
            one.try_forces(self._kept_at, self._over, still)
        self._meeting = force.copy()
        stored = sum(one.energies()[1] for one in interactions)
        self._met = (stored, sum(one.lost() for one in interactions), sum(one.power() for one in interactions))

    @property
    def _rubs(self) -> bool:
        return any(one.rubs for one in self.system.interactions)

    @property
    def conservative(self) -> bool:
        """Whether all forces have a potential, so that the tangent is symmetric."""
        return self.dead and not self._rubs

    def _rest(self, *names: str) -> None:
        """Set fields that there are to 0."""
        for name in names:
            if name in self.system.particles:
                self.system.particles.owned_rows(name)[:] = 0.0

    def stabilise(self) -> None:
        """Find the forces and energy of what resists rough displacements of boxes, in the present one."""
        if self.tangent.stabiliser is not None:
            self._stabilising[:] = 0.0
            displacement = self.system.particles.owned_rows("displacement")
            self.tangent.stabiliser.add_product(displacement, self._stabilising)

    def stabilise_motion(self) -> None:
        """Let boxes that move resist rough displacements as they do in equilibrium, where they come from one or will
        go to one: the forces of `system.sweeps` have their part of it."""
        if self.tangent.stabiliser is not None:
            self.follow_motion()
            self.stabilise()
            self.system.particles.owned_rows("stress_force")[:] -= self._stabilising / self.system.share[:, None]

    def follow_motion(self) -> None:
        """Take the displacement of bodies that move."""
        of = self.system.particles.owned_rows
        np.subtract(of("position"), of("reference_position"), out=of("displacement"))

    def internal_force(self) -> np.ndarray:
        """Internal forces [N] of the unknowns evaluated last, on this side of mirror planes; collective."""
        force = self.system.particles.owned_rows("stress_force") * self.system.share[:, None]
        force += self._meeting - self._stabilising
        if self.pressures is None:
            return force
        present = self.pressures.unknowns(), self.system.particles.owned_rows("jacobian")
        return np.column_stack((force, self.pressures.residual(*present)))

    def stabiliser_energy(self) -> float:
        """Energy [J] of what resists rough displacements of this rank's boxes, in the state evaluated last."""
        return 0.5 * float(np.vdot(self.system.particles.owned_rows("displacement"), self._stabilising))

    def _loads(self, time: float, step: float, part: float) -> np.ndarray:
        """Loads [N] on the unknowns at a part of a load step [s] from a time [s], in the present shape; of a jump,
        where the step is 0, from those before it to those after it."""
        if step == 0.0:
            before = self._held_at_start if time == self.began else self._loads_on_unknowns(time, True)
            return (1.0 - part) * before + part * self._loads_on_unknowns(time, False)
        return self._loads_on_unknowns(time + part * step, part > 0.0)

    def _loads_on_unknowns(self, time: float, before_jump: bool) -> np.ndarray:
        result = np.zeros(self.free.shape)
        result[:, : self.system.dimension] = self.loads_at(time, before_jump)
        return result

    def loads_at(self, time: float, before_jump: bool) -> np.ndarray:
        """Loads (owned, d) [N] at a time [s] in the present shape; before_jump: where they jump, those before it."""
        found = self.conditions.find_loads(time, before_jump)
        if found is None:
            return np.zeros(self.tangent.free.shape)
        loads = found.copy()
        self.tangent.share(loads)
        return np.ascontiguousarray(loads.T)

    def linearise(self) -> None:
        """See `Problem`."""
        self.tangent.linearise(self.history)
        self.preconditioner.follow_tools()

    def precondition(self, residual: np.ndarray) -> np.ndarray:
        """See `Problem`."""
        if self.pressures is None:
            return np.asarray(self.preconditioner(residual))
        of_pressures = self.pressures.precondition(residual[:, -1])
        return np.column_stack((self.preconditioner(residual[:, :-1]), of_pressures))

    def solve(self, load: np.ndarray, target: float) -> Solution:
        """See `Problem`; the preconditioner is made anew at the present shape once it takes much more products."""
        size = float(np.sqrt(sums(self.comm, [np.vdot(load * self.free, load)])[0]))
        solver = self.krylov_method(self.conservative)
        precondition = self.precondition if self.dead or self.sprung else self._solve_roughly
        solution = solver(self.comm, self._product, load, target, self.free, _PRODUCTS, precondition)
        self.products += solution.iterations
        self.most_products = max(self.most_products, solution.iterations)
        self.unsolved += solution.iterations >= _PRODUCTS
        if self.unsolved > _UNSOLVED:
            raise Unsolvable(f"no solution of the linear equations after {_PRODUCTS} products")
        decades = max(np.log10(max(size, 1e-300) / max(solution.residual, 1e-300)), 0.5)
        self.preconditioner.note(solution.iterations, decades)
        return solution

    def krylov_method(self, symmetric: bool) -> Any:
        """That of symmetric tangents, or of others."""
        elements, definite = self.preconditioner.elements, self.pressures is None
        if elements is not None:
            # flexible, as preconditioners may be solutions of their own
            return Krylov(elements.PETSc, ("cg" if definite else "minres") if symmetric else "fgmres")
        if not symmetric:
            return gmres
        return conjugate_gradients if definite else minres

    def _solve_roughly(self, residual: np.ndarray) -> np.ndarray:
        """About K^-1 r [m] without the change of loads, the preconditioner where that is not found; without
        this, restarts lose nearly incompressible bodies."""
        target = _ROUGH * float(np.sqrt(sums(self.comm, [np.vdot(residual, residual)])[0]))

        def product(change: np.ndarray, out: np.ndarray) -> None:
            self.look_for_stop(True)
            out[:] = self.stiffness(change)

        settings = target, self.free, _PRODUCTS, self.precondition
        found = self.krylov_method(True)(self.comm, product, residual, *settings)
        self.products += found.iterations
        return found.value if found.converged else self.precondition(residual)

    def stiffness(self, change: np.ndarray) -> np.ndarray:
        """K times a change [m] of the unknowns [N]."""
        if self.pressures is None:
            return self.tangent.product(change)
        return self.pressures.product(self.tangent, change)

    def _product(self, change: np.ndarray, out: np.ndarray) -> None:
        """(K - dL/du) times a change [m] of the unknowns into out [N]."""
        self.look_for_stop(True)
        out[:] = self.stiffness(change)
        if not self.dead:
            out[:, : self.system.dimension] -= self.change_of_loads(change[:, : self.system.dimension])

    def change_of_loads(self, change: np.ndarray) -> np.ndarray:
        """dL/du du (owned, d) [N] of loads that follow the shape: differences, which are exact for springs and for a
        pressure, whose loads are polynomials of second order in du."""
        of, system = self.system.particles.owned_rows, self.system
        x, F = of("position").copy(), of("deformation_gradient").copy()
        one, ends = np.eye(system.dimension).ravel(), []
        for sign in (1.0, -1.0):
            of("position")[:] = x + sign * change
            of("deformation_gradient")[:] = one + system.displacement_gradient().reshape(F.shape)
            ends.append(self._loads(*self.sought))
        of("position")[:], of("deformation_gradient")[:] = x, F
        if system.meshes is not None:
            # rows of the sweeps have places, too, which the energy needs
            system.meshes.begin()
        return np.asarray(0.5 * (ends[0] - ends[1])[:, : system.dimension])

    # --- load steps ----------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """Take the displacement of the start, of which no path is known, and no velocity."""
        self._rest("velocity", "dissipative_force", RIEMANN_HEAT, "displacement_rate", "displacement_curvature")
        self.follow_motion()
        self.stabilise()

    def stable_step(self) -> float:
        """The next load step [s]."""
        return self.load_step

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """Nothing: an equilibrium is one with the positions at the end of its step."""

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """Equilibria up to the end of a load step [s] from a time [s]; where there are no more, or the run is to stop,
        `reached` says how far, and `fault` why there are none."""
        first = self._begin(time)
        if step == 0.0:
            self.power_rate = np.nan
        at, work, part = self._follow(time, step, first, ledger)
        if step == 0.0:
            self.power_rate = np.nan
        self._report(time, step if part == 1.0 else part * step, first, at, work)
        external = float(work.sum())
        if step == 0.0 and time == self.began > 0.0:
            # a motion's last state is held by nothing but its loads
            fall = self._loads(time, 0.0, 1.0) * (at.unknowns - first.unknowns) - work
            lost = float(fall[self.free].sum())
            external += lost
            ledger.add_term(STAGE_CHANGE, lost)
        ledger.add(1.0, 0.0, 0.0, external)
        announce(True, self.load_step)
        self.conditions.report(step, ledger)
        return True

    def _follow(
        self, time: float, step: float, first: Equilibrium, ledger: Any
    ) -> tuple[Equilibrium, np.ndarray, float]:
        """From the equilibrium at the start of a load step [s] in parts, as long as attempts allow: the last one, the
        work (unknowns) [J] up to there, and the part of the load step."""
        at, work, part, length = first, np.zeros(self.free.shape), 0.0, 1.0
        self.system.stopped, self.fault, self.reached, shortened = False, "", None, False
        mark, tries, products = 0.0, 0, self.products
        while part < 1.0:
            if part - mark >= _LEAST:
                mark, tries, products = part, 0, self.products
            else:
                tries += 1
            ahead = Stretch(time, step, part, part + length if part + length < 1.0 - _ROUNDED else 1.0)
            closed = self._close_gaps(ahead, at)
            if closed is None:
                self._end_at(time + part * step, Failed("a load pushes what nothing holds"))
                break
            at = closed
            self.heeds_stops = step > 0.0 or part == 0.0
            try:
                tried = self._attempt(ahead, at)
            except Stopped:
                self._return_to(at.unknowns)
                self.system.stopped, self.reached = True, time + part * step
                break
            if isinstance(tried, Taken):
                at, work, part = self._take(ahead, tried, ledger), work + tried.work, ahead.end
                # what was too long just now may be so again
                length = (ahead.end - ahead.part) * min(self._growth(tried), 1.0 if shortened else np.inf)
                shortened = False
                if step > 0.0:
                    self.load_step = min(length * step, self.settings.maximum_step or self.end)
                continue
            self._retreat(at, tried)
            shortened, length = bool(tried.fault), tried.part * (ahead.end - part)
            in_vain = tries > _TRIES or self.products - products > _TRIES * _PRODUCTS
            # a jump of the loads takes no time, however short its parts are
            short = 0.0 < length * step < (self.settings.minimum_step or 0.0) or length < _LEAST
            if in_vain or (short and tried.fault):
                self._end_at(time + part * step, tried if tried.fault else Failed("contacts close again and again"))
                break
        return at, work, part

    def _take(self, ahead: Stretch, taken: Taken, ledger: Any) -> Equilibrium:
        """Book a step that counts; the equilibrium at its end."""
        at = taken.end
        self.load_steps, self.other_way, self.power_rate = self.load_steps + 1, False, taken.power_rate
        self.most_stored = max(self.most_stored, abs(at.stored))
        ledger.add(1.0, taken.lost, 0.0, taken.of_tools)
        self._remember(ledger, ahead.time + ahead.end * ahead.step)
        self._keep_path(taken, ahead.ahead)
        # friction has warmed bodies that rub
        return at._replace(stored=self._stored_energy()) if self._rubs else at

    def _retreat(self, at: Equilibrium, tried: Failed) -> None:
        """Return to the last equilibrium from an attempt that does not count."""
        self.retries += 1
        self.other_way = bool(tried.fault) and not self.other_way
        self._return_to(at.unknowns)
        self.preconditioner.build()

    def _begin(self, time: float) -> Equilibrium:
        """The equilibrium that a step begins with."""
        u = self.system.particles.owned_rows("displacement").copy()
        if self.pressures is not None:
            u = np.column_stack((u, self.pressures.unknowns()))
        if self.history is not None:
            self.history.remember()
        self._keep(time, None)
        self._return_to(u)
        self.preconditioner.begin()
        force = self.internal_force()
        self._held_at_start = -force if time == self.began else np.zeros(force.shape)
        return Equilibrium(u, -force, self._stored_energy(), self._met[2])

    def _close_gaps(self, ahead: Stretch, at: Equilibrium) -> Equilibrium | None:
        """An equilibrium with bodies that contact alone holds brought into contact, where the load ahead presses them;
        None where nothing comes to bear it. See `closing`."""
        loose, spacing, d = self.preconditioner.loose, self.preconditioner.spacing, self.system.dimension
        if not loose.groups or not (self._clearances() > 0.0).any():
            return at
        position = self.system.particles.owned_rows("position")
        time, step, part, end = ahead
        load = (self._loads(time, step, end) - self._loads(time, step, part))[:, :d]
        start = position.copy()

        def meet(change: np.ndarray) -> tuple[float, np.ndarray]:
            np.add(start, change, out=position)
            # springs of friction keep their stretch along this motion, which does no work
            self._meet(still=True)
            for one in self.system.interactions:
                one.linearise()
            return self._met[0], self._meeting

        def product(change: np.ndarray) -> np.ndarray:
            return sum((one.change_along(change, 0.0)[0] for one in self.system.interactions), np.zeros(change.shape))

        stiffness = maximum(self.comm, float(self.preconditioner.diagonal.max(initial=0.0)))
        known = load, self.preconditioner.rounding, stiffness, spacing
        moved = close_gaps(self.comm, loose, start, *known, meet, product)
        unknowns = at.unknowns.copy()
        way = 0.0 if moved is None else maximum(self.comm, float(np.abs(moved).max(initial=0.0)))
        if moved is not None and way > 0.0:
            self.closed_gap = max(self.closed_gap, way)
            unknowns[:, :d] += moved
            meet(moved)
            if self.history is not None:
                self.history.recall()
            self.system.particles.owned_rows("displacement")[:] = unknowns[:, :d]
            if self.history is not None:
                self.history.remember()
            self._keep(self._kept_at, None)
            # tools take the points where particles stick to them
            self._meet(still=False)
            self._keep(self._kept_at, None)
        self._return_to(unknowns)
        return None if moved is None else at._replace(unknowns=unknowns, stored=self._stored_energy())

    def _keep(self, time: float, ledger: Any) -> None:
        """Let contact and ties take their last trial, or the present state, as that from which trials go."""
        for one in self.system.interactions:
            one.keep(ledger)
        self._kept_at, self._over = time, 0.0

    def _return_to(self, unknowns: np.ndarray) -> None:
        """Find the forces of the last equilibrium."""
        self._over = 0.0
        if self.history is not None:
            self.history.elapsed = 0.0
        self._deform(unknowns, still=True)
        if self.history is not None:
            # which rounding would change
            self.history.recall()

    def _remember(self, ledger: Any, time: float) -> None:
        """Take the present state as that of an equilibrium at a time [s], with what has led to it."""
        # tangents have moved what contact knows of the state
        self._meet(still=False)
        self._keep(time, ledger)
        self._meet(still=True)
        if self.history is not None:
            for block in self.system.blocks:
                block.book(ledger)
            self.history.remember()

    def _attempt(self, stretch: Stretch, start: Equilibrium) -> Taken | Failed:
        """From the equilibrium at the start of a stretch of a load step to that at its end."""
        time, step, part, end = stretch
        before, ahead, of = self._loads(time, step, part), stretch.ahead, self.system.particles.owned_rows
        self.unsolved = 0
        for one in self.system.interactions:
            one.ahead = ahead
        self._meet(still=True)
        start = start._replace(power=self._met[2])
        gaps = self._clearances()
        self.sought = (time, step, end)
        load = self._loads(*self.sought) - before
        moved, guess = self._moved(stretch, start.unknowns), of("displacement_rate") * ahead

        unbalanced = load + self._pushed(ahead)
        if self.history is not None:
            self.history.elapsed = ahead
            started = self._start_to_flow(start, moved, guess, gaps, ahead)
            if isinstance(started, Failed):
                return started
            unbalanced, guess, gaps = started
        first = self._tangent_of_path(unbalanced, moved, guess, ahead)
        self._let_close(True)
        if isinstance(first, Failed):
            return first

        curved = np.where(self.free, 0.5 * ahead**2 * of("displacement_curvature"), 0.0)
        self._over = ahead
        state = self.evaluate(start.unknowns + first.change + curved)
        touched = self._first_touch(gaps)
        if touched < 1.0:
            return Failed("", part=touched)
        found = newton_to_share(self, state, self._find_target)
        self.corrections += found.corrections
        if found.fault:
            return Failed(found.fault)

        lost, rubbed = 0.0 if self.history is None else self.history.lost, self._met[1]
        held = np.where(self.free & self.dead, self._loads(*self.sought), -self.internal_force())
        end_of_step = Equilibrium(found.state.displacement, held, self._stored_energy(), self._met[2])
        if not self._smooth:
            taken = self._taken_with_losses(start, end_of_step, (lost, rubbed), ahead, stretch.over)
        else:
            self._let_close(False)
            last = self._tangent_of_path(load + self._pushed(ahead), moved, first.change, ahead)
            self._let_close(True)
            if isinstance(last, Failed):
                return last
            taken = self._taken(start, end_of_step, first, last, ahead)
        if taken.missing > _MISSING * self._scale(taken) + self._rounding:
            jumps = "the body jumps, as its energy does not follow the work of the load"
            return Failed(jumps, True, 0.5 if self._smooth else self._growth(taken))
        self.largest_load = max(self.largest_load, self._load)
        return taken

    def _start_to_flow(
        self, start: Equilibrium, moved: np.ndarray, guess: np.ndarray, gaps: np.ndarray, ahead: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | Failed:
        """Deform bodies that flow or relax to where the tangent of their path is taken.

        Returns forces [N] that are not balanced at the start, also as bodies relax while nothing moves, the guess of
        the change [m], and the gaps [m] that the end of the stretch may close. Failed where one closes on the way.

        Tools that approach stand at the end of the step, where they touch. Those that withdraw stand at its start, with
        a force linear in their motion: at the end they would touch nothing. Where a step fails, the next attempt tries
        the other way.
        """
        pushed, d = self._pushed(ahead), self.system.dimension
        more, along = sums(self.comm, [np.vdot(self._meeting, change[:, :d]) for change in (pushed, guess)])
        withdraw = bool(self.system.interactions) and bool(more < 0.0) != self.other_way
        self._over = 0.0 if withdraw else ahead
        if withdraw and along > 0.0:
            # they turn back: the body unloads, with the elastic tangent of the start
            guess = np.zeros_like(guess)
        if not withdraw and (gaps > 0.0).any():
            # tools that stand at the end of the step push away what they touch, so look for that before
            self.evaluate(start.unknowns + np.where(self.free, guess, moved))
            touched, gaps = self._first_touch(gaps), np.zeros(0)
            if touched < 1.0:
                return Failed("", part=touched)
        unbalanced = self.evaluate(start.unknowns).residual + (pushed if withdraw else 0.0)
        self._deform(start.unknowns + _AHEAD * np.where(self.free, guess, moved))
        # what they just touch at the end has not pressed before
        self._let_close(withdraw)
        return unbalanced, guess, gaps

    @property
    def _smooth(self) -> bool:
        """Whether nothing flows, relaxes or rubs, so that tangents at both ends of a step give its work."""
        return self.history is None and not self._rubs

    def _stored_energy(self) -> float:
        """Of all ranks [J]."""
        return float(sums(self.comm, [self._stored()])[0])

    def _stored(self) -> float:
        """Of this rank [J], with that of contact and ties, in the state evaluated last."""
        return float(self.system.energies()[1]) + self._met[0]

    def _pushed(self, ahead: float) -> np.ndarray:
        """By how much the forces of contact (owned, d) [N] change as tools move on for a time [s]."""
        still, result = np.zeros(self.tangent.free.shape), np.zeros(self.free.shape)
        for one in self.system.interactions if ahead > 0.0 else ():
            result[:, : self.system.dimension] += one.change_along(still, ahead)[0]
        return result

    def _let_close(self, closes: bool) -> None:
        """See `Interaction.closes`."""
        for one in self.system.interactions:
            one.closes = closes

    def _clearances(self) -> np.ndarray:
        """Of all contacts, over all ranks [m]."""
        gaps = [one.clearances() for one in self.system.interactions]
        return minimum(self.comm, np.concatenate(gaps)) if gaps else np.zeros(0)

    def _first_touch(self, before: np.ndarray) -> float:
        """The part of a load step at the end of which a contact that was open before, by gaps [m], closes; 1 where none
        does. What bears a load within a step alone, the work of its end does not know."""
        if not len(before):
            return 1.0
        now = self._clearances()
        closes = (before > 0.0) & (now < 0.0)
        parts = before[closes] / (before[closes] - now[closes])
        return min(parts[(parts > _TOUCHING) & (parts < 1.0 - _TOUCHING)].tolist(), default=1.0)

    def _taken(self, start: Equilibrium, end: Equilibrium, first: Tangential, last: Tangential, ahead: float) -> Taken:
        """A step of a time ahead [s] of elastic bodies between two equilibria with the tangents at its ends; see the
        head of this file."""
        du = end.unknowns - start.unknowns
        curved = (end.held - start.held) * (last.change - first.change) - du * (last.force - first.force)
        work = 0.5 * (start.held + end.held) * du + curved / 12.0
        of_tools = 0.5 * ahead * (start.power + end.power) + ahead * (first.power - last.power) / 12.0
        total = float(sums(self.comm, [work.sum() + of_tools])[0])
        # of the cubic polynomial through both ends
        curvature = 2.0 * first.change + 4.0 * last.change - 6.0 * du
        missing = abs(total - (end.stored - start.stored))
        return Taken(end, work, of_tools, total, missing, 0.0, last.change, curvature, 0.0)

    def _taken_with_losses(
        self, start: Equilibrium, end: Equilibrium, losses: tuple[float, float], ahead: float, over: float
    ) -> Taken:
        """A step of a time ahead [s] in which bodies flow, relax or rub; losses [J]: what this rank's branches and
        friction have lost; over: the length of the step, also where it takes no time."""
        lost, rubbed = losses
        du = end.unknowns - start.unknowns
        work, of_tools = 0.5 * (start.held + end.held) * du, 0.5 * ahead * (start.power + end.power)
        powers = [np.vdot(one.held, du) + ahead * one.power for one in (start, end)]
        before, after, total, all_lost = map(float, sums(self.comm, [*powers, work.sum() + of_tools, lost + rubbed]))
        missing, rate = abs(total - all_lost - (end.stored - start.stored)), (after - before) / over**2
        if self.history is not None and not self.history.relaxes and np.isfinite(self.power_rate):
            # What flow takes balances the work of any step, so the change of the power's rate says how long it may be.
            # Forces that have just begun do not count: they grow from nothing in any step.
            begun = min(abs(before) / max(abs(after), 1e-300), 1.0)
            missing = max(missing, begun * over**2 * abs(rate - self.power_rate) / 12.0)
        return Taken(end, work, of_tools, total, missing, lost, du, np.zeros_like(du), rate)

    def _moved(self, stretch: Stretch, u: np.ndarray) -> np.ndarray:
        """By how much [m] prescribed components move along a stretch of a load step from u [m]."""
        time, step, part, end = stretch
        motion, result = self.conditions.motion, u.copy()
        if motion.there:
            motion.displace(time + part * step, (end - part) * step, result.T[: self.system.dimension])
        result -= u
        return result * ((end - part) / (1.0 - part)) if step == 0.0 else result

    def _tangent_of_path(
        self, load: np.ndarray, moved: np.ndarray, guess: np.ndarray, ahead: float
    ) -> Tangential | Failed:
        """The tangent for a change of the loads (owned, d) [N], of what is prescribed (owned, d) [m], and of tools over
        a time [s], whose forces are among the loads; guess (owned, d) [m]: of the change."""
        self.linearise()
        lifted, change = np.where(self.free, 0.0, moved), np.where(self.free, guess, moved)
        products = np.empty((2, *change.shape))
        for one, product in zip((lifted, change), products):
            self._product(one, product)
        wanted, left = np.where(self.free, load - products, 0.0)
        size = float(np.sqrt(sums(self.comm, [np.vdot(wanted, wanted)])[0]))
        part = _TANGENT if self.pressures is None else _SADDLE * _TANGENT
        try:
            solution = self.solve(left, max(part * size, self.preconditioner.rounding))
        except Unsolvable as why:
            return Failed(f"along the load, {why}")
        if not solution.converged:
            return Failed(f"along the load, {solution.reason}", solution.iterations < _PRODUCTS)
        change += solution.value
        own = np.ascontiguousarray(change[:, : self.system.dimension])
        power = sum(one.change_along(own, ahead)[1] for one in self.system.interactions)
        return Tangential(change, self.stiffness(change) - self._pushed(ahead), power)

    def _scale(self, taken: Taken) -> float:
        """Energy [J] beside which what is missing counts."""
        rough = sum(one.roughness for one in self.system.interactions)
        return max(abs(taken.total), 0.01 * max(abs(taken.end.stored), self.most_stored), rough)

    @property
    def _rounding(self) -> float:
        return 1e-11 * float(self.system.energy_scale)

    def _growth(self, taken: Taken) -> float:
        """The next load step over one that was taken."""
        missing = taken.missing - self._rounding
        if missing <= 0.0:
            return 2.0**_POWERS
        # a power of 2, so that rounding on other ranks changes no step
        order, aim = (0.25 if self._smooth else 0.5), (_ROUGH_AIM if self._rubs else _AIM)
        power = np.floor(order * np.log2(max(aim * self._scale(taken) / missing, 1e-9)))
        return float(2.0 ** np.clip(power, -_POWERS, _POWERS))

    def _find_target(self) -> float:
        """Force [N] that need not be balanced: the tolerance times the largest load so far, or the largest reaction
        where nothing is loaded, that of the state evaluated last included; at least the rounding of forces."""
        external, force = self._loads(*self.sought), self.internal_force()
        force = np.where(self.tangent.free, self._meeting, force[:, : self.system.dimension])
        load, reaction = np.sqrt(sums(self.comm, [np.vdot(external, external), np.vdot(force, force)]))
        self.loaded = self.loaded or bool(load > 0.0)
        if not self.loaded:
            load = reaction
        self._load = float(load)
        largest = max(self.largest_load, self._load)
        self.target = max(self.settings.tolerance * largest, self.preconditioner.rounding)
        return self.target

    def _keep_path(self, taken: Taken, step: float) -> None:
        """Keep slope and curvature of the path at the end of a load step [s], with which the next one begins; after a
        jump there are none."""
        of = self.system.particles.owned_rows
        of("displacement_rate")[:] = taken.slope / step if step > 0.0 else 0.0
        of("displacement_curvature")[:] = taken.curvature / step**2 if step > 0.0 else 0.0

    def _end_at(self, time: float, tried: Failed) -> None:
        """No equilibrium has been found beyond a time [s]."""
        self.reached = time
        limit = "a limit point of the load: beyond it there is no stable equilibrium near the last one"
        self.fault = f"{limit} ({tried.fault})" if tried.critical else tried.fault
        if (self._clearances() > 0.0).any():
            held = "; ".join(self.preconditioner.loose.names)
            held = f", and contact alone is to hold {held}: close the gap by a displacement" if held else ""
            self.fault += f"; a tool, or a body in contact, touches nothing{held}"

    def _report(self, time: float, step: float, first: Equilibrium, last: Equilibrium, work: np.ndarray) -> None:
        """Forces and works of conditions in a step [s] from a time [s]."""
        loads, change = self._loads(time, step, 1.0), last.unknowns - first.unknowns
        both = self._loads(time, step, 0.0) + loads
        places, reaction = self.system.particles.owned_rows("position").T, -self.internal_force() - loads
        of_motion = slice(0, self.system.dimension)
        change, reaction, held = (one[:, of_motion] for one in (change, reaction, work - 0.5 * both * change))
        report_equilibrium(self.conditions, places, change, reaction, held, time, step)

    # --- what is asked of it -----------------------------------------------------------------------------------

    def first_invalid(self) -> tuple[int, str] | None:
        """This rank's particle farthest from balance, where the last step found none; and why."""
        if not self.fault or not len(self._residual):
            return None
        index = int(np.argmax(np.linalg.norm(self._residual, axis=1)))
        left = float(np.linalg.norm(self._residual[index]))
        return index, f"{self.fault}; of what was not balanced this particle has most, {left:.3g} of {self.norm:.3g} N"

    def state(self) -> dict[str, Any]:
        """What a restart needs besides the fields."""
        return {name: getattr(self, name) for name in _STATE}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        for name in _STATE:
            # earlier versions kept fewer
            setattr(self, name, state.get(name, getattr(self, name)))

    def summary(self) -> dict[str, Any]:
        """Entries of summary.json."""
        return {
            "load_steps": self.load_steps,
            "load_steps_retried": self.retries,
            "newton_iterations": self.corrections,
            "linear_iterations": self.products,
            "most_linear_iterations": self.most_products,
            "closed_gap_metres": self.closed_gap,
            "residual_newtons": self.norm,
            "residual_target_newtons": self.target,
        }

    def cost_notes(self) -> list[Note]:
        """What a load step takes; collective."""
        unknowns = int(sums(self.comm, [float(self.free.sum())])[0])
        cost = (
            f"equilibria of {unknowns} unknowns: 10 to 40 products with the tangent a linear solution, from 1e3 to 1e5 "
            "unknowns, and 3 to 6 solutions a load step"
        )
        return [Note("load-step-cost", cost)]

    def progress(self) -> list[str]:
        """What lines of progress say of the last equilibrium."""
        return [f"Newton {self.corrections}", f"linear {self.products}", f"residual {self.norm:.2e} N"]
