"""A VTKHDF file of points over time (PolyData, one vertex cell a particle), laid out once for a number of steps.

Source: VTKHDF specification, version 2.2, "Poly data" and "Temporal data". Every step has as many points, in the same
order, so that cells and constant fields are stored once: their offsets are 0 for all steps.

Readers take the number of steps from Steps/NSteps and want Steps/Values of exactly that length. A run may be killed
between the two, so they are never changed while in use: /series holds two versions of the Steps group, the one not in
use is brought up to date, and then a soft link is pointed at it, which is one small write to the file.

    /VTKHDF/Steps       -> /series/shown/steps -> /series/empty, /series/first or /series/other
    /series             attribute layout (JSON): what the file was laid out for

A run writes its rows side by side from all ranks, which a deflated data set does not allow; so one rank
packs a finished file, a piece of a data set at a time.
"""

import json
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from parsolid.output.errors import OutputError, words
from parsolid.output.slabs import create_slab, flush_to_disk, open_serial

VERSION = (2, 2)

# a reader loads a part as one piece: larger sets are cut so that parallel readers can share them
PART = 4_000_000

_TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")


# name -> (shape of a row, dtype name)
Kinds = dict[str, tuple[tuple[int, ...], str]]


class Layout(NamedTuple):
    """particles; capacity, the most steps; name -> (row shape, dtype name) of the fields that vary and that do not."""

    particles: int
    capacity: int
    varying: Kinds
    constant: Kinds

    def like(self, other: "Layout") -> bool:
        """True when both hold the same fields of as many particles."""
        return self._replace(capacity=0) == other._replace(capacity=0)

    @property
    def bytes_per_step(self) -> int:
        """Bytes that one step adds."""
        rows = [np.dtype(kind).itemsize * int(np.prod(shape)) for shape, kind in self.varying.values()]
        return int(self.particles * (24 + sum(rows)))


def lay_out(path: Path | str, layout: Layout, index: int | None = None) -> None:
    """Create the file with no step in it; index: its place among the blocks of a collection. One rank alone."""
    particles, capacity, parts = layout.particles, layout.capacity, -(-layout.particles // PART)
    with open_serial(path, "w") as file:
        vtk = file.create_group("VTKHDF")
        _name_type(vtk, b"PolyData")
        if index is not None:
            vtk.attrs["Index"] = np.int64(index)
        sizes = np.full(parts, PART)
        sizes[parts - 1 :] = particles - PART * (parts - 1)
        vtk["NumberOfPoints"] = sizes
        create_slab(vtk, "Points", (capacity * particles, 3), np.float64)
        for name in _TOPOLOGIES:
            group, counts = vtk.create_group(name), sizes if name == "Vertices" else np.zeros_like(sizes)
            group["NumberOfCells"] = group["NumberOfConnectivityIds"] = counts
            create_slab(group, "Connectivity", (counts.sum(),), np.int64)
            if counts.any():
                create_slab(group, "Offsets", (counts.sum() + parts,), np.int64)
            else:
                group["Offsets"] = np.zeros(parts, np.int64)
        data = vtk.create_group("PointData")
        for name, (shape, kind) in layout.varying.items():
            create_slab(data, name, (capacity * particles, *shape), kind)
        for name, (shape, kind) in layout.constant.items():
            create_slab(data, name, (particles, *shape), kind)
        _create_steps(file, layout, parts)
        vtk["Steps"] = h5py.SoftLink("/series/shown/steps")


def _name_type(vtk: h5py.Group, kind: bytes) -> None:
    vtk.attrs["Version"] = np.array(VERSION, np.int64)
    # readers want a string of fixed length
    vtk.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))


def collect(path: Path | str, blocks: dict[str, Path]) -> None:
    """Create a file of which blocks in files of the same folder are parts, by name in order. One rank alone."""
    with open_serial(path, "w") as file:
        # a group that tracks the order shows its blocks in it
        vtk = file.create_group("VTKHDF", track_order=True)
        _name_type(vtk, b"PartitionedDataSetCollection")
        tree = vtk.create_group("Assembly", track_order=True)
        for name, block in blocks.items():
            vtk[name] = h5py.ExternalLink(block.name, "/VTKHDF")
            tree.create_group(name, track_order=True)[name] = h5py.SoftLink(f"/VTKHDF/{name}")


def collected(path: Path | str) -> dict[str, Path]:
    """Name -> file of the blocks of a file, itself where it is no collection. One rank alone; OutputError."""
    try:
        with open_serial(path, "r") as file:
            vtk = file["VTKHDF"]
            links = {name: vtk.get(name, getlink=True) for name in vtk}
            files = {name: one.filename for name, one in links.items() if isinstance(one, h5py.ExternalLink)}
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise OutputError(f"{path}: not a whole series of fields ({words(error)})") from error
    return {name: Path(path).with_name(file) for name, file in files.items()} or {"": Path(path)}


def _create_steps(file: h5py.File, layout: Layout, parts: int) -> None:
    series = file.create_group("series")
    series.attrs["layout"] = json.dumps(layout)
    capacity = layout.capacity
    tables = series.create_group("tables")
    tables["PartOffsets"] = np.zeros(capacity, np.int64)
    tables["NumberOfParts"] = np.full(capacity, parts)
    tables["PointOffsets"] = np.arange(capacity) * layout.particles
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        tables[name] = np.zeros((capacity, len(_TOPOLOGIES)), np.int64)
    offsets = tables.create_group("PointDataOffsets")
    for name in layout.varying:
        offsets[name] = np.arange(capacity) * layout.particles
    for name in layout.constant:
        offsets[name] = np.zeros(capacity, np.int64)
    for state in ("empty", "first", "other"):
        steps = series.create_group(state)
        steps.attrs["NSteps"] = np.int64(0)
        # one chunk, in the file from the start, so that publishing allocates nothing
        values = np.zeros(0 if state == "empty" else 1)
        steps.create_dataset("Values", data=values, maxshape=(capacity,), chunks=(capacity,))
        for name in tables:
            steps[name] = tables[name]
    # a group that tracks the order keeps its link in its own header, one block of the file
    series.create_group("shown", track_order=True)["steps"] = h5py.SoftLink("/series/empty")


def published(path: Path | str) -> tuple[Layout, np.ndarray]:
    """The layout of a file and the times of its steps [s]. One rank alone; OutputError when it is no such file."""
    try:
        with open_serial(path, "r") as file:
            particles, capacity, *fields = json.loads(file["series"].attrs["layout"])
            kinds = [{name: (tuple(shape), kind) for name, (shape, kind) in field.items()} for field in fields]
            steps = file["VTKHDF/Steps"]
            return Layout(particles, capacity, *kinds), steps["Values"][: steps.attrs["NSteps"]]
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise OutputError(f"{path}: not a whole series of fields ({words(error)})") from error


def publish(path: Path | str, times: np.ndarray) -> None:
    """Make the first len(times) steps, at these times [s], the ones that readers see. One rank alone."""
    with open_serial(path, "r+") as file:
        shown = file["series/shown"].get("steps", getlink=True).path
        unused = "/series/other" if shown == "/series/first" else "/series/first"
        if len(times) == 0:
            unused = "/series/empty"
        else:
            file[unused].attrs.modify("NSteps", np.int64(len(times)))
            file[unused]["Values"].resize((len(times),))
            file[unused]["Values"][...] = times
    flush_to_disk(path)
    with open_serial(path, "r+") as file:
        del file["series/shown/steps"]
        file["series/shown/steps"] = h5py.SoftLink(unused)
    flush_to_disk(path)


# rows of a chunk: what a reader of one place has to unpack
CHUNK = 32768
_CELLS = ("VTKHDF/Vertices/Connectivity", "VTKHDF/Vertices/Offsets")


def pack(path: Path | str, level: int) -> None:
    """Deflate a series of fields (level 1 to 9, the bytes of numbers sorted before); steps without rows go.

    For one rank alone; the file at path is whole at every instant. Raises OutputError and OSError.
    """
    path = Path(path)
    layout, times = published(path)
    partial = path.with_name(path.name + ".partial")
    rows = dict.fromkeys(["VTKHDF/Points", *(f"VTKHDF/PointData/{name}" for name in layout.varying)], len(times))
    rows |= dict.fromkeys([*(f"VTKHDF/PointData/{name}" for name in layout.constant), *_CELLS], 1)
    with open_serial(path, "r") as old, open_serial(partial, "w") as new:
        old.copy("series", new)
        new["series"].attrs["layout"] = json.dumps(layout._replace(capacity=max(1, len(times))))
        _copy_attributes(old["VTKHDF"], new.create_group("VTKHDF"))

        def visit(name: str) -> None:
            whole = f"VTKHDF/{name}"
            item = old[whole]
            if isinstance(item, h5py.Group):
                _copy_attributes(item, new.require_group(whole))
            elif whole in rows and item.size:
                count = layout.particles * rows[whole] if whole not in _CELLS else len(item)
                shape = (count, *item.shape[1:])
                chunks = (max(1, min(CHUNK, count)), *item.shape[1:])
                packed = new.create_dataset(
                    whole, shape, item.dtype, chunks=chunks, shuffle=True, compression="gzip", compression_opts=level
                )
                for first in range(0, count, CHUNK):
                    packed[first : first + CHUNK] = np.asarray(item[first : min(first + CHUNK, count)])
            else:
                old.copy(item, new, whole)

        # links, that of the steps among them, are not visited
        old["VTKHDF"].visit(visit)
        new["VTKHDF/Steps"] = h5py.SoftLink("/series/shown/steps")
    flush_to_disk(partial)
    partial.replace(path)


def _copy_attributes(old: Any, new: Any) -> None:
    for name in old.attrs:
        new.attrs.create(name, old.attrs[name], dtype=old.attrs.get_id(name).dtype)
