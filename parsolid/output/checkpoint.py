"""Checkpoints: everything a run needs to go on, in one HDF5 file that is whole at every instant.

Layout (format version 4):

    /                      attributes format, version, complete (1 once everything is on the disk)
    /header                JSON text: what is not an array
    /checksums             a digest of the rest of this text, a line's end, JSON: data set -> shape, type, checksum
    /particles/<field>     (N,) or (N, c), contiguous, the ranks' particles one rank after the other
    /ranks/offset          (ranks + 1,) int64: rank r wrote rows offset[r] to offset[r + 1]
    /particles_1/<field>, /ranks/offset_1 and so on, of further systems of particles
    /ranks/values          (ranks, k) float64: what each rank keeps for itself
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from mpi4py import MPI

from parsolid.checksums import added, digest, sum_of_rows
from parsolid.output.errors import OutputError, together, words
from parsolid.output.slabs import CHECKED_VERSIONS, SlabWriter, create_slab, flush_to_disk, open_serial, places, probe


def stated_sums(file: h5py.File) -> dict[str, Any]:
    """Shape, type and checksum of each data set, as stated in the file. Raises OutputError where this is damaged."""
    try:
        own, _, text = file["checksums"][()].partition(b"\n")
        if digest(text).encode() == own:
            stated: dict[str, Any] = json.loads(text)
            return stated
    except Exception as error:  # what h5py raises depends on where the file is torn
        raise damaged(file, "checksums", words(error)) from error
    raise damaged(file, "checksums")


def sound_header(file: h5py.File, stated: dict[str, Any]) -> dict[str, Any]:
    """The header of a file. Raises OutputError when it is damaged."""
    try:
        text = file["header"][()]
        if digest(text) == stated["header"]:
            header: dict[str, Any] = json.loads(text)
            return header
    except Exception as error:  # what h5py raises depends on where the file is torn
        raise damaged(file, "header", words(error)) from error
    raise damaged(file, "header")


def _kind(entry: list[Any] | None) -> str:
    return "none" if entry is None else f"{entry[1]} {tuple(entry[0])}"


def compare(stated: dict[str, Any], found: dict[str, int], path: Path | str) -> None:
    """Raise OutputError unless the checksums found are those stated in the file."""
    wrong = [name for name in sorted(found) if stated[name][2] != found[name]]
    if wrong:
        raise OutputError(f"{Path(path).name}: damaged: {', '.join(wrong)} not as written (checksums differ)")


def damaged(file: h5py.File, name: str, fault: str = "not as written (checksums differ)") -> OutputError:
    """The error of a damaged data set."""
    return OutputError(f"{Path(file.filename).name}: damaged: {name}: {fault}")


FORMAT = "parsolid checkpoint"
VERSION = 4
DEFAULT_NAME = "checkpoint.h5"
Header = dict[str, Any]
Fields = dict[str, np.ndarray]
Sums = dict[str, int]
_KINDS = ("float64", "int64", "int32", "uint8")


def previous_name(path: Path | str) -> Path:
    """The last checkpoint but one: checkpoint.h5 -> checkpoint.previous.h5."""
    path = Path(path)
    return path.with_name(f"{path.stem}.previous{path.suffix}")


def partial_name(path: Path | str) -> Path:
    """The checkpoint being written: checkpoint.h5 -> checkpoint.h5.partial."""
    path = Path(path)
    return path.with_name(path.name + ".partial")


def numbered(name: str, system: int) -> str:
    """A name of what belongs to a system: particles, particles_1, particles_2..."""
    return f"{name}_{system}" if system else name


def write_checkpoint(
    comm: MPI.Intracomm,
    path: Path | str,
    header: Header,
    systems: Sequence[Fields],
    per_rank: np.ndarray | None = None,
) -> None:
    """Write a checkpoint beside the last one, then put it in its place; the last two are kept. Collective.

    header: anything JSON can hold (numpy scalars and arrays too), the same on all ranks; rank 0's is written.
    systems: of each name -> this rank's rows (n,) or (n, c), any strides, float64, int64, int32 or uint8; the same
    names, types and c on all ranks. per_rank: (k,) float64 of this rank, k the same on all ranks.
    Killed at any instant, a whole checkpoint remains (`find_checkpoint`).

    Raises OutputError on all ranks; the last checkpoint is then untouched.
    """
    path = Path(path)
    partial = partial_name(path)
    doing = f"cannot write the checkpoint {path}"
    values = np.empty(0) if per_rank is None else np.asarray(per_rank, float)
    rows = np.array([_row_count(comm, fields, values, doing) for fields in systems], np.int64)
    of_ranks, offsets = np.empty((comm.size, len(rows)), np.int64), np.zeros((len(rows), comm.size + 1), np.int64)
    comm.Allgather(rows, of_ranks)
    offsets[:, 1:] = np.cumsum(of_ranks, axis=0).T
    sums = _sums(comm, systems, offsets, values)
    laid = None
    with together(comm, doing):
        if comm.rank == 0:
            _finish_interrupted(path)
            _lay_out(partial, header, systems, offsets, len(values), sums)
            laid = places(partial)
    laid = comm.bcast(laid)
    with SlabWriter(comm, partial, laid) as writer:
        for number, fields in enumerate(systems):
            for name, array in fields.items():
                writer.write(f"{numbered('particles', number)}/{name}", int(offsets[number, comm.rank]), array)
        writer.write("ranks/values", comm.rank, values[np.newaxis])
    with together(comm, doing):
        if comm.rank == 0:
            # the numbers are on the disk already (SlabWriter), so the mark cannot get there before them
            with open_serial(partial, "r+") as file:
                file.attrs.modify("complete", 1)
            flush_to_disk(partial)
            _put_in_place(path)


def read_checkpoint(comm: MPI.Intracomm, path: Path | str) -> tuple[Header, list[Fields], np.ndarray]:
    """Read a checkpoint and compare all of it with its checksums: header, fields of each system, per-rank rows.

    Collective. On as many ranks as wrote it, every rank gets the rows that it wrote, in the same order; on another
    number, even contiguous shares (to be partitioned anew). fields: name -> (n,) or (n, c), C-contiguous.
    per-rank rows: (ranks that wrote, k) float64, all of them on every rank.

    Raises OutputError on all ranks for a file that is not whole or in which anything is not as it was written.
    """
    while True:
        before = _identity(comm, path)
        try:
            return _read(comm, path)
        except OutputError:
            # a run that goes on may have put its next checkpoint there while some ranks read this one
            if _identity(comm, path) == before:
                raise


def _identity(comm: MPI.Intracomm, path: Path | str) -> Any:
    """Identity of a file, which differs after another file has taken its place; collective."""
    found = None
    if comm.rank == 0 and os.path.exists(path):
        state = os.stat(path)
        found = state.st_ino, state.st_mtime_ns
    return comm.bcast(found)


def _read(comm: MPI.Intracomm, path: Path | str) -> tuple[Header, list[Fields], np.ndarray]:
    layout = None
    doing = f"cannot read the checkpoint {path}"
    with together(comm, doing):
        if comm.rank == 0:
            with _open_whole(path) as file:
                stated = stated_sums(file)
                # the data sets, shapes and types that it had when it was written
                found: dict[str, Any] = {}

                def note(name: str, item: object) -> None:
                    if isinstance(item, h5py.Dataset):
                        found[name] = [list(item.shape), item.dtype.str]

                file.visititems(note)
                wanted = {name: entry[:2] for name, entry in stated.items() if name != "header"}
                for name in sorted({*wanted, *found} - {"header", "checksums"}):
                    if wanted.get(name) != found.get(name):
                        fault = f"expected {_kind(wanted.get(name))}, found {_kind(found.get(name))}"
                        raise damaged(file, name, fault)
                offsets, ranks = list[np.ndarray](), file["ranks"]
                while (name := numbered("offset", len(offsets))) in ranks:
                    offsets.append(ranks[name][()])
                layout = sound_header(file, stated), offsets, file["ranks/values"][()], stated
    header, offsets, values, stated = comm.bcast(layout)
    sums = {"ranks/values": _part(comm, values, 0)}
    sums |= {f"ranks/{numbered('offset', i)}": _part(comm, offset, 0) for i, offset in enumerate(offsets)}
    systems: list[Fields] = []
    with together(comm, doing), open_serial(path, "r") as file:
        for number, offset in enumerate(offsets):
            if len(offset) - 1 != comm.size:
                offset = np.array([offset[-1] * rank // comm.size for rank in range(comm.size + 1)])
            first, last = (int(end) for end in offset[comm.rank : comm.rank + 2])
            group = numbered("particles", number)
            systems.append({name: rows[first:last] for name, rows in file[group].items()})
            sums |= {f"{group}/{name}": sum_of_rows(rows, first) for name, rows in systems[-1].items()}
    compare(stated, added(comm, sums), path)
    return header, systems, values


def find_checkpoint(directory: Path | str, comm: MPI.Intracomm | None = None) -> Path:
    """The newest whole checkpoint of a directory. With comm collective, else for one rank alone.

    Raises OutputError (on all ranks) with the fault of each candidate, or where there is none.
    """
    if comm is None:
        return _find(Path(directory))
    found = Path()
    with together(comm, f"cannot look for a checkpoint in {directory}"):
        if comm.rank == 0:
            found = _find(Path(directory))
    return Path(comm.bcast(found))


def _find(directory: Path) -> Path:
    path = directory / DEFAULT_NAME
    candidates, reasons = (partial_name(path), path, previous_name(path)), []
    if not any(candidate.exists() for candidate in candidates):
        found = "the run there ended before its first, or has none" if directory.is_dir() else "there is no such folder"
        todo = "start it without --restart, or name another folder with -o or a file with --restart FILE"
        raise OutputError(f"no checkpoint was written yet in {directory}: {found}; {todo}")
    # a whole partial file is newer than both: the run was killed between the two renames or just before
    for candidate in candidates:
        try:
            _open_whole(candidate).close()
        except OutputError as error:
            reasons.append(str(error))
        else:
            return candidate
    raise OutputError(f"no whole checkpoint in {directory}: " + "; ".join(reasons))


def _open_whole(path: Path | str) -> h5py.File:
    path = Path(path)
    if not path.exists():
        raise OutputError(f"{path.name}: does not exist")
    try:
        file = open_serial(path, "r")
        try:
            found, version, complete = (file.attrs.get(name) for name in ("format", "version", "complete"))
            found = found.decode() if isinstance(found, bytes) else found
        except BaseException:
            # HDF5 would return the same damaged file to the next open
            file.close()
            raise
    except Exception as error:  # what h5py raises depends on where the file is torn
        raise OutputError(f"{path.name}: not a whole HDF5 file ({words(error)})") from error
    if found != FORMAT:
        fault = f"not a checkpoint (format: expected {FORMAT!r}, found {found!r})"
    elif version != VERSION:
        fault = f"written by another parsolid (version: expected {VERSION}, found {version})"
    elif complete != 1:
        fault = "not written to its end"
    else:
        return file
    file.close()
    raise OutputError(f"{path.name}: {fault}")


def _row_count(comm: MPI.Intracomm, fields: Fields, values: np.ndarray, doing: str) -> int:
    """This rank's number of rows; checks that the arrays fit together on and across ranks."""
    signature = [(name, array.shape[1:], array.dtype.name) for name, array in fields.items()] + [values.shape]
    expected = comm.bcast(signature)
    counts = {len(array) for array in fields.values()}
    with together(comm, doing):
        if not fields:
            raise ValueError("fields: expected at least one, found none")
        if len(counts) > 1:
            raise ValueError(f"fields: expected equal lengths, found {sorted(counts)}")
        unknown = {array.dtype.name for array in fields.values()} - set(_KINDS)
        if unknown:
            raise ValueError(f"fields: expected {', '.join(_KINDS)}, found {', '.join(sorted(unknown))}")
        if values.ndim != 1:
            raise ValueError(f"per_rank: expected shape (k,), found {values.shape}")
        if signature != expected:
            raise ValueError(f"fields differ from those of rank 0: expected {expected}, found {signature}")
    return counts.pop()


def _lay_out(
    partial: Path, header: Header, systems: Sequence[Fields], offsets: np.ndarray, values: int, sums: Sums
) -> None:
    text = json.dumps(header, default=_plain).encode()
    stated = _text_of_sums(text, systems, offsets, values, sums)
    size = len(text) + len(stated) + 8 * offsets.size + 8 * offsets.shape[1] * values
    for fields, rows in zip(systems, offsets[:, -1]):
        size += int(rows) * sum(array.dtype.itemsize * int(np.prod(array.shape[1:])) for array in fields.values())
    probe(partial, size)
    # with checksums of HDF5's metadata: without them HDF5 has crashed on damaged ones
    with open_serial(partial, "w", CHECKED_VERSIONS) as file:
        # of fixed length, since the heap of variable lengths has no checksum
        file.attrs.create("format", FORMAT, dtype=h5py.string_dtype("ascii", len(FORMAT)))
        file.attrs["version"] = VERSION
        file.attrs["complete"] = 0
        for name, content in (("header", text), ("checksums", stated)):
            file.create_dataset(name, data=content, dtype=h5py.string_dtype("utf-8", len(content)))
        for number, (fields, rows) in enumerate(zip(systems, offsets[:, -1])):
            particles = file.create_group(numbered("particles", number))
            for name, array in fields.items():
                create_slab(particles, name, (int(rows), *array.shape[1:]), array.dtype)
        ranks = file.create_group("ranks")
        for number, offset in enumerate(offsets):
            ranks[numbered("offset", number)] = offset
        create_slab(ranks, "values", (offsets.shape[1] - 1, values), np.float64)


def _sums(comm: MPI.Intracomm, systems: Sequence[Fields], offsets: np.ndarray, values: np.ndarray) -> Sums:
    """Checksum of every array over all ranks; collective."""
    sums = {"ranks/values": sum_of_rows(values[np.newaxis], comm.rank)}
    for number, (fields, offset) in enumerate(zip(systems, offsets)):
        sums[f"ranks/{numbered('offset', number)}"] = _part(comm, offset, 0)
        group, first = numbered("particles", number), int(offset[comm.rank])
        sums |= {f"{group}/{name}": sum_of_rows(array, first) for name, array in fields.items()}
    return added(comm, sums)


def _part(comm: MPI.Intracomm, rows: np.ndarray, first_row: int) -> int:
    """Checksum of an array that all ranks have, on rank 0, 0 elsewhere."""
    return sum_of_rows(rows, first_row) if comm.rank == 0 else 0


def _text_of_sums(header: bytes, systems: Sequence[Fields], offsets: np.ndarray, values: int, sums: Sums) -> bytes:
    """The content of /checksums."""
    kinds: dict[str, tuple[tuple[int, ...], str]] = {"ranks/values": ((offsets.shape[1] - 1, values), "<f8")}
    for number, (fields, offset) in enumerate(zip(systems, offsets)):
        kinds[f"ranks/{numbered('offset', number)}"] = offset.shape, "<i8"
        for name, array in fields.items():
            kinds[f"{numbered('particles', number)}/{name}"] = (int(offset[-1]), *array.shape[1:]), array.dtype.str
    entries: dict[str, Any] = {name: [*kind, sums[name]] for name, kind in kinds.items()}
    text = json.dumps(entries | {"header": digest(header)}).encode()
    return digest(text).encode() + b"\n" + text


def _plain(value: object) -> object:
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"header: expected what JSON can hold, found {type(value).__name__}")


def _put_in_place(path: Path) -> None:
    if path.exists():
        os.replace(path, previous_name(path))
    os.replace(partial_name(path), path)
    flush_to_disk(path.parent)


def _finish_interrupted(path: Path) -> None:
    """Complete the renames of a run that was killed between them, before the partial file is overwritten."""
    try:
        _open_whole(partial_name(path)).close()
    except OutputError:
        return
    _put_in_place(path)
