"""`parsolid view`: interactive pictures of a run's bodies, in a window or in an HTML page.

This module imports no package for drawing, so that commands start fast.
"""

import argparse
from typing import Any

from parsolid.commands.plot import add_look_arguments


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `parsolid view`."""
    parser.add_argument("directory", metavar="DIR", help="folder of a run")
    page = "write a page for any browser, in one file that needs nothing else, instead of opening a window"
    parser.add_argument("--html", metavar="FILE", help=page)
    parser.add_argument("--field", metavar="NAME", help="what colours the bodies (default: as plot does)")
    add_look_arguments(parser)


def run_view(comm: Any, options: argparse.Namespace) -> int:
    """Open a window or write the page on rank 0; exit status 0. Collective.

    Raises SceneError on all ranks for faulty options or a faulty folder, OutputError for a page that cannot be written.
    """
    from parsolid.commands.plot import on_first_rank

    def show() -> None:
        from parsolid.commands.view.showing import show

        show(options)

    return on_first_rank(comm, show)
