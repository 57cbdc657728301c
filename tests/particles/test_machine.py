"""What a job may use of its machine: cores of a quota, memory of its group and of those around it, in both versions."""

import pytest

from parsolid.machine import cores, cores_in_words, free_bytes

MEMINFO = "MemTotal: 64000000 kB\nMemAvailable:    1000000 kB\n"


def written(root, files):
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({}, float("inf")),
        ({"proc/meminfo": MEMINFO}, 1.024e9),
        # the group around this one has less left; files that it keeps are given back
        (
            {
                "proc/meminfo": MEMINFO,
                "proc/self/cgroup": "0::/job/step\n",
                "sys/fs/cgroup/job/step/memory.max": "max\n",
                "sys/fs/cgroup/job/step/memory.current": "100\n",
                "sys/fs/cgroup/job/memory.max": "5000\n",
                "sys/fs/cgroup/job/memory.current": "4000\n",
                "sys/fs/cgroup/job/memory.stat": "anon 2500\ninactive_file 1500\n",
            },
            2500.0,
        ),
        # version 1, whose folder a container does not see: that of the mount is its own
        (
            {
                "proc/meminfo": MEMINFO,
                "proc/self/cgroup": "4:memory:/docker/x\n1:cpu,cpuacct:/docker/x\n0::/\n",
                "sys/fs/cgroup/unified/cgroup.procs": "",
                "sys/fs/cgroup/memory/memory.limit_in_bytes": "9000\n",
                "sys/fs/cgroup/memory/memory.usage_in_bytes": "9500\n",
                "sys/fs/cgroup/memory/memory.stat": "total_inactive_file 700\n",
            },
            200.0,
        ),
    ],
)
def test_free_memory_is_what_the_tightest_group_has_left(tmp_path, files, expected):
    assert free_bytes(written(tmp_path, files)) == expected


def test_cores_are_those_of_the_quota_and_at_least_one(tmp_path, monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: set(range(8)), raising=False)
    assert cores(tmp_path) == 8
    two = written(
        tmp_path / "2",
        {
            "proc/self/cgroup": "0::/job/step\n",
            "sys/fs/cgroup/job/step/cpu.max": "max 100000\n",
            "sys/fs/cgroup/job/cpu.max": "350000 100000\n",
        },
    )
    assert cores(two) == 3
    one = {"proc/self/cgroup": "1:cpu,cpuacct:/\n", "sys/fs/cgroup/cpu,cpuacct/cpu.cfs_period_us": "100000\n"}
    quota = "sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us"
    assert cores(written(tmp_path / "1", one | {quota: "50000\n"})) == 1
    assert cores(written(tmp_path / "none", one | {quota: "-1\n"})) == 8


def test_a_report_tells_the_machine_from_the_job(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 64)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {3, 4}, raising=False)
    assert cores_in_words() == f"64 cores, of which this job may use {cores()}"
    monkeypatch.setattr("os.sched_getaffinity", lambda _: set(range(64)), raising=False)
    monkeypatch.setattr("parsolid.machine.cores", lambda: 64)
    assert cores_in_words() == "64 cores"
