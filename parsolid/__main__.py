"""`python -m parsolid`; without arguments it runs the example, where `parsolid` tells what there is."""

import sys

from parsolid.simulation.signals import catch_early, hold

catch_early(sys.argv[1:])

from parsolid.commands.cli import main  # noqa: E402 (after the signals are caught: importing takes seconds)

status = main(sys.argv[1:] or ["run"])
# Python takes handlers back before it ends
hold()
sys.exit(status)
