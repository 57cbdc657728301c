"""Entry points of installed packages, found without parsing the metadata of all: few packages have any of a group."""

import os
import sys
from contextlib import suppress
from importlib.machinery import PathFinder
from typing import Any


def entry_points(group: str) -> Any:
    if not _is_named(group):
        return ()
    from importlib import metadata

    return metadata.entry_points(group=group)


def _is_named(group: str) -> bool:
    """Whether a package may have entry points of a group: one has, or is in an archive or found by another finder."""
    others = (it for it in sys.meta_path if it is not PathFinder)
    if any(hasattr(it, "find_distributions") for it in others):
        return True
    wanted = f"[{group}]".encode()
    for place in dict.fromkeys(sys.path):
        if os.path.isfile(place):
            return True
        with suppress(OSError):
            for name in os.listdir(place or "."):
                if name.endswith((".dist-info", ".egg-info")) and wanted in _text(os.path.join(place, name)):
                    return True
                if name.endswith(".egg"):
                    return True
    return False


def _text(folder: str) -> bytes:
    with suppress(OSError), open(os.path.join(folder, "entry_points.txt"), "rb") as file:
        return file.read()
    return b""
