"""Random fields into a checkpoint and back, on the same ranks and on one."""

import numpy as np
import pytest
from mpi4py import MPI

hypothesis = pytest.importorskip("hypothesis")
from hypothesis import given  # noqa: E402 (after it is known to be there)
from hypothesis import strategies as st  # noqa: E402

from parsolid.checksums import sum_of_rows  # noqa: E402
from parsolid.output.checkpoint import read_checkpoint, write_checkpoint  # noqa: E402

# every rank draws as many examples and takes rank 0's, for constants of modules that a rank has loaded are drawn, too;
# none looks for a smaller one while the others wait
TOGETHER = hypothesis.settings(
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=10,
    phases=[hypothesis.Phase.generate],
    suppress_health_check=[hypothesis.HealthCheck.function_scoped_fixture],
)
KINDS = st.sampled_from(["<f8", "<i8", "<i4", "|u1"])
FIELDS = st.dictionaries(st.text("abcxyz_", min_size=1, max_size=6), st.tuples(KINDS, st.integers(0, 7)), min_size=1)
HEADERS = st.dictionaries(st.text(), st.one_of(st.none(), st.floats(allow_nan=False), st.text(), st.integers()))


@TOGETHER
@given(st.lists(st.tuples(st.integers(0, 40), FIELDS), min_size=1, max_size=3), HEADERS, st.integers(0, 2**32 - 1))
def test_what_is_written_is_read_bit_for_bit(comm, shared_path, systems, header, seed):
    systems, header, seed = comm.bcast((systems, header, seed))
    chance, written = np.random.default_rng(seed), []
    for most, fields in systems:
        counts = chance.integers(0, most + 1, comm.size)
        first, last = counts[: comm.rank].sum(), counts[: comm.rank + 1].sum()
        # any bits, not only those of sound numbers; 0 components are a field (n,)
        whole = {
            name: chance.bytes(int(counts.sum()) * max(1, width) * np.dtype(kind).itemsize)
            for name, (kind, width) in fields.items()
        }
        arrays = {
            name: np.frombuffer(whole[name], kind).reshape((-1, width) if width else -1)
            for name, (kind, width) in fields.items()
        }
        written.append((arrays, first, last))
    values = chance.random((comm.size, 3))[comm.rank]
    path = shared_path / "checkpoint.h5"
    write_checkpoint(comm, path, header, [{n: a[i:j] for n, a in arrays.items()} for arrays, i, j in written], values)
    for group in (comm, MPI.COMM_SELF):
        found, read, rows = read_checkpoint(group, path)
        assert found == header and rows[comm.rank].tobytes() == values.tobytes()
        for (arrays, first, last), fields in zip(written, read):
            same = slice(first, last) if group is comm or comm.size == 1 else slice(None)
            assert {name: array[same].tobytes() for name, array in arrays.items()} == {
                name: rows.tobytes() for name, rows in fields.items()
            }
    comm.Barrier()


@TOGETHER
@given(st.integers(1, 200), st.integers(1, 5), KINDS, st.integers(0, 2**32 - 1))
def test_a_checksum_is_that_of_its_parts_and_sees_any_bit(count, width, kind, seed):
    chance = np.random.default_rng(seed)
    rows = np.frombuffer(chance.bytes(count * width * np.dtype(kind).itemsize), kind).reshape(count, width).copy()
    whole, cut = sum_of_rows(rows, 5), int(chance.integers(0, count + 1))
    assert (sum_of_rows(rows[:cut], 5) + sum_of_rows(rows[cut:], 5 + cut)) % 2**64 == whole
    rows.view(np.uint8).reshape(-1)[chance.integers(0, rows.nbytes)] ^= np.uint8(1 << chance.integers(0, 8))
    assert sum_of_rows(rows, 5) != whole
