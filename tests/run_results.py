"""Read the results of a run and compare those of two."""

import json
from pathlib import Path

import h5py
import numpy as np
from mpi4py import MPI

from parsolid.output import vtkhdf
from parsolid.output.checkpoint import read_checkpoint
from parsolid.output.history import read_history
from parsolid.scene.observation import HISTORY_COLUMNS


def history(folder: Path) -> dict[str, np.ndarray]:
    """Columns of the history."""
    return {name: np.array(values) for name, values in read_history(folder / "history.csv").items()}


def state(folder: Path) -> tuple[dict, dict[str, np.ndarray], np.ndarray]:
    """Header, fields in the order of the file and ledgers of the ranks of the last checkpoint, of one system."""
    header, (fields,), ledgers = states(folder)
    return header, fields, ledgers


def states(folder: Path) -> tuple[dict, list[dict[str, np.ndarray]], np.ndarray]:
    """The same with the fields of each system."""
    return read_checkpoint(MPI.COMM_SELF, folder / "checkpoint.h5")


def summary(folder: Path) -> dict:
    """The summary."""
    return json.loads((folder / "summary.json").read_text())


def natural_scales(columns: dict[str, np.ndarray]) -> dict[str, float]:
    """What a difference in each column is measured against.

    It is the column's greatest magnitude, but a column that is zero but for rounding has no such measure: for energies
    it is at least a thousandth of the greatest energy, and for a component of a probe's vector or tensor a thousandth
    of its greatest one.
    """
    scales = {name: np.abs(values).max() for name, values in columns.items()}
    energy = max(scales[name] for name in HISTORY_COLUMNS if name in scales)
    for name in columns:
        # heat that only moves within bodies is supplied but for rounding, in any of several systems, as is the work of
        # a viscosity that a scene turns off, and the offset of a kinetic energy at rest
        if name in HISTORY_COLUMNS or name.startswith(("heat_supplied", "viscous_work", "kinetic_offset")):
            scales[name] = max(scales[name], 1e-3 * energy)
        elif "." in name:
            family = [other for other in columns if other.rpartition("_")[0] == name.rpartition("_")[0] != ""]
            scales[name] = max([1e-3 * scales[other] for other in family] + [scales[name]])
    scales["energy_error"] = energy
    # momenta and displacements that symmetry keeps at zero still compare with something
    return {name: scale if scale > 0.0 else 1.0 for name, scale in scales.items()}


def assert_close(found: Path, expected: Path, tolerance: float) -> None:
    """The histories and final states of two runs agree to a tolerance relative to `natural_scales`."""
    one, other = history(found), history(expected)
    assert list(one) == list(other)
    assert np.array_equal(one["step"], other["step"]) and len(one["step"]) > 1
    scales = natural_scales(other)
    worst = {name: float(np.abs(one[name] - other[name]).max() / scales[name]) for name in one}
    assert max(worst.values()) <= tolerance, {name: value for name, value in worst.items() if value > tolerance}
    for one, other in zip(states(found)[1], states(expected)[1], strict=True):
        _assert_fields_close(one, other, tolerance)


def _assert_fields_close(one: dict, other: dict, tolerance: float) -> None:
    assert set(one) == set(other)
    orders = [np.argsort(fields["identifier"]) for fields in (one, other)]
    # places at which lists were made differ where another number of ranks has made them anew; rates and curvatures of
    # paths guess the next equilibrium and are differences of what was solved for, over steps of any length
    for name in set(other) - {"listed_position", "displacement_rate", "displacement_curvature"}:
        values, wanted = one[name][orders[0]], other[name][orders[1]]
        scale = np.abs(wanted).max() or 1.0
        assert np.abs(values - wanted).max() <= tolerance * scale, name


def assert_same_bits(found: Path, expected: Path) -> None:
    """The rows of the histories and all that is in the final checkpoints are equal to the last bit."""
    rows, wanted_rows = ((folder / "history.csv").read_text().splitlines() for folder in (found, expected))
    assert rows == wanted_rows
    (header, systems, ledgers), (wanted_header, wanted_systems, wanted_ledgers) = states(found), states(expected)
    assert header["step"] == wanted_header["step"] and header["time"] == wanted_header["time"]
    assert header["probes"] == wanted_header["probes"]
    for fields, wanted in zip(systems, wanted_systems, strict=True):
        assert list(fields) == list(wanted)
        for name in wanted:
            assert fields[name].tobytes() == wanted[name].tobytes(), name
    assert ledgers.tobytes() == wanted_ledgers.tobytes()
    assert_same_series(found, expected)


def assert_same_series(found: Path, expected: Path) -> None:
    """The field series hold the same steps, to the last bit."""
    names, wanted = ({path.name for path in folder.glob("fields*.vtkhdf")} for folder in (found, expected))
    assert names == wanted
    # one of several systems links to a file of each
    for name in sorted(names - {"fields.vtkhdf"} or names):
        _assert_same_file(found / name, expected / name)


def _assert_same_file(found: Path, expected: Path) -> None:
    (layout, times), (wanted_layout, wanted_times) = vtkhdf.published(found), vtkhdf.published(expected)
    assert np.array_equal(times, wanted_times) and len(times) > 0
    assert layout.varying == wanted_layout.varying
    rows = len(times) * layout.particles
    with h5py.File(found) as one, h5py.File(expected) as other:
        for name in ("Points", *(f"PointData/{field}" for field in layout.varying)):
            assert one[f"VTKHDF/{name}"][:rows].tobytes() == other[f"VTKHDF/{name}"][:rows].tobytes(), name
