"""What HDF5 files state of their data sets, shapes, types and checksums, and what is compared with it."""

import json
from pathlib import Path
from typing import Any

import h5py

from parsolid.checksums import digest
from parsolid.output.errors import OutputError, words


def stated_sums(file: h5py.File) -> dict[str, Any]:
    """What a file says of its data sets. Raises OutputError when that itself is damaged."""
    try:
        own, _, text = file["checksums"][()].partition(b"\n")
        if digest(text).encode() == own:
            stated: dict[str, Any] = json.loads(text)
            return stated
    except Exception as error:  # what h5py raises depends on where the file is torn
        raise damaged(file, "checksums", words(error)) from error
    raise damaged(file, "checksums")


def sound_header(file: h5py.File, stated: dict[str, Any]) -> dict[str, Any]:
    """The header that was written. Raises OutputError when it is another."""
    try:
        text = file["header"][()]
        if digest(text) == stated["header"]:
            header: dict[str, Any] = json.loads(text)
            return header
    except Exception as error:  # what h5py raises depends on where the file is torn
        raise damaged(file, "header", words(error)) from error
    raise damaged(file, "header")


def check_shapes(file: h5py.File, stated: dict[str, Any]) -> None:
    """Raise OutputError unless a file has the data sets, shapes and types that it had when it was written."""
    found: dict[str, Any] = {}

    def note(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = [list(item.shape), item.dtype.str]

    file.visititems(note)
    wanted = {name: entry[:2] for name, entry in stated.items() if name != "header"}
    for name in sorted({*wanted, *found} - {"header", "checksums"}):
        if wanted.get(name) != found.get(name):
            told = f"expected {_kind(wanted.get(name))}, found {_kind(found.get(name))}"
            raise damaged(file, name, told)


def _kind(entry: list[Any] | None) -> str:
    return "none" if entry is None else f"{entry[1]} {tuple(entry[0])}"


def compare(stated: dict[str, Any], found: dict[str, int], path: Path | str) -> None:
    """Raise OutputError unless the checksums of what was read are those that a file states."""
    wrong = [name for name in sorted(found) if stated[name][2] != found[name]]
    if wrong:
        raise OutputError(f"{Path(path).name}: damaged: {', '.join(wrong)} not as written (checksums differ)")


def damaged(file: h5py.File, name: str, told: str = "not as written (checksums differ)") -> OutputError:
    """The error of a data set that is not as it was written."""
    return OutputError(f"{Path(file.filename).name}: damaged: {name}: {told}")
