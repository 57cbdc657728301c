"""Where a run is and what it has left so far, for the message of an error that nobody has foreseen."""

import os
import tempfile
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

NAME = "traceback.txt"
# a rank that is not the first to tell lets the first one finish [s]
PATIENCE = 3.0


@dataclass
class Context:
    """folder: of the results, None before there is one; checkpoint: the last one; job: the same number on all ranks."""

    folder: Path | None = None
    checkpoint: str | None = None
    job: int = 0

    def describe(self) -> str:
        """The last checkpoint, in words, or nothing outside of a run."""
        if self.folder is None:
            return ""
        return f"; last checkpoint: {self.checkpoint or 'none was written'}"


# of this process
CONTEXT = Context()


def report(error: BaseException) -> str | None:
    """Keep the traceback of an error in a file; what to say of it, in one line.

    None where another rank has said it already: then this returns late, so that the other has had its time.
    """
    text = "".join(traceback.format_exception(error))
    reason = " ".join(f"{type(error).__name__}: {error}".split()).rstrip(":")
    told = f"expected no error, found {reason[:300]}"
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
        return f"{told}; the traceback is in {path}{CONTEXT.describe()}"
    return f"{told}; its traceback could be written nowhere{CONTEXT.describe()}"
