"""numba's compiler with only what kernels need, in force while one of our kernels is compiled.

- What kernels call is neither optimised nor assembled on its own (`linking`).
- Kernels that make and give no arrays do without counts of references: numba writes them for every use of an array, and
  its optimiser takes them away again.
- Passes for closures, lists, array expressions and the like are left out, and what numba does in vain (`economies`).

What does not get through this way is compiled once more by numba as it is, and so are others' `njit` functions that a
kernel calls: Python may call them, too. All of it may be numba's by PARSOLID_PLAIN_COMPILER=1.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import compiler, errors, ir, typed_passes, types, untyped_passes
from numba.core.compiler_machinery import PassManager, _pass_registry, pass_timings
from numba.core.targetconfig import ConfigStack

from decomposition.economies import economies, replaced
from decomposition.linking import CalleeLibrary, KernelLibrary

# what functions of ours do not contain; where numba knows a name no more, there is nothing to leave out
_UNNEEDED = frozenset(
    getattr(untyped_passes, name, None) or getattr(typed_passes, name, None)
    for name in (
        "AnnotateTypes",
        "DumpParforDiagnostics",
        "FindLiterallyCalls",
        "InlineClosureLikes",
        "InlineInlinables",
        "InlineOverloads",
        "LiteralPropagationSubPipelinePass",
        "LiteralUnroll",
        "MakeFunctionToJitFunction",
        "NopythonRewrites",
        "RewriteDynamicRaises",
        "WithLifting",
    )
)
# names in the code of functions that make arrays
_MAKERS = frozenset(
    (
        *("arange", "argsort", "array", "astype", "bincount", "concatenate", "copy", "cumsum", "empty", "empty_like"),
        *("flatnonzero", "full", "full_like", "linspace", "nonzero", "ones", "ones_like", "repeat", "sort", "unique"),
        *("where", "zeros", "zeros_like"),
    )
)
_USUAL = compiler.Compiler.define_pipelines
# kernels whose compilations stand within each other, and all that the outermost has begun
_within: list[Any] = []
_begun: list[Any] = []
# what numba has of its own where something of ours stands now
_numbas: list[tuple[Any, str, Any]] = []
# what numba has compiled of its own without counts of references, which nothing that counts may take
_UNCOUNTED: dict[Any, Any] = {}
# kernels that this process has compiled as numba does, by module and name, for what failed here
FALLEN_BACK: list[str] = []


def compile_short(dispatcher: Any, as_numba: Callable[[Any], Any], signature: Any) -> Any:
    """Compile a kernel; what goes wrong on the way goes the way of numba, whose errors are those that people know."""
    # helpers are chosen by their arguments alone: with counts in the caller, they are wanted with counts
    caller = ConfigStack.top_or_none()
    counted = caller is not None and caller.nrt
    makes_arrays = not _MAKERS.isdisjoint(dispatcher.py_func.__code__.co_names)
    dispatcher.targetoptions["_nrt"] = makes_arrays or counted
    _begun.append(dispatcher)
    try:
        with _in_force():
            _within.append(dispatcher)
            try:
                return as_numba(signature)
            finally:
                _within.pop()
    except Exception:
        if _within:
            raise
        FALLEN_BACK.append(f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__name__}")
        for one in _begun:
            # numba keeps what has failed once
            one._compiler._failed_cache.clear()
            one.targetoptions.pop("_nrt", None)
        return as_numba(signature)
    finally:
        if not _within:
            _begun.clear()


@contextmanager
def _in_force() -> Iterator[None]:
    if _within:
        yield
        return
    with _uncollected(), replaced([*economies(), (compiler.Compiler, "define_pipelines", _pipelines)]) as before:
        _numbas[:] = before
        yield


@contextmanager
def _uncollected() -> Iterator[None]:
    """Nothing of what a compilation makes is garbage before its end, and looking for some takes a tenth of its time."""
    looking = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if looking:
            gc.enable()


def _pipelines(self: Any) -> list[Any]:
    state = self.state
    if not state.flags.no_cpython_wrapper and state.func_id.func is not _within[-1].py_func:
        return list(map(_AsNumba, _USUAL(self)))
    if not state.flags.nrt:
        state.targetctx.cached_internal_func = _UNCOUNTED
    if state.library is None:
        library = CalleeLibrary if state.flags.no_cpython_wrapper else KernelLibrary
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
    usual = _USUAL(self)
    if len(usual) != 1:
        return list(usual)
    short = _Passes(usual[0].pipeline_name)
    numbas = state.func_id.modname.partition(".")[0] == "numba"
    short.passes = usual[0].passes if numbas else _shortened(usual[0].passes)
    short._analysis, short._finalized = usual[0]._analysis, True
    return [short]


def _shortened(passes: list[Any]) -> list[Any]:
    """Without what is not needed; branches that cannot be taken are pruned once."""
    kept: list[Any] = []
    for kind, description in passes:
        again = kind is untyped_passes.DeadBranchPrune and (kind, description) in kept
        if kind not in _UNNEEDED and not again:
            kept.append((kind, description))
    return kept


class _Passes(PassManager):  # type: ignore[misc]
    """A list of passes, run without events and without liveness after each."""

    def run(self, state: Any) -> None:
        """Run the passes on a function."""
        for index, (kind, description) in enumerate(self.passes):
            step = _pass_registry.get(kind).pass_inst
            step.analysis = self._analysis
            try:
                step.run_initialization(state)
                _run(step, state)
                step.run_finalizer(state)
                if kind is typed_passes.NopythonTypeInference and not state.flags.nrt:
                    _refuse_owned_arrays(state)
            except errors.NumbaError as error:
                where = f"Failed in {self.pipeline_name} mode pipeline (step: {description})"
                raise self._patch_error(where, error) from None
            self.exec_times[f"{index}_{step.name()}"] = pass_timings(0.0, 0.0, 0.0)


def _run(step: Any, state: Any) -> None:
    """Run a pass; without counts of references what a kernel calls may give it an array out of its arguments' tuples,
    which numba, looking at the arguments alone, takes for one just made. What makes one is refused when it is lowered.
    """
    try:
        step.run_pass(state)
    except errors.NumbaTypeError as error:
        inferred = isinstance(step, typed_passes.NopythonTypeInference) and isinstance(state.return_type, types.Array)
        callee = state.flags.no_cpython_wrapper and not state.flags.nrt
        if not (inferred and callee and "returning of array" in str(error)):
            raise


class _AsNumba:
    """A list of passes of numba's over what others have written, with counts of references."""

    def __init__(self, passes: Any) -> None:
        self.passes, self.pipeline_name, self.exec_times = passes, passes.pipeline_name, passes.exec_times

    def run(self, state: Any) -> None:
        """Run the passes on a function."""
        state.flags.nrt = ConfigStack().top().nrt = True
        state.targetctx = state.targetctx.subtarget(enable_nrt=True)
        with replaced(_numbas):
            self.passes.run(state)


def _refuse_owned_arrays(state: Any) -> None:
    """Without counts of references nobody would free an array that a kernel gives back to this one, nor keep one that
    this gives back to Python or to a kernel that counts.
    """
    given = [] if state.flags.no_cpython_wrapper else [state.return_type]
    for call, signature in state.calltypes.items():
        calls = isinstance(call, ir.Expr) and call.op == "call"
        if calls and isinstance(state.typemap.get(call.func.name), types.Dispatcher):
            given.append(signature.return_type)
    models = state.targetctx.data_model_manager
    if any(models[kind].contains_nrt_meminfo() for kind in given):
        raise errors.NumbaRuntimeError("this function needs counts of references")
