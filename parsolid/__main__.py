"""`python -m parsolid`."""

import sys

from parsolid.stopping import catch_early

catch_early(sys.argv[1:])

from parsolid.cli import main  # noqa: E402 (after the signals are caught: importing takes seconds)

sys.exit(main())
