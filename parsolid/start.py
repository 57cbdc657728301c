"""The start of a job without Python's collector: what is loaded is no garbage, and looking for some in it, while it is
loaded and again when the job ends, takes a fifth of a small job.
"""

import gc
import os

# whether this process is a job that has begun so and is not loaded yet
_begun: list[bool] = []


def begin() -> None:
    """Look for no garbage until `loaded`."""
    gc.disable()
    # those of other people's have nothing to do with scenes, and every package that is installed is asked for them
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    _begun.append(True)


def loaded() -> None:
    """Look for garbage from here on, and never in what there is.

    Nothing in a script of somebody's: what earlier runs left there is garbage.
    """
    if _begun:
        _begun.clear()
        gc.freeze()
        gc.enable()


def end() -> None:
    """Look for none in what ends with the job."""
    gc.disable()
    gc.freeze()
