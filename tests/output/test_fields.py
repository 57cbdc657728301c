"""The field series: read back step by step by VTK's own reader, resumed, and readable whenever the run was killed."""

import importlib.util
import subprocess
import sys

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from parsolid.output import OutputError, vtkhdf
from parsolid.output.fields import FieldSeries
from parsolid.output.slabs import probe
from parsolid.output.vtkhdf import pack

TIMES = [0.0, 0.1, 0.1 + 0.2, 1.0]


class Particles:
    """What the series of a moving plane body holds, as functions of identifier and time."""

    def __init__(self, comm, total=29):
        # scattered over the ranks, in no order
        self.identifier = np.random.default_rng(5).permutation(total)[comm.rank :: comm.size]

    def position(self, time, number=None):
        number = self.identifier if number is None else number
        return np.stack([number + time, np.sqrt(number) * (1 + time)], axis=1)

    def varying(self, time):
        velocity = np.empty((2, len(self.identifier) + 3))
        velocity[:, : len(self.identifier)] = self.position(2.0 * time).T
        gradient = np.arange(1.0, 5.0) * (1 + time) + self.identifier[:, np.newaxis]
        return {
            "velocity": velocity.T[: len(self.identifier)],
            "gradient": gradient.reshape(-1, 2, 2),
            "pressure": self.identifier * time,
            "rank": np.full(len(self.identifier), 7, np.int32),
        }

    def constant(self):
        return {"identifier": self.identifier, "volume": 1.0 / (1.0 + self.identifier)}

    def write(self, series, time):
        series.write(time, self.identifier, self.position(time), self.varying(time), self.constant())


needs_vtk = pytest.mark.skipif(importlib.util.find_spec("pyvista") is None, reason="pyvista is not installed")


def read_with_vtk(path):
    """Times and, for each, the mesh; by VTK's reader as pyvista and ParaView use it."""
    import pyvista
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()
    meshes = []
    for time in times:
        reader.UpdateTimeStep(time)
        meshes.append(pyvista.wrap(reader.GetOutputDataObject(0)).copy())
    return list(times), meshes


def check_mesh(particles, mesh, time, total=29):
    number = np.arange(total)
    assert np.array_equal(mesh.points[:, :2], particles.position(time, number)) and not mesh.points[:, 2].any()
    assert mesh.n_cells == mesh.n_verts == total
    assert np.array_equal(mesh.verts.reshape(-1, 2), np.stack([np.ones(total, int), number], axis=1))
    data = mesh.point_data
    assert np.array_equal(data["identifier"], number) and data["volume"][3] == np.float32(0.25)
    assert np.array_equal(data["velocity"][:, :2], particles.position(2.0 * time, number).astype(np.float32))
    assert np.array_equal(data["pressure"], (number * time).astype(np.float32))
    rows = [(1 + time), 2 * (1 + time), 0, 3 * (1 + time), 4 * (1 + time), 0, 0, 0, 0]
    assert np.allclose(data["gradient"][5], [value + 5 * (value > 0) for value in rows], rtol=1e-6)
    assert data["velocity"].shape == (total, 3) and data["rank"].dtype == np.int32


@needs_vtk
def test_vtk_reads_all_time_steps(comm, shared_path):
    particles = Particles(comm)
    series = FieldSeries(comm, shared_path / "fields.vtkhdf", 6)
    for time in TIMES:
        particles.write(series, time)
    assert np.array_equal(series.times, TIMES)
    double = FieldSeries(comm, shared_path / "double.vtkhdf", 1, double=True)
    particles.write(double, 0.1)
    with h5py.File(double.path, "r") as file:
        assert np.array_equal(file["VTKHDF/PointData/pressure"][()], np.arange(29) * 0.1)
    if comm.rank == 0:
        times, meshes = read_with_vtk(series.path)
        assert times == TIMES
        for time, mesh in zip(times, meshes):
            check_mesh(Particles(MPI.COMM_SELF), mesh, time)


def test_the_file_does_not_depend_on_the_number_of_ranks(comm, shared_path):
    for communicator, name in ((comm, "all"), (MPI.COMM_SELF, f"alone{comm.rank}")):
        series = FieldSeries(communicator, shared_path / f"{name}.vtkhdf", 3)
        for time in TIMES[:3]:
            Particles(communicator).write(series, time)
    assert (shared_path / "all.vtkhdf").read_bytes() == (shared_path / f"alone{comm.rank}.vtkhdf").read_bytes()


@needs_vtk
def test_a_file_laid_out_but_without_steps_opens(comm, shared_path):
    if comm.rank == 0:
        vtkhdf.lay_out(shared_path / "fields.vtkhdf", vtkhdf.Layout(5, 3, {"velocity": ((3,), "float32")}, {}))
        assert read_with_vtk(shared_path / "fields.vtkhdf") == ([], [])


@needs_vtk
def test_large_sets_are_cut_into_parts(comm, shared_path, monkeypatch):
    monkeypatch.setattr(vtkhdf, "PART", 10)
    particles = Particles(comm)
    series = FieldSeries(comm, shared_path / "fields.vtkhdf", 2)
    for time in TIMES[:2]:
        particles.write(series, time)
    if comm.rank == 0:
        _, meshes = read_with_vtk(series.path)
        for time, mesh in zip(TIMES, meshes):
            assert [part.n_verts for part in mesh] == [10, 10, 9]
            assert all(np.array_equal(part.verts[1::2], np.arange(part.n_points)) for part in mesh)
            points = np.concatenate([part.points for part in mesh])
            assert np.array_equal(points[:, :2], particles.position(time, np.arange(29)))


@pytest.mark.parametrize("more, room", [(2, 4), (7, 9)])
def test_resumed_series_equals_an_uninterrupted_one(comm, shared_path, more, room):
    particles = Particles(comm)
    whole = FieldSeries(comm, shared_path / "whole.vtkhdf", 4)
    killed = FieldSeries(comm, shared_path / "fields.vtkhdf", 4)
    for time in TIMES:
        particles.write(whole, time)
    # the run went on past the checkpoint at TIMES[1] before it was killed
    for time in TIMES[:3]:
        particles.write(killed, time)
    resumed = FieldSeries(comm, shared_path / "fields.vtkhdf", more, resume_at=TIMES[1])
    for time in TIMES[1:]:
        particles.write(resumed, time)
    assert np.array_equal(resumed.times, TIMES)
    with h5py.File(whole.path, "r") as one, h5py.File(killed.path, "r") as other:
        for name in ("Points", "PointData/velocity", "PointData/volume", "Vertices/Offsets", "Steps/Values"):
            expected = one["VTKHDF"][name][()]
            # a file with more room has it behind
            assert np.array_equal(expected, other["VTKHDF"][name][: len(expected)])
    assert vtkhdf.published(killed.path)[0].capacity == room
    assert sorted(path.name for path in shared_path.glob("*.vtkhdf*")) == ["fields.vtkhdf", "whole.vtkhdf"]


def test_a_packed_series_is_smaller_reads_the_same_and_is_gone_on_with(comm, shared_path):
    particles, path = Particles(comm, 500), shared_path / "fields.vtkhdf"
    series = FieldSeries(comm, path, 6)
    for time in TIMES[:2]:
        particles.write(series, time)
    before, plain = path.stat().st_size, {}
    names = ("Points", "PointData/velocity", "PointData/volume", "Vertices/Offsets", "Steps/Values")
    with h5py.File(path, "r") as file:
        plain = {name: file["VTKHDF"][name][()] for name in names}
    comm.Barrier()
    if comm.rank == 0:
        pack(path, 4)
    comm.Barrier()
    assert path.stat().st_size < 0.7 * before
    with h5py.File(path, "r") as file:
        for name, values in plain.items():
            found = file["VTKHDF"][name][()]
            assert np.array_equal(found, values[: len(found)]) and len(found) in (len(values), 1000), name
        assert file["VTKHDF"].attrs["Type"] == b"PolyData"
    if importlib.util.find_spec("pyvista"):
        times, meshes = read_with_vtk(path)
        assert times == TIMES[:2]
        for time, mesh in zip(times, meshes):
            check_mesh(particles, mesh, time, 500)
    resumed = FieldSeries(comm, path, 4, resume_at=TIMES[0])
    particles.write(resumed, TIMES[2])
    assert np.array_equal(vtkhdf.published(path)[1], [TIMES[0], TIMES[2]])


@pytest.mark.parametrize("other", ["torn", "of fewer particles", "of other fields"])
def test_a_file_that_does_not_fit_is_set_aside(comm, shared_path, other):
    path = shared_path / "fields.vtkhdf"
    if other == "torn":
        if comm.rank == 0:
            path.write_bytes(b"\x89HDF\r\n")
        comm.Barrier()
    else:
        particles = Particles(comm, 11 if other == "of fewer particles" else 29)
        fields = particles.varying(0.0)
        if other == "of other fields":
            del fields["pressure"]
        place = particles.position(0.0)
        FieldSeries(comm, path, 4).write(0.0, particles.identifier, place, fields, particles.constant())
    before = path.read_bytes()
    comm.Barrier()
    series = FieldSeries(comm, path, 4, resume_at=0.0)
    Particles(comm).write(series, 0.5)
    assert (shared_path / "fields.1.vtkhdf").read_bytes() == before
    assert np.array_equal(vtkhdf.published(path)[1], [0.5])


def test_a_full_file_is_followed_by_another(comm, shared_path):
    particles = Particles(comm)
    series = FieldSeries(comm, shared_path / "fields.vtkhdf", 3)
    for time in TIMES:
        particles.write(series, time)
    assert np.array_equal(vtkhdf.published(shared_path / "fields.1.vtkhdf")[1], TIMES[:3])
    assert np.array_equal(vtkhdf.published(shared_path / "fields.vtkhdf")[1], TIMES[3:])


def test_going_back_in_time_other_fields_and_missing_particles_are_refused_on_all_ranks(comm, shared_path):
    particles = Particles(comm)
    series = FieldSeries(comm, shared_path / "fields.vtkhdf", 3)
    particles.write(series, 1.0)
    with pytest.raises(OutputError, match="0.5 s"):
        particles.write(series, 0.5)
    with pytest.raises(OutputError, match="'pressure'"):
        series.write(2.0, particles.identifier, particles.position(2.0), {"velocity": particles.position(2.0)})
    for wrong in (particles.identifier[-1], 29):
        if comm.rank == 0:
            particles.identifier[0] = wrong
        with pytest.raises(OutputError, match="identifier: "):
            particles.write(series, 2.0)
    assert np.array_equal(vtkhdf.published(series.path)[1], [1.0])


@needs_vtk
def test_publishing_a_step_changes_one_block_of_the_file_last(comm, shared_path):
    """Whatever was written when the run was killed, a reader sees the steps before or after, never a mixture."""
    if comm.rank > 0:
        return
    particles = Particles(MPI.COMM_SELF)
    series = FieldSeries(MPI.COMM_SELF, shared_path / "fields.vtkhdf", 4)
    for time in TIMES[:2]:
        particles.write(series, time)
    before = series.path.read_bytes()
    particles.write(series, TIMES[2])
    after = series.path.read_bytes()
    assert len(before) == len(after)
    with h5py.File(series.path, "r") as file:
        header = h5py.h5o.get_info(file["series/shown"].id).addr
    changed = [i for i in range(len(before)) if before[i] != after[i]]
    link = [i for i in changed if header <= i < header + 512]
    # everything but the link written: the new step does not show, the old ones do
    torn = bytearray(after)
    torn[header : header + 512] = before[header : header + 512]
    (shared_path / "torn.vtkhdf").write_bytes(torn)
    assert link and max(link) - min(link) < 200
    assert np.array_equal(vtkhdf.published(shared_path / "torn.vtkhdf")[1], TIMES[:2])
    times, meshes = read_with_vtk(shared_path / "torn.vtkhdf")
    assert times == TIMES[:2]
    check_mesh(particles, meshes[1], TIMES[1])


def test_a_run_writes_while_someone_looks_at_the_file(comm, shared_path):
    particles = Particles(comm)
    series = FieldSeries(comm, shared_path / "fields.vtkhdf", 3)
    particles.write(series, 0.0)
    comm.Barrier()
    if comm.rank == 0:
        # another process holds HDF5's lock on the file, as ParaView does
        code = "import h5py, sys; f = h5py.File(sys.argv[1], 'r'); print('open', flush=True); sys.stdin.read()"
        looking = subprocess.Popen([sys.executable, "-c", code, series.path], stdin=-1, stdout=-1)
        assert looking.stdout.readline() == b"open\n"
    comm.Barrier()
    particles.write(series, 1.0)
    if comm.rank == 0:
        looking.communicate()
    assert np.array_equal(vtkhdf.published(series.path)[1], [0.0, 1.0])


@pytest.mark.serial
def test_a_file_that_finds_no_room_is_not_there(tmp_path):
    with pytest.raises(OSError, match="."):
        probe(tmp_path / "fields.vtkhdf.partial", 2**62)
    assert not list(tmp_path.iterdir())
