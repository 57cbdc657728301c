"""Machine code of kernels' files in memory, without numba: by addresses written (`direct_linking`) or by LLVM's linker,
with those parts of numba that are in C.

Those parts are loaded from their files, for importing them by their names would import all of numba; numba finds them
as it would its own when it is imported later.
"""

import builtins
import ctypes
import functools
import hashlib
import os
import pickle
import sys
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, ModuleSpec
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from decomposition import direct_linking
from decomposition.kernel_files import UNREADABLE, called_part, constants_of
from decomposition.kernel_places import numba_folder
from decomposition.processor import described

_PARTS = ("_dispatcher", "_dynfunc", "_helperlib", "core.typeconv._typeconv", "core.runtime._nrt_python")


class InC(NamedTuple):
    """Parts of numba in C: how arguments are told apart, functions of machine code, what that calls."""

    dispatcher: Any
    functions: Any
    helpers: Any
    conversions: Any
    runtime: Any


def _loaded(name: str) -> ModuleType:
    path = str(numba_folder().joinpath(*name.split(".")).with_name(name.rpartition(".")[2] + EXTENSION_SUFFIXES[0]))
    loader = ExtensionFileLoader(f"numba.{name}", path)
    module = module_from_spec(ModuleSpec(f"numba.{name}", loader, origin=path))
    loader.exec_module(module)
    return module


@functools.cache
def in_c() -> InC:
    """The parts in C, while numba is not imported. Raises Exception where they are not as usual."""
    # the first asks for another of them by the name of the package
    package: Any = ModuleType("numba")
    reader: Any = ModuleType("numba.core.serialize")
    reader._numba_unpickle = _read_once
    sys.modules.update({"numba": package, reader.__name__: reader})
    try:
        package._devicearray = sys.modules["numba._devicearray"] = _loaded("_devicearray")
        parts = InC(*map(_loaded, _PARTS))
        # what reads pickled objects, such as classes of results, is asked for with the first, and kept
        nothing = pickle.dumps(None, protocol=4)
        read = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p)
        read(parts.helpers.c_helpers["unpickle"])(nothing, len(nothing), hashlib.sha1(nothing).digest())
        return parts
    finally:
        for name in ("", "._devicearray", ".core.serialize", *(f".{part}" for part in _PARTS)):
            sys.modules.pop(f"numba{name}", None)


_READ: dict[tuple[int, bytes], Any] = {}


def _read_once(address: int, content: bytes, digest: bytes) -> Any:
    """What machine code has pickled at an address."""
    key = address, digest
    if key not in _READ:
        _READ[key] = pickle.loads(content)
    return _READ[key]


def features() -> frozenset[str]:
    """Names of what kernels are compiled for, by which their files are named: not more than the processor can, and less
    where numba is set to compile for others, too.
    """
    generic = os.environ.get("NUMBA_CPU_NAME", "").lower() == "generic"
    set_so = os.environ.get("NUMBA_CPU_FEATURES") or ("" if generic or "NUMBA_CPU_FEATURES" in os.environ else None)
    told = (described()[2] if set_so is None else set_so).split(",")
    without_avx = set_so is None and os.environ.get("NUMBA_ENABLE_AVX") == "0"
    return frozenset(it[1:] for it in told if it[:1] == "+" and not (without_avx and it[1:4] == "avx"))


@functools.cache
def _engine() -> Any:
    """Where LLVM links machine code, set as numba sets its own. As there, it stays to the end."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple, processor, features = described()
    target = llvm.Target.from_triple(triple)
    reloc = "static" if target.name.startswith("x86") else "default"
    machine = target.create_target_machine(
        cpu=processor, features=features, reloc=reloc, codemodel="jitdefault", jit=True
    )
    module = llvm.parse_assembly(f'target triple = "{triple}"\n')
    return llvm.create_mcjit_compiler(module, machine)


@functools.cache
def _offered() -> dict[str, int]:
    """Addresses of what machine code calls in C, by its names there."""
    parts = in_c()
    mine = {f"numba_{name}": at for part in (parts.helpers, parts.functions) for name, at in part.c_helpers.items()}
    errors = {f"PyExc_{it.__name__}": id(it) for it in vars(builtins).values() if _is_error(it)}
    # functions of the C library, which numba takes from there too
    return {**parts.helpers.c_helpers, **mine, **errors, **runtime_helpers(parts.runtime), "_Py_NoneStruct": id(None)}


def _is_error(it: Any) -> bool:
    return isinstance(it, type) and issubclass(it, BaseException)


def runtime_helpers(runtime: Any) -> dict[str, int]:
    """Addresses of what machine code that counts references calls in C, by its names there."""
    named = {name if name.startswith("_") else f"NRT_{name}": address for name, address in runtime.c_helpers.items()}
    if "NRT_MemInfo_data" in named:
        # what numba compiles by that name does the same without a call
        named["NRT_MemInfo_data_fast"] = named["NRT_MemInfo_data"]
    return named


_KNOWN: set[str] = set()


def _find(symbol: str) -> bool:
    """Whether LLVM's linker knows what machine code calls; it would end the process otherwise."""
    import llvmlite.binding as llvm

    if symbol not in _KNOWN:
        address = _offered().get(symbol)
        if address is not None:
            llvm.add_symbol(symbol, address)
        elif not llvm.address_of_symbol(symbol):
            return False
        _KNOWN.add(symbol)
    return True


_ENVIRONMENTS: dict[str, Any] = {}


def _environment(name: str, module: str | None, constants: list[Any]) -> Any:
    """What machine code takes Python's objects from."""
    if name not in _ENVIRONMENTS:
        # what a function without constants looks for is nothing: its module need not be imported for that
        names = vars(import_module(module)) if constants and module else {}
        _ENVIRONMENTS[name] = in_c().functions.Environment(names)
        _ENVIRONMENTS[name].consts[:] = constants
    return _ENVIRONMENTS[name]


def _address_of(symbol: str) -> int | None:
    return _offered().get(symbol) or direct_linking.address_in_process(symbol)


def _linked(code: bytes, needed: list[str], names: list[str]) -> dict[str, int] | None:
    """Addresses of names in machine code, which is in memory from then on; None where something is not known."""
    try:
        found = direct_linking.linked(code, _address_of)
    except OSError:
        found = None
    if found is not None and all(it in found for it in names):
        return found
    import llvmlite.binding as llvm

    # symbols of this process are known to LLVM once there is one
    engine = _engine()
    if not all(map(_find, needed)):
        return None
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    entry, *variables = names
    return {entry: engine.get_function_address(entry)} | {it: engine.get_global_value_address(it) for it in variables}


def function_of(path: Path) -> Any:
    """What Python calls, of a kernel's file; None where there is none or where it is numba's affair."""
    try:
        code, function, environments, needed, alone, *_ = called_part(path)
        module, qualified_name, symbol = function
        if not alone or needed is None:
            return None
        at = _linked(code, needed, [symbol, *(name for name, _, _ in environments)])
        if at is None:
            return None
        kept = [(name, _environment(name, place, constants_of(it))) for name, place, it in environments]
        made = in_c().functions.make_function(
            sys.modules[module],
            qualified_name.rpartition(".")[2],
            f"compiled wrapper for {qualified_name!r}",
            at[symbol],
            kept[0][1],
            (),
        )
    except UNREADABLE:
        return None
    for name, environment in kept:
        ctypes.c_void_p.from_address(at[name]).value = id(environment)
    return made
