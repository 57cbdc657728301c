"""Whether energy is kept: the error of the ledger against the largest energy of a run, and what a run's end says.

The check has one word for every method, see `EnergyCheck.verdict`.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from parsolid.methods.failure_fields import DELETED_KINETIC
from parsolid.methods.protocol import ParticleSystem
from parsolid.observables.declared import Observables
from parsolid.observables.quantities import AngularMomentum
from parsolid.scene import Scene
from parsolid.scene.codes import Warned
from parsolid.scene.method_settings import KINETIC_OFFSET
from parsolid.scene.observation import stored_energy

# of the largest energy, by how much leapfrog's kinetic energy may differ from the one that is conserved
_OFFSET = 0.05
# of the methods' energy scale, what rounding leaves; of the largest energy, what is worth a word
_ROUND_OFF, _TOLD = 1e-12, 1e-5
# what a load does in one step is as large as what the step leaves out of the balance: energies are taken to grow for
# so many steps as in the one in which they have grown most, which a limit of 5 % makes 1.6 steps, and which is
# forgotten in as many
_STEPS_TO_COME = 32


# of the sum of their particles' parts, what of momenta may be lost where nothing acts from outside
_MOMENTUM = 0.01

# words of the check, the last counts most; and the codes of what speaks against a run
WORDS = ("ok", "dissipative", "inapplicable", "unbalanced")
ENERGY_UNACCOUNTED, ENERGY_GIVEN, LONG_STEP = "energy-unaccounted", "energy-given", "long-step"
MOMENTUM_LOST, ANGULAR_MOMENTUM_LOST = "momentum-lost", "angular-momentum-lost"
BEYOND_THE_METHOD = "beyond-the-method"
NUMERICAL_DISSIPATION, ARTIFICIAL_VISCOSITY = "numerical-dissipation", "artificial-viscosity"
NOT_SLOW = "scaled-inertia"
# of the internal energy, the kinetic energy up to which a motion with `method.mass_scaling` counts as slow
_SLOW = 0.05


# of `EnergyCheck`, what a restart goes on with
_STATE = ("largest", "worst", "growth", "entered", "gained", "taken", "giver", "offset", "kinetic", "internal")


class Finding(NamedTuple):
    """What speaks against a run: the word that the check then has, a code, the reason in words."""

    word: str
    code: str
    reason: str


class EnergyLimits(NamedTuple):
    """Shares of the largest energy, or of the energy that went in; see `scene.method_settings.MethodSettings`."""

    balance_warning: float
    balance_limit: float
    dissipation_warning: float

    @classmethod
    def of(cls, settings: Iterable[Any]) -> "EnergyLimits":
        """The tightest of several methods' settings."""
        return cls(*(min(values) for values in zip(*([getattr(one, key) for key in cls._fields] for one in settings))))


class EnergyCheck:
    """Checks rows of the ledger.

    A body that a tool touches for the first time, a support that starts or a load that rises has little energy as yet,
    of which a step leaves out much. So a balance is measured by what the load is about to bring as well: the most by
    which energies have grown in one step, for some more steps. In a loaded state that is little beside the energy.
    What is not accounted for has not been brought by anything, and a jump of the loads is no step.

    limits: what the scene allows; largest: the largest kinetic or stored energy or external work so far [J]; worst: the
    largest |energy error| so far [J]; offset: the largest change of leapfrog's kinetic offset [J]; entered: the most
    energy that has gone in so far, what there was at the start and the external work [J]; lost, viscous: the numerical
    dissipation and what artificial viscosity took [J] by the last row; growth: the most that went in within a step of
    late [J]; kinetic, internal: the largest kinetic energy, and stored energy with what laws dissipated, so far [J];
    scaled: whether inertia is that of more mass; violation: the first energy error [J] beyond the limit, None while
    there was none; gained: the most that came from nowhere [J]: by which the numerical dissipation was below zero, or
    another one below its largest value so far, `taken` [J] by its name; giver: the name of that dissipation.
    """

    def __init__(self, limits: EnergyLimits, viscous_terms: Sequence[str] = (), scaled: bool = False) -> None:
        """viscous_terms: entries of a row that the artificial viscosity fills."""
        self.limits, self.viscous_terms, self.scaled = limits, viscous_terms, scaled
        self.kinetic = self.internal = 0.0
        self.largest = self.worst = self.entered = self.lost = self.viscous = self.growth = self.gained = 0.0
        self.offset = 0.0
        self.taken, self.giver = dict[str, float](), "numerical_dissipation"
        self.violation: float | None = None

    def check(
        self,
        row: Mapping[str, float],
        scale: float,
        initial: float = 0.0,
        steps: int | None = 1,
        work: float = 0.0,
        given: float = 0.0,
    ) -> None:
        """Take a row in; scale: the energy [J] of which the balance has the round-off in any case; initial: the energy
        at time 0 [J]; steps: since the row before, None if the last was a jump of no length; work: that from outside in
        the last of them [J]; given: what fracture gave in all steps so far [J]."""
        before = self.largest
        self.largest = max(self.largest, *(abs(row[name]) for name in ("kinetic", stored_energy(row), "external_work")))
        self.kinetic = max(self.kinetic, row["kinetic"])
        self.internal = max(self.internal, row[stored_energy(row)] + row.get("material_dissipation", 0.0))
        if steps is not None:
            # what was there at the start has not gone in, nor what comes from nowhere
            brought = self.largest - max(before, abs(initial)) - abs(row["energy_error"])
            forgotten = self.growth * float(np.exp(-steps / _STEPS_TO_COME))
            self.growth = max(forgotten, abs(work), brought / max(steps, 1))
        # an equilibrium that was not reached may close the balance all the same: conjugate gradients always do
        self.worst = max(abs(row["energy_error"]), row.get("residual_work", 0.0), self.worst)
        self.lost, self.viscous = row["numerical_dissipation"], sum(row[name] for name in self.viscous_terms)
        # where numerical dissipation is what closes the balance, that is all there is to see of what comes from nowhere
        if -self.lost > self.gained:
            self.gained, self.giver = -self.lost, "numerical_dissipation"
        # what breaks, rubs or flows only takes: a term that falls hides a gain, which the balance does not show
        if not self.taken:
            self.taken = {name: energy for name, energy in row.items() if name.endswith("_dissipation")}
            del self.taken["numerical_dissipation"]
        for name, most in self.taken.items():
            energy = row[name]
            if energy > most:
                self.taken[name] = energy
            elif most - energy > self.gained:
                self.gained, self.giver = most - energy, name
        if given > self.gained:
            self.gained, self.giver = given, "fracture_dissipation"
        self.offset = max(self.offset, *(abs(row[name]) for name in row if name.startswith(KINETIC_OFFSET)), 0.0)
        self.entered = max(self.entered, initial + row["external_work"])
        measure = self.largest + _STEPS_TO_COME * self.growth
        allowed = self.limits.balance_limit * measure + _ROUND_OFF * scale + np.finfo(float).tiny
        if not (abs(row["energy_error"]) <= allowed < np.inf):
            self.violation = row["energy_error"]

    def state(self) -> dict[str, Any]:
        """What a restart goes on with, as JSON has it."""
        return {name: getattr(self, name) for name in _STATE}

    def set_state(self, state: Mapping[str, Any], lost: float) -> None:
        """Take back what `state` gave; lost: the numerical dissipation in the ledger [J]."""
        for name in _STATE:
            # a checkpoint of an earlier version may have none
            setattr(self, name, state.get(name, getattr(self, name)))
        self.lost = lost

    def relative(self, balance: float, scale: float) -> float | None:
        """A balance [J] over the largest energy, over the scale where that is round-off of it.

        None where there is neither.
        """
        over = self.largest if self.largest > _ROUND_OFF * scale else scale
        return balance / over if over > 0.0 else None

    @property
    def kinetic_share(self) -> float:
        """The largest kinetic over the largest internal energy of the run."""
        return self.kinetic / self.internal if self.internal > 0.0 else float(np.sign(self.kinetic))

    def verdict(
        self,
        scale: float,
        doubts: Sequence[str] = (),
        momenta: tuple[float, float] = (0.0, 0.0),
        warnings: Sequence[Warned] = (),
    ) -> dict[str, Any]:
        """Entries of summary.json: the largest |energy error| over the largest energy, numerical dissipation [J], its
        share of the energy that went in, that of the artificial viscosity, and the word of the check with its code and
        reason; doubts: why methods do not apply; momenta: shares of linear and angular momentum lost; warnings: of the
        scene, see `representation`.

        "ok" says that energy and momentum are accounted for and that little of the energy went into the scheme
        and its artificial viscosity: an answer needs that, but is not right by that alone.
        """
        balance, gained, offset = (self.relative(one, scale) or 0.0 for one in (self.worst, self.gained, self.offset))
        share, viscous = (
            energy / self.entered if self.entered > _ROUND_OFF * scale else 0.0 for energy in (self.lost, self.viscous)
        )
        findings = self._findings(balance, gained, offset, share, viscous, doubts, momenta)
        findings += [Finding("inapplicable", one.code, one.text) for one in warnings if one.inapplicable]
        if not findings:
            reason = f"error {_percent(balance)}, numerical dissipation {_percent(share)} of the energy"
            reason += f", spurious gain {_percent(gained)}" if gained > _TOLD else ""
            reason += f", artificial viscosity {_percent(viscous)}" if viscous else ""
        verdict = max(findings, key=lambda one: WORDS.index(one.word)) if findings else Finding("ok", "", reason)
        return {
            "energy_error_share_largest": balance,
            "spurious_energy_gain": gained,
            "kinetic_offset_largest": offset,
            "numerical_dissipation": self.lost,
            "numerical_dissipation_share": share,
            **({"artificial_viscosity_share": viscous} if self.viscous_terms else {}),
            "momentum_lost_share": momenta[0],
            "angular_momentum_lost_share": momenta[1],
            "energy_check": verdict.word,
            "energy_check_code": verdict.code or None,
            "energy_check_reason": verdict.reason,
            "energy_check_findings": [one._asdict() for one in findings],
        }

    def _findings(
        self,
        balance: float,
        gained: float,
        offset: float,
        share: float,
        viscous: float,
        doubts: Sequence[str],
        momenta: tuple[float, float],
    ) -> list[Finding]:
        """Everything that speaks against a run, the first of a word counting most."""
        limits, found = self.limits, []
        allowed = f"(method.balance_warning = {limits.balance_warning:g})"
        if not balance <= limits.balance_warning or self.violation is not None:
            reason = f"{balance:.2g} of the largest energy is not accounted for {allowed}"
            found.append(Finding("unbalanced", ENERGY_UNACCOUNTED, reason))
        if gained > limits.balance_warning:
            reason = (
                f"the scheme gave {gained:.2g} of the largest energy, {self.gained:.3g} J by {self.giver} {allowed}"
            )
            found.append(Finding("unbalanced", ENERGY_GIVEN, reason))
        if offset > _OFFSET:
            reason = f"within a step kinetic energy swings by {offset:.2g} of the largest energy"
            found.append(Finding("unbalanced", LONG_STEP, f"the time step is too long: {reason}"))
        for lost, code in zip(momenta, (MOMENTUM_LOST, ANGULAR_MOMENTUM_LOST)):
            if not lost <= _MOMENTUM:
                reason = f"nothing acts from outside, and the {code.removesuffix('-lost').replace('-', ' ')} changes by"
                found.append(Finding("unbalanced", code, f"{reason} {lost:.2g} of what moves"))
        if self.scaled and self.kinetic_share > _SLOW:
            reason = f"kinetic energy reaches {_percent(self.kinetic_share)} of the internal one (method.mass_scaling)"
            found.append(Finding("inapplicable", NOT_SLOW, f"the motion is not slow: {reason}"))
        found += [Finding("inapplicable", BEYOND_THE_METHOD, doubt) for doubt in doubts]
        if max(abs(share), abs(share + viscous)) > limits.dissipation_warning:
            own = abs(share) > limits.dissipation_warning
            reason = f"the scheme, not the material, took {share:.2g} of the energy that went in"
            if viscous:
                reason += f", its artificial viscosity {viscous:.2g}"
            reason += f" (method.dissipation_warning = {limits.dissipation_warning:g})"
            code = NUMERICAL_DISSIPATION if own else ARTIFICIAL_VISCOSITY
            found.append(Finding("dissipative", code, reason))
        return found


def _percent(share: float) -> str:
    """A share in per cent, with two digits."""
    return f"{100.0 * share:.2g} %"


# kinds of boundaries that exert no force
_FORCELESS = ("temperature", "heat-flux", "micro-hard")
# of sum m |x| |v|, up to which the motion about the centre of mass may be rounding
_ANGULAR_ROUND_OFF = 1e-9


def isolated(scene: Scene) -> bool:
    """Whether only the bodies of a scene act on one another: no supports, loads or tools, and no mass that goes."""
    loads = scene.loads
    loaded = loads.acceleration is not None or loads.body_force is not None or bool(loads.manufactured)
    held = any(one.kind not in _FORCELESS for one in scene.boundaries)
    deletes = any(DELETED_KINETIC in getattr(body.material, "ledger_terms", {}) for body in scene.bodies)
    about_an_axis = any(getattr(one.settings, "geometry", None) == "axisymmetric" for one in scene.systems)
    return not (loaded or held or scene.tools or deletes or about_an_axis)


class MomentumBalance:
    """What of the momenta is lost, over the largest sums of their particles' parts.

    first, largest: linear momentum and angular momentum about the origin at the start, and the largest
    sum m |v| [kg m/s] and sum m |x - x_c| |v - v_c| [kg m^2/s] about the centre of mass so far, 0 where that is
    rounding; lost: the largest changes of the momenta so far. None until `check`.
    """

    def __init__(self, comm: Any, systems: Sequence[ParticleSystem]) -> None:
        self.comm, self.observables = comm, Observables(systems)
        self.first: np.ndarray | None = None
        self.largest, self.lost = np.zeros(2), np.zeros(2)

    def check(self) -> None:
        """Take the present state in; collective."""
        momenta, sizes, centre = self._present()
        d = self.observables.dimension
        if self.first is None:
            self.first = momenta
        change = momenta - self.first
        # what a change of linear momentum does to the angular momentum about the origin is counted once
        change[d:] -= _cross(centre, change[:d])
        self.largest = np.maximum(self.largest, sizes)
        self.lost = np.maximum(self.lost, [np.linalg.norm(change[:d]), np.linalg.norm(change[d:])])

    def _present(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Momenta, sizes (2,) of their parts, centre of mass [m]; of all ranks."""
        watched = self.observables
        d, mass = watched.dimension, watched.tributary_mass
        x, v = watched.rows("position"), watched.rows("velocity")
        angular = AngularMomentum("", [""] * (3 if d == 3 else 1)).part(watched)
        mine = np.concatenate(([mass.sum()], mass @ x, mass @ v, angular))
        total = np.empty_like(mine)
        self.comm.Allreduce(mine, total)
        centre, mean = (total[k : k + d] / (total[0] or 1.0) for k in (1, 1 + d))
        arm, speed = np.linalg.norm(x - centre, axis=1), np.linalg.norm(v - mean, axis=1)
        whole = np.linalg.norm(v, axis=1)
        own = np.array([mass @ whole, mass @ (arm * speed), mass @ (np.linalg.norm(x, axis=1) * whole)])
        sizes = np.empty_like(own)
        self.comm.Allreduce(own, sizes)
        linear, angular, about_origin = sizes
        moves = angular > _ANGULAR_ROUND_OFF * about_origin
        return total[1 + d :], np.array([linear, angular if moves else 0.0]), centre

    def shares(self) -> tuple[float, float]:
        """Linear and angular momentum that were lost, over the largest sums of parts; 0 where nothing has moved."""
        linear, angular = (float(lost / size) if size > 0.0 else 0.0 for lost, size in zip(self.lost, self.largest))
        return linear, angular

    def state(self) -> dict[str, Any]:
        """What a restart goes on with, as JSON has it."""
        first = None if self.first is None else self.first.tolist()
        return {"first": first, "largest": self.largest.tolist(), "lost": self.lost.tolist()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        self.first = None if state["first"] is None else np.array(state["first"])
        self.largest, self.lost = np.array(state["largest"]), np.array(state["lost"])


def _cross(arm: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """(1,) in the plane, (3,) in space, zero along a line."""
    if len(arm) == 3:
        return np.cross(arm, vector)
    return np.array([arm[0] * vector[1] - arm[1] * vector[0] if len(arm) == 2 else 0.0])
