"""The preconditioner of equilibria of total-Lagrangian SPH: `solvers.grid_levels` at the present shape.

The particles' own level is the diagonal of nearest-neighbour elements, the others are grids over the bodies as they
are. Moduli are those at rest.
"""

from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.boundary.forces import SpringLoad
from parsolid.collective import SolverError, maximum
from parsolid.methods.tlsph.closing import Loose
from parsolid.methods.tlsph.linear_elements import LinearElements
from parsolid.methods.tlsph.tangent import Tangent
from parsolid.solvers import (
    GridLevels,
    moduli_of_rows,
    rigid_motions,
    scaled_diagonal,
    start_vector,
    unrestrained_modes,
)

# products a decade over those of the first solution, from which the shape has left that of the preconditioner; products
# of a solution that say something
_GROWN, _FEW = 1.5, 8
# of the stiffness of tools, the change from which it is taken anew
_CHANGED = 0.25
# of a particle's stiffness times its size, the rounding of its force: twice what 42,000 nodes of a mesh have
_BITS = 64.0 * 2.0**-52
# of a body's size, a turn or shift that is none
_LOOSE = 1e-9


class StaticPreconditioner:
    """M^-1 r of residuals; all methods are collective.

    rounding [N]: of the norm of forces; loose: what nothing but contact holds; elements: those from which PETSc makes
    it, None where it is this package's own.
    """

    def __init__(self, tangent: Tangent) -> None:
        self.tangent, self.system, self.comm = tangent, tangent.system, tangent.comm
        system, d = self.system, self.system.dimension
        of = system.particles.owned_rows
        lame, self.shear = moduli_of_rows(tangent.laws, system.owned)
        # what pressures take is not in the tangent of displacements
        self.lame = lame if system.pressures is None else np.where(system.pressures.free, 0.0, lame)
        self.volume, self.loose = np.array(of("volume")), Loose(np.zeros((0, system.owned, d)))
        count, volume = sums(self.comm, [float(system.owned), float(self.volume.sum())])
        self.spacing = float(volume / count) ** (1.0 / d)
        softer = ((d + 1.0) * self.shear + self.lame) / ((d + 1.0) * self.shear + lame)
        self.diagonal = self._scaled_diagonal(softer)
        size = (self.volume ** (1.0 / d) / softer)[:, None]
        self.rounding = _BITS * float(np.sqrt(sums(self.comm, [np.sum((self.diagonal * size) ** 2)])[0]))

        petsc = system.settings.linear_solver == "petsc"
        self.elements = LinearElements(system, self.lame, self.shear) if petsc else None
        self.begin()

    def _scaled_diagonal(self, softer: np.ndarray) -> np.ndarray:
        """D (owned, d) [N/m]: the tangent's own mean over that of its estimate, from one product at rest; softer
        (owned,): a factor on the estimate, where pressures are unknowns."""
        tangent, estimate = self.tangent, self.tangent.diagonal() * softer[:, None]
        signs = np.sign(start_vector(self.system.particles.owned_rows("identifier"), self.system.dimension))
        tangent.share_moves(signs)
        trial = np.where(tangent.free, signs, 0.0)
        tangent.linearise()
        return scaled_diagonal(self.comm, estimate, trial, tangent.product(trial))

    def begin(self, inertia: np.ndarray | None = None) -> None:
        """Forget earlier shapes, as a restart knows none; inertia (owned,) [N/m]: what masses add to the diagonal."""
        self.held = np.zeros(self.diagonal.shape)
        self.inertia = self.held if inertia is None else self.held + inertia[:, None]
        self.build()

    def build(self) -> None:
        """Take the shape that is present where it is next asked for."""
        self._levels: Any = None
        self._first: float | None = None

    def follow_tools(self) -> None:
        """Take the stiffness of what tools press on, as linearised, where it has changed: they may be all that holds a
        body."""
        tools = self.system.interactions
        held = np.where(self.tangent.free, sum((one.stiffness() for one in tools), np.zeros(self.held.shape)), 0.0)
        changed, size = sums(self.comm, [np.abs(held - self.held).sum(), held.sum()])
        if changed > _CHANGED * size:
            self.held = held
            self.build()

    def note(self, products: int, decades: float) -> None:
        """Hear how many products took how many decades of a residual; take the present shape where it is far more
        than at first."""
        if products < _FEW:
            return
        if self._first is None:
            self._first = products / decades
        elif products / decades > _GROWN * self._first:
            self.build()

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """M^-1 r (owned, d) [m] of a residual (owned, d) [N] that is 0 where a component is prescribed."""
        if self._levels is None:
            places = np.ascontiguousarray(self.system.particles.owned_rows("position"))
            added = self.inertia + self.held
            if self.elements is not None:
                self._levels = self.elements.build(places, self.tangent.free, self.diagonal, added)
            else:
                self._levels = GridLevels(self.comm, places, self.spacing, self.tangent.free)
                moduli = self.lame, self.shear, self.volume
                self._levels.of_moduli(*moduli, self.diagonal, added if added.any() else None)
        return np.asarray(self._levels(residual))

    # --- what nothing holds -------------------------------------------------------------------------------------

    def refuse_loose_bodies(self, tied: list[tuple[int, int]], touched: set[int]) -> None:
        """Raise SolverError on all ranks for a body that can move as one without a force; tied: numbers of bodies that
        ties join; touched: those that contact may hold."""
        for group, names, modes in self._loose_bodies(tied):
            held = f"{names} of {' and '.join(self.system.names_of_bodies[number] for number in sorted(group))}"
            if touched.isdisjoint(group):
                expected = "boundaries: expected conditions that hold every body in equilibrium"
                raise SolverError(f"{expected}, found none against {held}")
            largest = [maximum(self.comm, float(np.abs(mode).max(initial=0.0))) for mode in modes]
            every = np.concatenate((self.loose.modes, modes / np.array(largest)[:, None, None]))
            here = np.isin(self.system.particles.owned_rows("body"), group)
            self.loose = Loose(every, [*self.loose.groups, here], [*self.loose.names, held])

    def _loose_bodies(self, tied: list[tuple[int, int]]) -> list[tuple[list[int], str, np.ndarray]]:
        """Numbers of bodies that can move as one without a force but those of contact, and how, in words and as modes
        (k, owned, d); collective."""
        system, d = self.system, self.system.dimension
        body, X = system.particles.owned_rows("body"), system.particles.owned_rows("reference_position")
        sprung, result = self._bodies_on_springs(body), []
        for group in self._joined_bodies(tied).values():
            if sprung[group].any():
                continue
            here = np.isin(body, group)
            modes = _rigid_modes(self.comm, X, here)
            held = modes * ~self.tangent.free
            restraint = sums(self.comm, np.tensordot(held, held, ((1, 2), (1, 2))))
            loose = unrestrained_modes(self.comm, modes, restraint)
            if len(loose):
                parts = sums(self.comm, np.tensordot(loose, modes, ((1, 2), (1, 2))))
                result.append((group, _names(d, parts), loose))
        return result

    def _bodies_on_springs(self, body: np.ndarray) -> np.ndarray:
        """Whether any spring acts on each body, of the numbers (owned,) of the particles' bodies."""
        found = np.zeros(len(self.system.laws))
        for load, _ in self.system.conditions.loads_of:
            if isinstance(load, SpringLoad):
                found[body[load.surface.selection.rows]] = 1.0
        return sums(self.comm, found) > 0.0

    def _joined_bodies(self, tied: list[tuple[int, int]]) -> dict[int, list[int]]:
        """Numbers of bodies that share nodes, by their meshes, or are tied, under the first of them."""
        keys: dict[Any, int] = {}
        groups: dict[int, list[int]] = {}
        for number, mesh in enumerate(self.system.meshes_of_bodies):
            first = keys.setdefault(mesh, number) if mesh is not None else number
            groups.setdefault(first, []).append(number)
        for one, other in tied:
            a, b = (next(first for first, group in groups.items() if body in group) for body in (one, other))
            if a != b:
                groups[a] += groups.pop(b)
        return groups


def _rigid_modes(comm: Any, X: np.ndarray, here: np.ndarray) -> np.ndarray:
    """Shifts along the axes and turns about the middle (k, owned, d) of some particles."""
    count, *middle = sums(comm, [float(here.sum()), *X[here].sum(axis=0)])
    arm = (X - np.array(middle) / max(count, 1.0)) * here[:, None]
    arm /= max(maximum(comm, float(np.abs(arm).max(initial=0.0))), 1e-300)
    return rigid_motions(arm) * here[:, None]


def _names(d: int, parts: np.ndarray) -> str:
    """What shifts and turns loose modes (l, k) have parts of, in words."""
    names = [f"a shift along {axis}" for axis in "XYZ"[:d]]
    names += ["a turn"] if d == 2 else [f"a turn about {axis}" for axis in "ZYX"]
    sizes = np.abs(parts).max(axis=0)
    return ", ".join(name for name, size in zip(names, sizes) if size > _LOOSE * sizes.max())
