"""What is told of a scene that runs: warnings of what is likely to be wrong, notes of what its choices bring.

Each has a code that never changes; `--silence CODE` leaves it out.
"""

from typing import NamedTuple

from parsolid.scene.codes import NOTES, WARNINGS

# every code that `--silence` takes
CODES = WARNINGS | NOTES


class Warned(NamedTuple):
    """A code and words; inapplicable: whether the method cannot represent what is asked."""

    code: str
    text: str
    inapplicable: bool = False

    def __str__(self) -> str:
        return f"warning: {self.text} [{self.code}]"


class Note(NamedTuple):
    """A code and words."""

    code: str
    text: str

    def __str__(self) -> str:
        return f"note: {self.text} [{self.code}]"
