"""A lock on the folder of a run's results, so that two runs never write into the same one.

The file `run.lock` says which run has the folder. What counts is the system's lock on it (flock), which Linux passes
on to the server of an NFS and which ends with its process, however that ends: a file left by a killed run is stale and
is taken over. Where a file system has no such locks, the process named in the file counts: of this machine it is looked
for, of another one it is believed to be alive, unless it is an earlier start of the same batch job.
"""

import contextlib
import errno
import fcntl
import json
import os
import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from parsolid.output.errors import OutputError

NAME = "run.lock"
# a job that a batch system starts again keeps its number
_JOBS = ("SLURM_JOB_ID", "PBS_JOBID", "LSB_JOBID", "JOB_ID")
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)


class FolderLock:
    """A lock held from its creation until `release` or the end of the process; for one rank alone.

    Raises OutputError, and changes nothing, when another run has the folder; OSError when it cannot be written.
    """

    def __init__(self, folder: Path):
        self.path = folder / NAME
        # a file object closes the file, and so ends the lock, when it is garbage
        self._file = os.fdopen(self._opened(), "r+b", buffering=0)
        self._file.truncate(0)
        self._file.write((json.dumps(_this_process()) + "\n").encode())

    def _opened(self) -> int:
        while True:
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            try:
                self._take(descriptor)
                # the run before may have removed the file since it was opened
                if os.fstat(descriptor).st_ino == os.stat(self.path).st_ino:
                    return descriptor
            except FileNotFoundError:
                pass
            except BaseException:
                os.close(descriptor)
                raise
            os.close(descriptor)

    def _take(self, descriptor: int) -> None:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            owner = _owner(descriptor)
            if error.errno in _NO_LOCKS:
                if not owner or not _still_runs(owner):
                    return
                remedy = f"; if that run has ended, remove {self.path}"
            elif error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                remedy = ""
            else:
                raise
            described = ", ".join(
                f"{key} {owner[key]}" for key in ("host", "process", "job", "since") if owner.get(key)
            )
            raise OutputError(
                f"{self.path.parent}: expected a folder of this run's own, found another run that writes there "
                f"({described or 'unnamed'}): choose another output directory{remedy}"
            ) from None

    def release(self) -> None:
        """End the lock; further calls do nothing."""
        if self._file.closed:
            return
        with contextlib.suppress(OSError):
            # before the lock ends, so that the file of another run is not removed
            os.unlink(self.path)
        self._file.close()


def _this_process() -> dict[str, Any]:
    job = next((os.environ[name] for name in _JOBS if os.environ.get(name)), None)
    since = datetime.now(UTC).isoformat(timespec="seconds")
    return {"host": platform.node(), "process": os.getpid(), "job": job, "since": since}


def _owner(descriptor: int) -> dict[str, Any]:
    """The owner in the file, empty where it cannot be read."""
    try:
        owner = json.loads(os.pread(descriptor, 4096, 0))
    except ValueError:
        return {}
    return owner if isinstance(owner, dict) else {}


def _still_runs(owner: dict[str, Any]) -> bool:
    mine = _this_process()
    if owner.get("host") != mine["host"]:
        return mine["job"] is None or owner.get("job") != mine["job"]
    process = owner.get("process")
    if not isinstance(process, int) or process <= 0 or process == mine["process"]:
        return False
    try:
        os.kill(process, 0)
    except OSError as error:
        return error.errno != errno.ESRCH
    return True
