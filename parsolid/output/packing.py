"""Fields of a finished run made smaller: the same file with its numbers deflated, which the same readers open.

A run writes its rows side by side from all ranks, which a deflated data set does not allow without parallel HDF5; so
that one rank packs at the end, a piece of a data set at a time.
"""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from parsolid.output.slabs import flush_to_disk, open_serial
from parsolid.output.vtkhdf import published

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
