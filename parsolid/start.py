"""The start of a job without Python's collector: what is loaded is no garbage, and looking for some in it, while it is
loaded and again when the job ends, takes a fifth of a small job.
"""

import gc


def begin() -> None:
    """Look for no garbage until `loaded`."""
    gc.disable()


def loaded() -> None:
    """Look for garbage from here on, and never in what there is."""
    gc.freeze()
    gc.enable()


def end() -> None:
    """Look for none in what ends with the job."""
    gc.disable()
    gc.freeze()
