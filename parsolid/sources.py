"""A digest of the sources that a run is made of."""

import hashlib
from functools import cache
from pathlib import Path

import decomposition
import parsolid

# what looks at results and does not make them
_NOT_OF_A_RUN = ("commands", "campaign")


@cache
def source_digest() -> str:
    """The same for the same sources, whatever commands are given."""
    digest = hashlib.sha256()
    for package in (parsolid, decomposition):
        root = Path(str(package.__file__)).resolve().parent
        for source in sorted(root.rglob("*.py")):
            relative = source.relative_to(root)
            if package is parsolid and relative.parts[0] in _NOT_OF_A_RUN:
                continue
            digest.update(str(relative).encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()
