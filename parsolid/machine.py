"""What this process may use of its machine: cores and memory, within the groups of processes (cgroups) that it is in.

Containers and batch systems limit a job by groups of either version: what the machine has is then not the job's to use.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

ROOT = Path("/")


def cores(root: Path = ROOT) -> int:
    """How many cores this process may use: of its affinity and of the quota of its groups, whole ones, at least 1.

    root: where `proc` and `sys` are, as for `free_bytes`.
    """
    found = [float(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)]
    for group in _groups("cpu", root):
        quota = _words(group / "cpu.max") or [
            *_words(group / "cpu.cfs_quota_us"),
            *_words(group / "cpu.cfs_period_us"),
        ]
        # "max" and -1: none
        with suppress(ValueError):
            most, period = map(float, quota)
            if most > 0.0:
                found.append(most / period)
    return max(1, int(min(found)))


def cores_in_words() -> str:
    """The cores of the machine, and how many of them this process may use where it may not use all."""
    here, mine = os.cpu_count() or 1, cores()
    return f"{here} core{'s' * (here > 1)}" + (f", of which this job may use {mine}" if mine < here else "")


def free_bytes(root: Path = ROOT) -> float:
    """Memory [bytes] that this process can still get from its machine and its groups of processes; inf where unknown.

    What a group keeps of files is given back when it is needed, and counts as free.
    """
    found = [float("inf")]
    with suppress(OSError, KeyError, ValueError, IndexError):  # not Linux
        lines = dict(line.split(":", 1) for line in (root / "proc/meminfo").read_text().splitlines())
        found.append(1024.0 * int(lines["MemAvailable"].split()[0]))
    for group in _groups("memory", root):
        for limit, used, files in (
            ("memory.max", "memory.current", "inactive_file"),
            ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
        ):
            with suppress(ValueError):
                (most,), (now,) = _words(group / limit), _words(group / used)
                kept = _words(group / "memory.stat")
                back = float(kept[kept.index(files) + 1]) if files in kept else 0.0
                found.append(float(most) - float(now) + back)
    return max(0.0, min(found))


def _groups(controller: str, root: Path) -> Iterator[Path]:
    """Folders of the groups that limit this process, from its own to the outermost that can be seen."""
    lines = []
    with suppress(OSError):
        lines = (root / "proc/self/cgroup").read_text().splitlines()
    mounts = root / "sys/fs/cgroup"
    for line in lines:
        number, controllers, name = line.split(":", 2)
        if number == "0":
            mount = mounts / "unified" if (mounts / "unified").is_dir() else mounts
        elif controller in controllers.split(","):
            mount = mounts / controllers if (mounts / controllers).is_dir() else mounts / controller
        else:
            continue
        group = mount / name.strip("/")
        yield from (folder for folder in (group, *group.parents) if folder == mount or mount in folder.parents)


def _words(path: Path) -> list[str]:
    """The words of a small file; none where there is no such file."""
    with suppress(OSError):
        return path.read_text().split()
    return []
