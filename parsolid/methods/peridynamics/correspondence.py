"""Forces of correspondence peridynamics: from displacements to gradients, stresses and forces (see `sweeps`).

At a particle G = (sum of the gradient sweep) K^-1 / V, the stress P follows from G and a history, and M = P K^-1 - C G'
goes into the divergence sweep. G' is the gradient of the relaxing displacement f, on which the control of zero-energy
modes acts: C = coefficient G (tr K^-1 1 + 2 K^-1), after Wan et al. with the shear modulus alone as its scale.

Where all laws are linear and all their moduli relax alike, the stress follows from the gradient of f, too, and one
sweep of each kind does. Else it follows from the gradient of u and histories of tensors (`solids`), and control and
stress have sweeps of their own. Bodies with different Prony series have one relaxing displacement for each series. The
energy is a sum over particles, each of which knows the f of its own series at both ends of its bonds; so the force is a
sum over the series, in each of which only the particles of the series have M and C. Solids that flow have states of
their own, and a control on velocities (`plastic`).
"""

from functools import partial
from typing import Any

import numpy as np

from parsolid.kernels import kernel
from parsolid.materials.declaration import SOFTENING
from parsolid.materials.hyperelastic.at_particles import state_count
from parsolid.materials.viscoelastic.prony import LinearSolid, branch_weights, linear_solid, linear_stress
from parsolid.methods.peridynamics.bond_damage import BondDamage, Failing
from parsolid.methods.peridynamics.bonds import Bonds
from parsolid.methods.peridynamics.plastic import PlasticStates, flows
from parsolid.methods.peridynamics.relaxing_displacement import RelaxingDisplacement
from parsolid.methods.peridynamics.solids import has_tensor_history, is_small_strain, series_of
from parsolid.methods.peridynamics.sweeps import (
    MATRIX_ROW,
    Lists,
    control_at,
    copy_to_columns,
    gradient_at,
    inverse_at,
    matmul_in,
    store_rows,
)
from parsolid.methods.peridynamics.tensor_histories import TensorHistories, rows_between
from parsolid.pairs.lattice_convolution import aligned_zeros, lattice_convolution
from parsolid.particles.declaration import Columns, Field, Rows
from parsolid.particles.law_values import rows_of_laws
from parsolid.tensors import combine, general, symmetric_part

# some owned particles (k,), ascending, and lists with all of their bonds
Near = tuple[np.ndarray, Lists]
# sigma = 0: a law that leaves the control of zero-energy modes alone
NO_STRESS = LinearSolid(0.0, 0.0, 0.0, 0.0, 0.0, False, 0.0)


class BondForces:
    """What forces of correspondence and bond-based laws have in common.

    evaluations: of the forces so far; last_step [s]: the length of the step before the present one; laws: (first, last,
    law) of the rank's particles; plane: True in the plane, else None; d: dimension of the scene, 1 of bars, that of
    `bonds` being 2; share (owned,): the part of a particle on this side of mirror planes. sound: whether every settled
    Jacobian is positive; stiffens: whether stiffness depends on the state; growth: bound of the largest to come over
    that at rest. It declares internal_force (d, n) [N], that of the last evaluation, of the whole particle where it
    lies on a mirror plane.
    """

    sound, stiffens, growth, last_step = True, False, 1.0, 0.0
    plastic: PlasticStates | None = None
    damping: np.ndarray | None = None

    def __init__(self, bonds: Bonds, blocks: list[Any], fixed: np.ndarray) -> None:
        """blocks: this rank's particles by law; fixed (owned, d) bool: normals of fixed planes a particle lies on."""
        self.bonds, self.particles = bonds, bonds.particles
        self.owned, self.plane = bonds.owned, True if bonds.d == 2 else None
        self.d = self.particles.fields["displacement"].components
        self.laws = [(block.first, block.last, block.law) for block in blocks]
        self.every = np.arange(self.owned)
        self.evaluations, self.rows = 0, aligned_zeros(self.owned, 4)
        self.projected = np.flatnonzero(fixed.any(axis=1))
        # factors of rows of M that leave (M + Q M R)/2, Q = -1, of particles on fixed planes
        factors = np.ones((len(self.projected), bonds.d))
        for axis in range(bonds.d):
            factors[np.ix_(fixed[self.projected, axis], np.arange(bonds.d) != axis)] = 0.0
        self.projection = np.repeat(factors, MATRIX_ROW[bonds.d] // bonds.d, axis=1)
        told: dict[str, Any] = {"ghosts": "forward", "message": "trial", "layout": Columns(), "carried": False}
        self.particles.declare(Field("trial_displacement", self.d, "m", mirror="vector", **told))
        told = {"mirror": "vector", "checkpointed": True, "layout": Columns()}
        self.particles.declare(Field("internal_force", self.d, "N", **told))

    def book_softening(self, ledger: Any) -> float:
        """Nothing, where laws have no state variables."""
        return 0.0

    @property
    def force(self) -> np.ndarray:
        """Force (owned, d) [N] of the last evaluation, a view."""
        return self.particles.owned_rows("internal_force")

    def store(self, rows: np.ndarray) -> np.ndarray:
        """Let rows (owned, 4) [N] be the force of the last evaluation, (owned, d)."""
        copy_to_columns(rows, self.particles.storage("internal_force"))
        return self.force

    @property
    def share(self) -> np.ndarray:
        """The part (owned,) of a particle on this side of mirror planes."""
        return self.particles.owned_rows("share")

    def divergence(
        self, field: str, control: np.ndarray | None, force: np.ndarray, lists: Lists | None = None
    ) -> np.ndarray:
        """Fill force (owned, 4) [N] with that of the rows of M, see `Bonds.divergence`."""
        if len(self.projected):
            self.particles.storage("bond_stress")[self.projected] *= self.projection
        return self.bonds.divergence(field, control, force, lists)

    def of_stress(self, stress: np.ndarray) -> np.ndarray:
        """Force (owned, d) [N] of given stresses (owned, d, d) [Pa] without control; what balances a consistent
        load."""
        d = self.bonds.d
        rows = self.particles.storage("bond_stress")[: self.owned].reshape(self.owned, d, MATRIX_ROW[d] // d)
        rows[:, :, :d] = (stress @ self.bonds.inverse_shapes()).swapaxes(1, 2)
        return self.divergence("displacement", None, self.rows)[:, : self.d].copy()

    def displacement_gradients(self) -> np.ndarray:
        """grad u (owned, d, d) with the ghosts' displacements of the last evaluation."""
        bonds, d = self.bonds, self.bonds.d
        rows = bonds.gradients("displacement").reshape(self.owned, d, MATRIX_ROW[d] // d)
        columns = rows[:, :, :d].swapaxes(1, 2)
        return np.asarray(columns @ bonds.inverse_shapes() / bonds.volume[: self.owned, None, None])

    def bytes_sent(self) -> int:
        return int(self.particles.bytes_sent("motion") + self.particles.bytes_sent("record"))


class CorrespondenceForces(BondForces):
    """Forces and memory of a rank's particles.

    memories: one `RelaxingDisplacement` for each Prony series; controls: rows of C of each, or None; tensors:
    `TensorHistories` or None; plastic: `PlasticStates` or None; histories: those of both that there are, whose stress
    follows from the gradient of u, as all have it then; damping: rows of C of the control on velocities, or None.
    """

    def __init__(self, bonds: Bonds, blocks: list[Any], laws: list[Any], settings: Any, scales: Any, fixed: Any):
        """laws: of all bodies of the scene, the same on all ranks; scales: of the control, coefficient times shear
        modulus [Pa], and of that on velocities [Pa s], each (owned,) or None; blocks, fixed: see `BondForces`.
        Collective.
        """
        super().__init__(bonds, blocks, fixed)
        self.tensors: TensorHistories | None = None
        series, distinct = list(dict.fromkeys(map(series_of, laws))), list(dict.fromkeys(laws))
        self._softens = any(state_count(law) for law in rows_of_laws(laws))
        if any(map(has_tensor_history, laws)) and not all(map(flows, laws)):
            terms, own = max(len(ratios) for ratios, _ in series), [law for law in self.laws if not flows(law[2])]
            self.tensors = TensorHistories(bonds, own, terms, self.share, rows_of_laws(laws))
        if any(map(flows, laws)):
            self.plastic = PlasticStates(bonds, self.laws, distinct, settings.viscosity)
        self.histories: list[Any] = [one for one in (self.tensors, self.plastic) if one is not None]
        self.stiffens = not all(is_small_strain(law) for _, _, law in self.laws)
        if not settings.stabilisation.relaxes:
            series = [((), ())]
        self.memories = []
        for number, one in enumerate(series):
            mine = [law for law in self.laws if len(series) == 1 or series_of(law[2]) == one]
            mark = "" if len(series) == 1 else f"_{number}"
            self.memories.append(RelaxingDisplacement(self.particles, mine, one, mark))
        scale, viscous = scales
        self.controls = [None] * len(self.memories) if scale is None else self._controls(scale)
        self.damping = None if viscous is None else self._control_rows("damping", viscous)
        # sums over a lattice know one control
        if len(self.memories) == 1 and (scale is None or viscous is None):
            bonds.lattice = lattice_convolution(bonds)

    def _controls(self, scale: np.ndarray) -> list[np.ndarray]:
        """Rows of C (n, 12 or 4) for each series, 0 of particles that have another, ghosts behind."""
        whole = self._control_rows("control", scale)
        if len(self.memories) == 1:
            return [whole]
        number = np.full(self.owned, -1, np.int64)
        for i, memory in enumerate(self.memories):
            number[memory.rows] = i
        number = np.pad(self.bonds.halo.with_ghosts(number), (0, len(whole)))[: len(whole)]
        return [np.where(number[:, None] == i, whole, 0.0) for i in range(len(self.memories))]

    def _control_rows(self, name: str, scale: np.ndarray) -> np.ndarray:
        """Rows of C (n, 12 or 4) of a field of that name, ghosts behind.

        Of laws of finite strain C is a multiple of 1, that of a whole neighbourhood: what a body has in its surface
        does not turn with it, and only what is along the jump of a bond has no moment.
        """
        bonds, d = self.bonds, self.bonds.d
        K = bonds.inverse_shapes()
        C = scale[:, None, None] * (np.trace(K, axis1=1, axis2=2)[:, None, None] * np.eye(d) + 2.0 * K)
        for first, last, law in self.laws:
            if not is_small_strain(law):
                C[first:last] = np.trace(C[first:last], axis1=1, axis2=2)[:, None, None] * np.eye(d) / d
        row = MATRIX_ROW[d]
        self.particles.declare(Field(name, row, "", layout=Rows(row), carried=False, ghosts="forward", message=name))
        self.particles.owned_rows(name).reshape(self.owned, d, row // d)[:, :, :d] = C
        self.particles.update(name)
        return self.particles.storage(name)

    # --- a step -----------------------------------------------------------------------------------------------

    def internal_force(self, step: float) -> np.ndarray:
        """Force (owned, d) [N] after a step [s] from the settled state to the displacement of the particles."""
        for memory in self.memories:
            memory.trial_step(step)
        if self.plastic is not None:
            self.plastic.mean_step = 0.5 * (self.last_step + step)
        return self._evaluate(step)

    def _evaluate(self, step: float) -> np.ndarray:
        """Force (owned, d) [N] of the fields of the memories, and of the displacement at the end of a step [s]."""
        self.evaluations += 1
        message: str | None = "motion"
        for memory in self.memories:
            if not self.histories or self.controls[0] is not None:
                self._evaluate_memory(memory, message)
                message = None
        total = self.memories[0].force
        for memory in self.memories[1:]:
            total = total + memory.force
        if self.histories:
            sums = self.bonds.gradients("displacement", message)
            for one in self.histories:
                one.store_stresses(step, sums, self.particles.storage("bond_stress"))
            total = total + self.divergence("displacement", None, self.rows)
        return self.store(total)

    def _dampen(self) -> None:
        """Force of the control on velocities, which ghosts have with the motion, and of viscosity; the heat of both."""
        if self.plastic is not None and self.damping is not None:
            self.plastic.dampen(self.damping)
            rows = self.divergence("velocity", self.damping, self.rows)
            copy_to_columns(rows, self.particles.storage("dissipative_force"))

    def _evaluate_memory(
        self, memory: RelaxingDisplacement, message: str | None, near: Near | None = None
    ) -> np.ndarray:
        """What of the force (owned, 4) [N] is linear in the field of a memory: all of it, or the control's; near: see
        `_linear_force`."""
        laws = memory.laws
        if self.histories:
            laws = [(first, last, None) for first, last, _ in laws]
        control = self.controls[self.memories.index(memory)]
        return self._linear_force(memory.field, laws, control, message, memory.force, near)

    def _linear_force(
        self,
        field: str,
        laws: list[Any],
        control: np.ndarray | None,
        message: str | None,
        force: np.ndarray,
        near: Near | None = None,
    ) -> np.ndarray:
        """Fill force (owned, 4) [N] with that of a field by linear laws, of which None has no stress, and a control.

        With `near` the force is what the bonds and the M of some particles give, which is what changes when they lose
        some.
        """
        chosen, lists = near or (self.every, None)
        sums, M = self.bonds.gradients(field, message, lists), self.particles.storage("bond_stress")
        if len(self.memories) > 1 or near is not None:
            M[: self.owned] = 0.0
        inverse, volume = self.particles.storage("inverse_shape"), self.bonds.volume
        for first, last, law in laws:
            law = NO_STRESS if law is None else linear_solid(law)
            rows = rows_between(chosen, first, last)
            store_linear_stresses(self.plane, rows, law, inverse, volume, control, sums, M)
        return self.divergence(field, control, force, lists)

    def commit(self, step: float) -> float:
        """End a step [s] at the displacement of the last evaluation, of which the sums are; the energy dissipated over
        it [J]."""
        lost = sum(memory.commit(step, self.share) for memory in self.memories)
        lost += sum(one.commit(step, self.bonds.sums) for one in self.histories)
        self._dampen()
        return lost

    def book_softening(self, ledger: Any) -> float:
        """Enter into a ledger what state variables of laws have dissipated in the step that was committed last; the
        energy [J]."""
        if not self._softens or self.tensors is None:
            return 0.0
        ledger.add_term(SOFTENING, self.tensors.softened)
        return float(self.tensors.softened)

    def start(self, instantaneous: bool) -> None:
        """Memory and forces of the displacement at time 0: reached in a jump, or held for ever."""
        for memory in self.memories:
            memory.start(partial(self._evaluate_memory, memory, "motion"), instantaneous)
        if self.histories:
            sums = self.bonds.gradients("displacement", "motion")
            for one in self.histories:
                one.start(sums, instantaneous)
        self.resume()
        self._dampen()

    def resume(self) -> None:
        """Forces of a settled state that was put back."""
        for memory in self.memories:
            memory.compose()
        self._evaluate(0.0)
        for memory in self.memories:
            memory.resume()
        for one in self.histories:
            one.resume(self.bonds.sums)

    def evaluate_anew(self) -> None:
        """Forces of the settled state and of each part of its memory; tensors take what has changed in the gradients as
        a jump."""
        for memory in self.memories:
            memory.evaluate_anew(partial(self._evaluate_memory, memory, "motion"))
        self._evaluate(0.0)
        for one in self.histories:
            one.commit(0.0, self.bonds.sums)

    def break_bonds(self, damage: BondDamage, failing: Failing | None) -> float:
        """Break bonds in the settled state, None where this rank has none that fail; the energy [J] released.

        Collective. Forces change near these bonds alone; tensors take what has changed in the gradients as a jump.
        Where bodies flow, all particles are evaluated anew.
        """
        released, local = sum(one.stored for one in self.histories), self.plastic is None
        particles = np.zeros(0, np.int64) if failing is None else failing.particles
        near = particles, damage.near(particles)
        before, pulled = self._parts_near(near), self._pull_of_tensors(near, -1.0) if local else None
        near = particles, near[1] if failing is None else damage.cut(failing)
        after = self._parts_near(near)
        for memory, old, new in zip(self.memories, before, after):
            change = new - old
            released -= memory.energy_of(change[: self.d], change[self.d :], self.share)
            self.force[:] += memory.add_to_parts(change).T
        if pulled is not None:
            self.force[:] += self._pull_of_tensors(near, 1.0) - pulled
        elif self.histories:
            self._evaluate(0.0)
            for one in self.histories:
                one.commit(0.0, self.bonds.sums)
        return float(released - sum(one.stored for one in self.histories))

    def _pull_of_tensors(self, near: Near, sign: float) -> np.ndarray | None:
        """What bonds near some particles give of the force (owned, d) [N] of tensors, None without any; the energy that
        tensors store there goes to their sum with a sign."""
        if self.tensors is None:
            return None
        (particles, lists), stored = near, self.tensors.stored
        sums, M = self.bonds.gradients("displacement", None, lists), self.particles.storage("bond_stress")
        M[: self.owned] = 0.0
        self.tensors.store_stresses(0.0, sums, M, particles)
        self.tensors.commit(0.0, sums, particles)
        self.tensors.stored = stored + sign * self.tensors.stored
        return self.divergence("displacement", None, self.rows, lists)[:, : self.d].copy()

    def _parts_near(self, near: Near) -> list[np.ndarray]:
        """What bonds near some particles give of each part of the memories."""
        # ghosts have the displacement; parts must be sent
        messages = ["motion" if len(memory.ratios) else None for memory in self.memories]
        return [
            memory.parts(partial(self._evaluate_memory, memory, message, near))
            for memory, message in zip(self.memories, messages)
        ]

    # --- stiffness, energy and stress -------------------------------------------------------------------------

    def factor(self, step: float) -> np.ndarray:
        """1 + sum gamma_j A_j (owned,) of each particle over a step [s]."""
        result = np.ones(self.owned)
        for first, last, law in self.laws:
            ratios, times = series_of(law)
            result[first:last] += sum(ratio * branch_weights(step, tau)[1] for ratio, tau in zip(ratios, times))
        return result

    def stiffness_force(self, laws: list[Any], change: np.ndarray, step: float) -> np.ndarray:
        """-K du (owned, 4) [N] of a displacement du (owned, d) [m] of the undeformed body over a step [s].

        laws: (first, last, law), elastic ones that the factors of the particles multiply (`tangent.algorithmic_law`).
        """
        total, trial = np.zeros((self.owned, 4)), self.particles.owned_rows("trial_displacement")
        for memory, control in zip(self.memories, self.controls):
            memory.begin(step)
            factor = self.factor(step)[:, None] if len(self.memories) == 1 else memory.factor
            np.multiply(change, factor, out=trial)
            # a rank without particles of a series has an empty block, which begins where the next one does
            mine = [one for one in laws if any(one[:2] == other[:2] for other in memory.laws)]
            total += self._linear_force("trial_displacement", mine, control, "trial", self.rows)
            self.evaluations += 1
        return total

    def damping_force(self, velocity: np.ndarray) -> np.ndarray:
        """Force (owned, 4) [N] of the control on velocities (owned, d) [m/s]."""
        self.particles.owned_rows("trial_displacement")[:] = velocity
        nothing = [(first, last, None) for first, last, _ in self.laws]
        return self._linear_force("trial_displacement", nothing, self.damping, "trial", self.rows)

    def stored_energy(self) -> float:
        """Of the settled state [J], the control's included."""
        stored = sum(memory.stored_energy(self.share) for memory in self.memories)
        return stored + sum(one.stored for one in self.histories)

    @property
    def sound(self) -> bool:  # type: ignore[override]
        """Whether every settled Jacobian is positive; of small strain there is none to look at."""
        return all(one.sound for one in self.histories)

    @property
    def growth(self) -> float:  # type: ignore[override]
        """Bound of the stiffness to come over that at rest."""
        return max((one.growth for one in self.histories), default=1.0)

    def cauchy_stresses(self, F: np.ndarray) -> np.ndarray:
        """sigma (owned, 3, 3) [Pa] of the settled state; F (owned, 3, 3): its deformation gradients."""
        P, inverse, volume = np.zeros((self.owned, 9)), self.particles.storage("inverse_shape"), self.bonds.volume
        if self.histories:
            sums = self.bonds.gradients("displacement")
            for one in self.histories:
                one.nominal_stresses(sums, P)
        else:
            for memory in self.memories:
                sums = self.bonds.gradients(memory.field)
                for first, last, law in memory.laws:
                    linear_stresses(self.plane, first, last, linear_solid(law), inverse, volume, sums, P)
        nominal = P.reshape(-1, 3, 3)
        return pushed_forward(nominal, F) if self.stiffens else nominal


def pushed_forward(P: np.ndarray, F: np.ndarray) -> np.ndarray:
    """sigma = P F^T / J (n, 3, 3) [Pa]."""
    return P @ F.swapaxes(1, 2) / np.linalg.det(F)[:, None, None]


@kernel
def store_linear_stresses(plane, rows, law, inverse, volume, control, sums, M):
    """M = sigma K^-1 - C G of some particles from the sums of the gradient of f; control: rows of C or None."""
    for a in rows:
        G = gradient_at(plane, sums, inverse, volume, a)
        e = symmetric_part(G)
        S = matmul_in(plane, general(linear_stress(law, e, e)), inverse_at(inverse, a))
        if control is not None:
            S = combine(1.0, S, -1.0, matmul_in(plane, control_at(plane, control, a), G))
        store_rows(plane, M, a, S)


@kernel
def linear_stresses(plane, first, last, law, inverse, volume, sums, result):
    """Stress (n, 9) [Pa] of particles first..last-1 from the sums of the gradient of f."""
    for a in range(first, last):
        e = symmetric_part(gradient_at(plane, sums, inverse, volume, a))
        P = general(linear_stress(law, e, e))
        for c in range(9):
            result[a, c] = P[c]
