"""Rigid tools as contact partners of all systems: one interaction for all tools of a scene."""

from pathlib import Path
from typing import Any

import numpy as np

from decomposition.reduction import sums as over_ranks
from parsolid.collective import SolverError, maximum, minimum, raise_together
from parsolid.contact.tools.bodies import make_body, shaped
from parsolid.contact.tools.forces import RESULTANT
from parsolid.contact.tools.rigid_body import FreeBody, GuidedBody, Pose, rotation_vector
from parsolid.contact.tools.touch import STIFFNESS, Touch, axisymmetric, touchable_by
from parsolid.contact.trials import ROUGH, Trial, TriedContact
from parsolid.methods.failure_fields import DELETED_INTERNAL
from parsolid.methods.leapfrog import taken_by_step_change
from parsolid.methods.protocol import EnergyLedger, ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.contact import CONTACT_TERMS, TOOL_TERMS
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.method_settings import KINETIC_OFFSET
from parsolid.scene.previous_results import tools_at

# in spacings, by how much a body may overlap a tool at the start
_OVERLAP = 0.5
# largest w dt, w the frequency of a particle on the spring of the contact: the energy that a bounce adds grows
# with its square, and remains where the method does not damp waves
_STEP, _STEP_UNDAMPED = 1.0, 0.5
# largest w dt of a free tool on the springs of all particles that it may touch in the next step
_STEP_OF_TOOL = 0.2


class Tool:
    """One tool, the same on all ranks.

    own, total (1,): resultants, see `forces.RESULTANT`, of this rank, and of all ranks for a free tool; quiet_until
    [s]: time before which no rank touches a free tool; longest [s]: longer than any stable step of the particles it may
    touch; around: force over force per radian, 2 pi in axisymmetric scenes, else 1; resumed: whether the state is from
    a checkpoint or another run; last_step [s]: the step before the present one, 0 at the start.
    """

    def __init__(self, stated: Any, dimension: int, polar: bool):
        """stated: `scene.tools.Tool`. Raises SolverError for a mesh that is no closed surface."""
        form = shaped(stated, dimension)
        self.name, self.stated, self.shape, self.width = stated.name, stated, form.shape, form.width
        self.far = form.far
        self.friction, self.stiffness = stated.friction, stated.stiffness
        self.around = 2.0 * np.pi if polar else 1.0
        self.body: FreeBody | GuidedBody = make_body(stated, form, dimension, 1.0 / self.around)
        self.touches: list[Touch] = []
        self.own, self.total = np.zeros(1, RESULTANT), np.zeros(1, RESULTANT)
        self.quiet_until = -np.inf
        self.longest, self.resumed, self.last_step = 0.0, False, 0.0

    @property
    def free(self) -> bool:
        """Whether it has mass and moves by forces."""
        return isinstance(self.body, FreeBody)

    def speed(self) -> float:
        """The greatest speed [m/s] of its points that bodies can reach."""
        pose = self.body.pose
        turning = float(np.linalg.norm(pose.spin))
        return float(np.linalg.norm(pose.velocity)) + (turning * self.far if turning else 0.0)

    def resultant(self, opening: bool) -> tuple[np.ndarray, np.ndarray]:
        """Force [N] and moment [N m] on the particles for the opening or the closing half of a step: of all ranks for a
        free tool, else of this one."""
        of = (self.total if self.free else self.own)[0]
        if opening:
            return of["force"], of["moment"]
        return of["force"] + of["closing_force"], of["moment"] + of["closing_moment"]

    def add_up(self) -> None:
        """Set `own` to the sum over all systems."""
        self.own = np.zeros(1, RESULTANT)
        for touch in self.touches:
            self.own.view(float)[:] += touch.resultant.view(float)


class RigidTools(TriedContact):
    """All tools of a scene. Ranks communicate in a step only where free tools may be touched: 18 numbers a tool."""

    terms = CONTACT_TERMS | TOOL_TERMS

    def __init__(self, comm: Any, scene: Scene, systems: list[ParticleSystem]):
        """systems: of the scene, whose particles have the fields of `touch.declare_tool_fields`.

        Raises SolverError on all ranks for a tool that is narrower than a spacing, or whose mesh is not a closed
        surface. Collective.
        """
        self.comm, self.systems, self.dimension = comm, systems, scene.dimension
        self.names = [body.name or f"bodies.{i}" for i, body in enumerate(scene.bodies)]
        self.tools = [Tool(stated, scene.dimension, axisymmetric(scene)) for stated in scene.tools]
        self.rubs = any(tool.friction > 0.0 for tool in self.tools)
        acceleration = scene.loads.acceleration
        self.gravity = None if acceleration is None else LoadHistory(acceleration, scene.loads)
        for system in systems:
            moduli = [system.wave_modulus(body) for body in range(len(system.bodies))]
            signal = max(float(np.sqrt(modulus / density)) for modulus, density in moduli)
            rows = system.particles.owned_rows
            spacing = rows("spacing").max(axis=1)
            for number, tool in enumerate(self.tools):
                touchable = touchable_by(tool.stated, scene, system)
                if not touchable.any():
                    continue
                tool.touches.append(Touch(tool, system, touchable, signal))
                coarsest = maximum(comm, float(spacing[touchable[rows("body")]].max(initial=0.0)))
                tool.longest = max(tool.longest, coarsest / signal)
                if tool.width < coarsest:
                    raise SolverError(
                        f"tools.{number}.shape: expected a tool at least as wide as the spacing of what it touches, "
                        f"{coarsest:g} m, found {tool.name!r}, {tool.width:g} m wide"
                    )
            if STIFFNESS in system.particles:
                energy = float((rows(STIFFNESS) * spacing**2).max(initial=0.0))
                self.energy_scale = max(self.energy_scale, maximum(comm, energy))
        # a particle that is in a tool by the roughness of faces
        self.roughness = 0.5 * ROUGH**2 * self.energy_scale
        self._take_results(scene)
        # poses of the kept state, and the times [s] after it for which tools are posed now, see `TriedContact`
        self._kept_poses, self._posed = list[dict[str, Any]](), (np.inf, 0.0, 0.0)

    # --- what the loop asks -------------------------------------------------------------------------------------

    def begin(self, time: float) -> None:
        """Forces at the start; raises SolverError, on all ranks, where a tool lies in a body. Collective."""
        for tool in self.tools:
            if isinstance(tool.body, GuidedBody):
                tool.body.follow(time)
        self._evaluate(time, 0.0, begins=True)
        if any(tool.resumed for tool in self.tools):
            self.book_stored(None, **self._stored())
        for number, tool in enumerate(self.tools):
            for touch in [] if tool.resumed else tool.touches:
                raise_together(self.comm, self._overlap(number, tool, touch))

    def _take_results(self, scene: Scene) -> None:
        """Give tools the poses of the same names in the results from which particles take their state."""
        for i, state in enumerate(scene.initial):
            found = tools_at(Path(state.results), state.time) if state.takes_state and state.results else {}
            for number, tool in enumerate(self.tools):
                if tool.name not in found:
                    continue
                if found[tool.name].keys() != tool.body.state().keys():
                    had = "without mass, led by formulas" if tool.free else "with mass"
                    raise SolverError(
                        f"tools.{number}.mass: expected {tool.name!r} to move as in initial.{i}.results, found there a "
                        f"tool {had}"
                    )
                tool.body.set_state(found[tool.name])
                tool.resumed = True

    def _overlap(self, number: int, tool: Tool, touch: Touch) -> str | None:
        """The fault of a body that overlaps a tool at the start, or None; collective."""
        particles, depth = touch.system.particles, maximum(self.comm, -float(touch.clearance))
        spacing = float(particles.owned_rows("spacing")[touch.rows].min(initial=np.inf))
        allowed = _OVERLAP * minimum(self.comm, spacing)
        if not depth > allowed * (1.0 + 1e-9) or not len(touch.rows):
            return None
        bodies = np.unique(particles.owned_rows("body")[touch.rows])
        named = " and ".join(repr(self.names[touch.system.bodies[body]]) for body in bodies)
        return (
            f"tools.{number}.shape: expected a tool outside the bodies (by half a spacing, {allowed:g} m, at most), "
            f"found {tool.name!r} within {named} by {depth:g} m"
        )

    def start_step(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """The opening half kick and the drift of the tools."""
        self._kick(time, 0.5 * step, ledger, opening=True)
        for tool in self.tools:
            tool.body.drift(time, step)

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces at the new positions and the closing half kick; collective where free tools may be touched."""
        self._evaluate(time, step)
        self.book(ledger)
        self._kick(time, 0.5 * step, ledger, opening=False)

    def book(self, ledger: EnergyLedger) -> None:
        """See `TriedContact`."""
        ledger.add_term("friction_dissipation", float(sum(tool.own["lost"][0] for tool in self.tools)))
        deleted = sum(touch.deleted for tool in self.tools for touch in tool.touches)
        if deleted > 0.0:
            ledger.add_term(DELETED_INTERNAL, deleted)
        heat = sum(touch.warm() for tool in self.tools for touch in tool.touches)
        if heat:
            ledger.add_term("friction_heat", heat)
        self.book_stored(ledger, **self._stored())

    # --- in steps that are solved for -----------------------------------------------------------------------------

    def keep(self, ledger: EnergyLedger | None) -> None:
        """See `Interaction`."""
        super().keep(ledger)
        self._kept_poses, self._posed = [tool.body.state() for tool in self.tools], (np.inf, 0.0, 0.0)

    def memory(self) -> list[np.ndarray]:
        """See `TriedContact`."""
        return [field for tool in self.tools for touch in tool.touches for field in touch.memory()]

    def evaluate_trial(self, trial: Trial) -> None:
        """See `TriedContact`."""
        self.recall(self.kept_memory)
        over, posed = trial.over, (trial.over, self.ahead, trial.later)
        for tool, kept in zip(self.tools, self._kept_poses):
            if isinstance(tool.body, GuidedBody) and self._posed != posed:
                tool.body.set_state(kept)
                if over > 0.0 or self.ahead > 0.0:
                    # forces do work along the displacement; the velocity may jump within the step
                    tool.body.drift_evenly(trial.time, over, self.ahead)
                else:
                    tool.body.follow(trial.time * (1.0 + 1e-12))
                tool.body.pose.go_on(trial.later)
            for touch in tool.touches:
                touch.try_forces(not trial.still, over, trial.mean, trial.deeper)
            tool.add_up()
        self._posed = posed

    def fastest(self) -> float:
        """See `TriedContact`: of rotating tools, the speed at the farthest particle."""
        place, most = self.systems[0].particles.owned_rows("position"), 0.0
        for pose in (tool.body.pose for tool in self.tools):
            arms = np.linalg.norm(place - pose.place[: self.dimension], axis=1)
            turning = float(np.linalg.norm(pose.spin)) * float(arms.max(initial=0.0))
            most = max(most, float(np.linalg.norm(pose.velocity)) + turning)
        return most

    def power(self) -> float:
        """See `Interaction`."""
        return sum(tool.body.pose.power(*tool.resultant(opening=False)) for tool in self.tools)

    def lost(self) -> float:
        """See `Interaction`."""
        return float(sum(tool.own["lost"][0] for tool in self.tools))

    def clearances(self) -> np.ndarray:
        """See `Interaction`."""
        return np.array([min((touch.clearance for touch in tool.touches), default=np.inf) for tool in self.tools])

    def _evaluate(self, time: float, step: float, begins: bool = False) -> None:
        """Forces of all tools at a time [s], and corrections over a step [s]; begins: whether this is the first
        evaluation, in which tools of a checkpoint or of results keep the records of friction."""
        for tool in self.tools:
            for touch in tool.touches:
                touch.evaluate(time, not (begins and tool.resumed), step)
            tool.add_up()
        free = [tool for tool in self.tools if tool.free and not time < tool.quiet_until]
        if not free:
            return
        totals = self._over_ranks(free)
        for number, tool in enumerate(free):
            tool.total = totals[number : number + 1]
        apart = [tool for tool in free if tool.total["pressed"][0] == 0.0]
        if apart:
            quiet = [min((touch.quiet_until for touch in tool.touches), default=np.inf) for tool in apart]
            for tool, until in zip(apart, minimum(self.comm, np.array(quiet))):
                tool.quiet_until = float(until)

    def _over_ranks(self, tools: list[Tool]) -> np.ndarray:
        """Resultants (tools,) summed over all ranks; collective."""
        own = np.concatenate([tool.own for tool in tools])
        return over_ranks(self.comm, own.view(float)).view(RESULTANT)

    def _kick(self, time: float, half_step: float, ledger: EnergyLedger, opening: bool) -> None:
        """Kick free tools over half a step [s] with the forces at a time [s], and book the energies of all tools."""
        work = lost = 0.0
        for tool in self.tools:
            if isinstance(tool.body, GuidedBody):
                work += half_step * tool.body.pose.power(*tool.resultant(opening))
                continue
            supplied, dissipated, offset = self._kick_free(tool, tool.body, time, half_step, opening)
            # the same on all ranks, booked on one
            if self.comm.rank == 0:
                work, lost = work + supplied, lost + dissipated
                ledger.add_term(KINETIC_OFFSET, offset)
        ledger.add(1.0, 0.0, lost, work)

    def _kick_free(
        self, tool: Tool, body: FreeBody, time: float, half_step: float, opening: bool
    ) -> tuple[float, float, float]:
        """Kick a free tool by leapfrog with a kinetic offset, as particles, see `methods.leapfrog`. Returns the work of
        gravity, the numerical dissipation and the kinetic offset [J]."""
        force, moment = tool.resultant(opening=True)
        velocity, angular, work = body.pose.velocity, body.angular, 0.0
        body.kick(-half_step * force, -half_step * moment)
        if self.gravity is not None:
            before, impulse = body.kinetic, np.zeros(3)
            place = body.pose.place[None, : self.dimension]
            impulse[: self.dimension] = half_step * body.mass * self.gravity.evaluate(place, time)[0]
            body.kick(impulse, np.zeros(3))
            work = body.kinetic - before
        offset = body.energy_of_change(velocity, angular)
        if opening:
            lost = taken_by_step_change(offset, tool.last_step, half_step)
            tool.last_step = half_step
            return work, lost, lost - offset
        # the correction of the impulse works on the motion in the middle of the step; what it changes of the kinetic
        # energy besides is numerical dissipation
        closing_force, closing_moment = tool.resultant(opening=False)
        impulse, twist, lost = -half_step * (closing_force - force), -half_step * (closing_moment - moment), 0.0
        if impulse.any() or twist.any():
            before = body.kinetic
            middle = Pose(body.pose.place, body.pose.rotation, velocity, body.spin_of(angular))
            body.kick(impulse, twist)
            lost = middle.power(body.free * impulse, twist if body.turns else np.zeros(3)) - (body.kinetic - before)
        return work, lost, offset

    def stable_step(self) -> float:
        """Largest step [s] that the springs of contact allow on this rank, for particles and free tools."""
        square = 0.0
        for tool in self.tools:
            of_tool, total = 0.0, tool.total[0]
            if isinstance(tool.body, FreeBody):
                of_tool = tool.body.square_of(total["stiffness"], total["turning"]) / _STEP_OF_TOOL**2
            for touch in tool.touches:
                if touch.greatest_square > 0.0:
                    own = touch.greatest_square / (_STEP_UNDAMPED if touch.system.undamped else _STEP) ** 2
                    square = max(square, own + of_tool)
        return np.inf if square == 0.0 else float(1.0 / np.sqrt(square))

    def _stored(self) -> dict[str, float]:
        """Energies [J] of this rank in penetrations and in springs of friction."""
        names = {"contact_energy": "stored", "stick_energy": "stuck"}
        return {term: float(sum(tool.own[name][0] for tool in self.tools)) for term, name in names.items()}

    def energies(self) -> tuple[float, float]:
        """Kinetic energy of all free tools, on one rank, and energy stored by contact on this rank [J]."""
        kinetic = sum(tool.body.kinetic for tool in self.tools) if self.comm.rank == 0 else 0.0
        return kinetic, sum(self._stored().values())

    def sound(self) -> bool:
        """Whether the places of all tools are finite."""
        return all(bool(np.isfinite(tool.body.pose.place).all()) for tool in self.tools)

    def state(self) -> dict[str, Any]:
        """States of all tools, by name."""
        return {tool.name: tool.body.state() | {"last_step": tool.last_step} for tool in self.tools}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        for tool in self.tools:
            tool.body.set_state(state[tool.name])
            tool.last_step, tool.resumed = state[tool.name]["last_step"], True

    def handed_on(self) -> dict[str, Any]:
        """States of all tools, by name, for another run."""
        return {tool.name: tool.body.state() for tool in self.tools}

    # --- what the history shows ---------------------------------------------------------------------------------

    @property
    def columns(self) -> list[str]:
        """Of every tool: force and moment on it, place and rotation."""
        return [column for tool in self.tools for column in tool.stated.columns(self.dimension)]

    def sample(self) -> list[float]:
        """Values of the columns; collective."""
        d = self.dimension
        turning = {1: slice(0, 0), 2: slice(2, 3), 3: slice(0, 3)}[d]
        result: list[float] = []
        for tool, total in zip(self.tools, self._over_ranks(self.tools)):
            force, moment = -tool.around * total["force"], -tool.around * total["moment"]
            if tool.around != 1.0:
                # around the axis, radial forces and moments cancel
                force[0], moment[:] = 0.0, 0.0
            pose = tool.body.pose
            pieces = (force[:d], moment[turning], pose.place[:d], rotation_vector(pose.rotation)[turning])
            result += [float(value) for piece in pieces for value in piece]
        return result
