"""Ranks that have the program loaded when they start, so that a job of a second is not four of imports.

`mpirun` starts this file as a script, which is up in milliseconds: it hands its streams, its environment and its line
to the process manager to a process that has imported everything (`serve`) and forks; that child is the rank, and runs
what `program` says. Signals, exit status and death go both ways, so a job is launched, killed and waited for as any
other. Kernels that a rank has loaded are loaded before the next one is made. Linux, and MPICH's process manager.
"""

import functools
import json
import os
import select
import signal
import socket
import sys

# what would make the server a rank of the job that runs the tests
_INHERITED = ("PMI", "HYDRA", "HYDI", "MPI_LOCAL")
_ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
# what a rank that loads itself would import, without which MPI is not started
_MODULES = (
    "parsolid.commands.run",
    "parsolid.methods.tlsph.system",
    "parsolid.methods.peridynamics.system",
    "parsolid.methods.ulsph.system",
    "parsolid.methods.mpm.system",
)


def program(*words: str) -> tuple[str, ...]:
    """What Python is started with for a rank of "-m", "parsolid", of "-c" and code, or of a script.

    Where there can be no server of this process, ranks load the program themselves.
    """
    address = _server()[1]
    return ("-S", "-E", __file__, address, *(words[1:] if words[0] == "-m" else words)) if address else words


@functools.cache
def _server() -> tuple:
    """The server, which ends when its standard input does, with this process at the latest; and its address."""
    import subprocess
    import tempfile
    import time

    from mpi4py import MPI

    if not sys.platform.startswith("linux") or MPI.get_vendor()[0] != "MPICH":
        return None, None
    address = os.path.join(tempfile.mkdtemp(prefix="parsolid-door-"), "door")
    values = {name: value for name, value in os.environ.items() if not name.startswith(_INHERITED)}
    values["PYTHONPATH"] = os.pathsep.join(path for path in (_ROOT, values.get("PYTHONPATH")) if path)
    command = [sys.executable, __file__, "serve", address]
    server = subprocess.Popen(command, env=values, stdin=subprocess.PIPE, start_new_session=True)
    while not os.path.exists(address):
        assert server.poll() is None, "the server of ranks did not start"
        time.sleep(0.01)
    return server, address


def stub(address: str, arguments: list[str]) -> None:
    """The process that mpirun knows; does not return."""
    waiting: list[int] = []
    child = 0

    def passed_on(number: int, _: object) -> None:
        waiting.append(number)
        if child:
            os.kill(child, number)

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(number, passed_on)
    line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    line.connect(address)
    manager = os.environ.get("PMI_FD")
    streams = [0, 1, 2] + ([int(manager)] if manager else [])
    request = json.dumps([streams, dict(os.environ), os.getcwd(), arguments]).encode()
    socket.send_fds(line, [len(request).to_bytes(8, "little")], streams)
    line.sendall(request)
    child = int.from_bytes(_received(line, 8), "little")
    for number in waiting:
        os.kill(child, number)
    status = int.from_bytes(_received(line, 8), "little")
    if os.WIFSIGNALED(status):
        signal.signal(os.WTERMSIG(status), signal.SIG_DFL)
        os.kill(os.getpid(), os.WTERMSIG(status))
    os._exit(os.WEXITSTATUS(status))


def _received(line: socket.socket, length: int) -> bytes:
    """So many bytes; without the other side this process has no reason to be."""
    data = b""
    while len(data) < length:
        part = line.recv(length - len(data))
        if not part:
            os.kill(os.getpid(), signal.SIGKILL)
        data += part
    return data


def serve(address: str) -> None:
    """Load the program, then make a rank of everyone who asks, until nobody can any more."""
    import importlib

    import mpi4py

    mpi4py.rc.initialize, mpi4py.rc.finalize = False, True
    for name in _MODULES:
        importlib.import_module(name)
    door = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    door.bind(address)
    door.listen(64)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while door in select.select([door, 0], [], [])[0]:
        line, _ = door.accept()
        if os.fork() == 0:
            door.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            _keep(line)
        line.close()


def _keep(line: socket.socket) -> None:
    """Between one rank and its stub until one of them ends."""
    first, streams, *_ = socket.recv_fds(line, 8, 8)
    numbers, values, folder, arguments = json.loads(_received(line, int.from_bytes(first, "little")))
    rank = os.fork()
    if rank == 0:
        line.close()
        _rank(dict(zip(numbers, streams)), values, folder, arguments)
    for number in streams:
        os.close(number)
    ended = os.pidfd_open(rank)
    line.sendall(rank.to_bytes(8, "little"))
    ready, *_ = select.select([ended, line], [], [])

    if ended not in ready:
        os.kill(rank, signal.SIGKILL)
    status = os.waitpid(rank, 0)[1]
    if ended in ready:
        line.sendall(status.to_bytes(8, "little"))
    os._exit(0)


def _rank(streams: dict[int, int], values: dict[str, str], folder: str, arguments: list[str]) -> None:
    """Become the rank: `python -m parsolid`, `python -c` or a script; leaves as those do."""
    import fcntl
    import runpy

    # none of them on a number that another is to have
    high = {number: fcntl.fcntl(stream, fcntl.F_DUPFD, 100) for number, stream in streams.items()}
    for stream in streams.values():
        os.close(stream)
    for number, stream in high.items():
        os.dup2(stream, number)
        os.close(stream)
    os.environ.clear()
    os.environ.update(values)
    os.chdir(folder)
    what, *sys.argv[1:] = arguments
    from parsolid.simulation.signals import catch_early

    if what == "parsolid":
        catch_early(sys.argv[1:])
    from mpi4py import MPI

    MPI.Init_thread()
    if what == "-c":
        code = sys.argv.pop(1)
        exec(compile(code, "<string>", "exec"), {"__name__": "__main__"})
    elif what == "parsolid":
        runpy.run_module(what, run_name="__main__", alter_sys=True)
    else:
        sys.path.insert(0, os.path.dirname(what))
        runpy.run_path(what, run_name="__main__")
    sys.exit(0)


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        serve(sys.argv[2])
    else:
        stub(sys.argv[1], sys.argv[2:])
