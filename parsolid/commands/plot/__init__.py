"""`parsolid plot`: the history of a run as curves, its bodies coloured by a field.

This module imports no package for drawing, so that commands start fast.
"""

import argparse
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from parsolid.commands.arguments import positive, whole_number

FOLDER = "pictures"
# limits of the standard pictures: number of times, and number of particles for pictures of bodies
STANDARD_TIMES, STANDARD_PARTICLES = 8, 1_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `parsolid plot`."""
    parser.add_argument("directory", metavar="DIR", help="folder of a run")
    one = "one picture (.png, .pdf, .svg, .gif, .mp4) or a folder (default: DIR/pictures)"
    parser.add_argument("-o", "--output", metavar="OUT", help=one)
    parser.add_argument("--field", metavar="NAME", help="colour of the bodies, such as velocity_x (default: pressure)")
    parser.add_argument("--times", type=_times, metavar="T1,T2,...", help="stored times near these [s] (default a few)")
    parser.add_argument("--every", action="store_true", help="all times at which fields were written")
    parser.add_argument("--single", action="store_true", help="one picture for each time instead of one sheet")
    parser.add_argument("--animation", action="store_true", help="an animation of all times: .gif, or .mp4 with ffmpeg")
    parser.add_argument("--frames-per-second", type=_rate, metavar="N", help="of animations (default 8)")
    add_look_arguments(parser)
    parser.add_argument("--along", type=axes, default=(), metavar="AXIS", help="values over one coordinate, no bodies")
    parser.add_argument("--follow", action="store_true", help="centre each picture on the bodies")
    parser.add_argument("--exaggerate", type=positive, default=1.0, metavar="N", help="factor on the displacements")
    parser.add_argument("--small", action="store_true", help="256 colours only, for a third of the bytes")
    parser.add_argument("--columns", type=whole_number, metavar="N", help="pictures side by side on a sheet")
    parser.add_argument("--size", type=_size, metavar="WxH", help="of a picture, in pixels")
    parser.add_argument("--title", metavar="TEXT", help="above the sheet")


def add_look_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that `plot` and `view` share."""
    view = "iso, front, side, top, below or the direction towards the viewer, such as --view=1,-2,0.5"
    parser.add_argument("--view", type=direction, default="iso", help=view)
    parser.add_argument("--up", type=axes, default=(2,), metavar="AXIS", help="vertical axis: X, Y or Z (default)")
    colours = "limits of the colours, in SI units, such as --range=-2e6,2e6"
    parser.add_argument("--range", type=limits, metavar="LO,HI", help=colours)
    parser.add_argument("--colours", metavar="MAP", help="colour map of matplotlib (default: by the field)")
    mirror = "also show the images in the planes X = 0, Y = 0, Z = 0 of these axes, such as XZ"
    parser.add_argument("--mirror", type=axes, default=(), metavar="AXES", help=mirror)
    clip = "show one side of a plane of the reference (X) or present (x) configuration, such as 'Y > 0'"
    parser.add_argument("--clip", type=cut_plane("<>"), metavar="PLANE", help=clip)
    section = "show a section of bodies in 3-D, such as 'Y = 0'"
    parser.add_argument("--slice", type=cut_plane("="), metavar="PLANE", help=section)
    parser.add_argument("--only", metavar="NAMES", help="draw only these bodies, by name or index: rod or 0,2")


def run_plot(comm: Any, options: argparse.Namespace) -> int:
    """Draw the pictures of a command line on rank 0; exit status 0. Collective.

    Raises SceneError on all ranks for faulty options or a faulty folder, OutputError for files that cannot be written.
    """

    def draw_all() -> None:
        from parsolid.commands.plot.command import draw

        for path in draw(options):
            print(path, flush=True)

    return on_first_rank(comm, draw_all)


def on_first_rank(comm: Any, draw: Callable[[], None]) -> int:
    """Draw on rank 0; exit status 0. Collective. Raises SceneError and OutputError on all ranks."""
    from parsolid.output.errors import OutputError, words
    from parsolid.scene import SceneError

    fault: Any = None
    if comm.rank == 0:
        try:
            draw()
        except SceneError as error:
            fault = (SceneError, error.faults)
        except OutputError as error:
            fault = (OutputError, str(error))
        except OSError as error:
            fault = (OutputError, f"cannot write the pictures: {words(error)}")
    fault = comm.bcast(fault)
    if fault is not None:
        raise fault[0](fault[1])
    return 0


def _numbers(text: str, count: int | None, expected: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if not numbers or count not in (None, len(numbers)) or not all(abs(number) < float("inf") for number in numbers):
        raise argparse.ArgumentTypeError(f"expected {expected}, found {text!r}")
    return numbers


def _rate(text: str) -> float:
    if not 0.01 <= (rate := positive(text)) <= 100.0:
        raise argparse.ArgumentTypeError(f"expected a number from 0.01 to 100, found {text!r}")
    return rate


def _times(text: str) -> tuple[float, ...]:
    return _numbers(text, None, "times [s] separated by commas")


def limits(text: str) -> tuple[float, ...]:
    """Two rising numbers of the command line."""
    numbers = _numbers(text, 2, "two numbers LO,HI with LO < HI")
    if not numbers[0] < numbers[1]:
        raise argparse.ArgumentTypeError(f"expected two numbers LO,HI with LO < HI, found {text!r}")
    return numbers


def direction(text: str) -> str | tuple[float, ...]:
    """The name of a view, or the direction towards the viewer."""
    if text in ("iso", "front", "side", "top", "below"):
        return text
    numbers = _numbers(text, 3, "iso, front, side, top, below or three numbers x,y,z")
    if not any(numbers):
        raise argparse.ArgumentTypeError(f"expected a direction that is not zero, found {text!r}")
    return numbers


def axes(text: str) -> tuple[int, ...]:
    """Indices of the axes that letters name."""
    if not text or len(set(text.upper())) != len(text) or not set(text.upper()) <= set("XYZ"):
        raise argparse.ArgumentTypeError(f"expected axes such as X or XZ, found {text!r}")
    return tuple("XYZ".index(letter) for letter in text.upper())


def cut_plane(signs: str) -> Callable[[str], tuple[str, str, float]]:
    """A function that parses "X > 0" to ("X", ">", 0.0), with one of the given signs."""

    def read(text: str) -> tuple[str, str, float]:
        match = re.fullmatch(rf"\s*([XYZxyz])\s*([{signs}])\s*([-+.\deE]+)\s*", text)
        if match is not None:
            with suppress(ValueError):
                return match[1], match[2], float(match[3])
        expected = " or ".join(f"'X {sign} 0.1'" for sign in signs)
        raise argparse.ArgumentTypeError(f"expected a plane such as {expected}, found {text!r}")

    return read


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and 50 <= int(width) <= 16000 and 50 <= int(height) <= 16000):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT from 50x50 to 16000x16000 pixels, found {text!r}")
    return int(width), int(height)
