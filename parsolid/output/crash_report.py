"""Report of an unexpected error: its traceback in a file, and the last checkpoint."""

import os
import tempfile
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

NAME = "traceback.txt"
# time that other ranks wait for the first one to report [s]
PATIENCE = 3.0


@dataclass
class Context:
    """folder: of the results, None before there is one; checkpoint: the last one; job: the same number on all ranks."""

    folder: Path | None = None
    checkpoint: str | None = None
    job: int = 0

    def describe(self) -> str:
        """A text of the last checkpoint; empty outside of a run."""
        if self.folder is None:
            return ""
        return f"; last checkpoint: {self.checkpoint or 'none was written'}"


# of this process
CONTEXT = Context()


def report(error: BaseException) -> str | None:
    """Write the traceback of an error to a file; returns a message of one line.

    None where another rank has reported already; this returns after a pause in which that rank prints its message.
    """
    text = "".join(traceback.format_exception(error))
    reason = " ".join(f"{type(error).__name__}: {error}".split()).rstrip(":")
    message = f"expected no error, found {reason[:300]}"
    folders = (Path.cwd(), Path(tempfile.gettempdir()))
    files = [CONTEXT.folder / NAME] if CONTEXT.folder else []
    for path in [*files, *(folder / f"parsolid-{CONTEXT.job}-{NAME}" for folder in folders)]:
        try:
            with open(path, "x", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
        except FileExistsError:
            time.sleep(PATIENCE)
            return None
        except OSError:
            continue  # a full disk or a folder that is not ours: the next one
        return f"{message}; the traceback is in {path}{CONTEXT.describe()}"
    return f"{message}; its traceback could be written nowhere{CONTEXT.describe()}"
