"""Libraries of machine code of which only kernels' are optimised and assembled.

numba makes a complete library of every function that a kernel calls: optimised, assembled, and then linked into the
caller, where it is inlined and all of it done again. Nothing calls those functions but kernels. Here a callee stays as
it was lowered until a kernel is finished, which links in all that it reaches, each once, and optimises the whole.
A library of numba's own that wants a callee (a user's `njit` function) gets it finished as numba would have.
"""

from collections.abc import Iterable
from typing import Any

from llvmlite.binding import Linkage
from numba.core.codegen import JITCodeLibrary


class KernelLibrary(JITCodeLibrary):  # type: ignore[misc]
    """A function called from Python, with all that it calls."""

    def add_llvm_module(self, ll_module: Any) -> None:
        """Add a module; it is optimised with the others, when the library is finished."""
        ll_module.data_layout = self._codegen._data_layout
        self._final_module.link_in(ll_module)

    def add_linking_library(self, library: Any) -> None:
        """Note a callee; one of ours needs no finish."""
        if not isinstance(library, CalleeLibrary):
            library._ensure_finalized()
        self._linking_libraries.append(library)

    def finalize(self) -> None:
        """Link, optimise and assemble."""
        self._codegen._check_llvm_bugs()
        self._raise_if_finalized()
        callees = _reached(self._linking_libraries)
        for library in callees:
            if hasattr(library, "_reload_init"):
                # numba 0.61 has none
                self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._optimize_final_module()
        self._finalize_final_module()
        for library in callees:
            if isinstance(library, CalleeLibrary):
                library.settle_environments()


class CalleeLibrary(KernelLibrary):
    """A function that only compiled functions call: as it was lowered, until a library of numba's asks for more."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self.environments: dict[str, Any] = {}
        self._exported: list[Any] | None = None

    @property
    def codegen(self) -> Any:
        """numba's, but for the environments, which have no address yet."""
        return _LateEnvironments(self)

    def get_pointer_to_function(self, name: str) -> int:
        """Null: there is no entry from Python."""
        return int(super().get_pointer_to_function(name)) if self._finalized else 0

    def finalize(self) -> None:
        """Finish it as numba does, for a library of numba's own."""
        for function in self._exported or ():
            function.linkage = "external"
        super().finalize()
        self.settle_environments()

    def settle_environments(self) -> None:
        """Tell the machine code that has been assembled where the environments are."""
        for name, environment in self.environments.items():
            if self._codegen._engine.is_symbol_defined(name):
                self._codegen.set_env(name, environment)

    def _get_module_for_linking(self) -> Any:
        if self._finalized:
            return super()._get_module_for_linking()
        if self._exported is None:
            functions = self._final_module.functions
            self._exported = [f for f in functions if not f.is_declaration and f.linkage == Linkage.external]
            for function in self._exported:
                # as numba marks what is linked into several libraries
                function.linkage = "linkonce_odr"
        return self._final_module


class _LateEnvironments:
    def __init__(self, library: CalleeLibrary) -> None:
        self._library = library

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Keep an environment until there is an address for it."""
        self._library.environments[name] = environment


def _reached(libraries: Iterable[Any]) -> list[Any]:
    """Libraries and those that unfinished ones call, directly or not, each once."""
    found: dict[Any, None] = {}
    waiting = list(libraries)
    while waiting:
        library = waiting.pop(0)
        if library not in found:
            found[library] = None
            if isinstance(library, CalleeLibrary):
                waiting += library._linking_libraries
    return list(found)
