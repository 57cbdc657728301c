"""What is told of a scene that runs and is likely to be wrong."""

from typing import NamedTuple


class Warned(NamedTuple):
    """A code that never changes, and words; inapplicable: whether the method cannot represent what is asked."""

    code: str
    text: str
    inapplicable: bool = False

    def __str__(self) -> str:
        return f"warning: {self.text} [{self.code}]"
