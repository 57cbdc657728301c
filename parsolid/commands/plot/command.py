"""The pictures of `parsolid plot`: their fields, times and files."""

import argparse
import ctypes.util
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.api.pictures import missing
from parsolid.commands.arguments import refuse_files
from parsolid.commands.plot import FOLDER, STANDARD_PARTICLES, STANDARD_TIMES, add_arguments
from parsolid.output.results import Results
from parsolid.output.summary import read_summary
from parsolid.scene import SceneError
from parsolid.scene.observed import NODAL_VON_MISES
from parsolid.scene.validation_errors import describe, suggestion

# the first field that was written is drawn
_VON_MISES = (NODAL_VON_MISES, "von_mises_stress")
_STILL, _MOVING = (".png", ".pdf", ".svg"), (".gif", ".mp4")


def draw(options: argparse.Namespace) -> list[Path]:
    """Draw the pictures of the options; their paths. Raises SceneError before anything is drawn, and OSError."""
    _check_packages()
    results = Results(options.directory)
    output = Path(options.output) if options.output else results.directory / FOLDER
    one_file = output.suffix.lower() in _STILL + _MOVING
    faults = _faults(results, options, output, one_file)
    if faults:
        raise SceneError(faults)
    fields = [options.field] if options.field else pictured_fields(results)
    for field in fields:
        results.check_field(field)
    if (results.directory / "summary.json").exists():
        # refuses a damaged one
        read_summary(results.directory / "summary.json")
    moving = options.animation or output.suffix.lower() in _MOVING
    steps = _steps(results, options, moving)
    if not one_file:
        results.check_history()
    # bodies first, since what cannot be drawn of them is found before a file is written
    drawn = [path for field in fields for path in _draw_bodies(results, field, steps, options, output, moving)]
    return drawn if one_file else _curves(results, output) + drawn


def draw_modes(folder: Path, frequencies: np.ndarray, rigid: int) -> list[Path]:
    """Draw a picture of each elastic mode in a folder of `parsolid modes`; their paths.

    frequencies (k,) [Hz], rigid modes first; rigid: their number. Raises SceneError before anything is drawn.
    """
    _check_packages()
    from parsolid.commands.plot.sheets import Look, Sheet, write_singles

    results, numbers = Results(folder), list(range(rigid, len(frequencies)))
    if results.dimension == 3:
        _check_renderer()
    sheet = Sheet(results, "displacement", numbers, Look())
    sheet.labels = [f"mode {number + 1}, {frequencies[number]:.5g} Hz" for number in numbers]
    (folder / FOLDER).mkdir(exist_ok=True)
    try:
        return write_singles(sheet, folder / FOLDER, names=[f"mode-{number + 1}" for number in numbers])
    finally:
        sheet.close()


def standard(directory: Path | str) -> list[Path]:
    """Draw the standard pictures of a run: energies, probes and a sheet of a few times; their paths."""
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    options = parser.parse_args([str(directory)])
    results = Results(directory)
    if results.particles <= STANDARD_PARTICLES:
        return draw(options)
    folder = results.directory / FOLDER
    folder.mkdir(exist_ok=True)
    return _curves(results, folder)


def _faults(results: Results, options: argparse.Namespace, output: Path, one_file: bool) -> list[str]:
    refuse_files(output=output.parent if one_file else output)
    faults = _unused(results, options, one_file and output.suffix.lower() in _MOVING)
    if len(options.up) != 1:
        faults.append(f"--up: expected one axis, X, Y or Z, found {describe(options.up)}")
    if options.times and options.every:
        faults.append("--times, --every: expected one of them, found both")
    if options.single and (one_file or options.animation):
        faults.append(f"--single: expected a folder as output and no animation, found {describe(str(output))}")
    if options.animation and output.suffix.lower() in _STILL:
        faults.append(f"--animation: expected a name that ends in .gif or .mp4, found {describe(output.name)}")
    if any(axis >= results.dimension for axis in options.along[:1]) or len(options.along) > 1:
        faults.append(f"--along: expected one axis of {results.dimension} dimensions, found {describe(options.along)}")
    of_bodies = options.animation or output.suffix.lower() in _MOVING or options.single
    if of_bodies and (results.dimension == 1 or options.along):
        faults.append("--animation, --single: expected a scene in 2-D or 3-D and no --along, found otherwise")
    if options.clip and options.slice:
        faults.append("--clip, --slice: expected one of them, found both")
    for name, plane in (("--clip", options.clip), ("--slice", options.slice)):
        least = max(2 if name == "--clip" else 3, "XYZ".index(plane[0].upper()) + 1) if plane else 0
        if plane and ((results.dimension or 0) < least or options.along):
            faults.append(f"{name}: expected bodies of {least} dimensions and no --along, found {results.dimension}")
    if not one_file and output.suffix and not output.is_dir():
        endings = ", ".join(_STILL + _MOVING)
        faults.append(f"--output: expected a folder or a name that ends in {endings}, found {describe(output.name)}")
    if options.colours is not None:
        from matplotlib import colormaps

        if options.colours not in colormaps:
            near = suggestion(options.colours, colormaps)
            faults.append(f"--colours: expected a colour map of matplotlib, found {describe(options.colours)}{near}")
    return faults


def _unused(results: Results, options: argparse.Namespace, moving: bool) -> list[str]:
    """Faults of options that change nothing."""
    lines, moving = results.dimension == 1 or bool(options.along), moving or options.animation
    looks = ("view", "up", "range", "colours", "mirror", "only", "follow", "exaggerate", "columns", "title")
    cases = (
        (lines, looks, "a picture of bodies, without --along"),
        (results.dimension == 2 and not lines, ("view", "up"), "bodies in 3-D"),
        (moving or options.single, ("columns",), "a sheet of pictures"),
        (not moving, ("frames_per_second",), "an animation"),
    )
    standard = {"view": "iso", "up": (2,), "mirror": (), "follow": False, "exaggerate": 1.0}
    unused = [(name, why) for holds, names, why in cases if holds for name in names]
    given = [(name, why) for name, why in unused if getattr(options, name) != standard.get(name)]
    return [f"--{name.replace('_', '-')}: expected {why}, found otherwise" for name, why in given]


def pictured_fields(results: Results) -> list[str]:
    """Default fields of pictures: the first written of the method's `pictured_fields`, and von Mises stress."""
    names = results.field_names
    preferred = [name for method in results.methods for name in method.pictured_fields if name in names]
    von_mises = [name for name in _VON_MISES if name in names]
    return list(dict.fromkeys([*preferred[:1], *von_mises[:1]])) or names[:1]


def _steps(results: Results, options: argparse.Namespace, moving: bool) -> list[int]:
    if options.times:
        steps = results.steps_at(list(options.times))
        # a note on requested times without fields nearby
        near, stored = 0.02 * results.times[-1], results.times[steps]
        off = [f"{time:g}" for time in options.times if np.abs(stored - time).min() > near]
        if off:
            drawn = ", ".join(f"{results.times[step]:g}" for step in steps)
            print(f"note: no fields were written at {', '.join(off)} s; drawn are {drawn} s", file=sys.stderr)
        return steps
    count = len(results.times)
    if options.every or moving or options.single or count <= STANDARD_TIMES:
        return list(range(count))
    return [int(step) for step in np.linspace(0, count - 1, STANDARD_TIMES).round()]


def _curves(results: Results, folder: Path) -> list[Path]:
    from parsolid.commands.plot.curves import write_energies, write_forces, write_probes

    write_energies(results, folder / "energies.png")
    more = ((write_probes, folder / "probes.png"), (write_forces, folder / "forces.png"))
    return [folder / "energies.png", *(path for write, path in more if write(results, path))]


def _draw_bodies(
    results: Results, field: str, steps: list[int], options: Any, output: Path, moving: bool
) -> list[Path]:
    from parsolid.commands.plot.sheets import Look, Sheet, write_animation, write_sheet, write_singles

    if results.dimension == 1 or options.along:
        from parsolid.commands.plot.curves import write_lines

        path = output if output.suffix.lower() in _STILL else output / f"{field}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_lines(results, field, steps, path, options.size, options.along[0] if options.along else 0)
        return [path]
    if results.dimension == 3:
        _check_renderer()
    sheet = Sheet(results, field, steps, Look.of(options))
    try:
        if options.single:
            output.mkdir(parents=True, exist_ok=True)
            return write_singles(sheet, output, options.small)
        path = (
            output if output.suffix.lower() in _STILL + _MOVING else output / f"{field}{'.gif' if moving else '.png'}"
        )
        path.parent.mkdir(parents=True, exist_ok=True)
        if moving:
            write_animation(sheet, path, options.frames_per_second or 8.0)
        else:
            write_sheet(sheet, path, options.small)
        return [path]
    finally:
        sheet.close()


def _check_packages() -> None:
    """Raise SceneError if packages for drawing are not installed."""
    if missing():
        packages = "the packages of the extra 'plot' (pip install \"parsolid[plot]\")"
        raise SceneError([f"plot: expected {packages}, found no {' and no '.join(missing())}"])


def _check_renderer() -> None:
    """Raise SceneError without a display and without a library for off-screen drawing, because VTK would crash."""
    if not sys.platform.startswith("linux") or os.environ.get("DISPLAY"):
        return
    if not any(ctypes.util.find_library(name) for name in ("EGL", "OSMesa")):
        expected = "a display, libEGL or libOSMesa to draw with (Debian: apt install libegl1 libosmesa6)"
        raise SceneError([f"plot: expected {expected}, found none of them"])
