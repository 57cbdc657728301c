"""Fields of the particles over time, in fields.vtkhdf, which ParaView opens as it is.

Rows are ordered by the particles' identifiers, so that a particle keeps its row from step to step and the file does
not depend on the number of ranks. To that end ranks exchange rows; none ever has more than its even share.

Checksums of a step's data sets are in fields.sums beside it, a line a step: a damaged number is found where it is read,
by results and pictures, and by a run that starts from them. Of several systems each has a file, and one shows them all
as the blocks of a temporal collection (VTKHDF specification, version 2.2, "Partitioned dataset collection"); readers
take the times from the first block, which is therefore written last.
"""

import json
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from mpi4py import MPI

from decomposition.migration import migrate
from decomposition.reduction import sums
from decomposition.slices import Slices
from parsolid.checksums import added, sum_of_rows
from parsolid.collective import maximum, minimum
from parsolid.output import vtkhdf
from parsolid.output.errors import OutputError, agree, together, words
from parsolid.output.run_folder import next_free
from parsolid.output.slabs import DataSet, SlabWriter, open_serial, places, probe
from parsolid.scene.previous_results import STATE


def sums_path(path: Path) -> Path:
    """The file of checksums of a file of fields."""
    return path.with_suffix(".sums")


def check_step(path: Path, step: int, count: int) -> None:
    """Compare all of a step of a file of fields, count rows a data set, with its checksums; for one rank alone.

    Raises OutputError where it is damaged.
    """
    lines = _lines(path) or []
    try:
        names = [json.loads(line)["sums"] for line in (*lines[:1], *lines[step : step + 1])]
        with h5py.File(path, "r", locking=False) as file:
            for name in names[-1] if names else ():
                rows_of_step(file, path, name, step, count)
            for name in set(names[0]) - set(names[-1]) if names else ():
                rows_of_step(file, path, name, step, count, constant=True)
    except (OSError, ValueError, KeyError) as error:
        raise OutputError(f"{path}: damaged: {words(error)}") from error


def rows_of_step(file: Any, path: Path, name: str, step: int, count: int, constant: bool = False) -> np.ndarray:
    """Rows (count, ...) of a data set of an open file of fields, "VTKHDF/Points" and the like, at a step; constant: the
    same at every step. Raises OutputError where they are not as they were written.
    """
    first = 0 if constant else step * count
    try:
        rows: np.ndarray = file[name][first : first + count]
    except OSError as error:
        raise OutputError(f"{path}: damaged: {name}: {words(error)}") from error
    lines = _lines(path)
    if lines is None or (0 if constant else step) >= len(lines):
        return rows
    try:
        stated = json.loads(lines[0 if constant else step])["sums"].get(name)
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise OutputError(f"{sums_path(path)}: damaged: line {step + 1} is no checksum") from error
    if stated is not None and stated != sum_of_rows(rows, 0):
        raise OutputError(f"{path}: damaged: {name} at step {step} is not as it was written (checksums differ)")
    return rows


def _lines(path: Path) -> list[str] | None:
    """The whole lines of the checksums; None without any."""
    try:
        text = sums_path(path).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    return text[: text.rfind("\n") + 1].splitlines()


def numbers_of(comm: MPI.Intracomm, identifier: np.ndarray) -> np.ndarray:
    """0 to m - 1 (k,) for m particles of all ranks, rising with their identifiers (k,); collective."""
    largest = np.array(identifier.max(initial=-1), np.int64)
    comm.Allreduce(MPI.IN_PLACE, largest, op=MPI.MAX)
    owner = identifier * comm.size // (int(largest) + 1) if largest >= 0 else identifier
    mine = np.arange(len(identifier))
    there = migrate(comm, owner, {"identifier": identifier, "rank": np.full(len(mine), comm.rank), "row": mine})
    order = np.argsort(there["identifier"], kind="stable")
    first = comm.exscan(len(order)) or 0
    numbers = np.empty(len(order), np.int64)
    numbers[order] = first + np.arange(len(order))
    back = migrate(comm, there["rank"], {"row": there["row"], "number": numbers})
    result = np.empty(len(mine), np.int64)
    result[back["row"]] = back["number"]
    return result


Fields = dict[str, np.ndarray]


class FieldSeries:
    """Writes steps to a VTKHDF file, which is readable, with all complete steps, at every instant.

    Parameters: comm; path; capacity, how many steps are to come (space is taken as they are written);
    resume_at, a time [s]: go on with the file at path, keeping its steps up to and including that time, if it is
    whole and holds the same fields of as many particles, else None; double, write floating-point fields with 8
    bytes instead of 4 (positions, a state and the displacement beside one always have 8); index, of a block its place
    among others.

    A file that is gone on with and has too little room gives its steps to one that has. A file that is at path and is
    not gone on with, or is full, is renamed to the next free of fields.1.vtkhdf, fields.2.vtkhdf and so on.
    Checkpoints must be written after the fields of the same time, not before.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        path: Path | str,
        capacity: int,
        resume_at: float | None = None,
        double: bool = False,
        index: int | None = None,
    ):
        if capacity < 1:
            raise ValueError(f"capacity: expected at least 1, found {capacity}")
        self._comm = comm
        self.path = Path(path)
        self._capacity = capacity
        self._resume_at = resume_at
        self._floats = np.float64 if double else np.float32
        self._exact: set[str] = set()
        self._index = index
        # known after the first write
        self._layout: Any = None
        self._places: dict[str, DataSet] = {}
        self._times = np.empty(0)

    @property
    def times(self) -> np.ndarray:
        """Times of the steps in the file [s]; known after the first `write`."""
        return self._times

    def write(
        self,
        time: float,
        identifier: np.ndarray,
        position: np.ndarray,
        varying: Fields,
        constant: Fields | None = None,
    ) -> None:
        """Add a step at a time [s] later than the last; at the time of the last it does nothing. Collective.

        identifier (n,): the particles 0 to N - 1, each on one rank; position (n, d) [m]. varying, constant: name ->
        (n,) scalars, (n, d) vectors, (n, d, d) or (n, 4) (2-D) or (n, 9) tensors by rows, or any (n, c); plane ones are
        padded with zeros to 3-D. constant fields are written with a file's first step only. All strides will do.

        Raises OutputError on all ranks; the steps before remain readable.
        """
        constant = constant or {}
        self._exact = exact_names(varying)
        if self._layout is None:
            kinds = [
                {
                    name: (_in_space(values).shape[1:], self._shown(values[:0], name).dtype.name)
                    for name, values in fields.items()
                }
                for fields in (varying, constant)
            ]
            wrong = [name for name in (*varying, *constant) if "/" in name or name in (".", "")]
            twice = set(varying) & set(constant)
            if wrong or twice:
                raise ValueError(
                    f"fields: expected distinct names without '/', found {', '.join(sorted({*wrong, *twice}))}"
                )
            particles = self._comm.allreduce(len(identifier))
            self._layout = vtkhdf.Layout(particles, self._capacity, *kinds)
            if not self._resume():
                self._start_new_file()
        if set(varying) != set(self._layout.varying):
            raise OutputError(
                f"{self.path}: expected the fields {sorted(self._layout.varying)}, found {sorted(varying)}"
            )
        if len(self._times) and time <= self._times[-1]:
            if time == self._times[-1]:
                return
            raise OutputError(f"{self.path}: expected a time after {self._times[-1]:.9g} s, found {time:.9g} s")
        rows = _ByIdentifier(self._comm, identifier, self._layout.particles)
        if len(self._times) == self._layout.capacity:
            self._start_new_file()
        step = len(self._times) * self._layout.particles + rows.first
        sums: dict[str, int] = {}
        with SlabWriter(self._comm, self.path, self._places) as writer:
            self._write_rows(writer, "VTKHDF/Points", step, rows, _in_space(position), sums)
            for name, values in varying.items():
                self._write_rows(writer, f"VTKHDF/PointData/{name}", step, rows, self._shown(values, name), sums)
            if len(self._times) == 0:
                for name in self._layout.constant:
                    values = self._shown(constant[name], name)
                    self._write_rows(writer, f"VTKHDF/PointData/{name}", rows.first, rows, values, sums)
                # the point of each cell, and where its points begin, counted within its part
                for name, period in (("Connectivity", vtkhdf.PART), ("Offsets", vtkhdf.PART + 1)):
                    total = self._places[f"VTKHDF/Vertices/{name}"].shape[0]
                    share = Slices(self._comm, total)
                    writer.write(f"VTKHDF/Vertices/{name}", share.first, np.arange(share.first, share.last) % period)
        sums = added(self._comm, sums)
        with together(self._comm, f"cannot write {sums_path(self.path)}"):
            if self._comm.rank == 0:
                # before the step is shown: a step that is, has its checksums; they follow those of earlier steps, of
                # which some may be without, and later ones are written anew
                step, path, lines = len(self._times), sums_path(self.path), _lines(self.path) or []
                if len(lines) > step:
                    partial = path.with_name(path.name + ".partial")
                    partial.write_text("".join(f"{line}\n" for line in lines[:step]), encoding="utf-8")
                    os.replace(partial, path)
                if len(lines) >= step:
                    with open(path, "a", encoding="utf-8") as file:
                        file.write(json.dumps({"time": time, "sums": sums}) + "\n")
        self._publish(np.append(self._times, time))

    def _write_rows(
        self, writer: SlabWriter, name: str, first: int, rows: "_ByIdentifier", values: np.ndarray, sums: dict[str, int]
    ) -> None:
        """Rows of a data set from `first` on; their part of its checksum into `sums`."""
        arranged = np.ascontiguousarray(rows.arrange(values), self._places[name].dtype)
        writer.write(name, first, arranged)
        sums[name] = sum_of_rows(arranged, rows.first)

    def _resume(self) -> bool:
        """Append to the file at path where it is whole and has the same layout; returns whether it is."""
        found = None
        if self._comm.rank == 0 and self._resume_at is not None:
            try:
                layout, times = vtkhdf.published(self.path)
                if layout.like(self._layout):
                    found = layout, times[times <= self._resume_at], places(self.path)
            except OutputError:
                found = None  # torn or missing
        found = self._comm.bcast(found)
        if found is None:
            return False
        layout, times, self._places = found
        # rows of a file that was packed have no places
        if layout.capacity < len(times) + self._capacity or "VTKHDF/Points" not in self._places:
            self._enlarge(layout, times)
        else:
            self._layout = layout
            self._publish(times)
        return True

    def _enlarge(self, layout: vtkhdf.Layout, times: np.ndarray) -> None:
        """Copy the steps at these times [s] to a new file with more room, so that one file holds all of a run."""
        self._layout = layout._replace(capacity=len(times) + self._capacity)
        partial, laid = self.path.with_name(self.path.name + ".partial"), None
        with together(self._comm, f"cannot lay out {self.path}"):
            if self._comm.rank == 0:
                laid = self._lay_out(partial, len(times))
        self._places = self._comm.bcast(laid)
        n = layout.particles
        varying = {"VTKHDF/Points", *(f"VTKHDF/PointData/{name}" for name in layout.varying)}
        once = [f"VTKHDF/PointData/{name}" for name in layout.constant]
        once += ["VTKHDF/Vertices/Connectivity", "VTKHDF/Vertices/Offsets"]
        with open_serial(self.path, "r") as old, SlabWriter(self._comm, partial, self._places) as new:
            for name in [*sorted(varying), *once]:
                # a step at a time, so that no rank has more than its share of one
                total, steps = (n, len(times)) if name in varying else (old[name].shape[0], 1)
                share = Slices(self._comm, total)
                for step in range(steps):
                    first, last = step * total + share.first, step * total + share.last
                    new.write(name, first, old[name][first:last])
        with together(self._comm, f"cannot write {self.path}"):
            if self._comm.rank == 0:
                vtkhdf.publish(partial, times)
                partial.replace(self.path)
        self._times = times

    def _lay_out(self, partial: Path, steps: int) -> dict[str, DataSet]:
        """A new file, with free space on the disk for so many steps; for one rank alone."""
        probe(partial, self._layout.bytes_per_step * steps)
        vtkhdf.lay_out(partial, self._layout, self._index)
        return places(partial)

    def _start_new_file(self) -> None:
        self._layout = self._layout._replace(capacity=self._capacity)
        laid = None
        with together(self._comm, f"cannot lay out {self.path}"):
            if self._comm.rank == 0:
                partial = self.path.with_name(self.path.name + ".partial")
                laid = self._lay_out(partial, 1)
                if self.path.exists():
                    aside = next_free(self.path)
                    self.path.rename(aside)
                    if sums_path(self.path).exists():
                        sums_path(self.path).rename(sums_path(aside))
                sums_path(self.path).unlink(missing_ok=True)
                partial.rename(self.path)
        self._places = self._comm.bcast(laid)
        self._times = np.empty(0)

    def _publish(self, times: np.ndarray) -> None:
        with together(self._comm, f"cannot write {self.path}"):
            if self._comm.rank == 0:
                vtkhdf.publish(self.path, times)
        self._times = times

    def _shown(self, values: np.ndarray, name: str) -> np.ndarray:
        """Values as they are written: in space, floats with the precision asked for."""
        values = _in_space(values)
        if values.dtype.kind == "f" and name not in self._exact:
            return values.astype(self._floats, copy=False)
        return values.astype(np.uint8) if values.dtype == bool else values


class _ByIdentifier:
    """Moves rows so that rank r has the identifiers from ceil(r N / ranks) on, in order."""

    def __init__(self, comm: MPI.Intracomm, identifier: np.ndarray, particles: int):
        """Collective. OutputError on all ranks unless the identifiers are 0 to N - 1, each once."""
        self._comm = comm
        self.first, end = (-(-rank * particles // comm.size) for rank in (comm.rank, comm.rank + 1))
        outside = len(identifier) > 0 and not 0 <= identifier.min() <= identifier.max() < particles
        fault = ValueError(f"identifier: expected 0 to {particles - 1}, each on one rank")
        agree(comm, fault if outside else None, "cannot order the particles")
        self._owner = identifier * comm.size // particles if particles else identifier
        moved = migrate(comm, self._owner, {"identifier": identifier})["identifier"]
        self._order = np.argsort(moved, kind="stable")
        whole = np.array_equal(moved[self._order], np.arange(self.first, end))
        agree(comm, None if whole else fault, "cannot order the particles")

    def arrange(self, values: np.ndarray) -> np.ndarray:
        """This rank's share of an array in the order of the identifiers. Collective."""
        return migrate(self._comm, self._owner, {"values": values})["values"][self._order]


def exact_names(names: Iterable[str]) -> set[str]:
    """Which fields of a file have all their digits: those of a state, and the displacement beside them, by which a
    particle's reference place is found however far it has moved."""
    of_state = {name for name in names if name.startswith(STATE)}
    return of_state | {"displacement"} if of_state else of_state


def bytes_of_rows(values: np.ndarray, exact: bool = False) -> int:
    """Bytes that a row of a field takes in the file."""
    width = int(np.prod(_in_space(values[:0]).shape[1:]))
    return width * (4 if values.dtype.kind == "f" and not exact else values.dtype.itemsize)


def _in_space(values: np.ndarray) -> np.ndarray:
    """Vectors (n, 1) and (n, 2) as (n, 3), tensors (n, 4) and (n, d, d) as (n, 9); anything else as it is."""
    if values.ndim == 2 and values.shape[1] < 3:
        return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))
    if values.ndim == 2 and values.shape[1] == 4:
        values = values.reshape(-1, 2, 2)
    if values.ndim == 3:
        missing = 3 - values.shape[1]
        return np.pad(values, ((0, 0), (0, missing), (0, missing))).reshape(-1, 9)
    return values


class FieldBlocks:
    """Writes steps of several blocks; each has a `FieldSeries` of its own beside the file at `path`."""

    def __init__(self, comm: Any, path: Path, names: list[str], capacity: int, resume_at: float | None = None):
        """names: of the blocks, each with another; the rest as in `FieldSeries`."""
        self._comm, self.path = comm, path
        self._files = {_plain(name): path.with_name(f"{path.stem}_{_plain(name)}{path.suffix}") for name in names}
        self.series = [
            FieldSeries(comm, file, capacity, resume_at, index=number)
            for number, file in enumerate(self._files.values())
        ]
        # of each block the first identifier of every body and its row, found at the first write
        self._firsts: list[tuple[np.ndarray, np.ndarray] | None] = [None] * len(names)

    def write(self, time: float, number: int, position: np.ndarray, varying: Fields, constant: Fields) -> None:
        """Add a step [s] of one block; constant: "identifier" (n,), those of a body in one piece, "body" (n,) and more.

        Collective; raises OutputError on all ranks.
        """
        series, identifier, body = self.series[number], constant["identifier"], constant["body"]
        firsts = self._firsts[number] or self._first_of_bodies(identifier, body)
        self._firsts[number] = firsts
        series.write(time, identifier - firsts[0][body] + firsts[1][body], position, varying, constant)

    def collect(self) -> None:
        """Write the file that shows the blocks, once they are there; collective."""
        with together(self._comm, f"cannot write {self.path}"):
            if self._comm.rank == 0 and (not self.path.exists() or vtkhdf.collected(self.path) != self._files):
                partial = self.path.with_name(self.path.name + ".partial")
                vtkhdf.collect(partial, self._files)
                partial.replace(self.path)

    def _first_of_bodies(self, identifier: np.ndarray, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First identifier and first row of every body; collective."""
        count = maximum(self._comm, int(body.max(initial=-1))) + 1
        least = np.full(count, np.iinfo(np.int64).max)
        np.minimum.at(least, body, identifier)
        first = minimum(self._comm, least)
        sizes = sums(self._comm, np.bincount(body, minlength=count))
        order = np.argsort(first, kind="stable")
        rows = np.zeros(count, np.int64)
        rows[order[1:]] = np.cumsum(sizes[order])[:-1]
        return first, rows


def _plain(name: str) -> str:
    """A name that files and groups may have."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)
