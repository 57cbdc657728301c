"""Kernels whose machine code comes from files, called without numba: by numba's dispatcher, which is in C.

Where there is no file, or arguments are numba's affair, numba is imported and does what it does.
"""

import functools
import inspect
import os
import threading
from collections.abc import Callable
from typing import Any

from decomposition.argument_kinds import classes_in, kind_of, number_codes
from decomposition.compiled import WAY, ordered
from decomposition.deferred import numba_is_there
from decomposition.kernel_places import note_use, path_of
from decomposition.machine_code import function_of, in_c
from decomposition.processor import described


class _Omitted:
    """An argument that is not given."""

    def __init__(self, value: Any) -> None:
        self.value = value


_IN_C = in_c()
_IN_C.dispatcher.typeof_init(_Omitted, number_codes())
_CONVERSIONS = _IN_C.conversions.new_type_manager()
# between a file's being linked and its machine code's being told where its objects are no other is linked
_LINKING = threading.RLock()


@functools.cache
def _way() -> tuple[Any, ...]:
    """The processor, and how numba is set where nobody has said anything."""
    # `compiled` sees to it that this is a number
    return (*described(), WAY, int(os.environ.get("NUMBA_SLP_VECTORIZE", "0")), 3, None)


class FileKernel(_IN_C.dispatcher.Dispatcher):  # type: ignore[misc, name-defined]
    """A kernel; what it has not itself it has of numba's dispatcher, which is made when it is asked for."""

    _enable_sysmon = False

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        """options: of `numba.njit`."""
        code = function.__code__
        names = code.co_varnames[: code.co_argcount + bool(code.co_flags & inspect.CO_VARARGS)]
        omitted = tuple(map(_Omitted, function.__defaults__ or ()))
        super().__init__(
            _IN_C.conversions.get_pointer(_CONVERSIONS),
            len(names),
            True,
            names,
            omitted,
            False,
            len(names) > code.co_argcount,
            False,
        )
        functools.update_wrapper(self, function)
        self.py_func, self._options = function, options
        # what profilers ask for
        self.__code__ = code
        self.entry_points: dict[tuple[int, ...], Any] = {}

    def typeof_pyval(self, value: Any) -> Any:
        """The type of an argument that the part in C does not know yet."""
        return self.real.typeof_pyval(value) if numba_is_there() else kind_of(value)

    def _compile_for_args(self, *arguments: Any, **keywords: Any) -> Any:
        """What Python calls for arguments of these types, which came for the first time."""
        found = None if keywords or numba_is_there() else self._from_file(arguments)
        return self._by_numba(arguments, keywords) if found is None else found

    def _from_file(self, arguments: tuple[Any, ...]) -> Any:
        kinds = [kind_of(it) for it in arguments]
        names = [kind.name for kind in kinds if kind.name is not None]
        if len(names) < len(kinds):
            return None
        codes = [kind.code for kind in kinds]
        path = path_of(self.py_func, ordered(self._options), names, classes_in(kinds), _way())
        with _LINKING:
            if tuple(codes) in self.entry_points:
                return self.entry_points[tuple(codes)]
            try:
                note_use(path)
            except OSError:
                return None
            found = function_of(path)
            if found is not None:
                self._keep(codes, found)
        return found

    def _by_numba(self, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
        from numba.core.dispatcher import OmittedArg

        real = self.real
        given = [OmittedArg(it.value) if isinstance(it, _Omitted) else it for it in arguments]
        found = real._compile_for_args(*given, **keywords)
        if not any(isinstance(it, _Omitted) for it in arguments):
            self._keep([real.typeof_pyval(it)._code for it in arguments], found)
        return found

    def _keep(self, codes: list[int], found: Any) -> None:
        self._insert(codes, found, False)
        self.entry_points[tuple(codes)] = found

    @functools.cached_property
    def real(self) -> Any:
        """numba's dispatcher."""
        from decomposition.kernel_cache import numba_kernel

        return numba_kernel(self.py_func, self._options)

    @property
    def _numba_type_(self) -> Any:
        """What numba asks of things that it does not know."""
        from numba import typeof

        return typeof(self.real)

    def entry_point(self, arguments: tuple[Any, ...]) -> Any:
        """What a call with such arguments comes to; None where there was no such call."""
        # numba may have come since
        return self.entry_points.get(tuple(self.typeof_pyval(it)._code for it in arguments)) or self.entry_points.get(
            tuple(kind_of(it).code for it in arguments)
        )

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "_numba_type_":
            raise AttributeError(name)
        return getattr(self.real, name)

    def __reduce__(self) -> Any:
        return _named, (self.__module__, self.__qualname__)


def _named(module: str, name: str) -> Any:
    """A kernel that another process has, too."""
    from importlib import import_module
    from operator import attrgetter

    return attrgetter(name)(import_module(module))
