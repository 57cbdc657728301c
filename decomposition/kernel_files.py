"""What a file of a compiled kernel holds: first what a call from Python needs, the machine code and the name of its
entry point; behind it what the compilation of a caller needs, types and code to link in, read only then.

A call needs no types from the file: they are those of the call, by which the file was found.
"""

import functools
import hashlib
import os
import pickle
import struct
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

# digest and length of the first part, digest and length of the second
_HEAD = struct.Struct("<32sQ32sQ")
_EMPTY = Environment({})
# what errors of a file that cannot be read are, also by a numba that is built otherwise; such a file is as good as none
UNREADABLE = (OSError, EOFError, pickle.UnpicklingError, ValueError, struct.error, AttributeError, TypeError)


def content(result: Any) -> bytes:
    """The content of the file of what numba has compiled."""
    (name, _, (machine_code, bitcode)), description, environment, *rest = result._reduce()
    signature, _, _, annotation, on_loading, environments = rest
    function = description.modname, description.qualname, description.llvm_cpython_wrapper_name
    others = [(it.env_name, it.globals.get("__name__"), list(it.consts)) for it in environments]
    called = dumps((machine_code, function, environment, others, on_loading, _counts_references(result.library)))
    linked = dumps((name, bitcode, description, signature, annotation))
    return b"".join((_HEAD.pack(*_told(called), *_told(linked)), called, linked))


def _c_helpers() -> dict[str, int]:
    """Addresses of what machine code that counts references calls in C, by its names there."""
    helpers = _nrt_python.c_helpers
    named = {name if name.startswith("_") else f"NRT_{name}": address for name, address in helpers.items()}
    if "NRT_MemInfo_data" in named:
        # what numba compiles by that name does the same without a call
        named["NRT_MemInfo_data_fast"] = named["NRT_MemInfo_data"]
    return named


def _counts_references(library: Any) -> str:
    """What machine code takes from numba's runtime: "" nothing, "C" functions in C, "all" also such as numba compiles
    for itself when it compiles anything.
    """
    called = {it.name for it in library._final_module.functions if it.is_declaration and "nrt_" in it.name.lower()}
    return "all" if called - _c_helpers().keys() else "C" if called else ""


@functools.cache
def _offer_c_helpers() -> None:
    for name, address in _c_helpers().items():
        llvm.add_symbol(name, address)


def _told(part: bytes) -> tuple[bytes, int]:
    return hashlib.sha256(part).digest(), len(part)


def _part(path: Path, second: bool) -> Any:
    """One of the two parts of a file. Raises one of `UNREADABLE`."""
    with path.open("rb") as file:
        digest, length, digest_behind, length_behind = _HEAD.unpack(file.read(_HEAD.size))
        if os.fstat(file.fileno()).st_size != _HEAD.size + length + length_behind:
            raise EOFError(path)
        if second:
            file.seek(length, os.SEEK_CUR)
        part = file.read(length_behind if second else length)
    if hashlib.sha256(part).digest() != (digest_behind if second else digest):
        raise ValueError(path)
    return pickle.loads(part)


class LoadedKernel:
    """A kernel of a file, in the place of numba's result of a compilation; the attributes of that which no call needs
    are read when they are asked for.
    """

    objectmode = False

    def __init__(self, path: Path, target_context: Any, compile_again: Callable[[], Any]) -> None:
        """Load the machine code. Raises one of `UNREADABLE`.

        compile_again: gives numba's result of a compilation, for a file that is gone when more of it is asked for.
        """
        code, function, self.environment, self._others, self.reload_init, runtime = _part(path, second=False)
        module, qualified_name, symbol = function
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
        self._kept = [_rebuild_env(module, constants, name) for name, module, constants in self._others if constants]
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
            name, bitcode, description, signature, annotation = _part(self.path, second=True)
        except UNREADABLE:
            return self._compile_again()
        # callers keep them in their files
        self._kept = [_rebuild_env(module, constants, name) for name, module, constants in self._others]
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
