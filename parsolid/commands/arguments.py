"""Values that arguments of the command line may take."""

import argparse

TRUST_CODE = "run the Python files of laws that the scene names"


def whole_number(text: str) -> int:
    """A whole number of at least 1; raises argparse.ArgumentTypeError."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, found {text}")
    return value
