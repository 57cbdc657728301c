"""What is said of a file that cannot be written: the system's reason, once."""

from types import SimpleNamespace

import pytest
from mpi4py import MPI

from parsolid.output.errors import words
from parsolid.output.log import Log

STACK = """Other I/O error , error stack:
internal_File_write_at_all_c(8926): MPI_File_write_at_all_c(file=0x5609, offset=436312, count=7908, MPI_BYTE) failed
ADIOI_GEN_WRITECONTIG(80).........: Other I/O error No space left on device"""
HDF5 = (
    "[Errno 28] Can't write data (file write failed: errno = 28, error message = 'No space left on device', buf = 0x1)"
)


class Told(MPI.Exception):
    def __str__(self):
        return STACK


@pytest.mark.parametrize(
    "error", [Told(MPI.ERR_IO), OSError(HDF5), OSError(28, HDF5), OSError(28, "No space left on device")]
)
def test_a_full_disk_is_called_so_whoever_met_it(error):
    assert words(error) == "No space left on device"


def test_what_is_no_such_error_keeps_its_words():
    assert words(OSError(2, "No such file or directory", "x.h5")) == "No such file or directory: x.h5"
    assert words(ValueError("expected a number")) == "expected a number" and words(KeyError()) == "KeyError"


def test_a_log_that_cannot_be_written_is_told_once_and_the_run_goes_on(capsys):
    log = Log()
    log.open(SimpleNamespace(rank=0, size=1, allreduce=lambda value, _: value), "/dev/full")
    log.say("step 1")
    log.say("step 2")
    told = capsys.readouterr().err
    assert told.count("/dev/full") == told.count("No space left on device") == told.count("\n") == 1
