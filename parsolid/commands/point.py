"""`parsolid point`: integrate a law along a prescribed deformation of a material point, on one rank."""

import os
import time as clock
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.commands.arguments import TRUST_CODE, refuse_files
from parsolid.materials.registry import law_at_origin
from parsolid.output.errors import OutputError, words
from parsolid.output.summary import provenance, write_summary
from parsolid.point.driver import integrate, point_law, tabulate
from parsolid.point.laws import PathLost
from parsolid.point.schema import MaterialPoint, load_point
from parsolid.scene.validation_errors import SceneError
from parsolid.simulation.loop import RunFailed

_SHOWN = (
    *("von_mises_stress", "plastic_strain_rate", "micro_stress"),
    *("plastic_strain", "temperature", "heat_given_away"),
)
TABLE, PICTURE, SUMMARY = "point.csv", "point.png", "point_summary.json"


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    parser.add_argument("path", metavar="PATH", help="TOML file with a material and a path of deformation")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder of the results (default: that of the file)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY.PATH=VALUE", help="override a key")
    parser.add_argument("--trust-code", action="store_true", help=TRUST_CODE)
    parser.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors")


def run_point(comm: Any, options: Any) -> int:
    """Integrate a material point on rank 0; exit status 0. Collective.

    Raises SceneError (bad input), OutputError or RunFailed (the path cannot be followed) on all ranks.
    """
    failure = None
    if comm.rank == 0:
        try:
            drive_and_report(options)
        except (SceneError, OutputError, RunFailed) as error:
            failure = (type(error), *error.args)
    failure = comm.bcast(failure)
    if failure is not None:
        raise failure[0](*failure[1:])
    return 0


def drive_and_report(options: Any) -> dict[str, Any]:
    """Read the file, integrate the point and write the results; the summary. For one rank.

    Raises SceneError, OutputError, or RunFailed if the path cannot be followed.
    """
    point = load_point(options.path, options.set, options.trust_code)
    directory = _prepared(Path(options.output or point.output.directory), point, options.path)
    began = clock.perf_counter()
    law = point_law(law_at_origin(point.material), **point.conditions)
    try:
        record = integrate(law, point.path, point.end_time, point.longest_step)
    except PathLost as error:
        raise RunFailed(str(error)) from None
    columns = tabulate(law, record, np.array(point.output.directions))
    summary = summarise(point, columns, clock.perf_counter() - began)
    # 17 digits are exact
    path = directory / TABLE
    partial = path.with_name(path.name + ".partial")
    try:
        with open(partial, "w", encoding="utf-8") as file:
            file.write(",".join(columns) + "\n")
            np.savetxt(file, np.column_stack(list(columns.values())), fmt="%.17g", delimiter=",")
        os.replace(partial, path)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {words(error)}") from error
    summary["picture"] = _picture(point, columns, directory)
    write_summary(directory / SUMMARY, summary | provenance())
    if not options.quiet:
        print(describe(summary, directory), flush=True)
    return summary


def summarise(point: MaterialPoint, columns: dict[str, np.ndarray], seconds: float) -> dict[str, Any]:
    """The summary of a point; the energy error is relative to the largest energy."""
    scale = max(np.abs(columns[name]).max() for name in ("strain_energy", "work", "dissipation"))
    worst = np.abs(columns["energy_error"]).max()
    shown = [name for name in _SHOWN if name in columns]
    return {
        "title": point.title,
        "material": point.material.kind,
        "path": point.path.kind,
        "end_time": point.end_time,
        "rows": len(columns["time"]),
        "wall_time": seconds,
        "energy_error": worst,
        "energy_error_share": worst / scale if scale > 0.0 else 0.0,
        "strain_energy_at_start": columns["strain_energy"][0],
        "strain_energy_at_end": columns["strain_energy"][-1],
        "dissipation_at_end": columns["dissipation"][-1],
        "work_at_end": columns["work"][-1],
        **{f"{name}_at_end": columns[name][-1] for name in shown},
        "largest_von_mises_stress": columns["von_mises_stress"].max(),
        "smallest_jacobian": columns["jacobian"].min(),
        "largest_pressure_wave_speed": columns["largest_pressure_wave_speed"].max(),
        "smallest_acoustic_eigenvalue": columns["smallest_acoustic_eigenvalue"].min(),
        "hyperbolic": bool((columns["smallest_acoustic_eigenvalue"] > 0.0).all()),
        "input": point.resolved(),
    }


def describe(summary: dict[str, Any], directory: Path) -> str:
    """The summary in a few lines."""
    title, end = summary["title"] or "material point", summary["end_time"]
    stored = summary["strain_energy_at_end"] - summary["strain_energy_at_start"]
    hyperbolic = "hyperbolic" if summary["hyperbolic"] else "NOT hyperbolic"
    head = f"{title}: {summary['material']}, {summary['path']}, {summary['rows']} rows to t = {end:g} s"
    energy = f"  work {summary['work_at_end']:.6g} = newly stored {stored:.6g}"
    energy += f" + dissipated {summary['dissipation_at_end']:.6g} J/m^3"
    waves = f"  von Mises stress up to {summary['largest_von_mises_stress']:.6g} Pa"
    waves += f", pressure waves up to {summary['largest_pressure_wave_speed']:.6g} m/s"
    waves += f", smallest acoustic eigenvalue {summary['smallest_acoustic_eigenvalue']:.6g} Pa ({hyperbolic})"
    lines = [f"{head} in {summary['wall_time']:.2g} s"]
    lines += [f"{energy}, off by at most {summary['energy_error_share']:.1e} of the largest", waves]
    if "plastic_strain_at_end" in summary:
        strain, temperature = summary["plastic_strain_at_end"], summary["temperature_at_end"]
        lines.append(f"  plastic strain {strain:.6g}, temperature {temperature:.6g} K at the end")
    if "micro_stress_at_end" in summary:
        norm, rate, stress = (summary[f"{name}_at_end"] for name in _SHOWN[:3])
        plastic = f"  von Mises stress {norm:.6g} Pa, plastic strain rate {rate:.6g} 1/s"
        lines.append(f"{plastic}, micro-stress {stress:.6g} Pa at the end")
    return "\n".join([*lines, f"  {directory / TABLE}; picture: {summary['picture']}"])


def _prepared(directory: Path, point: MaterialPoint, source: str) -> Path:
    """Make the folder of the results; raises OutputError also if an input file would be overwritten."""
    refuse_files(output=directory)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder {directory}: {words(error)}") from error
    inputs = {Path(name).resolve() for name in (source, getattr(point.path, "file", None)) if name}
    for name in (TABLE, PICTURE, SUMMARY):
        if (directory / name).resolve() in inputs:
            raise OutputError(f"{directory / name}: is read by this command; choose another folder (-o DIR)")
    return directory


def _picture(point: MaterialPoint, columns: dict[str, np.ndarray], directory: Path) -> str:
    """Draw the picture; its path, or the reason why there is none."""
    if not point.output.pictures:
        return "not wanted"
    try:
        from parsolid.commands.point_picture import draw
    except ImportError as error:
        return f"none, because {error.name or 'matplotlib'} is not installed (pip install 'parsolid[plot]')"
    draw(directory / PICTURE, point.title, columns)
    return str(directory / PICTURE)
