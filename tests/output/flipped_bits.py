"""One bit of a file, changed for the tests of checksums."""

from pathlib import Path


def flip(path: Path, position: int, bit: int) -> None:
    """Change a bit of the byte at a position; done twice, the file is as it was."""
    with open(path, "r+b") as file:
        file.seek(position)
        byte = file.read(1)[0]
        file.seek(position)
        file.write(bytes([byte ^ 1 << bit]))
