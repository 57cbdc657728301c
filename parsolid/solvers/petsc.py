"""PETSc's Krylov methods and algebraic multigrid in place of this package's own: `method.linear_solver = "petsc"`.

The product stays that of the bodies; the preconditioner is made from an assembled matrix. Options of a scene go to
PETSc's database, so that `-ksp_type` and `-pc_type` replace what is chosen here. petsc4py is an optional extra,
imported where a scene asks for it. Source: S. Balay et al., PETSc/TAO users manual, ANL-21/39.
"""

import re
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.reduction import sums
from parsolid.collective import SolverError
from parsolid.solvers.conjugate_gradients import Solution

# of a residual, how much further a solution goes whose method ends by the norm of the preconditioner
_FURTHER, _ROUNDS = 0.3, 8
_LIBRARY = re.compile(rb"lib(?:mpi|mpich)\.so\.\d+")


def missing_petsc() -> str | None:
    """What is found where petsc4py is expected, None where it can be used; imports nothing of PETSc."""
    if find_spec("petsc4py") is None:
        return "none"
    import petsc4py

    wanted = {
        name.decode()
        for extension in Path(petsc4py.__file__).parent.rglob("PETSc*.so")
        for name in _LIBRARY.findall(extension.read_bytes())
    }
    maps = Path("/proc/self/maps")
    # libraries of this process, in which mpi4py is one
    loaded = {name.decode() for name in _LIBRARY.findall(maps.read_bytes())} if maps.exists() else wanted
    if wanted and not wanted & loaded:
        return f"one built with another MPI ({', '.join(sorted(wanted))}) than mpi4py ({MPI.get_vendor()[0]})"
    return None


def start_petsc(options: str) -> Any:
    """The module PETSc, with options of a scene. Raises SolverError where it cannot be imported or does not read
    them."""
    try:
        from petsc4py import PETSc
    except (ImportError, RuntimeError) as error:
        expected = "method.linear_solver: expected a petsc4py that can be imported for 'petsc'"
        raise SolverError(f"{expected}, found {error}") from error
    try:
        PETSc.Options().insertString(options)
    except PETSc.Error as error:
        raise SolverError(f"method.petsc_options: expected options of PETSc, found {options!r}") from error
    return PETSc


class Multigrid:
    """A preconditioner of PETSc: GAMG unless options say otherwise."""

    def __init__(self, PETSc: Any, comm: Any, places: np.ndarray, free: np.ndarray, matrix: Any) -> None:
        """places (n, d) [m] of this rank's particles, whose rigid motions a multigrid method keeps; free (n, d) bool;
        matrix (n d, d particles of all ranks) [N/m]: rows of a stiffness, sparse. Collective. Raises SolverError on all
        ranks where PETSc refuses options."""
        self.free, (height, width) = free, matrix.shape
        csr = [matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType), matrix.data]
        sizes, d = ((height, width),) * 2, places.shape[1]
        self.matrix = PETSc.Mat().createAIJ(size=sizes, bsize=d, csr=csr, comm=comm)
        coordinates = PETSc.Vec().createWithArray(np.ascontiguousarray(places).ravel(), bsize=d, comm=comm)
        self.matrix.setNearNullSpace(PETSc.NullSpace().createRigidBody(coordinates))
        self.pc = PETSc.PC().create(comm)
        self.pc.setOperators(self.matrix)
        self.pc.setType("gamg")
        self.right, self.solution = self.matrix.createVecs()
        try:
            self.pc.setFromOptions()
            self.pc.setUp()
        except PETSc.Error as error:
            raise SolverError(f"method.petsc_options: expected a preconditioner of PETSc, found {error}") from error

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """M^-1 r (n, d) [m] of a residual (n, d) [N] that is 0 where a component is prescribed."""
        self.right.setArray(residual.ravel())
        self.pc.apply(self.right, self.solution)
        # aggregates move what is prescribed, too
        return self.solution.getArray(readonly=True).reshape(residual.shape) * self.free

    def destroy(self) -> None:
        """Free what PETSc holds, on all ranks at once."""
        for one in (self.pc, self.matrix, self.right, self.solution):
            one.destroy()


class _Action:
    """What PETSc calls as the product of a matrix, or as a preconditioner."""

    def __init__(self, act: Callable[[np.ndarray], np.ndarray], shape: tuple[int, ...]) -> None:
        self.act, self.shape = act, shape

    def mult(self, _: Any, x: Any, y: Any) -> None:
        y.setArray(self.act(x.getArray(readonly=True).reshape(self.shape)).ravel())

    apply = mult


class Krylov:
    """A Krylov method of PETSc with the arguments of `conjugate_gradients`; kind: as of `-ksp_type`."""

    def __init__(self, PETSc: Any, kind: str) -> None:
        self.PETSc, self.kind = PETSc, kind

    def __call__(
        self,
        comm: Any,
        apply: Callable[[np.ndarray, np.ndarray], None],
        load: np.ndarray,
        target: float,
        free: np.ndarray,
        limit: int,
        precondition: Callable[[np.ndarray], np.ndarray],
    ) -> Solution:
        """Solve K x = load on free components; collective. The residual is that of the equations, whatever norm the
        method ends by: where that was not enough it goes on from there."""
        PETSc, shape, products = self.PETSc, load.shape, 0

        def product(x: np.ndarray) -> np.ndarray:
            nonlocal products
            products += 1
            out = np.empty(shape)
            apply(np.ascontiguousarray(x), out)
            return out * free

        sizes = (load.size, PETSc.DETERMINE)
        operator = PETSc.Mat().createPython((sizes, sizes), _Action(product, shape), comm=comm)
        ksp = PETSc.KSP().create(comm)
        ksp.setOperators(operator)
        ksp.setType(self.kind)
        if self.kind == "cg":
            ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        ksp.setFromOptions()
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(_Action(lambda r: precondition(np.array(r)), shape))
        value, residual, reason = np.zeros(shape), load * free, ""
        right, change = operator.createVecs()
        norm = float(np.sqrt(sums(comm, [np.vdot(residual, residual)])[0]))
        # the norm that a method ends by is that of the equations, or falls like it
        part = 1.0
        for _ in range(_ROUNDS):
            if norm <= target or products >= limit or reason:
                break
            right.setArray(residual.ravel())
            ksp.setTolerances(rtol=part * target / norm, atol=0.0, divtol=1e30, max_it=limit - products)
            ksp.solve(right, change)
            code = ksp.getConvergedReason()
            value += change.getArray(readonly=True).reshape(shape)
            residual = load * free - product(value)
            norm = float(np.sqrt(sums(comm, [np.vdot(residual, residual)])[0]))
            part *= _FURTHER
            if code == PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_MAT:
                reason = "a direction without positive stiffness"
            elif code < 0 and code != PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT:
                reason = f"PETSc's {ksp.getType()} ends with code {code}"
        for one in (ksp, operator, right, change):
            one.destroy()
        if norm <= target * (1.0 + 1e-6):
            return Solution(value, products, norm, True)
        return Solution(value, products, norm, False, reason or f"no solution after {products} products")
