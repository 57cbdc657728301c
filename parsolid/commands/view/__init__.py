"""`parsolid view`: a run's bodies in a window, or in a page that turns in a browser.

Light to import: what draws is loaded when it is needed.
"""

import argparse
from typing import Any

from parsolid.commands.plot import axes, cut_plane, direction, limits


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `parsolid view`."""
    parser.add_argument("directory", metavar="DIR", help="folder of a run")
    page = "write a page for any browser, in one file that needs nothing else, instead of opening a window"
    parser.add_argument("--html", metavar="FILE", help=page)
    parser.add_argument("--field", metavar="NAME", help="what colours the bodies (default: as plot does)")
    parser.add_argument("--view", type=direction, default="iso", help="where it is seen from at first, as for plot")
    parser.add_argument("--up", type=axes, default=(2,), metavar="AXIS", help="upright in space: X, Y or Z (default)")
    parser.add_argument("--range", type=limits, metavar="LO,HI", help="of the colours, in SI units")
    parser.add_argument("--colours", metavar="MAP", help="colour map of matplotlib (default: by the field)")
    mirror = "also show the images in the planes X = 0, Y = 0, Z = 0 of these axes, such as XZ"
    parser.add_argument("--mirror", type=axes, default=(), metavar="AXES", help=mirror)
    parser.add_argument("--clip", type=cut_plane("<>"), metavar="PLANE", help="as for plot, such as 'Y > 0'")
    parser.add_argument("--slice", type=cut_plane("="), metavar="PLANE", help="as for plot, such as 'Y = 0'")
    parser.add_argument("--only", metavar="NAMES", help="these bodies alone, by name or number")


def run_view(comm: Any, options: argparse.Namespace) -> int:
    """Open a window, or write the page, on rank 0; exit status 0. Collective.

    Raises SceneError on all ranks for options or a folder that will not do, OutputError for a page that cannot be
    written.
    """
    from parsolid.commands.plot import on_first_rank

    def show() -> None:
        from parsolid.commands.view.showing import show

        show(options)

    return on_first_rank(comm, show)
