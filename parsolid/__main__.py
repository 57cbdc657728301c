"""`python -m parsolid`."""

import sys

from parsolid.simulation.signals import catch_early, hold

catch_early(sys.argv[1:])

from parsolid.commands.cli import main  # noqa: E402 (after the signals are caught: importing takes seconds)

status = main()
# Python takes handlers back before it ends
hold()
sys.exit(status)
