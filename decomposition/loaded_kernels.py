"""Kernels from files in the place of what numba has compiled, once numba is there (see `kernel_files`)."""

import functools
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from llvmlite import binding as llvm
from numba import _dynfunc
from numba.core.compiler import CompileResult
from numba.core.environment import Environment, _rebuild_env
from numba.core.runtime import _nrt_python, rtsys
from numba.core.serialize import dumps

from decomposition.kernel_files import UNREADABLE, Called, called_part, constants_of, linked_part, symbols_of, written
from decomposition.machine_code import runtime_helpers

_EMPTY = Environment({})


def content(result: Any) -> bytes:
    """The content of the file of what numba has compiled."""
    (name, _, (machine_code, bitcode)), description, environment, *rest = result._reduce()
    signature, _, _, annotation, on_loading, environments = rest
    function = description.modname, description.qualname, description.llvm_cpython_wrapper_name
    own = (environment.env_name, environment.globals.get("__name__"), _pickled(environment.consts))
    others = [(it.env_name, it.globals.get("__name__"), _pickled(it.consts)) for it in environments]
    counts, prepared = _counts_references(result.library), dumps(on_loading) if on_loading else b""
    alone = not prepared and counts != "all" and not any(b"numba" in it[2] for it in (own, *others))
    called = Called(machine_code, function, [own, *others], symbols_of(machine_code), alone, prepared, counts)
    return written(called, dumps((name, bitcode, description, signature, annotation)))


def _pickled(constants: list[Any]) -> bytes:
    return dumps(list(constants)) if constants else b""


def _counts_references(library: Any) -> str:
    """What machine code takes from numba's runtime: "" nothing, "C" functions in C, "all" also such as numba compiles
    for itself when it compiles anything.
    """
    called = {it.name for it in library._final_module.functions if it.is_declaration and "nrt_" in it.name.lower()}
    return "all" if called - runtime_helpers(_nrt_python).keys() else "C" if called else ""


@functools.cache
def _offer_c_helpers() -> None:
    for name, address in runtime_helpers(_nrt_python).items():
        llvm.add_symbol(name, address)


class LoadedKernel:
    """A kernel of a file, in the place of numba's result of a compilation; the attributes of that which no call needs
    are read when they are asked for.
    """

    objectmode = False

    def __init__(self, path: Path, target_context: Any, compile_again: Callable[[], Any]) -> None:
        """Load the machine code. Raises one of `UNREADABLE`.

        compile_again: gives numba's result of a compilation, for a file that is gone when more of it is asked for.
        """
        code, function, (own, *self._others), _, _, on_loading, runtime = called_part(path)
        module, qualified_name, symbol = function
        self.environment = _rebuild_env(own[1], constants_of(own[2]), own[0])
        self.reload_init = pickle.loads(on_loading) if on_loading else ()
        for prepare in self.reload_init:
            prepare()
        if runtime == "all":
            rtsys.initialize(target_context)
        elif runtime == "C":
            _offer_c_helpers()
        self.path, self.target_context, self._compile_again = path, target_context, compile_again
        engine = target_context.codegen()._engine._ee
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        self.entry_point = _dynfunc.make_function(
            sys.modules[module],
            qualified_name.rpartition(".")[2],
            f"compiled wrapper for {qualified_name!r}",
            engine.get_function_address(symbol),
            self.environment,
            (),
        )
        target_context.codegen().set_env(self.environment.env_name, self.environment)
        # what a function without constants looks for in its environment is nothing: its module, one of numba's own
        # mostly, need not be imported for that
        self._kept = [_rebuild_env(module, constants_of(it), name) for name, module, it in self._others if it]
        for name, _, constants in self._others:
            if not constants:
                target_context.codegen().set_env(name, _EMPTY)
        self._tell(self._kept)

    def _tell(self, environments: list[Any]) -> None:
        """Tell the machine code where environments are."""
        for environment in environments:
            self.target_context.codegen().set_env(environment.env_name, environment)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "_result":
            raise AttributeError(name)
        if "_result" not in vars(self):
            self._result = self.completed()
            self.target_context.insert_user_function(self.entry_point, self._result.fndesc, [self._result.library])
        return getattr(self._result, name)

    def completed(self) -> Any:
        """What numba's compilation would have given."""
        try:
            name, bitcode, description, signature, annotation = linked_part(self.path)
        except UNREADABLE:
            return self._compile_again()
        # callers keep them in their files
        self._kept = [_rebuild_env(module, constants_of(it), name) for name, module, it in self._others]
        self._tell(self._kept)
        codegen = self.target_context.codegen()
        library = codegen.create_library(name)
        library._shared_module = llvm.parse_bitcode(bitcode)
        library._finalized = library._disable_inspection = True
        codegen._engine._load_defined_symbols(library._shared_module)
        return CompileResult(
            target_context=self.target_context,
            typing_context=self.target_context.typing_context,
            library=library,
            environment=self.environment,
            entry_point=self.entry_point,
            fndesc=description,
            type_annotation=annotation,
            signature=signature,
            objectmode=False,
            lifted=(),
            typing_error=None,
            call_helper=None,
            metadata=None,
            reload_init=self.reload_init,
            referenced_envs=self._kept,
        )
