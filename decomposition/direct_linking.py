"""Machine code of a kernel into memory without LLVM, whose library alone takes 45 MB and a twentieth of a second.

numba compiles with addresses of 64 bits everywhere, so that an ELF file for x86-64 asks for nothing but such addresses
to be written. What asks for anything else is left to LLVM. Sections: https://refspecs.linuxfoundation.org/elf/gabi4+.
"""

import ctypes
import functools
import mmap
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

# an ELF file of 64 bits, low byte first, relocatable, of x86-64
_HEAD = struct.pack("<4s5B7xHH", b"\x7fELF", 2, 1, 1, 0, 0, 1, 62)
_CONTENT, _SYMBOLS, _ADDRESSES, _ZEROS, _UNWIND = 1, 2, 4, 8, 0x70000001
# besides nothing, names and notes
_KNOWN = (0, _CONTENT, _SYMBOLS, 3, _ADDRESSES, 7, _ZEROS, _UNWIND)
_IN_MEMORY, _EXECUTABLE, _OF_THREADS = 2, 4, 0x400
_UNDEFINED, _ABSOLUTE, _COMMON = 0, 0xFFF1, (0xFFF2, 0xFF02)
# the one kind of address that is known: a symbol's and a number, in 64 bits
_SYMBOL_AND_NUMBER = 1
_PRIVATE = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS


class _Section(NamedTuple):
    name: int
    kind: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    of: int
    alignment: int
    entry: int

    @property
    def placed(self) -> bool:
        """Whether it is wanted in memory; tables for debuggers are not."""
        return bool(self.flags & _IN_MEMORY) and self.kind != _UNWIND


class _Symbol(NamedTuple):
    name: int
    about: int
    visibility: int
    section: int
    value: int
    size: int


@functools.cache
def process() -> Any:
    """Functions of the C library and of Python."""
    return ctypes.CDLL(None, use_errno=True)


def address_in_process(symbol: str) -> int | None:
    """Of a function of the C library or of Python; None of what is neither."""
    try:
        return ctypes.cast(getattr(process(), symbol), ctypes.c_void_p).value
    except AttributeError:
        return None


def reserved(size: int) -> int:
    """The address of so many bytes, which stay to the end. Raises OSError."""
    ask = process().mmap
    ask.restype, ask.argtypes = ctypes.c_void_p, (ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long)
    found = ask(None, size, mmap.PROT_READ | mmap.PROT_WRITE, _PRIVATE, -1, 0)
    if found in (None, ctypes.c_void_p(-1).value):
        raise OSError(ctypes.get_errno(), "no memory for machine code")
    return int(found)


def executable(address: int, size: int) -> None:
    """Let bytes be run, and written no more. Raises OSError where the system forbids it."""
    allow = process().mprotect
    allow.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
    if allow(address, size, mmap.PROT_READ | mmap.PROT_EXEC):
        raise OSError(ctypes.get_errno(), "no machine code may be made here")


def linked(code: bytes, address_of: Callable[[str], int | None]) -> dict[str, int] | None:
    """Addresses of what an object file defines, which is in memory from then on; None where LLVM has to do it.

    address_of: of what it takes from elsewhere, None of what is not known. Raises OSError, struct.error and ValueError
    of a file that cannot be read or run.
    """
    if code[: len(_HEAD)] != _HEAD:
        return None
    (table,), (count,) = struct.unpack_from("<Q", code, 40), struct.unpack_from("<H", code, 60)
    sections = [_Section(*struct.unpack_from("<IIQQQQIIQQ", code, table + 64 * k)) for k in range(count)]
    kinds = {it.kind for it in sections if it.placed}
    tables = [it for it in sections if it.kind == _SYMBOLS]
    if kinds - {_CONTENT, _ZEROS} or any(it.flags & _OF_THREADS for it in sections) or len(tables) != 1:
        return None
    symbols = [_Symbol(*it) for it in struct.iter_unpack("<IBBHQQ", _bytes(code, tables[0]))]
    places, variables, rest, length = _laid_out(sections, symbols)
    base = reserved(length)
    image = bytearray(length)
    for k, place in places.items():
        if sections[k].kind == _CONTENT:
            image[place : place + sections[k].size] = _bytes(code, sections[k])
    starts = {k: base + place for k, place in places.items()} | {_ABSOLUTE: 0}
    names = sections[tables[0].link].offset
    addresses: list[int | None] = []
    defined: dict[str, int] = {}
    for k, symbol in enumerate(symbols):
        name = code[names + symbol.name : code.index(b"\0", names + symbol.name)].decode()
        if symbol.section == _UNDEFINED:
            addresses.append(address_of(name) if name else None)
            continue
        start = base if k in variables else starts.get(symbol.section)
        addresses.append(None if start is None else start + variables.get(k, symbol.value))
        # those that are not for others have a 0 in the upper half
        if symbol.about >> 4 and addresses[-1] is not None:
            defined[name] = addresses[-1]
    for section in sections:
        if section.kind == _ADDRESSES and section.of in places:
            for offset, about, number in struct.iter_unpack("<QQq", _bytes(code, section)):
                address = addresses[about >> 32]
                if about & 0xFFFFFFFF != _SYMBOL_AND_NUMBER or address is None:
                    return None
                struct.pack_into("<Q", image, places[section.of] + offset, address + number)
        elif section.kind not in _KNOWN:
            return None
    ctypes.memmove(base, bytes(image), length)
    executable(base, rest)
    return defined


def _bytes(code: bytes, section: _Section) -> bytes:
    return code[section.offset : section.offset + section.size]


def _laid_out(sections: list[_Section], symbols: list[_Symbol]) -> tuple[dict[int, int], dict[int, int], int, int]:
    """Where sections start, and variables in none of them; where what is not run starts, on its own page, and ends."""
    places: dict[int, int] = {}
    ends = []
    end = 0
    for runs in (True, False):
        for k, section in enumerate(sections):
            if section.placed and section.size and bool(section.flags & _EXECUTABLE) == runs:
                places[k] = _up(end, section.alignment)
                end = places[k] + section.size
        ends.append(end := _up(end, mmap.PAGESIZE))
    variables = {}
    for k, symbol in enumerate(symbols):
        if symbol.section in _COMMON:
            # the value is the alignment
            variables[k] = _up(end, symbol.value)
            end = variables[k] + symbol.size
    return places, variables, ends[0], _up(end, mmap.PAGESIZE)


def _up(place: int, alignment: int) -> int:
    return -(-place // max(alignment, 1)) * max(alignment, 1)
