"""The material point: closed forms, orders, paths, faults, files."""

import csv
import json
from argparse import ArgumentParser
from pathlib import Path

import numpy as np
import pytest
from points import followed

from parsolid.commands.point import add_arguments, run_point
from parsolid.materials.hyperelastic import evaluation
from parsolid.materials.viscoelastic.maxwell import branch_energy
from parsolid.output.errors import OutputError
from parsolid.point.schema import load_point
from parsolid.scene.validation_errors import SceneError
from parsolid.simulation.loop import RunFailed

# one rank does it all, and tells the others of an error
pytestmark = pytest.mark.serial
EXAMPLES = Path(__file__).parents[2] / "runs" / "point"
TENSOR = ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz")
MATERIAL = """
[material]
kind = "mooney-rivlin"
density = 1100
youngs_modulus = 17e6
poissons_ratio = 0.45
zeta = 1e6
branches = [{ beta = 3.0, tau = 0.02 }, { beta = 1.0, tau = 1e-4 }]
"""
ELASTIC = MATERIAL.replace("branches = [{ beta = 3.0, tau = 0.02 }, { beta = 1.0, tau = 1e-4 }]", "")


@pytest.fixture
def driven(point_of):
    """The columns of a point stated as TOML."""

    def make(path, material=MATERIAL, head="end_time = 0.1\nsteps = 40\n"):
        return followed(point_of(f"{head}{material}[path]\n{path}\n"))

    return make


def tensors(columns, name):
    """Tensors (n, 3, 3) of nine columns."""
    return np.stack([columns[f"{name}_{c}"] for c in TENSOR], axis=1).reshape(-1, 3, 3)


def branch(columns, alpha):
    """A_alpha (n, 3, 3)."""
    columns_of = [columns[f"branch_{alpha + 1}.A_{''.join(sorted(c))}"] for c in TENSOR]
    return np.stack(columns_of, axis=1).reshape(-1, 3, 3)


HOLDS = {
    "uniaxial": 'kind = "uniaxial"\nstretch = 1.6\nlateral = "fixed"',
    "compression": 'kind = "uniaxial"\nstretch = 0.3\nlateral = "fixed"',
    "shear": 'kind = "simple-shear"\nshear = 0.8',
    "isochoric": 'kind = "isochoric"\nstretch = 2\n',
    "planar": 'kind = "isochoric"\nstretch = 2\nplanar = true',
    "volumetric": 'kind = "volumetric"\njacobian = 0.7',
    "cyclic": """kind = "table"
interpolation = "constant"
columns = ["time", "deformation_gradient_xy"]
rows = [[0, 0.5], [0.02, 0], [0.04, -0.5], [0.06, 0], [0.08, 0.5]]""",
}


def energies(law, F, A):
    """W_infinity and W_alpha (m,) [J/m^3] of a state with A (m, 3, 3)."""
    C, J = tuple(evaluation.symmetric_rows(F.T @ F)[0]), np.linalg.det(F)
    rows = map(tuple, evaluation.symmetric_rows(A))
    return evaluation.energies(law, F), np.array([branch_energy(mu, C, J, a) for mu, a in zip(law.branch_moduli, rows)])


@pytest.mark.parametrize("path", HOLDS.values(), ids=HOLDS)
@pytest.mark.parametrize("steps", [5, 200])
def test_holds_follow_the_closed_form(driven, path, steps):
    """A(t) = C^-1 + (A_0 - C^-1) exp(-t/tau) after each jump; stress, energies and dissipation follow from it."""
    run = driven(path, head=f"end_time = 0.1\nsteps = {steps}\n")
    columns, law = run.columns, run.law.law
    F, times = tensors(columns, "deformation_gradient"), columns["time"]
    # the first row is the virgin state, and a jump has two rows
    assert times[0] == times[1] == 0.0 and columns["strain_energy"][0] == 0.0 and (F[0] == np.eye(3)).all()
    A, lost, work = np.array([np.eye(3), np.eye(3)]), 0.0, 0.0
    for n in range(1, len(times)):
        elapsed, decay = times[n] - times[n - 1], None
        before = energies(law, F[n], A)
        if elapsed == 0.0:
            # the work of a jump is what is stored
            work += before[0] + before[1].sum()
            work -= sum(part.sum() for part in energies(law, F[n - 1], A))
        else:
            assert np.array_equal(F[n], F[n - 1])
            inverse = np.linalg.inv(F[n].T @ F[n])
            decay = np.exp(-elapsed / np.array(law.relaxation_times))[:, None, None]
            A = inverse + (A - inverse) * decay
            lost += (before[1] - energies(law, F[n], A)[1]).sum()
        for alpha in range(2):
            assert branch(columns, alpha)[n] == pytest.approx(A[alpha], rel=1e-12, abs=1e-12)
        P = tensors(columns, "first_piola_kirchhoff_stress")[n]
        largest = np.abs(tensors(columns, "first_piola_kirchhoff_stress")).max()
        assert P == pytest.approx(
            evaluation.stresses(law, F[n], np.einsum("a,aij->ij", law.branch_moduli, A)), abs=1e-12 * largest
        )
        scale = columns["work"].max()
        equilibrium, viscous = energies(law, F[n], A)
        assert columns["strain_energy"][n] == pytest.approx(equilibrium + viscous.sum(), abs=1e-12 * scale)
        assert columns["dissipation"][n] == pytest.approx(lost, abs=1e-12 * scale)
        assert columns["work"][n] == pytest.approx(work, abs=1e-12 * scale)
    assert np.abs(columns["energy_error"]).max() <= 1e-12 * columns["work"].max()


@pytest.mark.parametrize(
    "path", ['kind = "simple-shear"\nshear = "8*t"', 'kind = "cyclic-shear"\namplitude = 0.5\nperiod = 0.1']
)
def test_elastic_work_is_what_is_stored(driven, path):
    columns = driven(path, ELASTIC, "end_time = 0.1\nsteps = 60\n").columns
    assert np.all(columns["dissipation"] == 0.0)
    assert np.abs(columns["energy_error"]).max() <= 2e-10 * columns["work"].max()
    columns = driven(path, ELASTIC, "end_time = 0.1\nsteps = 300\n").columns
    assert np.abs(columns["energy_error"]).max() <= 1e-13 * columns["work"].max()


@pytest.mark.slow
@pytest.mark.parametrize("path", ['kind = "isochoric"\nstretch = "1 + 8*t"', 'kind = "uniaxial"\nstretch = "1 + 5*t"'])
def test_moving_paths_are_of_second_order(driven, path):
    material = MATERIAL.replace("tau = 1e-4", "tau = 0.2")
    runs = [driven(path, material, f"end_time = 0.1\nsteps = {steps}\n").columns for steps in (20, 40, 80, 160)]
    for quantity in ("first_piola_kirchhoff_stress_xx", "branch_1.A_xx", "dissipation", "work"):
        # what each halving of the step changes
        changes = np.abs(np.diff([columns[quantity][-1] for columns in runs]))
        assert np.log2(changes[:-1] / changes[1:]) == pytest.approx([2.0, 2.0], abs=0.12), quantity
    balance = [np.abs(columns["energy_error"]).max() for columns in runs]
    assert np.log2(np.array(balance[:-1]) / balance[1:]) == pytest.approx([2.0, 2.0, 2.0], abs=0.2)


def test_uniaxial_stretch_with_free_sides(driven):
    path = 'kind = "uniaxial"\nstretch = "where(t < 0.05, 1 + 10*t, 1.2)"\nbreaks = [0.05]'
    columns = driven(path).columns
    assert columns["stress_xx"].max() > 1e6
    for name in ("stress_yy", "stress_zz"):
        assert np.abs(columns[name]).max() <= 1e-9 * columns["stress_xx"].max()
    # the jump from 1.5 to 1.2 has two rows, and the sides follow it at once
    at = np.flatnonzero(columns["time"] == 0.05)
    assert columns["deformation_gradient_xx"][at] == pytest.approx([1.5, 1.2])
    assert columns["deformation_gradient_yy"][at[1]] > columns["deformation_gradient_yy"][at[0]]


def test_dissipation_of_a_small_cycle_is_that_of_linear_viscoelasticity(driven):
    # loss modulus mu_1 omega tau / (1 + (omega tau)^2), energy pi G'' gamma^2 a cycle
    material = MATERIAL.replace(", { beta = 1.0, tau = 1e-4 }", "")
    period, amplitude = 0.1, 1e-3
    run = driven(
        f'kind = "cyclic-shear"\namplitude = {amplitude}\nperiod = {period}', material, "end_time = 0.4\nsteps = 2000\n"
    )
    x = 2.0 * np.pi / period * 0.02
    expected = np.pi * run.law.law.branch_moduli[0] * x / (1.0 + x * x) * amplitude**2
    lost = run.columns["dissipation"]
    assert lost[-1] - lost[-501] == pytest.approx(expected, rel=1e-4)


def test_ten_branches_over_eight_decades(driven):
    branches = ", ".join(f"{{ beta = 0.2, tau = {10.0 ** (k * 8 / 9 - 7):g} }}" for k in range(10))
    material = f"{ELASTIC}branches = [{branches}]\n"
    for path in (HOLDS["uniaxial"], 'kind = "cyclic-shear"\namplitude = 0.5\nperiod = 0.05'):
        columns = driven(path, material, "end_time = 0.1\nsteps = 400\n").columns
        assert np.diff(columns["dissipation"]).min() >= 0.0
        assert np.abs(columns["energy_error"]).max() <= 2e-4 * columns["work"].max()
        assert columns["smallest_acoustic_eigenvalue"].min() > 0.0
        # branches far faster than the step are relaxed but for their lag, far slower ones untouched
        F = tensors(columns, "deformation_gradient")[-1]
        assert branch(columns, 0)[-1] == pytest.approx(np.linalg.inv(F.T @ F), abs=2e-5)
        assert branch(columns, 9)[-1] == pytest.approx(np.eye(3), abs=0.02)


def test_wave_speeds_along_chosen_directions(write):
    path = write(
        f"end_time = 1\nsteps = 1\n{MATERIAL}[path]\n{HOLDS['shear']}\n[output]\ndirections = [[2, 0, 0], [1, 1, 1]]\n"
    )
    columns = followed(load_point(path)).columns
    assert "direction_3.pressure_wave_speed" not in columns
    for k in (1, 2):
        slow, fast, pressure = (
            columns[f"direction_{k}.{kind}_wave_speed"] for kind in ("slow_shear", "fast_shear", "pressure")
        )
        assert (slow <= fast).all() and (fast < pressure).all()
        assert (pressure <= columns["largest_pressure_wave_speed"] * (1.0 + 1e-12)).all()
        assert (fast <= columns["largest_shear_wave_speed"] * (1.0 + 1e-12)).all()
        assert (slow**2 * 1100 >= columns["smallest_acoustic_eigenvalue"] * (1.0 - 1e-12)).all()


TABLE = 'kind = "table"\ncolumns = ["time", "deformation_gradient_xy", "deformation_gradient_xx"]\n'


def test_a_linear_table_steps_onto_its_rows(driven):
    rows = "rows = [[0, 0, 1], [0.03, 0.6, 1.1], [0.03, 0.2, 1.1], [0.1, -0.2, 1]]"
    columns = driven(TABLE + rows, head="end_time = 0.1\nsteps = 7\n").columns
    at = np.flatnonzero(columns["time"] == 0.03)
    assert columns["deformation_gradient_xy"][at] == pytest.approx([0.6, 0.2])
    assert columns["deformation_gradient_xx"][-1] == 1.0
    after = columns["time"] >= 0.03
    expected = 0.2 - 0.4 * (columns["time"][after][1:] - 0.03) / 0.07
    assert columns["deformation_gradient_xy"][after][1:] == pytest.approx(expected, abs=1e-12)


def test_a_cubic_table_is_smooth(driven):
    times = np.linspace(0.0, 0.1, 21)
    rows = ", ".join(f"[{t}, {0.5 * np.sin(30 * t)}, 1]" for t in times)
    run = driven(f'{TABLE}rows = [{rows}]\ninterpolation = "cubic"', head="end_time = 0.1\nsteps = 50\n")
    expected = 0.5 * np.sin(30.0 * run.columns["time"])
    assert run.columns["deformation_gradient_xy"] == pytest.approx(expected, abs=2e-5)


def test_the_table_of_one_point_drives_another(write, comm, shared_path, driven):
    source = write(
        f"end_time = 0.1\nsteps = 50\n{MATERIAL}[path]\nkind = 'uniaxial'\nstretch = '1 + 3*t'\n", "first.toml"
    )
    run_point(comm, options(source, shared_path / "first", output__pictures="false"))
    (first,) = read(shared_path / "first" / "point.csv")
    second = driven('kind = "table"\nfile = "first/point.csv"', head="end_time = 0.1\nsteps = 50\n").columns
    assert second["first_piola_kirchhoff_stress_xx"][-1] == pytest.approx(
        first["first_piola_kirchhoff_stress_xx"][-1], rel=1e-5
    )
    assert second["deformation_gradient_yy"] == pytest.approx(first["deformation_gradient_yy"], abs=1e-12)


def test_a_table_file_with_prefix(write, driven):
    write("step,time,dt,corner.deformation_gradient_xx\n0,0,1,1\n1,0.1,1,1.5\n", "history.csv")
    columns = driven('kind = "table"\nfile = "history.csv"\nprefix = "corner."').columns
    assert columns["deformation_gradient_xx"][-1] == 1.5
    assert columns["deformation_gradient_yy"][-1] == 1.0


# a path and the key at fault
FAULTS = {
    'kind = "uniaxal"\nstretch = 1': "path.kind",
    'kind = "uniaxial"': "path.stretch",
    'kind = "uniaxial"\nstretch = "1 + X"': "path.stretch",
    'kind = "uniaxial"\nstretch = "1 - 20*t"\nlateral = "fixed"': "path",
    'kind = "uniaxial"\nstretch = 1\nlatral = "free"': "path.latral",
    'kind = "simple-shear"\nshear = 1\nbreaks = [3]': "path.breaks.0",
    'kind = "formulas"\ndeformation_gradient = [[1, "free", 0], [0, 1, 0], [0, 0, 1]]': "path.deformation_gradient.0.1",
    'kind = "formulas"\ndeformation_gradient = [[1, 0], [0, 1]]': "path.deformation_gradient.0",
    'kind = "table"\nfile = "nowhere.csv"': "path.file",
    'kind = "table"': "path",
    'kind = "table"\nrows = [[0, 1]]': "path",
    'kind = "table"\ncolumns = ["time", "Fxx"]\nrows = [[0, 1]]': "path.rows",
    TABLE + "rows = [[0, 0, 1], [0.2, 0.1]]": "path.rows",
    TABLE + "rows = [[0, 0, 1], [0.2, 0.1, 1], [0.1, 0, 1]]": "path.rows",
    TABLE + "rows = [[0.01, 0, 1], [0.2, 0.1, 1]]": "path.rows",
    TABLE + "rows = [[0, 0, 1], [0.05, 0.1, 1]]": "end_time",
}


@pytest.mark.parametrize("path", FAULTS)
def test_bad_paths_are_told(write, path):
    with pytest.raises(SceneError) as caught:
        load_point(write(f"end_time = 0.1\nsteps = 10\n{MATERIAL}[path]\n{path}\n"))
    assert any(fault.partition(": ")[0] == FAULTS[path] for fault in caught.value.faults)


def test_all_faults_at_once(write):
    text = "end_time = -1\nsteps = 0\ntime_step = 0.1\nstep = 3\n[path]\nkind = 'volumetric'\n"
    text += "[output]\ndirections = [[0, 0, 0]]\n"
    with pytest.raises(SceneError) as caught:
        load_point(write(text), ["nonsense"])
    keys = ("end_time", "steps", "steps, time_step", "'step'", "material", "path.jacobian", "directions.0", "nonsense")
    assert all(key in str(caught.value) for key in keys)
    with pytest.raises(SceneError, match="^time_step: "):
        load_point(write(f"end_time = 1\ntime_step = 1e-9\n{MATERIAL}[path]\n{HOLDS['shear']}\n"))


def options(path, output=None, **more):
    """A command line."""
    parser = ArgumentParser()
    add_arguments(parser)
    settings = [word for key, value in more.items() for word in ("--set", f"{key.replace('__', '.')}={value}")]
    return parser.parse_args([str(path), "-q", *settings, *(["-o", str(output)] if output else [])])


def read(*paths):
    """The columns of CSV files, as every rank reads them."""
    result = []
    for path in paths:
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
        result.append({name: np.array([float(row[name]) for row in rows]) for name in rows[0]})
    return result


BOUNDS = {"uniaxial": 1.6e-4, "shear": 1e-6, "cyclic": 1e-4, "relaxation": 1e-12, "prony": 1e-4, "prony_finite": 1e-4}


@pytest.mark.slow
@pytest.mark.parametrize("name", BOUNDS)
def test_examples(comm, shared_path, name):
    # a quarter of the steps of the longest one, whose sides are sought in each
    fewer = {"steps": 250} if name == "uniaxial" else {}
    assert run_point(comm, options(EXAMPLES / f"{name}.toml", shared_path, output__pictures="false", **fewer)) == 0
    (columns,) = read(shared_path / "point.csv")
    summary = json.loads((shared_path / "point_summary.json").read_text())
    assert summary["rows"] == len(columns["time"]) > 10
    assert summary["hyperbolic"] is True and summary["energy_error_share"] <= BOUNDS[name]
    assert summary["input"]["path"]["kind"] in (EXAMPLES / f"{name}.toml").read_text()
    assert np.diff(columns["dissipation"]).min() >= 0.0


@pytest.mark.mpi
def test_table_holds_the_numbers_to_the_last_bit(write, comm, shared_path, driven):
    path = write(f"end_time = 0.1\nsteps = 40\n{MATERIAL}[path]\n{HOLDS['shear']}\n", "first.toml")
    run_point(comm, options(path, shared_path / "out", output__pictures="false"))
    (columns,) = read(shared_path / "out" / "point.csv")
    direct = driven(HOLDS["shear"]).columns
    assert list(columns) == list(direct)
    assert all(np.array_equal(columns[name], direct[name]) for name in columns)


def test_picture(comm, shared_path):
    pytest.importorskip("matplotlib")
    run_point(comm, options(EXAMPLES / "relaxation.toml", shared_path))
    assert (shared_path / "point.png").read_bytes()[:4] == b"\x89PNG"
    assert json.loads((shared_path / "point_summary.json").read_text())["picture"].endswith("point.png")


@pytest.mark.mpi
def test_a_path_that_collapses_on_its_way_is_a_failed_run(write, comm, shared_path):
    # with free sides, what becomes of J is known only on the way
    text = f"end_time = 1\nsteps = 100\n{MATERIAL}[path]\nkind = 'uniaxial'\nstretch = '1 - 2*t'\n"
    with pytest.raises(RunFailed, match=r"J = .* at t = 0\.5"):
        run_point(comm, options(write(text), shared_path / "out"))
    with pytest.raises(SceneError) as caught:
        run_point(comm, options(write("end_time = 1\n"), shared_path))
    assert len(caught.value.faults) >= 3


def test_its_own_table_is_not_written_over(write, comm, shared_path):
    write("time,deformation_gradient_xx\n0,1\n1,1.5\n", "point.csv")
    path = write(f"end_time = 1\nsteps = 10\n{MATERIAL}[path]\nkind = 'table'\nfile = 'point.csv'\n")
    with pytest.raises(OutputError, match="point.csv: is read by this command"):
        run_point(comm, options(path, shared_path))
