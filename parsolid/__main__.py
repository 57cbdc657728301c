"""`python -m parsolid`."""

import sys

from parsolid.cli import main

sys.exit(main())
